"""Spaces: names, embedding, charts."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.spaces import Space

kinds = st.lists(st.booleans(), min_size=1, max_size=6).map(tuple)
numbers = st.floats(-50.0, 50.0)


# Shape checks draw random numbers, which hypothesis forbids while it draws: spaces are made in the tests.
cases = kinds.flatmap(lambda kind: st.tuples(st.just(kind), *(st.tuples(*(numbers for _ in kind)) for _ in "01")))


def unpack(case):
    """A space and two configurations in it."""
    kind, q0, q1 = case
    return Space(kind), np.array(q0), np.array(q1)


@given(kind=kinds)
def test_a_space_is_read_back_from_its_name(kind):
    assert Space.parse(str(Space(kind))) == Space(kind)


@pytest.mark.parametrize(
    ("text", "name", "kind"),
    [
        ("R1", "R1", (False,)),
        ("T2", "T2", (True, True)),
        ("R1 T1", "R1 T1", (False, True)),
        ("T1 R2 T1", "T1 R2 T1", (True, False, False, True)),
        ("T1 T1  R1", "T2 R1", (True, True, False)),
        ("R12 T1", "R12 T1", (False,) * 12 + (True,)),
    ],
)
def test_factors_stand_in_the_order_of_the_coordinates(text, name, kind):
    space = Space.parse(text)
    assert space.is_angle == kind
    assert str(space) == name


@pytest.mark.parametrize(
    "text", ["", " ", "X1", "R", "1R", "R0", "T-1", "r1", "R1,T1", "R1T1", "R1.5", "R²", "R٣", "R65", "T" + "9" * 5000]
)
def test_what_is_no_space_is_refused(text):
    with pytest.raises(ValueError, match="must be factors R<n> and T<m>"):
        Space.parse(text)


@pytest.mark.parametrize("kind", [(), (True,) * 65])
def test_a_space_has_a_sensible_number_of_coordinates(kind):
    with pytest.raises(ValueError, match="must have 1 to 64 coordinates"):
        Space(kind)


@given(kind=kinds)
def test_sizes_count_one_for_a_length_and_two_for_an_angle(kind):
    space = Space(kind)
    assert space.size == len(kind)
    assert space.embedded_size == len(kind) + sum(kind)
    assert sorted([*space.angles, *space.lengths]) == list(range(len(kind)))
    assert space.embed(jnp.zeros(space.size)).shape == (space.embedded_size,)


def test_the_embedding_has_all_lengths_then_all_cosines_then_all_sines():
    q = jnp.array([0.3, 5.0, -1.2, 7.0])
    expected = [5.0, 7.0, np.cos(0.3), np.cos(-1.2), np.sin(0.3), np.sin(-1.2)]
    assert Space.parse("T1 R1 T1 R1").embed(q) == pytest.approx(expected)


@given(case=cases, turns=st.integers(-3, 3))
def test_a_turn_changes_no_embedding_but_moves_a_length(case, turns):
    space, q, _ = unpack(case)
    moved = q + 2 * np.pi * turns
    error = np.abs(space.embed(jnp.asarray(moved)) - space.embed(jnp.asarray(q)))
    angles = len(space.angles)
    lengths, circles = np.split(error, [space.size - angles])
    assert lengths == pytest.approx(abs(2 * np.pi * turns))
    assert circles == pytest.approx(0.0, abs=1e-12)


@given(case=cases)
def test_projection_undoes_the_embedding_up_to_whole_turns(case):
    space, q, _ = unpack(case)
    back = space.project(space.embed(jnp.asarray(q)))
    assert space.difference(back, jnp.asarray(q)) == pytest.approx(0.0, abs=1e-12)


@given(case=cases, radius=st.floats(0.1, 10.0))
def test_projection_takes_the_nearest_point_of_the_circle(case, radius):
    space, q, _ = unpack(case)
    embedding = space.embed(jnp.asarray(q))
    stretched = jnp.where(jnp.arange(space.embedded_size) < len(space.lengths), embedding, radius * embedding)
    assert space.difference(space.project(stretched), jnp.asarray(q)) == pytest.approx(0.0, abs=1e-12)


@given(case=cases)
def test_wrapping_keeps_the_configuration_and_brings_angles_near_zero(case):
    space, q, _ = unpack(case)
    wrapped = np.asarray(space.wrap(jnp.asarray(q)))
    turns = (wrapped - q) / (2 * np.pi)
    assert wrapped[space.lengths] == pytest.approx(q[space.lengths], abs=0)
    assert turns == pytest.approx(np.round(turns), abs=1e-12)
    assert np.all(np.abs(wrapped[space.angles]) <= np.pi + 1e-12)


@given(case=cases)
def test_a_difference_leads_from_one_configuration_to_the_other(case):
    space, q0, q1 = unpack(case)
    step = space.difference(jnp.asarray(q1), jnp.asarray(q0))
    assert space.embed(jnp.asarray(q0) + step) == pytest.approx(np.asarray(space.embed(jnp.asarray(q1))), abs=1e-12)
    assert np.all(np.abs(step[space.angles]) <= np.pi + 1e-12)
    back = space.difference(jnp.asarray(q0), jnp.asarray(q1))
    half_turn = np.asarray(space.is_angle) & (np.abs(np.abs(step) - np.pi) < 1e-9)
    assert np.where(half_turn, 0.0, step + back) == pytest.approx(0.0, abs=1e-12)


def test_differences_of_angles_go_the_short_way():
    assert Space.parse("T1 R1").difference(jnp.array([3.0, 3.0]), jnp.array([-3.0, -3.0])) == pytest.approx(
        [6.0 - 2 * np.pi, 6.0]
    )


def test_a_space_is_static_in_compiled_functions():
    space = Space.parse("T1 R1")
    assert jax.tree.leaves(space) == []
    batch = jax.jit(jax.vmap(space.embed))(jnp.ones((5, 2)))
    assert batch.shape == (5, 3)
    assert hash(space) == hash(Space.parse("T1 R1"))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_charts_keep_the_precision(dtype):
    space, q = Space.parse("R1 T1"), jnp.ones(2, dtype)
    for result in (space.embed(q), space.wrap(q), space.difference(q, q), space.project(space.embed(q))):
        assert result.dtype == dtype

"""Targets that leave coordinates free: reaction wheels, arms and carts that need not come to rest anywhere."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.control import (
    CollocatedPump,
    EnergyPump,
    Handover,
    Loop,
    Regulator,
    attraction,
    choose_method,
    design,
    indifferent,
    judge,
    run_episodes,
)
from symoden.control._attraction import _ellipsoids
from symoden.control._free import way_from
from symoden.control._motion import velocity_field
from symoden.control._pumps import is_direct, swung_terms
from symoden.known import KnownParts
from symoden.mechanics import AbstractPortHamiltonian, potential
from symoden.models import ModelConfig, build
from symoden.spaces import Space

from .conftest import ACROBOT, CART_POLE, FULL_CART_POLE, PENDULUM, rate_of

UP = [np.pi, np.nan]


def wheel_pendulum(relative=True):
    """A pendulum whose reaction wheel gives 0.12 N m against a weight of 0.9 N m; q2 is measured from it, or not."""
    own = 6e-4
    parts = KnownParts(
        mass_matrix=[[0.03 + own, own], [own, own]] if relative else [[0.03, 0], [0, own]],
        potential_energy="-0.9*cos(q1)",
        input_matrix=[[0], [1]] if relative else [[-1], [1]],
        dissipation_matrix=[["1e-3 + 2e-3/sqrt(v1**2 + 1e-2)", 0], [0, 2e-5]],
    )
    plant = build(ModelConfig(), Space.parse("T2"), 1, known=parts, key=jax.random.key(0))
    assert isinstance(plant, AbstractPortHamiltonian)
    return plant


WHEEL = wheel_pendulum()


@pytest.fixture(scope="module")
def upright():
    return design(WHEEL, UP, limits=0.12)


def test_a_reaction_wheel_swings_its_pendulum_up_from_anywhere(upright):
    assert isinstance(upright, Handover)
    assert isinstance(upright.far, EnergyPump)
    q0 = np.random.default_rng(0).uniform(-np.pi, np.pi, (12, 2))
    episodes = run_episodes(WHEEL, upright, q0, 0 * q0, Loop(duration=12.0, period=0.01, step=0.01))
    assert judge(episodes, WHEEL.space, np.asarray(UP)).success.all()
    assert np.abs(np.asarray(episodes.q[:, -1, 1])).max() > 10 * np.pi  # Wherever the wheel is then.


def test_what_is_free_changes_no_input(upright):
    rng = np.random.default_rng(0)
    for _ in range(20):
        q, v, turn = rng.uniform(-4, 4, 2), rng.uniform(-3, 3, 2), rng.uniform(-50, 50)
        for controller in (upright, upright.near):
            there, elsewhere = (controller(jnp.asarray(each), jnp.asarray(v)) for each in (q, q + np.array([0, turn])))
            np.testing.assert_allclose(there, elsewhere, atol=1e-12)


def test_however_fast_a_free_coordinate_is_most_of_the_limits_is_left_for_the_others(upright):
    near = upright.near
    fastest = float(near.fastest[1])
    assert np.isinf(near.fastest[0])
    assert float(near.limits[0] * 0.3) == pytest.approx(fastest * abs(float(near.gain[0, 3])))
    at = jnp.array([np.pi, 0.0])
    fast, faster = (near(at, jnp.array([0.0, share * fastest])) for share in (1.0, 100.0))
    assert float(fast[0]) == float(faster[0])
    assert abs(float(near(at, jnp.array([0.0, 0.5 * fastest]))[0])) == pytest.approx(0.5 * abs(float(fast[0])))


def test_where_the_wheel_is_measured_from_changes_nothing(upright):
    outside = design(wheel_pendulum(relative=False), UP, limits=0.12)
    q, v = jnp.array([1.0, 0.0]), jnp.array([2.0, 5.0])
    np.testing.assert_allclose(outside(q, v + jnp.array([0.0, v[0]])), upright(q, v), rtol=1e-6)


@pytest.mark.parametrize("relative", [True, False])
def test_the_energy_of_the_swung_angle_changes_by_its_own_forces_alone(relative):
    rng, model = np.random.default_rng(0), wheel_pendulum(relative)
    for _ in range(20):
        q, v, u = (jnp.asarray(rng.uniform(-3, 3, size)) for size in (2, 2, 1))
        inertia, g, drag = swung_terms(model, q, v, 0)
        _, (rate, _) = velocity_field(model, q, v, u)
        slope = jax.grad(potential, argnums=1)(model, q)[0]
        assert float(inertia * rate) == pytest.approx(float(g * u[0] - drag - slope), rel=1e-9, abs=1e-12)


def test_a_pump_is_for_one_angle_that_its_input_moves_everywhere_alike():
    assert is_direct(WHEEL, jnp.array(UP))
    assert is_direct(PENDULUM, jnp.zeros(1))
    assert not is_direct(CART_POLE, jnp.array([jnp.nan, 0.0]))  # At a level pole the cart does nothing.
    assert not is_direct(WHEEL, jnp.zeros(2))
    with pytest.raises(ValueError, match="got 2 coordinates, 1 inputs"):
        EnergyPump.of(WHEEL, [np.pi, 0.0], limits=1.0)


def test_a_cart_that_may_be_anywhere_balances_its_pole():
    controller = design(CART_POLE, [np.nan, 0.0], method="lqr", limits=15.0, period=0.01)
    q0 = np.stack([np.linspace(-40, 40, 9), np.linspace(-0.5, 0.5, 9)], axis=1)
    episodes = run_episodes(CART_POLE, controller, q0, 0 * q0, Loop(duration=6.0, period=0.01, step=0.01))
    assert judge(episodes, CART_POLE.space, np.array([np.nan, 0.0])).success.all()
    assert isinstance(controller, Regulator)
    assert attraction(CART_POLE, controller) > 0


def test_states_are_drawn_along_what_counts_and_faster_than_that():
    regulator = Regulator.of(WHEEL, UP, limits=0.12)
    levels, q0, v0 = _ellipsoids(regulator, seed=0)
    assert not q0[:, 1].any()
    fast = np.abs(v0[:, 1]) > float(regulator.fastest[1])
    assert 0.1 < fast.mean() < 1
    costs = jax.vmap(regulator.desired_energy)(jnp.asarray(q0), jnp.asarray(v0))
    np.testing.assert_allclose(np.asarray(costs)[~fast], np.repeat(levels, 48)[~fast], rtol=1e-6)


def test_nothing_is_asked_of_what_is_free():
    space = Space.parse("T1 R1")
    q = jnp.asarray(np.random.default_rng(0).uniform(-9, 9, 2))
    away = way_from(jnp.array([1.0, jnp.nan]), space, q)
    assert float(away[0]) == pytest.approx(float(space.difference(q, jnp.array([1.0, 0.0]))[0]))
    assert float(away[1]) == 0
    assert np.isfinite(jax.jacfwd(lambda q: way_from(jnp.array([1.0, jnp.nan]), space, q))(q)).all()


@pytest.mark.parametrize(
    ("model", "target", "method", "message"),
    [
        (
            CART_POLE,
            [0.0, np.nan],
            None,
            r"depends on coordinate 2",
        ),
        (CART_POLE, [np.nan, np.nan], None, "at least one coordinate; all were left free"),
        (CART_POLE, [np.nan, 0.0], "ida-pbc", "'ida-pbc' needs a place for each coordinate"),
        (ACROBOT, [np.nan, 0.0], "lqr", "depends on coordinate 1"),
    ],
)
def test_what_cannot_be_left_free_is_refused(model, target, method, message):
    with pytest.raises(ValueError, match=message):
        design(model, target, method=method, limits=15.0)


def test_a_swing_up_that_would_have_to_be_planned_is_refused(monkeypatch):
    monkeypatch.setattr("symoden.control._design.is_direct", lambda *_: False)
    monkeypatch.setattr("symoden.control._design._rides", lambda *_: False)
    with pytest.raises(ValueError, match="motions are planned to whole configurations"):
        design(WHEEL, UP, method="swing-up", limits=0.12)


def test_the_cost_to_go_falls_near_the_target_while_free_speeds_count_in_full(upright):
    near, rng = upright.near, np.random.default_rng(0)
    for _ in range(20):
        e, v = 0.01 * rng.uniform(-1, 1, 2), rng.uniform(-1, 1, 2) * [0.03, 0.5 * float(near.fastest[1])]
        rate, _ = rate_of(WHEEL, near, np.array([np.pi, 0.0]) + e, v)
        assert rate < 0


def test_two_wheels_together_get_no_more_than_the_share_of_the_limits():
    parts = KnownParts(
        mass_matrix=[[0.03, 0, 0], [0, 6e-4, 0], [0, 0, 9e-4]],
        potential_energy="-0.9*cos(q1)",
        input_matrix=[[-1, -1], [1, 0], [0, 1]],
        dissipation_matrix=np.diag([1e-3, 2e-5, 3e-5]).tolist(),
    )
    plant = build(ModelConfig(), Space.parse("T3"), 2, known=parts, key=jax.random.key(0))
    regulator = Regulator.of(plant, [np.pi, np.nan, np.nan], limits=0.12)
    fast = jnp.array([0.0, 1e3, 1e3])
    for signs in ([1.0, 1.0, 1.0], [1.0, 1.0, -1.0]):
        u = -regulator.gain @ regulator.deviation(jnp.array([np.pi, 0.0, 0.0]), fast * jnp.array(signs))
        assert np.abs(u).max() <= 0.3 * 0.12 + 1e-9


def spring_cart(stiffness, effect="1"):
    """A cart on a spring, or on a hill, with a pole."""
    parts = KnownParts(
        mass_matrix=[[1, "cos(q2)/4"], ["cos(q2)/4", "1/6"]],
        potential_energy=f"{stiffness}*q1**2 + 2.45*cos(q2)",
        input_matrix=[[effect], [0]],
        dissipation_matrix=[[0.1, 0], [0, 0.05]],
    )
    plant = build(ModelConfig(), Space.parse("R1 T1"), 1, known=parts, key=jax.random.key(0))
    assert isinstance(plant, AbstractPortHamiltonian)
    return plant


@pytest.mark.parametrize(("stiffness", "effect"), [(50, "1"), (-20, "1"), (0, "1 + q1/2")])
def test_springs_and_inputs_that_differ_from_place_to_place_are_no_free_coordinate(stiffness, effect):
    assert indifferent(spring_cart(0), jnp.zeros(2)).tolist() == [True, False]
    assert indifferent(spring_cart(stiffness, effect), jnp.zeros(2)).tolist() == [False, False]
    with pytest.raises(ValueError, match="depends on coordinate 1"):
        design(spring_cart(stiffness, effect), [np.nan, 0.0], method="lqr", limits=15.0)


def test_a_cart_that_is_free_is_pumped_by_moving_it():
    controller = design(CART_POLE, [np.nan, 0.0], limits=15.0, period=0.01)
    assert isinstance(controller, Handover)
    assert isinstance(controller.far, CollocatedPump)
    q0 = np.stack([np.linspace(-9, 9, 6), np.linspace(-3, 3, 6)], axis=1)
    episodes = run_episodes(CART_POLE, controller, q0, 0 * q0, Loop(duration=15.0, period=0.01, step=0.01))
    assert judge(episodes, CART_POLE.space, np.array([np.nan, 0.0])).success.all()


def test_a_regulator_is_chosen_where_no_swing_up_leaves_anything_free():
    assert choose_method(FULL_CART_POLE, [np.nan, 0.0], limits=15.0) == "lqr"
    assert choose_method(CART_POLE, [np.nan, 0.0], limits=15.0) == "swing-up"
    assert choose_method(WHEEL, UP, limits=0.12) == "swing-up"

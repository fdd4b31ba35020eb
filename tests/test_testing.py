"""Conformance checks: sound systems pass them, and each flaw is found by the check for it."""

import dataclasses
import re
from pathlib import Path
from typing import Any, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.core import Tracer

from symoden import testing
from symoden.mechanics import AbstractDynamics, AbstractMechanical
from symoden.spaces import Space
from symoden.systems import Acrobot, CartPole, LinkChain, Pendulum

SYSTEMS = [
    Pendulum(damping=0.1),
    Pendulum(upright=True, momenta=True),
    CartPole(pole_damping=0.05, fully_actuated=True),
    Acrobot(dampings=(0.2, 0.2)),
    LinkChain.of_rods(3, damping=0.1),
    dataclasses.replace(LinkChain.of_rods(2), actuated=(False, False)),
]


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda system: f"{type(system).__name__}-{system.inputs}")
def test_analytic_systems_pass_every_check(system):
    testing.check_all(system)


def test_a_system_in_single_precision_passes_by_its_own_tolerance():
    system = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), Acrobot(dampings=(0.2, 0.2)))
    assert testing.draw_samples(system).q.dtype == jnp.float32
    testing.check_all(system)


def test_samples_are_reproducible_and_begin_at_rest():
    first, again, other = (testing.draw_samples(CartPole(), seed=seed, count=9) for seed in (1, 1, 2))
    assert [batch.shape for batch in first] == [(9, 2), (9, 2), (9, 1)]
    assert all(np.array_equal(one, two) for one, two in zip(first, again, strict=True))
    assert not np.array_equal(first.q, other.q)
    assert not any(batch[0].any() for batch in first)


@final
class Flawed(AbstractMechanical):
    """Double pendulum of unit inertia with one flaw."""

    flaw: str = eqx.field(default="", static=True)
    momenta: bool = eqx.field(default=False, static=True)
    space: Space = eqx.field(default=Space((True, True)), static=True)
    inputs: int = eqx.field(default=1, static=True)

    def potential_energy(self, q):
        if self.flaw == "aperiodic":
            return 0.5 * q @ q
        if self.flaw == "kink":
            return jnp.sqrt(jnp.sin(q) @ jnp.sin(q))
        return -jnp.sum(jnp.cos(q))

    def mass_matrix(self, q):
        flawed = {"indefinite mass": [[1.0, 2.0], [2.0, 1.0]], "lopsided mass": [[2.0, 1.0], [0.0, 2.0]]}
        return jnp.array(flawed.get(self.flaw, [[2.0, 0.0], [0.0, 2.0]]), q.dtype)

    def inverse_mass_matrix(self, q):
        flawed = {
            "indefinite inverse": [[1.0, 2.0], [2.0, 1.0]],
            "lopsided inverse": [[0.5, 0.1], [0.0, 0.5]],
            "wrong inverse": [[1.0, 0.0], [0.0, 1.0]],
        }
        return jnp.array(flawed.get(self.flaw, [[0.5, 0.0], [0.0, 0.5]]), q.dtype)

    def input_matrix(self, q):
        dtype = jnp.float32 if self.flaw == "hard-coded precision" else q.dtype
        return jnp.ones((2, 2 if self.flaw == "inputs" else 1), dtype)

    def dissipation_matrix(self, q, v):
        flawed = {"active": [[-0.1, 0.0], [0.0, 0.1]], "lopsided friction": [[1.0, 0.5], [0.0, 1.0]]}
        if self.flaw == "size of friction":
            return jnp.eye(3, dtype=q.dtype)
        return jnp.array(flawed.get(self.flaw, [[0.1, 0.0], [0.0, 0.1]]), q.dtype)


@pytest.mark.parametrize(
    ("flaw", "check", "message"),
    [
        ("aperiodic", testing.check_periodicity, r"must be 2π-periodic in q\[0\]; it is off by .* at q = "),
        ("kink", testing.check_gradients, "must have finite derivatives by .*; not so .* at q = "),
        ("indefinite mass", testing.check_mass_matrix, "`mass_matrix` must be positive definite.* eigenvalue is -1"),
        ("lopsided mass", testing.check_mass_matrix, "`mass_matrix` must be symmetric"),
        ("indefinite inverse", testing.check_inverse_mass_matrix, "`inverse_mass_matrix` must be positive definite"),
        ("lopsided inverse", testing.check_inverse_mass_matrix, "`inverse_mass_matrix` must be symmetric"),
        ("wrong inverse", testing.check_inverse_mass_matrix, "must be the inverse of `mass_matrix`"),
        ("wrong inverse", testing.check_round_trip, r"`decode` must be the inverse of `encode` \(rates\)"),
        ("active", testing.check_dissipation_matrix, "must be positive semidefinite; its smallest eigenvalue is -0.1"),
        ("active", testing.check_power_balance, "Dissipated power must not be negative"),
        ("lopsided friction", testing.check_dissipation_matrix, "`dissipation_matrix` must be symmetric"),
        ("size of friction", testing.check_shapes, r"must have shape \(2, 2\) or \(4, 4\) and .*; got \(3, 3\)"),
        ("inputs", testing.check_shapes, r"`input_matrix` must have shape \(2, 1\).*; got \(2, 2\)"),
        ("hard-coded precision", testing.check_shapes, "`input_matrix` must have .* dtype float64; got .* float32"),
    ],
)
def test_a_flaw_is_found_and_named(flaw, check, message):
    check(Flawed())
    with pytest.raises(AssertionError, match=message):
        check(Flawed(flaw=flaw))


@pytest.mark.parametrize("flaw", ["aperiodic", "wrong inverse", "active", "lopsided friction"])
def test_all_checks_together_find_it_too(flaw):
    testing.check_all(Flawed())
    with pytest.raises(AssertionError):
        testing.check_all(Flawed(flaw=flaw))


def test_an_energy_that_does_not_fit_the_motion_is_found():
    class Leaky(Pendulum):  # pyright: ignore[reportGeneralTypeIssues]
        def vector_field(self, q, p, u):
            return 3 * p, -jnp.sin(q) + u

    with pytest.raises(AssertionError, match="Stored power must be supplied less dissipated power"):
        testing.check_power_balance(Leaky())


@final
class Mass(AbstractDynamics):
    """Unit mass on a line, no port-Hamiltonian system by its type, with one flaw."""

    flaw: str = eqx.field(default="", static=True)
    momenta: bool = eqx.field(default=False, static=True)
    space: Space = eqx.field(default=Space((False,)), static=True)
    inputs: int = eqx.field(default=1, static=True)

    def encode(self, q, rates):
        return jnp.concatenate([q, 0 * rates if self.flaw == "forgetful" else rates])

    def derivative(self, t, state, u):
        force = -2 * state[:1] if self.flaw == "plain" and not isinstance(state, Tracer) else -state[:1]
        return jnp.concatenate([self.double_in_batches(state[1:]) if self.flaw == "batch" else state[1:], force + u])

    def decode(self, state):
        return state[:1], state[1:]

    def observe(self, state):
        return jnp.sin(state) if self.flaw == "observation" else state

    def double_in_batches(self, v):
        @jax.custom_batching.custom_vmap
        def speed(v):
            return v

        speed.def_vmap(lambda size, batched, v: (2 * v, batched[0]))
        return speed(v)


def test_other_dynamics_are_checked_where_that_applies():
    testing.check_all(Mass())


@pytest.mark.parametrize(
    ("flaw", "message"),
    [
        ("forgetful", r"`decode` must be the inverse of `encode` \(rates\)"),
        ("observation", r"`observe` must give \(embed\(q\), rates\)"),
        ("plain", "The flow must be the same compiled and not"),
    ],
)
def test_flaws_of_other_dynamics_are_found(flaw, message):
    with pytest.raises(AssertionError, match=message):
        testing.check_all(Mass(flaw=flaw))


def test_the_batch_check_alone_finds_a_batch_that_differs():
    with pytest.raises(AssertionError, match="must be the same in a batch and alone"):
        testing.check_batching(Mass(flaw="batch"))


def test_the_system_of_the_documentation_passes_every_check():
    page = (Path(__file__).parents[1] / "docs" / "api" / "testing.md").read_text()
    (code,) = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    here: dict[str, Any] = {"__name__": "page"}
    exec(compile(code, "docs/api/testing.md", "exec"), here)
    flipped = dataclasses.replace(here["crane"], damping=-here["crane"].damping)
    with pytest.raises(AssertionError, match="dissipation_matrix"):
        testing.check_dissipation_matrix(flipped)

"""IDA-PBC: what the closed loop's energy does, whatever K and V_d are, and what it is with the conditions solved."""

from typing import Any

import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given

from symoden.control import IdaPbc, Loop, Regulator, judge, run_episodes
from symoden.control._expansion import Expansion
from symoden.control._linear_matching import LinearMatching
from symoden.control._matching import annihilator, unactuated
from symoden.known import KnownParts
from symoden.mechanics import friction_matrix
from symoden.models import ModelConfig, build, rescale
from symoden.spaces import Space
from symoden.systems import CartPole

from .conftest import ACROBOT, CART_POLE, FREE_CART_POLE, FULL_CART_POLE, rate_of

TOP = [np.pi, 0.0]
SOLVED = {"cart-pole": IdaPbc.of(CART_POLE, [0.0, 0.0], limits=15.0), "acrobot": IdaPbc.of(ACROBOT, TOP, limits=15.0)}


def anything(model, target, seed):
    """A controller that matches nothing: a random field near G⊥, a random V_d and random gains."""
    generator = np.random.default_rng(seed)
    space, goal = model.space, jnp.asarray(target)

    def expansion(constant):
        empty = Expansion(space=space, target=goal, coefficients=jnp.zeros((0, 0)), order=2)
        rest = 0.05 * generator.standard_normal((len(empty.degrees()) - 1, len(constant)))
        return eqx.tree_at(lambda e: e.coefficients, empty, jnp.asarray(np.concatenate([[constant], rest])))

    m = model.inputs
    return IdaPbc(
        model=model,
        target=goal,
        field=expansion(np.asarray(unactuated(model, goal))),
        shape=expansion(np.zeros(1)),
        ratio=jnp.asarray(generator.uniform(0.5, 2.0)),
        damping=jnp.eye(m) * generator.uniform(0.1, 2.0),
        reach=jnp.ones(space.size),
        limits=jnp.full(m, jnp.inf),
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("space", "inputs"), [("R1 T1", 1), ("T2", 1), ("T1 R1 T1", 2)])
def test_the_energy_changes_by_damping_friction_and_what_remains_unmatched(learned, space, inputs, seed):
    model = learned(space, inputs, seed)
    controller = anything(model, np.zeros(model.space.size), seed)
    q, v = (jnp.asarray(x) for x in np.random.default_rng(seed).uniform(-0.5, 0.5, (2, model.space.size)))
    K, M, g = controller.inertia(q), model.mass_matrix(q), model.input_matrix(q)
    w, row = controller.field(q), unactuated(model, q)
    rest, moving = controller.unmatched(q)
    along = (K @ w / (w @ K @ w)) @ v
    y, passive = g.T @ jnp.linalg.solve(M, K @ v), jnp.linalg.solve(M, K @ v)
    friction = passive @ friction_matrix(model, q, v) @ v
    left = row * (rest + moving * along**2) / (row @ row)
    expected = -y @ controller.damping @ y - friction - passive @ left
    assert rate_of(model, controller, q, v)[0] == pytest.approx(float(expected), rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_no_input_acts_along_the_annihilator(seed):
    generator = np.random.default_rng(seed)
    for n in (2, 3, 4):
        g = jnp.asarray(generator.standard_normal((n, n - 1)))
        row = annihilator(g)
        np.testing.assert_allclose(row @ g, 0, atol=1e-12)
        assert float(jnp.linalg.norm(row)) > 0.01


@pytest.mark.parametrize("name", SOLVED)
def test_in_its_region_the_conditions_are_solved_with_a_positive_energy(name):
    controller = SOLVED[name]
    found = controller.matching()
    assert found.rest < 1e-3
    assert found.moving < 1e-5
    shifts = np.random.default_rng(2).uniform(-1, 1, (200, 2)) * np.asarray(controller.reach)
    q = jnp.asarray(np.asarray(controller.target) + shifts)
    least = np.linalg.eigvalsh(np.asarray(jax.vmap(controller.inertia)(q)))[:, 0]
    assert least.min() > 0
    assert float(jax.vmap(controller.desired_potential)(q).min()) > 0
    np.testing.assert_allclose(jax.grad(controller.desired_potential)(controller.target), 0, atol=1e-9)


def test_what_remains_is_reported_where_it_is():
    solved = SOLVED["cart-pole"]
    bump = jnp.zeros_like(solved.shape.coefficients).at[-1].set(1.0)
    worse = eqx.tree_at(lambda c: c.shape.coefficients, solved, solved.shape.coefficients + bump)
    found = worse.matching()
    assert found.rest > 10 * solved.matching().rest
    at = abs(float(worse.unmatched(jnp.asarray(found.rest_q))[0]))
    elsewhere = abs(float(worse.unmatched(jnp.asarray([0.1, 0.1]))[0]))
    assert at > elsewhere


@given(x=st.floats(-0.5, 0.5), theta=st.floats(-0.75, 0.75), v=st.tuples(st.floats(-2, 2), st.floats(-2, 2)))
def test_without_friction_the_desired_energy_falls(x, theta, v):
    controller = eqx.tree_at(lambda c: c.limits, FREE, jnp.full(1, jnp.inf))
    rate, _ = rate_of(FREE_CART_POLE, controller, [x, theta], list(v))
    speed = float(np.linalg.norm(v))
    assert rate <= 2e-3 * speed + 1e-9  # What remains unmatched, at most 1e-3 of a load of 2.5 N m.


FREE = IdaPbc.of(FREE_CART_POLE, [0.0, 0.0])


@pytest.mark.parametrize(("name", "system", "size"), [("cart-pole", CART_POLE, 0.6), ("acrobot", ACROBOT, 0.05)])
def test_the_target_is_an_equilibrium_that_is_reached_within_the_limits(name, system, size):
    controller = SOLVED[name]
    np.testing.assert_allclose(controller(controller.target, jnp.zeros(2)), 0, atol=1e-9)
    share_q, share_v = np.random.default_rng(0).uniform(-1, 1, (2, 20, 2))
    q0 = np.asarray(controller.target) + share_q * np.where(system.space.is_angle, size, 0.5)
    episodes = run_episodes(system, controller, q0, 0.05 * share_v, Loop(duration=12.0, period=0.01))
    assert judge(episodes, system.space, np.asarray(controller.target)).success.all()
    assert float(jnp.abs(episodes.u).max()) <= 15.0


def test_an_angle_counts_modulo_a_turn():
    q, v = jnp.array([3.3, -0.2]), jnp.array([0.1, 0.3])
    turned = SOLVED["acrobot"](q + 2 * jnp.pi * jnp.array([1.0, -2.0]), v)
    np.testing.assert_allclose(turned, SOLVED["acrobot"](q, v), rtol=1e-9)


@pytest.mark.parametrize("beta", [0.2, 7.0])
def test_the_unit_of_momentum_changes_no_input(beta):
    parts = KnownParts(
        mass_matrix=[[1.0, "0.25*cos(q2)"], ["0.25*cos(q2)", 1 / 6]],
        potential_energy="2.45*cos(q2)",
        input_matrix=[[1], [0]],
        dissipation_matrix=[[0.1, 0], [0, 0.05]],
    )
    model: Any = build(ModelConfig(), CART_POLE.space, 1, known=parts, key=jax.random.key(0))
    q, v = jnp.array([0.1, 0.2]), jnp.array([0.2, -0.3])
    u, other = (IdaPbc.of(each, [0.0, 0.0])(q, v) for each in (model, rescale(model, beta)))
    np.testing.assert_allclose(u, other, rtol=1e-6)


@pytest.mark.parametrize("system_target", [(CART_POLE, [0.0, 0.0]), (ACROBOT, TOP)])
def test_the_linear_conditions_hold_and_cost_what_a_lyapunov_equation_says(system_target):
    system, target = system_target
    goal = jnp.asarray(target)
    linear = LinearMatching.of(system, goal, 15.0)
    w = linear.direction(0.7)
    gains = linear.cheapest(w)
    assert 1 <= gains.cost < 100
    np.testing.assert_allclose(gains.P @ w, linear.load, atol=1e-9)
    assert np.linalg.eigvalsh(gains.P).min() > 0
    field = Expansion(space=system.space, target=goal, coefficients=jnp.asarray(w)[None], order=0)
    shape = Expansion(space=system.space, target=goal, coefficients=jnp.zeros((1, 1)), order=0)
    controller = IdaPbc(
        model=system,
        target=goal,
        field=field,
        shape=shape,
        ratio=jnp.asarray(gains.ratio),
        damping=jnp.asarray(gains.damping),
        reach=jnp.ones(2),
        limits=jnp.full(1, jnp.inf),
    )
    K, M, g = (np.asarray(part(goal)) for part in (controller.inertia, system.mass_matrix, system.input_matrix))
    np.testing.assert_allclose(K @ w, linear.inertia, atol=1e-9)
    stiffness = -M @ linear.A[2:, :2]
    by_q = np.linalg.pinv(g) @ (stiffness - M @ np.linalg.solve(K, gains.P))
    F = np.concatenate([by_q, -gains.damping @ g.T @ np.linalg.solve(M, K)], axis=1)
    regulator = Regulator.of(system, goal, limits=15.0)
    Q, R = np.asarray(regulator.state_weight), np.asarray(regulator.input_weight)
    cost = scipy.linalg.solve_continuous_lyapunov((linear.A + linear.B @ F).T, -(Q + F.T @ R @ F))
    unit = np.linalg.inv(Q)
    assert gains.cost == pytest.approx(np.trace(cost @ unit) / np.trace(np.asarray(regulator.cost) @ unit), rel=1e-6)


@pytest.mark.parametrize(("name", "system"), [("cart-pole", CART_POLE), ("acrobot", ACROBOT)])
def test_near_the_target_it_is_the_linear_feedback_whose_cost_was_least(name, system):
    controller, rest = SOLVED[name], jnp.zeros(2)
    goal = controller.target
    linear = LinearMatching.of(system, goal, 15.0)
    P = np.asarray(jax.hessian(controller.desired_potential)(goal))
    np.testing.assert_allclose(P @ np.asarray(controller.field(goal)), linear.load, rtol=1e-6, atol=1e-8)
    K, M, g = (np.asarray(part(goal)) for part in (controller.inertia, system.mass_matrix, system.input_matrix))
    by_q, by_v = jax.jacfwd(controller, argnums=(0, 1))(goal, rest)
    wanted = np.linalg.pinv(g) @ (-M @ linear.A[2:, :2] - M @ np.linalg.solve(K, P))
    np.testing.assert_allclose(by_q, wanted, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(by_v, -np.asarray(controller.damping) @ g.T @ np.linalg.solve(M, K), rtol=1e-6)


def test_other_mechanisms_and_targets_are_refused():
    passive: Any = build(ModelConfig(), Space.parse("T1"), 0, key=jax.random.key(0))
    with pytest.raises(ValueError, match="has 2 coordinates and 2 inputs"):
        IdaPbc.of(FULL_CART_POLE, [0.0, 0.0])
    with pytest.raises(ValueError, match="has 1 coordinates and 0 inputs"):
        IdaPbc.of(passive, [0.0])
    with pytest.raises(ValueError, match=r"must be an equilibrium; at \[0.0, 0.3\]"):
        IdaPbc.of(CART_POLE, [0.0, 0.3])
    with pytest.raises(ValueError, match="proportional to the inertia there"):
        IdaPbc.of(CartPole(gravity=0.0), [0.0, 0.0])
    with pytest.raises(ValueError, match="with a smaller `reach`"):
        IdaPbc.of(CART_POLE, [0.0, 0.0], reach=1.6)

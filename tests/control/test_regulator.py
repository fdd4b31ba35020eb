"""The regulator: linearisation, Riccati equation, and where it is trusted."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from symoden.control import Loop, Regulator, attraction, linearize, run_episodes
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.systems import CartPole, Pendulum

from .conftest import ACROBOT, CART_POLE, PENDULUM


def test_a_pendulum_is_linearised_in_closed_form():
    A, B, hold = linearize(PENDULUM, jnp.zeros(1))
    np.testing.assert_allclose(A, [[0, 1], [15, -0.3]], atol=1e-12)
    np.testing.assert_allclose(B, [[0], [3]], atol=1e-12)
    np.testing.assert_allclose(hold, 0, atol=1e-12)


def test_what_holds_a_pendulum_aside_is_its_weight():
    _, _, hold = linearize(Pendulum(gravity=10.0), jnp.array([0.3]))
    np.testing.assert_allclose(hold, 5 * np.sin(0.3), rtol=1e-12)


@pytest.mark.parametrize("tip", [1e-3, 1e3])
def test_where_no_input_holds_all_of_it_the_constraint_that_is_left_is_least(tip):
    """Of all inputs; so the units of the coordinates have no say, and a light pole does not call for a great push."""
    cart_pole = CartPole(pole_mass=tip)
    q = jnp.array([0.2, 0.4])
    _, _, hold = linearize(cart_pole, q)
    M, g = (np.asarray(part(q)) for part in (cart_pole.mass_matrix, cart_pole.input_matrix))
    load = np.asarray(jax.grad(cart_pole.potential_energy)(q))
    weight = g.T @ np.linalg.inv(M)
    np.testing.assert_allclose(hold, np.linalg.solve(weight @ g, weight @ load), rtol=1e-6)


def test_momentum_data_give_the_same_regulator():
    gains = [
        Regulator.of(Pendulum(damping=0.1, momenta=momenta), [np.pi], limits=3.0).gain for momenta in (False, True)
    ]
    np.testing.assert_allclose(*gains, rtol=1e-9)


def test_the_gain_solves_the_riccati_equation():
    regulator = Regulator.of(CART_POLE, [0.0, 0.0], limits=15.0)
    A, B, _ = linearize(CART_POLE, jnp.zeros(2))
    P, Q, R = (np.asarray(x) for x in (regulator.cost, regulator.state_weight, regulator.input_weight))
    left = A.T @ P + P @ A - P @ B @ np.linalg.solve(R, B.T @ P) + Q
    np.testing.assert_allclose(left, 0, atol=1e-8 * np.abs(P).max())
    np.testing.assert_allclose(regulator.gain, np.linalg.solve(R, B.T @ P), rtol=1e-9)


@pytest.mark.parametrize("period", [0.02, 0.1])
def test_a_sampled_gain_stabilises_the_sampled_system(period):
    regulator = Regulator.of(CART_POLE, [0.0, 0.0], limits=15.0, period=period)
    A, B, _ = linearize(CART_POLE, jnp.zeros(2))
    both = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 5))]]) * period)
    closed = both[:4, :4] - both[:4, 4:] @ np.asarray(regulator.gain)
    assert np.abs(np.linalg.eigvals(closed)).max() < 1
    continuous = Regulator.of(CART_POLE, [0.0, 0.0], limits=15.0)
    assert np.abs(np.asarray(continuous.gain)).max() > np.abs(np.asarray(regulator.gain)).max()


def test_a_model_without_energy_is_regulated_too():
    model = build(ModelConfig(kind="naive", flow=(8,)), Space.parse("T1"), 1, key=jax.random.key(3))
    A, B, _ = linearize(model, jnp.zeros(1))
    assert A.shape == (2, 2)
    regulator = Regulator.of(model, [0.0], limits=10.0)
    assert np.linalg.eigvals(A - B @ np.asarray(regulator.gain)).real.max() < 0


def test_what_no_input_moves_is_refused():
    lame = CartPole(cart_mass=1e12)
    with pytest.raises(ValueError, match="cannot be stabilised"):
        Regulator.of(lame, [0.0, 0.0], limits=1.0)


def test_within_the_region_a_pendulum_is_caught_and_far_outside_it_is_not():
    regulator = Regulator.of(PENDULUM, [0.0], limits=2.0)
    level = attraction(PENDULUM, regulator)
    lower = np.linalg.cholesky(np.linalg.inv(np.asarray(regulator.cost)))
    angle = np.linspace(0, 2 * np.pi, 40)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ lower.T
    for factor, caught in ((0.99, True), (9.0, False)):
        q0, v0 = np.split(np.sqrt(factor * level) * circle, 2, axis=1)
        ends = run_episodes(PENDULUM, regulator, q0, v0, Loop(duration=6.0, period=0.01)).q[:, -1]
        assert bool((jnp.abs(ends) < 0.05).all()) == caught


def test_an_equilibrium_beside_the_target_within_the_tolerance_is_held():
    target = [np.pi + 0.001, 0.0]
    regulator = Regulator.of(ACROBOT, target, limits=15.0)
    assert attraction(ACROBOT, regulator) == pytest.approx(
        attraction(ACROBOT, Regulator.of(ACROBOT, [np.pi, 0.0], limits=15.0)), rel=0.3
    )

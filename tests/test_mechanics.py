"""The interface of analytic and learned systems, on a system whose every part is random."""

from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.mechanics import AbstractMechanical
from symoden.spaces import Space


@final
class RandomSystem(AbstractMechanical):
    """On R¹ × T¹, with two inputs, a mass matrix, a potential and friction that all depend on the configuration."""

    weights: jax.Array
    full: bool = eqx.field(static=True)
    momenta: bool = eqx.field(static=True)
    space: Space = eqx.field(default=Space((False, True)), static=True)
    inputs: int = eqx.field(default=3, static=True)

    def potential_energy(self, q):
        return jnp.sum(jnp.sin(self.weights[0, :3] * self.space.embed(q))) + 0.1 * q[0] ** 2

    def mass_matrix(self, q):
        L = jnp.diag(0.5 + jnp.cos(q[1:]) ** 2 @ jnp.ones((1, 2))) + jnp.tril(self.weights[1:3, :2], -1) * jnp.sin(q[1])
        return L @ L.T

    def inverse_mass_matrix(self, q):
        return jnp.linalg.inv(self.mass_matrix(q))

    def input_matrix(self, q):
        return self.weights[:2, :3] * jnp.cos(q[1])

    def dissipation_matrix(self, q, v):
        size = 4 if self.full else 2
        L = jnp.tril(self.weights[:size, :size]) * (1 + jnp.tanh(v[0]) ** 2) * jnp.sin(q[1] + 1)
        return L @ L.T


numbers = st.floats(-3.0, 3.0)
vectors = {n: st.lists(numbers, min_size=n, max_size=n).map(jnp.array) for n in (2, 3)}
weights = st.lists(st.floats(-1.0, 1.0), min_size=16, max_size=16).map(lambda ws: jnp.array(ws).reshape(4, 4))


@jax.jit
def balance(system, q, p, u):
    return system.power_balance(q, p, u)


@jax.jit
def flow(system, q, p, u):
    return system.vector_field(q, p, u)


@jax.jit
def trip(system, q, rates):
    state = system.encode(q, rates)
    return state, system.decode(state), system.observe(state)


@pytest.mark.parametrize("full", [False, True])
@given(weights=weights, q=vectors[2], p=vectors[2], u=vectors[3])
def test_energy_changes_only_through_port_and_friction(full, weights, q, p, u):
    system = RandomSystem(weights=weights, full=full, momenta=True)
    stored, supplied, dissipated = balance(system, q, p, u)
    q_dot, p_dot = flow(system, q, p, u)
    slope = jax.grad(system.hamiltonian, argnums=(0, 1))(q, p)
    assert float(stored) == pytest.approx(float(slope[0] @ q_dot + slope[1] @ p_dot), abs=1e-9, rel=1e-9)
    assert float(stored) == pytest.approx(float(supplied - dissipated), abs=1e-9, rel=1e-9)
    assert dissipated >= -1e-12


@given(weights=weights, q=vectors[2], p=vectors[2], u=vectors[3])
def test_velocities_are_inverse_mass_times_momenta_when_friction_acts_on_momenta(weights, q, p, u):
    system = RandomSystem(weights=weights, full=False, momenta=True)
    q_dot, _ = flow(system, q, p, u)
    assert q_dot == pytest.approx(np.linalg.solve(system.mass_matrix(q), p), abs=1e-9)


@given(weights=weights, q=vectors[2], p=vectors[2], u=vectors[3])
def test_momenta_change_by_the_written_out_equation(weights, q, p, u):
    system = RandomSystem(weights=weights, full=False, momenta=True)
    v = system.inverse_mass_matrix(q) @ p
    force = system.input_matrix(q) @ u - system.dissipation_matrix(q, v) @ v
    expected = force - jax.grad(system.hamiltonian)(q, p)
    assert flow(system, q, p, u)[1] == pytest.approx(np.asarray(expected), abs=1e-9)


@given(weights=weights, q=vectors[2], p=vectors[2], u=vectors[3])
def test_full_friction_acts_on_both_halves_of_the_gradient(weights, q, p, u):
    system = RandomSystem(weights=weights, full=True, momenta=True)
    slope = np.concatenate(jax.grad(system.hamiltonian, argnums=(0, 1))(q, p))
    J = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    D = np.asarray(system.dissipation_matrix(q, jnp.asarray(slope[2:])))
    port = np.concatenate([np.zeros(2), np.asarray(system.input_matrix(q) @ u)])
    assert np.concatenate(flow(system, q, p, u)) == pytest.approx((J - D) @ slope + port, abs=1e-9)


@given(weights=weights, q=vectors[2], p=vectors[2], u=vectors[3])
def test_output_times_input_is_the_power_of_the_generalized_forces(weights, q, p, u):
    system = RandomSystem(weights=weights, full=False, momenta=True)
    power = (system.input_matrix(q) @ u) @ (system.inverse_mass_matrix(q) @ p)
    assert float(system.output(q, p) @ u) == pytest.approx(float(power), abs=1e-9)


@pytest.mark.parametrize("momenta", [False, True])
@given(weights=weights, q=vectors[2], rates=vectors[2])
def test_measurements_survive_encoding(momenta, weights, q, rates):
    system = RandomSystem(weights=weights, full=False, momenta=momenta)
    state, (decoded, decoded_rates), observed = trip(system, q, rates)
    p = rates if momenta else system.mass_matrix(q) @ rates
    assert state == pytest.approx(np.concatenate([q, p]), abs=1e-9)
    assert decoded == pytest.approx(np.asarray(q), abs=0)
    assert decoded_rates == pytest.approx(np.asarray(rates), abs=1e-9)
    assert observed == pytest.approx(np.concatenate([system.space.embed(q), rates]), abs=1e-9)


def test_the_derivative_stacks_the_vector_field_and_ignores_time():
    system = RandomSystem(weights=jnp.ones((4, 4)), full=False, momenta=True)
    state, u = jnp.array([0.1, 0.2, 0.3, 0.4]), jnp.array([1.0, 2.0, 3.0])
    derivatives = [system.derivative(jnp.asarray(t), state, u) for t in (0.0, 5.0)]
    expected = np.concatenate(system.vector_field(state[:2], state[2:], u))
    for derivative in derivatives:
        assert derivative == pytest.approx(expected, abs=0)

"""The paper's embedded equations are ours, seen through the embedding."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.models import ModelConfig, build, embedded_vector_field
from symoden.spaces import Space
from symoden.systems import Acrobot, CartPole, Pendulum

ANALYTIC = [Pendulum(damping=0.3), CartPole(pole_damping=0.05, cart_damping=0.1), Acrobot(dampings=(0.2, 0.1))]


@eqx.filter_jit
def both(system, q, v, u):
    """The paper's equations; ours pushed forward by `observe`, that is by `embed` and by `decode`; terms' size."""
    p = system.mass_matrix(q) @ v
    state = jnp.concatenate([q, p])
    flow = system.derivative(jnp.zeros(()), state, u)
    embedded, pushed = jax.jvp(system.observe, (state,), (flow,))
    size = 1 + jnp.max(jnp.abs(system.inverse_mass_matrix(q))) * jnp.max(jnp.abs(flow))
    return embedded_vector_field(system, embedded, u), pushed, size


def compare(system, seed, spread):
    n = system.space.size
    q, v, u = np.split(spread * np.random.default_rng(seed).standard_normal(2 * n + system.inputs), [n, 2 * n])
    paper, ours, size = both(system, jnp.asarray(q), jnp.asarray(v), jnp.asarray(u))
    assert np.isfinite(ours).all()
    assert paper / size == pytest.approx(np.asarray(ours / size), abs=1e-9)


@pytest.mark.parametrize("name", ["joint", "viscous", "full", "frictionless", "unstructured", "unstructured-full"])
@given(seed=st.integers(0, 2**32 - 1), spread=st.floats(0.1, 4.0))
def test_a_model_moves_alike_in_embedded_and_canonical_coordinates(name, small_model, scrambled, seed, spread):
    compare(scrambled(small_model(name), seed), seed, spread)


@pytest.mark.parametrize("system", ANALYTIC, ids=lambda system: type(system).__name__)
@given(seed=st.integers(0, 2**32 - 1), spread=st.floats(0.1, 4.0))
def test_an_analytic_system_moves_alike_in_embedded_and_canonical_coordinates(system, seed, spread):
    compare(system, seed, spread)


def test_the_pendulum_swings_by_the_textbook_equation():
    system, angle, speed = Pendulum(damping=0.3), 0.7, 1.1
    state = jnp.array([np.cos(angle), np.sin(angle), speed])
    inertia = float(system.mass_matrix(jnp.zeros(1))[0, 0])
    slope = float(jax.grad(lambda q: system.potential_energy(q[None]))(jnp.asarray(angle)))
    acceleration = (0.5 - slope - 0.3 * speed) / inertia
    expected = [-np.sin(angle) * speed, np.cos(angle) * speed, acceleration]
    assert embedded_vector_field(system, state, jnp.array([0.5])) == pytest.approx(expected, abs=1e-12)


def test_momentum_data_have_no_velocities_to_embed():
    model: Any = build(ModelConfig(), Space.parse("T1"), 1, momenta=True, key=jax.random.key(0))
    with pytest.raises(ValueError, match="rates are momenta"):
        embedded_vector_field(model, jnp.ones(3), jnp.ones(1))


def test_an_embedded_state_of_another_length_is_refused():
    with pytest.raises(ValueError, match=r"`state` must have the shape \(3,\).* on T1; got \(2,\)"):
        embedded_vector_field(Pendulum(), jnp.ones(2), jnp.ones(1))
    with pytest.raises(ValueError, match=r"`u` must have the shape \(1,\), one number per input; got \(2,\)"):
        embedded_vector_field(Pendulum(), jnp.ones(3), jnp.ones(2))

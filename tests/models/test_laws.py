"""What every learned port-Hamiltonian model obeys before and after training: over random states and weights."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.integrate import RK4, rollout

MODELS = ["joint", "viscous", "full", "paper", "frictionless", "unstructured", "unstructured-full"]
seeds = st.integers(0, 2**32 - 1)


@eqx.filter_jit
def facts(model, q, v, u):
    """Matrices, powers, the size of the terms that cancel in them, and the motion one turn further."""
    M, M_inv = model.mass_matrix(q), model.inverse_mass_matrix(q)
    p = M @ v
    turn = jnp.where(np.asarray(model.space.is_angle), 2 * jnp.pi, 0.0)
    q_dot, p_dot = model.vector_field(q, p, u)
    return {
        "M": M,
        "M_inv": M_inv,
        "D": model.dissipation_matrix(q, v),
        "powers": model.power_balance(q, p, u),
        "flow": jnp.concatenate([q_dot, p_dot]),
        "turned": jnp.concatenate(model.vector_field(q + turn, p, u)),
        "energies": (model.hamiltonian(q, p), model.hamiltonian(q + turn, p)),
    }


def draw(model, seed, spread):
    n = model.space.size
    numbers = spread * np.random.default_rng(seed).standard_normal(2 * n + model.inputs)
    return tuple(jnp.asarray(part) for part in np.split(numbers, [n, 2 * n]))


@pytest.mark.parametrize("name", MODELS)
@given(seed=seeds, weights=st.floats(0.1, 3.0), spread=st.floats(0.01, 5.0))
def test_a_model_is_passive_periodic_and_has_inertia(name, small_model, scrambled, seed, weights, spread):
    model = scrambled(small_model(name), seed, weights)
    found = facts(model, *draw(model, seed, spread))
    M, M_inv, D = (np.asarray(found[key]) for key in ("M", "M_inv", "D"))
    for matrix in (M_inv, D):
        assert matrix == pytest.approx(matrix.T, rel=1e-12, abs=1e-12 * np.abs(matrix).max())
    assert np.linalg.eigvalsh(M_inv).min() > 0
    assert np.linalg.eigvalsh((M + M.T) / 2).min() > 0
    assert M @ M_inv == pytest.approx(np.eye(len(M)), abs=1e-12 * np.linalg.cond(M))
    assert np.linalg.eigvalsh(D).min() >= -1e-12 * np.abs(D).max()
    stored, supplied, dissipated = (float(power) for power in found["powers"])
    size = 1 + np.abs(found["flow"]).max() * (1 + abs(supplied) + abs(dissipated))
    assert stored / size == pytest.approx((supplied - dissipated) / size, abs=1e-9)
    assert dissipated >= -1e-12 * size
    here, there = (float(energy) for energy in found["energies"])
    assert there == pytest.approx(here, rel=1e-9, abs=1e-9)
    flow = np.asarray(found["flow"])
    assert np.asarray(found["turned"]) == pytest.approx(flow, abs=1e-9 * size)


@eqx.filter_jit
def energies(model, q, rates, ts, us, substeps):
    states = rollout(model, q, rates, ts, us, solver=RK4(substeps)).states
    n = model.space.size
    return eqx.filter_vmap(model.hamiltonian)(states[:, :n], states[:, n:])


@pytest.mark.parametrize("name", ["joint", "viscous", "full", "unstructured"])
@given(seed=seeds)
@settings(max_examples=20)
def test_a_rollout_without_input_only_loses_energy(name, small_model, scrambled, seed):
    model = scrambled(small_model(name), seed, 0.5)
    q, v, _ = draw(model, seed, 1.0)
    ts, us = 0.01 * jnp.arange(30.0), jnp.zeros((30, model.inputs))
    path = np.asarray(energies(model, q, v, ts, us, jnp.asarray(32)))  # Random friction is stiff.
    assert np.isfinite(path).all()
    assert np.diff(path).max() <= 1e-6 * (1 + np.abs(path).max())
    assert path[-1] < path[0]


@given(seed=seeds)
@settings(max_examples=10)
def test_energy_is_conserved_at_the_order_of_the_integrator(small_model, scrambled, seed):
    model = scrambled(small_model("frictionless"), seed, 0.5)
    q, v, _ = draw(model, seed, 1.0)
    ts, us = jnp.linspace(0.0, 1.0, 3), jnp.zeros((3, 0))
    drifts = [np.ptp(np.asarray(energies(model, q, v, ts, us, jnp.asarray(steps)))) for steps in (20, 160, 1280)]
    assert drifts[2] <= 1e-9 * (1 + drifts[0])
    if drifts[1] > 1e-11:  # above rounding
        assert np.log(drifts[0] / drifts[1]) / np.log(8) > 3.9

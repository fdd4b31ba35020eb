"""Solvers: order of convergence, substeps, tolerances, derivatives."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.integrate import HOLDS, RK4, DiffraxSolver, rollout
from symoden.systems import CartPole

SYSTEM = CartPole(pole_damping=0.2, cart_damping=0.1)
START = (jnp.array([0.1, 2.0]), jnp.array([0.3, -1.0]))
SAMPLES = 5


@eqx.filter_jit
def end(ts, us, solver, hold):
    return rollout(SYSTEM, *START, ts, us, solver=solver, hold=hold).states[-1]


def coarse(hold):
    """Inputs that jump, or bend, at a few samples."""
    return jnp.linspace(0.0, 0.8, SAMPLES), jnp.array([[1.0], [-2.0], [0.5], [3.0], [-1.0]])


@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_rk4_has_order_four_in_its_substeps_under_every_hold(hold):
    ts, us = coarse(hold)
    exact = end(ts, us, RK4(jnp.asarray(1024)), HOLDS[hold])
    steps = np.array([8, 16, 32, 64])
    errors = [np.abs(end(ts, us, RK4(jnp.asarray(k)), HOLDS[hold]) - exact).max() for k in steps]
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_rk4_has_order_four_in_the_sampling_interval(hold):
    def refined(factor):
        ts, us = coarse(hold)
        fine = np.linspace(0.0, 0.8, (SAMPLES - 1) * factor + 1)
        if hold == "linear":
            inputs = np.interp(fine, ts, us[:, 0])
        else:
            inputs = np.append(np.repeat(us[:-1, 0], factor), us[-1, 0])
        return end(jnp.asarray(fine), jnp.asarray(inputs)[:, None], RK4(), HOLDS[hold])

    exact = refined(512)
    factors = np.array([8, 16, 32, 64])
    errors = [np.abs(refined(int(factor)) - exact).max() for factor in factors]
    assert -np.polyfit(np.log(factors), np.log(errors), 1)[0] == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("hold", ["zero", "linear"])
@pytest.mark.parametrize("steps", [1, 2, 5])
def test_substeps_known_only_when_run_give_the_same(hold, steps):
    ts, us = coarse(hold)
    static, dynamic = (end(ts, us, RK4(k), HOLDS[hold]) for k in (steps, jnp.asarray(steps)))
    assert np.asarray(dynamic) == pytest.approx(np.asarray(static), rel=1e-13, abs=1e-13)


@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_substeps_are_shorter_sampling_intervals(hold):
    ts, us = coarse(hold)
    finer = jnp.sort(jnp.concatenate([ts, (ts[:-1] + ts[1:]) / 2]))
    between = us[:-1] if hold == "zero" else (us[:-1] + us[1:]) / 2
    inputs = jnp.concatenate([jnp.stack([us[:-1], between], axis=1).reshape(-1, 1), us[-1:]])
    halves = end(finer, inputs, RK4(), HOLDS[hold])
    assert np.asarray(end(ts, us, RK4(2), HOLDS[hold])) == pytest.approx(np.asarray(halves), rel=1e-12, abs=1e-12)


def test_each_setting_of_an_adaptive_solver_has_an_effect():
    ts, us = coarse("zero")
    settings = [(diffrax.Tsit5(), 1e-10, 1e-5), (diffrax.Tsit5(), 1e-4, 1e-5), (diffrax.Tsit5(), 1e-10, 1e-8)]
    ends = [
        end(ts, us, DiffraxSolver(solver, rtol=rtol, atol=atol), HOLDS["zero"])
        for solver, rtol, atol in [*settings, (diffrax.Dopri5(), 1e-10, 1e-5)]
    ]
    assert len({tuple(np.asarray(value)) for value in ends}) == 4
    given_up = end(ts, us, DiffraxSolver(diffrax.Tsit5(), rtol=1e-9, atol=1e-9, max_steps=1), HOLDS["zero"])
    assert np.isnan(given_up).all()


@pytest.mark.parametrize("solver", [RK4(2), DiffraxSolver(diffrax.Tsit5())], ids=["RK4", "Tsit5"])
def test_a_rollout_can_be_differentiated_by_start_and_input(solver):
    ts, us = coarse("zero")

    def last(speed, push):
        path = rollout(SYSTEM, START[0], START[1] + speed, ts, us + push, solver=solver)
        return path.q[-1, 1]

    slopes = jax.jit(jax.grad(last, argnums=(0, 1)))(0.0, 0.0)
    step = 1e-5
    apart = [
        (jax.jit(last)(step, 0.0) - jax.jit(last)(-step, 0.0)) / (2 * step),
        (jax.jit(last)(0.0, step) - jax.jit(last)(0.0, -step)) / (2 * step),
    ]
    assert [float(slope) for slope in slopes] == pytest.approx([float(x) for x in apart], rel=1e-3)


def test_an_interval_needs_a_step():
    with pytest.raises(ValueError, match="`substeps` must be at least 1"):
        RK4(0)

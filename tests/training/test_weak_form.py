"""The weak form of the equations of motion: true of true motions, and where training begins."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.integrate import HOLDS, RK4, rollout
from symoden.models import build, rescale
from symoden.spaces import Space
from symoden.systems import LinkChain
from symoden.training._flatten import Flattening
from symoden.training._gauss_newton import linearize
from symoden.training._objective import Batch
from symoden.training._weak_form import WeakForm

CHAIN = LinkChain.of_rods(3, mass=0.5, length=0.4, damping=0.1)


def random_window(n, m, seed, samples=9):
    """Noise: no motion of anything."""
    generator = np.random.default_rng(seed)
    ts = np.cumsum(generator.uniform(0.005, 0.02, samples))
    q, rates = generator.normal(size=(2, samples, n))
    us = generator.normal(size=(samples, m))
    return Batch(*(jnp.asarray(x) for x in (ts - ts[0], q, rates, us, np.concatenate([q[0], rates[0]]))))


def motion(step, hold, kind):
    """A motion of the chain as one window, under inputs that stay, swing or jump between samples."""
    ts = np.arange(round(0.48 / step) + 1) * step
    us = {
        "constant": np.ones((len(ts), 3)),
        "sine": np.sin(3 * ts[:, None] + np.arange(1, 4)),
        "steps": np.where(ts[:, None] + 1e-9 > [0.12, 0.2, 0.3], 3.0, -3.0),
    }[kind]
    start = np.random.default_rng(1).uniform(-1, 1, (2, 3))
    path = rollout(CHAIN, *map(jnp.asarray, (*start, ts, us)), solver=RK4(8), hold=HOLDS[hold])
    return Batch(*(jnp.asarray(x)[None] for x in (ts, path.q, path.rates, us, np.concatenate(start))))


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("kind", ["constant", "sine", "steps"])
def test_true_motions_satisfy_it_to_the_fourth_order_of_even_steps(hold, kind):
    form = WeakForm(jnp.ones(3), HOLDS[hold])
    # With linear hold what steps is a ramp, another one with every step.
    errors = [float(jnp.sqrt(form.loss(CHAIN, motion(step, hold, kind)))) for step in (0.02, 0.01)]
    assert errors[0] < 0.01  # Of velocities of 2 rad/s.
    assert np.log2(errors[0] / errors[1]) > 3.5


def test_uneven_steps_weigh_by_their_lengths():
    fine, form = motion(0.005, "zero", "constant"), WeakForm(jnp.ones(3), HOLDS["zero"])
    kept = np.concatenate([np.arange(0, 48, 1), np.arange(48, 97, 2)])
    ts, q, rates, us = (x[:, kept] for x in fine[:4])
    thinned = Batch(ts, q, rates, us, fine.start)
    wrong = LinkChain.of_rods(3, mass=0.5, length=0.4, damping=0.3)
    even, uneven = (np.asarray(form.residuals(wrong, jax.tree.map(lambda x: x[0], b))) for b in (fine, thinned))
    assert np.abs(even).max() > 0.1
    assert uneven == pytest.approx(even, abs=0.02 * float(np.abs(even).max()))


@pytest.mark.parametrize("hold", HOLDS)
def test_it_is_newtons_second_law_under_a_bump(hold, scrambled, plain):
    config = dataclasses.replace(plain, knees=(0.1,))
    model = scrambled(build(config, Space.parse("R1 T2"), 2, key=jax.random.key(0)), 0, 0.5)
    window = random_window(3, 2, 0)
    window = window._replace(us=jnp.broadcast_to(window.us[:1], window.us.shape))  # Nothing jumps.
    ts, halves = np.asarray(window.ts), np.diff(np.asarray(window.ts)) / 2
    x = 2 * ts / ts[-1] - 1
    bump = (1 - x**2) ** 3
    slope = np.asarray(jax.vmap(jax.grad(lambda t: (1 - (2 * t / ts[-1] - 1) ** 2) ** 3))(jnp.asarray(ts)), float)
    whole = np.pad(halves, (1, 0)) + np.pad(halves, (0, 1))
    states = jax.vmap(model.encode)(window.q, window.rates)
    rates = jax.vmap(lambda s, u: model.derivative(jnp.zeros(()), s, u))(states, window.us)
    impulse = (whole * bump) @ rates[:, 3:] + (whole * slope) @ states[:, 3:]
    velocity = model.inverse_mass_matrix(window.q[np.argmax(bump)]) @ impulse * ts[-1] / (whole @ bump)
    found = WeakForm(jnp.array([1.0, 2.0, 3.0]), HOLDS[hold]).residuals(model, window)
    assert np.asarray(found)[0] == pytest.approx(np.asarray(velocity) * [1, 2, 3], rel=1e-9, abs=1e-12)


def test_no_scale_of_the_energy_changes_it(scrambled, plain):
    model = scrambled(build(plain, Space.parse("T3"), 3, key=jax.random.key(0)), 0, 0.5)
    form, window = WeakForm(jnp.ones(3), HOLDS["zero"]), random_window(3, 3, 0)
    here, there = (np.asarray(form.residuals(each, window)) for each in (model, rescale(model, 7.0)))
    assert there == pytest.approx(here, rel=1e-9, abs=1e-12)


def test_its_derivative_is_that_of_the_residuals(scrambled, plain):
    model = scrambled(build(plain, Space.parse("T3"), 3, key=jax.random.key(0)), 0, 0.5)
    restore, theta = Flattening.of(model, corrections=0)
    form, window = WeakForm(jnp.ones(3), HOLDS["zero"]), random_window(3, 3, 0)
    r, J = linearize(restore, theta, form, window)
    direction = jnp.asarray(np.random.default_rng(1).normal(size=theta.size))
    value, slope = jax.jvp(lambda theta: form.residuals(restore(theta), window)[0], (theta,), (direction,))
    assert np.asarray(r) == pytest.approx(np.asarray(value), rel=1e-12)
    assert np.asarray(J @ direction) == pytest.approx(np.asarray(slope), rel=1e-9)


def test_a_model_without_energies_is_refused(plain):
    model = build(dataclasses.replace(plain, kind="naive"), Space.parse("T3"), 3, key=jax.random.key(0))
    with pytest.raises(TypeError, match="must be mechanical; got NaiveModel"):
        WeakForm(jnp.ones(3), HOLDS["zero"]).residuals(model, random_window(3, 3, 0))

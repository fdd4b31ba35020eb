"""Starts that are estimated with the model."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import CORRECTIONS, Known, KnownFriction, KnownFunction, KnownValue
from symoden.data import windows
from symoden.integrate import HOLDS, RK4, rollout
from symoden.mechanics import AbstractDynamics
from symoden.models import build
from symoden.spaces import Space
from symoden.training._flatten import Flattening
from symoden.training._gauss_newton import Linearization
from symoden.training._objective import Batch, Objective
from symoden.training._residuals import evaluate_loss, find_starts, follow_starts, integration_error
from symoden.training._starts import find_start

WEIGHTS, NOISE = jnp.array([1.0, 0.5, 2.0]), jnp.array([0.05, 0.05, 0.1])


def problem(dataset, config, *, level=0.05, noise=0.0):
    model = build(config, Space.parse("T1"), 1, key=jax.random.key(3))
    objective = Objective(WEIGHTS, RK4(), HOLDS["zero"], noise=NOISE, level=jnp.asarray(level))
    batch = Batch.of(windows(dataset.train, 9, stride=9))
    shaken = np.random.default_rng(0).normal(size=batch.start.shape) * noise
    q, rates = np.array(batch.q), np.array(batch.rates)
    q[:, 0] += shaken[:, :1]
    rates[:, 0] += shaken[:, 1:]
    start = jnp.asarray(np.concatenate([q[:, 0], rates[:, 0]], axis=1))
    return model, objective, batch._replace(q=jnp.asarray(q), rates=jnp.asarray(rates), start=start)


def settled(model, objective, batch):
    for _ in range(6):
        batch = find_starts(model, objective, batch).windows
    return batch


def about(restore, theta, objective, batch):
    return dataclasses.replace(Linearization.at(restore, theta, objective, batch), precision=float)


def test_the_gradient_is_that_of_the_loss_from_the_best_starts(pendulum, small, scrambled):
    model, objective, batch = problem(pendulum(), small, noise=0.05)
    restore, theta = Flattening.of(scrambled(model, 1, 0.3), corrections=CORRECTIONS)
    best = settled(restore(theta), objective, batch)
    equations = about(restore, theta, objective, best).normal_equations()
    direction = np.random.default_rng(1).normal(size=theta.shape)
    direction *= 1e-4 / np.linalg.norm(direction)
    ahead, behind = (
        evaluate_loss(
            restore(theta + sign * direction), objective, settled(restore(theta + sign * direction), objective, best)
        )
        for sign in (1, -1)
    )
    assert 4 * equations.gradient @ direction == pytest.approx(ahead - behind, rel=1e-4)


def test_pulling_back_goes_around_the_starts(pendulum, small, scrambled):
    model, objective, batch = problem(pendulum(), small, noise=0.05)
    restore, theta = Flattening.of(scrambled(model, 1, 0.3), corrections=CORRECTIONS)
    best = settled(restore(theta), objective, batch)
    linear = about(restore, theta, objective, best)
    random = np.random.default_rng(2)
    cotangents = random.normal(size=linear.found.residuals.shape)

    def residuals(theta, starts):
        windows = best._replace(start=starts)
        return jax.vmap(lambda window: objective.residuals(restore(theta), window))(windows)

    _, pull = jax.vjp(residuals, theta, best.start)
    by_start = jax.vmap(
        jax.jacfwd(lambda start, window: objective.residuals(restore(theta), window._replace(start=start)))
    )
    slopes = np.asarray(by_start(best.start, best)).reshape(len(cotangents), -1, best.start.shape[1])
    for k, J in enumerate(slopes):
        cotangents[k] -= (J @ np.linalg.lstsq(J, cotangents[k].ravel(), rcond=None)[0]).reshape(cotangents[k].shape)
    expected, along = pull(jnp.asarray(cotangents))
    assert np.abs(along).max() < 1e-10  # Nothing is left that a start could follow.
    pulled = linear.pull_back(cotangents + (slopes @ random.normal(size=slopes.shape[2])).reshape(cotangents.shape))
    assert pulled == pytest.approx(np.asarray(expected), abs=1e-9 * np.abs(expected).max())


def test_the_starts_of_a_model_nearby_are_followed(pendulum, small, scrambled):
    model, objective, batch = problem(pendulum(), small)
    restore, theta = Flattening.of(scrambled(model, 1, 0.3), corrections=CORRECTIONS)
    exact = jax.vmap(lambda window: exact_window(restore(theta), window))(batch)
    found = find_starts(restore(theta), objective, exact)
    direction = np.random.default_rng(1).normal(size=theta.shape)
    missed = []
    for distance in (0.2, 0.1):
        near = restore(theta + distance * direction / np.linalg.norm(direction))
        best = np.asarray(find_starts(near, objective, settled(near, objective, exact)).residuals)
        stuck, followed = (
            np.asarray(follow_starts(near, objective, found.windows, inverse)) for inverse in (None, found.inverse)
        )
        missed.append([np.mean(each**2) - np.mean(best**2) for each in (stuck, followed)])
    assert missed[0][1] < 0.05 * missed[0][0]
    assert missed[0][1] > 10 * missed[1][1] > 0  # Of the fourth order.


def test_a_start_is_found_again_where_the_model_is_right(pendulum, small):
    dataset = pendulum()
    model, objective, batch = problem(dataset, small)
    truth = batch.start
    exact = jax.vmap(lambda window: exact_window(model, window))(batch)
    _, _, shaken = problem(dataset, small, noise=0.05)
    shaken = exact._replace(q=exact.q.at[:, 0].set(shaken.q[:, 0]), rates=exact.rates.at[:, 0].set(shaken.rates[:, 0]))
    shaken = shaken._replace(start=jnp.concatenate([shaken.q[:, 0], shaken.rates[:, 0]], axis=1))
    found = find_starts(model, objective, shaken).windows.start
    before, after = (np.sqrt(np.mean((np.asarray(x) - np.asarray(truth)) ** 2)) for x in (shaken.start, found))
    assert after < 0.4 * before


def exact_window(model, window):
    objective = Objective(jnp.ones(3), RK4(), HOLDS["zero"])
    zero = window._replace(q=jnp.zeros_like(window.q), rates=jnp.zeros_like(window.rates))
    seen = objective.residuals(model, zero) + jnp.array([[1.0, 0.0, 0.0]])
    q = jnp.unwrap(jnp.concatenate([window.start[:1], jnp.arctan2(seen[:, 1], seen[:, 0])]))
    return window._replace(q=q[:, None], rates=jnp.concatenate([window.start[1:], seen[:, 2]])[:, None])


class CartAndPendulum(AbstractDynamics):
    """A mass on a spring, in any unit of length, and a pendulum beside it."""

    space: Space = eqx.field(default=Space.parse("R1 T1"))
    inputs: int = eqx.field(static=True, default=0)
    momenta: bool = eqx.field(static=True, default=False)

    def encode(self, q, rates):
        return jnp.concatenate([q, rates])

    def derivative(self, t, state, u):
        return jnp.array([state[2], state[3], -4 * state[0], -9 * jnp.sin(state[1])])

    def decode(self, state):
        return state[:2], state[2:]

    def observe(self, state):
        return jnp.concatenate([self.space.embed(state[:2]), state[2:]])


@pytest.mark.parametrize("unit", [1e9, 1e-9])
def test_starts_are_the_same_whatever_lengths_are_measured_in(unit):
    with jax.enable_x64(True):
        ts, noise = jnp.linspace(0.0, 1.0, 51), 1e-2 * np.random.default_rng(0).normal(size=(51, 4))
        machine, us, starts = CartAndPendulum(), jnp.zeros((51, 0)), []
        for scale in (np.array([1.0, 1.0]), np.array([unit, 1.0])):
            path = rollout(machine, jnp.asarray(scale * [1.0, 0.5]), jnp.zeros(2), ts, us, solver=RK4(4))
            q, rates = path.q + scale * noise[:, :2], path.rates + scale * noise[:, 2:]
            channels = jnp.asarray(scale[[0, 1, 1, 0, 1]])
            objective = Objective(1 / channels, RK4(4), HOLDS["zero"], noise=1e-2 * channels, level=jnp.asarray(1e-2))
            window = Batch(ts, q, rates, us, jnp.concatenate([q[0], rates[0]]))
            found = find_start(machine, objective, window, iterations=3).windows.start
            starts.append(np.asarray(found) / np.tile(scale, 2))
    np.testing.assert_allclose(starts[1], starts[0], rtol=1e-6)


def test_good_sensors_beside_a_poor_model_hold_the_start(pendulum, small):
    model, objective, batch = problem(pendulum(), small, noise=0.05)
    moved = []
    for level in (0.01, 1.0, np.inf):
        found = find_starts(model, dataclasses.replace(objective, level=jnp.asarray(level)), batch).windows.start
        moved.append(float(jnp.abs(found - batch.start).max()))
    assert moved[0] > 2 * moved[1] > 100 * moved[2]
    assert moved[2] < 1e-3


def test_rates_that_were_estimated_do_not_count(pendulum, small):
    _, objective, _ = problem(pendulum(), small)
    measured = dataclasses.replace(objective, measured=jnp.array([1.0, 1.0, 0.0]))
    before, rows = (np.array(each.row_weights(10)) for each in (objective, measured))
    assert rows[:, :2] == pytest.approx(before[:, :2])
    assert before[:, 2].all()
    assert not rows[:, 2].any()


def test_a_free_motion_has_starts_too(pendulum, small):
    _, objective, batch = problem(pendulum(), small, noise=0.05)
    free = batch._replace(us=batch.us[:, :, :0])
    model = build(small, Space.parse("T1"), 0, key=jax.random.key(3))
    found = find_starts(model, objective, free).windows
    assert found.us.shape == free.us.shape
    assert float(jnp.abs(found.start - batch.start).max()) > 1e-3


def test_without_noise_windows_start_where_they_were_measured(pendulum, small):
    model, objective, batch = problem(pendulum(), small, noise=0.05)
    pinned = dataclasses.replace(objective, noise=None, level=None)
    assert np.array_equal(find_starts(model, pinned, batch).windows.start, batch.start)
    assert jax.vmap(lambda window: pinned.residuals(model, window))(batch).shape[1] == 9
    assert jax.vmap(lambda window: objective.residuals(model, window))(batch).shape[1] == 10


def test_an_integration_that_diverges_has_an_error_that_is_no_number(pendulum, small, scrambled):
    model, objective, batch = problem(pendulum(), small)
    wild = scrambled(model, 1, 1e6)
    assert not np.isfinite(integration_error(wild, objective, dataclasses.replace(objective, solver=RK4(2)), batch))
    assert integration_error(model, objective, dataclasses.replace(objective, solver=RK4(2)), batch) < 1e-6


def test_friction_that_is_stiff_at_rest_asks_for_steps_that_are_stable(pendulum, small):
    """Rollouts hardly tell: dry friction is bounded, so that they chatter where they are; their derivatives explode."""
    model, objective, _ = problem(pendulum(), small)
    model = dataclasses.replace(
        model,
        inverse_mass=KnownValue(Known(jnp.ones((1, 1)))),
        potential=KnownFunction(lambda q: 0.1 * jnp.cos(q[0])),
        friction=KnownFriction(lambda q, v: 0.4 / jnp.sqrt(v[:, None] ** 2 + 1e-6)),  # Of rate 400/s at rest.
    )
    rest = jnp.zeros((3, 101, 1))
    start = jnp.asarray([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]])
    batch = Batch(ts=jnp.tile(0.01 * jnp.arange(101.0), (3, 1)), q=rest, rates=rest, us=rest, start=start)
    once, twice, more = (dataclasses.replace(objective, solver=RK4(n)) for n in (1, 2, 4))
    assert np.square(np.asarray(follow_starts(model, once, batch) - follow_starts(model, twice, batch))).mean() < 0.01
    assert integration_error(model, once, twice, batch) == np.inf  # 4 in a step; 2.8 is stable.
    assert integration_error(model, twice, more, batch) < 1e-6
    short = batch._replace(**{name: getattr(batch, name)[:, :31] for name in ("ts", "q", "rates", "us")})
    stiffer = dataclasses.replace(model, friction=KnownFriction(lambda q, v: 0.4 / jnp.sqrt(v[:, None] ** 2 + 1.1e-7)))
    for some in (batch, short):  # Both overflow; both lose all digits, the finer one sooner.
        assert integration_error(stiffer, once, twice, some) == np.inf

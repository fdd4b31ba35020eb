"""First states that are found from several samples."""

import dataclasses

import numpy as np
import pytest

from symoden.data import Trajectory, choose_spans, estimate_velocities, velocity_noise_gain
from symoden.evaluation import predict
from symoden.integrate import HOLDS, RK4
from symoden.systems import Pendulum
from symoden.training import find_first_state

TRUTH = Pendulum(damping=0.2)
NOISE = (0.01, 0.5)


def noisy(recording, seed, *, noise=NOISE, initial_samples=12):
    generator = np.random.default_rng(seed)
    q, rates = (
        x + sigma * generator.normal(size=x.shape)
        for x, sigma in zip((recording.q, recording.rates), noise, strict=True)
    )
    return dataclasses.replace(recording, q=q, rates=rates, initial_samples=initial_samples)


def first_states(recordings, system=TRUTH):
    pairs = [find_first_state(system, each, hold=HOLDS["zero"], solver=RK4(2)) for each in recordings]
    return np.concatenate([np.concatenate(pair) for pair in pairs]).reshape(-1, 2)


def measured(recordings):
    return np.array([[each.q[0, 0], each.rates[0, 0]] for each in recordings])


def error(states, recordings):
    """Root mean square, of the coordinate and of the velocity."""
    return np.sqrt(np.mean((states - measured(recordings)) ** 2, axis=0))


@pytest.fixture(scope="module")
def clean(pendulum):
    return pendulum(count=8, samples=61).train


def test_the_true_state_is_found_in_noise(clean):
    shaken = [noisy(recording, k) for k, recording in enumerate(clean)]
    before, after = (error(states, clean) for states in (measured(shaken), first_states(shaken)))
    assert before[1] > 0.25
    assert after[1] < 0.1 * before[1]
    assert after[0] < before[0]


def test_only_the_initial_samples_tell_it(clean):
    shaken = [noisy(recording, k) for k, recording in enumerate(clean)]
    turned = [
        dataclasses.replace(each, q=np.concatenate([each.q[:12], each.q[12:] + 0.5 * each.ts[12:, None] ** 2]))
        for each in shaken
    ]
    # Later samples tell no more than how noisy the sensors are.
    assert first_states(turned) == pytest.approx(first_states(shaken), abs=0.02)


@pytest.mark.parametrize("changes", [{"noise": (0.0, 0.0)}, {"initial_samples": 1}])
def test_it_is_the_measured_one_where_nothing_else_is_told(clean, changes):
    recordings = [noisy(recording, k, **changes) for k, recording in enumerate(clean)]
    assert np.array_equal(first_states(recordings), measured(recordings))


def test_a_model_that_is_wrong_by_more_than_the_noise_moves_it_little(clean):
    precise = [noisy(recording, k, noise=(1e-4, 1e-3)) for k, recording in enumerate(clean)]
    found = first_states(precise, Pendulum(damping=0.2, gravity=5.0))
    assert (np.abs(found - measured(precise)) < [3e-4, 3e-3]).all()


def test_it_is_the_measured_one_where_rollouts_diverge(clean):
    shaken = [noisy(recording, k) for k, recording in enumerate(clean)]
    assert np.array_equal(first_states(shaken, Pendulum(damping=1e200)), measured(shaken))


def forced(seed, *, noise=1e-3, step=0.015, frequency=10.0, samples=200):
    """A pendulum under a torque of ten turns a second: as it moves, and as its encoder tells."""
    generator = np.random.default_rng(seed)
    ts = step * np.arange(samples)
    torque = 150 * np.sin(2 * np.pi * frequency * ts + generator.uniform(0, 6))
    still = Trajectory(
        name="forced",
        ts=ts,
        q=np.full((samples, 1), generator.uniform(-1, 1)),
        rates=np.full((samples, 1), generator.normal()),
        us=torque[:, None],
    )
    (path,) = predict(TRUTH, [still])
    q = path.q + noise * generator.normal(size=path.q.shape)
    spans = choose_spans([ts], [q])
    seen = dataclasses.replace(
        still,
        q=q,
        rates=estimate_velocities(ts, q, name="forced", spans=spans),
        noise_gain=velocity_noise_gain(ts, spans),
        one_sided=int(spans[0]) // 2 * step,
    )
    return dataclasses.replace(still, q=path.q, rates=path.rates), seen


@pytest.mark.parametrize("system", [TRUTH, Pendulum(damping=0.25, gravity=9.5)])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_estimated_rates_do_not_hold_it_where_they_are_poor(system, noise):
    moved, seen = zip(*(forced(seed, noise=noise) for seed in range(6)), strict=True)
    before, after = error(measured(seen), moved)[1], error(first_states(seen, system), moved)[1]
    assert before > 1.0
    assert after < 0.1 * before


def test_of_good_estimates_the_first_one_is_taken():
    _, seen = forced(0, step=0.001, samples=500, noise=1e-5)
    assert np.array_equal(first_states([seen]), measured([seen]))

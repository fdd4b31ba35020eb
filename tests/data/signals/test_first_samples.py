"""Which samples tell the first state of a recording, and how far estimated rates are off there."""

import dataclasses

import numpy as np
import pytest

from symoden.data import (
    Trajectory,
    choose_spans,
    estimate_velocities,
    first_samples,
    rate_errors_at_ends,
    velocity_noise_gain,
)


def swing(seed, *, step, samples=400, noise=1e-3, stretch=None):
    """Sums of sines up to 8 Hz, as positions tell them, and their velocity."""
    generator = np.random.default_rng(seed)
    ts = step * np.arange(samples)
    if stretch is not None:
        ts = ts + stretch * step * generator.uniform(-1, 1, samples)
    sizes, phases = generator.normal(size=(2, 4))
    omega = 2 * np.pi * np.array([1.0, 2.0, 4.0, 8.0])
    angles = ts[:, None] * omega + phases
    q = np.sum(sizes / omega * np.sin(angles), axis=1)[:, None] + noise * generator.normal(size=(samples, 1))
    spans = choose_spans([ts], [q])
    recording = Trajectory(
        name="swing",
        ts=ts,
        q=q,
        rates=estimate_velocities(ts, q, name="swing", spans=spans),
        us=np.zeros((samples, 0)),
        noise_gain=velocity_noise_gain(ts, spans),
        one_sided=int(spans[0]) // 2 * step,
    )
    return recording, np.sum(sizes * np.cos(angles), axis=1)


@pytest.mark.parametrize("stretch", [None, 0.3])
@pytest.mark.parametrize("step", [0.002, 0.01, 0.02])
def test_errors_at_ends_are_what_recordings_alone_tell(step, stretch):
    made = [swing(seed, step=step, stretch=stretch) for seed in range(40)]
    off = np.array([[each.rates[k, 0] - v[k] for k in (0, -1)] for each, v in made])
    said = np.array([rate_errors_at_ends(each)[0] for each, _ in made])
    assert np.sqrt(np.mean(off**2)) == pytest.approx(np.sqrt(np.mean(said**2)), rel=0.35)


def test_poor_estimates_take_all_samples_that_they_had():
    recording, _ = swing(0, step=0.02)
    assert first_samples(recording) == 1 + 2 * round(recording.one_sided / 0.02) > 1
    assert first_samples(swing(0, step=0.001, samples=4000, noise=1e-5)[0]) == 1


def test_a_resting_joint_calls_for_none():
    recording, _ = swing(0, step=0.001, samples=4000, noise=1e-5)
    rest = 1e-4 * np.random.default_rng(1).normal(size=recording.rates.shape)
    joined = {name: np.hstack([getattr(recording, name), rest]) for name in ("q", "rates")}
    gain = np.repeat(np.ravel(np.asarray(recording.noise_gain)), 2)
    assert first_samples(dataclasses.replace(recording, **joined, noise_gain=gain)) == 1


def test_what_the_description_says_goes_before():
    recording, _ = swing(0, step=0.02)
    assert first_samples(dataclasses.replace(recording, initial_samples=3)) == 3
    assert first_samples(dataclasses.replace(recording, noise_gain=None)) == 1


def test_too_short_a_recording_is_as_far_off_as_it_moves():
    recording, _ = swing(0, step=0.02, samples=8)
    assert rate_errors_at_ends(recording) == pytest.approx(np.sqrt(np.mean(recording.rates**2, axis=0)))
    assert first_samples(recording) < len(recording)

"""How noisy sensors are, told from motion."""

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from symoden.data import (
    Trajectory,
    choose_spans,
    estimate_velocities,
    measure_noise,
    read_dataset,
    resample,
    velocity_noise_gain,
)

TS = 0.02 * np.arange(200)


def logs(sigma, seed, frequency=2.0, count=6, blur=1):
    generator = np.random.default_rng(seed)
    found = []
    for k in range(count):
        angle = 2 * np.pi * frequency * TS + generator.uniform(0, 6)
        noise = generator.normal(size=(2, len(TS) + blur - 1))
        noise = np.stack([np.convolve(row, np.ones(blur) / np.sqrt(blur), mode="valid") for row in noise])
        q, rates = np.cos(angle) + sigma * noise[0], -np.sin(angle) + 2 * sigma * noise[1]
        found.append(Trajectory(name=f"r{k}", ts=TS, q=q[:, None], rates=rates[:, None], us=np.zeros((len(TS), 0))))
    return found


@given(sigma=st.floats(0.01, 0.3), seed=st.integers(0, 1000))
def test_white_noise_is_found_beside_a_motion(sigma, seed):
    noise = measure_noise(logs(sigma, seed))
    assert noise.is_seen
    assert noise.q == pytest.approx([sigma], rel=0.4)
    assert noise.rates == pytest.approx([2 * sigma], rel=0.4)


@given(frequency=st.floats(0.1, 11.0), seed=st.integers(0, 1000))
def test_a_motion_alone_is_no_noise(frequency, seed):
    turns = frequency * np.diff(TS[:2]) * np.arange(1, 26)
    assume(np.abs(turns - np.round(turns)).min() > 1e-6)  # One that repeats after few samples has few values: rounded?
    assert not measure_noise(logs(0.0, seed, frequency)).is_seen


def test_noise_that_a_filter_has_cut_off_keeps_its_size_within_a_factor_of_two():
    noise = measure_noise(logs(0.1, 0, blur=2))
    assert 0.05 < noise.q[0] < 0.2


def test_rounding_counts_as_the_noise_that_it_is():
    rounded = [
        Trajectory(name=each.name, ts=each.ts, q=np.round(each.q / 0.02) * 0.02, rates=each.rates, us=each.us)
        for each in logs(0.0, 1, frequency=0.7)
    ]
    assert measure_noise(rounded).q[0] == pytest.approx(0.02 / np.sqrt(12), rel=0.6)


def test_the_gap_between_two_recordings_is_no_noise():
    generator = np.random.default_rng(0)
    pieces = [
        Trajectory(
            name=f"r{k}", ts=each.ts[:12], q=each.q[:12] + generator.normal(), rates=each.rates[:12], us=each.us[:12]
        )
        for k, each in enumerate(logs(0.0, 3, count=40))
    ]
    assert not measure_noise(pieces).is_seen


def estimated(sigma, seed, hertz=500):
    """A noisy swing whose velocities are estimated from its positions."""
    ts = np.arange(0, 20, 1 / hertz)
    q = (np.sin(3 * ts) + sigma * np.random.default_rng(seed).normal(size=len(ts)))[:, None]
    spans = choose_spans([ts], [q])
    v = estimate_velocities(ts, q, name="r", spans=spans)
    gain = velocity_noise_gain(ts, spans)
    return Trajectory(name="r", ts=ts, q=q, rates=v, us=np.zeros((len(ts), 0)), noise_gain=gain)


@pytest.mark.parametrize("dt", [None, 0.01, 0.02])
@pytest.mark.parametrize("hertz", [100, 200, 500, 1000, 2000])
def test_estimated_velocities_have_the_noise_that_their_weights_make_of_the_positions(hertz, dt):
    log = estimated(1e-3, hertz, hertz)
    log = log if dt is None else resample(log, dt)
    error = (log.rates[:, 0] - 3 * np.cos(3 * log.ts))[len(log) // 20 : -len(log) // 20]
    # The window is as wide as the motion allows: a part of the error is not noise, but motion that it takes away.
    assert 0.5 * error.std() < measure_noise([log]).rates[0] < 1.1 * error.std()


def test_the_shortest_part_of_a_recording_can_still_be_resampled():
    log = estimated(1e-3, 0, hertz=100)
    assert resample(log.cut(0, 3, name="s"), 0.01).noise_gain == pytest.approx(log.noise_gain)


def test_estimated_and_measured_velocities_count_each_in_its_way():
    noise = measure_noise([estimated(1e-3, 0), *logs(0.1, 0)])
    assert noise.rates[0] > 0.9 * measure_noise(logs(0.1, 0)).rates[0]
    assert measure_noise([estimated(0.0, 0)]).rates[0] == 0


def test_a_recording_that_is_read_without_velocities_knows_that_they_were_estimated(tmp_path):
    log = estimated(1e-3, 0)
    np.savez(tmp_path / "r.npz", t=log.ts, q=log.q, v=log.rates)
    text = 'space = "T1"\ntime = "t"\npositions = "q"\nresample = 0.01\n[train]\nfiles = ["r.npz"]\nsplit_every = 5.0\n'
    (tmp_path / "d.toml").write_text(text)
    expected = np.asarray(resample(log, 0.01).noise_gain)
    gains = np.array([each.noise_gain for each in read_dataset(tmp_path / "d.toml").train])
    np.testing.assert_allclose(gains, np.tile(expected, (4, 1)), rtol=0.01)
    (tmp_path / "d.toml").write_text('velocities = "v"\n' + text)
    assert all(each.noise_gain is None for each in read_dataset(tmp_path / "d.toml").train)


@given(sigma=st.floats(0.001, 0.1), seed=st.integers(0, 1000))
def test_noise_is_found_where_time_stamps_come_in_bursts(sigma, seed):
    generator = np.random.default_rng(seed)
    ts = np.cumsum(np.tile([0.001, 0.001, 0.028], 3000))
    q = np.sin(3 * ts)[:, None] + sigma * generator.normal(size=(len(ts), 1))
    log = Trajectory(name="r", ts=ts, q=q, rates=3 * np.cos(3 * ts)[:, None], us=np.zeros((len(ts), 0)))
    assert measure_noise([log]).q == pytest.approx([sigma], rel=0.5)


@given(seed=st.integers(0, 1000))
def test_what_a_restless_input_moves_is_no_noise(seed):
    generator = np.random.default_rng(seed)
    found = []
    for k in range(4):
        us = generator.normal(size=(len(TS), 1))
        v = np.concatenate([[0.0], np.cumsum(0.02 * us[:-1, 0])])
        q = np.concatenate([[0.0], np.cumsum(0.02 * (v[:-1] + 0.01 * us[:-1, 0]))])
        found.append(Trajectory(name=f"r{k}", ts=TS, q=q[:, None], rates=v[:, None], us=us))
    noise = measure_noise(found)
    assert noise.q[0] < 1e-6
    assert noise.rates[0] < 1e-6

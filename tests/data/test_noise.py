"""How noisy sensors are, told from motion."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import Trajectory, measure_noise

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

"""Estimated velocities are the slope of the motion, without bias or delay."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, estimate_velocities, velocity_noise_gain


@given(
    coefficients=st.lists(st.floats(-3, 3), min_size=4, max_size=4),
    step=st.floats(0.0005, 0.2),
    samples=st.integers(5, 200),
)
def test_the_slope_of_a_cubic_is_exact_to_the_ends(coefficients, step, samples):
    ts = step * np.arange(samples) / (step * samples)
    motion = np.polynomial.Polynomial(coefficients)
    velocities = estimate_velocities(ts, motion(ts)[:, None], name="run")
    np.testing.assert_allclose(velocities[:, 0], motion.deriv()(ts), atol=1e-8)


def test_a_noisy_sine_gives_unbiased_velocities():
    rng = np.random.default_rng(0)
    ts = 0.002 * np.arange(5000)
    true = 4 * np.cos(4 * ts)
    noise = 1e-3 * rng.normal(size=(5000, 8))
    errors = estimate_velocities(ts, np.sin(4 * ts)[:, None] + noise, name="run") - true[:, None]
    inside = errors[25:-25]
    assert inside.std() == pytest.approx(0.035, rel=0.1)  # 35 / s times the noise of the positions
    assert (inside * true[25:-25, None]).mean() / (true**2).mean() == pytest.approx(0, abs=1e-3)
    assert (inside * np.sin(4 * ts)[25:-25, None]).mean() == pytest.approx(0, abs=1e-3)  # no delay


@given(step=st.floats(0.0005, 0.1), samples=st.integers(12, 400))
def test_the_noise_gain_is_the_norm_of_what_each_velocity_adds_up(step, samples):
    ts = step * np.arange(samples)
    weights = estimate_velocities(ts, np.eye(samples), name="run")
    assert velocity_noise_gain(ts) == pytest.approx(np.linalg.norm(weights[samples // 2]), rel=1e-6)


def test_the_bias_is_of_order_four_in_the_step():
    def worst(step):
        ts = step * np.arange(round(4 / step))
        return np.abs(estimate_velocities(ts, np.sin(3 * ts)[:, None], name="run")[:, 0] - 3 * np.cos(3 * ts))[
            5:-5
        ].max()

    assert np.log2(worst(0.08) / worst(0.04)) == pytest.approx(4, abs=0.1)


def test_jitter_of_the_time_stamps_does_little_harm():
    ts = np.cumsum(0.002 * np.random.default_rng(0).uniform(0.6, 1.4, 5000))
    velocities = estimate_velocities(ts, np.sin(4 * ts)[:, None], name="run")[:, 0]
    np.testing.assert_allclose(velocities[25:-25], 4 * np.cos(4 * ts[25:-25]), atol=0.003)


def test_a_measured_arm_moves_as_its_encoders_say(shared_data):
    polars = pytest.importorskip("polars")
    table = polars.read_csv(shared_data / "dfki-double-pendulum" / "C1" / "20230629-143601.csv.gz")
    ts, q = table["time"].to_numpy(), table.select("pos_meas1", "pos_meas2").to_numpy()
    measured = table.select("vel_meas1", "vel_meas2").to_numpy()
    errors = estimate_velocities(ts, q, name="arm") - measured
    assert np.sqrt((errors**2).mean()) < 0.05 * np.sqrt((measured**2).mean())  # the encoders' own noise is 0.2 rad/s
    assert np.abs(errors.mean(axis=0)).max() < 0.02


@pytest.mark.parametrize("ts", [np.arange(4.0), np.array([0, 1e-9, 2e-9, 3e-9, 4e-9, 1e3])])
def test_too_few_samples_or_an_extreme_gap_are_refused(ts):
    with pytest.raises(
        DataError, match=r"`run`: velocities are estimated from at least 5 samples without extreme gaps"
    ):
        estimate_velocities(ts, ts[:, None], name="run")

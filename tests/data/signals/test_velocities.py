"""Estimated velocities are the slope of the motion, without bias or delay."""

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from symoden.data import DataError, choose_spans, estimate_velocities, velocity_noise_gain


def swing(frequency, rate, *, samples=2000, noise=0.0, step=0.0, jitter=0.0, seed=0):
    """Time stamps, positions as a sensor gives them, and the true velocities."""
    generator = np.random.default_rng(seed)
    ts = np.cumsum(generator.uniform(1 - jitter, 1 + jitter, samples)) / rate
    omega = 2 * np.pi * frequency
    q = np.sin(omega * ts) + noise * generator.normal(size=samples)
    q = np.round(q / step) * step if step else q
    return ts, q[:, None], (omega * np.cos(omega * ts))[:, None]


def relative_error(ts, q, v):
    """Root mean square, of the true one's."""
    return float(np.sqrt(np.mean((estimate_velocities(ts, q, name="run") - v) ** 2) / np.mean(v**2)))


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
    spans = np.full(8, 25)
    errors = estimate_velocities(ts, np.sin(4 * ts)[:, None] + noise, name="run", spans=spans) - true[:, None]
    inside = errors[25:-25]
    # 35 / s times the noise of the positions, and a little more as a window of over 17 samples fits means of them.
    assert inside.std() == pytest.approx(0.035, rel=0.1)
    assert (inside * true[25:-25, None]).mean() / (true**2).mean() == pytest.approx(0, abs=1e-3)
    assert (inside * np.sin(4 * ts)[25:-25, None]).mean() == pytest.approx(0, abs=1e-3)  # no delay


@pytest.mark.parametrize("rate", [0.1, 10, 250, 10_000, 1e6])
@pytest.mark.parametrize("samples_a_period", [10, 20, 200, 1000])
@pytest.mark.parametrize(("noise", "step"), [(0.0, 0.0), (1e-3, 0.0), (0.0, 2 * np.pi / 4096)])
def test_velocities_keep_their_size_however_fast_the_motion_and_the_log(rate, samples_a_period, noise, step):
    motion = swing(rate / samples_a_period, rate, noise=noise, step=step, jitter=0.3)
    assert relative_error(*motion) < 0.02


@pytest.mark.parametrize("samples_a_period", [10, 50, 500])
@pytest.mark.parametrize("noise", [1e-4, 1e-3, 1e-2])
def test_no_other_span_would_be_much_better_in_noise(samples_a_period, noise):
    ts, q, v = swing(0.97, samples_a_period, noise=noise, samples=4000)
    errors = [
        np.sqrt(np.mean((estimate_velocities(ts, q, name="run", spans=np.array([span])) - v) ** 2))
        for span in (5, 7, 9, 13, 17, 23, 31, 43, 61, 85, 121, 171, 241)
    ]
    chosen = np.sqrt(np.mean((estimate_velocities(ts, q, name="run") - v) ** 2))
    assert chosen < 1.4 * min(errors)


@given(
    seconds=st.floats(1e-6, 1e6),
    metres=st.floats(1e-6, 1e6),
    step=st.sampled_from([0.0, 0.01]),
    seed=st.integers(0, 1000),
)
@settings(max_examples=15)
def test_velocities_follow_the_units_of_time_and_length(seconds, metres, step, seed):
    ts, q, _ = swing(1.0, 100, samples=300, noise=3e-3, step=step, jitter=0.4, seed=seed)
    v = estimate_velocities(ts, q, name="run")
    scaled = estimate_velocities(seconds * ts, metres * q, name="run")
    np.testing.assert_allclose(scaled * seconds / metres, v, rtol=1e-6, atol=1e-6)


def test_each_coordinate_has_its_own_span_and_recordings_of_one_motion_share_it():
    slow, fast = (swing(hertz, 1000, noise=1e-3, seed=k) for k, hertz in enumerate((1.0, 50.0)))
    both = np.concatenate([slow[1], fast[1]], axis=1)
    spans = choose_spans([slow[0]], [both])
    assert spans[0] > 5 * spans[1]
    cut = [slice(0, 900), slice(900, 903), slice(903, 2000)]
    parts = choose_spans([slow[0][part] for part in cut], [both[part] for part in cut])
    assert np.all(np.abs(np.log(parts / spans)) < 0.35)


@pytest.mark.parametrize("samples", [5, 6, 9, 17, 40])
def test_short_recordings_are_no_trouble(samples):
    assert relative_error(*swing(1.0, 40, samples=samples, noise=1e-5)) < 0.05


def test_no_window_spans_a_gap():
    ts = 0.01 * np.arange(400.0)
    ts[200:] += 5.0
    q = np.where(ts < 3, ts, 7 - 2 * ts)[:, None]
    v = estimate_velocities(ts, q, name="run", spans=np.array([31]))
    np.testing.assert_allclose(v[:, 0], np.where(ts < 3, 1.0, -2.0), atol=1e-6)


@given(
    lengths=st.lists(st.integers(1, 9), min_size=1, max_size=4),
    slopes=st.lists(st.floats(-3, 3), min_size=5, max_size=5),
    gaps=st.lists(st.floats(0.06, 20.0), min_size=4, max_size=4),
    place=st.integers(0, 4),
)
@example(lengths=[1], slopes=[0.0] * 5, gaps=[10.0] * 4, place=0)
@example(lengths=[3, 100], slopes=[0.0] * 5, gaps=[10.0] * 4, place=0)
def test_what_is_moved_in_gaps_has_no_velocity(lengths, slopes, gaps, place):
    place = min(place, len(lengths))
    lengths = [*lengths[:place], 120, *lengths[place:]]
    part = np.repeat(np.arange(len(lengths)), lengths)
    ts = 0.01 * np.arange(len(part)) + np.cumsum([0.0, *gaps])[part]
    v = np.array(slopes)[part]
    q = 5.0 * part + v * (ts - ts[np.searchsorted(part, part)])
    found = estimate_velocities(ts, q[:, None], name="run")[:, 0]
    alone = np.array(lengths)[part] == 1
    np.testing.assert_allclose(found[~alone], v[~alone], atol=1e-6)
    far = np.where(alone, np.inf, np.abs(ts - ts[:, None]))
    np.testing.assert_allclose(found[alone], v[far.argmin(axis=1)][alone], atol=1e-6)


def test_five_samples_with_a_gap_are_two_parts():
    ts = np.array([0.0, 0.01, 0.02, 3.0, 3.01])
    v = estimate_velocities(ts, np.where(ts < 1, 2 * ts, 7 - ts)[:, None], name="run")
    np.testing.assert_allclose(v[:, 0], [2, 2, 2, -1, -1], atol=1e-9)


@given(step=st.floats(0.0005, 0.1), samples=st.integers(30, 120), span=st.sampled_from([5, 9, 17, 26]))
@settings(max_examples=30)
def test_the_noise_gain_is_the_norm_of_what_each_velocity_adds_up(step, samples, span):
    ts = step * np.arange(samples)
    weights = estimate_velocities(ts, np.eye(samples), name="run", spans=np.full(samples, span))
    norms = np.linalg.norm(weights[samples // 2 - 1 : samples // 2 + 1], axis=1)
    assert velocity_noise_gain(ts, np.array([span]))[0] == pytest.approx(norms.mean(), rel=0.02)


def test_the_bias_is_of_order_four_in_the_step():
    def worst(step):
        ts = step * np.arange(round(4 / step))
        v = estimate_velocities(ts, np.sin(3 * ts)[:, None], name="run", spans=np.array([5]))[:, 0]
        return np.abs(v - 3 * np.cos(3 * ts))[5:-5].max()

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

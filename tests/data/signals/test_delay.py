"""A delayed input acts when it acts: impulses are kept exactly, at any time stamps, and nothing is made up."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, Trajectory, read_dataset, resample
from symoden.data.signals._delay import advance_positions, delay_inputs


def pushed_mass(seed, delay, samples=300, step=0.01):
    """A unit mass under a held force that acts `delay` after it was logged; its motion is exact."""
    rng = np.random.default_rng(seed)
    ts = np.concatenate([[0.0], np.cumsum(step * rng.uniform(0.3, 1.7, samples - 1))]) + 100 * rng.normal()
    u = rng.normal(size=samples)
    knots, areas = np.append(ts, ts[-1] + 1e3), np.append(0.0, np.cumsum(np.append(np.diff(ts), 1e3) * u))
    # Before the record begins the force was 1, which no log knows.
    v = np.interp(ts - delay, knots, areas) + np.minimum(ts - delay - ts[0], 0.0)
    return Trajectory(name="push", ts=ts, q=np.zeros((samples, 1)), rates=v[:, None], us=u[:, None])


@given(seed=st.integers(0, 10_000), delay=st.floats(-1.0, 1.0))
def test_the_momentum_grows_by_the_delayed_impulse_of_every_step(seed, delay):
    logged = pushed_mass(seed, delay)
    acting = delay_inputs(logged, (delay,), hold="zero")
    impulses = np.diff(acting.ts) * acting.us[:-1, 0]
    np.testing.assert_allclose(np.diff(acting.rates[:, 0]), impulses, atol=1e-9)


@given(seed=st.integers(0, 10_000), delay=st.floats(-1.0, 1.0))
def test_exactly_the_samples_with_unknown_inputs_are_left_out(seed, delay):
    logged = pushed_mass(seed, delay)
    acting = delay_inputs(logged, (delay,), hold="zero")
    known = (logged.ts >= logged.ts[0] + delay - 1e-12) & (logged.ts <= logged.ts[-1] + delay + 1e-12)
    np.testing.assert_array_equal(acting.ts, logged.ts[known])
    np.testing.assert_array_equal(acting.rates, logged.rates[known])


@given(seed=st.integers(0, 1000), dt=st.floats(0.005, 0.1))
def test_resampling_keeps_the_delayed_impulse(seed, dt):
    logged = pushed_mass(seed, 0.123)
    new = resample(delay_inputs(logged, (0.123,), hold="zero"), dt)
    at = new.ts[[1, -1]]
    true = np.diff(np.interp(at, logged.ts, logged.rates[:, 0]))[0]
    assert dt * new.us[1:-1].sum() == pytest.approx(true, abs=1e-3)


@pytest.mark.parametrize("steps", [-7, -1, 0, 1, 7])
def test_a_delay_of_whole_steps_is_a_shift(steps):
    ts, u = 0.01 * np.arange(200), np.random.default_rng(0).normal(size=(200, 2))
    logged = Trajectory(name="run", ts=ts, q=u, rates=u, us=u)
    for hold in ("zero", "linear"):
        acting = delay_inputs(logged, (0.01 * steps,), hold=hold)
        assert len(acting) == 200 - abs(steps)
        np.testing.assert_allclose(acting.us, u[max(0, -steps) : 200 - max(0, steps)], atol=1e-9)


def test_each_input_has_its_own_delay_and_a_line_stays_a_line():
    ts = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.03, 200))
    u = np.stack([ts, 2 * ts], axis=1)
    acting = delay_inputs(Trajectory(name="run", ts=ts, q=u, rates=u, us=u), (0.1, 0.25), hold="linear")
    assert acting.ts[0] >= ts[0] + 0.25
    np.testing.assert_allclose(acting.us, np.stack([acting.ts - 0.1, 2 * (acting.ts - 0.25)], axis=1), atol=1e-12)


def test_the_delay_of_a_log_is_where_its_momentum_balance_closes(tmp_path):
    logged = pushed_mass(3, 0.0437)
    columns = np.concatenate([logged.ts[:, None], logged.q, logged.rates, logged.us], axis=1)
    np.savetxt(tmp_path / "a.csv", columns, delimiter=",", header="t,q,p,u", comments="", fmt="%.17g")

    def misfit(delay):
        text = 'space = "R1"\ntime = "t"\npositions = ["q"]\nmomenta = ["p"]\ninputs = ["u"]\n'
        path = tmp_path / "push.toml"
        path.write_text(f'{text}input_delay = {delay}\n[train]\nfiles = ["a.csv"]\n')
        run = read_dataset(path).train[0]
        return np.abs(np.diff(run.rates[:, 0]) - np.diff(run.ts) * run.us[:-1, 0])[10:].mean()

    assert misfit(0.0437) < 1e-9
    assert min(misfit(0.0), misfit(0.03), misfit(0.06)) > 1e-3


@pytest.mark.parametrize(
    ("delays", "message"),
    [
        ((0.1, 0.2), "`push`: `input_delay` must be one number or one per input, 1; got 2"),
        ((1e3,), "`push`: `input_delay` must be shorter than the recording; got 1000.0 s for"),
    ],
)
def test_a_delay_that_does_not_fit_is_refused(delays, message):
    with pytest.raises(DataError, match=message):
        delay_inputs(pushed_mass(0, 0.0), delays, hold="zero")


def two_joints(delays, ts):
    """Two smooth angles, each logged some time after it was so."""
    late = ts[:, None] - np.array(delays)
    q, rates = np.sin(late * [3.0, 5.0]), [3.0, 5.0] * np.cos(late * [3.0, 5.0])
    return Trajectory(name="seen", ts=ts, q=q, rates=rates, us=np.cos(ts)[:, None])


@given(delays=st.tuples(st.floats(0.0, 0.3), st.floats(0.0, 0.3)), seed=st.integers(0, 1000))
def test_late_positions_are_those_of_the_time_at_which_they_were(delays, seed):
    ts = np.cumsum(np.random.default_rng(seed).uniform(0.005, 0.015, 300))
    undone, truth = advance_positions(two_joints(delays, ts), delays), two_joints((0.0, 0.0), ts)
    count = len(undone)
    assert ts[count - 1] + max(delays) <= ts[-1] + 1e-9
    assert count == len(ts) or ts[count] + max(delays) > ts[-1]  # No more is left out than must be.
    np.testing.assert_array_equal(undone.ts, ts[:count])
    np.testing.assert_array_equal(undone.us, truth.us[:count])
    np.testing.assert_allclose(undone.q, truth.q[:count], atol=2e-3)
    np.testing.assert_allclose(undone.rates, truth.rates[:count], atol=2e-2)


@pytest.mark.parametrize("steps", [0, 1, 7])
def test_a_position_that_is_late_by_whole_steps_is_shifted(steps):
    logged = two_joints((0.0, 0.01 * steps), 0.01 * np.arange(200))
    undone = advance_positions(logged, (0.0, 0.01 * steps))
    assert len(undone) == 200 - steps
    np.testing.assert_array_equal(undone.q[:, 0], logged.q[: 200 - steps, 0])
    np.testing.assert_allclose(undone.q[:, 1], logged.q[steps:, 1], atol=1e-12)
    np.testing.assert_allclose(undone.rates[:, 1], logged.rates[steps:, 1], atol=1e-12)


@pytest.mark.parametrize("velocities", [True, False])
def test_a_description_says_how_late_a_sensor_is(tmp_path, velocities):
    logged, truth = (two_joints(delays, 0.01 * np.arange(400)) for delays in ((0.0, 0.13), (0.0, 0.0)))
    rows = np.concatenate([logged.ts[:, None], logged.q, logged.rates, logged.us], axis=1)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t,x,y,vx,vy,u", comments="")
    text = 'space = "T2"\ntime = "t"\npositions = ["x", "y"]\ninputs = ["u"]\nposition_delay = [0, 0.13]\n'
    text += 'velocities = ["vx", "vy"]\n' if velocities else ""
    path = tmp_path / "arm.toml"
    path.write_text(text + '[train]\nfiles = ["a.csv"]\n')
    (seen,) = read_dataset(path).train
    assert len(seen) == 400 - 13
    np.testing.assert_allclose(seen.q, truth.q[: len(seen)], atol=1e-9)
    np.testing.assert_allclose(seen.rates[20:-20], truth.rates[20 : len(seen) - 20], atol=0.02)
    path.write_text(text.replace("[0, 0.13]", "[0, 0.13, 0]") + '[train]\nfiles = ["a.csv"]\n')
    with pytest.raises(DataError, match="`position_delay` must be one number or one per position, 2; got 3"):
        read_dataset(path)


@pytest.mark.parametrize(
    ("delays", "message"),
    [
        ((0.1, 0.2, 0.3), "`seen`: `position_delay` must be one number or one per position, 2; got 3"),
        ((1e3,), "`seen`: `position_delay` must be shorter than the recording; got 1000.0 s for"),
    ],
)
def test_a_late_position_that_does_not_fit_is_refused(delays, message):
    with pytest.raises(DataError, match=message):
        advance_positions(two_joints((0.0, 0.0), 0.01 * np.arange(200)), delays)

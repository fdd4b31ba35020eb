"""What acts follows an input by a first-order lag, exactly at any time stamps, and nothing is made up."""

from typing import Literal

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, Trajectory, read_dataset
from symoden.data.signals._lag import SETTLED, lag_inputs

LAGS = st.floats(0.01, 0.5)


def logged(ts, us):
    us = np.asarray(us, float).reshape(len(ts), -1)
    return Trajectory(name="run", ts=ts, q=ts[:, None], rates=ts[:, None], us=us)


def uneven(seed, samples=400, step=0.01):
    rng = np.random.default_rng(seed)
    return rng, 100 * rng.normal() + np.cumsum(step * rng.uniform(0.3, 1.7, samples))


@given(seed=st.integers(0, 10_000), lag=LAGS)
def test_a_step_is_answered_by_an_exponential(seed, lag):
    rng, ts = uneven(seed)
    low, high = rng.normal(size=2)
    after = ts >= ts[300]
    acting = lag_inputs(logged(ts, np.where(after, high, low)), (lag,), hold="zero")
    elapsed = np.maximum(acting.ts - ts[300], 0.0)
    answer = high * elapsed + (low - high) * lag * -np.expm1(-elapsed / lag)  # ∫ x dt since then.
    later = acting.ts[:-1] >= ts[300]
    impulses = np.diff(acting.ts) * acting.us[:-1, 0]
    np.testing.assert_allclose(impulses[later], np.diff(answer)[later], atol=1e-12)
    np.testing.assert_allclose(acting.us[acting.ts < ts[300], 0], low, atol=1e-12)


@given(seed=st.integers(0, 10_000), lag=LAGS)
def test_a_ramp_comes_late_by_the_lag(seed, lag):
    rng, ts = uneven(seed)
    slope, start = rng.normal(size=2)
    acting = lag_inputs(logged(ts, start + slope * (ts - ts[0])), (lag,), hold="linear")
    elapsed = acting.ts - ts[0]
    late = start + slope * (elapsed - lag * -np.expm1(-elapsed / lag))
    np.testing.assert_allclose(acting.us[:, 0], late, atol=1e-9)


@given(seed=st.integers(0, 10_000), lag=LAGS)
def test_rows_in_between_change_nothing(seed, lag):
    """Every impulse of a held input is the same, and what acts at the rows of straight lines."""
    rng, ts = uneven(seed, samples=200)
    u = rng.normal(size=200)
    middle = (ts[:-1] + ts[1:]) / 2
    dense = np.insert(ts, np.arange(1, 200), middle)
    holds: tuple[tuple[Literal["zero", "linear"], np.ndarray], ...]
    holds = ("zero", u[:-1]), ("linear", (u[:-1] + u[1:]) / 2)
    for hold, between in holds:
        plain = lag_inputs(logged(ts, u), (lag,), hold=hold)
        finer = lag_inputs(logged(dense, np.insert(u, np.arange(1, 200), between)), (lag,), hold=hold)
        finer = finer.cut(int(np.searchsorted(finer.ts, plain.ts[0])), len(finer), name="run")
        np.testing.assert_array_equal(finer.ts[::2], plain.ts)
        values = finer.us[::2, 0]
        if hold == "zero":
            areas = np.diff(finer.ts) * finer.us[:-1, 0]
            values = np.append((areas[::2] + areas[1::2]) / np.diff(plain.ts), plain.us[-1, 0])
        np.testing.assert_allclose(values, plain.us[:, 0], atol=1e-9)


def test_each_input_has_its_own_lag_and_the_first_samples_are_left_out():
    ts = 0.01 * np.arange(300)
    u = np.random.default_rng(0).normal(size=(300, 2))
    acting = lag_inputs(logged(ts, u), (0.0, 0.2), hold="zero")
    assert acting.ts[0] == pytest.approx(SETTLED * 0.2)
    kept = np.isin(ts, acting.ts)
    np.testing.assert_array_equal(acting.us[:, 0], u[kept, 0])
    other = lag_inputs(logged(ts, u + np.where(np.arange(300) < 1, 10.0, 0.0)[:, None]), (0.0, 0.2), hold="zero")
    left = 10 * np.exp(-SETTLED + 0.01 / 0.2)  # What acted before, and until the second row, is nearly gone.
    assert 0.1 * left < np.abs(other.us - acting.us).max() < 1.001 * left


def test_what_is_never_pushed_is_left_whole():
    ts = 0.01 * np.arange(50)
    free = logged(ts, np.zeros(50))
    assert lag_inputs(free, (10.0,), hold="zero") is free
    pushed = logged(ts, np.sin(ts))
    assert lag_inputs(pushed, (0.0,), hold="zero") is pushed


@pytest.mark.parametrize(
    ("lags", "message"),
    [
        ((0.1, 0.2, 0.3), "`run`: `input_lag` must be one number or one per input, 2; got 3"),
        ((1.0,), "`run`: `input_lag` must be less than a third of the recording.*; got 1 s for 2.99 s"),
    ],
)
def test_lags_that_cannot_be_are_refused(lags, message):
    ts = 0.01 * np.arange(300)
    with pytest.raises(DataError, match=message):
        lag_inputs(logged(ts, np.stack([ts, ts + 1], axis=1)), lags, hold="zero")


@pytest.mark.filterwarnings("ignore::symoden.data.DataWarning")
def test_a_description_says_it(tmp_path):
    ts = 0.01 * np.arange(400)
    u = np.sign(np.sin(3 * ts))
    np.savetxt(tmp_path / "a.csv", np.stack([ts, ts**2, u], 1), delimiter=",", header="t,q,u", comments="")
    text = 'space = "R1"\ntime = "t"\npositions = ["q"]\ninputs = ["u"]\ninput_lag = {}\n[train]\nfiles = ["a.csv"]\n'

    def read(lag):
        path = tmp_path / "a.toml"
        path.write_text(text.format(lag))
        return read_dataset(path).train[0]

    plain, late = read(0), read("[0.1]")
    assert len(plain) - len(late) == 30
    np.testing.assert_allclose(late.us, lag_inputs(plain, (0.1,), hold="zero").us)
    np.testing.assert_array_equal(late.q, plain.q[30:])
    with pytest.raises(DataError, match=r"`input_lag` must be one number or one per input, 1; got 2"):
        read("[0.1, 0.1]")
    with pytest.raises(DataError, match=r"`input_lag` must be a number of seconds, at least 0, or a list"):
        read(-0.1)

"""Single samples that cannot be, told from motion, noise and impacts."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import read_dataset
from symoden.data.logs._logs import Log
from symoden.data.logs._spikes import find_spikes

STEP, SIZE = 0.01, 400
NAMES = {"time": ("t",), "positions": ("q",), "rates": ("v",), "inputs": ()}


def log(q, v, ts=None):
    ts = STEP * np.arange(len(q)) if ts is None else ts
    return Log(
        part="train", name="r", path=Path("r.csv"), rows=np.arange(len(ts)),
        ts=ts, q=np.array(q)[:, None], rates=np.array(v)[:, None], us=np.zeros((len(q), 0)), names=NAMES,
    )  # fmt: skip


def swing(seed, *, noise=0.003, uneven=0.0):
    generator = np.random.default_rng(seed)
    ts = STEP * (np.arange(SIZE) + uneven * generator.uniform(-0.5, 0.5, SIZE))
    angle = generator.uniform(3, 9) * ts + generator.uniform(0, 6)
    q = np.sin(angle) + noise * generator.normal(size=SIZE)
    return ts, q, 6 * np.cos(angle) + 10 * noise * generator.normal(size=SIZE)


def rows_of(found, channel):
    return [int(row) for each in found if each.channel == channel for row in each.rows]


@given(
    seed=st.integers(0, 500),
    rows=st.lists(st.integers(6, SIZE - 7), min_size=1, max_size=4, unique_by=lambda row: row // 10),
    size=st.floats(0.1, 2.5),
    uneven=st.floats(0.0, 0.8),
)
def test_wrong_samples_are_found_and_no_others(seed, rows, size, uneven):
    rows = [row for row in sorted(rows) if all(abs(row - other) > 8 for other in rows if other != row)]
    ts, q, v = swing(seed, uneven=uneven)
    q[rows] += size
    found = find_spikes(log(q, v, ts), np.array([True]))
    assert rows_of(found, "q") == rows
    assert rows_of(found, "v") == []
    assert all(each.largest == pytest.approx(size, abs=0.05) for each in found)


@pytest.mark.parametrize("turns", [0, 3, 30])
def test_a_wrong_angle_is_one_however_often_it_has_gone_round(turns):
    ts, q, v = swing(3, noise=2e-4)
    pace = 2 * np.pi * turns / ts[-1]
    q, v = q + pace * ts, v + pace
    q[200] += 0.09
    assert rows_of(find_spikes(log(q, v, ts), np.array([True])), "q") == [200]


@given(seed=st.integers(0, 2000), noise=st.sampled_from([0.0, 1e-4, 0.01, 0.1]), uneven=st.floats(0.0, 0.8))
def test_motion_and_noise_have_none(seed, noise, uneven):
    ts, q, v = swing(seed, noise=noise, uneven=uneven)
    assert find_spikes(log(q, v, ts), np.array([True])) == ()


@given(
    step=st.floats(0.02, 0.1),
    pace=st.lists(st.floats(0.97, 1.03), min_size=5, max_size=5),
    first=st.floats(0.0, 1.0),
    back=st.floats(0.0, 0.3),
    more=st.floats(0.0, 0.6),
    rest=st.tuples(st.integers(4, 20), st.integers(6, 30)),
    turn=st.sampled_from([1.0, -1.0]),
)
def test_a_sharp_stop_between_rare_samples_is_none(step, pace, first, back, more, rest, turn):
    """A winch whose motor is switched off, and which then gives way, as a log of ten samples a second had it."""
    way = [*np.zeros(rest[0]), first, *pace, -back, -back * more, *np.zeros(rest[1])]
    q = np.round(0.22 * np.cumsum(way), 4)
    ts = step * np.arange(len(q))
    for each in (q, q[::-1]):
        assert find_spikes(log(turn * each, np.zeros(len(q)), ts), np.array([False])) == ()


@given(seed=st.integers(0, 500), row=st.integers(10, SIZE - 10), kick=st.floats(1.0, 40.0))
def test_an_impact_is_none(seed, row, kick):
    ts, q, v = swing(seed, noise=1e-5)
    q += kick * np.maximum(0, ts - ts[row])
    v += kick * (np.arange(SIZE) >= row)
    assert find_spikes(log(q, v, ts), np.array([True])) == ()


def test_a_rounded_signal_has_none_and_a_wrapped_angle_neither():
    ts, q, v = swing(3, noise=0.0)
    assert find_spikes(log(np.round(q / 0.01) * 0.01, np.round(v / 0.2) * 0.2, ts), np.array([True])) == ()
    turning = 12 * ts + 0.001 * np.random.default_rng(0).normal(size=SIZE)
    assert find_spikes(log(np.mod(turning, 2 * np.pi), np.full(SIZE, 12.0), ts), np.array([True])) == ()


def time_stamps(kind, generator, size=4000):
    """Time stamps of a logger that waits, jitters, merges two clocks, or writes in bursts."""
    steps = {
        "waits": generator.exponential(STEP, size) + 1e-5,
        "jitters": generator.uniform(0.001, 0.019, size),
        "bursts": np.tile([0.001, 0.001, 0.028], size // 3),
    }
    if kind == "two clocks":
        return np.unique(np.concatenate([np.arange(0, 30, STEP), np.arange(0.0013, 30, 0.0333)]))
    return np.cumsum(steps[kind])


@pytest.mark.parametrize("kind", ["waits", "jitters", "two clocks", "bursts"])
def test_noise_at_uneven_time_stamps_has_none_and_wrong_samples_are_still_found(kind):
    false, missed, planted = 0, 0, 0
    for seed in range(6):
        generator = np.random.default_rng(seed)
        ts = time_stamps(kind, generator)
        q = np.sin(3 * ts) + 0.01 * generator.normal(size=len(ts))
        v = 3 * np.cos(3 * ts) + 0.03 * generator.normal(size=len(ts))
        false += len(find_spikes(log(q, v, ts), np.array([True])))
        rows = np.arange(200, len(ts) - 10, 200)
        q[rows] += 0.5
        missed += len(set(rows) - set(rows_of(find_spikes(log(q, v, ts), np.array([True])), "q")))
        planted += len(rows)
    assert false == 0
    assert missed < 0.15 * planted


@given(seed=st.integers(0, 500), flickers=st.integers(1, 15), step=st.floats(1e-5, 0.015), rate=st.booleans())
def test_one_that_flickers_by_one_count_at_rest_has_none_but_a_wrong_sample_is_found(seed, flickers, step, rate):
    generator = np.random.default_rng(seed)
    q, v = np.full(20 * SIZE, 0.3), np.zeros(20 * SIZE)
    v[generator.choice(len(v), flickers * rate, replace=False)] = 0.1
    q[generator.choice(len(q), flickers, replace=False)] += step * generator.choice([-1, 1], flickers)
    assert find_spikes(log(q, v), np.array([True])) == ()
    q[50], v[60] = 1.3, 5.0
    found = find_spikes(log(q, v), np.array([True]))
    assert rows_of(found, "q") == [50]
    assert rows_of(found, "v") == [60]


def test_a_rate_that_the_positions_confirm_is_none():
    ts, q, _ = swing(2, noise=0.0)
    ts[150] += 0.3 * STEP  # A late time stamp: what is off by that is too little to be a wrong position.
    v = np.concatenate([[0.0], np.diff(q) / np.diff(ts)])
    assert find_spikes(log(q, v, ts), np.array([True])) == ()
    v[80] += 5.0
    assert rows_of(find_spikes(log(q, v, ts), np.array([True])), "v") == [80]


def test_a_wrong_position_makes_wrong_rates_that_are_its_differences():
    ts, q, _ = swing(2, noise=0.0)
    q[150] += 0.3
    v = np.concatenate([[0.0], np.diff(q) / np.diff(ts)])
    found = find_spikes(log(q, v, ts), np.array([True]))
    assert rows_of(found, "q") == [150]  # Whose row, and with it the rate up to it, is left out.
    assert rows_of(found, "v") == [151]


@given(seed=st.integers(0, 500), wrapped=st.booleans(), glitch=st.integers(10, SIZE - 10))
def test_degrees_taken_for_rad_have_only_the_spikes_that_they_have(seed, wrapped, glitch):
    ts, q, v = swing(seed, noise=1e-4)
    q = np.degrees(q)
    q[glitch] += 25.0
    shown = np.mod(q, 360) if wrapped else q
    assert rows_of(find_spikes(log(shown, v, ts), np.array([True])), "q") == [glitch]


def test_too_few_rows_tell_nothing():
    ts, q, v = swing(0)
    assert find_spikes(log(q[:8], v[:8], ts[:8]), np.array([False])) == ()


def test_they_are_left_out_of_what_is_read(tmp_path):
    ts, q, _ = swing(1)
    q[[50, 200]] += 0.7
    table = "\n".join(["t,q", *(f"{t:.6f},{a:.6f}" for t, a in zip(ts, q, strict=True))])
    (tmp_path / "r.csv").write_text(table)
    (tmp_path / "d.toml").write_text('space = "T1"\ntime = "t"\npositions = ["q"]\n[train]\nfiles = ["r.csv"]\n')
    with pytest.warns(UserWarning, match="2 rows with samples that stand out alone"):
        dataset = read_dataset(tmp_path / "d.toml")
    assert len(dataset.train[0]) == SIZE - 2
    assert np.abs(dataset.train[0].q).max() < 1.1

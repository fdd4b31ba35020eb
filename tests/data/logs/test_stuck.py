"""Positions that stand still while their velocities do not are left out; a machine at rest is not."""

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from symoden.data import DataWarning, check_dataset, read_dataset

TEXT = 'space = "T1"\ntime = "t"\npositions = ["q"]\n{rates}inputs = ["u"]\n[train]\nfiles = ["a.csv"]\n'
STEP = 0.01


def turning(samples=1200, *, seed=0, pace=1.5):
    """A joint that swings and turns over: time, rounded position, noisy velocity, input."""
    t = STEP * np.arange(samples)
    phase = np.random.default_rng(seed).uniform(0, 6)
    q = 2.5 * np.sin(1.7 * t + phase) + pace * t
    v = 4.25 * np.cos(1.7 * t + phase) + pace + 0.02 * np.random.default_rng(seed).normal(size=samples)
    return np.stack([t, np.round(q, 5), v, np.sin(3 * t)], axis=1)


def written(folder, rows, *, rates='velocities = ["v"]\n'):
    np.savetxt(folder / "a.csv", rows, delimiter=",", header="t,q,v,u", comments="", fmt="%.17g")
    path = folder / "arm.toml"
    path.write_text(TEXT.format(rates=rates))
    return path


def found(path):
    (check,) = check_dataset(path).recordings
    return [one for one in check.findings if one.level != "note"]


@settings(max_examples=10)
@given(seed=st.integers(0, 1000), start=st.integers(100, 600), length=st.integers(150, 400))
def test_a_frozen_position_is_left_out_as_if_its_cells_were_empty(tmp_path_factory, seed, start, length):
    folder = tmp_path_factory.mktemp("frozen")
    rows = turning(seed=seed)
    stop = start + length
    rows[start:stop, 1] = rows[start, 1]
    path = written(folder, rows)
    assert [(one.kind, one.level, one.channel) for one in found(path)] == [
        ("stuck", "masked", "q"),
        ("gap", "masked", ""),
    ]
    assert found(path)[0].spans == ((pytest.approx(rows[start, 0]), pytest.approx(rows[stop - 1, 0])),)
    with pytest.warns(
        DataWarning, match=r"left out in `a`: \d+ rows in which `q` does not .* from .* s while `v` says that it moves"
    ) as said:
        recordings = read_dataset(path).train
    assert len(said) == 1
    rows[start:stop, 1] = np.nan
    with pytest.warns(DataWarning, match="rows without all numbers"):
        blanked = read_dataset(written(folder, rows)).train
    assert [each.name for each in recordings] == ["a#1", "a#2"]
    for one, other in zip(recordings, blanked, strict=True):
        np.testing.assert_array_equal(one.q, other.q)
        np.testing.assert_array_equal(one.ts, other.ts)


def test_what_no_velocity_contradicts_is_a_warning_and_its_jump_no_other_one(tmp_path):
    rows = turning()
    rows[400:760, 1] = rows[400, 1]
    rows[760:, 1] += rows[400, 1] + 5.0 - rows[760, 1]
    assert [(one.kind, one.level) for one in found(written(tmp_path, rows, rates=""))] == [("stuck", "warning")]


@settings(max_examples=25)
@given(
    seed=st.integers(0, 1000),
    bias=st.floats(-0.3, 0.3),
    noise=st.floats(0.0, 1.0),
    lag=st.floats(0.001, 0.05),
    rest=st.integers(50, 600),
)
@example(seed=0, bias=0.3, noise=0.0, lag=0.001, rest=600)
def test_a_machine_that_a_stop_has_caught_is_not_stuck_whatever_its_velocity_shows(
    tmp_path_factory, seed, bias, noise, lag, rest
):
    rows = turning(seed=seed, pace=0.0)
    caught = np.repeat(rows[600:601], rest, axis=0)
    caught[:, 0] += STEP * np.arange(rest)
    caught[:, 2] = 0.0
    rows[600:, 0] += STEP * rest
    rows = np.concatenate([rows[:600], caught, rows[600:]])
    shown = rows[:, 2] + bias + noise * np.random.default_rng(seed).normal(size=len(rows))
    keeps = np.exp(-STEP / lag)
    for k in range(1, len(rows)):
        shown[k] = keeps * shown[k - 1] + (1 - keeps) * shown[k]
    rows[:, 2] = shown
    assert ("stuck", "masked") not in {
        (one.kind, one.level) for one in found(written(tmp_path_factory.mktemp("c"), rows))
    }


def masked(folder, rows):
    return [one for one in found(written(folder, rows)) if (one.kind, one.level) == ("stuck", "masked")]


@pytest.mark.parametrize("shown", ["held", "late"])
def test_a_machine_at_its_stops_is_not_stuck_though_its_velocity_is_held_or_late(tmp_path, shown):
    t = STEP * np.arange(3000)
    if shown == "late":  # By 0.6 s, beside stops at which it rests for 1 s.
        q = np.clip(1.05 * np.sin(0.6 * t), -1, 1)
        v = np.where(np.abs(q) < 1, 0.63 * np.cos(0.6 * t), 0.0)
        v = np.concatenate([np.full(60, v[0]), v[:-60]])
    else:
        q = np.minimum(np.sin(1.7 * t) + 0.3 * np.sin(0.9 * t), 0.8)
        last = np.maximum.accumulate(np.where(q < 0.8, np.arange(len(t)), 0))
        v = (1.7 * np.cos(1.7 * t) + 0.27 * np.cos(0.9 * t))[last]
    assert masked(tmp_path, np.stack([t, np.round(q, 5), v, np.sin(3 * t)], axis=1)) == []


def test_a_position_that_is_logged_more_slowly_than_the_table_is_no_stuck_sensor(tmp_path):
    rows = turning(3000)
    rows[:, 1] = rows[40 * (np.arange(3000) // 40), 1]
    said = found(written(tmp_path, rows))
    assert [one.text for one in said if one.kind == "stuck"] == []
    assert any("repeats its last reading" in one.text for one in said)


def noisy(seed, *, noise, step=1e-4):
    """A slow swing without velocities whose sensor has noise beside a finer rounding."""
    rows = turning(600, seed=seed, pace=0.0)
    rows[:, 1] = step * np.round((0.3 * rows[:, 1] + np.random.default_rng(seed).normal(0, noise, 600)) / step)
    return rows


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("length", [30, 80])
def test_a_noisy_position_that_stops_and_then_leaps_is_stuck(tmp_path, seed, length):
    rows = noisy(seed, noise=1e-3)
    assert found(written(tmp_path, rows, rates="")) == []
    moves = np.abs(rows[length:, 1] - rows[:-length, 1])
    start = int(np.argmax(moves))  # Where it goes on elsewhere.
    rows[start : start + length, 1] = rows[start, 1]
    (one,) = found(written(tmp_path, rows, rates=""))
    assert (one.kind, one.level, one.channel) == ("stuck", "warning", "q")
    assert one.spans == ((pytest.approx(rows[start, 0]), pytest.approx(rows[start + length - 1, 0])),)


@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-3])
@pytest.mark.parametrize("seed", range(3))
def test_an_encoder_that_rests_and_is_then_moved_is_not(tmp_path, noise, seed):
    """Stick and slip within a row, and a start from rest; what has noise keeps it."""
    rng = np.random.default_rng(seed)
    slips = np.repeat(np.cumsum(rng.choice([-1, 1], 20) * rng.uniform(0.1, 0.5, 20)), 30)
    rows = noisy(seed, noise=0.0)
    for way in (slips, np.where(np.arange(600) < 60, rows[60, 1], rows[:, 1])):
        rows[:, 1] = 1e-4 * np.round((way + rng.normal(0, noise, 600)) / 1e-4)
        assert [one for one in found(written(tmp_path, rows, rates="")) if one.kind == "stuck"] == []


def test_a_position_that_stands_still_all_along_takes_its_file_out(tmp_path):
    for name, rows in (("a", turning()), ("b", turning(seed=1))):
        if name == "b":
            rows[:, 1] = rows[0, 1]
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header="t,q,v,u", comments="", fmt="%.17g")
    path = tmp_path / "arm.toml"
    path.write_text(TEXT.format(rates='velocities = ["v"]\n').replace('["a.csv"]', '["a.csv", "b.csv"]'))
    moves, frozen = (check.findings for check in check_dataset(path).recordings)
    assert not [one for one in moves if one.kind == "stuck"]
    (one,) = [one for one in frozen if one.kind == "stuck"]
    assert "`q` does not change in any row while the machine moves" in one.text
    assert one.advice.startswith("Take this file out of `files`")

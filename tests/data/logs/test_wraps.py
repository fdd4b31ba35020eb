"""A clock that is full and begins anew is counted on where nothing else explains it; else times must increase."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, check_dataset, read_dataset
from symoden.data.logs._logs import Log
from symoden.data.logs._wraps import find_wraps, unwrapped_clock

TEXT = """
space = "T1"
time = "t"
positions = ["q"]
units = {{ {units} }}
[train]
files = ["run.csv"]
"""
STEP = 0.005  # [s]


def written(folder, stamps, units="t = 'ms'", *, fmt="%.10g"):
    """The description of a swing whose clock shows these stamps."""
    q = np.sin(3 * STEP * np.arange(len(stamps)))
    columns = np.stack([stamps, q], axis=1)
    np.savetxt(folder / "run.csv", columns, delimiter=",", header="t,q", comments="", fmt=[fmt, "%.15g"])
    path = folder / "swing.toml"
    path.write_text(TEXT.format(units=units))
    return path


def shown(taken, bits, *, signed=False):
    """What a counter of so many bits shows."""
    half = 2**bits // 2 if signed else 0
    return (np.asarray(taken) + half) % 2**bits - half


def log_of(ts):
    """A log with nothing but a clock [s]."""
    none = np.zeros((len(ts), 0))
    return Log(
        part="train", name="run", path=Path("run.npz"), rows=np.arange(len(ts)), ts=ts, q=none, rates=None, us=none,
        names={"time": ("t",), "positions": (), "inputs": ()},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("bits", "tick", "divided", "signed"),
    [
        (16, 1e-3, False, False),
        (16, 1e-3, True, False),
        (24, 1e-6, False, False),
        (31, 1e-6, False, False),
        (32, 1e-6, False, False),
        (32, 1e-6, True, False),
        (32, 1e-3, True, True),
        (16, 1e-4, False, True),
    ],
)
def test_a_counter_that_begins_anew_is_counted_on(tmp_path, bits, tick, divided, signed):
    start = 2 ** (bits - signed) - round(1.5 / tick)
    taken = start + np.round(STEP / tick * np.arange(600)).astype(np.int64)
    stamps, units = shown(taken, bits, signed=signed), f"t = {tick}"
    assert (np.diff(stamps) < 0).sum() == 1
    if divided:
        stamps, units = stamps * tick, ""
    path = written(tmp_path, stamps, units)
    (recording,) = read_dataset(path).train
    np.testing.assert_allclose(recording.ts - recording.ts[0], tick * (taken - taken[0]), atol=1e-5)
    (check,) = check_dataset(path).recordings
    (note,) = [each for each in check.findings if each.kind == "time"]
    assert (note.level, note.channel) == ("note", "t")
    assert f"goes back once, at line 302 (row 300), by 2^{bits} ticks" in note.text
    assert check.duration == pytest.approx(recording.duration)


def test_it_may_begin_anew_often_and_be_measured_in_fractions_of_a_second(tmp_path):
    taken = 5 * np.arange(40_000) + np.arange(40_000) // 9
    path = written(tmp_path, shown(taken, 16) / 1000, "", fmt="%.3f")
    (recording,) = read_dataset(path).train
    np.testing.assert_allclose(recording.ts, taken / 1000, atol=1e-9)
    (check,) = check_dataset(path).recordings
    (note,) = [each for each in check.findings if each.kind == "time"]
    assert "goes back 3 times, at line 12825 (row 12823) first, by 2^16 ticks of 1 ms" in note.text
    assert len(note.spans) == 3


@pytest.mark.parametrize(("lost", "counted"), [(3, True), (40, False)])
def test_rows_may_be_lost_there_but_not_many(tmp_path, lost, counted):
    taken = np.delete(64_000 + 5 * np.arange(800), slice(306, 306 + lost))  # The last before 65536 is row 307.
    path = written(tmp_path, shown(taken, 16))
    if counted:
        np.testing.assert_allclose(read_dataset(path).train[0].ts, taken / 1000)
    else:
        with pytest.raises(DataError, match="times must increase"):
            read_dataset(path)


@pytest.mark.parametrize(
    "stamps",
    [
        5 * (np.arange(800) % 400),  # Two recordings.
        np.concatenate([shown(64_000 + 5 * np.arange(600), 16), 5 * np.arange(100)]),  # A wrap, and another recording.
        shown(64_000 + 5.25 * np.arange(800), 16),  # No whole milliseconds.
        np.roll(60_000 + 5 * np.arange(1000), 500),  # Rows in another order.
    ],
)
def test_what_goes_back_for_another_reason_is_refused(tmp_path, stamps):
    path = written(tmp_path, stamps)
    with pytest.raises(DataError, match="times must increase"):
        read_dataset(path)
    (check,) = check_dataset(path).recordings
    assert [each.level for each in check.findings if each.kind == "time"] == ["refused"]


@pytest.mark.parametrize(
    "frames",
    [
        np.round(np.arange(500) / 30, 4),  # Each as long as 24 bits of microseconds but for 4 frames, and set to 0.
        np.round(0.5 + np.arange(500) / 30, 4),  # Whole tenths of milliseconds, which are no microseconds.
        np.random.default_rng(0).uniform(1, 1.02) + np.arange(330) / 20,  # No ticks at all.
    ],
)
def test_recordings_of_one_length_are_not_joined(frames):
    log = log_of(np.tile(frames, 3))
    assert unwrapped_clock(log, {}) is log


def test_rows_in_another_order_where_a_clock_begins_anew_are_left_as_they_are():
    ticks = np.concatenate([np.arange(65_000, 65_534, 2), [65_534, 1, 65_535, 3], np.arange(5, 900, 2)])
    log = log_of(ticks / 1000)
    assert unwrapped_clock(log, {}) is log


@given(ticks=st.lists(st.integers(3, 7), min_size=30, max_size=60), first=st.integers(0, 65_535))
def test_stamps_go_on_as_they_were_taken_wherever_the_clock_is_full(ticks, first):
    taken = first + np.cumsum(ticks)
    log = unwrapped_clock(log_of(shown(taken, 16) / 1000), {})
    np.testing.assert_allclose(np.diff(log.ts), np.diff(taken) / 1000, atol=1e-9)
    assert len(find_wraps(log)) == (taken[-1] >= 65_536 > taken[0])

"""Rows that arrived several at once go back onto the even clock they were taken by; stamps that may be right stay."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, DataWarning, check_dataset, read_dataset
from symoden.data.logs._arrivals import even_times

TEXT = """
space = "T1"
time = "t"
positions = ["q"]
inputs = ["u"]
[train]
files = ["run.csv"]
"""
STEP, POLL = 1 / 120, 0.0101


def arrivals(taken, poll=POLL):
    """When a program that looks for messages once in a while gets to each: those that wait come at once."""
    looks = np.ceil((taken + 1e-3) / poll)
    return poll * looks + 3e-5 * (np.arange(len(taken)) - np.searchsorted(looks, looks))


def written(folder, stamps, q, text=TEXT):
    """The description of one recording."""
    columns = np.stack([stamps, q, np.sign(np.sin(3 * stamps))], axis=1)
    np.savetxt(folder / "run.csv", columns, delimiter=",", header="t,q,u", comments="", fmt="%.9g")
    path = folder / "wheel.toml"
    path.write_text(text)
    return path


def angle(t):
    """A wheel that turns round and round, as an encoder shows it."""
    return (8 * t + 2 * np.sin(2 * t) + np.pi) % (2 * np.pi) - np.pi


def speed(t):
    """Its velocity."""
    return 8 + 4 * np.cos(2 * t)


@pytest.mark.parametrize("lost", [0.0, 0.02])
def test_velocities_are_those_of_even_samples_and_not_of_stamps_of_arrival(tmp_path, lost):
    rng = np.random.default_rng(1)
    taken = STEP * np.arange(1200)
    taken = taken[rng.random(1200) >= lost]
    q = angle(taken) + 1e-3 * rng.standard_normal(len(taken))
    path = written(tmp_path, arrivals(taken), q)
    with pytest.warns(DataWarning, match="not taken at the times that were logged, `run`: .* arrived at once"):
        (recording,) = read_dataset(path).train
    steps = np.diff(recording.ts)
    assert np.median(steps) == pytest.approx(STEP, rel=0.02)
    assert steps.min() > 0.9 * STEP
    errors = recording.rates[:, 0] - speed(recording.ts)
    assert np.sqrt(np.mean(errors**2)) < 0.8  # Slopes of the positions over the stamps would be off by 100 rad/s.
    (note,) = [each for each in check_dataset(path).recordings[0].findings if each.kind == "clocks"]
    assert (note.level, note.channel) == ("note", "t")
    assert "such as `dt = 0.008" in note.advice


def test_the_step_of_the_clock_may_be_given_and_lost_rows_leave_their_ticks_empty(tmp_path):
    taken = np.delete(STEP * np.arange(600), [50, 51, 200])
    path = written(tmp_path, arrivals(taken), angle(taken), TEXT.replace('"t"', f'"t"\ndt = {STEP:.9g}', 1))
    (recording,) = read_dataset(path).train
    np.testing.assert_allclose(recording.ts - recording.ts[0], taken, atol=STEP * 1.5)
    whole = np.diff(recording.ts) / STEP
    np.testing.assert_allclose(whole, np.round(whole), atol=1e-5)
    assert np.round(whole).sum() == pytest.approx(599, abs=1)
    assert {each.kind for each in check_dataset(path).recordings[0].findings} == {"wrap"}


def test_rows_that_were_lost_do_not_make_the_clock_as_slow_as_they_are_apart(tmp_path):
    taken = STEP * np.arange(2000)
    taken = taken[np.random.default_rng(3).random(2000) >= 0.15]
    path = written(tmp_path, arrivals(taken), angle(taken))
    with pytest.warns(DataWarning, match="an even clock of"):
        recordings = read_dataset(path).train
    step, apart = np.median(np.diff(recordings[0].ts)), STEP / 0.85
    assert 0.98 * STEP < step < (STEP + apart) / 2


@pytest.mark.parametrize("step", [0.001, 0.0007, 0.0012])
def test_rounded_stamps_of_which_many_are_equal_are_even_again(tmp_path, step):
    taken = step * np.arange(1500)
    stamps = np.floor(taken / 0.001 + np.random.default_rng(0).uniform(-0.4, 0.4, 1500)) * 0.001
    stamps[700:] += 0.2
    path = written(tmp_path, stamps, angle(taken))
    with pytest.warns(DataWarning, match="1 gap"), pytest.warns(DataWarning, match="not taken at the times"):
        recordings = read_dataset(path).train
    assert [len(each) for each in recordings] == [700, 800]
    for each in recordings:
        steps = np.diff(each.ts) / step
        assert np.median(steps) == pytest.approx(1, rel=0.01)
        assert np.mean(np.abs(steps - 1) > 0.02) < 0.005  # A tick that is left empty now and then.


def test_a_step_that_is_longer_than_rows_are_apart_is_refused(tmp_path):
    taken = STEP * np.arange(600)
    path = written(tmp_path, arrivals(taken), angle(taken), TEXT.replace('"t"', '"t"\ndt = 0.02', 1))
    with pytest.raises(DataError, match=r"got one in 0\.008\d* s for `dt` = 0\.02"):
        read_dataset(path)


@pytest.mark.parametrize("held", [True, False])
def test_rows_that_repeat_the_one_before_or_lack_their_position_keep_their_stamps(tmp_path, held):
    taken = 0.01 * np.arange(400)
    stamps = np.sort(np.concatenate([taken, taken[::5] + 3e-5]))
    q = np.sin(2 * taken[np.searchsorted(taken, stamps, side="right") - 1])
    q[np.flatnonzero(np.diff(stamps) < 1e-4) + 1] *= 1 if held else np.nan
    assert not [
        each for each in check_dataset(written(tmp_path, stamps, q)).recordings[0].findings if each.channel == "t"
    ]


@pytest.mark.parametrize("every", [1, 7, 150])
def test_rows_that_repeat_the_one_before_stamp_and_all_are_left_out(tmp_path, every):
    taken = 0.01 * np.arange(400)
    q = np.where(taken == 0.05, np.nan, np.sin(2 * taken))
    path = written(tmp_path, taken, q)
    with pytest.warns(DataWarning, match="1 row"):
        (once,) = read_dataset(path).train
    rows = np.sort(np.concatenate([np.arange(400), np.arange(1, 400, every)]))
    written(tmp_path, taken[rows], q[rows])
    with pytest.warns(DataWarning, match="1 row"):
        (twice,) = read_dataset(path).train
    np.testing.assert_array_equal(twice.ts, once.ts)
    np.testing.assert_array_equal(twice.q, once.q)
    (found,) = (each for each in check_dataset(path).recordings[0].findings if each.kind == "time")
    assert found.level == "masked"
    assert found.text.startswith(f"{len(rows) - 400} row")
    assert found.text.endswith("first at line 4 (row 2)")
    other = q[rows]
    other[2] += 1e-6  # One of them is another sample: which is right, none can know.
    written(tmp_path, taken[rows], other)
    with pytest.raises(DataError, match="times must increase"):
        read_dataset(path)


@given(seed=st.integers(0, 2**32 - 1), jitter=st.floats(0, 0.8))
def test_samples_at_uneven_times_keep_their_stamps(tmp_path_factory, seed, jitter):
    rng = np.random.default_rng(seed)
    stamps = 0.01 * (np.arange(300) + jitter * rng.uniform(0, 1, 300))
    path = written(tmp_path_factory.mktemp("uneven"), stamps, np.sin(4 * stamps))
    (log,) = (each.log for each in check_dataset(path).recordings)
    np.testing.assert_array_equal(log.ts, np.array([float(f"{each:.9g}") for each in stamps]))


@given(
    gaps=st.lists(st.integers(1, 5), min_size=2, max_size=200),
    delays=st.lists(st.floats(0, 0.9), min_size=200, max_size=200),
    step=st.floats(1e-4, 1.0),
)
def test_no_two_rows_have_a_tick_in_common_and_none_was_taken_after_it_arrived(gaps, delays, step):
    ticks = np.cumsum(gaps)
    stamps = step * (ticks + np.array(delays[: len(ticks)]))
    times = even_times(stamps, step)
    whole = (times - times[0]) / step
    np.testing.assert_allclose(whole, np.round(whole), atol=1e-6)
    assert (np.diff(np.round(whole)) >= 1).all()
    assert (times <= stamps + 1e-9 * step).all()
    late = stamps - times
    assert late.max() < 2 * step  # The first row's own delay, and less than a tick.

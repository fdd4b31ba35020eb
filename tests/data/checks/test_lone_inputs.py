"""Samples of an input far beyond all others are named; those that the machine was not given are left out."""

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset
from tests.data.conftest import arm, written


def spikes(folder, u):
    log = arm(samples=len(u))
    log[:, 5] = u
    (check,) = check_dataset(written(folder, log)).recordings
    return [one for one in check.findings if one.kind == "spike"]


def torque(seed, kind):
    """An input of 500 samples."""
    generator = np.random.default_rng(seed)
    k = np.arange(500)
    made = {
        "sine": 2 * np.sin(0.1 * k),
        "noise": generator.normal(size=500),
        "steps": np.repeat(generator.normal(size=25), 20),
        "counts": np.round(36 * np.sin(0.05 * k)) + 2048,
    }
    return made[kind]


@pytest.mark.parametrize("kind", ["sine", "noise", "steps", "counts"])
@pytest.mark.parametrize("rows", [[300], [40, 200, 333]])
def test_samples_far_beyond_all_others_are_named(tmp_path, kind, rows):
    u = torque(0, kind)
    u[rows] += 5 * np.ptp(u)
    (one,) = spikes(tmp_path, u)
    assert (one.level, one.channel, len(one.spans)) == ("warning", "u1", len(rows))
    assert ("one sample" if len(rows) == 1 else "3 single samples") in one.text


@pytest.mark.parametrize("rows", [[0], [3], [496], [499], [0, 1, 2], [300, 301], [498, 499]])
def test_neither_the_ends_nor_others_beside_hide_them(tmp_path, rows):
    u = torque(0, "sine")
    u[rows] = 300.0
    (one,) = spikes(tmp_path, u)
    assert (one.level, len(one.spans)) == ("warning", len(rows))
    assert ("one sample far" if len(rows) == 1 else f"{len(rows)} samples in a row far") in one.text
    assert "by up to 298 where the others range over 4" in one.text


@pytest.mark.parametrize("rows", [[149], [150], [148, 149]])
def test_a_gap_beside_does_not_hide_them(tmp_path, rows):
    log = arm(samples=500)
    log[:, 5] = torque(0, "sine")
    log[rows, 5] = 300.0
    log[150:, 0] += 3.0
    (check,) = check_dataset(written(tmp_path, log)).recordings
    (one,) = [one for one in check.findings if one.kind == "spike"]
    assert len(one.spans) == len(rows)


def test_samples_on_both_sides_of_a_gap_are_in_no_row(tmp_path):
    log = arm(samples=500)
    log[:, 5] = torque(0, "sine")
    log[[148, 149, 150, 151], 5] = 300.0
    log[150:, 0] += 3.0
    (check,) = check_dataset(written(tmp_path, log)).recordings
    (one,) = [one for one in check.findings if one.kind == "spike"]
    assert "4 samples, up to 2 in a row, far" in one.text


@pytest.mark.parametrize("kind", ["sine", "noise", "steps", "counts"])
@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_said_of_what_a_command_may_be(tmp_path, kind, seed):
    u = torque(seed, kind)
    assert spikes(tmp_path, u) == []
    u[100:104] += 5 * np.ptp(u)  # A pulse.
    assert spikes(tmp_path, u) == []
    u[300] = u[100]
    assert spikes(tmp_path, u) == []
    u = torque(seed, kind)
    u[10::40] += 5 * np.ptp(u)  # Impulses at a rate.
    assert spikes(tmp_path, u) == []


@pytest.mark.parametrize("seed", range(3))
def test_impulses_on_nothing_at_all_are_commands(tmp_path, seed):
    u = np.zeros(500)
    u[[100, 300]] = 3.0
    assert spikes(tmp_path, u + 1e-15 * np.random.default_rng(seed).normal(size=500)) == []


DRIVE = """
space = "R1"
time = "t"
positions = ["q"]
inputs = ["u"]
{more}
[train]
files = ["run.csv"]
"""
ROWS = [200, 333, 590]


def drive(folder, *, given, size, seed=0, delay=0, more='velocities = ["v"]', rows=ROWS):
    """A mass on a spring with dry friction, whose log has some samples of so many ranges that it was given or not."""
    generator = np.random.default_rng(seed)
    t = 0.01 * np.arange(800)
    u = np.sin(2 * np.pi * np.outer(t, [0.7, 1.9, 4.2]) + generator.uniform(0, 6, 3)).sum(axis=1)
    logged, q, v, path = u.copy(), 0.0, 0.0, []
    logged[rows] += size * np.ptp(u)
    acting = logged if given else u
    for k in range(len(t)):
        path.append((q, v))
        for _ in range(5):
            v += 0.002 * (acting[max(k - delay, 0)] - 20 * q - 0.5 * v - 0.2 * np.tanh(v / 0.02))
            q += 0.002 * v
    motion = np.array(path) + generator.normal(size=(800, 2)) * [1e-4, 1e-3]
    table = np.concatenate([t[:, None], motion, logged[:, None]], axis=1)
    np.savetxt(folder / "run.csv", table, delimiter=",", header="t,q,v,u", comments="")
    (folder / "drive.toml").write_text(DRIVE.format(more=more))
    return folder / "drive.toml", u, logged


def said(path):
    (check,) = check_dataset(path).recordings
    return next(one for one in check.findings if one.kind == "spike")


@pytest.mark.filterwarnings("ignore:.*accelerations follow inputs that are held")  # They are.
@pytest.mark.parametrize("more", ["", 'velocities = ["v"]', 'hold = "linear"'])
@pytest.mark.parametrize("size", [3, 50])
def test_samples_that_the_motion_does_not_answer_are_left_out(tmp_path, size, more):
    path, u, _ = drive(tmp_path, given=False, size=size, more=more)
    one = said(path)
    assert (one.level, one.channel, len(one.spans)) == ("masked", "u", 3)
    assert "this input is interpolated there" in one.advice
    with pytest.warns(DataWarning, match=r"left out in `run`: 3 wrong numbers of `u` .interpolated"):
        (recording,) = read_dataset(path).train
    assert len(recording) == 800
    np.testing.assert_allclose(recording.us[ROWS, 0], u[ROWS], atol=0.1)


@pytest.mark.parametrize("more", ["", 'velocities = ["v"]'])
@pytest.mark.parametrize("size", [3, 50])
def test_impulses_that_the_machine_was_given_are_kept_without_a_warning(tmp_path, recwarn, size, more):
    path, _, logged = drive(tmp_path, given=True, size=size, more=more)
    one = said(path)
    assert (one.level, len(one.spans)) == ("note", 3)
    (recording,) = read_dataset(path).train
    assert not recwarn.list
    np.testing.assert_allclose(recording.us[ROWS, 0], logged[ROWS])


@pytest.mark.parametrize("given", [True, False])
def test_impulses_act_as_late_as_inputs_do(tmp_path, given):
    path, *_ = drive(tmp_path, given=given, size=8, delay=40, more='velocities = ["v"]\ninput_delay = 0.4')
    assert said(path).level == ("note" if given else "masked")


@pytest.mark.parametrize("given", [True, False])
def test_momenta_do_not_tell_impulses(tmp_path, given):
    path, _, logged = drive(tmp_path, given=given, size=8, more='momenta = ["v"]')
    assert said(path).level == "warning"
    with pytest.warns(DataWarning, match="the motion does not tell whether they are impulses"):
        (recording,) = read_dataset(path).train
    np.testing.assert_allclose(recording.us[ROWS, 0], logged[ROWS])


def test_impulses_that_act_later_than_the_description_says_are_seen(tmp_path):
    path, *_ = drive(tmp_path, given=True, size=50, delay=6)
    assert said(path).level == "note"


@pytest.mark.parametrize("rows", [[400, 401], [400, 401, 402], [3], [0, 1], [0, 1, 2]])
def test_some_in_a_row_and_the_first_ones_are_told_by_the_motion_too(tmp_path, rows):
    path, *_ = drive(tmp_path, given=True, size=20, rows=rows)
    assert said(path).level == "note"
    path, u, _ = drive(tmp_path, given=False, size=100, rows=rows)
    one = said(path)
    assert (one.level, len(one.spans)) == ("masked", len(rows))
    assert f"this input is {'interpolated' if rows[0] else 'set to the number beside'} there" in one.advice
    with pytest.warns(DataWarning, match=f"{len(rows)} wrong number"):
        (recording,) = read_dataset(path).train
    assert len(recording) == 800
    np.testing.assert_allclose(recording.us[rows, 0], u[rows], atol=0.5)


@pytest.mark.parametrize(("row", "given", "delay"), [(0, True, 0), (780, False, 0), (780, True, 20), (780, True, 40)])
def test_samples_whose_answer_may_be_out_of_sight_are_not_left_out(tmp_path, row, given, delay):
    path, *_ = drive(tmp_path, given=given, size=50, rows=[row], delay=delay)
    assert said(path).level == "warning"

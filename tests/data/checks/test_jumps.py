"""Jumps that no machine makes are named, and fast motions are not."""

import re

import numpy as np
import pytest

from symoden.data import check_dataset
from tests.data.conftest import arm, written


def named(folder, log, space="T2", *, velocities=True):
    path = written(folder, log)
    text = path.read_text().replace('"T2"', f'"{space}"')
    path.write_text(text if velocities else text.replace("velocities", "#"))
    findings = [one for each in check_dataset(path).recordings for one in each.findings]
    return [(one.channel, one.text) for one in findings if one.kind == "jump"]


@pytest.mark.parametrize("space", ["T2", "R2"])
@pytest.mark.parametrize("size", [0.6, -1.5])
def test_where_another_recording_begins_the_position_is_said_to_jump(tmp_path, space, size):
    log = arm()
    log[1200:, 2] += size
    ((channel, text),) = named(tmp_path, log, space)
    step = abs(log[1200, 2] - log[1199, 2])
    assert channel == "q2"
    assert text.startswith(f"`q2` jumps by {step:.3g} once, first at ")
    assert "does another recording begin there?" in text


def test_jumps_are_found_beside_wraps_and_gaps_and_counted_where_velocities_are_known(tmp_path):
    log = arm(amplitude=2.0)
    log[:, 2] += 0.7 * (np.arange(len(log)) // 200)
    log[700:704, 2] = np.nan
    log[:, 2] = np.mod(log[:, 2] + np.pi, 2 * np.pi) - np.pi
    ((_, text),) = (one for one in named(tmp_path, log) if one[0] == "q2")
    assert re.search(r"^`q2` jumps by 0\.[67]\d* 9 times", text)


@pytest.mark.parametrize("velocities", [True, False])
def test_a_first_row_before_the_sensor_was_ready_is_to_be_left_out(tmp_path, velocities):
    log = arm()
    log[0, 2] += 0.8
    path = written(tmp_path, log)
    if not velocities:
        path.write_text(path.read_text().replace("velocities", "#"))
    (jump,) = (one for each in check_dataset(path).recordings for one in each.findings if one.kind == "jump")
    assert jump.advice.startswith("Leave the first row out if the sensor was not ready: `rows = [1]`.")


def test_a_slip_that_the_velocity_tells_is_no_jump(tmp_path):
    log = arm(amplitude=0.01)
    for k in (400, 900, 1500):
        log[k:, 2] += 0.4
        log[k - 1 : k + 1, 4] += 0.4 / 0.005
    assert named(tmp_path, log) == []


@pytest.mark.parametrize("samples", [2, 3, 10])
def test_a_fast_motion_is_no_jump(tmp_path, samples):
    log = arm(amplitude=0.01)
    log[:, 2] += np.interp(np.arange(len(log)), [1000, 1000 + samples], [0.0, 0.6])
    assert named(tmp_path, log, velocities=False) == []


@pytest.mark.parametrize("size", [0.6, 0.002])
def test_many_jumps_of_what_has_no_velocity_are_how_it_moves_and_few_must_be_far_beyond_the_rest(tmp_path, size):
    log = arm(amplitude=0.01)
    log[:, 2] += size * (np.arange(len(log)) // (100 if size > 0.1 else 1000))
    assert named(tmp_path, log, velocities=False) == []

"""Jumps that no machine makes are named, and fast motions are not."""

import numpy as np
import pytest

from symoden.data import check_dataset

from .conftest import arm, written


def named(folder, log, space="T2"):
    path = written(folder, log)
    path.write_text(path.read_text().replace('"T2"', f'"{space}"'))
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


@pytest.mark.parametrize("samples", [2, 3, 10])
def test_a_fast_motion_is_no_jump(tmp_path, samples):
    log = arm(amplitude=0.01)
    log[:, 2] += np.interp(np.arange(len(log)), [1000, 1000 + samples], [0.0, 0.6])
    assert named(tmp_path, log) == []


def test_many_jumps_are_how_it_moves(tmp_path):
    log = arm(amplitude=0.01)
    log[:, 2] += 0.6 * (np.arange(len(log)) // 100 % 2)
    assert named(tmp_path, log) == []

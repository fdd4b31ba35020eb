"""Encoders that count from where each recording began are noticed."""

import numpy as np
import pytest

from symoden.data import check_dataset

TEXT = """
space = "T2"
time = "t"
positions = ["q1", "q2"]
inputs = ["u"]
[train]
files = ["*.csv"]
"""


def check_of(folder, firsts, *, quantum=0.0, amplitude=1.0, more=""):
    """Findings on zeros of recordings whose two joints begin at these positions."""
    t = 0.01 * np.arange(400)
    for k, (first, second) in enumerate(firsts):
        q = np.stack([first + amplitude * np.sin((2 + k) * t), second - np.cos((3 + k) * t)], axis=1)
        if quantum:
            q = quantum * np.round(q / quantum)
        log = np.concatenate([t[:, None], q, np.cos(5 * t)[:, None]], axis=1)
        np.savetxt(folder / f"run{k}.csv", log, delimiter=",", header="t,q1,q2,u", comments="", fmt="%.15g")
    (folder / "arm.toml").write_text(TEXT + more)
    return [finding for finding in check_dataset(folder / "arm.toml").findings if finding.kind == "zero"]


@pytest.mark.parametrize("quantum", [0.0, 1e-3])
def test_a_joint_that_every_recording_counts_from_zero_is_named(tmp_path, quantum):
    (finding,) = check_of(tmp_path, [(0.0, 0.3), (0.0, 0.1), (quantum, -0.2)], quantum=quantum)
    assert (finding.level, finding.channel) == ("note", "q1")
    assert "all 3 recordings" in finding.text


def test_where_nothing_depends_on_a_joint_its_zero_does_not_count(tmp_path):
    (finding,) = check_of(tmp_path, [(0.0, 1.0)] * 3, more='[known]\ncyclic = ["q1"]\n')
    assert finding.channel == "q2"


def test_both_joints_share_one_finding(tmp_path):
    (finding,) = check_of(tmp_path, [(0.0, 1.0)] * 3)
    assert finding.text.startswith("`q1` and `q2` are 0")


@pytest.mark.parametrize(
    ("firsts", "amplitude"),
    [
        ([(0.0, 0.3)] * 2, 1.0),  # Two may begin alike by chance.
        ([(0.0, 0.3), (0.0, 0.3), (0.01, 0.3)], 1.0),
        ([(0.7, 0.3)] * 3, 1.0),  # Alike, but a position that was measured.
        ([(0.0, 0.3)] * 3, 0.02),  # Hardly a motion.
    ],
)
def test_other_beginnings_are_not(tmp_path, firsts, amplitude):
    assert not check_of(tmp_path, firsts, quantum=1e-3, amplitude=amplitude)

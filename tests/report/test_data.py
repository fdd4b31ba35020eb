"""Figures of logs: every column of every recording, with what is wrong marked and named."""

import dataclasses

import numpy as np
import pytest
from matplotlib import rcParams

from symoden.data import check_dataset
from symoden.report import draw_check

TEXT = """
space = "T1"
time = "t"
positions = ["q"]
velocities = ["v"]
inputs = ["u"]
[train]
files = ["a.csv"]
[test]
files = ["b.csv"]
"""


@pytest.fixture
def check(tmp_path):
    t = 0.01 * np.arange(400)
    log = np.stack([t, np.sin(3 * t), 3 * np.cos(3 * t), np.sin(5 * t)], axis=1)
    for name in ("a", "b"):
        if name == "b":
            log[100:200, 1] = log[100, 1]
            log[300:350, 3] = np.nan
        np.savetxt(tmp_path / f"{name}.csv", log, delimiter=",", header="t,q,v,u", comments="")
    (tmp_path / "arm.toml").write_text(TEXT)
    return check_dataset(tmp_path / "arm.toml")


def test_an_angle_that_was_logged_wrapped_is_drawn_without_wraps(tmp_path):
    t = 0.01 * np.arange(400)
    turning = 6.0 + 0.3 * np.sin(3 * t) + 0.2 * t
    log = np.stack([t, np.mod(turning, 2 * np.pi), 0.9 * np.cos(3 * t) + 0.2, np.sin(5 * t)], axis=1)
    log[50, 1] = np.nan
    for name in ("a", "b"):
        np.savetxt(tmp_path / f"{name}.csv", log, delimiter=",", header="t,q,v,u", comments="")
    (tmp_path / "arm.toml").write_text(TEXT)
    drawn = draw_check(check_dataset(tmp_path / "arm.toml")).axes[0].get_lines()[0].get_ydata()
    drawn = np.asarray(drawn, float)
    assert np.isnan(drawn[50])
    there = np.isfinite(drawn)
    assert drawn[there] == pytest.approx(turning[there])


def test_each_recording_is_a_row_and_each_column_a_panel(check):
    before = dict(rcParams)
    figure = draw_check(check)
    figure.canvas.draw()
    assert dict(rcParams) == before
    panels = figure.axes
    assert [ax.get_title() for ax in panels] == ["q [rad]", "v [rad/s]", "u", "", "", ""]
    assert [ax.get_ylabel().split("\n")[0] for ax in panels] == ["a", "", "", "b", "", ""]
    assert [ax.get_xlabel() for ax in panels] == ["", "", "", *["time [s]"] * 3]
    for ax, each, role in zip(panels, [check.recordings[0]] * 3, ("positions", "rates", "inputs"), strict=False):
        (line,) = ax.get_lines()
        np.testing.assert_array_equal(line.get_ydata(), each.log.signals[role][:, 0])


def test_where_nothing_can_be_read_there_is_nothing_to_draw(check):
    with pytest.raises(ValueError, match="must be a recording to draw; no file can be read"):
        draw_check(dataclasses.replace(check, recordings=()))


@pytest.mark.parametrize(("hold", "style"), [("zero", "steps-post"), ("linear", "default")])
def test_inputs_that_are_held_are_drawn_as_steps(check, hold, style):
    check = dataclasses.replace(check, description=dataclasses.replace(check.description, hold=hold))
    drawn = [ax.get_lines()[0].get_drawstyle() for ax in draw_check(check).axes]
    assert drawn == ["default", "default", style] * 2


def test_what_is_wrong_is_shaded_and_named_where_it_is(check):
    figure = draw_check(check)
    named = [[text.get_text() for text in ax.texts] for ax in figure.axes]
    assert named == [[""], [""], [""], ["stuck"], [""], ["missing"]]
    shaded = [len(ax.patches) for ax in figure.axes]
    assert shaded == [0, 0, 0, 3, 2, 3]  # both gaps in all panels, and what is wrong in its own
    stuck = min(
        patch.get_extents().transformed(figure.axes[3].transData.inverted()).x0 for patch in figure.axes[3].patches
    )
    assert stuck == pytest.approx(1.0, abs=0.02)

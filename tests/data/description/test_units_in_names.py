"""Units that names of columns say, or a line under these, beside those that are read."""

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset
from symoden.data.description._units import split_unit

NAMED = """
space = "R1 T1"
{units}
time = "t"
positions = ["x [mm]", "turn (°)"]
inputs = ["u [N]"]
[train]
files = ["a.csv"]
"""


def test_a_name_that_says_an_angle_on_a_space_of_lengths_is_asked_for(tmp_path):
    t = 0.01 * np.arange(400)
    rows = np.stack([t, 40 * np.sin(2 * t), np.cos(3 * t), np.sin(t)], axis=1)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t,drum [deg],turn,u", comments="")
    path = tmp_path / "arm.toml"
    text = NAMED.format(units="").replace("x [mm]", "drum [deg]").replace("turn (°)", "turn").replace("u [N]", "u")
    path.write_text(text, encoding="utf-8")
    (found,) = (each for each in check_dataset(path).recordings[0].findings if each.kind == "unit")
    assert found.advice == 'Write `units = {"drum [deg]" = "deg"}` into the description.'
    assert "says deg, and it is read as rad" in found.text


@pytest.mark.parametrize(
    ("units", "said"),
    [
        ('{"x [mm]" = "cm", "turn (°)" = "deg"}', 'mm, and `units` cm: Write `"x [mm]" = "mm"` into `units` instead'),
        ('{"x [mm]" = 1, "turn (°)" = "deg"}', 'mm, and `units` m: Write `"x [mm]" = "mm"` into `units` instead'),
        ('{"x [mm]" = -0.01, "turn (°)" = "deg"}', 'mm, and `units` cm: Write `"x [mm]" = -0.001` into `units`'),
        ('{"x [mm]" = "mm", "turn (°)" = "rev"}', 'deg, and `units` rev: Write `"turn (°)" = "deg"` into `units`'),
        ('{"x [mm]" = -0.001, "turn (°)" = 0.01746}', ""),
        ('{"x [mm]" = 0.0005, "turn (°)" = 0.03}', ""),  # Gears.
    ],
)
def test_names_and_units_that_differ_are_named(tmp_path, units, said):
    t = np.linspace(0.0, 4.0, 401)
    rows = np.stack([t, 100 * np.sin(2 * t), 30 * np.cos(3 * t), np.sin(t)], axis=1)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t,x [mm],turn (°),u [N]", comments="", encoding="utf-8")
    path = tmp_path / "arm.toml"
    path.write_text(NAMED.format(units=f"units = {units}"), encoding="utf-8")
    found = [each for each in check_dataset(path).recordings[0].findings if "says" in each.text]
    assert len(found) == bool(said)
    assert all(said in f"{each.text}: {each.advice}" and each.level == "warning" for each in found)


def test_units_in_names_that_no_entry_of_units_could_have_are_advised_as_factors(tmp_path):
    t = np.linspace(0.0, 4.0, 401)
    rows = np.stack([t, np.sin(2 * t), np.cos(3 * t), np.sin(t)], axis=1)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t,x [ms],turn (mm),u [us]", comments="")
    path = tmp_path / "arm.toml"
    text = NAMED.format(units="").replace("x [mm]", "x [ms]").replace("turn (°)", "turn (mm)").replace("[N]", "[us]")
    path.write_text(text, encoding="utf-8")
    found = [each for each in check_dataset(path).recordings[0].findings if each.kind == "unit"]
    assert [each.channel for each in found] == ["x [ms]", "turn (mm)"]  # Widths of pulses are in us.
    assert all(f'`units = {{"{each.channel}" = 1}}`' in each.advice for each in found)
    path.write_text(f'units = {{"x [ms]" = 1, "turn (mm)" = 1}}\n{text}', encoding="utf-8")
    assert [each for each in check_dataset(path).recordings[0].findings if each.kind == "unit"] == []


@pytest.mark.parametrize(
    ("units", "names", "said"),
    [
        ("", ("x [mm]", "turn (°)"), ["mm", "deg"]),
        ('units = {"x [mm]" = "mm"}', ("x", "turn (°)"), ["deg"]),
        ('units = {"x [mm]" = 0.001, "turn (°)" = "deg", "u [N]" = 2}', ("x", "turn"), []),
    ],
)
def test_units_in_names_are_asked_for_and_left_out_once_the_numbers_have_others(tmp_path, units, names, said):
    t = np.linspace(0.0, 4.0, 401)
    rows = np.stack([t, 100 * np.sin(2 * t), 30 * np.cos(3 * t), np.sin(t)], axis=1)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t,x [mm],turn (°),u [N]", comments="", encoding="utf-8")
    path = tmp_path / "arm.toml"
    path.write_text(NAMED.format(units=units), encoding="utf-8")
    found = [each for each in check_dataset(path).recordings[0].findings if each.kind == "unit"]
    assert [part.split(",")[0] for each in found for part in each.text.split(" says ")[1:]] == said
    assert len(found) == bool(said)  # One line mends all.
    assert all(f'"{unit}"' in found[0].advice for unit in said)
    if said:
        with pytest.warns(DataWarning, match="the name of"):
            dataset = read_dataset(path)
    else:
        dataset = read_dataset(path)
    assert dataset.position_names == names


@pytest.mark.parametrize(
    ("name", "plain", "unit"),
    [
        ("theta_deg", "theta", "deg"),
        ("sway_degrees", "sway", "deg"),
        ("w_deg_s", "w", "deg/s"),
        ("wheel_rpm", "wheel", "rpm"),
        ("x_mm", "x", "mm"),
        ("deg", "deg", ""),
        ("_mm", "_mm", ""),
        ("joint_s", "joint_s", ""),
        ("q_m", "q_m", ""),
        ("x_cm", "x_cm", ""),  # As a rule the centre of mass.
    ],
)
def test_units_that_names_end_in(name, plain, unit):
    assert split_unit(name) == (plain, unit)


def test_names_that_are_the_same_without_their_units_keep_them(tmp_path):
    t = np.linspace(0.0, 4.0, 401)
    rows = np.stack([t, 100 * np.sin(2 * t), 30 * np.cos(3 * t), np.sin(t)], axis=1)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t,q [mm],q (°),u [N]", comments="", encoding="utf-8")
    path = tmp_path / "arm.toml"
    units = 'units = {"q [mm]" = "mm", "q (°)" = "deg"}'
    path.write_text(NAMED.format(units=units).replace('"x [mm]", "turn (°)"', '"q [mm]", "q (°)"'), encoding="utf-8")
    assert read_dataset(path).position_names == ("q [mm]", "q (°)")


@pytest.mark.parametrize(
    ("units", "asked"), [("", True), ("units = {turn = -1}", True), ('units = {"turn (°)" = "rad"}', False)]
)
def test_whether_a_joint_that_turns_many_times_is_in_degrees_is_not_asked_of_one_whose_unit_is_told(
    tmp_path, units, asked
):
    t = np.linspace(0.0, 4.0, 401)
    rows = np.stack([t, np.sin(2 * t), 40 * np.cos(3 * t), np.sin(t)], axis=1)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t,x,turn (°),u", comments="", encoding="utf-8")
    path = tmp_path / "arm.toml"
    path.write_text(NAMED.format(units=units).replace("x [mm]", "x").replace("u [N]", "u"), encoding="utf-8")
    if asked:  # By its movement alone, not by its name.
        path.write_text(path.read_text(encoding="utf-8").replace("turn (°)", "turn"), encoding="utf-8")
        text = (tmp_path / "a.csv").read_text(encoding="utf-8")
        (tmp_path / "a.csv").write_text(text.replace("turn (°)", "turn"), encoding="utf-8")
    texts = [each.text for each in check_dataset(path).recordings[0].findings if each.kind == "unit"]
    assert any("degrees?" in text for text in texts) == asked


def test_all_joints_of_an_arm_that_are_in_degrees_are_told_by_one_line(tmp_path):
    t = np.linspace(0.0, 4.0, 401)
    rows = np.stack([t, 90 * np.cos(3 * t), 30 * t - 40, 2 * np.sin(t), np.sin(t)], axis=1)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="t,shoulder,elbow,wrist,u", comments="")
    path = tmp_path / "arm.toml"
    text = 'space = "T3"\ntime = "t"\npositions = ["shoulder", "elbow", "wrist"]\ninputs = ["u"]\n'
    path.write_text(f'{text}[train]\nfiles = ["a.csv"]\n')
    (found,) = (each for each in check_dataset(path).recordings[0].findings if each.kind == "unit")
    line = 'units = {shoulder = "deg", elbow = "deg"}'
    assert f"`{line}`" in found.advice  # The elbow goes one way, but as far as the shoulder, which turns back.
    assert "Look at `wrist`, too" in found.advice
    path.write_text(f'{text}{line}\n[train]\nfiles = ["a.csv"]\n')
    assert not [each for each in check_dataset(path).recordings[0].findings if each.kind == "unit"]


@pytest.mark.parametrize("line", ["s,deg,mm,A", "[s],[deg],[mm],[A]"])
def test_a_line_of_units_under_the_names_is_compared_with_what_is_read(tmp_path, line):
    t = np.linspace(0.0, 4.0, 401)
    rows = np.stack([t, 5 * np.sin(2 * t), 30 * np.cos(3 * t), np.sin(t)], axis=1)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=f"t,turn,way,u\n{line}", comments="")
    path, units = tmp_path / "arm.toml", 'units = {turn = "deg", way = "mm"}'
    text = 'space = "T1 R1"\ntime = "t"\npositions = ["turn", "way"]\ninputs = ["u"]\n'
    for more, findings in (("", 1), (f"{units}\n", 0)):
        path.write_text(f'{text}{more}[train]\nfiles = ["a.csv"]\n')
        found = [each for each in check_dataset(path).recordings[0].findings if each.kind == "unit"]
        assert len(found) == findings
        for each in found:
            assert "the line under the name of `turn` says deg, and it is read as rad" in each.text
            assert f"`{units}`" in each.advice
    np.testing.assert_allclose(read_dataset(path).train[0].q[:, 1], 0.03 * np.cos(3 * t), atol=1e-9)

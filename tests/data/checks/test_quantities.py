"""Columns that are taken for another quantity than their names say."""

import numpy as np
import pytest

from symoden.data import check_dataset

T = 0.01 * np.arange(400)
MOTION, RATE, DRIVE = np.sin(2 * T), 2 * np.cos(2 * T), np.sin(5 * T) + np.cos(3 * T)


def described(folder, names, *columns, space="T1", below="", more="", velocities=True):
    """A table of a time, a position, a velocity and an input, and its description."""
    rows = np.stack([T, *columns], axis=1)
    header = ",".join(("t", *names)) + (f"\n{below}" if below else "")
    np.savetxt(folder / "a.csv", rows, delimiter=",", header=header, comments="", encoding="utf-8")
    q, v, u = names
    rates = f'velocities = ["{v}"]\n' if velocities else ""
    text = f'space = "{space}"\ntime = "t"\npositions = ["{q}"]\n{rates}inputs = ["{u}"]\n{more}\n'
    path = folder / "d.toml"
    path.write_text(f'{text}[train]\nfiles = ["a.csv"]\n', encoding="utf-8")
    return path


def found(path):
    """Findings on units, by their columns, and the headings of all columns."""
    (recording,) = check_dataset(path).recordings
    units = {each.channel: each for each in recording.findings if each.kind == "unit"}
    return units, [one.title for one in recording.channels]


def test_a_current_that_is_taken_for_an_angle_is_named_and_so_is_the_angle_among_the_inputs(tmp_path):
    names = ("current(A)", "w", "rw angle(rad)")
    units, titles = found(described(tmp_path, names, DRIVE, RATE, MOTION, velocities=False))
    assert list(units) == ["current(A)", "rw angle(rad)"]
    assert units["current(A)"].text == "the name of `current(A)` says A, and it is read as rad: another column?"
    assert units["current(A)"].advice == (
        "Name the right one. If it is this one, write the factor that makes rad of it, "
        '`units = {"current(A)" = 1}` into the description.'
    )
    assert "says rad, and it is read as an input" in units["rw angle(rad)"].text
    assert all(each.level == "warning" for each in units.values())
    assert titles == ["current(A)", "rw angle(rad)"]


def test_whoever_gives_the_column_a_factor_knows_it(tmp_path):
    names, more = ("pot (V)", "w", "u"), 'units = {"pot (V)" = 0.35}'
    units, titles = found(described(tmp_path, names, MOTION, RATE, DRIVE, more=more, velocities=False))
    assert not units
    assert titles == ["pot [rad]", "u"]


def test_a_line_of_units_is_read_as_names_are(tmp_path):
    path = described(tmp_path, ("i", "w", "u"), DRIVE, RATE, MOTION, below="s,[A],[rad/s],[-]", velocities=False)
    units, titles = found(path)
    assert units["i"].text == "the line under the name of `i` says A, and it is read as rad: another column?"
    assert titles == ["i", "u"]


def test_numbers_that_are_the_velocity_but_for_a_factor_are_told_by_it_and_not_by_their_volts(tmp_path):
    units, titles = found(described(tmp_path, ("q", "tacho (V)", "u"), MOTION, RATE / 7, DRIVE))
    assert ["7 times" in each.text for each in units.values()] == [True]
    assert titles[1] == "tacho (V)"
    units, _ = found(described(tmp_path, ("q", "tacho (V)", "u"), MOTION, DRIVE, RATE))
    assert units["tacho (V)"].text.endswith("says V, and it is read as rad/s: another column?")


@pytest.mark.parametrize(
    ("space", "name", "said", "advised"),
    [
        ("T1", "x (mm)", "mm, and it is read as rad:", "Name the right one; lengths have the letter R in `space`. If"),
        ("T1", "w [rpm]", "rpm, and it is read as rad:", "Name the right one. If"),
        ("R1", "f [N m]", "Nm, and it is read as m or rad:", "the factor that makes m or rad of it"),
        ("R1", "x [ms]", "ms, and it is read as m or rad:", "Name the right one. If"),
        ("R1", "x [mm]", "mm, and it is read as m", '"x [mm]" = "mm"'),
        ("T1", "q", "", ""),
        ("R1", "q [rad]", "", ""),
    ],
)
def test_positions_are_angles_or_lengths(tmp_path, space, name, said, advised):
    path = described(tmp_path, (name, "w", "u"), MOTION, RATE, DRIVE, space=space, velocities=False)
    units, _ = found(path)
    assert list(units) == ([name] if said else [])
    assert all(said in each.text and advised in each.advice for each in units.values())


@pytest.mark.parametrize(
    ("name", "numbers", "named"),
    [
        ("target (rad)", MOTION, False),  # Of a servo.
        ("pulse [us]", 1500 + 400 * DRIVE, False),  # Of a servo, too.
        ("stamp [us]", 1e6 * T, True),
        ("clock (s)", T, True),
        ("clock", T, False),
        ("step (s)", 0 * T + 0.01, False),
    ],
)
def test_of_inputs_only_clocks_are_named_where_positions_are_what_they_shall_be(tmp_path, name, numbers, named):
    units, _ = found(described(tmp_path, ("q (rad)", "w", name), MOTION, RATE, numbers, velocities=False))
    assert list(units) == ([name] if named else [])

"""Inputs that a description forgot are named, by the names of a table's columns."""

import numpy as np
import pytest

from symoden.data import check_dataset


def unread(path, header, *, inputs="", constant=False):
    """What is said of a swing's table with one more column."""
    ts = np.linspace(0, 4, 400)
    drive = np.full(400, 2.0) if constant else np.sin(3 * ts)
    table = np.column_stack([ts, np.cos(2 * ts), drive])
    np.savetxt(path / "run.csv", table, "%.5f", ",", header=f"t,q,{header}", comments="")
    file = path / "run.toml"
    file.write_text(f'space = "T1"\ntime = "t"\npositions = ["q"]\n{inputs}\n[train]\nfiles = ["run.csv"]\n')
    return [one for one in check_dataset(file).findings if one.kind == "idle" and "no `inputs`" in one.text]


@pytest.mark.parametrize(
    "name",
    ["/joint_states/effort/elbow", "tau", "motor_current [A]", "cmd1", "u_pwm", "Torque", "U", "u1 [V]", "thrust_2"],
)
def test_a_column_that_may_drive_the_machine_is_named(tmp_path, name):
    (one,) = unread(tmp_path, name)
    assert (one.level, one.channel) == ("warning", name)
    assert f'inputs = ["{name}"]' in one.advice
    assert unread(tmp_path, name, inputs=f'inputs = ["{name}"]') == []


@pytest.mark.parametrize(
    "name", ["battery_voltage", "current_time", "temp", "enforced", "cmd_position", "x", "u_pos", "mu"]
)
def test_other_columns_are_not(tmp_path, name):
    assert unread(tmp_path, name) == []


def test_nothing_is_said_of_one_that_does_not_change(tmp_path):
    assert unread(tmp_path, "tau", constant=True) == []

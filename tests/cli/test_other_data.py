"""Scores on data whose columns, hold or units are not those of the run come with a word on what they mean."""

import json

import pytest

from symoden.cli import main

from .conftest import write_untrained_run


def other(described, **changes):
    """The description with other words in it, and the names of columns in its files."""
    text = described.read_text()
    for old, new in changes.items():
        text = text.replace(f'["{old}"]', f'["{new}"]')
        for file in ("a.csv", "b.csv"):
            path = described.with_name(file)
            names, _, rows = path.read_text().partition("\n")
            path.write_text(",".join(new if name == old else name for name in names.split(",")) + "\n" + rows)
    described.write_text(text)
    return described


def warned(capsys, *arguments):
    """What `evaluate` says of other data."""
    assert main(["evaluate", *map(str, arguments), "--json"]) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out.splitlines()[-1])["recordings"]
    return [line for line in captured.err.splitlines() if "of the run" in line or "was trained by" in line]


def test_columns_of_other_names_are_named_once_with_what_scores_mean(arm_run, described, capsys):
    (line,) = warned(capsys, arm_run, other(described, q="angle", u="torque"))
    assert line.startswith(f"warning: `{described}`: columns must be those of the run, in its order")
    assert "got `angle` for `q`, `torque` for `u`. Of another machine scores say" in line


def test_another_hold_is_named(arm_run, described, capsys):
    described.write_text('hold = "linear"\n' + described.read_text())
    (line,) = warned(capsys, arm_run, described)
    assert '`hold` must be what the model was trained by, "zero"; got "linear"' in line


@pytest.mark.parametrize("own", [True, False])
def test_nothing_is_said_of_data_like_the_runs(arm_run, arm, described, capsys, own):
    assert not warned(capsys, arm_run, *([arm] if own else [described]))


def test_another_space_is_refused_before_files_are_read(arm_run, described, capsys):
    described.write_text(described.read_text().replace('"T1"', '"R1"'))
    described.with_name("a.csv").unlink()
    assert main(["evaluate", str(arm_run), str(described)]) == 2
    assert "must have the space of the run, `T1`; got `R1`" in capsys.readouterr().err


@pytest.mark.parametrize(("unit", "named"), [('units = { q = "mm" }', True), ("", False)])
def test_positions_in_another_unit_are_named(described, tmp_path, capsys, unit, named):
    described.write_text(described.read_text().replace('"T1"', '"R1"'))
    run = write_untrained_run(tmp_path / "run", described)
    path = tmp_path / "other.toml"
    path.write_text(f"{unit}\n" + described.read_text())
    lines = warned(capsys, run, path)
    assert named == any("in the units of the run; got `q` in m, not the unit of the log" in line for line in lines)

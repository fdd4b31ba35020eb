"""`symoden data check`: what it prints, what it draws, and that `train` says what it leaves out."""

import dataclasses
import json
import warnings
from pathlib import Path

import numpy as np
import pytest

from symoden.cli import _data, main
from symoden.data import DataWarning, check_dataset

from .conftest import write_untrained_run


def damage(path, **columns):
    """Write values into rows of columns of a recording."""
    lines = path.read_text().splitlines()
    names = lines[0].split(",")
    table = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    for name, change in columns.items():
        table[:, names.index(name)] = change(table[:, names.index(name)].copy())
    np.savetxt(path, table, delimiter=",", header=lines[0], comments="", fmt="%.17g")


def holes(values):
    values[40:52] = np.nan
    return values


def swapped(values):
    values[[20, 21]] = values[[21, 20]]
    return values


def test_a_good_data_set_has_its_tables_and_nothing_wrong(arm, capsys):
    assert main(["data", "check", str(arm)]) == 0
    out = capsys.readouterr().out
    lines = [line.split() for line in out.splitlines()]
    assert ["train", "a", "80", "3.95", "50", "50", "50", "0", "0", "1"] in lines
    assert [line[:3] for line in lines if line[:1] in (["q"], ["v"], ["u"])] == [
        ["q", "[rad]", "position"],
        ["v", "[rad/s]", "velocity"],
        ["u", "input", "-0.9895"],
    ]
    assert "space T1, hold zero" in out
    few = "signs, delays and `hold` of inputs are not looked at: [train] has too few rows, by about 5.5 s of motion"
    assert out.partition("Findings\n")[2].splitlines()[:2] == ["nothing looks wrong; worth knowing:", f"- note: {few}."]


@pytest.mark.parametrize(("steps", "said"), [([0.0, 0.01], 0.01), ([0.0, 0.01, 0.02, 0.02], 0.02), ([0.0, 0.0], "-")])
def test_rounding_is_that_of_the_logs_that_tell_it(arm, steps, said):
    facts = check_dataset(arm).recordings[0].channels[0]
    row = _data._channel_row([dataclasses.replace(facts, quantum=step) for step in steps])
    assert row[5] == said


def test_what_is_wrong_is_named_with_what_to_do(described, capsys):
    damage(described.parent / "a.csv", q=np.degrees, u=holes)
    damage(described.parent / "b.csv", q=np.degrees, t=swapped)
    assert main(["data", "check", str(described)]) == 2
    printed = capsys.readouterr()
    assert printed.err == f"error: `{described}`: training refuses these data. Mend what is named refused.\n"
    findings = printed.out.partition("Findings\n")[2].splitlines()
    assert findings[0].startswith("- refused in b: 1 time stamp does not increase (1 goes back), first at line 23")
    assert findings[2].startswith("- warning in a (and 1 more: b): the derivative of `q` is")
    assert findings[3] == '  Write `units = {q = "deg"}` into the description.'
    assert findings[4].startswith("- masked in a: `u` lacks 12 of 80 numbers")
    assert findings[6].startswith("- masked in a: 1 gap in time, the longest 0.65 s from 1.95 to 2.6 s")


def test_json_says_all_of_it(described, capsys):
    damage(described.parent / "a.csv", u=holes)
    assert main(["data", "check", str(described), "--json"]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    said = json.loads(line, parse_constant=pytest.fail)
    assert list(said) == ["source", "space", "refused", "findings", "recordings", "unreadable", "figure"]
    a, b = said["recordings"]
    assert [(one["name"], one["split"], one["rows"], one["recordings"]) for one in (a, b)] == [
        ("a", "train", 80, 2),
        ("b", "test", 60, 1),
    ]
    assert (a["missing_rows"], a["gaps_s"]) == (12, [[pytest.approx(1.95), pytest.approx(2.6)]])
    assert [(one["kind"], one["level"]) for one in a["findings"]] == [("missing", "masked"), ("gap", "masked")]
    assert {"name", "role", "minimum", "maximum", "rms", "quantum", "noise", "ratio"} <= set(a["channels"][0])
    assert said["refused"] is False


def test_refused_data_are_status_2_with_all_of_the_json(described, capsys):
    described.write_text(described.read_text().replace("[[1]]", "[[1, 0]]"))
    assert main(["data", "check", str(described), "--json"]) == 2
    printed = capsys.readouterr()
    said = json.loads(printed.out)
    assert said["refused"] is True
    assert [one["level"] for one in said["findings"]] == ["refused"]
    assert "training refuses these data" in printed.err


def test_parts_of_one_file_are_told_apart(described, capsys):
    damage(described.parent / "a.csv", v=lambda v: 57.3 * v)
    described.write_text(
        described.read_text()
        .replace('["a.csv"]', '["a.csv"]\nrows = [0, 40]')
        .replace('["b.csv"]', '["a.csv"]\nrows = [40]')
    )
    main(["data", "check", str(described)])
    assert "in a [train] (and 1 more: a [test]): the derivative of `q` is" in capsys.readouterr().out


def test_files_that_cannot_be_read_are_refused_beside_those_that_can(described, tmp_path, capsys):
    (described.parent / "c.csv").write_text("t,q,v,u\n")
    for name in ("d.csv", "e.csv"):
        (described.parent / name).write_text("t,q,v\n0,1,2\n")
    described.write_text(described.read_text().replace('["a.csv"]', '["?.csv"]').replace('["b.csv"]', '["c.csv"]'))
    figure = tmp_path / "arm.png"
    assert main(["data", "check", str(described), "--figure", str(figure)]) == 2
    printed = capsys.readouterr()
    assert printed.err == f"error: `{described}`: training refuses these data. Mend what is named refused.\n"
    lines = [line.split() for line in printed.out.splitlines()]
    assert ["train", "a", "80", "3.95", "50", "50", "50", "0", "0", "1"] in lines
    for part, name in (("train", "c"), ("train", "d"), ("train", "e"), ("test", "c")):
        assert [part, name, *"-------", "refused"] in lines
    findings = printed.out.partition("Findings\n")[2].splitlines()
    assert findings[0].startswith("- refused in c [train] (and 1 more: c [test]): ")
    assert "a recording must have at least 2 rows; got 0" in findings[0]
    assert findings[1].startswith("- refused in d (and 1 more: e): ")
    assert "no column `u`; found `t, q, v`" in findings[1]
    assert main(["data", "check", str(described), "--json"]) == 2
    said = json.loads(capsys.readouterr().out)
    assert said["refused"] is True
    assert [(one["name"], one["split"]) for one in said["unreadable"]] == [(n, "train") for n in "cde"] + [
        ("c", "test")
    ]
    assert [one["kind"] for each in said["unreadable"] for one in each["findings"]] == ["refused"] * 4
    page = (Path(__file__).parents[2] / "docs" / "check.md").read_text()
    assert [key for key, value in said.items() if isinstance(value, list) and f"`{key}`" not in page] == []
    assert main(["train", str(described), "--out", str(tmp_path / "run")]) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert "c.csv`: a recording must have at least 2 rows; got 0. Leave it out. 2 more cannot be read either" in error


def test_where_nothing_can_be_read_all_of_it_is_said_and_nothing_is_drawn(described, tmp_path, capsys):
    for name in "ab":
        (described.parent / f"{name}.csv").write_text("t,q,v,u\n0,1,off,2\n1,off,off,2\n")
    figure = tmp_path / "arm.png"
    words = ["data", "check", str(described), "--figure", str(figure)]
    assert main(words) == 2
    printed = capsys.readouterr()
    assert printed.err == f"error: `{described}`: training refuses these data. Mend what is named refused.\n"
    table, _, findings = printed.out.partition("\nFindings\n")
    assert [line.split()[:2] for line in table.splitlines()[3:]] == [["train", "a"], ["test", "b"]]
    assert findings.startswith("- refused in a (and 1 more: b): ")
    assert "the first of 3 such cells up to line 3 (row 1): 1 in `q`, 2 in `v`. Correct them" in findings
    assert findings.endswith("\nnothing is drawn\n")
    assert main([*words, "--json"]) == 2
    said = json.loads(capsys.readouterr().out)
    assert [one["name"] for one in said["unreadable"]] == ["a", "b"]
    assert (said["refused"], said["recordings"], said["findings"], said["figure"]) == (True, [], [], None)
    assert not figure.exists()


def test_what_is_wrong_with_a_file_is_said_before_what_is_wrong_with_it_beside_others(described, capsys):
    (described.parent / "a.csv").write_text("")
    described.write_text(described.read_text().replace('["a.csv"]', '["a.csv", "b.csv"]'))
    assert main(["data", "check", str(described)]) == 2
    first, second, *_ = capsys.readouterr().out.partition("Findings\n")[2].splitlines()
    assert first.startswith("- refused in a: ")
    assert second.startswith(f"- refused: `{described}`: [train] and [test] must have no rows in common")


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_the_recordings_are_drawn(arm, tmp_path, capsys, ending):
    path = tmp_path / f"arm.{ending}"
    assert main(["data", "check", str(arm), "--figure", str(path)]) == 0
    assert path.stat().st_size > 5000
    assert capsys.readouterr().out.endswith(f"all recordings are drawn in {path}\n")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("check", "gone.toml"), "`gone.toml`: cannot be read"),
        (("check", "{arm}", "--space", "T2"), "`space` must have one coordinate per position column"),
        (("check", "{arm}", "--figure", "a.gif"), "`--figure` must end in one of .png, .pdf, .svg; got `a.gif`"),
        (("verify", "{arm}"), "verify"),
        (("check",), "FILE.toml"),
    ],
)
def test_what_cannot_be_read_is_status_2(arm, capsys, words, message):
    assert main(["data", *(word.format(arm=arm) for word in words)]) == 2
    assert message in capsys.readouterr().err


def test_training_says_in_one_line_what_it_leaves_out_and_what_looks_wrong(described, tmp_path, capsys, monkeypatch):
    def stop(*arguments, **options):
        raise ValueError("enough")

    monkeypatch.setattr("symoden.cli._train.train_run", stop)
    damage(described.parent / "a.csv", u=holes, v=np.negative)
    assert main(["train", str(described), "--out", str(tmp_path / "run")]) == 2
    masked, suspicion, headline, error = capsys.readouterr().err.splitlines()
    assert masked.startswith(f"warning: `{described}`: left out in `a`: 12 rows without all numbers, 1 gap in time")
    assert suspicion.startswith(f"warning: `{described}`: perhaps wrong in `a`: the derivative of `q` is -")
    assert headline.startswith("training a dissipative model")
    assert error == "error: enough"


def test_what_was_said_of_a_runs_own_data_is_not_said_again(described, tmp_path, capsys):
    damage(described.parent / "a.csv", u=holes)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        run = write_untrained_run(tmp_path / "run", described)
    for words in (("evaluate", run), ("inspect", run), ("evaluate", run, described)):
        capsys.readouterr()
        assert main(list(map(str, words))) == 0
        assert ("left out in `a`" in capsys.readouterr().err) == (words[-1] == described)
    damage(described.parent / "a.csv", u=np.negative)
    for words in (("evaluate", run), ("inspect", run)):
        assert main(list(map(str, words))) == 0
        assert "the data are no longer those that the run was trained on" in capsys.readouterr().err


def test_recordings_that_have_the_same_but_for_its_numbers_are_told_apart(described, capsys):
    for name, limit in (("a.csv", 0.6), ("b.csv", 0.8)):
        path = described.with_name(name)
        head, *rows = path.read_text().splitlines()
        columns = np.array([row.split(",") for row in rows], float)
        columns[:, 3] = np.clip(columns[:, 3], -limit, limit)
        np.savetxt(path, columns, delimiter=",", header=head, comments="", fmt="%.17g")
    assert main(["data", "check", str(described)]) == 0
    assert (
        "in a (and 1 more, with other numbers: b): `u` is at its extreme value (-0.6 or 0.6)" in capsys.readouterr().out
    )

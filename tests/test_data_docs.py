"""The pages on data name every key, unit, format and finding that there is, and what they show works."""

import re
import typing
from pathlib import Path

import numpy as np
import pytest

import symoden
from symoden.data import DataError
from symoden.data._findings import Kind
from symoden.data.description._description import read_description
from symoden.data.description._formulas import COLUMNS
from symoden.data.description._known import _ROBOT, KEYS as _KNOWN_KEYS
from symoden.data.description._units import UNITS
from symoden.data.description._values import KEYS, PART_KEYS, PARTS
from symoden.data.files._readers import _ARRAYS, TABLES as FORMATS
from symoden.known import FUNCTIONS

DOCS = Path(__file__).parents[1] / "docs"
PAGE = "\n".join((DOCS / f"{name}.md").read_text() for name in ("data", "files", "check"))
TABLES = re.findall(r"^\| (.*?) \|.*\n\|[-|]+\n((?:\|.*\n)+)", PAGE, flags=re.MULTILINE)


def first_cells(title):
    """What stands in code in the first column of the table whose first column has this title."""
    rows = [rows for head, rows in TABLES if head == title]
    assert len(rows) == 1, f"{title} among {[head for head, _ in TABLES]}"
    cells = [row.split(" | ")[0] for row in rows[0].splitlines()]
    return sorted(name for cell in cells for name in re.findall(r"`([^`]+)`", cell))


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, flags=re.MULTILINE | re.DOTALL)


def test_every_key_of_a_description_is_documented_and_no_other():
    assert first_cells("key") == sorted([*KEYS, *(f"[{part}]" for part in (*PARTS, "known"))])
    assert first_cells("key of `[train]`, `[test]`, `[validation]`") == sorted(PART_KEYS)
    assert first_cells("key of `[known]`") == sorted(_KNOWN_KEYS)
    assert first_cells("key of `robot`") == sorted(_ROBOT)


def test_every_unit_format_and_finding_is_documented_and_no_other():
    assert first_cells("unit") == sorted(UNITS)
    assert first_cells("ending") == sorted([*FORMATS, *_ARRAYS])
    assert first_cells("`kind` in JSON") == sorted(typing.get_args(Kind))
    assert first_cells("function of columns") == sorted(COLUMNS.more)
    assert re.search(", ".join(FUNCTIONS).replace(", ", r",\s+"), PAGE)


def test_the_examples_are_descriptions(tmp_path):
    smallest, full, thrusts, made, steered, pole, teleoperated, joined = blocks("toml")
    drone = (
        'space = "R2 T1"\ntime = "t"\npositions = ["x", "z", "theta"]\ninputs = ["f1", "f2"]\n[train]\nfiles = ["*"]\n'
    )
    bench = smallest.replace('["tau"]', '["current", "push", "third"]').replace("[train]", f"{made}[train]")
    for text in (
        smallest,
        full,
        drone + thrusts,
        bench,
        steered,
        steered + pole,
        teleoperated,
        'space = "T2"\n' + joined,
    ):
        path = tmp_path / "arm.toml"
        path.write_text(text)
        read_description(path)
    used = {line.split(" = ")[0] for line in full.splitlines() if " = " in line}
    assert {*KEYS, *PART_KEYS} - used == {"dt", "momenta", "estimated_velocities"}, (
        "that `time` and `velocities` exclude, or programs write"
    )


def test_the_smallest_example_reads_files(tmp_path):
    (tmp_path / "logs").mkdir()
    ts = 0.002 * np.arange(200)
    columns = np.stack([ts, np.sin(3 * ts), np.random.default_rng(0).normal(size=200)], axis=1)
    np.savetxt(tmp_path / "logs" / "run.csv", columns, delimiter=",", header="t,q,tau", comments="")
    path = tmp_path / "arm.toml"
    path.write_text(blocks("toml")[0])
    recording = symoden.read_dataset(path).train[0]
    assert (recording.name, recording.q.shape, recording.us.shape) == ("run", (200, 1), (200, 1))
    path.write_text(blocks("toml")[0].replace('["q"]', '["theta"]'))
    with pytest.raises(DataError, match="no column `theta`"):
        symoden.read_dataset(path)


def test_the_lines_of_python_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (code,) = blocks("python")
    exec(compile(code, "docs/data.md", "exec"), {})
    data = symoden.read_dataset("swing.toml")
    assert [len(part) for part in (data.train, data.test)] == [3, 1]
    assert np.diff(data.train[0].ts) == pytest.approx(0.01)
    assert data.train[0].rates[:, 0] == pytest.approx(0.6 * np.cos(2 * data.train[0].ts), abs=1e-3)

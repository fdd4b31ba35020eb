"""The table as text: every format has the numbers of the results."""

import csv
import json
import math
import re

import pytest

from symoden.experiments import Cell, CellResult, MeanStd, result_as_json, table_rows
from symoden.models import Kind
from symoden.report import flat_row, table_csv, table_latex, table_markdown, table_title, write_tables


def result(test, *, seed=0, task="pendulum", model: Kind = "dissipative", **options):
    cell = Cell(task=task, model=model, preset="default", seed=seed, **options)
    return CellResult(
        cell=cell,
        parameters=1408,
        train=MeanStd(test / 2, 0.5),
        test=MeanStd(test, 4e-9),
        prediction=MeanStd(268.24, 1.0),
        seconds=123.4,
    )


RESULTS = [
    result(1.84e-9),
    result(2.5e-9, seed=1),
    result(math.inf, model="naive"),
    CellResult(cell=Cell(task="pendulum", model="symoden", preset="default", seed=0), error="no"),
    result(0.00123, task="cartpole", noise=0.05, trajectories=64),
]


def test_csv_reads_back():
    rows = table_rows(RESULTS)
    read = list(csv.DictReader(table_csv(rows).splitlines()))
    assert len(read) == len(rows) == 4
    for text, row in zip(read, rows, strict=True):
        for name, value in flat_row(row).items():
            if value is None:
                assert text[name] == ""
            else:
                assert type(value)(text[name]) == value
    naive, symoden, dissipative, cart = read
    assert (dissipative["test_median"], dissipative["test_greatest"]) == ("1.84e-09", "2.5e-09")
    assert (dissipative["test_paper_mean"], dissipative["test_paper_std"]) == ("0.13", "0.25")
    assert float(dissipative["test_ratio"]) == pytest.approx(0.13 / 1.84e-9)
    assert (naive["test_mean"], symoden["test_mean"], symoden["failed"]) == ("inf", "", "1")
    assert (cart["trajectories"], cart["noise"], cart["test_paper_mean"]) == ("64", "0.05", "")
    assert table_csv([]) == "\n"


def test_markdown_has_a_table_for_each_task_in_few_digits():
    first, second = table_markdown(table_rows(RESULTS)).split("\n\n**")
    lines = first.splitlines()
    assert lines[0] == "**Task 2: pendulum, preset default**"
    assert lines[2].startswith("| model | parameters | train | the paper | ratio | test | the paper | ratio |")
    assert all(line.count("|") == lines[2].count("|") for line in lines[2:])
    naive, symoden, dissipative = lines[4:]
    assert dissipative == (
        "| dissipative | 1408 | 9.2e-10 ± 0.5 (9.2e-10 to 1.3e-9) | 0.15 ± 0.27 | 1.6e8 "
        "| 1.8e-9 ± 4.0e-9 (1.8e-9 to 2.5e-9) | 0.13 ± 0.25 | 7.1e7 "
        "| 268 ± 1 (268 to 268) | 1.04 ± 1.3 | 3.9e-3 | 123 |"
    )
    assert naive.startswith("| naive | 1408 | diverged | 2.02 ± 4.41 | 0 | diverged |")
    assert symoden == f"| symoden (1 failed) |{' - |' * 11}"
    assert second.startswith("Task 3: cartpole, preset default, 64 training trajectories, noise 0.05**")
    assert "| 1.2e-3 ± 4.0e-9 | - | - |" in second
    assert table_markdown([]) == ""


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (0.0123456, "0.0123"),
        (0.0099, "9.9e-3"),
        (30.21, "30.2"),
        (999.4, "999"),
        (999.6, "1.0e3"),
        (366380.0, "3.7e5"),
        (math.inf, "diverged"),
    ],
)
def test_numbers_have_two_or_three_digits(value, text):
    assert f" {text} ± 4.0e-9 |" in table_markdown(table_rows([result(value)])).replace(
        "diverged |", "diverged ± 4.0e-9 |"
    )


def test_latex_is_one_tabular_that_compiles():
    text = table_latex(table_rows(RESULTS))
    lines = text.splitlines()
    (columns,) = re.findall(r"\\begin\{tabular\}\{(\w+)\}", text)
    body = [line for line in lines if line.endswith(r"\\") and "multicolumn" not in line]
    assert {line.count("&") for line in body} == {len(columns) - 1}
    assert text.count(rf"\multicolumn{{{len(columns)}}}") == 2
    assert lines[-1] == r"\end{tabular}"
    assert text.count("$") % 2 == 0
    assert text.isascii()
    assert r"$1.8\cdot 10^{-9}$ $\pm$ $4.0\cdot 10^{-9}$" in text
    assert text.count("{") == text.count("}")


def test_letters_that_latex_reads_are_escaped():
    (row,) = table_rows([result(1.0, task="pendulum-canonical", space="T1")])
    assert table_title(row) == "Task 1: pendulum-canonical, told the space T1, preset default"
    cell = Cell(task="pendulum", model="naive", preset="a_b & 50% of #1 {x} $y ~ ^ \\", seed=0)
    text = table_latex(table_rows([CellResult(cell=cell)]))
    assert r"a\_b \& 50\% of \#1 \{x\} \$y \textasciitilde{} \textasciicircum{} \textbackslash{}" in text


def test_all_files_are_written(tmp_path):
    write_tables(tmp_path / "out", RESULTS)
    out = tmp_path / "out"
    assert sorted(path.name for path in out.iterdir()) == ["table.csv", "table.json", "table.md", "table.tex"]
    read = json.loads((out / "table.json").read_text())
    assert read == [result_as_json(one) for one in RESULTS]
    contract = {"task", "model", "preset", "seed", "parameters", "train_error", "test_error", "prediction_error"}
    assert contract | {"seconds"} <= set(read[0])
    assert read[0]["test_error"] == {"mean": 1.84e-9, "std": 4e-9}
    assert (out / "table.csv").read_text() == table_csv(table_rows(RESULTS))
    assert (out / "table.md").read_text() == table_markdown(table_rows(RESULTS))
    assert (out / "table.tex").read_text() == table_latex(table_rows(RESULTS))

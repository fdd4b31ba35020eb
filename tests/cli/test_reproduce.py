"""The paper's evaluation through the command line: what it leaves behind, and how it goes on."""

import contextlib
import csv
import json
import os
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest
from matplotlib.figure import Figure
from rich.console import Console

from symoden.cli import _jobs, main
from symoden.cli._live import _board, _State, show_cells
from symoden.experiments import CellResult, MeanStd, cell_folder, cells, write_result
from symoden.training import Progress

FILES = ["cells", "table.csv", "table.json", "table.md", "table.tex"]


@pytest.fixture(autouse=True)
def quick(monkeypatch, tiny):
    monkeypatch.setattr("symoden.experiments._run_cell.preset", tiny)


def scored(cell, *, error=None):
    """A result without training."""
    if error is not None:
        return CellResult(cell=cell, error=error)
    score = MeanStd(0.5 + cell.seed, 0.25)
    return CellResult(cell=cell, parameters=42, train=score, test=score, prediction=score, seconds=1.5)


@pytest.fixture
def ran(monkeypatch):
    """Names of the cells that are run, nothing being trained."""
    names = []

    def pretend(folder, cell, *, progress):
        names.append(cell.name)
        progress(Progress("Adam", 3, 5, 0.1, None, 1.0))
        result = scored(cell, error="It diverged." if cell.model == "naive" else None)
        write_result(cell_folder(folder, cell), result)
        return result

    monkeypatch.setattr("symoden.cli._jobs.run_cell", pretend)
    monkeypatch.setattr("symoden.cli._jobs.jax.clear_caches", lambda: None)
    return names


def reproduce(out, *words):
    return main(["reproduce", "--out", str(out), "--no-figures", *words])


ONE = ("--tasks", "pendulum", "--models", "dissipative")


def test_a_cell_is_trained_once_and_extended(tmp_path, capsys, monkeypatch):
    out = tmp_path / "out"
    small = (*ONE, "--trajectories", "6")
    assert reproduce(out, *small) == 0
    printed = capsys.readouterr()
    first, *_, last = printed.err.splitlines()  # A slow machine prints progress between them.
    assert first == "pendulum-dissipative-default-0-n6: started"
    assert last.startswith("pendulum-dissipative-default-0-n6: test ")
    assert last.endswith(" s (1 of 1)")
    assert "Task 2: pendulum, preset default, 6 training trajectories" in printed.out
    assert sorted(path.name for path in out.iterdir()) == FILES
    assert main(["evaluate", str(out / "cells" / "pendulum-dissipative-default-0-n6"), "--json"]) == 0
    scores = json.loads(capsys.readouterr().out)
    (row,) = json.loads((out / "table.json").read_text())
    diverged = scores.pop("diverged")  # Of this command alone: a table has the errors, which are infinite then.
    assert set(diverged.values()) == {0}
    assert {key: row[key] for key in scores} == scores

    def never(*arguments, **options):
        raise AssertionError("trained again")

    with monkeypatch.context() as patch:
        patch.setattr("symoden.experiments._run_cell.train_run", never)
        assert reproduce(out, *small) == 0
    assert capsys.readouterr().err.splitlines() == ["1 of 1 cells are finished already"]
    assert reproduce(out, *small, "--seeds", "2") == 0
    assert "pendulum-dissipative-default-1-n6: started" in capsys.readouterr().err
    assert [row["seed"] for row in json.loads((out / "table.json").read_text())] == [0, 1]


def test_the_table_covers_all_that_is_there(ran, tmp_path, capsys):
    assert reproduce(tmp_path, *ONE, "--seeds", "3") == 0
    assert reproduce(tmp_path, "--tasks", "cartpole", "--models", "symoden", "--json") == 0
    answer = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (answer["out"], answer["cells"], answer["failed"]) == (str(tmp_path), 4, [])
    with (tmp_path / "table.csv").open() as file:
        read = list(csv.DictReader(file))
    assert [(row["task"], row["model"], row["seeds"]) for row in read] == [
        ("pendulum", "dissipative", "3"),
        ("cartpole", "symoden", "1"),
    ]
    assert [(row["test_median"], row["test_greatest"]) for row in answer["rows"]] == [(1.5, 2.5), (0.5, 0.5)]
    assert ran[-1] == "cartpole-symoden-default-0"


def test_everything_is_chosen_by_default(ran, tmp_path):
    assert reproduce(tmp_path) == 1
    assert len(ran) == 23
    assert ran[:2] == ["pendulum-canonical-dissipative-default-0", "pendulum-canonical-T1-dissipative-default-0"]


def test_a_failed_cell_stops_nothing_and_is_named(ran, tmp_path, capsys):
    assert reproduce(tmp_path, "--tasks", "pendulum", "--models", "naive", "symoden", "--seeds", "2") == 1
    assert len(ran) == 4
    lines = capsys.readouterr().err.splitlines()
    assert "pendulum-naive-default-0: failed: It diverged. (2 of 4)" in lines
    assert lines[-1].startswith(
        "error: 2 of 4 cells failed: pendulum-naive-default-0, pendulum-naive-default-1. To try one again, remove its "
    )
    assert "naive (2 failed)" in (tmp_path / "table.md").read_text()


def test_what_the_machine_could_not_do_is_tried_again(tmp_path, capsys, monkeypatch):
    def crash(*arguments, **options):
        raise RuntimeError("out of\n memory")

    with monkeypatch.context() as patch:
        patch.setattr("symoden.cli._jobs.run_cell", crash)
        assert reproduce(tmp_path, *ONE, "--json") == 1
    printed = capsys.readouterr()
    assert "RuntimeError: out of memory" in printed.err
    assert json.loads(printed.out)["failed"] == ["pendulum-dissipative-default-0"]
    assert not (tmp_path / "cells").exists()


def test_an_interruption_keeps_what_is_finished(ran, tmp_path, capsys, monkeypatch):
    pretend = _jobs.run_cell

    def interrupt(folder, cell, *, progress):
        if cell.seed == 1:
            raise KeyboardInterrupt
        return pretend(folder, cell, progress=progress)

    with monkeypatch.context() as patch:
        patch.setattr("symoden.cli._jobs.run_cell", interrupt)
        assert reproduce(tmp_path, *ONE, "--seeds", "2") == 130
    message = capsys.readouterr().err.splitlines()[-1]
    assert message == "interrupted; finished cells are kept: give the same command to continue"
    assert [row["seed"] for row in json.loads((tmp_path / "table.json").read_text())] == [0]
    assert reproduce(tmp_path, *ONE, "--seeds", "2") == 0
    assert ran == ["pendulum-dissipative-default-0", "pendulum-dissipative-default-1"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--tasks", "pendulm"), "A task must be one of pendulum-canonical"),
        (("--tasks", "pendulum:T2"), "`T2` has 2"),
        (("--tasks",), "none is left"),
        (("--models", "magic"), "A model must be one of"),
        (("--preset", "fast"), "A preset must be one of default, paper; got 'fast'"),
        (("--seeds", "0"), "must be at least 1; got 0"),
        (("--jobs", "0"), "`--jobs` must be at least 1; got 0"),
        (("--trajectories", "0"), "must be at least 1; got 0"),
        (("--noise", "-1"), "must be at least 0 and finite; got -1.0"),
        (("--seeds", "x"), "--seeds"),
    ],
    ids=str,
)
def test_wrong_choices_are_status_2(ran, tmp_path, capsys, words, message):
    assert reproduce(tmp_path / "out", *words) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    assert ran == []


def test_a_file_is_no_folder(ran, tmp_path, capsys):
    path = tmp_path / "file"
    path.write_text("precious")
    assert reproduce(path) == 2
    assert "`--out` must be a folder" in capsys.readouterr().err
    assert path.read_text() == "precious"


def test_a_damaged_result_is_found_before_anything_runs(ran, tmp_path, capsys):
    assert reproduce(tmp_path, *ONE, "--seeds", "2") == 0
    path = tmp_path / "cells" / "pendulum-dissipative-default-1" / "result.json"
    path.write_text("{")
    assert reproduce(tmp_path, "--tasks", "cartpole", "--models", "symoden") == 2
    message = capsys.readouterr().err.splitlines()[-1]
    assert str(path) in message
    assert "Remove it" in message
    assert len(ran) == 2


def test_figures_and_page_are_made_of_the_results(ran, tmp_path, capsys, monkeypatch):
    seen = {}
    names = ["pendulum-dissipative-default-0", "pendulum-dissipative-default-0-s0.05"]

    def draw(folder, results):
        seen["drawn"] = (folder, [result.cell.name for result in results])
        return {"errors": Figure(figsize=(1, 1)), "sweep-pendulum": Figure(figsize=(1, 1))}

    def write(page, results, rows, figures, facts):
        seen["page"] = (page, len(results), [row.model for row in rows], figures, facts)

    monkeypatch.setattr("symoden.report.draw_results", draw, raising=False)
    monkeypatch.setattr("symoden.report.write_page", write, raising=False)
    monkeypatch.setattr("symoden.experiments.machine_facts", lambda: {"cores": "2"}, raising=False)
    monkeypatch.setattr("symoden.experiments.holds_run", lambda folder: True, raising=False)
    commits = {names[0]: None, names[1]: "0123456789abcdef"}
    monkeypatch.setattr(
        "symoden.experiments.read_run", lambda folder: SimpleNamespace(commit=commits[folder.name]), raising=False
    )
    out, page = tmp_path / "out", tmp_path / "results.md"
    words = ["reproduce", "--out", str(out), *ONE, "--noise", "0.0", "0.05", "--page", str(page)]
    assert main(words) == 0
    assert seen["drawn"] == (out, names)
    pages, count, models, figures, facts = seen["page"]
    assert (pages, count, models) == (page, 2, ["dissipative", "dissipative"])
    assert figures == {name: out / "figures" / f"{name}.png" for name in ("errors", "sweep-pendulum")}
    assert facts["last command"] == (
        f"symoden reproduce --out {out} --tasks pendulum --models dissipative --noise 0.0 0.05 --page {page}"
    )
    assert facts["cores"] == "2"
    assert {"date", "training time"} <= set(facts)
    assert facts["commits that trained them"] == "0123456789, not known"
    written = {path.name: path.read_bytes()[:4] for path in (out / "figures").iterdir()}
    assert written == {
        "errors.png": b"\x89PNG",
        "errors.pdf": b"%PDF",
        "sweep-pendulum.png": b"\x89PNG",
        "sweep-pendulum.pdf": b"%PDF",
    }
    monkeypatch.setattr("symoden.cli._reproduce.importlib.util.find_spec", lambda name: None)
    assert main(words) == 0
    assert 'Install "symoden[plot]"' in capsys.readouterr().err
    assert seen["page"][3] == {}


class Terminal:
    """Standard error that says it is a terminal."""

    def __init__(self):
        self.text = ""

    def write(self, text):
        self.text += text

    def flush(self):
        pass

    def isatty(self):
        return True


def test_the_live_table_shows_each_state(monkeypatch):
    every = cells(["pendulum", "cartpole"], ["dissipative", "naive"], ["default"], 1, noise=[0.05])
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("LINES", "40")
    with show_cells(every, [scored(every[0])]) as watch:
        watch.started(every[1])
        watch.advanced(every[1], Progress("Adam", 300, 1000, 0.1, None, 12.0))
        watch.started(every[2])
        watch.ended(scored(every[2], error="no"))
    last = terminal.text[terminal.text.rindex("task") :]
    for words in ("done", "Adam 300/1000", "failed", "waiting", "12", "0.5", "noise 0.05", "2 of 4 done, of which 1"):
        assert words in last


def test_the_live_table_shows_what_runs_where_not_all_fit():
    every = cells(["pendulum"], ["dissipative"], ["default"], 100)
    states = {cell.name: _State() for cell in every}
    states |= {cell.name: _State(text="done", finished=True) for cell in every[:50]}
    states[every[50].name] = _State(text="Adam 1/5", running=True)
    table = _board(every, states, Console(width=100, height=30))
    shown = list(table.columns[4].cells)
    assert len(shown) == 22
    assert "Adam 1/5" in shown
    assert {"done", "waiting"} < set(shown)


def test_lines_of_progress_come_now_and_then(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("symoden.cli._live.time.monotonic", lambda: now[0])
    one, other = cells(["pendulum", "cartpole"], ["dissipative"], ["default"], 1)
    with show_cells((one, other), ()) as watch:
        watch.started(one)
        watch.started(other)
        for second in range(40):
            now[0] = float(second)
            watch.advanced(one, Progress("Adam", second, 40, 0.1, None, float(second)))
    lines = capsys.readouterr().err.splitlines()
    assert lines[2:] == [f"pendulum-dissipative-default-0: Adam {second}/40, {second} s" for second in (15, 30)]


# Workers import the program that started them, and so have its settings.
PROGRAM = """
import sys
from symoden.cli import main
from symoden.experiments import _run_cell
from symoden.models import BlockConfig, ModelConfig
from symoden.training import TrainingConfig

def tiny(name, *, task, kind):
    block = BlockConfig(constant=True)
    model = ModelConfig(kind=kind, inverse_mass=block, potential=BlockConfig(hidden=(4,)), actuation=block)
    return model, TrainingConfig(adam_steps={steps}, lm_steps=0, restarts=1, batch_size=16, validation=0.0)

_run_cell.preset = tiny
if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
"""


def start(tmp_path, *, steps):
    """A run of two cells at once, in processes of their own."""
    program = tmp_path / "program.py"
    program.write_text(PROGRAM.format(steps=steps))
    words = ["--tasks", "pendulum", "--models", "symoden", "--seeds", "2", "--jobs", "2", "--trajectories", "4"]
    command = [sys.executable, str(program), "reproduce", "--out", str(tmp_path / "out"), "--no-figures", *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


def ended(group, *, patience):
    """Whether every process of a group ends in so many seconds."""
    for _ in range(10 * patience):
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.1)
    return False


def test_several_cells_run_at_once(tmp_path):
    run = start(tmp_path, steps=5)
    out, err = run.communicate(timeout=300)
    assert run.returncode == 0, err
    lines = err.splitlines()
    assert lines[:2] == ["pendulum-symoden-default-0-n4: started", "pendulum-symoden-default-1-n4: started"]
    assert sorted(line.rpartition(" (")[2] for line in lines[-2:]) == ["1 of 2)", "2 of 2)"]
    assert "2 " in out
    read = json.loads((tmp_path / "out" / "table.json").read_text())
    assert [(row["seed"], row["error"]) for row in read] == [(0, None), (1, None)]
    assert read[0]["test_error"] != read[1]["test_error"]
    assert ended(run.pid, patience=10)


@pytest.mark.parametrize("how", ["interrupted", "killed"])
def test_no_worker_outlives_the_command(tmp_path, how):
    run = start(tmp_path, steps=10**7)
    cell = tmp_path / "out" / "cells" / "pendulum-symoden-default-1-n4" / "config.json"
    try:
        for _ in range(1200):
            if cell.exists() or run.poll() is not None:
                break
            time.sleep(0.1)
        assert run.poll() is None
        if how == "killed":
            run.kill()
        else:
            os.killpg(run.pid, signal.SIGINT)  # As a terminal does.
        _, err = run.communicate(timeout=60)
        assert ended(run.pid, patience=10)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(run.pid, signal.SIGKILL)
    if how == "interrupted":
        assert run.returncode == 130
        assert err.splitlines()[-1] == "interrupted; finished cells are kept: give the same command to continue"
        assert "Traceback" not in err

"""The front of the command line: help without JAX, one message for each error, exit statuses."""

import os
import subprocess
import sys

import pytest

import symoden
from symoden.cli import _session, main
from symoden.experiments import TASKS
from symoden.models import KINDS
from symoden.storage import StorageError
from symoden.training import TrainingError

COMMANDS = ["simulate", "train", "evaluate", "predict", "inspect", "control", "reproduce", "data"]
HEAVY = ["jax", "jaxlib", "numpy", "scipy", "polars", "equinox", "diffrax", "optax", "rich"]
PROBE = """
import sys
from symoden.cli import main
status = main(sys.argv[1:])
print([name for name in {heavy} if name in sys.modules])
sys.exit(status)
"""
LONG = """
import sys
import symoden.cli._simulate
from symoden.cli import main

def run(command):
    for line in range(100_000):
        print(line)

symoden.cli._simulate.run = run
sys.exit(main(sys.argv[1:]))
"""


def failing(monkeypatch, command, error):
    def run(arguments):
        raise error

    monkeypatch.setattr(f"symoden.cli._{command}.run", run)


@pytest.mark.parametrize("words", [[], *([name] for name in COMMANDS), ["data", "check"]], ids=str)
def test_help_loads_nothing_heavy(words):
    program = [sys.executable, "-c", PROBE.format(heavy=HEAVY), *words, "--help"]
    answer = subprocess.run(program, capture_output=True, check=False, text=True)
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.startswith(" ".join(["usage: symoden", *words]))
    assert answer.stdout.splitlines()[-1] == "[]"


def test_the_module_runs_as_the_program_does():
    answer = subprocess.run([sys.executable, "-m", "symoden", "--version"], capture_output=True, check=True, text=True)
    assert answer.stdout.strip() == symoden.__version__


def test_help_names_every_command_task_and_kind(capsys):
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert [name for name in COMMANDS if name not in text] == []
    for command in ("simulate", "train"):
        assert main([command, "--help"]) == 0
        text = capsys.readouterr().out
        assert [name for name in TASKS if name not in text] == []
    assert [kind for kind in KINDS if kind not in text] == []


def test_help_on_data_says_that_they_are_checked(capsys):
    assert main(["data", "--help"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("usage: symoden data [-h] {check}\n\n`symoden data check FILE.toml` checks a data set")
    assert "there is nothing else" not in text
    assert main(["data", "check", "--help"]) == 0
    assert capsys.readouterr().out.startswith("usage: symoden data check [-h] FILE.toml")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "Missing subcommand"),
        (["data"], "Expected one of {check}"),
        (["data", "a.toml"], "`a.toml` is no command. Commands are: check."),
        (["data", "check"], "FILE.toml"),
        (["learn"], "`learn` is no command. Commands are: simulate, train,"),
        (["trains"], "`trains` is no command; did you mean `train`? Commands are: simulate, train,"),
        (["data", "checks", "a.toml"], "`checks` is no command; did you mean `check`? Commands are: check."),
        (["train", "pendulum"], "--out RUN"),
        (["train", "pendulum", "--out", "run", "--sed", "3"], "--seed"),
        (["train", "pendulum", "--out", "run", "--seed", "x"], "Error parsing --seed: must be an integer; got 'x'"),
        (["train", "pendulum", "--out", "run", "--noise", "x"], "Error parsing --noise: must be a number; got 'x'"),
        (["train", "pendulum", "--out", "run", "--seed", "9" * 20], "--seed: must be at most 4294967295; got 9999999"),
        (["control", "run", "--seed", "0.5"], "Error parsing --seed: must be an integer; got '0.5'"),
        (["evaluate"], "RUN"),
        (["predict", "run", "pendulum"], "--out FILE.npz"),
        (["reproduce"], "--out DIR"),
    ],
    ids=str,
)
def test_wrong_usage_is_status_2_and_says_what_is_wrong(capsys, words, message):
    assert main(words) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.out == ""


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [
        (ValueError("The value\n must be 1."), 2, "error: The value must be 1.\n"),
        (StorageError("`a` is damaged."), 2, "error: `a` is damaged.\n"),
        (TrainingError("Everything diverged."), 1, "error: Everything diverged.\n"),
        (OSError(28, "No space left on device"), 1, "error: [Errno 28] No space left on device\n"),
        (
            KeyError("q"),
            1,
            "error: KeyError: 'q'. This should not happen; please report it with the output of --debug.\n",
        ),
    ],
    ids=lambda value: type(value).__name__,
)
def test_an_error_is_one_line_and_a_status(monkeypatch, capsys, error, status, message):
    failing(monkeypatch, "simulate", error)
    assert main(["simulate", "pendulum", "--out", "a.npz"]) == status
    assert capsys.readouterr() == ("", message)


def test_a_refusal_of_the_system_is_a_failure(monkeypatch, capsys):
    error = StorageError("`a` must be writable.")
    error.__cause__ = OSError(28, "No space left on device")
    failing(monkeypatch, "simulate", error)
    assert main(["simulate", "pendulum", "--out", "a.npz"]) == 1
    assert capsys.readouterr().err == "error: `a` must be writable.\n"


def test_debug_shows_the_traceback(monkeypatch):
    failing(monkeypatch, "simulate", KeyError("q"))
    with pytest.raises(KeyError):
        main(["simulate", "pendulum", "--out", "a.npz", "--debug"])


def test_a_reader_that_ends_ends_the_command_quietly(tmp_path):
    program = [sys.executable, "-c", LONG, "simulate", "pendulum", "--out", str(tmp_path / "a.npz")]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline() == "0\n"
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 141


@pytest.mark.parametrize("words", [["train", "--help"], ["--help"], ["--version"]], ids=" ".join)
def test_so_does_one_that_reads_no_help(words):
    program = [sys.executable, "-m", "symoden", *words]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 141


def test_a_broken_pipe_to_another_process_is_a_failure(monkeypatch, capsys):
    failing(monkeypatch, "simulate", BrokenPipeError(32, "Broken pipe"))
    assert main(["simulate", "pendulum", "--out", "a.npz"]) == 1
    assert capsys.readouterr().err == "error: [Errno 32] Broken pipe\n"


def test_an_interrupted_training_says_how_to_continue(monkeypatch, tmp_path, capsys):
    failing(monkeypatch, "train", KeyboardInterrupt())
    run = tmp_path / "run 1"
    run.mkdir()
    (run / "config.json").write_text("{}")
    for words, more in (
        (["a.toml", "--out", str(run), "--seed", "3"], ""),
        (["--out", str(run), "--resume"], ""),  # A run knows its source.
        (["--out", str(run), "--resume", "--members", "4"], "--members 4 "),
    ):
        assert main(["train", *words]) == 130
        said = capsys.readouterr().err
        assert said == f"interrupted; continue with: symoden train --out '{run}' {more}--resume\n"
    failing(monkeypatch, "inspect", KeyboardInterrupt())
    assert main(["inspect", "runs/a"]) == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_a_training_that_was_interrupted_before_it_began_is_to_be_started_as_it_was(monkeypatch, tmp_path, capsys):
    failing(monkeypatch, "train", KeyboardInterrupt())
    run = tmp_path / "run"
    assert main(["train", "my arm.toml", "--out", str(run), "--seed", "3", "--model", "symoden"]) == 130
    again = f"symoden train 'my arm.toml' --out {run} --seed 3 --model symoden"
    assert capsys.readouterr().err == f"interrupted; nothing was begun, start again with: {again}\n"


@pytest.mark.parametrize(
    ("given", "jaxlib", "left"),
    [
        ("", "0.10.2", "--xla_cpu_use_fusion_emitters=false"),
        ("--xla_dump_to=d", "0.10.0", "--xla_dump_to=d --xla_cpu_use_fusion_emitters=false"),
        ("--xla_cpu_use_fusion_emitters=true", "0.10.2", "--xla_cpu_use_fusion_emitters=true"),
        ("", "0.11.0", ""),  # A flag that it does not know would end the process.
    ],
)
def test_programs_compile_fast_where_that_was_tried_and_the_user_says_nothing_else(monkeypatch, given, jaxlib, left):
    monkeypatch.setenv("XLA_FLAGS", given)
    monkeypatch.setattr(_session, "version", {"jaxlib": jaxlib}.__getitem__)
    _session.configure()
    assert os.environ["XLA_FLAGS"] == left


@pytest.mark.parametrize(
    ("given", "trains", "cores", "threads"),
    [(None, True, 2, None), (None, False, 2, "1"), ("4", False, 2, "4"), (None, False, 16, None)],
)
def test_what_does_not_train_has_one_thread_unless_the_user_says_otherwise(monkeypatch, given, trains, cores, threads):
    """Two of XLA's threads waited for each other."""
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    monkeypatch.setenv("NPROC", given or "")
    if given is None:
        monkeypatch.delenv("NPROC")
    _session.configure(trains=trains)
    assert os.environ.get("NPROC") == threads


@pytest.mark.parametrize(("words", "trains"), [(["train", "x"], True), (["inspect", "x"], False)])
def test_training_alone_has_all_threads(monkeypatch, capsys, words, trains):
    asked = []
    monkeypatch.setattr(_session, "configure", lambda **settings: asked.append(settings))
    assert main([*words, *(["--out", "y"] if trains else [])]) != 0  # There is no x.
    assert asked == [{"trains": trains}]


@pytest.mark.parametrize(("limit", "left"), [(1000, ["4", "5", "read"]), (1200, ["0", "1", "2", "3", "4", "5"])])
def test_of_too_large_a_cache_the_programs_go_that_were_not_used_for_longest(tmp_path, limit, left):
    folder = tmp_path / "symoden" / "jax"
    (folder / "other").mkdir(parents=True)
    for k in range(6):
        (folder / str(k)).write_bytes(bytes(200))
        os.utime(folder / str(k), (1e9 + k, 1e9 + k))
    if limit == 1000:
        (folder / "0").rename(folder / "read")
        os.utime(folder / "read", (1.1e9, 1e9))
    words = f"from symoden.cli import _session; _session._LARGEST = {limit}; _session.configure()"
    environment = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")} | {"XDG_CACHE_HOME": str(tmp_path)}
    subprocess.run([sys.executable, "-c", words], env=environment, check=True)
    assert sorted(path.name for path in folder.iterdir() if path.is_file()) == left


def test_programs_that_were_not_written_to_the_end_are_compiled_without_a_word(tmp_path):
    def simulate():
        words = [sys.executable, "-m", "symoden", "simulate", "pendulum", "--out", str(tmp_path / "data.npz")]
        environment = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")}
        return subprocess.run(
            words, env=environment | {"XDG_CACHE_HOME": str(tmp_path)}, capture_output=True, text=True, check=True
        )

    first = simulate()
    entries = list((tmp_path / "symoden" / "jax").glob("*-cache"))
    assert entries
    for entry in entries:
        os.truncate(entry, 100)
    again = simulate()
    assert (again.stdout, again.stderr) == (first.stdout, first.stderr)
    assert "pendulum" in first.stdout

"""Entry point: parse, run one command, and turn errors into one message and an exit status."""

import difflib
import importlib
import importlib.metadata
import inspect
import logging
import os
import shlex
import sys
from collections.abc import Sequence
from typing import Annotated, Any, Final, Union

import tyro

from ._arguments import COMMANDS, DATA_COMMANDS, Command, Control, Reproduce, Train
from ._numbers import number_rules

FAILURE: Final = 1
WRONG_INPUT: Final = 2
INTERRUPTED: Final = 130
UNREAD: Final = 141  # as of a program that SIGPIPE ends

_DESCRIPTION: Final = (
    "Learn the inertia, potential energy, actuation and friction of a mechanism from its logs, as a port-Hamiltonian "
    "system. `symoden COMMAND --help` explains a command; `symoden --version` prints the version."
)
_OF_DATA: Final = "`symoden data check FILE.toml` checks a data set; `symoden data check --help` explains it."


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: Words after the program's name; those of the process if absent.

    Returns:
        Exit status: 0, or 1 for a failure, 2 for wrong usage or input, 130 for an interruption, 141 if nobody reads on.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if words == ["--version"]:
            print(importlib.metadata.version("symoden"), flush=True)
            return 0
        command = _parse(words)
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else WRONG_INPUT
    except BrokenPipeError:  # Help is long.
        _nobody_reads()
        return UNREAD
    return _obey(command, words)


def _obey(command: Command, words: list[str]) -> int:
    """Run a command and say what went wrong; the exit status."""
    try:
        if isinstance(command, Control):
            importlib.import_module("._checks", __package__).check_control(command)
        _carry_out(command)
        sys.stdout.flush()
    except KeyboardInterrupt:
        print(f"interrupted{_way_on(command, words)}", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        if isinstance(error, BrokenPipeError) and _nobody_reads():
            return UNREAD
        if command.general.debug:
            raise
        print(f"error: {_message(error)}", file=sys.stderr)
        return _status(error)
    return 0


def _parse(words: list[str]) -> Command:
    """Read the command, or exit with help or with what is wrong."""
    config = (tyro.conf.OmitArgPrefixes, tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone)
    kinds, program, description = COMMANDS, "symoden", _DESCRIPTION
    if words and words[0] == "data":
        kinds, program, description, words = DATA_COMMANDS, "symoden data", _OF_DATA, words[1:]
    if words and words[0] in kinds:
        name, *words = words
        return tyro.cli(kinds[name], prog=f"{program} {name}", args=words, config=config, registry=number_rules())
    if words and not words[0].startswith("-"):
        near = difflib.get_close_matches(words[0], kinds, n=1)
        meant = f"; did you mean `{near[0]}`?" if near else "."
        print(f"error: `{words[0]}` is no command{meant} Commands are: {', '.join(kinds)}.", file=sys.stderr)
        raise SystemExit(WRONG_INPUT)
    # Nothing is chosen, so this exits; one line explains each command.
    choices = [
        Annotated[kind, tyro.conf.subcommand(name, description=inspect.getdoc(kind).partition("\n")[0])]  # pyright: ignore[reportOptionalMemberAccess]
        for name, kind in kinds.items()
    ]
    hidden = Annotated[None, tyro.conf.Suppress]  # Where there is one choice alone, tyro would take it for chosen.
    union: Any = Union[(*choices, hidden)]
    return tyro.cli(union, prog=program, description=description, args=words, config=config)


def _carry_out(command: Command) -> None:
    """Import the module of the command, and JAX with it, and run it."""
    if command.general.debug:
        logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s")
    trains = isinstance(command, Train | Reproduce)
    importlib.import_module("._session", __package__).configure(trains=trains)
    with importlib.import_module("._warnings", __package__).warnings_as_lines():
        importlib.import_module(f"._{type(command).__name__.lower()}", __package__).run(command)


def _nobody_reads() -> bool:
    """Whether standard output has ended, as that to `head` does; what is still to be written is then thrown away."""
    try:
        print(flush=True)  # The failed write is forgotten: only another one tells.
    except BrokenPipeError:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, sys.stdout.fileno())
        os.close(nothing)
        return True
    return False


def _way_on(command: Command, words: Sequence[str]) -> str:
    """How to continue what was interrupted."""
    if isinstance(command, Reproduce):
        return "; finished cells are kept: give the same command to continue"
    if not isinstance(command, Train):
        return ""
    if not (command.out / "config.json").is_file():  # `holds_run`, which imports JAX: that may be what was interrupted.
        return f"; nothing was begun, start again with: {shlex.join(['symoden', *words])}"
    more = [] if command.members is None else ["--members", str(command.members)]  # The run may not know of them yet.
    return f"; continue with: {shlex.join(['symoden', 'train', '--out', str(command.out), *more, '--resume'])}"


def _status(error: Exception) -> int:
    """Wrong input if the error is a `ValueError`, unless the system itself refused, as a full disk does."""
    refused = isinstance(error.__cause__, OSError)
    return WRONG_INPUT if isinstance(error, ValueError) and not refused else FAILURE


def _message(error: Exception) -> str:
    """What to tell the user, in one line."""
    text = " ".join(str(error).split())
    if isinstance(error, ValueError | OSError):
        return text
    from symoden.training import TrainingError  # And JAX with it.

    if isinstance(error, TrainingError):
        return text
    return f"{type(error).__name__}: {text}. This should not happen; please report it with the output of --debug."

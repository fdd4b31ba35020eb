"""Cells while they run: a live table on a terminal, plain lines elsewhere."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from rich import box
from rich.console import Console
from rich.live import Live
from rich.table import Table

from symoden.experiments import Cell, CellResult, MeanStd
from symoden.training import Progress
from symoden.wording import number

from ._output import console

_PAUSE = 15.0
_AROUND = 8  # Lines of the display that are no cells, and one of air.
_COLUMNS = ("task", "model", "preset", "seed", "state", "test", "prediction", "seconds")


class Watch(NamedTuple):
    """What is told of cells.

    Attributes:
        started: A cell begins.
        advanced: A cell reports.
        ended: A cell has its result.
    """

    started: Callable[[Cell], None]
    advanced: Callable[[Cell, Progress], None]
    ended: Callable[[CellResult], None]


class _State(NamedTuple):
    """What the display says of a cell."""

    text: str = "waiting"
    running: bool = False
    finished: bool = False
    failed: bool = False
    test: MeanStd | None = None
    prediction: MeanStd | None = None
    seconds: float | None = None


@contextlib.contextmanager
def show_cells(every: Sequence[Cell], known: Sequence[CellResult]) -> Iterator[Watch]:
    """Show cells on standard error while the context lasts.

    Args:
        every: The cells.
        known: Results that there are already.

    Yields:
        What to tell of each cell.
    """
    out = console(stderr=True)
    if known:
        print(f"{len(known)} of {len(every)} cells are finished already", file=sys.stderr, flush=True)
    if not out.is_terminal:
        yield _on_lines(len(every), len(known))
        return
    states = {cell.name: _State() for cell in every}
    states |= {result.cell.name: _finished(result) for result in known}
    with Live(get_renderable=lambda: _board(every, states, out), console=out, refresh_per_second=2):
        yield _on_terminal(states)


def _on_terminal(states: dict[str, _State]) -> Watch:
    """Keep the states that the display reads."""

    def started(cell: Cell) -> None:
        states[cell.name] = _State(text="started", running=True)

    def advanced(cell: Cell, progress: Progress) -> None:
        states[cell.name] = _State(text=_stage(progress), running=True, seconds=progress.seconds)

    def ended(result: CellResult) -> None:
        states[result.cell.name] = _finished(result)

    return Watch(started, advanced, ended)


def _on_lines(total: int, known: int) -> Watch:
    """Print a line when a cell starts, when it ends, and every now and then for those that run."""
    running: dict[str, Progress | None] = {}
    last, done = time.monotonic(), known

    def say(text: str) -> None:
        nonlocal last
        last = time.monotonic()
        print(text, file=sys.stderr, flush=True)

    def started(cell: Cell) -> None:
        running[cell.name] = None
        say(f"{cell.name}: started")

    def advanced(cell: Cell, progress: Progress) -> None:
        running[cell.name] = progress
        if time.monotonic() - last >= _PAUSE:
            reports = ((name, report) for name, report in running.items() if report is not None)
            say("; ".join(f"{name}: {_stage(report)}, {report.seconds:.0f} s" for name, report in reports))

    def ended(result: CellResult) -> None:
        nonlocal done
        running.pop(result.cell.name, None)
        done += 1
        say(f"{result.cell.name}: {_outcome(result)} ({done} of {total})")

    return Watch(started, advanced, ended)


def _outcome(result: CellResult) -> str:
    """The result of a cell in words."""
    if result.error is not None:
        return f"failed: {result.error}"
    seconds = "" if result.seconds is None else f", {result.seconds:.0f} s"
    return f"test {_mean(result.test)}, prediction {_mean(result.prediction)}{seconds}"


def _stage(progress: Progress) -> str:
    """How far training is."""
    return f"{progress.stage} {progress.step}/{progress.steps}"


def _finished(result: CellResult) -> _State:
    """State of a cell with a result."""
    failed = result.error is not None
    text = "failed" if failed else "done"
    return _State(
        text=text,
        finished=True,
        failed=failed,
        test=result.test,
        prediction=result.prediction,
        seconds=result.seconds,
    )


def _board(every: Sequence[Cell], states: dict[str, _State], out: Console) -> Table:
    """The table, as much of it as fits, around the cells that run."""
    done, failed = (sum(getattr(state, name) for state in states.values()) for name in ("finished", "failed"))
    caption = f"{done} of {len(every)} done" + (f", of which {failed} failed" if failed else "")
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, caption=caption, caption_justify="left")
    for name in _COLUMNS:
        table.add_column(name, justify="right" if name in {"seed", "test", "prediction", "seconds"} else "left")
    room = max(1, out.size.height - _AROUND)
    first = next((i for i, cell in enumerate(every) if not states[cell.name].finished), len(every))
    start = max(0, min(first - room // 3, len(every) - room))
    for cell in every[start : start + room]:
        state = states[cell.name]
        texts = (_mean(state.test), _mean(state.prediction), "" if state.seconds is None else f"{state.seconds:.0f}")
        style = "red" if state.failed else "bold" if state.running else "dim" if not state.finished else ""
        table.add_row(_data(cell), cell.model, cell.preset, str(cell.seed), state.text, *texts, style=style)
    return table


def _data(cell: Cell) -> str:
    """What a cell learns from."""
    space = "" if cell.space is None else f":{cell.space}"
    count = "" if cell.trajectories is None else f", {cell.trajectories} trajectories"
    return f"{cell.task}{space}{count}" + (f", noise {cell.noise:g}" if cell.noise else "")


def _mean(error: MeanStd | None) -> str:
    """The mean of an error."""
    return "" if error is None else number(error.mean)

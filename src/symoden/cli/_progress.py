"""Progress: of training a bar on a terminal, of other work a spinner; plain lines elsewhere."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress as Bars, TaskID, TextColumn, TimeElapsedColumn

from symoden.training import Progress

from ._output import console

_PAUSE = 2.0


@contextlib.contextmanager
def show_progress() -> Iterator[Callable[[Progress], None]]:
    """Show progress on standard error while the context lasts.

    Yields:
        What to call with each report.
    """
    out = console(stderr=True)
    if out.is_terminal:
        with _bars(out) as bars:
            yield _on_terminal(bars)
    else:
        yield _on_lines()


@contextlib.contextmanager
def show_work(what: str) -> Iterator[None]:
    """Say on standard error what is going on while the context lasts.

    Args:
        what: The work, whose length is not known.

    Yields:
        Nothing.
    """
    out = console(stderr=True)
    if out.is_terminal:
        with out.status(what):
            yield
    else:
        print(what, file=sys.stderr, flush=True)
        yield


def _bars(out: Console) -> Bars:
    """Columns of the display."""
    return Bars(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[losses]}"),
        TimeElapsedColumn(),
        console=out,
    )


def _on_terminal(bars: Bars) -> Callable[[Progress], None]:
    """Draw a bar for each stage."""
    tasks: dict[str, TaskID] = {}

    def report(progress: Progress) -> None:
        if progress.stage not in tasks:
            for earlier in tasks.values():
                bars.stop_task(earlier)
            tasks[progress.stage] = bars.add_task(progress.stage, total=progress.steps, losses="")
        bars.update(tasks[progress.stage], completed=progress.step, losses=progress.losses)

    return report


def _on_lines() -> Callable[[Progress], None]:
    """Print a line every few seconds, and at the first report and the end of each stage."""
    last: tuple[str, float] = ("", 0.0)
    unsaid: Progress | None = None

    def report(progress: Progress) -> None:
        nonlocal last, unsaid
        now = time.monotonic()
        if unsaid is not None and progress.stage != unsaid.stage:
            _say(unsaid)  # How the stage before ended.
        unsaid = progress
        ends = progress.step == progress.steps or progress.verdict
        if progress.stage != last[0] or ends or now - last[1] >= _PAUSE:
            last, unsaid = (progress.stage, now), None
            _say(progress)

    return report


def _say(progress: Progress) -> None:
    """Print a line."""
    print(progress, file=sys.stderr, flush=True)

"""Running cells one after the other in this process, or several at once in others."""

import json
import logging
import math
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import jax

from symoden.experiments import Cell, CellResult, cell_folder, run_cell
from symoden.training import Progress, TrainingError, ignore

from ._live import Watch
from ._session import configure

_PAUSE = 1.0
_LOGGER = logging.getLogger(__name__)


def run_cells(
    folder: Path, todo: Sequence[Cell], *, jobs: int, watch: Watch, keep: Callable[[CellResult], None]
) -> None:
    """Run cells.

    Args:
        folder: Folder of all results.
        todo: What to run.
        jobs: How many at once.
        watch: What is told of each cell.
        keep: Called with each result.
    """
    if jobs > 1 and len(todo) > 1:
        _in_processes(folder, todo, min(jobs, len(todo)), watch, keep)
        return
    for cell in todo:
        watch.started(cell)
        result = _attempt(folder, cell, lambda progress, cell=cell: watch.advanced(cell, progress))
        keep(result)
        watch.ended(result)


def _in_processes(
    folder: Path, todo: Sequence[Cell], jobs: int, watch: Watch, keep: Callable[[CellResult], None]
) -> None:
    """Run cells in worker processes, as many as there are jobs; none is left when this ends, however it does."""
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)
    waiting = iter(todo)
    running: dict[Future[CellResult], Cell] = {}
    try:
        while True:
            while len(running) < jobs and (cell := next(waiting, None)) is not None:
                running[pool.submit(_attempt, folder, cell)] = cell
                watch.started(cell)
            if not running:
                break
            done, _ = wait(running, timeout=_PAUSE, return_when=FIRST_COMPLETED)
            for cell in (cell for future, cell in running.items() if future not in done):
                if (progress := _latest(folder, cell)) is not None:
                    watch.advanced(cell, progress)
            for future in done:
                del running[future]
                result = future.result()
                keep(result)
                watch.ended(result)
    except BrokenProcessPool as error:
        raise TrainingError(
            "A worker process was killed, perhaps for lack of memory; finished cells are kept. Give the same command "
            "with fewer `--jobs`."
        ) from error
    finally:
        if running:
            for child in set(multiprocessing.active_children()) - others:
                child.terminate()
        pool.shutdown(cancel_futures=True)


def _begin() -> None:
    """Prepare a worker: the settings of JAX; interruptions and the end of the process that started it end it too."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # The parent has it as well, and ends its workers.
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()
    configure()


def _attempt(folder: Path, cell: Cell, progress: Callable[[Progress], None] = ignore) -> CellResult:
    """Run a cell; what the machine could not do becomes a result that is not kept, so that the next run tries again."""
    try:
        return run_cell(folder, cell, progress=progress)
    except (RuntimeError, MemoryError) as error:
        _LOGGER.info("%s failed", cell.name, exc_info=True)
        return CellResult(cell=cell, error=f"{type(error).__name__}: {' '.join(str(error).split())}")
    finally:
        jax.clear_caches()  # Programs of many cells would fill the memory; the cache on disk keeps them.


def _latest(folder: Path, cell: Cell) -> Progress | None:
    """Last report of a cell that another process runs."""
    path = cell_folder(folder, cell) / "metrics.jsonl"
    try:
        value = json.loads(path.read_text(encoding="utf-8").splitlines()[-1])
        loss = value["loss"]
        return Progress(**(value | {"loss": math.nan if loss is None else loss}))
    except (OSError, ValueError, IndexError, KeyError, TypeError):
        return None  # Nothing was written yet.

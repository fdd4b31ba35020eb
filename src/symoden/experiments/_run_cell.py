"""Running a cell: train, score, keep the result; what is on disk already is not done again."""

import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from symoden.blocks import count_parameters
from symoden.data import DataError
from symoden.storage import StorageError
from symoden.training import Progress, TrainingError, ignore

from ._block_errors import block_errors
from ._cells import Cell, CellResult
from ._data_summary import summarize
from ._paper import MeanStd
from ._presets import preset
from ._results import cell_folder, read_result, write_result
from ._runs import RunConfig, evaluation_solver, holds_run, read_model, read_run, train_run
from ._score_task import score_task
from ._sources import Source, read_source


def run_cell(folder: Path, cell: Cell, *, progress: Callable[[Progress], None] = ignore) -> CellResult:
    """Train a cell and score it, or go on where an interrupted run was; a finished cell is read.

    Args:
        folder: Folder of all results; the cell's run is `cells/<name>` in it, its result `result.json` there.
        cell: The cell.
        progress: Called after every stride of training.

    Returns:
        The result; that of a training that came to nothing, or of data too few to train on, has its error.

    Raises:
        ValueError: If the cell was begun with other settings; a `StorageError` if a file is damaged or cannot be
            written.
    """
    known = check_cell(folder, cell)
    if known is not None:
        return known
    run = cell_folder(folder, cell)
    source = read_source(cell.task, seed=cell.seed, space=cell.space, trajectories=cell.trajectories, noise=cell.noise)
    try:
        seconds = _trained(run, RunConfig(**_asked(cell), data=summarize(source.dataset)), source, progress)
    except (TrainingError, DataError) as error:
        result = CellResult(cell=cell, seconds=_seconds(run), error=" ".join(str(error).split()))
    else:
        result = _scored(run, cell, source, seconds)
    write_result(run, result)
    return result


def check_cell(folder: Path, cell: Cell) -> CellResult | None:
    """Find what there is of a cell.

    Args:
        folder: Folder of all results.
        cell: The cell.

    Returns:
        Its result, if it is finished.

    Raises:
        ValueError: If the cell was begun with other settings; a `StorageError` if a file is damaged.
    """
    run = cell_folder(folder, cell)
    if holds_run(run):
        saved = read_run(run)
        for name, value in _asked(cell).items():
            if getattr(saved, name) != value:
                raise ValueError(
                    f"`{run}` was begun with other settings than it now would be: another `{name}`. "
                    "Choose another folder, or remove that of the cell."
                )
    return read_result(run)


def _asked(cell: Cell) -> dict[str, Any]:
    """Settings that a cell fixes, by their names in `RunConfig`."""
    model, training = preset(cell.preset, task=cell.task, kind=cell.model)
    return {
        "source": cell.task,
        "seed": cell.seed,
        "space": cell.space,
        "preset": cell.preset,
        "trajectories": cell.trajectories,
        "noise": cell.noise,
        "model": model,
        "training": dataclasses.replace(training, seed=cell.seed),
    }


def _trained(run: Path, config: RunConfig, source: Source, progress: Callable[[Progress], None]) -> float | None:
    """Train, unless that is done; how long it took."""
    if holds_run(run) and (run / "model.safetensors").is_file():
        return _seconds(run)
    if not holds_run(run):
        for leftover in run.glob(".config.json.*"):  # Of a process that was killed while it wrote.
            leftover.unlink()
    return train_run(run, config, source.dataset, resume=True, progress=progress).seconds


def _seconds(run: Path) -> float | None:
    """Time that the run's metrics report [s]; None if there are none."""
    path = run / "metrics.jsonl"
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        return float(json.loads(lines[-1])["seconds"]) if lines else None
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StorageError(f"`{path}` is damaged: {error}. Remove the folder of the cell.") from None


def _scored(run: Path, cell: Cell, source: Source, seconds: float | None) -> CellResult:
    """Score the model that the run holds."""
    model = read_model(run)
    score = score_task(model, source, solver=evaluation_solver(read_run(run)))
    return CellResult(
        cell=cell,
        parameters=count_parameters(model),
        train=_finite(score.train),
        test=_finite(score.test),
        prediction=_finite(score.prediction),
        seconds=seconds,
        blocks=block_errors(model, source),
    )


def _finite(error: MeanStd) -> MeanStd:
    """The error, or infinities: if one trajectory diverges, so do the mean and what goes with it."""
    return error if all(map(math.isfinite, error)) else MeanStd(math.inf, math.inf)

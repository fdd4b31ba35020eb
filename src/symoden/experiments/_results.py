"""Results of cells on disk: one JSON file in the folder of each."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from symoden.models import Kind
from symoden.storage import StorageError, write_atomically

from ._block_errors import BlockErrors
from ._cells import Cell, CellResult
from ._paper import MeanStd
from ._settings import decode
from ._tasks import task as find_task

_FILE: Final = "result.json"
_SPREADS: Final = ("train_error", "test_error", "prediction_error", "blocks")


@dataclass(frozen=True, kw_only=True)
class _Spread:
    """A `MeanStd` as JSON has it."""

    mean: float
    std: float


@dataclass(frozen=True, kw_only=True)
class _Stored:
    """A result as JSON has it, the contract of `table.json`."""

    task: str
    space: str | None
    model: Kind
    preset: str
    trajectories: int | None
    noise: float
    seed: int
    parameters: int | None
    train_error: _Spread | None
    test_error: _Spread | None
    prediction_error: _Spread | None
    seconds: float | None
    blocks: BlockErrors | None
    error: str | None


def cell_folder(folder: Path, cell: Cell) -> Path:
    """Folder of a cell's run.

    Args:
        folder: Folder of all results.
        cell: The cell.

    Returns:
        Its folder, which may not exist yet.
    """
    return folder / "cells" / cell.name


def result_as_json(result: CellResult) -> dict[str, Any]:
    """A result as `table.json` has it.

    Args:
        result: The result.

    Returns:
        What JSON can express; errors that are not finite are null.
    """

    def spread(error: MeanStd | None) -> _Spread | None:
        return None if error is None else _Spread(mean=error.mean, std=error.std)

    cell = result.cell
    value = asdict(
        _Stored(
            task=cell.task,
            space=cell.space,
            model=cell.model,
            preset=cell.preset,
            trajectories=cell.trajectories,
            noise=cell.noise,
            seed=cell.seed,
            parameters=result.parameters,
            train_error=spread(result.train),
            test_error=spread(result.test),
            prediction_error=spread(result.prediction),
            seconds=result.seconds,
            blocks=result.blocks,
            error=result.error,
        )
    )
    for key in _SPREADS:
        if value[key] is not None:
            value[key] = {name: number if math.isfinite(number) else None for name, number in value[key].items()}
    return value


def write_result(run: Path, result: CellResult) -> None:
    """Keep a result.

    Args:
        run: Folder of the cell's run.
        result: Its result.

    Raises:
        StorageError: If it cannot be written.
    """
    text = json.dumps(result_as_json(result), indent=2, allow_nan=False)
    write_atomically(run / _FILE, f"{text}\n".encode())


def read_result(run: Path) -> CellResult | None:
    """Read the result of a cell.

    Args:
        run: Folder of the cell's run.

    Returns:
        The result; None if there is none yet.

    Raises:
        StorageError: If the file is not what it must be.
    """
    path = run / _FILE
    if not path.is_file():
        return None
    try:
        value = _with_infinities(json.loads(path.read_text(encoding="utf-8")))
        result = _decoded(decode(_Stored, value, f"`{path}`"))
    except (OSError, ValueError, RecursionError) as error:
        raise StorageError(f"`{path}` is damaged: {error} Remove it, and its cell is scored again.") from None
    if result.cell.name != run.name:
        name = result.cell.name
        raise StorageError(f"`{path}` must be the result of the cell `{run.name}`; got that of `{name}`. Remove it.")
    return result


def read_results(folder: Path) -> tuple[CellResult, ...]:
    """Read the results of all cells, those of earlier runs as well.

    Args:
        folder: Folder of all results.

    Returns:
        The results, by the names of their cells.

    Raises:
        StorageError: If one of the files is not what it must be.
    """
    found = (read_result(path.parent) for path in sorted((folder / "cells").glob(f"*/{_FILE}")))
    return tuple(result for result in found if result is not None)


def _with_infinities(value: object) -> object:
    """What was read, its errors that were not finite being infinite again."""
    if not isinstance(value, Mapping):
        return value
    infinite = {
        key: {name: math.inf if number is None else number for name, number in value[key].items()}
        for key in _SPREADS
        if isinstance(value.get(key), Mapping)
    }
    return {**value, **infinite}


def _decoded(stored: _Stored) -> CellResult:
    """The result."""

    def spread(error: _Spread | None) -> MeanStd | None:
        return None if error is None else MeanStd(error.mean, error.std)

    cell = Cell(
        task=find_task(stored.task).name,
        model=stored.model,
        preset=stored.preset,
        seed=stored.seed,
        space=stored.space,
        trajectories=stored.trajectories,
        noise=stored.noise,
    )
    return CellResult(
        cell=cell,
        parameters=stored.parameters,
        train=spread(stored.train_error),
        test=spread(stored.test_error),
        prediction=spread(stored.prediction_error),
        seconds=stored.seconds,
        blocks=stored.blocks,
        error=stored.error,
    )

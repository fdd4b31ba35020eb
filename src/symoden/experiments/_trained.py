"""The models of finished cells, side by side: those that were trained on the same data."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from symoden.integrate import AbstractSolver
from symoden.mechanics import AbstractDynamics

from ._cells import CellResult, data_name
from ._results import cell_folder
from ._runs import evaluation_solver, read_model, read_run, read_run_source
from ._sources import Source
from ._table import PAPER_ORDER
from ._tasks import TASKS, Task, own_trajectories


class Trained(NamedTuple):
    """A trained model and what advances its rollouts.

    Attributes:
        model: The model.
        solver: Solver of its rollouts.
    """

    model: AbstractDynamics
    solver: AbstractSolver


@dataclass(frozen=True, kw_only=True, eq=False)
class Contest:
    """Models of several kinds that were trained on the same data.

    Attributes:
        task: The task.
        source: Its data, in the space that the models were told.
        space: That space, where it is not the task's own.
        preset: Name of the settings.
        trained: The models by kind, in the paper's order.
    """

    task: Task
    source: Source
    space: str | None
    preset: str
    trained: Mapping[str, Trained]

    @property
    def name(self) -> str:
        """The task, then the space if it is not the task's own."""
        return data_name(self.task.name, self.space)


def read_contests(folder: Path, results: Sequence[CellResult]) -> tuple[Contest, ...]:
    """Load the models of finished cells that had all of a task's training trajectories, free of noise.

    Args:
        folder: The folder that the cells were run in.
        results: Results of cells; those that failed are left out.

    Returns:
        For each task, space and preset the models of the seed that has most of them, the smallest such seed; in the
        order of `TASKS`.

    Raises:
        StorageError: If a cell's folder holds no model, or a damaged one.
    """
    groups: dict[tuple[str, str | None, str], dict[int, dict[str, CellResult]]] = {}
    # Those with the task's own number of trajectories said outright come first, so that the others replace them.
    for result in sorted(results, key=lambda result: result.cell.trajectories is None):
        cell = result.cell
        if result.error is None and cell.trajectories in {None, own_trajectories(cell.task)} and not cell.noise:
            seeds = groups.setdefault((cell.task, cell.space, cell.preset), defaultdict(dict))
            seeds[cell.seed][cell.model] = result
    order = sorted(groups, key=lambda key: (list(TASKS).index(key[0]), key[1] or "", key[2]))
    chosen = (max(groups[key].items(), key=lambda item: (len(item[1]), -item[0])) for key in order)
    return tuple(_contest(folder, cells) for _, cells in chosen)


def _contest(folder: Path, results: Mapping[str, CellResult]) -> Contest:
    """Load the models of cells that differ in nothing else."""
    runs = {kind: cell_folder(folder, results[kind].cell) for kind in PAPER_ORDER if kind in results}
    configs = {kind: read_run(run) for kind, run in runs.items()}
    config = next(iter(configs.values()))
    source = read_run_source(config)
    if source.task is None:
        raise ValueError(f"A cell must be one of a task; `{config.source}` is none.")
    trained = {kind: Trained(read_model(run), evaluation_solver(configs[kind])) for kind, run in runs.items()}
    return Contest(task=source.task, source=source, space=config.space, preset=config.preset, trained=trained)

"""Cells of the paper's evaluation: one training and its scores for each task, model, preset and seed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

from symoden.models import KINDS, Kind
from symoden.spaces import Space

from ._block_errors import BlockErrors
from ._paper import MeanStd
from ._presets import PRESETS
from ._tasks import TASKS, own_trajectories, task as find_task
from ._variants import refuse_variant

_FIRST = "dissipative"


def data_name(task: str, space: str | None) -> str:
    """Name of a task's data, fit for files: the task, then the space if it is not the task's own.

    Args:
        task: Name of the task.
        space: Configuration space instead of the task's own, if any.

    Returns:
        The name.
    """
    return task if space is None else f"{task}-{space.replace(' ', '')}"


@dataclass(frozen=True, kw_only=True)
class Cell:
    """What is trained once.

    Attributes:
        task: Name of the task.
        model: Kind of model.
        preset: Name of the settings.
        seed: Seed of the initial conditions, the initial weights and the batches.
        space: Configuration space instead of the task's own, if any.
        trajectories: Number of training trajectories; the task's if None.
        noise: Standard deviation of the noise on the training recordings.
    """

    task: str
    model: Kind
    preset: str
    seed: int
    space: str | None = None
    trajectories: int | None = None
    noise: float = 0.0

    @property
    def name(self) -> str:
        """Name of the cell's folder; no two cells share one.

        Example:
            >>> Cell(task="cartpole", model="naive", preset="default", seed=2, trajectories=64, noise=0.05).name
            'cartpole-naive-default-2-n64-s0.05'
        """
        count = "" if self.trajectories is None else f"-n{self.trajectories}"
        noise = f"-s{self.noise}" if self.noise else ""
        return f"{data_name(self.task, self.space)}-{self.model}-{self.preset}-{self.seed}{count}{noise}"


@dataclass(frozen=True, kw_only=True)
class CellResult:
    """What came of a cell.

    Attributes:
        cell: The cell.
        parameters: Number of trained numbers; None if training failed, as are the errors.
        train: The paper's error over the training trajectories, noise included; infinite if a rollout diverged.
        test: Over the test trajectories.
        prediction: Over the longer trajectories without input.
        seconds: How long training took [s], compilation included where no earlier cell had the same programs.
        blocks: Errors of M⁻¹, V, g and D; None for a model that has none.
        error: Why training failed; None if it did not.
    """

    cell: Cell
    parameters: int | None = None
    train: MeanStd | None = None
    test: MeanStd | None = None
    prediction: MeanStd | None = None
    seconds: float | None = None
    blocks: BlockErrors | None = None
    error: str | None = None


def cells(
    tasks: Sequence[str],
    models: Sequence[str],
    presets: Sequence[str],
    seeds: int,
    *,
    trajectories: Sequence[int] = (),
    noise: Sequence[float] = (),
) -> tuple[Cell, ...]:
    """Every combination, what matters most first, so that a run that is interrupted has it.

    First the dissipative model, of every task, for each seed in turn; then the others. Presets come one after the
    other, and so do numbers of trajectories and noises. The geometric model needs velocities, and is left out where
    momenta are observed, as in the paper.

    Args:
        tasks: TASK, or TASK:SPACE for another space than the task's own.
        models: Kinds of model.
        presets: Names of settings.
        seeds: Number of seeds: 0, 1, and so on.
        trajectories: Numbers of training trajectories; the task's own if there is none.
        noise: Standard deviations of the noise on training recordings; 0 if there is none.

    Returns:
        The cells.

    Raises:
        ValueError: If a name is unknown, a number is out of range, or no cell is left.

    Example:
        >>> from symoden.experiments import cells
        >>> [cell.name for cell in cells(["pendulum"], ["naive", "dissipative"], ["default"], 1)]
        ['pendulum-dissipative-default-0', 'pendulum-naive-default-0']
    """
    where = tuple(dict.fromkeys(_task_and_space(name) for name in tasks))
    asked = dict.fromkeys(map(_kind, models))
    kinds: list[Kind] = [kind for kind in KINDS if kind in asked]
    names = tuple(dict.fromkeys(map(_preset, presets)))
    if seeds < 1:
        raise ValueError(f"The number of seeds must be at least 1; got {seeds}.")
    counts, sigmas = tuple(trajectories) or (None,), tuple(map(float, noise)) or (0.0,)
    for count, sigma in product(counts, sigmas):
        refuse_variant(count, sigma)
    every = dict.fromkeys(
        Cell(
            task=name, space=space, model=kind, preset=chosen, seed=seed, trajectories=_fewer(count, name), noise=sigma
        )
        for count, sigma, chosen in product(counts, sigmas, names)
        for kind, seed in _models_and_seeds(kinds, seeds)
        for name, space in where
        if not (kind == "geometric" and TASKS[name].system.momenta)
    )
    if not every:
        raise ValueError("There must be at least one cell; none is left. Choose more tasks, models or presets.")
    return tuple(every)


def _models_and_seeds(kinds: Sequence[Kind], seeds: int) -> Iterator[tuple[Kind, int]]:
    """All seeds of the first model, then for each seed the others."""
    for first in (True, False):
        for seed in range(seeds):
            for kind in kinds:
                if (kind == _FIRST) == first:
                    yield kind, seed


def _task_and_space(text: str) -> tuple[str, str | None]:
    """Name of a task, and the space that replaces its own."""
    name, colon, space = text.partition(":")
    own = Space.parse(find_task(name).space)
    if not colon:
        return name, None
    told = Space.parse(space)
    if told.size != own.size:
        raise ValueError(f"`{text}`: the space must have the task's {own.size} coordinates; `{told}` has {told.size}.")
    return name, None if told == own else str(told)


def _kind(name: str) -> Kind:
    """A kind of model."""
    for kind in KINDS:
        if kind == name:
            return kind
    raise ValueError(f"A model must be one of {', '.join(KINDS)}; got {name!r}.")


def _preset(name: str) -> str:
    """A preset."""
    if name not in PRESETS:
        raise ValueError(f"A preset must be one of {', '.join(PRESETS)}; got {name!r}.")
    return name


def _fewer(count: int | None, name: str) -> int | None:
    """A number of trajectories; None if it is the task's own, so that a cell has one name."""
    return None if count == own_trajectories(name) else count

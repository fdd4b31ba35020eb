"""Sources of data: a task, simulated, or the description of a data set."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from symoden.data import Dataset, Trajectory, read_dataset

from ._tasks import TASKS, Task
from ._variants import simulate_variant


@dataclass(frozen=True, kw_only=True, eq=False)
class Source:
    """Recordings to learn from or to be scored on.

    Attributes:
        name: Name of the task, or the absolute path of the description.
        dataset: Training and test recordings.
        seed: Seed of the initial conditions of a task; unused for a description.
        task: The task; None for a data set.
        prediction: Longer trajectories without input that measure a task's prediction error.
    """

    name: str
    dataset: Dataset
    seed: int = 0
    task: Task | None = None
    prediction: tuple[Trajectory, ...] = ()

    @property
    def parts(self) -> Mapping[str, tuple[Trajectory, ...]]:
        """Recordings of every part that has any."""
        data = self.dataset
        every = {"train": data.train, "validation": data.validation, "test": data.test, "prediction": self.prediction}
        return MappingProxyType({name: recordings for name, recordings in every.items() if recordings})


def read_source(
    name: str, *, seed: int = 0, space: str | None = None, trajectories: int | None = None, noise: float = 0.0
) -> Source:
    """Simulate a task, or read the data set that a description gives.

    Args:
        name: One of `TASKS`, or the path of a description.
        seed: Seed of the initial conditions of a task.
        space: Configuration space to take instead of the source's own, for the same numbers.
        trajectories: Number of a task's training trajectories, chosen at random; all of its own if None.
        noise: Standard deviation of Gaussian noise on every coordinate and rate of a task's training trajectories.

    Returns:
        The source.

    Raises:
        ValueError: If there is neither such a task nor such a file, or the last two are given for a file or out of
            range; a `DataError` if the data are not what they must be, or the space has another number of coordinates.

    Example:
        >>> read_source("pendulum").dataset.space
        'T1'
    """
    name = absolute_name(name)
    if name not in TASKS:
        if trajectories is not None or noise:
            raise ValueError(f"A number of trajectories and noise are for tasks only; got the data set `{name}`.")
        return Source(name=name, dataset=read_dataset(Path(name), space=space), seed=seed)
    data = simulate_variant(TASKS[name], seed=seed, trajectories=trajectories, noise=noise)
    # A task's lengths may be told to be angles, so that its units are those of the space.
    dataset = data.dataset if space is None else dataclasses.replace(data.dataset, space=space, position_units=())
    return Source(name=name, dataset=dataset, seed=seed, task=TASKS[name], prediction=data.prediction)


def absolute_name(name: str) -> str:
    """Name that means the same in every folder: a task's as it is, a description's as an absolute path.

    Args:
        name: One of `TASKS`, or the path of a description.

    Returns:
        The name.

    Raises:
        ValueError: If there is neither such a task nor such a file.
    """
    if name in TASKS:
        return name
    path = Path(name).expanduser()
    if path.is_file():
        return str(path.resolve())
    if path.suffix or len(path.parts) > 1:
        found = "a folder" if path.is_dir() else "no such file"
        raise ValueError(f"`{name}`: must be the file of a data set description; there is {found}. Correct the path.")
    raise ValueError(
        f"A source must be a task ({', '.join(TASKS)}) or the file of a data set description; got {name!r}, which is "
        "neither. Correct the name or the path."
    )

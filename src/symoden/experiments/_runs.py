"""A run: the folder of one training, with its settings, its model and what else is needed to use them."""

import contextlib
import dataclasses
import json
import os
import platform
import shlex
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Final

from symoden.data import Dataset, without_spans
from symoden.data.description import read_description
from symoden.integrate import FEWEST_SUBSTEPS, RK4
from symoden.mechanics import AbstractDynamics
from symoden.models import ModelConfig, load
from symoden.storage import StorageError, exclusive, write_atomically
from symoden.training import (
    CHECKPOINTS,
    MODEL,
    FitResult,
    Progress,
    TrainingConfig,
    check_members,
    fit,
    ignore,
)

from ._data_summary import DataSummary
from ._settings import decode
from ._sources import Source, absolute_name, read_source
from ._tasks import TASKS

_PACKAGES: Final = ("symoden", "jax", "jaxlib", "equinox", "optax", "diffrax", "numpy", "scipy")
_INTERRUPTED: Final = (
    "`symoden.fit` was interrupted there and left checkpoints: it goes on with `resume=True`, this `folder` and the "
    "same data and settings."
)


def _versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on."""
    return {"python": platform.python_version()} | {name: version(name) for name in _PACKAGES}


def commit() -> str | None:
    """Find out the commit of the package's sources.

    Returns:
        It; None where they are not tracked by git.
    """
    folder = Path(__file__).parent
    with contextlib.suppress(OSError, subprocess.SubprocessError):
        git = ["git", "-C", str(folder)]
        subprocess.run([*git, "ls-files", "--error-unmatch", Path(__file__).name], capture_output=True, check=True)
        head = subprocess.run([*git, "rev-parse", "HEAD"], capture_output=True, check=True, text=True)
        return head.stdout.strip()
    return None


@dataclass(frozen=True, kw_only=True)
class TrainingSummary:
    """How training went.

    Attributes:
        outcome: How it ended, in words.
        completed: Whether every stage came to its end.
        seconds: Time spent [s].
        verdicts: For every stage that had to gain something whether it is kept, and by what, in words.
        hardly_judged: Those of them that so few windows of validation refused that these hardly tell.
    """

    outcome: str
    completed: bool
    seconds: float
    verdicts: dict[str, str]
    hardly_judged: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """Settings of a run, saved beside its model.

    Attributes:
        source: Name of the task, or the absolute path of the description.
        beside: The description's path as seen from the run's folder, so that both can be moved together; empty for a
            task, and in a run that is not written yet.
        seed: Seed of the task's initial conditions, the initial weights and the batches.
        space: Configuration space that replaces the source's own, if any.
        preset: Name of the settings that it started from.
        trajectories: Number of training trajectories of a task; all of its own if None.
        noise: Standard deviation of the noise on a task's training trajectories.
        members: Number of models that are trained like the model, for its bands.
        model: Settings of the model.
        training: Settings of training.
        data: Summary of the data.
        substeps: RK4 steps in a sampling interval that training settled on, once it has ended.
        trained: How training went, once it has ended.
        versions: Versions of Python and of the packages that matter.
        commit: Commit of the package's sources, where they are in a git repository.
    """

    source: str
    beside: str = ""
    seed: int = 0
    space: str | None = None
    preset: str = "default"
    trajectories: int | None = None
    noise: float = 0.0
    members: int = 0
    model: ModelConfig
    training: TrainingConfig
    data: DataSummary
    substeps: int = 1
    trained: TrainingSummary | None = None
    versions: dict[str, str] = field(default_factory=_versions)
    commit: str | None = field(default_factory=commit)

    def __post_init__(self) -> None:
        """Refuse members that cannot be trained.

        Raises:
            ValueError: If there are too few, or training has no Levenberg-Marquardt.
        """
        check_members(self.members, self.training)

    @property
    def settled_substeps(self) -> int:
        """RK4 steps in a sampling interval that training ended with."""
        return max(self.training.substeps, self.training.lm_substeps or 1, self.substeps)


def holds_run(folder: Path) -> bool:
    """Whether a folder holds the settings of a run.

    Args:
        folder: Any path.

    Returns:
        Whether there is a `config.json`.
    """
    return (folder / "config.json").is_file()


def write_run(folder: Path, config: RunConfig) -> None:
    """Write the settings of a run.

    Args:
        folder: Folder of the run; it is made if absent.
        config: The settings.

    Raises:
        StorageError: If they cannot be written.
    """
    beside = "" if config.source in TASKS else _seen_from(folder, Path(config.source))
    text = json.dumps(dataclasses.asdict(config) | {"beside": beside}, indent=2, allow_nan=False)
    write_atomically(folder / "config.json", f"{text}\n".encode())


def read_run(folder: Path | str) -> RunConfig:
    """Read the settings of a run.

    Args:
        folder: Folder of the run.

    Returns:
        The settings; where the description is no longer at its absolute path, but is where it was seen from the run's
        folder, with that path. Of a copy the original is read as long as it is there.

    Raises:
        StorageError: If there is no run, or its `config.json` is not what it must be.
    """
    folder = Path(folder)
    path = folder / "config.json"
    if not holds_run(folder):
        advice = "Check the path, or train."
        if (folder / MODEL).is_file():
            advice = "`symoden.fit` made it of data in memory: `read_model` loads its model."
        elif (folder / CHECKPOINTS).is_dir():
            advice = _INTERRUPTED
        raise StorageError(f"`{folder}` must be the folder of a run; it has no `config.json`. {advice}")
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise StorageError(f"`{path}` must be JSON; reading stopped at: {error}. Restore it.") from None
    config = decode(RunConfig, value, f"`{path}`")
    moved = folder / config.beside
    if config.beside and not Path(config.source).is_file() and moved.is_file():
        return dataclasses.replace(config, source=str(moved.resolve()))
    return config


def _seen_from(folder: Path, path: Path) -> str:
    """A relative path, if there is one: not so on another drive."""
    with contextlib.suppress(ValueError):
        return Path(os.path.relpath(path, folder.resolve())).as_posix()
    return ""


def read_model(folder: Path | str) -> AbstractDynamics:
    """Load the model of a run.

    Args:
        folder: Folder of the run.

    Returns:
        The model.

    Raises:
        StorageError: If there is none yet, or it is damaged.
    """
    folder = Path(folder)
    path = folder / MODEL
    if not path.is_file() and (holds_run(folder) or (folder / CHECKPOINTS).is_dir()):
        again = shlex.join(["symoden", "train", "--out", str(folder), "--resume"])
        advice = f"Its training did not end; go on with: {again}" if holds_run(folder) else _INTERRUPTED
        raise StorageError(f"`{folder}` has no `{MODEL}`. {advice}")
    return load(path)


def read_run_source(config: RunConfig, name: str | None = None) -> Source:
    """Read the data of a run, or other data for its model.

    Args:
        config: Settings of the run.
        name: Another task or description; the run's own if absent.

    Returns:
        The source, in the space that the run's model was told.

    Raises:
        ValueError: If the description that the run was trained on is gone, or the data are those of another mechanism:
            other coordinates, inputs or kind of rates.
    """
    known = config.data
    if name is None or absolute_name(name) == config.source:
        if config.source not in TASKS and not Path(config.source).is_file():
            raise ValueError(
                f"`{config.source}` must be the description that the run was trained on; there is no such file. "
                "Move it back, or write where it is now, its absolute path, as `source` into the run's config.json."
            )
        return read_source(
            config.source,
            seed=config.seed,
            space=config.space,
            trajectories=config.trajectories,
            noise=config.noise,
        )
    other = _space_of(name)
    if config.space is None and other != known.space:  # Before all files are read.
        raise ValueError(
            f"`{absolute_name(name)}` must have the space of the run, `{known.space}`; got `{other}`. "
            "Choose data of the mechanism that the model was trained on."
        )
    # A run may have been told to read its data so.
    source = read_source(name, seed=config.seed, space=None if other == known.space else known.space)
    given = source.dataset
    if (given.inputs, given.momenta) != (len(known.input_names), known.momenta):
        kinds = {True: "momenta", False: "velocities"}
        raise ValueError(
            f"`{source.name}` must have inputs and rates as the run has, {len(known.input_names)} and "
            f"{kinds[known.momenta]}; got {given.inputs} and {kinds[given.momenta]}."
        )
    return source


def _space_of(name: str) -> str:
    """Configuration space of a task, or that a description names."""
    name = absolute_name(name)
    return TASKS[name].space if name in TASKS else read_description(Path(name)).space


def undisturbed(config: RunConfig, dataset: Dataset) -> Dataset:
    """Data without what the training of a run left out of them, over which no model is to be judged.

    Args:
        config: Settings of the run.
        dataset: The run's data, or others.

    Returns:
        The run's data without these spans; others as they are.
    """
    spans = config.training.left_out
    return without_spans(dataset, spans) if spans and dataset.digest == config.data.digest else dataset


def evaluation_solver(config: RunConfig) -> RK4:
    """Solver of a run's rollouts: four RK4 steps in a sampling interval, or more where training used more.

    Args:
        config: Settings of the run.

    Returns:
        The solver.
    """
    return RK4(max(FEWEST_SUBSTEPS, config.settled_substeps))


def refuse_occupied(folder: Path) -> None:
    """Refuse to begin a run where something is already.

    Args:
        folder: Folder of the run to be.

    Raises:
        ValueError: If it is a file, or a folder that is not empty.
    """
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    if holds_run(folder):
        raise ValueError(
            f"`{folder}` must be empty or absent; there is a run already. Give --resume to go on with it or to add "
            "members to it, or choose another folder."
        )
    found = "there are other files and no `config.json`" if folder.is_dir() else "it is a file"
    raise ValueError(f"`{folder}` must be empty, absent or the folder of a run; {found}. Choose another folder.")


def train_run(
    folder: Path | str,
    config: RunConfig,
    dataset: Dataset,
    *,
    resume: bool = False,
    max_minutes: float | None = None,
    progress: Callable[[Progress], object] = ignore,
) -> FitResult:
    """Train, and keep everything in a folder.

    Args:
        folder: Folder of the run.
        config: Its settings.
        dataset: Its data.
        resume: Go on from the latest checkpoint.
        max_minutes: Stop after this time with the best model so far.
        progress: Called after every stride; by raising `StopIteration` it ends training, as `max_minutes` does.

    Returns:
        The model and how training ended; the folder then holds `config.json` and `model.safetensors`, and where members
        were asked for `ensemble.safetensors`.

    Raises:
        ValueError: If the folder is not empty and nothing is to be resumed, or nothing can be learned from the data;
            nothing is left behind then.
        StorageError: If another process is training there.
    """
    folder = Path(folder)
    fresh = not (resume and holds_run(folder))
    if fresh:
        refuse_occupied(folder)
    with exclusive(folder):
        if fresh or config != read_run(folder):
            write_run(folder, config)
        try:
            result = fit(
                dataset,
                model=config.model,
                config=config.training,
                folder=folder,
                resume=not fresh,
                members=config.members,
                max_minutes=max_minutes,
                progress=progress,
            )
        except Exception:
            if fresh and [path.name for path in folder.iterdir()] == ["config.json"]:
                (folder / "config.json").unlink()  # Nothing was begun: the folder is free for corrected data.
                folder.rmdir()
            raise
        trained = TrainingSummary(
            outcome=result.outcome,
            completed=result.completed,
            seconds=result.seconds,
            verdicts=result.verdicts,
            hardly_judged=result.hardly_judged,
        )
        write_run(
            folder, dataclasses.replace(config, training=result.config, substeps=result.substeps, trained=trained)
        )
        return result

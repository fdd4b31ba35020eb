"""What the data of a run leave open about its model."""

import contextlib
import dataclasses
import hashlib
from importlib.metadata import version
from pathlib import Path

from symoden.data import Dataset
from symoden.mechanics import AbstractDynamics
from symoden.storage import StorageError
from symoden.training import (
    ENSEMBLE,
    FEWEST_MEMBERS,
    MODEL,
    POSTERIOR,
    AbstractPosterior,
    Ensemble,
    TrainingConfig,
    infer_posterior,
    load_ensemble,
    load_laplace,
    save_laplace,
)

from ._runs import RunConfig, commit


def read_posterior(
    folder: Path | str, model: AbstractDynamics, config: RunConfig, dataset: Dataset
) -> AbstractPosterior:
    """What the data leave open about a run's model: its ensemble if it is to have one, else Laplace's approximation.

    The latter takes as long as many steps of training, so that it is kept in the run's folder where that can be
    written, and taken from there as long as model, data and settings stay the same.

    Args:
        folder: Folder of the run.
        model: Its model.
        config: Its settings.
        dataset: Its data.

    Returns:
        The posterior.

    Raises:
        ValueError: If there is no ensemble and the model has too many parameters for the other way.
        StorageError: If the ensemble is damaged, or that of another model.
    """
    folder = Path(folder)
    ensemble = read_ensemble(folder, model, config)
    if ensemble is not None:
        return ensemble
    training, substeps = config.training, config.settled_substeps
    if not (folder / MODEL).is_file():  # No run's, so that nothing would tell whose it is.
        return infer_posterior(model, dataset, training, substeps=substeps)
    kept, origin = folder / POSTERIOR, _origin(folder / MODEL, training, substeps, dataset)
    with contextlib.suppress(StorageError):  # Absent, of an earlier training, or damaged: it is inferred anew.
        return load_laplace(kept, model, origin=origin)
    posterior = infer_posterior(model, dataset, training, substeps=substeps)
    with contextlib.suppress(StorageError):  # A run that can only be read has its bands, too.
        save_laplace(kept, posterior, origin=origin)
    return posterior


def _origin(model: Path, training: TrainingConfig, substeps: int, dataset: Dataset) -> str:
    """SHA-256 of all that a posterior is inferred from, and of the version and commit that infer it."""
    told = repr((version("symoden"), commit(), training, substeps, dataset.digest))
    return hashlib.sha256(model.read_bytes() + told.encode()).hexdigest()


def read_ensemble(folder: Path | str, model: AbstractDynamics, config: RunConfig) -> Ensemble | None:
    """The models that were trained like a run's.

    Args:
        folder: Folder of the run.
        model: Its model.
        config: Its settings.

    Returns:
        The ensemble; None where the run is to have none, or has too few members to tell anything.

    Raises:
        StorageError: If it is damaged, or that of another model.
    """
    path = Path(folder) / ENSEMBLE
    if not config.members or not path.is_file():
        return None
    ensemble = load_ensemble(path, model)
    ensemble = dataclasses.replace(ensemble, members=ensemble.members[: config.members])
    return ensemble if len(ensemble.members) >= FEWEST_MEMBERS else None

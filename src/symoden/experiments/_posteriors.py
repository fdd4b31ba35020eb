"""What the data of a run leave open about its model."""

import dataclasses
from pathlib import Path

from symoden.data import Dataset
from symoden.mechanics import AbstractDynamics
from symoden.training import (
    ENSEMBLE,
    FEWEST_MEMBERS,
    AbstractPosterior,
    Ensemble,
    infer_posterior,
    load_ensemble,
)

from ._runs import RunConfig


def read_posterior(folder: Path, model: AbstractDynamics, config: RunConfig, dataset: Dataset) -> AbstractPosterior:
    """What the data leave open about a run's model: its ensemble if it is to have one, else Laplace's approximation.

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
    ensemble = read_ensemble(folder, model, config)
    if ensemble is not None:
        return ensemble
    return infer_posterior(model, dataset, dataclasses.replace(config.training, lm_substeps=config.settled_substeps))


def read_ensemble(folder: Path, model: AbstractDynamics, config: RunConfig) -> Ensemble | None:
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
    path = folder / ENSEMBLE
    if not config.members or not path.is_file():
        return None
    ensemble = load_ensemble(path, model)
    ensemble = dataclasses.replace(ensemble, members=ensemble.members[: config.members])
    return ensemble if len(ensemble.members) >= FEWEST_MEMBERS else None

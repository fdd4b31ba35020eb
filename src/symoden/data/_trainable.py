"""What training refuses of recordings that each could be read."""

from collections.abc import Sequence

import numpy as np

from ._dataset import Dataset
from ._errors import DataError
from ._trajectory import Trajectory


def check_trainable(dataset: Dataset) -> None:
    """Refuse training recordings in which nothing moves, and given parts that are no mechanism's in their states.

    Args:
        dataset: Recordings.

    Raises:
        DataError: If it is so.
    """
    if not dataset.train:
        return  # Of a description of tests alone nothing is asked here.
    estimate = "" if dataset.momenta else ", or leave `velocities` out: they are then estimated"
    for name, column, remedy in (
        ("position", "q", ""),
        ("momentum" if dataset.momenta else "velocity", "rates", estimate),
    ):
        if not any(np.ptp(getattr(each, column), axis=0).any() for each in dataset.train):
            raise DataError(
                f"`{dataset.name}`: what is to be learned must move in [train]; no {name} ever changes there. Record "
                f"motions, name other columns{remedy}."
            )
    if dataset.known is None:
        return
    from symoden.models import check_known  # And JAX with it, which reading alone does without.
    from symoden.spaces import Space

    q, v = states(dataset.train, momenta=dataset.momenta)
    try:
        check_known(dataset.known, Space.parse(dataset.space), dataset.inputs, q, v)
    except ValueError as error:
        raise DataError(f"`{dataset.name}`: {error}") from None


def states(trajectories: Sequence[Trajectory], *, momenta: bool) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and velocities of all samples; velocities in momentum data are differences of the coordinates.

    Args:
        trajectories: Recordings.
        momenta: Whether the rates are momenta.

    Returns:
        Coordinates (K, n) and velocities (K, n).
    """
    q = np.concatenate([trajectory.q for trajectory in trajectories])
    if momenta:
        return q, np.concatenate([np.gradient(trajectory.q, trajectory.ts, axis=0) for trajectory in trajectories])
    return q, np.concatenate([trajectory.rates for trajectory in trajectories])

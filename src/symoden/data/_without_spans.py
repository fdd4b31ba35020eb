"""Recordings without spans of them, as if nothing had been recorded there."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from symoden.wording import first_few

from ._dataset import Dataset
from ._errors import DataError
from ._split import whole_name
from ._trajectory import Trajectory
from .logs import LEAST_SAMPLES

_SHOWN = 6


def without_spans(dataset: Dataset, spans: Sequence[tuple[str, float, float]]) -> Dataset:
    """Leave spans of recordings in `train` and `validation` out, and split the recordings there.

    Args:
        dataset: Data set, before or after validation recordings are split off.
        spans: Of each span the recording's name, and its begin and end in the recording's own time [s], both left out.

    Returns:
        The data set; a recording is in pieces `name#1`, `name#2`, … then, those of fewer than 25 samples left out.

    Raises:
        DataError: If no recording has such a name, or nothing is left to train on.
    """
    if not spans:
        return dataset
    spans = [(whole_name(name), start, end) for name, start, end in spans]
    names = list(dict.fromkeys(whole_name(each.name) for each in (*dataset.train, *dataset.validation)))
    if unknown := [name for name, _, _ in spans if name not in names]:
        raise DataError(
            f"`{dataset.name}`: spans to leave out must be of recordings in `train` or `validation`; got "
            f"`{unknown[0]}`. There are {first_few([f'`{name}`' for name in names], _SHOWN)}."
        )
    train, validation = (
        tuple(piece for each in part for piece in _pieces(each, spans)) for part in (dataset.train, dataset.validation)
    )
    if not train:
        raise DataError(
            f"`{dataset.name}`: something must be left to train on; spans are left out of all recordings, and no piece "
            f"of {LEAST_SAMPLES} samples remains. Leave less out."
        )
    return dataclasses.replace(dataset, train=train, validation=validation)


def _pieces(recording: Trajectory, spans: Sequence[tuple[str, float, float]]) -> list[Trajectory]:
    """What is left of a recording."""
    ts = recording.ts
    inside = [(ts >= start) & (ts <= end) for name, start, end in spans if name == whole_name(recording.name)]
    if not np.any(inside):
        return [recording]
    rows = np.flatnonzero(~np.any(inside, axis=0))
    pieces = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
    least = max(LEAST_SAMPLES, recording.initial_samples + 1)
    long = [piece for piece in pieces if len(piece) >= least]
    return [
        recording.cut(int(piece[0]), int(piece[-1]) + 1, name=f"{recording.name}#{k}")
        for k, piece in enumerate(long, start=1)
    ]

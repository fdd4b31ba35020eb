"""What may be wrong with one file's columns, and how it is mended."""

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool

from symoden.data._dataset import Dataset
from symoden.data._findings import Kind
from symoden.data._trajectory import Trajectory, median_step

_LENGTHS: Final = (1e3, 1e-3, 1e2, 1e-2, 1e1, 1e-1, 25.4, 1 / 25.4)  # Millimetres, centimetres, inches beside these.
_INPUTS: Final = (1e3, 1e-3, 1e2, 1e-2, 1e1, 1e-1)  # Milliamperes, newton millimetres, newton centimetres.
_DEGREES: Final = 180 / np.pi
_FINEST, _LONGEST = 0.01, 0.1  # [s] between delays that are tried, if not a step; the longest one.


class Change(NamedTuple):
    """What may be wrong with a file, and how it is mended.

    Attributes:
        kind: What it is about.
        column: Column that it is about, the first of several.
        words: What has to be done with the file's columns.
        mend: A recording from what was recorded.
        delay: How late its inputs act then [s].
    """

    kind: Kind
    column: str
    words: str
    mend: Callable[[Trajectory], Trajectory]
    delay: float = 0.0


def changes_of(dataset: Dataset, is_angle: Bool[np.ndarray, " n"]) -> list[Change]:
    """Lay out what a file may be mended by: signs, units, the order of columns and delays.

    Args:
        dataset: Recordings as training sees them.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One change after another; any one of them alone.
    """
    return [*_factors(dataset, is_angle), *_orders(dataset, is_angle), *_delays(dataset)]


class _Columns(NamedTuple):
    """Columns of one meaning.

    Attributes:
        names: Their names.
        fields: What a recording has of them.
    """

    names: tuple[str, ...]
    fields: tuple[str, ...]

    def changed(self, kind: Kind, first: int, words: str, change: Callable[[np.ndarray], np.ndarray]) -> Change:
        """The same change of all that a recording has of them."""
        return Change(
            kind,
            self.names[first],
            words,
            lambda each: dataclasses.replace(each, **{field: change(getattr(each, field)) for field in self.fields}),
        )


def _columns(dataset: Dataset) -> tuple[_Columns, _Columns]:
    """Positions with their velocities, and inputs."""
    return _Columns(dataset.position_names, ("q", "rates")), _Columns(dataset.input_names, ("us",))


def _factors(dataset: Dataset, is_angle: Bool[np.ndarray, " n"]) -> Iterator[Change]:
    """Signs and units of columns."""

    def times(factor: float, kind: Kind, columns: _Columns, which: Sequence[int], words: str) -> Change:
        by = np.where(np.isin(np.arange(len(columns.names)), which), factor, 1.0)
        return columns.changed(kind, which[0], words, lambda signal: signal * by)

    positions, inputs = _columns(dataset)
    for columns, each, every, units in (
        (positions, "`{}` and its velocity", "all positions and velocities", ()),
        (inputs, "`{}`", "all inputs", _INPUTS),
    ):
        which = [([i], each.format(name), "is") for i, name in enumerate(columns.names)]
        if len(columns.names) > 1:
            which.append((list(range(len(columns.names))), every, "are"))
        for some, words, verb in which:
            yield times(-1.0, "sign", columns, some, f"the sign of {words} is turned")
            for factor in units:
                yield times(factor, "unit", columns, some, f"{words} {verb} taken times {factor:g}")
    for some, words in _alike(dataset.position_names, ~is_angle, "lengths"):
        for factor in _LENGTHS:
            yield times(factor, "unit", positions, some, f"{words} are taken times {factor:g}")
    for some, words in _alike(dataset.position_names, is_angle, "angles"):
        yield times(1 / _DEGREES, "unit", positions, some, f"{words} are taken to be in degrees")
        yield times(_DEGREES, "unit", positions, some, f"{words} are taken to be in radians")


def _alike(names: Sequence[str], which: Bool[np.ndarray, " n"], word: str) -> Iterator[tuple[list[int], str]]:
    """Positions of a kind, all and each, with words for them."""
    every = np.flatnonzero(which).tolist()
    if len(every) > 1:
        yield every, f"{word} and their velocities"
    for i in every:
        yield [i], f"`{names[i]}` and its velocity"


def _orders(dataset: Dataset, is_angle: Bool[np.ndarray, " n"]) -> Iterator[Change]:
    """Two columns of a kind that are exchanged."""
    for columns, kinds in zip(_columns(dataset), (is_angle, np.zeros(dataset.inputs, bool)), strict=True):
        for i, j in combinations(range(len(columns.names)), 2):
            if kinds[i] == kinds[j]:
                order = np.arange(len(columns.names))
                order[[i, j]] = j, i
                words = f"`{columns.names[i]}` and `{columns.names[j]}` are exchanged"
                yield columns.changed("order", i, words, lambda signal, order=order: signal[:, order])


def _delays(dataset: Dataset) -> Iterator[Change]:
    """Inputs that act later or sooner than they were logged."""
    step = median_step(dataset.recordings)
    for delay in np.arange(max(step, _FINEST), _LONGEST * (1 + 1e-3), max(step, _FINEST)).tolist():
        for late, when in ((delay, "later"), (-delay, "sooner")):
            words = f"inputs act {delay:.3g} s {when} than they were logged"
            yield Change("delay", dataset.input_names[0], words, lambda each: each, late)

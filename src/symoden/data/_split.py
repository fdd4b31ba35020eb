"""Splitting recordings: into segments, and into what is learned from and what is chosen by."""

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from symoden.wording import first_few

from ._dataset import Dataset
from ._errors import DataError
from ._trajectory import Trajectory, pieces_of

VALIDATION_SHARE: Final = 0.1
"""Share of the recordings that is held out, unless it is told otherwise."""
_SHOWN = 10
_TAIL = "#tail"  # Of a recording's name, that its end has.
_REST = "#rest"  # What follows that, where hardly anything moves.
_HARDLY = 0.3  # Of a recording's root mean square speed: what moves by less tells little of what moves more.
_OF_MOTION = 4  # One part in so many of what moves is held out at most, where a recording ends at rest.
_MANY = 10  # From so many groups on, whole groups are held out rather than the ends of recordings.


def segments(trajectory: Trajectory, seconds: float) -> tuple[Trajectory, ...]:
    """Split a recording into consecutive segments of equal duration, without losing a sample.

    The number of segments is the duration over `seconds`, rounded; the last one takes what remains.

    Args:
        trajectory: The recording.
        seconds: Duration of a segment [s].

    Returns:
        The segments, named `name#1`, `name#2`, …; the recording itself if there is only one.

    Raises:
        DataError: If the segments are too short to be recordings.
    """
    elapsed = trajectory.ts - trajectory.ts[0]
    step = float(np.median(np.diff(trajectory.ts)))
    count = max(1, round((trajectory.duration + step) / seconds))
    if count == 1:
        return (trajectory,)
    if count * (trajectory.initial_samples + 1) > len(trajectory):
        raise DataError(
            f"`{trajectory.name}`: `split_every` must leave at least {trajectory.initial_samples + 1} samples in every "
            f"segment; got {seconds} s for samples {step:.6g} s apart. Split into longer segments."
        )
    inner = np.searchsorted(elapsed, seconds * np.arange(1, count) - step / 2)
    edges = [0, *(int(edge) for edge in inner), len(trajectory)]
    return tuple(
        trajectory.cut(start, stop, name=f"{trajectory.name}#{k}")
        for k, (start, stop) in enumerate(itertools.pairwise(edges), start=1)
    )


def split_validation(dataset: Dataset, fraction: float = VALIDATION_SHARE, *, min_samples: int = 2) -> Dataset:
    """Hold recordings out of `train` for validation, the same ones every time.

    Where there are many, whole trajectories are held out, evenly spread over the data set; those with the same first
    state (one initial condition under several inputs) stay together, since they resemble each other. Of fewer than 10
    such groups each recording gives its end, unless all are too short for that. Where most ends are at
    rest or nearly so, as after steps or where a swing dies out, such a recording gives the end of what moves.

    Args:
        dataset: Data set; one that has validation recordings is returned as it is.
        fraction: Share of the data to hold out.
        min_samples: Least length of a part cut off a recording, for example a window's; recordings too short for it
            stay whole.

    Returns:
        The data set with `train` and `validation` disjoint.

    Raises:
        ValueError: If `fraction` is not between 0 and 1.
        DataError: If there is nothing to hold out.
    """
    if not 0 < fraction < 1:
        raise ValueError(f"`fraction` must be between 0 and 1; got {fraction}.")
    if dataset.validation:
        return dataset
    groups: dict[tuple[bytes, bytes], list[Trajectory]] = {}
    for trajectory in dataset.train:
        groups.setdefault((trajectory.q[0].tobytes(), trajectory.rates[0].tobytes()), []).append(trajectory)
    tails = _without_tails(dataset.train, fraction, min_samples)
    if len(groups) >= _MANY or (len(groups) > 1 and not any(held for _, held in tails)):
        count = max(1, round(fraction * len(groups)))
        held = {int((k + 0.5) * len(groups) / count) for k in range(count)}
        parts = [([], group) if k in held else (group, []) for k, group in enumerate(groups.values())]
    else:
        parts = tails
    train = tuple(trajectory for kept, _ in parts for trajectory in kept)
    validation = tuple(trajectory for _, held in parts for trajectory in held)
    if not train or not validation:
        raise DataError(
            f"`{dataset.name}`: validation needs recordings in `train` that are long enough to hold out {fraction:.0%} "
            f"of them: {_needed(dataset.train, fraction, min_samples)} samples or more; or many, from different first "
            f"states; got {_lengths(dataset.train)}. Give longer ones or more of them, or `[validation]` files."
        )
    return dataclasses.replace(dataset, train=train, validation=validation)


def halves(trajectories: Sequence[Trajectory]) -> tuple[tuple[Trajectory, ...], tuple[Trajectory, ...]]:
    """Share recordings out, about as many samples to either side, and all pieces of one to the same.

    Args:
        trajectories: Recordings; those whose names differ in what follows `#` alone are pieces of one.

    Returns:
        Those of either side, in the order of before; a single one leaves a side empty.
    """
    whole = pieces_of(trajectories)
    samples = {name: sum(len(trajectories[k]) for k in pieces) for name, pieces in whole.items()}
    sides, held, last = ([], []), [0, 0], 0
    for name in sorted(samples, key=lambda name: -samples[name]):
        # Of the same size, those that take turns in an experiment are not all on one side.
        last = last if held[0] == held[1] else int(held[1] < held[0])
        sides[last].extend(whole[name])
        held[last] += samples[name]
    first, second = (tuple(trajectories[k] for k in sorted(side)) for side in sides)
    return first, second


def validates_by_ends(dataset: Dataset) -> bool:
    """Whether validation recordings are the ends of those in `train`, as `split_validation` makes them of few.

    What is peculiar to a recording, such as an encoder that was switched on elsewhere, is then the same in both.

    Args:
        dataset: Data set with its validation part.

    Returns:
        Whether they are.
    """
    return any(_TAIL in trajectory.name for trajectory in dataset.validation)


def whole_name(name: str) -> str:
    """Name of the recording that a part is of, of which `split_validation` has held one out.

    Args:
        name: Name of a recording or of such a part.

    Returns:
        The recording's name.
    """
    return name.removesuffix(_TAIL).removesuffix(_REST)


def _needed(trajectories: Sequence[Trajectory], fraction: float, min_samples: int) -> int:
    """Samples of a recording of which a share can be held out."""
    least = max([min_samples, *(trajectory.initial_samples + 1 for trajectory in trajectories)])
    return math.ceil(least / min(fraction, 1 - fraction))


def _lengths(trajectories: Sequence[Trajectory]) -> str:
    """How many recordings there are, and their lengths."""
    lengths = [str(len(trajectory)) for trajectory in trajectories]
    of = f" of {first_few(lengths, _SHOWN)} samples" if lengths else ""
    return f"{len(lengths)} recording{'' if len(lengths) == 1 else 's'}{of}"


def _without_tails(
    trajectories: Sequence[Trajectory], fraction: float, min_samples: int
) -> list[tuple[list[Trajectory], list[Trajectory]]]:
    """Split the end off every recording, unless a part would be too short.

    Any model that rests where the mechanism does predicts an end at rest, as recordings of steps have it, and where a
    swing has died out friction hardly tells. Where most ends are such, these recordings give the end of what moves;
    else they keep all their motion to learn from.

    Returns:
        For each what is left of it, and what is held out.
    """
    held = [_held(trajectory, fraction, min_samples) for trajectory in trajectories]
    moving = [_moves_until(trajectory, count) for trajectory, count in zip(trajectories, held, strict=True)]
    every = list(zip(trajectories, held, moving, strict=True))
    resting = sum(count for trajectory, count, end in every if end <= len(trajectory) - count)
    at_rest = 2 * resting >= sum(held)
    return [
        _cut_off(
            trajectory, count, max(min_samples, trajectory.initial_samples + 1), end if at_rest else len(trajectory)
        )
        for trajectory, count, end in every
    ]


def _held(trajectory: Trajectory, fraction: float, min_samples: int) -> int:
    """Number of samples of a recording's end that are held out."""
    count = round(fraction * len(trajectory))
    long = min(count, len(trajectory) - count) >= max(min_samples, trajectory.initial_samples + 1)
    return count if long else 0


def _cut_off(trajectory: Trajectory, count: int, least: int, end: int) -> tuple[list[Trajectory], list[Trajectory]]:
    """Split so many samples off: the last ones, or those about the end of the motion where it comes before these.

    Returns:
        What is left, and what is held out.
    """
    if not count:
        return [trajectory], []
    start, rest = len(trajectory) - count, []
    if end <= start and end >= 2 * least:
        # As many samples as else, since windows are as long as these allow: the last ones that move, and rest.
        start = end - max(least, min(count, end // _OF_MOTION))
    stop = start + count if len(trajectory) - (start + count) >= least else len(trajectory)
    if stop < len(trajectory):
        rest = [trajectory.cut(stop, len(trajectory), name=trajectory.name + _REST)]
    head = trajectory.cut(0, start, name=trajectory.name)
    return [head, *rest], [trajectory.cut(start, stop, name=trajectory.name + _TAIL)]


def _moves_until(trajectory: Trajectory, count: int) -> int:
    """Number of samples before all is at rest for good or hardly moves, to a quarter of `count` samples."""
    usual = np.sqrt(np.mean(trajectory.rates**2, axis=0))
    block = max(1, count // 4)
    ends = np.arange(len(trajectory), block - 1, -block)
    energy = np.concatenate([np.zeros((1, len(usual))), np.cumsum(trajectory.rates**2, axis=0)])
    speeds = np.sqrt(np.maximum(energy[ends] - energy[ends - block], 0.0) / block)
    return int(ends[np.argmax((speeds > _HARDLY * usual).any(axis=1))])

"""How fast recordings are sampled, against how fast they move."""

import math
from typing import Final

import numpy as np

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data._trajectory import median_step
from symoden.data.signals import time_scales

_MANY: Final = 60  # samples in a time scale, of which the needed ones are enough
_NEEDED: Final = 25
_LARGE: Final = 20_000  # rows from which on training takes long
_IDLE: Final = 0.01  # of the liveliest rate: below it are trembling and noise
_FEWEST: Final = 2.0  # samples in a time scale: of a sine, twelve in a period
_FINER: Final = 0.6  # Of the logs' step: of uneven ones many are as short.
_ROUNDED: Final = 0.99  # What rows are apart that are as far apart as `resample` brings them.
_CHANGE, _OFTEN = 0.25, 0.3  # of the rates' deviation, from row to row; share of the rows


def find_fast_sampling(dataset: Dataset, is_angle: np.ndarray) -> list[Finding]:
    """Say that recordings have many more samples than their motion needs.

    Args:
        dataset: Recordings as training sees them.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding, or none.
    """
    rows = sum(map(len, dataset.train))
    if rows <= _LARGE:
        return []
    step, time = _step_and_time(dataset, is_angle)
    longest = max(recording.duration for recording in dataset.train)
    if not _MANY * step <= time < longest:  # A longer one was not seen: the machine rests, or drifts.
        return []
    longer = _round(time / _NEEDED)
    times = f"{longer / step:.2g}"
    return [
        Finding(
            kind="time",
            level="note",
            channel="",
            text=f"the {rows} rows of [train] are sampled about {times} times as fast as the motion needs, whose rates "
            f"change by about their own size in {time:.2g} s",
            advice=f"`resample = {longer:g}` averages over as many samples, and training is then about {times} times "
            "as fast.",
        )
    ]


def find_slow_sampling(
    dataset: Dataset, is_angle: np.ndarray, *, resample: float | None = None, logged: float = 0.0
) -> list[Finding]:
    """Say that the motion is too fast for the rows, of which velocities are estimated.

    Of velocities that were measured a chatter at rest looks the same, and few rows do less harm.

    Args:
        dataset: Recordings as training sees them.
        is_angle: Whether each coordinate is an angle.
        resample: Step that recordings were brought to [s].
        logged: The usual time between the rows of logs [s].

    Returns:
        One finding, or none.
    """
    if not dataset.train or dataset.train[0].noise_gain is None:
        return []
    step, time = _step_and_time(dataset, is_angle)
    if time >= _FEWEST * step or not _is_always_fast(dataset):
        return []
    sparser = resample is not None and logged < _ROUNDED * resample
    text = (
        f"the motion is fast for the rows of [train]: rates change by about their own size in {time:.2g} s, and rows "
        f"are {step:.2g} s apart{' by `resample`' if sparser else ''}"
    )
    first = f"Take a smaller `resample`: those of the logs are {logged:.2g} s apart" if sparser else "Log faster"
    advice = (
        f"{first}, or move slower: a sine wants twelve rows a period, and from fewer its velocities are estimated "
        "too small. If there are measured ones, name them as `velocities`."
    )
    return [Finding(kind="time", level="warning", channel="", text=text, advice=advice)]


def find_finer_sampling(*, resample: float | None, logged: float) -> list[Finding]:
    """Say that recordings are brought to more rows than there are in the logs.

    Args:
        resample: Step that recordings were brought to [s].
        logged: The usual time between the rows of logs [s].

    Returns:
        One finding, or none.
    """
    if resample is None or resample >= _FINER * logged:
        return []
    return [
        Finding(
            kind="time",
            level="warning",
            channel="",
            text=f"`resample = {resample:g}` makes {logged / resample:.2g} rows of each one of the logs, which are "
            f"{logged:.2g} s apart",
            advice="What is put between them are straight lines, whose kinks training takes for motion: leave "
            "`resample` out, or take as long a step as theirs.",
        )
    ]


def _step_and_time(dataset: Dataset, is_angle: np.ndarray) -> tuple[float, float]:
    """The usual time between rows [s], and the one in which the fastest rates change by about their own size [s]."""
    step = median_step(dataset.train)
    return step, float(np.min(time_scales(dataset.train, is_angle, idle=_IDLE)))


def _is_always_fast(dataset: Dataset) -> bool:
    """Whether rates of a coordinate change much from row to row, rather than at a few leaps."""
    sizes = np.std(np.concatenate([recording.rates for recording in dataset.train]), axis=0)
    changes = np.concatenate([np.abs(np.diff(recording.rates, axis=0)) for recording in dataset.train])
    return bool(np.any(np.mean(changes > _CHANGE * sizes, axis=0) > _OFTEN))


def _round(step: float) -> float:
    """The largest of 1, 2, 3 and 5 times a power of 10 that is not above a step."""
    power = 10.0 ** math.floor(math.log10(step))
    return max(digit * power for digit in (1, 2, 3, 5) if digit * power <= step)

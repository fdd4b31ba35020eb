"""Short windows of recordings, over which predictions are scored."""

from typing import Final

import numpy as np
from jaxtyping import Float

from symoden.data import Dataset, Trajectory, first_samples

HORIZON: Final = 1.0
"""Length of a window, if recordings are as long [s]."""
OVERLAP: Final = 4
"""Windows that start within the length of one."""

_SHORTER: Final = (0.5, 0.2, 0.1)  # Times a power of ten.
_LONGER: Final = (1.0, 2.0, 5.0, 10.0)
_FEWEST_STEPS: Final = 10  # In a window shorter than a second.
_INSTANT: Final = 1e-6  # [s]; stamps that count from 1970 are rounded to 2.4e-7 s.
_OF_STEP: Final = 0.1  # Of a step, no more than which is an instant.


def horizon_of(dataset: Dataset) -> float:
    """Find how long the windows are over which predictions are scored.

    Args:
        dataset: Recordings.

    Returns:
        1 s; where samples are so rare that a quarter of it has no step, the shortest of 2, 5, 10, 20, … s of which a
        quarter has one; where all recordings of one of its parts are shorter than 1 s, the longest of 0.5, 0.2, 0.1,
        0.05, … s that fits into half of those of each, apart from what is shorter than ten samples anywhere.
    """
    parts = [part for part in (dataset.train, dataset.validation, dataset.test) if part]
    steps = [float(np.median(np.diff(each.ts))) for part in parts for each in part]
    if steps and OVERLAP * max(steps) > HORIZON + _INSTANT:
        least = OVERLAP * max(steps) - _INSTANT
        power = 10.0 ** np.floor(np.log10(least))
        return float(next(share * power for share in _LONGER if share * power >= least))
    lengths = [np.array([float(_elapsed(each)[-1]) for each in part]) for part in parts]
    if all(part.max() + _INSTANT >= HORIZON for part in lengths):
        return HORIZON
    long = [part[part + _INSTANT >= _FEWEST_STEPS * max(steps)] for part in lengths]
    usual = min((float(np.median(part)) for part in long if len(part)), default=HORIZON) + _INSTANT
    if usual >= HORIZON:
        return HORIZON
    power = 10.0 ** np.floor(np.log10(usual) + 1)
    return float(next(share * power for share in _SHORTER if share * power <= usual))


def short_windows(recording: Trajectory, horizon: float = HORIZON) -> list[tuple[int, int]]:
    """Find the windows of a length, started every quarter of it after the `first_samples`.

    Args:
        recording: Any recording.
        horizon: The length [s].

    Returns:
        Samples [start, stop) of each; none where the recording is too short.
    """
    elapsed, instant = _elapsed(recording), instant_of(recording)
    starts = np.arange(0.0, elapsed[-1] - horizon + instant, horizon / OVERLAP)
    firsts = np.unique(np.searchsorted(elapsed, starts - instant))
    stops = np.searchsorted(elapsed, elapsed[firsts] + horizon + instant)
    # Where time stamps are irregular, the window after the last start may end after the recording.
    complete = elapsed[firsts] + horizon <= elapsed[-1] + instant
    return [(int(a), int(b)) for a, b in zip(firsts[complete], stops[complete], strict=True) if b - a > 1]


def instant_of(recording: Trajectory) -> float:
    """Time that does not count, since stamps are rounded.

    Args:
        recording: Any recording.

    Returns:
        A microsecond, or less beside steps that are as short [s].
    """
    return min(_INSTANT, _OF_STEP * float(np.median(np.diff(recording.ts))))


def _elapsed(recording: Trajectory) -> Float[np.ndarray, " T"]:
    """Time since the last of the initial samples [s]."""
    return recording.ts - recording.ts[first_samples(recording) - 1]

"""How long the windows are that training cuts, and which recordings they leave out."""

import dataclasses
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool

from ._dataset import Dataset
from ._trajectory import Trajectory
from .signals import time_scales

_MOST: Final = 0.9  # Share of the samples that recordings must hold, so that shorter ones do not matter.
_MOST_LEFT_OUT: Final = 0.05  # Share of a recording that its ends may be.


class WindowLength(NamedTuple):
    """How long windows are.

    Attributes:
        share: Their length relative to the time scale of the motion.
        least: Their steps at least.
    """

    share: float
    least: int


ADAM_WINDOWS: Final = WindowLength(0.3, 3)
"""Windows that training begins with."""
LEVENBERG_WINDOWS: Final = WindowLength(2.0, 6)
"""Windows that it goes on with."""


def window_steps(dataset: Dataset, length: WindowLength, is_angle: Sequence[bool] | Bool[np.ndarray, " n"]) -> int:
    """Steps of windows; two windows or more fill a recording, but for a few short ones.

    Args:
        dataset: Recordings, with their validation part.
        length: How long they are to be.
        is_angle: Which coordinates are angles.

    Returns:
        Number of steps.

    Example:
        >>> ts = 0.01 * np.arange(1000)
        >>> q, v = np.sin(3 * ts)[:, None], 3 * np.cos(3 * ts)[:, None]
        >>> swing = Trajectory(name="swing", ts=ts, q=q, rates=v, us=q[:, :0])
        >>> window_steps(Dataset(name="swings", space="R1", train=(swing,)), ADAM_WINDOWS, [False])
        9
    """
    recordings = dataset.train + dataset.validation
    step = float(np.mean(np.concatenate([np.diff(recording.ts) for recording in recordings])))
    scale = float(np.median(time_scales(dataset.train, is_angle)))
    wanted = max(length.least, round(length.share * scale / step))
    parts = [part for part in (dataset.train, dataset.validation) if part]
    longest = min(usual_steps(part, 2 * wanted) for part in parts)
    most = longest // length.least  # Windows that are long enough.
    return max(1, longest // max(1, min(most, max(2, round(longest / wanted)))))


def usual_steps(recordings: Sequence[Trajectory], enough: int) -> int:
    """Steps of the shortest recording, but for short ones that hold few of the samples: these are left out.

    Args:
        recordings: Recordings.
        enough: Steps that are not short.

    Returns:
        Number of steps.
    """
    steps = np.sort([len(recording) - 1 for recording in recordings])
    held = np.cumsum(steps[::-1])[::-1] >= _MOST * steps.sum()  # By recordings that are as long, or longer.
    return int(steps[steps >= min(enough, steps[held].max())].min())


def without_poor_ends(recording: Trajectory) -> Trajectory:
    """A long recording without the ends where the fits that estimate its rates see one side alone.

    Args:
        recording: The recording.

    Returns:
        What is left of it; all of a short one.
    """
    # A motion that an input sets off at once bends most there: of a joint with an elastic gear, four windows in 108
    # began in these samples and made 92 % of the loss.
    edge = int(np.searchsorted(recording.ts - recording.ts[0], recording.one_sided * (1 - 1e-9)))
    if 2 * edge > _MOST_LEFT_OUT * len(recording):
        return recording
    inner = recording.cut(edge, len(recording) - edge, name=recording.name)
    return dataclasses.replace(inner, one_sided=0.0)  # What is left is good, and is not cut again.

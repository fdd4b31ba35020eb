"""Inputs that were something else between samples than the description says."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.wording import percent

from ._bumps import Bumps, bumps_of, unexplained

_SAID: Final = {"zero": "held until the next row", "linear": "joined by straight lines"}
_LESS: Final = 0.5  # Share of what was left that is left with the other one: 0.2 of sampled sines, with noise of 1e-3.
_CLEAR: Final = 5.0  # Standard errors.


def find_other_hold(dataset: Dataset, bumps: Sequence[Bumps], is_angle: np.ndarray) -> list[Finding]:
    """Say where accelerations follow far better what inputs would be by the other `hold`.

    A smooth input that is called held acts half a step late, which no friction makes up for: of a simulated pendulum
    without noise predictions over a second were off by 4e-3 rad for 2e-5. A regression under bumps sees it where it
    leaves no more than that, as on one joint; `train` compares predictions.

    Args:
        dataset: Recordings as training sees them.
        bumps: Those to learn from, under bumps.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding, or none.
    """
    if not dataset.inputs:
        return []
    other = "linear" if dataset.hold == "zero" else "zero"
    otherwise = bumps_of(dataset.train, is_angle, held=other == "zero")
    now, then = (np.mean(unexplained(parts), axis=1) for parts in (bumps, otherwise))
    if np.mean(then) > _LESS * np.mean(now):
        return []
    gained = now - then
    if np.mean(gained) * np.sqrt(len(gained)) < _CLEAR * np.std(gained, ddof=1):
        return []
    return [
        Finding(
            kind="hold",
            level="warning",
            channel=dataset.input_names[0] if dataset.inputs == 1 else "",
            text=f"in [train] accelerations follow inputs that are {_SAID[other]}: "
            f"{percent(float(then.mean()))} of their variance is unexplained then, {percent(float(now.mean()))} by "
            f"inputs that are {_SAID[dataset.hold]}",
            advice=f'Write `hold = "{other}"`, unless errors of recordings held out of training are larger then.',
        )
    ]

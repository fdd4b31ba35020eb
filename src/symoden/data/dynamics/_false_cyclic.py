"""Coordinates that are told to be cyclic, and that accelerations depend on."""

import dataclasses
from collections.abc import Sequence
from typing import Final

import numpy as np

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.wording import percent

from ._bumps import Bumps, bumps_of, unexplained

_LESS: Final = 0.8  # Share of what is left without the coordinate that is left with it.
_CLEAR: Final = 4.0  # Standard errors; below zero of coordinates that are cyclic.


def find_false_cyclic(dataset: Dataset, bumps: Sequence[Bumps], is_angle: np.ndarray) -> list[Finding]:
    """Say where accelerations depend on a coordinate that `cyclic` names.

    A joint that gravity turns, or a spring holds, is taken for one about an upright axis. What is told is never learned
    otherwise: on a simulated camera head predictions over a second were off by 0.2 rad for 0.002.

    Args:
        dataset: Recordings as training sees them.
        bumps: Those to learn from, under bumps.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding for each such coordinate.
    """
    if dataset.known is None:
        return []
    found = []
    for i, name in enumerate(dataset.position_names):
        if f"q{i + 1}" not in dataset.known.cyclic:
            continue
        standing = [dataclasses.replace(each, q=each.q * (np.arange(len(is_angle)) != i)) for each in dataset.train]
        parts = bumps, bumps_of(standing, is_angle, held=dataset.hold == "zero")
        with_, without = (np.mean(unexplained(part), axis=1) for part in parts)
        gained = without - with_
        clear = np.mean(gained) * np.sqrt(len(gained)) >= _CLEAR * np.std(gained, ddof=1)
        if clear and np.mean(with_) <= _LESS * np.mean(without):
            found.append(
                Finding(
                    kind="cyclic",
                    level="warning",
                    channel=name,
                    text=f"[known] `cyclic` names q{i + 1}, `{name}`, but in [train] accelerations depend on it: "
                    f"{percent(np.mean(without))} of their variance is unexplained without, "
                    f"{percent(np.mean(with_))} with it",
                    advice="Remove it from `cyclic`, unless errors of recordings held out of training are larger then. "
                    "An angle is cyclic about an upright axis, a length where the machine is the same everywhere.",
                )
            )
    return found

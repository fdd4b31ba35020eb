"""Recordings that are too short to train on."""

import dataclasses
from typing import Final

import numpy as np
from jaxtyping import Bool

from symoden.data._dataset import Dataset
from symoden.data._errors import DataError
from symoden.data._findings import Finding, refusal
from symoden.data._horizons import ADAM_WINDOWS, LEVENBERG_WINDOWS, window_steps, without_poor_ends
from symoden.data._split import split_validation
from symoden.wording import first_few

_NAMED: Final = 5


def find_short(dataset: Dataset, is_angle: Bool[np.ndarray, " n"]) -> list[Finding]:
    """Name recordings that no window of training fits into, and say where training would refuse them all.

    Args:
        dataset: Recordings as training sees them.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding, or none.
    """
    if not dataset.train:
        return []
    try:
        held = split_validation(dataset, min_samples=ADAM_WINDOWS.least + 1)
    except DataError as error:
        return [refusal(error)]
    held = dataclasses.replace(held, train=tuple(map(without_poor_ends, held.train)))
    first, then = (window_steps(held, length, is_angle) + 1 for length in (ADAM_WINDOWS, LEVENBERG_WINDOWS))
    left = {each.name for each in held.train + held.validation if len(each) < then}
    short = [each for each in dataset.train if each.name in left]
    if not short:
        return []
    named = first_few((f"`{each.name}` ({len(each)})" for each in short), _NAMED)
    return [
        Finding(
            kind="refused",
            level="masked",
            channel="",
            text=f"few samples in {len(short)} of {len(dataset.train)} recordings of [train]: {named}",
            advice=f"Training leaves out what is shorter than its windows: of {first} samples at first, of {then} "
            "later. Record longer, or leave these files out.",
        )
    ]

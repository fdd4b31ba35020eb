"""Recordings with too few rows to tell what is wrong with inputs."""

from typing import Final

import numpy as np
from jaxtyping import Bool

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data._trajectory import median_step
from symoden.data.description import Description
from symoden.data.logs import SLOW

from ._bumps import lacking_seconds
from ._late_inputs import delays_tried

_SHORT: Final = 10.0  # [s] that are told to a tenth.


def find_few_rows(dataset: Dataset, description: Description, is_angle: Bool[np.ndarray, " n"]) -> list[Finding]:
    """Say where signs, delays and `hold` of inputs are not looked at, and how much motion that would take.

    Args:
        dataset: Recordings as training sees them.
        description: What it says of them.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One note; none where there are rows enough, or no input changes.
    """
    if not dataset.train or dataset.momenta or not np.ptp(np.concatenate([each.us for each in dataset.train]), 0).any():
        return []
    step = median_step(dataset.train)
    if step >= SLOW:  # The clock is doubted rather.
        return []
    delays = delays_tried(step, min(description.input_delay))
    lacking = lacking_seconds(dataset.train, is_angle, first=delays[-1], last=-delays[0])
    if not lacking:
        return []
    what = "signs, delays and `hold`" if lacking_seconds(dataset.train, is_angle) else "delays"
    told = np.ceil(lacking) if lacking >= _SHORT else np.ceil(10 * lacking) / 10
    return [
        Finding(
            kind="few",
            level="note",
            channel="",
            text=f"{what} of inputs are not looked at: [train] has too few rows, by about {told:g} s of motion",
            advice="Nothing need be done if you are sure of them. Else record more: more files, or longer ones.",
        )
    ]

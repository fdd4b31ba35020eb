"""Inputs that are not what the description says: late, held otherwise, or of the other sign."""

import numpy as np

from ._dataset import Dataset
from ._description import Description
from ._findings import Finding
from ._hold import find_other_hold
from ._input_signs import find_input_signs
from ._late_inputs import find_late_inputs


def find_wrong_inputs(dataset: Dataset, description: Description, is_angle: np.ndarray) -> list[Finding]:
    """Say what the description says wrongly of inputs, as accelerations in training recordings show it.

    By another delay inputs seem to be held otherwise or to push the other way round, so that it goes before both.

    Args:
        dataset: Recordings as training sees them.
        description: What it says of them.
        is_angle: Whether each coordinate is an angle.

    Returns:
        The findings.
    """
    if late := find_late_inputs(dataset, description.input_delay, is_angle):
        return late
    return [*find_other_hold(dataset, is_angle), *find_input_signs(dataset, description, is_angle)]

"""What accelerations speak against: the description as a whole, or single files."""

import numpy as np

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data.description import Description

from ._contradictions import find_contradictions
from ._false_cyclic import find_false_cyclic
from ._hold import find_other_hold
from ._input_signs import find_input_signs
from ._late_inputs import find_late_inputs


def find_doubts(dataset: Dataset, description: Description, is_angle: np.ndarray) -> list[Finding]:
    """Say what the description says wrongly of inputs and of cyclic coordinates, and which files contradict the others.

    By another delay inputs seem to be held otherwise, to push the other way round, or to be late in some files, so that
    it goes before all of these.

    Args:
        dataset: Recordings as training sees them.
        description: What it says of them.
        is_angle: Whether each coordinate is an angle.

    Returns:
        The findings.
    """
    late = find_late_inputs(dataset, description.input_delay, is_angle)
    acting = [] if late else [*find_other_hold(dataset, is_angle), *find_input_signs(dataset, description, is_angle)]
    files = find_contradictions(dataset, is_angle, late=bool(late))
    return [*late, *acting, *find_false_cyclic(dataset, is_angle), *files]

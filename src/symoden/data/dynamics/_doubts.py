"""What inputs and accelerations speak against: the description as a whole, or single files."""

from typing import NamedTuple

import numpy as np

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data.description import Description

from ._bumps import bumps_of
from ._contradictions import find_contradictions
from ._false_cyclic import find_false_cyclic
from ._feedback import find_feedback
from ._few_rows import find_few_rows
from ._hold import find_other_hold
from ._input_signs import find_input_signs
from ._input_work import find_input_work
from ._late_inputs import find_late_inputs
from ._late_positions import find_late_positions
from ._targets import find_targets


class Doubts(NamedTuple):
    """What inputs and accelerations speak against.

    Attributes:
        description: What it says of inputs and coordinates of all files.
        files: Files that contradict the others.
        inputs: Inputs of which it is doubtful whether what they do can be told; nothing is wrong with them.
    """

    description: list[Finding]
    files: list[Finding]
    inputs: list[Finding]


def find_doubts(dataset: Dataset, description: Description, is_angle: np.ndarray) -> Doubts:
    """Say what the description says wrongly of inputs and of cyclic coordinates, and which files contradict the others.

    By another delay inputs seem to be held otherwise, to push the other way round, or to be late in some files, so that
    it goes before all of these; by one that is far off they seem to be fed back; and by a late sensor to be early.

    Args:
        dataset: Recordings as training sees them.
        description: What it says of them.
        is_angle: Whether each coordinate is an angle.

    Returns:
        The findings.
    """
    late = find_late_positions(dataset, description.position_delay, is_angle)
    late = late or find_late_inputs(dataset, description.input_delay, is_angle)
    told = dataset.train and not dataset.momenta
    bumps = bumps_of(dataset.train, is_angle, held=dataset.hold == "zero") if told else []
    acting, places = [], []
    if bumps and not late:
        acting = [*find_other_hold(dataset, bumps, is_angle), *find_input_signs(dataset, description, bumps)]
    if not late and not acting:
        acting = find_input_work(dataset, description, is_angle)
    if bumps:
        places = find_false_cyclic(dataset, bumps, is_angle)
    few = find_few_rows(dataset, description, is_angle)
    targets = find_targets(dataset, description.units, is_angle)
    far_off = any(one.level == "warning" for one in late)
    return Doubts(
        description=[*targets, *late, *acting, *places, *few],
        files=find_contradictions(dataset, is_angle, late=bool(late)),
        inputs=[] if far_off else find_feedback(dataset, description.units, is_angle),
    )

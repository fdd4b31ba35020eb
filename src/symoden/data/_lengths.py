"""Recordings that are too short to train on."""

from typing import Final

from symoden.wording import first_few

from ._dataset import Dataset
from ._errors import DataError
from ._findings import Finding, refusal
from ._masking import LEAST_SAMPLES
from ._split import split_validation

_SHARE: Final = 0.1  # of a recording that training holds out, unless it is told otherwise
_HELD_OUT: Final = 4  # samples that it holds out at least
_NAMED: Final = 5


def find_short(dataset: Dataset) -> list[Finding]:
    """Name recordings with too few samples, and say where training would refuse them all.

    Short recordings alone are as good as long ones; among long ones, windows are too long for them.

    Args:
        dataset: Recordings as training sees them.

    Returns:
        One finding, or none.
    """
    if not dataset.train:
        return []
    try:
        split_validation(dataset, _SHARE, min_samples=_HELD_OUT)
    except DataError as error:
        return [refusal(error)]
    longest = max(map(len, dataset.train))
    short = [each for each in dataset.train if len(each) < min(LEAST_SAMPLES, longest / 2)]
    if not short:
        return []
    named = first_few((f"`{each.name}` ({len(each)})" for each in short), _NAMED)
    return [
        Finding(
            kind="refused",
            level="masked",
            channel="",
            text=f"few samples in {len(short)} of {len(dataset.train)} recordings of [train]: {named}",
            advice=f"Training leaves out what is shorter than its windows. Record {LEAST_SAMPLES} samples or more, or "
            "leave these files out.",
        )
    ]

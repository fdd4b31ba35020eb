"""Whether recordings move as one mechanism does: regressions of accelerations, with nothing learned."""

from ._answers import law_of as law_of, shares_answered as shares_answered
from ._doubts import find_doubts as find_doubts
from ._targets import targets_of as targets_of
from ._told_inputs import shares_told as shares_told

__all__ = [
    "find_doubts",
    "law_of",
    "shares_answered",
    "shares_told",
    "targets_of",
]

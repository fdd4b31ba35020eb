"""Whether recordings move as one mechanism does: regressions of accelerations, with nothing learned."""

from ._answers import law_of as law_of, shares_answered as shares_answered
from ._doubts import find_doubts as find_doubts
from ._told_inputs import followed_by as followed_by, shares_told as shares_told

__all__ = [
    "find_doubts",
    "followed_by",
    "law_of",
    "shares_answered",
    "shares_told",
]

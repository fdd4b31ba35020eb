"""Whether recordings move as one mechanism does: regressions of accelerations, with nothing learned."""

from ._answers import law_of as law_of, shares_answered as shares_answered
from ._doubts import find_doubts as find_doubts

__all__ = [
    "find_doubts",
    "law_of",
    "shares_answered",
]

"""What is known of a mechanism before anything is learned: its parts, as formulas, numbers or functions.

Nothing here imports JAX, so that descriptions are read quickly.
"""

from ._expressions import FUNCTIONS as FUNCTIONS, Expression as Expression
from ._parts import PARTS as PARTS, KnownParts as KnownParts

__all__ = ["FUNCTIONS", "PARTS", "Expression", "KnownParts"]

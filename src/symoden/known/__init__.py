"""What is known of a mechanism before anything is learned: its parts, as formulas, numbers or functions.

Nothing here imports JAX, so that descriptions are read quickly.
"""

from ._expressions import Expression as Expression
from ._grammar import FUNCTIONS as FUNCTIONS, Grammar as Grammar
from ._parts import PARTS as PARTS, KnownParts as KnownParts
from ._rewrite import Identified as Identified, rewrite_urdf as rewrite_urdf
from ._robot import GRAVITY as GRAVITY, Body as Body, Robot as Robot, read_urdf as read_urdf

__all__ = [
    "FUNCTIONS",
    "GRAVITY",
    "PARTS",
    "Body",
    "Expression",
    "Grammar",
    "Identified",
    "KnownParts",
    "Robot",
    "read_urdf",
    "rewrite_urdf",
]

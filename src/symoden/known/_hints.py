"""What was perhaps meant by a text that is no formula, as the last words of its refusal."""

import ast
import difflib
import re
from typing import Final

from ._grammar import Grammar

_SMOOTH_SIGN: Final = (
    " A smooth sign of x is `x/sqrt(x**2 + 1e-4)`. As friction is −D v, a dry friction F is D = `F/sqrt(v1**2 + 1e-4)`."
)
_SMOOTH_LARGER: Final = (
    " These are differentiated, and min, max and clip have corners. A smooth max(a, b) is "
    "`(a + b + sqrt((a - b)**2 + 1e-4))/2`; min(a, b) has the root with a minus."
)
_SMOOTH: Final = {
    **dict.fromkeys(("sign", "sgn"), _SMOOTH_SIGN),
    **dict.fromkeys(("min", "max", "clip"), _SMOOTH_LARGER),
}
_PRODUCT: Final = " A product is written `*`, as in `2*a*(1 - cos(q1))`."
_POINT: Final = " A decimal mark is a point, as in `0.5`."
_INSTEAD: Final = {"^": " A power is written `**`.", "·": _PRODUCT, "×": _PRODUCT, "−": " A minus is written `-`."}
_NO_SIGN: Final = re.compile(  # A number, a name or a parenthesis right before another one; 1e-4 is a number.
    r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?+\s*[A-Za-z_(]|\)\s*[\w(]|\w\s+\w|\w\s+\("
)


def hint_of_character(odd: str) -> str:
    """What was perhaps meant by a character that formulas do not have.

    Args:
        odd: The character.

    Returns:
        The words; none where nobody knows.
    """
    return _INSTEAD.get(odd, "")


def hint_of_text(plain: str) -> str:
    """What was perhaps meant by a text of the right characters that cannot be read.

    Args:
        plain: The text.

    Returns:
        The words; none where nobody knows.
    """
    return _PRODUCT if _NO_SIGN.search(plain) else ""


def hint_at(node: ast.expr, grammar: Grammar) -> str:
    """What was perhaps meant by a part of a text that is neither a number nor a name.

    Args:
        node: The part.
        grammar: What the formula may contain.

    Returns:
        The words; none where nobody knows.
    """
    match node:
        case ast.Tuple():
            return _POINT
        case ast.Call(func=ast.Name(id=name)):
            return _hint_of_call(name, grammar)
        case ast.Call():
            return _PRODUCT
    return ""


def _hint_of_call(name: str, grammar: Grammar) -> str:
    """What was perhaps meant by what stands before parentheses and is no function."""
    if name in _SMOOTH and not grammar.more:
        return _SMOOTH[name]
    meant = difflib.get_close_matches(name, grammar.arguments, n=1)
    return f" Did you mean `{grammar.example(meant[0])}`?" if meant else _PRODUCT

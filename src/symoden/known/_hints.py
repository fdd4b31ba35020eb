"""What was perhaps meant by a text that is no formula, as the last words of its refusal."""

import ast
import difflib
import keyword
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
BACKTICKS: Final = (
    ' A name of more than letters, digits and _ stands in backticks, as in "`Motor Current [mA]` * 0.001".'
)
"""How names are written that would be read as something else."""
_CONDITION: Final = " There are no conditions: beyond ±3 alone is `u - clip(u, -3, 3)`, and `sign(u)` is a direction."
_OF_CONDITIONS: Final = "<>=!?"
_INSTEAD: Final = {"^": " A power is written `**`.", "·": _PRODUCT, "×": _PRODUCT, "−": " A minus is written `-`."}
_NO_SIGN: Final = re.compile(  # A number, a name or a parenthesis right before another one; 1e-4 is a number.
    r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?+\s*[A-Za-z_(]|\)\s*[\w(]|\w\s+\w|\w\s+\("
)
_ODD_NAME: Final = re.compile(  # One of a path, one with a point, or one with no number in its brackets.
    r"(?:^|[-+*/(,])\s*/|[^\W\d]\w*\.|\[(?!\s*\d+\s*\])"
)


def hint_of_character(odd: str, grammar: Grammar) -> str:
    """What was perhaps meant by a character that formulas do not have.

    Args:
        odd: The character.
        grammar: What the formula may contain.

    Returns:
        The words; none where nobody knows.
    """
    if odd in _INSTEAD or not grammar.quotes:
        return _INSTEAD.get(odd, "")
    return _CONDITION if odd in _OF_CONDITIONS else BACKTICKS


def hint_of_text(plain: str, grammar: Grammar) -> str:
    """What was perhaps meant by a text of the right characters that cannot be read.

    Args:
        plain: The text.
        grammar: What the formula may contain.

    Returns:
        The words; none where nobody knows.
    """
    product = _PRODUCT if _NO_SIGN.search(plain) else ""
    odd = product or _ODD_NAME.search(plain) or any(map(keyword.iskeyword, re.findall(r"\w+", plain)))
    return product + BACKTICKS * bool(grammar.quotes and odd)


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
        case ast.Attribute() | ast.Subscript():
            return BACKTICKS * grammar.quotes
    return ""


def _hint_of_call(name: str, grammar: Grammar) -> str:
    """What was perhaps meant by what stands before parentheses and is no function."""
    if name in _SMOOTH and not grammar.more:
        return _SMOOTH[name]
    meant = difflib.get_close_matches(name, grammar.arguments, n=1)
    return f" Did you mean `{grammar.example(meant[0])}`?" if meant else _PRODUCT + BACKTICKS * grammar.quotes

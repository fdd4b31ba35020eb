"""Words that messages share."""

import json
import math
from collections.abc import Iterable
from typing import Final

LEARNED: Final = "model"
"""What stands for the name of a machine where a controller is tried on learned models."""
_SPANS: Final = 4
_FAR: Final = 1e3  # [s]: six digits do not tell the next stamp apart.


def first_few(names: Iterable[str], most: int) -> str:
    """Names with commas between them, an ellipsis in place of those after the first ones.

    Args:
        names: What to name.
        most: How many to name at most.

    Returns:
        The words.

    Example:
        >>> first_few("abc", 2), first_few("ab", 2)
        ('a, b, …', 'a, b')
    """
    every = list(names)
    return ", ".join(every[:most] + ["…"] * (len(every) > most))


def quoted(text: str) -> str:
    r"""A text as TOML has it, to be pasted: in single quotes where double ones would take a backslash for an escape.

    Args:
        text: The text.

    Returns:
        It, in quotes; where single quotes cannot hold it, with escapes in double ones.

    Example:
        >>> print(quoted("pos [mm]"), quoted(r"$\theta$"))
        "pos [mm]" '$\theta$'
    """
    if ("\\" in text or '"' in text) and "'" not in text and text.isprintable():
        return f"'{text}'"
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def stamp(seconds: float) -> str:
    """A time stamp with as many digits as tell it from those beside it, also where it counts from 1970 on.

    Args:
        seconds: The time [s].

    Returns:
        The number.

    Example:
        >>> stamp(12.3456789), stamp(36241.33), stamp(1717493100.25)
        ('12.3457', '36241.330', '1717493100.250')
    """
    return f"{seconds:.6g}" if abs(seconds) < _FAR else f"{seconds:.3f}"


def spans_in_words(spans: Iterable[tuple[str, float, float]]) -> str:
    """Spans of recordings, the first few of many.

    Args:
        spans: Of each the recording's name, its begin and its end [s].

    Returns:
        The words.

    Example:
        >>> spans_in_words([("run1", 4.875, 5.23), ("run2", 0.0, 1.0)])
        '`run1` from 4.875 to 5.23 s, `run2` from 0 to 1 s'
    """
    return first_few((f"`{name}` from {stamp(start)} to {stamp(end)} s" for name, start, end in spans), _SPANS)


def percent(share: float) -> str:
    """A share of what is unexplained: of what a regression did not see it may leave more than all.

    Args:
        share: The share.

    Returns:
        So many percent, two digits of it.

    Example:
        >>> percent(0.0018), percent(0.123), percent(4.4)
        ('0.18%', '12%', '100%')
    """
    return f"{100 * share:.2g}%" if share < 0.995 else "100%"


def number(value: float | None) -> str:
    """Number in four digits, or a dash for none.

    Args:
        value: Any number.

    Returns:
        The text.
    """
    if value is None or math.isnan(value):
        return "-"
    return f"{value:.4g}"

"""The one error of recorded data, and the words that its messages share."""

import difflib
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from symoden.wording import first_few

_SHOWN = 20
COPY: Final = "Perhaps it was cut off: copy it again, or write it again where it was recorded."


class DataError(ValueError):
    """Recorded data, or their description, are not what they must be.

    The message names the file, the column and the row (counted from 0, the header not counted; in a text file the line
    too, as editors count them), says what must hold and what arrived, and what to do.
    """


class DataWarning(UserWarning):
    """Recorded data are usable, but something was left out of them or looks wrong."""


def listing(names: Iterable[str]) -> str:
    """Names as one phrase in a message, a long list being cut short."""
    every = list(names)
    more = f" ({len(every)} in all)" if len(every) > _SHOWN else ""
    return f"`{first_few(every, _SHOWN)}{more}`" if every else "nothing"


def nearest(name: str, known: Iterable[str]) -> str:
    """Question for the name that was probably meant, or nothing."""
    by_lower = {candidate.lower(): candidate for candidate in known}
    matches = difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=0.6)
    return f" Did you mean `{by_lower[matches[0]]}`?" if matches else ""


def missing(path: Path, name: str, found: Iterable[str], *, kind: str = "column") -> str:
    """Message for a column or variable that a file does not have."""
    every = sorted(found) if kind == "variable" else list(found)
    question = nearest(name, every)
    return f"`{path}`: no {kind} `{name}`; found {listing(every)}.{question} Give the names as the file has them."

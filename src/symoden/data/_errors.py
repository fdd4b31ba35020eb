"""The errors of recorded data, and the words that their messages share."""

import difflib
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from symoden.wording import first_few, quoted

_SHOWN = 20
_TYPO, _CLOSE = 0.9, 0.6  # Likeness of names.
_SHOWN_TEXT = 80  # Characters.
_ESCAPES: Final = {"\b": r"\b", "\t": r"\t", "\n": r"\n", "\f": r"\f", "\r": r"\r"}
_CONTROL: Final = re.compile("[\b\t\n\f\r]")
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


def cut(text: str) -> str:
    """A formula or value in a message, without what is too long of it."""
    return text if len(text) <= _SHOWN_TEXT else f"{text[: _SHOWN_TEXT - 1]}…"


def unescaped(name: str) -> str:
    """The name in which TOML, or Python, took a backslash for the beginning of an escape; any other as it is."""
    return _CONTROL.sub(lambda found: _ESCAPES[found[0]], name)


def on_escapes(name: str) -> str:
    """A word on such a name, or nothing."""
    meant = unescaped(name)
    if meant == name:
        return ""
    return f" Names with backslashes stand in single quotes in TOML: {quoted(meant)}."


def nearest(name: str, known: Iterable[str]) -> str:
    """Question for the name that was probably meant, or nothing."""
    by_lower, wrong = {candidate.lower(): candidate for candidate in known}, name.lower()
    longer = [candidate for candidate in by_lower if _goes_on(candidate, wrong)]
    shorter = [candidate for candidate in by_lower if _goes_on(wrong, candidate)]
    # `x` is rather `x_mm` than `t`; but `inputs_delay` is `input_delay`, not `inputs`.
    for candidates, cutoff in ((longer, 0.0), (by_lower, _TYPO), (shorter, 0.0), (by_lower, _CLOSE)):
        if matches := difflib.get_close_matches(wrong, candidates, n=1, cutoff=cutoff):
            return f" Did you mean `{by_lower[matches[0]]}`?"
    return ""


def _goes_on(long: str, short: str) -> bool:
    """Whether a name is another one, and more: a word or unit of its own, or little."""
    more = long.removeprefix(short)
    if not short or not long.startswith(short):
        return False
    return not more[:1].isalpha() or difflib.SequenceMatcher(None, short, long).ratio() >= _CLOSE


class AbsentError(DataError):
    """A file has no column or variable of a name.

    Attributes:
        path: The file.
        name: The name.
        found: Names that the file has.
        kind: What the file has by name, a "column" or a "variable".
        hint: What more there is to say.
    """

    def __init__(self, path: Path, name: str, found: Iterable[str], *, kind: str = "column", hint: str = "") -> None:
        self.path, self.name, self.kind, self.hint = path, name, kind, hint
        self.found = sorted(found) if kind == "variable" else list(found)

    def __str__(self) -> str:
        """The message."""
        question = nearest(unescaped(self.name), self.found) + on_escapes(self.name)
        return (
            f"`{self.path}`: no {self.kind} `{self.name}`; found {listing(self.found)}.{question} Give the names as "
            f"the file has them.{self.hint}"
        )

"""Files of a description, and recordings in them, that cannot be read."""

from dataclasses import dataclass
from pathlib import Path

from symoden.data._errors import DataError
from symoden.data._findings import Finding, refusal


@dataclass(frozen=True, kw_only=True, eq=False)
class Unreadable:
    """A file that cannot be read, lacks a column or has no rows, or one recording in it; or a pattern without files.

    Attributes:
        part: "train", "test" or "validation".
        name: What its recording would be called.
        path: The file; where no file matches a pattern, the pattern.
        error: Why training refuses it.
    """

    part: str
    name: str
    path: Path
    error: DataError

    @property
    def finding(self) -> Finding:
        """Why training refuses it, as a finding."""
        return refusal(self.error)

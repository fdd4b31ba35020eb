"""What was found in a data set, and how it is said."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from symoden.wording import first_few

from ._findings import Finding
from .description import Description, Unreadable
from .logs import ChannelFacts, Log

_LEVELS: Final = ("refused", "warning", "masked", "note")
_NAMED: Final = 3  # Other recordings that a line names.


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordingCheck:
    """What was found in one file's rows of one part.

    Attributes:
        log: The numbers as they were logged, in SI and rad.
        recordings: How many recordings training makes of it; 0 if it refuses it.
        duration: Time from the first to the last time stamp [s].
        steps: Smallest, median and largest step of time [s].
        missing: Rows that lack a number.
        gaps: Start and end of each gap at which it is split [s].
        channels: Facts of every column; none where too few rows are complete.
        findings: What is worth saying.
    """

    log: Log
    recordings: int
    duration: float
    steps: tuple[float, float, float]
    missing: int
    gaps: tuple[tuple[float, float], ...]
    channels: tuple[ChannelFacts, ...]
    findings: tuple[Finding, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class DatasetCheck:
    """What was found in a data set.

    Attributes:
        description: What the description says.
        recordings: What was found in each file that can be read, part by part.
        findings: What is worth saying of them together.
        unreadable: The other files, and recordings in files.
    """

    description: Description
    recordings: tuple[RecordingCheck, ...]
    findings: tuple[Finding, ...]
    unreadable: tuple[Unreadable, ...] = ()

    def __repr__(self) -> str:
        """What it is, in a line."""
        unread = f", {len(self.unreadable)} unreadable" if self.unreadable else ""
        files = f"{len(self.recordings)} recordings{unread}"
        return f"DatasetCheck({files}: {len(self._every)} findings; print it to read them)"

    def __str__(self) -> str:
        """The findings in words, as `symoden data check` prints them."""
        return _told(self)

    @property
    def refused(self) -> bool:
        """Whether training refuses the data."""
        return bool(self.unreadable) or any(finding.level == "refused" for finding in self._every)

    @property
    def _every(self) -> list[Finding]:
        """All findings, of the data set and of single files."""
        return [*self.findings, *(finding for each in self.recordings for finding in each.findings)]


def _told(check: DatasetCheck) -> str:
    """What was found, what is worst first, each kind of a column once."""
    groups = list(_grouped(check))
    lines = []
    if not any(finding.level != "note" for finding, _ in groups):
        lines.append("nothing looks wrong" + ("; worth knowing:" if groups else ""))
    ordered = [pair for level in _LEVELS for pair in groups if pair[0].level == level]
    for k, (finding, where) in enumerate(ordered):
        ending = "" if finding.text.endswith((".", "?")) else "."
        lines.append(f"- {finding.level}{where}: {finding.text}{ending}")
        repeated = k + 1 < len(ordered) and ordered[k + 1][0].advice == finding.advice
        if finding.advice and not repeated:  # What follows has the same: it is said after that.
            lines.append(f"  {finding.advice}")
    return "\n".join(lines)


def _grouped(check: DatasetCheck) -> Iterator[tuple[Finding, str]]:
    """What cannot be read, then findings of the data set and of recordings: the first of its kind, and who has it."""
    reasons: dict[str, tuple[Finding, list[str]]] = {}
    times = Counter(each.name for each in check.unreadable)
    for each in check.unreadable:
        reason = each.finding.text.replace(str(each.path), "")  # Files with the same one are named together.
        name = f"{each.name} [{each.part}]" if times[each.name] > 1 else each.name
        reasons.setdefault(reason, (each.finding, []))[1].append(name)
    yield from ((finding, _where(names)) for finding, names in reasons.values())
    for finding in check.findings:
        yield finding, ""
    groups: dict[tuple[str, str, str], list[tuple[Finding, str]]] = {}
    parts = Counter(each.log.name for each in check.recordings)  # One file may have rows in several.
    for each in check.recordings:
        name = f"{each.log.name} [{each.log.part}]" if parts[each.log.name] > 1 else each.log.name
        for finding in each.findings:
            key = (finding.level, finding.kind, finding.channel)
            groups.setdefault(key, []).append((finding, name))
    for group in groups.values():
        findings, names = zip(*group, strict=True)
        yield findings[0], _where(names, alike=len({each.text for each in findings}) == 1)


def _where(names: Sequence[str], *, alike: bool = True) -> str:
    """The recording that the words are about, and the others that have the same, or the same but for its numbers."""
    first, *others = names
    more = f"{len(others)} more{'' if alike else ', with other numbers'}"
    return f" in {first}" + (f" (and {more}: {first_few(others, _NAMED)})" if others else "")

"""Logged velocities that come late, and whose place the slopes of the positions take."""

import dataclasses
from collections.abc import Collection, Iterable, Sequence
from typing import Final

import numpy as np

from symoden.data._findings import Finding, Kind
from symoden.data.description import Description
from symoden.data.logs import Log

from ._accuracy import WORSE, SlopeComparison
from ._examine import Examination, is_idle

_HARMLESS: Final = 0.01  # Error of a slope relative to a typical velocity that no other velocity could mend by much.
_DOUBTED: Final = frozenset({"stuck", "jump", "sign", "velocity"})  # Findings after which no slope is to be trusted.


def replace_late(
    logs: Sequence[Log], examinations: Sequence[Examination], description: Description
) -> tuple[tuple[Log, ...], tuple[Examination, ...], Finding | None]:
    """Take velocities away that come late, so that they are estimated from the positions.

    The training recordings decide for all. A velocity is late if it is in most of them. All of them go, for what is
    estimated of the others must be better too, or hardly worse.

    Args:
        logs: What was logged.
        examinations: What was found in each.
        description: What it means.

    Returns:
        The logs, without rates where these were taken away; then also the examinations without what they say of each
        velocity's slope, and one finding that says it for all.
    """
    if description.trust_velocities:
        return tuple(logs), tuple(examinations), None
    parts = {log.part for log in logs}
    decides = "train" if "train" in parts else "test"
    asked = [found for log, found in zip(logs, examinations, strict=True) if log.part == decides]
    joints = _by_joint([found.slopes for found in asked])
    late = {joint: every for joint, every in joints.items() if 2 * sum(one.is_late for one in every) > len(every)}
    if not late or _is_doubted(asked, joints) or not all(map(_is_better_estimated, joints.values())):
        return tuple(logs), tuple(examinations), None
    said = _finding(late.values(), [every[0].rate for joint, every in joints.items() if joint not in late])
    return (
        tuple(map(_without_rates, logs)),
        tuple(_without(said.kind, found) for found in examinations),
        said,
    )


def _without_rates(log: Log) -> Log:
    """The same log without velocities, and without what was wrong with them."""
    told = tuple(one for one in log.impossible if not set(one.columns) <= set(log.names["rates"]))
    return dataclasses.replace(log, rates=None, impossible=told)


def _without(kind: Kind, examination: Examination) -> Examination:
    """The same but for findings of a kind."""
    kept = tuple(finding for finding in examination.findings if finding.kind != kind)
    return dataclasses.replace(examination, findings=kept)


def _by_joint(slopes: Sequence[Sequence[SlopeComparison]]) -> dict[int, list[SlopeComparison]]:
    """The comparisons of each coordinate."""
    joints = {one.joint for each in slopes for one in each}
    return {joint: [one for each in slopes for one in each if one.joint == joint] for joint in sorted(joints)}


def _is_doubted(examinations: Sequence[Examination], compared: Collection[int]) -> bool:
    """Whether a position is damaged, or too noisy or in too wrong a unit to compare its velocity with."""
    facts = [found.facts for found in examinations if found.facts is not None]
    moving = {i for each in facts for i, position in enumerate(each.positions) if not is_idle(position)}
    wrong = any(finding.kind in _DOUBTED for found in examinations for finding in found.findings)
    return wrong or not moving <= set(compared)


def _is_better_estimated(every: Sequence[SlopeComparison]) -> bool:
    """Whether the slope of a position tells a velocity better than the log does, or as well as anyone needs."""
    error, differs, typical = (
        float(np.sqrt(np.mean(np.square([getattr(one, name) for one in every]))))
        for name in ("error", "differs", "typical")
    )
    return error <= max(differs / WORSE, _HARMLESS * typical)


def _finding(late: Iterable[Sequence[SlopeComparison]], others: Sequence[str]) -> Finding:
    """What was done, and why."""
    said = [
        f"`{every[0].rate}` comes {1000 * float(np.median([one.delay for one in every if one.is_late])):.3g} ms late"
        f" and is off by {max(one.differs for one in every):.2g}, the slope of `{every[0].position}` by about "
        f"{max(one.error for one in every):.1g}"
        for every in late
    ]
    names = ", ".join(f"`{name}`" for name in others)
    beside = f"; {names} with {'them' if len(said) > 1 else 'it'}, which the slopes tell as well" if others else ""
    return Finding(
        kind="slope",
        level="note",
        channel="",
        text=f"velocities are estimated from the positions, not taken from the log: {'; '.join(said)}{beside}",
        advice="Nothing need be done. `trust_velocities = true` takes them as they were logged.",
    )

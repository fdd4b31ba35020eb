"""Examining one log: what is wrong with it, and what is worth knowing."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from symoden.data._findings import Finding
from symoden.data.description import Description
from symoden.data.logs import ChannelFacts, Facts, find_stuck

from ._accuracy import SlopeComparison, compare_with_slopes, find_inaccurate
from ._held import find_held
from ._mismatch import find_mismatches

_SAME = 0.03
_IDLE, _LOUD = 10.0, 8.0  # steps of rounding, and sizes of the noise, whose own range is 7, that a joint must move
_STILL: Final = Finding(
    kind="idle",
    level="warning",
    channel="",
    text="nothing moves: no position and no velocity changes at all",
    advice="Leave the file out if the machine was at rest; otherwise look at the logger.",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Examination:
    """Facts of a log's channels, and findings on them; rows that are left out are `mask`'s business.

    Attributes:
        facts: The facts; None where too few rows are complete.
        findings: The findings.
        slopes: Velocities beside the slopes of their positions.
    """

    facts: Facts | None
    findings: tuple[Finding, ...] = ()
    slopes: tuple[SlopeComparison, ...] = ()


def examine(
    facts: Facts | None, description: Description, lone: Sequence[Finding] = (), *, clock: Finding | None = None
) -> Examination:
    """Look at the rows of a log that are used.

    Args:
        facts: What was measured of them; None where there are too few.
        description: What they mean.
        lone: What single samples of inputs are.
        clock: That the clock of all logs is wrong, if so: then nothing else is asked of velocities.

    Returns:
        What was found.
    """
    if facts is None:
        return Examination(facts=None)
    if stands_still(facts.channels):
        return Examination(facts=facts, findings=(_STILL,))
    slopes = compare_with_slopes(facts)
    findings = (
        *(stuck := find_stuck(facts)),
        *find_held(facts),
        *([clock] if clock else find_mismatches(facts, stuck)),
        *lone,
        *_saturation(facts),
        *(rounded := _rounding(facts)),
        *find_inaccurate(slopes, named={one.channel for one in rounded}, trusted=description.trust_velocities),
        *_idle(facts),
    )
    return Examination(facts=facts, findings=findings, slopes=slopes)


def _saturation(facts: Facts) -> list[Finding]:
    """Inputs that are cut off at an extreme value."""
    return [
        Finding(
            kind="saturation",
            level="note",
            channel=u.name,
            text=f"`{u.name}` is at its extreme value ({' or '.join(f'{limit:.4g}' for limit in u.limits)}) for "
            f"{u.cut_off:.0%} of the samples",
            advice="If these are commands and the drive limits them further, name the measured input instead.",
        )
        for u in facts.inputs
        if u.cut_off
    ]


def _rounding(facts: Facts) -> list[Finding]:
    """Velocities that are differences of rounded positions."""
    step = float(np.median(np.diff(facts.ts)))
    return [
        Finding(
            kind="rounding",
            level="note",
            channel=v.name,
            text=f"`{v.name}` is rounded to {v.quantum:.3g}, which is one step of `{q.name}` ({q.quantum:.3g}) in one "
            f"step of time ({step:.3g} s): it was computed as a difference of positions",
            advice="Nothing need be done. It knows no more than the positions do: without `velocities`, they are "
            "estimated from several samples and have less noise.",
        )
        for q, v in zip(facts.positions, facts.rates, strict=False)
        if facts.ratios and q.quantum and abs(v.quantum * step / q.quantum - 1) < _SAME
    ]


def _idle(facts: Facts) -> list[Finding]:
    """Joints that hardly move."""
    return [
        Finding(
            kind="idle",
            level="note",
            channel=q.name,
            text=f"`{q.name}` hardly moves, by {q.span:.3g} in all",
            advice="Nothing need be done if it moves in other recordings of the part.",
        )
        for q in facts.positions
        if is_idle(q)
    ]


def stands_still(channels: Sequence[ChannelFacts]) -> bool:
    """Whether nothing of a mechanism moves, not even by its noise.

    Args:
        channels: Facts of all its columns.

    Returns:
        Whether every position and every rate is constant.
    """
    return not any(one.span for one in channels if one.role != "input")


def is_idle(position: ChannelFacts) -> bool:
    """Whether a position hardly moves.

    Args:
        position: Its facts.

    Returns:
        Whether its range is what its rounding and noise make it.
    """
    return position.span <= max(_IDLE * position.quantum, _LOUD * position.noise)

"""Sensors that count from wherever the machine stood when a recording began."""

from collections.abc import Collection, Sequence
from typing import Final

import numpy as np

from symoden.data._findings import Finding

from ._facts import ChannelFacts
from ._logs import Log

_LEAST: Final = 3  # recordings: two may begin alike by chance
_STEPS: Final = 2  # of rounding, from zero
_MOVES: Final = 100  # steps of rounding: what moves less may be near zero by chance


def find_counted_zeros(
    logs: Sequence[Log], channels: Sequence[Sequence[ChannelFacts]], *, cyclic: Collection[str] = ()
) -> list[Finding]:
    """Find positions that are zero at the first row of every recording.

    An incremental encoder that is not homed counts from there. Dry friction holds a machine at rest anywhere within
    reach of its torque, so that every recording then has a zero of its own.

    Args:
        logs: What was logged.
        channels: Facts of each log's columns, positions first; empty where they are not known.
        cyclic: Coordinates, as "q1", that nothing depends on, wherever their zero is.

    Returns:
        One finding for all such positions, or none.
    """
    known = [(log, facts) for log, facts in zip(logs, channels, strict=True) if facts]
    if len(known) < _LEAST:
        return []
    names = [
        facts[0].name
        for i, facts in enumerate(zip(*(facts for _, facts in known), strict=True))
        if facts[0].role == "position"
        and f"q{i + 1}" not in cyclic
        and _counts_from_start([log.q[:, i] for log, _ in known], facts)
    ]
    if not names:
        return []
    named = " and ".join(f"`{name}`" for name in names)
    verb = "is" if len(names) == 1 else "are"
    return [
        Finding(
            kind="zero",
            level="note",
            channel=names[0] if len(names) == 1 else "",
            text=f"{named} {verb} 0 at the beginning of all {len(known)} recordings: positions that are counted from "
            "where each one began?",
            advice="Nothing need be done if it begins at a stop or at an index mark. If dry friction holds it, each "
            "recording's zero is off by something else, and gravity seems to turn: home the encoders before recording.",
        )
    ]


def _counts_from_start(positions: Sequence[np.ndarray], facts: Sequence[ChannelFacts]) -> bool:
    """Whether a column is zero at first in all recordings, to its rounding, and moves in one of them."""
    quantum, span = max(one.quantum for one in facts), max(one.span for one in facts)
    firsts = [position[np.isfinite(position)][0] for position in positions]
    near = max(_STEPS * quantum, np.finfo(float).eps * span)
    return span > _MOVES * quantum and bool(np.abs(firsts).max() <= near)

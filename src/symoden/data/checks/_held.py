"""Machines that something holds until it lets go, which is not among the inputs."""

from typing import Final

import numpy as np
from jaxtyping import Float

from symoden.data._findings import Finding
from symoden.data.logs import Facts

_LEAST_ROWS: Final = 5  # In which nothing moves.
_LONG: Final = 3.0  # Times as long as the first tenth of the way then takes.
_RESOLVED: Final = 100.0  # The way, in what counts as still: less does not tell when a tenth of it was gone.
_EARLY, _LATER = 0.1, 0.4  # Of the way.
_AT_ONCE: Final = 1.8  # Times as long as the tenth, four tenths take: 2 if let go, 1.6 at most where a balance is lost.
_ROUNDINGS, _NOISES, _FINEST = 1.5, 6.0, 1e-4  # Steps, noises of the first rows, and share of the way.


def find_held(facts: Facts) -> list[Finding]:
    """Name a beginning that no motion from rest has: nothing moves for long, and then much at once.

    What rests while its inputs stay as they are is in balance, and goes on resting; a balance that is not stable is
    lost slowly at first, as e^{λt}. What is let go, or pushed, begins with its full acceleration: four tenths of its
    way take twice as long as one.

    Args:
        facts: Of the log.

    Returns:
        One finding, or none.
    """
    gaps = np.flatnonzero(np.diff(facts.ts) > facts.longest)
    way = facts.way[: int(gaps[0]) + 1 if gaps.size else None]
    # Where samples are rare, what is taken for noise is motion; of few rows, noise is no more than guessed.
    for noise in (np.std(way[:_LEAST_ROWS], axis=0), [one.noise for one in facts.positions]):
        if found := _let_go(facts, np.abs(way - way[0]), np.asarray(noise)):
            name, span = found
            return [
                Finding(
                    kind="held",
                    level="warning",
                    channel=name,
                    text=f"`{name}` stands still for the first {span:.3g} s and then goes off at once, while no input "
                    "changes: what held it, or set it going, is not among the inputs",
                    advice="Leave these rows out, by `rows` of the file, unless friction held it and an input is "
                    "missing.",
                    spans=((float(facts.ts[0]), float(facts.ts[0]) + span),),
                )
            ]
    return []


def _let_go(facts: Facts, away: Float[np.ndarray, "T n"], noise: Float[np.ndarray, " n"]) -> tuple[str, float] | None:
    """Position that goes off at once, and for how long it stood still, in the first rows; None if none does."""
    ts = facts.ts[: len(away)] - facts.ts[0]
    ways, rounding = away.max(axis=0), np.array([one.quantum for one in facts.positions])
    still = np.maximum.reduce([_ROUNDINGS * rounding, _NOISES * noise, _FINEST * ways])
    first = int(np.argmax((away > still).any(axis=1)))
    if first < _LEAST_ROWS:  # Or nothing ever moves.
        return None
    span = float(ts[first - 1])
    for i in np.flatnonzero(ways > _RESOLVED * still):
        early, later = (_reached(ts, away[:, i], share * ways[i], first) - span for share in (_EARLY, _LATER))
        end = int(np.searchsorted(ts, span + later))
        unmoved = np.all(np.ptp(facts.us[: end + 1], axis=0) <= [one.quantum for one in facts.inputs])
        if unmoved and end > first and span >= _LONG * early and later >= _AT_ONCE * early:
            return facts.positions[i].name, span
    return None


def _reached(ts: np.ndarray, away: np.ndarray, distance: float, first: int) -> float:
    """When a distance was reached, between rows."""
    k = first + int(np.argmax(away[first:] >= distance))
    share = (distance - away[k - 1]) / (away[k] - away[k - 1])
    return float(ts[k - 1] + share * (ts[k] - ts[k - 1]))

"""Columns of another quantity than they are taken for, by the units that their names say."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from symoden.data._findings import Finding
from symoden.data.description import entry, of_column, si_of, split_unit, unit_said
from symoden.data.logs import Facts
from symoden.data.signals import UNRELATED

_DRIVES: Final = frozenset({"N", "N m", "A", "V"})
_MOTIONS: Final = frozenset({"rad", "m", "rad/s", "m/s"})


def find_other_quantities(facts: Facts) -> list[Finding]:
    """Find positions and velocities whose names say a unit of another quantity, and inputs that are in their place.

    What is the velocity of its position but for a factor is told by its numbers: a tachometer may say volts. An input
    may be the target of a servo, in rad: only beside a position that says amperes it is rather that position; and
    widths of pulses are inputs in us, which do not always rise, as time does.

    Args:
        facts: Facts of a log.

    Returns:
        A finding for each.
    """
    found = list(_of_motion(facts))
    positions = {position.name for position in facts.positions}
    exchanged = any(name in positions and si in _DRIVES for name, si, _ in found)
    for u, signal in zip(facts.inputs, facts.us.T, strict=True):
        si = _si_said(u.name, facts)
        if (exchanged and si in _MOTIONS) or (si == "s" and u.span > 0 and (np.diff(signal) >= 0).all()):
            found.append((u.name, si, ""))
    return [_finding(name, becomes, facts) for name, _, becomes in found]


def where_said(name: str) -> str:
    """Where the unit of a column stands.

    Args:
        name: The column's name, which or the line under which says a unit.

    Returns:
        The words.
    """
    return "name" if split_unit(name)[1] else "line under the name"


def _of_motion(facts: Facts) -> Iterator[tuple[str, str, str]]:
    """Names of positions and velocities, the SI unit that they say, and those that their numbers are taken to have."""
    for i, kinds in enumerate(facts.kinds):
        ratio = facts.ratios[i] if facts.ratios else None
        if ratio is not None and ratio.known and ratio.misfit <= UNRELATED:
            continue
        pair = [(facts.positions[i], kinds)]
        if facts.v is not None:
            pair.append((facts.rates[i], tuple(f"{unit}/s" for unit in kinds)))
        for channel, fitting in pair:
            if (si := _si_said(channel.name, facts)) and si not in fitting:
                yield channel.name, si, " or ".join(fitting)


def _si_said(name: str, facts: Facts) -> str:
    """SI unit of what a column's name says; nothing where it says none, or the description knows better."""
    unit = unit_said(name, facts.below)
    return (si_of(unit) or "") if unit and of_column(name, facts.units) is None else ""


def _finding(name: str, becomes: str, facts: Facts) -> Finding:
    """What is said of such a column, by the units that it is taken to have; of an input by none."""
    unit = unit_said(name, facts.below)
    taken = f"it is read as {becomes or 'an input'}"
    factor = f" the factor that makes {becomes} of it," if becomes else ""
    is_length = becomes.startswith("rad") and si_of(unit) in ("m", "m/s")
    letter = "; lengths have the letter R in `space`" if is_length else ""
    return Finding(
        kind="unit",
        level="warning",
        channel=name,
        text=f"the {where_said(name)} of `{name}` says {unit}, and {taken}: another column?",
        advice=f"Name the right one{letter}. If it is this one, write{factor} {entry({name: 1.0}, facts.units)}.",
    )

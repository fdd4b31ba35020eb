"""Positions and velocities that disagree: wrong units, turned signs, wrong columns, jumps."""

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from symoden.data._errors import listing
from symoden.data._findings import Finding
from symoden.data.description import (
    Description,
    entry,
    factor_of,
    key,
    number_of,
    of_column,
    si_of,
    unit_said,
    units_of,
)
from symoden.data.logs import Facts
from symoden.data.signals import AGREES, UNRELATED, Ratio, velocity_ratio

from ._jumps import find_jumps
from ._quantities import find_other_quantities, where_said

_ROUNDED: Final = 1e-3  # As far a factor may be rounded that is a unit's: 0.01745 for a degree.
_SAME = 0.06  # relative deviation up to which a factor is a known one
_ELSEWHERE = 0.2  # misfit of another coordinate's velocity that is taken for this one's
_TURNS = 5  # in both directions without a wrap, beyond which an angle is perhaps in degrees
_REVERSES = 1.5
_DEGREES = 180 / np.pi
_CLOCKS: Final = (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns")  # What makes of seconds so much of ∫v dt.
_TURNED: Final = frozenset({"rev", "rev/s"})  # All columns of a log have these more seldom than it has a wrong `dt`.
_FACTORS: Final = (0.5, 2.0)  # Which filters may make.
_SLOW = 0.5  # [s] between samples, which hardly a logger takes; of a single joint the units may be wrong as well.

# Factor of the position's displacement over the integrated velocity: what explains it, and units for both columns.
_ANGLES: Final = (
    (_DEGREES, "positions in degrees, velocities in rad/s", {"q": "deg"}),
    (1 / _DEGREES, "positions in rad, velocities in degrees per second", {"v": "deg/s"}),
    (1 / (2 * np.pi), "positions in turns, velocities in rad/s", {"q": "rev"}),
    (2 * np.pi, "positions in rad, velocities in turns per second", {"v": "rev/s"}),
    (2 * np.pi / 60, "positions in rad, velocities in turns per minute", {"v": "rpm"}),
    (6.0, "positions in degrees, velocities in turns per minute", {"q": "deg", "v": "rpm"}),
)
_LENGTHS: Final = (
    (1000.0, "positions in mm, velocities in m/s", {"q": "mm"}),
    (100.0, "positions in cm, velocities in m/s", {"q": "cm"}),
    (0.001, "positions in m, velocities in mm/s", {"v": "mm/s"}),
    (0.01, "positions in m, velocities in cm/s", {"v": "cm/s"}),
)


def find_wrong_clock(every: Sequence[Facts], description: Description) -> Finding | None:
    """Find a clock that is wrong by a factor, where several coordinates disagree with their velocities by the same.

    Of what is measured in one unit the unit may be wrong as well; then each position and velocity is told so.

    Args:
        every: Facts of each log of a data set.
        description: What it means.

    Returns:
        One finding for all logs, or none.
    """
    known = [(i, ratio) for facts in every for i, ratio in enumerate(facts.ratios) if ratio.known]
    if len({i for i, _ in known}) <= 1 or any(ratio.misfit > UNRELATED for _, ratio in known):
        return None
    factor = float(np.median([ratio.factor for _, ratio in known]))
    alike = factor > 0 and all(abs(ratio.factor / factor - 1) < AGREES for _, ratio in known)
    if not alike or abs(factor - 1) < AGREES or any(abs(factor / size - 1) < _SAME for size, _ in _CLOCKS):
        return None
    kinds = {every[0].kinds[i] for i, _ in known}
    units = [each for each in _factors(kinds.pop()) if abs(factor / each[0] - 1) < AGREES] if len(kinds) == 1 else []
    if any(description.dt is None or description.time is not None or _TURNED.isdisjoint(u.values()) for *_, u in units):
        return None
    clock, rounded = every[0].clock, float(f"{factor:.3g}")
    what = "are time stamps right?" if clock else "is `dt` right?"
    write = entry({clock: rounded}, every[0].units) if clock else f"`dt = {(description.dt or 1.0) * factor:.3g}`"
    others = f", as for {units[0][1]}" if units else ""
    return Finding(
        kind="unit",
        level="warning",
        channel="",
        text=f"all positions move about {rounded:g} times as far as their velocities say: {what}",
        advice=f"If not, write {write}, or what you know it to be. Otherwise positions or velocities are in another "
        f"unit{others}: name it in `units`.",
    )


def find_mismatches(facts: Facts, stuck: Sequence[Finding]) -> list[Finding]:
    """Find units, signs and columns that cannot be right, and jumps of positions.

    Args:
        facts: Facts of a log.
        stuck: What was found of sensors that stand still; a jump at the end of it is no other fault.

    Returns:
        The findings.
    """
    if clock := _clock(facts):
        return [clock]
    said, others = _units_in_names(facts), [*_other_units(facts), *find_other_quantities(facts)]
    found, named = [*_by_name(said, facts), *others], {*said, *(each.channel for each in others)}
    joints, agree = range(facts.q.shape[1]), []
    for i in joints:
        ratio = facts.ratios[i] if facts.ratios else None
        if named & {facts.positions[i].name, *(rate.name for rate in facts.rates[i : i + 1])}:
            continue
        of_ratio = _of_ratio(facts, i, ratio) if ratio is not None and ratio.known else []
        found.extend(of_ratio)
        agree.extend([] if of_ratio else [i])
    degrees = _in_degrees(facts, agree)
    found.extend(_of_degrees(facts, degrees))
    found.extend(one for i in agree if i not in degrees for one in find_jumps(facts, i, stuck))
    return found


def _named_units(facts: Facts) -> dict[str, tuple[str, str]]:
    """Unit that the name of a position or velocity, or a line under it, says, if it can be one; and its SI unit."""
    per_second = [tuple(f"{unit}/s" for unit in kinds) for kinds in facts.kinds]
    every = zip(facts.positions + facts.rates, [*facts.kinds, *per_second], strict=False)
    units = {channel.name: (unit_said(channel.name, facts.below), kinds) for channel, kinds in every}
    return {name: (unit, si) for name, (unit, kinds) in units.items() if unit and (si := si_of(unit)) in kinds}


def _units_in_names(facts: Facts) -> dict[str, tuple[str, str]]:
    """Those that are read in SI, for nobody said otherwise."""
    return {
        name: (unit, si)
        for name, (unit, si) in _named_units(facts).items()
        if si != unit and of_column(name, facts.units) is None
    }


def _other_units(facts: Facts) -> list[Finding]:
    """Columns whose names say one unit, and `units` another one; other factors may be gears."""
    found = []
    for name, (unit, si) in _named_units(facts).items():
        factor = number_of(name, facts.units, math.nan)
        told = [each for each in units_of([si]) if math.isclose(abs(factor), factor_of(each), rel_tol=_ROUNDED)]
        if not told or unit in told:
            continue
        value = f"{-factor_of(unit):.6g}" if factor < 0 else f'"{unit}"'
        found.append(
            Finding(
                kind="unit",
                level="warning",
                channel=name,
                text=f"the {where_said(name)} of `{name}` says {unit}, and `units` {told[0]}",
                advice=f"Write `{key(name)} = {value}` into `units` instead, unless it is the {where_said(name)} that "
                "is wrong.",
            )
        )
    return found


def _by_name(said: Mapping[str, tuple[str, str]], facts: Facts) -> list[Finding]:
    """One finding of all such columns, so that one line of the description mends them."""
    if not said:
        return []
    texts = [
        f"the {where_said(name)} of `{name}` says {unit}, and it is read as {si}" for name, (unit, si) in said.items()
    ]
    return [
        Finding(
            kind="unit",
            level="warning",
            channel=next(iter(said)) if len(said) == 1 else "",
            text="; ".join(texts),
            advice=f"Write {entry({name: unit for name, (unit, _) in said.items()}, facts.units)}.",
        )
    ]


def _clock(facts: Facts) -> Finding | None:
    """A clock that does not count seconds, where all velocities are too large by the same power of a thousand."""
    factors = [abs(ratio.factor) for ratio in facts.ratios if ratio.known]
    slow = float(np.median(np.diff(facts.ts))) > _SLOW
    for size, unit in _CLOCKS:
        if factors and (slow or len(factors) > 1) and all(abs(factor / size - 1) < _SAME for factor in factors):
            return Finding(
                kind="unit",
                level="warning",
                channel="",
                text=f"all positions move {size:g} times as far as their velocities say: time stamps in {unit}, not in "
                "s?",
                advice=f"Write {entry({facts.clock: unit}, facts.units)}." if facts.clock else "Correct `dt`.",
            )
    return None


def _of_ratio(facts: Facts, i: int, ratio: Ratio) -> list[Finding]:
    """A factor other than 1 between the derivative of a position and its velocity, or none at all."""
    q, v = facts.positions[i].name, facts.rates[i].name
    factor, size = ratio.factor, abs(ratio.factor)
    if ratio.agrees:
        return []
    other = _real_velocity(facts, i)
    if ratio.behind and other is None:
        return [_behind(q, v, ratio)]
    if other is not None or ratio.misfit > UNRELATED:
        return [_unrelated(q, v, other)]
    said = f"the derivative of `{q}` is {factor:.3g} times `{v}`"
    if abs(size - 1) < AGREES:
        return [
            Finding(
                kind="sign",
                level="warning",
                channel=v,
                text=f"{said}: opposite directions",
                advice=f"Turn the wrong one round: write {entry({v: -1.0}, facts.units)} or "
                f"{entry({q: -1.0}, facts.units)}. Look at the directions of the inputs too.",
            )
        ]
    for known, what, units in _factors(facts.kinds[i]):
        if abs(size / known - 1) < _SAME and abs(size / known - 1) <= abs(size / _round(size) - 1):
            columns = {{"q": q, "v": v}[symbol]: unit for symbol, unit in units.items()}
            turned = " One of them has the opposite direction as well." if factor < 0 else ""
            write = entry(columns, facts.units)
            advice = f"Write {write}."
            for one, told, mends in ((v, q, 1 / known), (q, v, known)):
                if one in columns and told in facts.units:  # That one may be wrong.
                    advice = f"If `{one}` is right, write {entry({told: mends}, facts.units)}; otherwise write {write}."
                    break
            return [
                Finding(
                    kind="unit",
                    level="warning",
                    channel=q,
                    text=f"{said}, as it is for {what}",
                    advice=advice + turned,
                )
            ]
    first, second = (v, q) if q in facts.units else (q, v)
    factors = {q: float(f"{1 / factor:.4g}"), v: float(f"{factor:.4g}")}
    return [
        Finding(
            kind="unit",
            level="warning",
            channel=v,
            text=f"{said}: {'opposite directions, and ' if factor < 0 else ''}another unit, a gear between the two "
            "sensors, or wrong time stamps?",
            advice=f"If `{first}` is right, write {entry({second: factors[second]}, facts.units)}; otherwise, if "
            f"`{second}` is, write {entry({first: factors[first]}, facts.units)}, or correct the time stamps.",
        )
    ]


def _behind(q: str, v: str, ratio: Ratio) -> Finding:
    """A position that is late beside its velocity: no factor mends that."""
    factor = ratio.factor
    return Finding(
        kind="velocity",
        level="warning",
        channel=v,
        text=f"`{q}` follows the integral of `{v}` about {ratio.behind:.2g} s late ({ratio.misfit:.0%} of its way is "
        "unexplained without a delay), as a filtered position or a slower sensor does"
        + ("" if _FACTORS[0] < factor < _FACTORS[1] else f"; and {factor:.3g} times as far: look at its unit, too"),
        advice="Leave `velocities` out: they are then estimated, as late as the positions, and `input_delay` can make "
        "up for that. Or name columns that belong together.",
    )


def _factors(kinds: tuple[str, ...]) -> tuple[tuple[float, str, dict[str, str]], ...]:
    """Known factors of a coordinate; of one that nothing tells to be an angle those of lengths."""
    return _LENGTHS if "m" in kinds else _ANGLES


def _round(size: float) -> float:
    """The next power of ten: a `dt` that is ten times too long is not turns per minute, which is 0.105."""
    return 10.0 ** round(math.log10(size))


def _real_velocity(facts: Facts, i: int) -> str | None:
    """Name of another coordinate's velocity that is the derivative of position i."""
    way = facts.way[:, i]
    for j, rate in enumerate(facts.rates):
        if j == i or facts.v is None:
            continue
        accuracy = facts.positions[i].accuracy, rate.accuracy
        other = velocity_ratio(facts.ts, way, facts.v[:, j], longest=facts.longest, accuracy=accuracy)
        if other.known and other.misfit < _ELSEWHERE and abs(other.factor - 1) < AGREES:
            return rate.name
    return None


def _unrelated(q: str, v: str, other: str | None) -> Finding:
    """A velocity that is not that of its position; perhaps it is another one's."""
    return Finding(
        kind="velocity",
        level="warning",
        channel=v,
        text=f"`{v}` is not the derivative of `{q}`" + (f", but `{other}` is" if other else ""),
        advice="Put `velocities` into the order of `positions`."
        if other
        else "Correct `positions` and `velocities`, or leave `velocities` out: they are then estimated.",
    )


def _in_degrees(facts: Facts, joints: Sequence[int]) -> list[int]:
    """Angles that turn back and forth further than joints do, and those that go as far beside one of them."""
    told = [of_column(position.name, facts.units) not in (None, -1.0) for position in facts.positions]  # -1: no unit.
    far = [i for i in joints if facts.is_angle[i] and not told[i] and facts.positions[i].span >= 2 * np.pi * _TURNS]
    back = [i for i in far if np.abs(np.diff(facts.q[:, i])).sum() >= _REVERSES * facts.positions[i].span]
    return far if back else []


def _of_degrees(facts: Facts, joints: Sequence[int]) -> list[Finding]:
    """One finding of all such angles, so that one line of the description mends them."""
    if not joints:
        return []
    spans = {facts.positions[i].name: facts.positions[i].span for i in joints}
    units = dict.fromkeys(spans, "deg") | {rate.name: "deg/s" for i in joints for rate in facts.rates[i : i + 1]}
    others = [
        one.name
        for one, angle in zip(facts.positions, facts.is_angle, strict=True)
        if angle and one.name not in spans and of_column(one.name, facts.units) is None
    ]
    look = f" Look at {listing(others)}, too, which go{'es' if len(others) == 1 else ''} less far." if others else ""
    said = "; ".join(
        f"`{name}` moves over {span:.4g} rad, {span / (2 * np.pi):.3g} turns" for name, span in spans.items()
    )
    return [
        Finding(
            kind="unit",
            level="warning",
            channel=next(iter(spans)) if len(spans) == 1 else "",
            text=f"{said}: degrees?",
            advice=f"If so, write {entry(units, facts.units)}.{look} If joints turn so far, nothing need be done.",
        )
    ]

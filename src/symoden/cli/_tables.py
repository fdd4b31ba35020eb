"""What a model learned, as lines and tables."""

import math
from collections.abc import Collection, Iterator, Sequence
from typing import Final

from symoden.evaluation import Certainty, Inspection, Profile
from symoden.experiments import RunConfig
from symoden.units import titled
from symoden.wording import number

from ._output import TableText
from ._words import size_words

_ROUNDING: Final = 1e-12
_ANYWHERE: Final = "anywhere"
_BENT: Final = 2.0


def facts(found: Inspection) -> Iterator[tuple[str, str]]:
    """What a model is, in a line each.

    Args:
        found: What was found.

    Yields:
        Name and value.
    """
    yield "parameters", size_words(found.parameters, found.active)
    yield "what fixes the scale", found.anchor
    if found.units:
        words = "; ".join(f"{letter} {unit}" for letter, unit in found.units.items())
        yield "units, where the data are SI and inputs N or N m", words
    yield from found.given.items()
    if found.cyclic:
        yield "nothing depends on", ", ".join(f"q{i + 1}" for i in found.cyclic) + " (given)"
    for name, extremes in (("M", found.mass_matrix_eigenvalues), ("D", found.dissipation_eigenvalues)):
        none = "does not apply: this kind of model has none"
        yield (
            f"eigenvalues of {name} over the data's range",
            none if extremes is None else "{} to {}".format(*map(number, extremes)),
        )
    if words := _bent_inertia(found):
        yield "what bends M so", words


def _bent_inertia(found: Inspection) -> str:
    """What to say of a learned M that changes much along the only coordinate."""
    if len(found.middle) > 1 or "mass_matrix" in found.given or found.mass_matrix_eigenvalues is None:
        return ""
    low, high = found.mass_matrix_eigenvalues
    if not 0 < _BENT * low <= high < math.inf:
        return ""
    return (
        f"that of one rigid body is the same everywhere, and this one changes {number(high / low)}-fold: unless it "
        "drives a linkage, an input that is no force (a thrust with an offset, a dead band, a target), that comes "
        "late, or that was not logged does it"
    )


def tables(found: Inspection, certain: Certainty | None, config: RunConfig) -> Iterator[TableText]:
    """Everything that was found, each number with half of the width of its band.

    Args:
        found: What was found.
        certain: Its bands.
        config: Settings of the run.

    Yields:
        The tables.
    """
    if found.identified:
        rows = [
            (name, _banded(value, certain and certain.identified[name])) for name, value in found.identified.items()
        ]
        factor = ": masses, moments and forces up to one common factor, which `input_matrix` would fix"
        free = "" if found.units else factor
        yield TableText(f"identified parameters{free}", ("name", "value"), rows)
    names, units = (config.data.position_names, config.data.input_names), found.position_units
    profiles = [
        list(
            _profile_tables(
                profile, certain and certain.profiles[i], *names, title=titled(names[0][i], units[i]), given=found.given
            )
        )
        for i, profile in enumerate(found.profiles)
    ]
    yield from _without_repetition(profiles)
    for k, along in enumerate(found.friction):
        i, band = along.coordinate, certain and certain.friction[k]
        columns = (along.coefficient, band and band.coefficient), (along.force, band and band.force)
        rows = [
            (number(v), *(_banded(values[j], None if half is None else half[j]) for values, half in columns))
            for j, v in enumerate(along.velocities)
        ]
        title = f"friction along the velocity of {names[0][i]}, the data's middle otherwise"
        force = titled("force D v", units[i] if found.units else "", "force")
        yield TableText(title, (titled("v", units[i], "velocity"), f"D[{i + 1}, {i + 1}]", force), rows)


def _banded(value: float, half_width: float | None) -> str:
    """A number, and half of the width of its band.

    Args:
        value: The number.
        half_width: Half of its band.

    Returns:
        The text.
    """
    # Where only ratios are known, M is the unit of the rest, and what is left of its band is rounding.
    known = half_width is None or half_width <= _ROUNDING * abs(value)
    return number(value) if known else f"{number(value)} ± {half_width:.2g}"


def _profile_tables(
    profile: Profile,
    widths: Profile | None,
    positions: Sequence[str],
    inputs: Sequence[str],
    *,
    title: str,
    given: Collection[str],
) -> Iterator[TableText]:
    """Blocks along one coordinate: the energy's in one table, what acts in another."""
    name = positions[profile.coordinate]
    others = ", the other coordinates in the middle of the data" if len(positions) > 1 else ""
    at = "; D at half of the largest velocities" if profile.dissipation_matrix is not None else ""
    names = positions, inputs, given
    for curves, half, note in (
        (profile.energy_curves(), widths and widths.energy_curves(), ""),
        (profile.port_curves(*names), widths and profile.port_curves(*names, widths=widths), at),
    ):
        if curves:
            rows = [
                [number(value), *(_banded(curves[head][k], None if half is None else half[head][k]) for head in curves)]
                for k, value in enumerate(profile.values)
            ]
            if all(row[1:] == rows[0][1:] for row in rows):
                rows = [[_ANYWHERE, *rows[0][1:]]]
            yield TableText(f"along {name}{others}{note}", (title, *curves), rows)


def _without_repetition(coordinates: Sequence[Sequence[TableText]]) -> Iterator[TableText]:
    """Tables coordinate by coordinate; what is the same everywhere once, and first."""
    repeated = []
    for k, (first, *others) in enumerate(zip(*coordinates, strict=False)):
        same = all((each.columns[1:], each.rows) == (first.columns[1:], first.rows) for each in others)
        if others and same and first.rows[0][0] == _ANYWHERE:
            note = first.title.partition(";")[2]
            repeated.append(k)
            yield TableText(f"in all configurations{note and ';'}{note}", ("", *first.columns[1:]), first.rows)
    for each in coordinates:
        yield from (table for k, table in enumerate(each) if k not in repeated)

"""What to say of scores on other data than a run's own."""

import sys

from symoden.experiments import RunConfig, Source


def name_other_data(config: RunConfig, source: Source) -> None:
    """Say on standard error which columns other data name otherwise than the run, and what else differs of them.

    Columns are taken in their order, and scores have the names of the run: where an order is another one, or the
    machine is, nothing else tells.

    Args:
        config: Settings of the run.
        source: The other data, with as many positions and inputs as the run's.
    """
    if words := other_words(config, source):
        print(f"warning: {words}", file=sys.stderr)


def other_words(config: RunConfig, source: Source) -> str:
    """What to say where other data have columns of other names, or are read otherwise than the run's.

    Args:
        config: Settings of the run.
        source: The other data, with as many positions and inputs as the run's.

    Returns:
        The words; none where nothing that the run knows of its data differs.
    """
    known, given = config.data, source.dataset
    renamed = [*_pairs(known.position_names, given.position_names), *_pairs(known.input_names, given.input_names)]
    measured = zip(known.position_names, known.position_units, given.position_units, strict=True)
    units = [f"`{name}` in {_unit(other)}, not {_unit(unit)}" for name, unit, other in measured if unit != other]
    said = []
    if renamed:
        said.append(
            "columns must be those of the run, in its order, for scores stand under its names; got "
            f"{', '.join(renamed)}. Of another machine scores say how far the run's model holds for it; if only the "
            "order is another, they say nothing: give `positions` and `inputs` that of the run."
        )
    if given.hold != known.hold:
        said.append(
            f'`hold` must be what the model was trained by, "{known.hold}"; got "{given.hold}". Scores say what that '
            "costs, too: write the run's, unless inputs were held otherwise here."
        )
    if units:
        said.append(
            f"positions must be in the units of the run; got {', '.join(units)}. Unless these are the same, scores say "
            "nothing: give `units` as for the run."
        )
    return f"`{source.name}`: {' '.join(said)}" if said else ""


def _unit(unit: str) -> str:
    """A unit in words."""
    return unit or "the unit of the log"


def _pairs(known: tuple[str, ...], given: tuple[str, ...]) -> list[str]:
    """Names that differ, each for the run's."""
    return [f"`{other}` for `{name}`" for name, other in zip(known, given, strict=True) if other != name]

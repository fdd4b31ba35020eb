"""`symoden inspect`."""

from dataclasses import asdict

from symoden.experiments import Certainty, Inspection

from ._arguments import Inspect
from ._figure import check_figure, save_figure
from ._learned import Learned
from ._output import print_json, print_table
from ._tables import facts, tables
from ._words import audit_as_json, audit_words, certainty_words, name_unfinished, training_words


def run(command: Inspect) -> None:
    """Show what the model of a run learned.

    Args:
        command: What to do.
    """
    check_figure(command.figure)
    learned = Learned.of(command.run)
    name_unfinished(learned.config)
    found, certain = learned.inspect()
    split, audited = learned.audit()
    if command.figure is not None:
        save_figure(learned.draw(), command.figure)
    if command.general.json:
        audit = audit_as_json(split, audited, learned.missing)
        trained = learned.config.trained
        training = {"training": None if trained is None else asdict(trained)}
        print_json(_as_json(found, audit, _certainty_as_json(certain, learned.uncertain)) | training)
        return
    print(f"{command.run}: {learned.config.model.kind} model of {learned.config.source}, space {found.space}")
    for name, value in facts(found):
        print(f"{name}: {value}")
    for table in tables(found, certain, learned.config):
        print_table(*table)
    for heading, lines in (
        ("training", training_words(learned.config)),
        ("certainty", certainty_words(certain, learned.uncertain)),
        ("power audit", audit_words(split, audited, learned.missing)),
    ):
        if words := [f"  {line}" for line in lines]:
            print("", heading, *words, sep="\n")
    if command.figure is not None:
        print(f"\nall of it is drawn in {command.figure}")


def _certainty_as_json(found: Certainty | None, missing: str) -> dict[str, object]:
    """What a program wants to know of the bands."""
    if found is None:
        return {"unavailable": missing}
    names = (
        "level",
        "relative",
        "common_factor",
        "apart",
        "accelerations",
        "undetermined",
        "identified",
        "effective",
        "parameters",
        "windows",
        "members",
        "tried",
    )
    return {name: getattr(found, name) for name in names}


def _as_json(found: Inspection, audited: dict[str, object], certain: dict[str, object]) -> dict[str, object]:
    """The object of the command line's contract."""

    def extremes(values: tuple[float, float] | None) -> dict[str, float] | None:
        return None if values is None else {"min": values[0], "max": values[1]}

    return {
        "space": found.space,
        "position_units": found.position_units,
        "parameters": found.parameters,
        "anchor": found.anchor,
        "given": found.given,
        "identified": found.identified,
        "mass_matrix_eigenvalues": extremes(found.mass_matrix_eigenvalues),
        "dissipation_eigenvalues": extremes(found.dissipation_eigenvalues),
        "certainty": certain,
        "audit": audited,
    }

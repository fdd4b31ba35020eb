"""`symoden inspect`."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType

from symoden.evaluation import Certainty, IdentifiedJoint, Inspection, write_urdf
from symoden.experiments import read_model
from symoden.mechanics import AbstractDynamics
from symoden.models import StructuredModel
from symoden.wording import number

from ._arguments import Inspect
from ._figure import check_figure, save_figure
from ._learned import Learned
from ._output import TableText, print_json, print_table
from ._tables import facts, tables
from ._words import audit_as_json, audit_words, certainty_words, name_unfinished, training_words


def run(command: Inspect) -> None:
    """Show what the model of a run learned.

    Args:
        command: What to do.
    """
    check_figure(command.figure)
    if command.urdf is not None:
        _check_urdf(command.urdf, read_model(command.run))
    learned = Learned.of(command.run)
    name_unfinished(learned.config)
    found, certain, joints = _looked_at(learned, command.urdf)
    split, audited = learned.audit()
    if command.figure is not None:
        save_figure(learned.draw(), command.figure)
    if command.general.json:
        audit = audit_as_json(split, audited, learned.missing)
        trained = learned.config.trained
        training = {"training": None if trained is None else asdict(trained)}
        written = {} if joints is None else {"urdf": {"out": str(command.urdf), "joints": [*map(asdict, joints)]}}
        print_json(_as_json(found, audit, _certainty_as_json(certain, learned.uncertain)) | training | written)
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
    if joints is not None:
        print_table(*_robot_table(command.urdf, joints))
        print("\ndrives have no place in a URDF: a comment in the file says what they are")


def _looked_at(
    learned: Learned, urdf: Path | None
) -> tuple[Inspection, Certainty | None, tuple[IdentifiedJoint, ...] | None]:
    """What was learned, how certain that is, and the joints of the robot that is written, if one is."""
    joints = None if urdf is None else _write_robot(urdf, learned)  # At first: it may be refused.
    found, certain = learned.inspect()
    if urdf is not None and certain is not None:
        joints = _write_robot(urdf, learned, certain.identified)
    return found, certain, joints


def _check_urdf(path: Path, model: AbstractDynamics) -> None:
    """Refuse a file that nothing could be written to, before anything takes time."""
    if path.suffix.lower() != ".urdf":
        raise ValueError(f"`--urdf` must end in .urdf; got `{path}`.")
    parameters = model.parameters if isinstance(model, StructuredModel) else None
    if parameters is None or parameters.links is None:
        raise ValueError(
            '`--urdf` needs a run that was given a robot; this one was not. Train with `robot = "arm.urdf"` under '
            "[known] of the description."
        )


def _write_robot(
    path: Path, learned: Learned, bands: Mapping[str, float] = MappingProxyType({})
) -> tuple[IdentifiedJoint, ...]:
    """Write what was learned of the run's robot."""
    known = None if learned.source is None else learned.source.dataset.known
    if known is None or known.robot is None:
        raise ValueError(
            f"`--urdf` needs the robot's file, which the run's data name; they cannot be read: {learned.missing}"
        )
    return write_urdf(path, learned.model, known.robot, ranges=learned.config.data.ranges, bands=bands)


def _robot_table(path: Path | None, joints: Sequence[IdentifiedJoint]) -> TableText:
    """What was found of each joint, beside what its body weighs."""
    columns = ("joint", "drive, not in it", "damping", "dry friction", "misses of friction")
    rows = [(each.joint, each.drive, *map(number, (each.damping, each.friction, each.missed))) for each in joints]
    return TableText(f"the identified robot is in {path}: SI units; - where friction is left as it was", columns, rows)


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

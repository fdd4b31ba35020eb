"""`symoden inspect`."""

from collections.abc import Collection, Sequence
from dataclasses import asdict
from itertools import combinations_with_replacement, product

import numpy as np

from symoden.data import Dataset, Trajectory
from symoden.experiments import (
    Audit,
    Certainty,
    Inspection,
    Profile,
    RunConfig,
    audit,
    certainty,
    evaluation_solver,
    inspect_model,
    read_model,
    read_run,
    read_run_source,
)
from symoden.mechanics import AbstractDynamics
from symoden.training import infer_posterior

from ._arguments import Inspect
from ._output import number, print_json, print_table

_SMALL = 3


def run(command: Inspect) -> None:
    """Show what the model of a run learned.

    Args:
        command: What to do.
    """
    config = read_run(command.run)
    model = read_model(command.run)
    found = inspect_model(model, config.data.ranges)
    try:
        dataset, missing = read_run_source(config).dataset, ""
    except ValueError as error:
        dataset, missing = None, " ".join(str(error).split())
    audited: dict[str, object] = {"unavailable": missing}
    certain, uncertain = None, f"the run's data cannot be read: {missing}"
    if dataset is not None:
        audited = _audited(model, config, dataset)
        certain, uncertain = _certainty(model, config, dataset, found)
    if command.general.json:
        print_json(_as_json(found, audited, _certainty_as_json(certain, uncertain)))
        return
    print(f"{command.run}: {config.model.kind} model of {config.source}, space {found.space}")
    print(f"parameters: {found.parameters}")
    print(f"what fixes the scale: {found.anchor}")
    for name, how in found.given.items():
        print(f"{name}: {how}")
    if found.identified:
        rows = [
            (name, _banded(value, certain and certain.identified[name])) for name, value in found.identified.items()
        ]
        print_table("identified parameters", ("name", "value"), rows)
    for name, extremes in (("M", found.mass_matrix_eigenvalues), ("D", found.dissipation_eigenvalues)):
        where = (
            "does not apply: this kind of model has none"
            if extremes is None
            else "{} to {}".format(*map(number, extremes))
        )
        print(f"eigenvalues of {name} over the data's range: {where}")
    for i, profile in enumerate(found.profiles):
        widths = certain and certain.profiles[i]
        names = config.data.position_names, config.data.input_names
        _print_profile(profile, widths, *names, given=found.given)
    _print_friction(found, certain, config.data.position_names)
    _print_certainty(certain, uncertain)
    _print_audit(audited)


def _certainty(
    model: AbstractDynamics, config: RunConfig, dataset: Dataset, found: Inspection
) -> tuple[Certainty | None, str]:
    """Bands on what was found, or why there are none."""
    try:
        return certainty(infer_posterior(model, dataset, config.training), found), ""
    except ValueError as error:
        return None, str(error)


def _certainty_as_json(found: Certainty | None, missing: str) -> dict[str, object]:
    """What a program wants to know of the bands."""
    if found is None:
        return {"unavailable": missing}
    names = ("level", "relative", "undetermined", "identified", "effective", "parameters", "windows")
    return {name: getattr(found, name) for name in names}


def _audited(model: AbstractDynamics, config: RunConfig, dataset: Dataset) -> dict[str, object]:
    """Audit on the recordings that were not trained on."""
    split, recordings = _unseen(dataset.test, dataset.train)
    solver = evaluation_solver(config)
    result = audit(model, recordings, ranges=config.data.ranges, hold=config.data.hold, solver=solver)
    return {"split": split, **asdict(result)}


def _unseen(test: tuple[Trajectory, ...], train: tuple[Trajectory, ...]) -> tuple[str, tuple[Trajectory, ...]]:
    """The test recordings, or those of training where there are no others."""
    return ("test", test) if test else ("train", train)


def _as_json(found: Inspection, audited: dict[str, object], certain: dict[str, object]) -> dict[str, object]:
    """The object of the command line's contract."""

    def extremes(values: tuple[float, float] | None) -> dict[str, float] | None:
        return None if values is None else {"min": values[0], "max": values[1]}

    return {
        "space": found.space,
        "parameters": found.parameters,
        "anchor": found.anchor,
        "given": found.given,
        "identified": found.identified,
        "mass_matrix_eigenvalues": extremes(found.mass_matrix_eigenvalues),
        "dissipation_eigenvalues": extremes(found.dissipation_eigenvalues),
        "certainty": certain,
        "audit": audited,
    }


def _print_profile(
    profile: Profile, widths: Profile | None, positions: Sequence[str], inputs: Sequence[str], *, given: Collection[str]
) -> None:
    """Blocks along one coordinate: the energy's in one table, what acts in another."""
    name = positions[profile.coordinate]
    others = ", the other coordinates in the middle of the data" if len(positions) > 1 else ""
    at = "; D at half of the largest velocities" if profile.dissipation_matrix is not None else ""
    for columns, half, note in (
        (_energy_columns(profile), None if widths is None else _energy_columns(widths), ""),
        (
            _port_columns(profile, positions, inputs, given),
            None if widths is None else _port_columns(widths, positions, inputs, given),
            at,
        ),
    ):
        if columns:
            rows = [
                [
                    number(value),
                    *(_banded(columns[head][k], None if half is None else half[head][k]) for head in columns),
                ]
                for k, value in enumerate(profile.values)
            ]
            print_table(f"along {name}{others}{note}", [name, *columns], rows)


def _energy_columns(profile: Profile) -> dict[str, np.ndarray]:
    """Entries of M, and V, by their names."""
    columns = _entries("M", profile.mass_matrix)
    return columns if profile.potential_energy is None else columns | {"V - min V": profile.potential_energy}


def _port_columns(
    profile: Profile, positions: Sequence[str], inputs: Sequence[str], given: Collection[str]
) -> dict[str, np.ndarray]:
    """Entries of g, unless it is given, and D by their names."""
    columns: dict[str, np.ndarray] = {}
    if profile.input_matrix is not None and "input_matrix" not in given:
        pairs = product(range(len(positions)), range(len(inputs)))
        columns = {f"g[{positions[i]}, {inputs[j]}]": profile.input_matrix[:, i, j] for i, j in pairs}
    return columns | _entries("D", profile.dissipation_matrix)


def _banded(value: float, half_width: float | None) -> str:
    """A number, and half of the width of its band."""
    return number(value) if half_width is None else f"{number(value)} ± {half_width:.2g}"


def _entries(letter: str, matrices: np.ndarray | None) -> dict[str, np.ndarray]:
    """Entries of a symmetric matrix, of a large one its diagonal."""
    if matrices is None:
        return {}
    size = matrices.shape[1]
    pairs = combinations_with_replacement(range(size), 2) if size <= _SMALL else ((i, i) for i in range(size))
    return {f"{letter}[{i + 1}, {j + 1}]": matrices[:, i, j] for i, j in pairs}


def _print_friction(found: Inspection, certain: Certainty | None, positions: Sequence[str]) -> None:
    """Friction along every velocity."""
    for k, profile in enumerate(found.friction):
        i = profile.coordinate + 1
        rows = [
            [
                number(v),
                _banded(profile.coefficient[j], certain and certain.friction[k].coefficient[j]),
                _banded(profile.force[j], certain and certain.friction[k].force[j]),
            ]
            for j, v in enumerate(profile.velocities)
        ]
        title = f"friction along the velocity of {positions[profile.coordinate]}, the data's middle otherwise"
        print_table(title, ("v", f"D[{i}, {i}]", "force D v"), rows)


def _print_certainty(found: Certainty | None, missing: str) -> None:
    """How certain all this is, in words."""
    print("\ncertainty")
    if found is None:
        print(f"  no bands: {missing}")
        return
    print(
        f"  ± is half of a {found.level:.0%} band, to first order; {found.windows} windows determine "
        f"{found.effective:.0f} of {found.parameters} free parameters"
    )
    print("  typical: " + ", ".join(f"{name} ± {value:.1%}" for name, value in found.relative.items() if value))
    if found.undetermined:
        print(f"  no larger than their bands, so not told by these data: {', '.join(found.undetermined)}")


def _print_audit(audited: dict[str, object]) -> None:
    """The power audit in words."""
    print("\npower audit")
    if "unavailable" in audited:
        print(f"  not made, because the run's data cannot be read: {audited['unavailable']}")
        return
    result = Audit(**{key: value for key, value in audited.items() if key != "split"})  # pyright: ignore[reportArgumentType]
    print(f"  {result.recordings} {audited['split']} recordings; outside the range of training: {result.outside:.1%}")
    if result.diverged is None:
        print("  the balance of powers does not apply: this kind of model has no energy")
        return
    print(f"  rollouts: {result.rollouts}, of which {result.diverged} diverged")
    print(f"  largest violation of dH/dt = y'u - v'Dv along rollouts, relative: {number(result.rollout_violation)}")
    print(
        "  residual of the energy balance along recordings, relative: "
        f"median {number(result.log_residual_median)}, largest {number(result.log_residual_max)}"
    )
    print(f"  least eigenvalue of inv(M): {number(result.inverse_mass_min)}, of D: {number(result.dissipation_min)}")

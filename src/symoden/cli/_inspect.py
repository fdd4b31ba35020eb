"""`symoden inspect`."""

from collections.abc import Sequence
from dataclasses import asdict
from itertools import combinations_with_replacement, product

import numpy as np

from symoden.data import Trajectory
from symoden.experiments import (
    Audit,
    Inspection,
    Profile,
    RunConfig,
    audit,
    evaluation_solver,
    inspect_model,
    read_model,
    read_run,
    read_run_source,
)
from symoden.mechanics import AbstractDynamics

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
    audited = _audited(model, config)
    if command.general.json:
        print_json(_as_json(found, audited))
        return
    print(f"{command.run}: {config.model.kind} model of {config.source}, space {found.space}")
    print(f"parameters: {found.parameters}")
    print(f"what fixes the scale: {found.anchor}")
    for name, how in found.given.items():
        print(f"{name}: {how}")
    if found.identified:
        print_table("identified parameters", ("name", "value"), [[*item] for item in found.identified.items()])
    for name, extremes in (("M", found.mass_matrix_eigenvalues), ("D", found.dissipation_eigenvalues)):
        where = (
            "does not apply: this kind of model has none"
            if extremes is None
            else "{} to {}".format(*map(number, extremes))
        )
        print(f"eigenvalues of {name} over the data's range: {where}")
    for profile in found.profiles:
        _print_profile(profile, config.data.position_names, config.data.input_names)
    _print_friction(found, config.data.position_names)
    _print_audit(audited)


def _audited(model: AbstractDynamics, config: RunConfig) -> dict[str, object]:
    """Audit on the recordings that were not trained on; the reason where the data cannot be read."""
    try:
        source = read_run_source(config)
    except ValueError as error:
        return {"unavailable": " ".join(str(error).split())}
    split, recordings = _unseen(source.dataset.test, source.dataset.train)
    solver = evaluation_solver(config)
    result = audit(model, recordings, ranges=config.data.ranges, hold=config.data.hold, solver=solver)
    return {"split": split, **asdict(result)}


def _unseen(test: tuple[Trajectory, ...], train: tuple[Trajectory, ...]) -> tuple[str, tuple[Trajectory, ...]]:
    """The test recordings, or those of training where there are no others."""
    return ("test", test) if test else ("train", train)


def _as_json(found: Inspection, audited: dict[str, object]) -> dict[str, object]:
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
        "audit": audited,
    }


def _print_profile(profile: Profile, positions: Sequence[str], inputs: Sequence[str]) -> None:
    """Blocks along one coordinate."""
    name = positions[profile.coordinate]
    columns: dict[str, np.ndarray] = {name: profile.values}
    blocks = {"M": profile.mass_matrix, "D": profile.dissipation_matrix}
    columns |= _entries("M", blocks["M"])
    if profile.potential_energy is not None:
        columns["V - min V"] = profile.potential_energy
    if profile.input_matrix is not None:
        pairs = product(range(len(positions)), range(len(inputs)))
        columns |= {f"g[{positions[i]}, {inputs[j]}]": profile.input_matrix[:, i, j] for i, j in pairs}
    columns |= _entries("D", blocks["D"])
    if len(columns) == 1:
        return
    others = ", the other coordinates in the middle of the data" if len(positions) > 1 else ""
    at = "; D at half of the largest velocities" if blocks["D"] is not None else ""
    rows = np.stack(list(columns.values()), axis=1).tolist()
    print_table(f"along {name}{others}{at}", list(columns), rows)


def _entries(letter: str, matrices: np.ndarray | None) -> dict[str, np.ndarray]:
    """Entries of a symmetric matrix, of a large one its diagonal."""
    if matrices is None:
        return {}
    size = matrices.shape[1]
    pairs = combinations_with_replacement(range(size), 2) if size <= _SMALL else ((i, i) for i in range(size))
    return {f"{letter}[{i + 1}, {j + 1}]": matrices[:, i, j] for i, j in pairs}


def _print_friction(found: Inspection, positions: Sequence[str]) -> None:
    """Friction along every velocity."""
    for profile in found.friction:
        i = profile.coordinate + 1
        rows = np.stack([profile.velocities, profile.coefficient, profile.force], axis=1).tolist()
        title = f"friction along the velocity of {positions[profile.coordinate]}, the data's middle otherwise"
        print_table(title, ("v", f"D[{i}, {i}]", "force D v"), rows)


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

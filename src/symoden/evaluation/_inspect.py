"""What a model learned: M, V, g and D over the range of its training data."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, product
from typing import Final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.blocks import count_active, count_parameters
from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian, potential
from symoden.models import Given, StructuredModel, given_parts, parts_that_fix_the_scale
from symoden.shapes import Coordinates, Rates
from symoden.units import position_units as units_of_positions, units_of_entries

from ._ranges import Ranges

_STATES: Final = 1024
_SLOWEST: Final = 0.01  # Of the largest velocity: where friction is looked at first.
_SMALL: Final = 3  # Coordinates up to which all entries of a matrix are shown.


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """Blocks along one coordinate, the others being in the middle of the data; None where the model has no such block.

    Attributes:
        coordinate: Index of the coordinate.
        values: Its values (K,).
        mass_matrix: M.
        potential_energy: V − min V.
        input_matrix: g.
        dissipation_matrix: D at half of the largest velocities.
    """

    coordinate: int
    values: Float[np.ndarray, " K"]
    mass_matrix: Float[np.ndarray, "K n n"] | None
    potential_energy: Float[np.ndarray, " K"] | None
    input_matrix: Float[np.ndarray, "K n m"] | None
    dissipation_matrix: Float[np.ndarray, "K d d"] | None

    def energy_curves(self) -> dict[str, Float[np.ndarray, " K"]]:
        """Entries of M, and V − min V, by their names.

        Returns:
            The curves; of a large matrix the diagonal alone.
        """
        curves = _entries("M", self.mass_matrix)
        return curves if self.potential_energy is None else curves | {"V - min V": self.potential_energy}

    def port_curves(
        self,
        positions: Sequence[str],
        inputs: Sequence[str],
        given: Collection[str],
        *,
        widths: "Profile | None" = None,
    ) -> dict[str, Float[np.ndarray, " K"]]:
        """Entries of g, unless it is given, and of D, by their names.

        Args:
            positions: Names of the coordinates.
            inputs: Names of the inputs.
            given: Parts that were given.
            widths: Half widths of bands, for the same curves of these.

        Returns:
            The curves; of a large D the diagonal alone, and of a large g the entry by which each input does most.
        """
        shown, curves = widths or self, {}
        if shown.input_matrix is not None and "input_matrix" not in given:
            curves = {f"g[{positions[i]}, {inputs[j]}]": shown.input_matrix[:, i, j] for i, j in self._acting()}
        return curves | _entries("D", shown.dissipation_matrix)

    def _acting(self) -> list[tuple[int, int]]:
        """Which entries of g are shown, row by row."""
        if self.input_matrix is None or self.mass_matrix is None:
            return []
        _, n, m = self.input_matrix.shape
        if n <= _SMALL:
            return list(product(range(n), range(m)))
        # A force counts by the kinetic energy that it gives to its coordinate alone in a while.
        forces = np.abs(self.input_matrix) / np.sqrt(np.diagonal(self.mass_matrix, axis1=1, axis2=2))[:, :, None]
        return sorted((int(i), j) for j, i in enumerate(forces.mean(axis=0).argmax(axis=0)))


@dataclass(frozen=True, kw_only=True, eq=False)
class FrictionProfile:
    """Friction along one velocity, the others being zero and the coordinates in the middle of the data.

    Attributes:
        coordinate: Index of the coordinate.
        velocities: Its velocities (K,).
        coefficient: Diagonal element of D.
        force: Friction force (D v) on the coordinate.
    """

    coordinate: int
    velocities: Float[np.ndarray, " K"]
    coefficient: Float[np.ndarray, " K"]
    force: Float[np.ndarray, " K"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Inspection:
    """What a model learned.

    Attributes:
        space: Configuration space.
        position_units: What each coordinate is measured in: "rad", "m", or "" where it is as it was logged.
        parameters: Number of parameters.
        active: Number of those that do something: without corrections that were never needed.
        anchor: What fixes the scale of inertia, energy and friction.
        units: Units of M, V and D by letter, where those of the data are SI; empty where nothing fixes the scale.
        given: Parts that were given, and how much of them.
        identified: Values of the parameters of given formulas, by name.
        mass_matrix_eigenvalues: Least and largest over the data's range; None for a model without inertia.
        dissipation_eigenvalues: The same of D.
        profiles: Blocks along every coordinate.
        friction: Friction along every velocity.
        velocities: Largest velocities of states drawn from the data's range; None for a model without inertia.
        middle: Middle of the coordinates' range, which all profiles go through.
        cyclic: Indices of the coordinates that nothing depends on, by what was given.
    """

    space: str
    position_units: tuple[str, ...]
    parameters: int
    active: int
    anchor: str
    units: dict[str, str]
    given: dict[str, Given]
    identified: dict[str, float]
    mass_matrix_eigenvalues: tuple[float, float] | None
    dissipation_eigenvalues: tuple[float, float] | None
    profiles: tuple[Profile, ...]
    friction: tuple[FrictionProfile, ...]
    velocities: Float[np.ndarray, " n"] | None
    middle: Float[np.ndarray, " n"]
    cyclic: tuple[int, ...] = ()


def inspect_model(
    model: AbstractDynamics, ranges: Ranges, *, position_units: Sequence[str] = (), points: int = 5
) -> Inspection:
    """Evaluate a model's blocks over the range of its training data.

    Args:
        model: Learned model or analytic system.
        ranges: Ranges of the training data.
        position_units: What each coordinate is measured in: "rad", "m" or "" (not known); all but angles on T are not
            known if empty.
        points: Number of values along each coordinate, and of velocities in each direction at which friction is looked
            at.

    Returns:
        What it learned.
    """
    measured = units_of_positions(model.space.is_angle, position_units)
    q_low, q_high = ranges.configurations(model.space)
    low, high = np.concatenate([[q_low, q_high], np.asarray(ranges.rates).T], axis=1)
    states = np.random.default_rng(0).uniform(low, high, (_STATES, len(low)))
    q, rates = (jnp.asarray(part) for part in np.split(states, 2, axis=1))
    speeds = None
    mass = dissipation = None
    if isinstance(model, AbstractPortHamiltonian):  # The geometric baseline's network may undo any M: it tells nothing.
        inverse = np.asarray(_inverse_masses(model, q))
        v = np.einsum("kij,kj->ki", inverse, np.asarray(rates)) if model.momenta else np.asarray(rates)
        speeds = np.abs(v).max(axis=0)
        mass = _extremes(np.linalg.inv(inverse))
        dissipation = _extremes(np.asarray(_dissipations(model, q, jnp.asarray(v))))
    grids = [np.linspace(a, b, points) for a, b in zip(q_low, q_high, strict=True)]
    middle = (q_low + q_high) / 2
    return Inspection(
        space=str(model.space),
        position_units=measured,
        parameters=count_parameters(model),
        active=count_active(model),
        anchor=anchor(model),
        units=units(model, measured),
        given=given_parts(model),
        cyclic=ranges.cyclic,
        identified=identified_parameters(model),
        mass_matrix_eigenvalues=mass,
        dissipation_eigenvalues=dissipation,
        profiles=tuple(_profile(model, i, grid, middle, speeds) for i, grid in enumerate(grids)),
        friction=_friction(model, middle, speeds, points),
        velocities=speeds,
        middle=middle,
    )


def anchor(model: AbstractDynamics) -> str:
    """What fixes the scale of inertia, energy, input and friction.

    Args:
        model: Learned model or analytic system.

    Returns:
        What fixes it, in words.
    """
    if not isinstance(model, AbstractPortHamiltonian):
        return "nothing: such a model has neither inertia nor energy"
    fixed = parts_that_fix_the_scale(model)
    if fixed:
        return f"{', '.join(fixed)} given"
    if model.momenta:
        return "momenta measured"
    known = "`input_matrix`, or a mass under `[known]`" if model.inputs else "a mass under `[known]`"
    return f"none: only ratios are known; one constant that is fixes all: {known}"


def units(model: AbstractDynamics, position_units: Sequence[str]) -> dict[str, str]:
    """Units of M, V and D where those of the data are SI.

    Args:
        model: Learned model or analytic system.
        position_units: What each coordinate is measured in; what is not known counts as a length.

    Returns:
        The units by letter, one for each kind of entry; none where nothing fixes the scale, or the model has no such
        blocks.
    """
    anchored = model.momenta or parts_that_fix_the_scale(model)
    if not isinstance(model, AbstractPortHamiltonian) or not anchored:
        return {}
    M, D = (", ".join(units_of_entries(quantity, position_units)) for quantity in ("inertia", "friction"))
    return {"M": M, "V": "J", "D": D}


def identified_parameters(model: AbstractDynamics) -> dict[str, float]:
    """Values of the parameters that given formulas left open, and of rigid bodies.

    Args:
        model: Learned model.

    Returns:
        Values in physical units by name; none for a model without such formulas.
    """
    if not isinstance(model, StructuredModel) or model.parameters is None:
        return {}
    return {name: float(value) for name, value in model.parameters.quantities.items()}


def _profile(
    model: AbstractDynamics,
    coordinate: int,
    grid: Float[np.ndarray, " K"],
    middle: Float[np.ndarray, " n"],
    speeds: Float[np.ndarray, " n"] | None,
) -> Profile:
    """Blocks along one coordinate."""
    q = np.tile(middle, (len(grid), 1))
    q[:, coordinate] = grid
    at = jnp.asarray(q)
    mass = energies = inputs = dissipation = None
    if isinstance(model, AbstractPortHamiltonian) and speeds is not None:
        mass = np.linalg.inv(np.asarray(_inverse_masses(model, at)))
        energies = np.array(jax.vmap(lambda q: potential(model, q))(at))
        energies -= energies.min()
        inputs = np.asarray(jax.vmap(model.input_matrix)(at))
        dissipation = np.asarray(_dissipations(model, at, jnp.asarray(np.tile(speeds / 2, (len(grid), 1)))))
    return Profile(
        coordinate=coordinate,
        values=grid,
        mass_matrix=mass,
        potential_energy=energies,
        input_matrix=inputs,
        dissipation_matrix=dissipation,
    )


def _friction(
    model: AbstractDynamics, middle: Float[np.ndarray, " n"], speeds: Float[np.ndarray, " n"] | None, points: int
) -> tuple[FrictionProfile, ...]:
    """Friction along every velocity, in both directions."""
    if not isinstance(model, AbstractPortHamiltonian) or speeds is None:
        return ()
    n = model.space.size
    forwards = np.geomspace(_SLOWEST, 1.0, points)
    both = np.concatenate([-forwards[::-1], forwards])
    found = []
    for i in range(n):
        v = speeds[i] * both[:, None] * np.eye(n)[i]
        D = np.asarray(_dissipations(model, jnp.asarray(np.tile(middle, (len(v), 1))), jnp.asarray(v)))
        D = D[:, -n:, -n:]  # Of the full D, the part that acts on momenta.
        found.append(
            FrictionProfile(coordinate=i, velocities=v[:, i], coefficient=D[:, i, i], force=D[:, i, i] * v[:, i])
        )
    return tuple(found)


def _entries(letter: str, matrices: Float[np.ndarray, "K d d"] | None) -> dict[str, Float[np.ndarray, " K"]]:
    """Entries of a symmetric matrix, of a large one its diagonal."""
    if matrices is None:
        return {}
    size = matrices.shape[1]
    pairs = combinations_with_replacement(range(size), 2) if size <= _SMALL else ((i, i) for i in range(size))
    return {f"{letter}[{i + 1}, {j + 1}]": matrices[:, i, j] for i, j in pairs}


def _extremes(matrices: Float[np.ndarray, "K d d"]) -> tuple[float, float]:
    """Least and largest eigenvalue of symmetric matrices."""
    eigenvalues = np.linalg.eigvalsh(matrices)
    return float(eigenvalues.min()), float(eigenvalues.max())


@eqx.filter_jit
def _inverse_masses(model: AbstractPortHamiltonian, q: Float[Array, "K n"]) -> Float[Array, "K n n"]:
    """M⁻¹ at many configurations."""
    return jax.vmap(model.inverse_mass_matrix)(q)


@eqx.filter_jit
def _dissipations(
    model: AbstractPortHamiltonian, q: Float[Array, "K n"], v: Float[Array, "K n"]
) -> Float[Array, "K d d"]:
    """D at many states."""

    def one(q: Coordinates, v: Rates) -> Float[Array, "d d"]:
        return model.dissipation_matrix(q, v)

    return jax.vmap(one)(q, v)

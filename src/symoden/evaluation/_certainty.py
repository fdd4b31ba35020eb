"""How certain a model is of M, V, g and D."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractPortHamiltonian, friction_matrix, gradient, potential
from symoden.models import StructuredModel, parts_that_fix_the_scale
from symoden.shapes import Scalar
from symoden.training import AbstractPosterior, Ensemble, Laplace

from ._inspect import FrictionProfile, Inspection, Profile, identified_parameters

LEVEL: Final = 0.9
"""Probability that a band is meant to cover."""
_STEPS: Final = 61  # Of a profile along which the mean size of M is taken.


@dataclass(frozen=True, kw_only=True, eq=False)
class Certainty:
    """Half widths of 90 % bands: Laplace's to first order in the parameters, or how an ensemble scatters.

    Where nothing fixes the scale, they are those at a fixed mean of log det M: the common factor of M, V, g and D is
    then not part of them, for no data of positions and velocities tell it.

    Attributes:
        level: Probability that a band is meant to cover.
        profiles: Half widths of the blocks in the inspection's profiles.
        friction: The same of friction along every velocity.
        identified: Half widths of the parameters of given formulas.
        relative: For M, V, g and D the half width over the size of the block (its root mean square over the profiles),
            in the median along each profile, of which the root mean square is taken; none of a block that is zero.
        common_factor: Relative half width of the common factor of M, V and D (that of the mean of log det M); none
            where anything but a known g fixes it, or nothing.
        apart: As `relative` of M, V and D where that factor were known: what differs from `relative` is known of
            their ratios alone.
        accelerations: Where nothing fixes the scale, the same of M⁻¹g, M⁻¹∇V and M⁻¹Dv, "inputs", "potential" and
            "friction", which no factor changes: neither the common one, nor one of a coordinate's own, which is open
            too where no other coordinate acts on it.
        undetermined: Entries of blocks whose band is wider than what is learned is large, everywhere.
        parameters: Number of parameters that training set free, and of those of friction's direction that bands leave
            open.
        windows: Number of windows of training data.
        effective: Number of parameters that the data, rather than the prior, determine; None of an ensemble.
        members: Number of models in the ensemble; None of Laplace's approximation.
        tried: Number of models that were trained for it.
    """

    level: float
    profiles: tuple[Profile, ...]
    friction: tuple[FrictionProfile, ...]
    identified: dict[str, float]
    relative: dict[str, float]
    common_factor: float | None
    apart: dict[str, float]
    accelerations: dict[str, float]
    undetermined: tuple[str, ...]
    parameters: int
    windows: int
    effective: float | None = None
    members: int | None = None
    tried: int | None = None


class _Accelerations(NamedTuple):
    """What accelerates the coordinates at some states."""

    inputs: Float[Array, "K n m"]
    potential: Float[Array, "K n"]
    friction: Float[Array, "K n"]


class _Blocks(NamedTuple):
    """Blocks at some states."""

    mass: Float[Array, "K n n"]
    potential: Float[Array, " K"]
    inputs: Float[Array, "K n m"]
    dissipation: Float[Array, "K d d"]


def certainty(posterior: AbstractPosterior, inspection: Inspection) -> Certainty:
    """Bands on everything that an inspection shows.

    Args:
        posterior: What the data say of the model's parameters.
        inspection: What the model learned.

    Returns:
        The bands.

    Raises:
        ValueError: If the model has no M, V, g and D of its own.
    """
    model = posterior.model
    if not isinstance(model, StructuredModel) or inspection.velocities is None:
        raise ValueError("Bands need a model with M, V, g and D; this kind has none.")
    n, speeds, middle = model.space.size, inspection.velocities, inspection.middle
    profile_states = [_along(profile, middle, speeds / 2) for profile in inspection.profiles]
    # Lest the scale depend on how many values are shown.
    everywhere = [_along(profile, middle, speeds / 2, steps=_STEPS) for profile in inspection.profiles]
    friction_states = [(np.tile(middle, (len(f.velocities), 1)), _only(f, n)) for f in inspection.friction]
    lowest = [int(np.argmin(p.potential_energy)) if p.potential_energy is not None else 0 for p in inspection.profiles]
    free = not parts_that_fix_the_scale(model) and not model.momenta

    def everything(model: StructuredModel) -> tuple:
        along = [
            blocks._replace(potential=blocks.potential - blocks.potential[k])
            for blocks, k in zip((_blocks(model, *states) for states in profile_states), lowest, strict=True)
        ]
        coefficients = [_blocks(model, q, v).dissipation[:, -n + i, -n + i] for i, (q, v) in enumerate(friction_states)]
        pushed = [_accelerations(model, *states) for states in profile_states] if free else []
        named = jnp.stack([*model.parameters.quantities.values()]) if model.parameters else jnp.zeros(0)
        if free:
            factor = jnp.exp(size - _log_size(model, everywhere))
            along = [_scaled(blocks, factor) for blocks in along]
            coefficients = [factor * each for each in coefficients]
        return along, coefficients, named, pushed, jnp.zeros(()) if free else _log_size(model, everywhere)

    size = _log_size(model, everywhere) if free else jnp.zeros(())
    values, structure = jax.tree.flatten(everything(model))
    rows = posterior.project(
        lambda model: jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(everything(model))])
    )
    learned: tuple = jax.tree.unflatten(structure, [np.asarray(leaf) for leaf in values])

    def widths(rows: np.ndarray) -> tuple:
        half = posterior.quantile(LEVEL) * np.linalg.norm(rows, axis=1)
        return jax.tree.unflatten(structure, _split_like(half, values))

    found = widths(rows)
    inputs_alone = parts_that_fix_the_scale(model) == ("input_matrix",) and not model.momenta
    common = float(found[-1]) if inputs_alone else 0.0
    # What is left where the common factor, whose logarithm is the last quantity, is held fixed.
    flat = np.concatenate([np.ravel(leaf) for leaf in values])
    apart = _relative(learned[0], widths(rows - flat[:, None] * rows[-1:])[0]) if common else {}
    return Certainty(
        level=LEVEL,
        profiles=tuple(map(_as_profile, inspection.profiles, found[0])),
        friction=tuple(map(_as_friction, inspection.friction, found[1])),
        identified=dict(zip(identified_parameters(model), found[2].tolist(), strict=True)),
        relative=_relative(learned[0], found[0]),
        common_factor=common or None,
        apart={symbol: apart[symbol] for symbol in _SCALED if symbol in apart},
        accelerations=_relative(learned[3], found[3]) if free else {},
        undetermined=_undetermined(learned[0], found[0]),
        parameters=len(posterior.theta),
        windows=posterior.windows,
        effective=posterior.effective if isinstance(posterior, Laplace) else None,
        members=len(posterior.members) if isinstance(posterior, Ensemble) else None,
        tried=posterior.tried if isinstance(posterior, Ensemble) else None,
    )


def _split_like(numbers: np.ndarray, leaves: Sequence[Array]) -> list[np.ndarray]:
    """Numbers in a row, cut into arrays of these shapes."""
    ends = np.cumsum([leaf.size for leaf in leaves])[:-1]
    return [part.reshape(leaf.shape) for part, leaf in zip(np.split(numbers, ends), leaves, strict=True)]


def _log_size(model: StructuredModel, states: Sequence[tuple[np.ndarray, np.ndarray]]) -> Scalar:
    """Logarithm of the size of M over all profiles: the mean of log det M for a coordinate."""
    masses = jnp.concatenate([_blocks(model, *each).mass for each in states])
    return jnp.mean(jnp.linalg.slogdet(masses)[1]) / masses.shape[-1]


def _blocks(model: AbstractPortHamiltonian, q: np.ndarray, v: np.ndarray) -> _Blocks:
    """Blocks at some states."""

    def one(q: Array, v: Array) -> _Blocks:
        return _Blocks(
            mass=model.mass_matrix(q),
            potential=potential(model, q),
            inputs=model.input_matrix(q),
            dissipation=model.dissipation_matrix(q, v),
        )

    return jax.vmap(one)(jnp.asarray(q), jnp.asarray(v))


def _accelerations(model: AbstractPortHamiltonian, q: np.ndarray, v: np.ndarray) -> _Accelerations:
    """What accelerates the coordinates, at some states."""

    def one(q: Array, v: Array) -> _Accelerations:
        inverse = model.inverse_mass_matrix(q)
        return _Accelerations(
            inputs=inverse @ model.input_matrix(q),
            potential=inverse @ gradient(model, q),
            friction=inverse @ (friction_matrix(model, q, v) @ v),
        )

    return jax.vmap(one)(jnp.asarray(q), jnp.asarray(v))


def _scaled(blocks: _Blocks, factor: Scalar) -> _Blocks:
    """Blocks in another unit of momentum; of a full D, what acts on the coordinates scales the other way."""
    n, d = blocks.mass.shape[-1], blocks.dissipation.shape[-1]
    root = jnp.sqrt(factor) ** jnp.concatenate([-jnp.ones(d - n), jnp.ones(n)])
    return _Blocks(
        mass=factor * blocks.mass,
        potential=factor * blocks.potential,
        inputs=factor * blocks.inputs,
        dissipation=blocks.dissipation * jnp.outer(root, root)[None],
    )


def _as_profile(profile: Profile, blocks: _Blocks) -> Profile:
    """Other blocks along the same coordinate."""
    return dataclasses.replace(
        profile,
        mass_matrix=blocks.mass,
        potential_energy=blocks.potential,
        input_matrix=blocks.inputs,
        dissipation_matrix=blocks.dissipation,
    )


def _as_friction(profile: FrictionProfile, coefficient: np.ndarray) -> FrictionProfile:
    """Half widths along the same velocity, from those of the coefficient: a joint at rest has it too."""
    return dataclasses.replace(profile, coefficient=coefficient, force=coefficient * np.abs(profile.velocities))


def _along(
    profile: Profile, middle: np.ndarray, v: np.ndarray, *, steps: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """States of a profile; or of so many steps over its range."""
    values = profile.values if steps is None else np.linspace(profile.values.min(), profile.values.max(), steps)
    q = np.tile(middle, (len(values), 1))
    q[:, profile.coordinate] = values
    return q, np.tile(v, (len(q), 1))


def _only(profile: FrictionProfile, n: int) -> np.ndarray:
    """Velocities of a friction profile, the others zero."""
    v = np.zeros((len(profile.velocities), n))
    v[:, profile.coordinate] = profile.velocities
    return v


_ROUNDING: Final = 1e-9
_SCALED: Final = ("M", "V", "D")  # What has a common factor where g is known.
_SYMBOLS: Final = {"mass": "M", "potential": "V", "inputs": "g", "dissipation": "D"}


def _relative(
    learned: Sequence[_Blocks | _Accelerations], widths: Sequence[_Blocks | _Accelerations]
) -> dict[str, float]:
    """Half widths over the size of each quantity: of every profile's median the root mean square."""
    found: dict[str, float] = {}
    for i, name in enumerate(learned[0]._fields):
        symbol = _SYMBOLS.get(name, name) if isinstance(learned[0], _Blocks) else name
        values, halves = (
            [np.reshape(each[i], (len(each[i]), -1)) for each in quantities] for quantities in (learned, widths)
        )
        if not values[0].size:  # Of free motion there are no inputs.
            continue
        size = float(np.sqrt(np.mean(np.concatenate(values) ** 2)))
        # A median of all together would be that of profiles along which an energy hardly changes.
        typical = [np.median(np.sqrt(np.mean(half**2, axis=1))) for half in halves]
        width = float(np.sqrt(np.mean(np.square(typical))))
        if size > _ROUNDING * width:  # V is zero, but for rounding, where training has closed it.
            found[symbol] = width / size
    return found


def _undetermined(learned: Sequence[_Blocks], widths: Sequence[_Blocks]) -> tuple[str, ...]:
    """Entries that are nowhere larger than their band."""
    found: list[str] = []
    for name, symbol in _SYMBOLS.items():
        value, width = (np.concatenate([np.asarray(getattr(b, name)) for b in blocks]) for blocks in (learned, widths))
        below = (np.abs(value) <= width).all(axis=0) & (width > 0).any(axis=0)
        if name == "potential":
            found.extend([symbol] if below else [])
            continue
        entries = ((i, j) for i, j in np.argwhere(below) if name == "inputs" or i <= j)
        found.extend(f"{symbol}[{i + 1}, {j + 1}]" for i, j in entries)
    return tuple(found)

"""How certain a model is of M, V, g and D, and of its predictions."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import ndtri

from symoden.data import Dataset, Trajectory
from symoden.integrate import HOLDS, AbstractSolver, Hold, rollout
from symoden.mechanics import AbstractPortHamiltonian
from symoden.models import StructuredModel, parts_that_fix_the_scale
from symoden.training import Posterior

from ._batches import Segment, Stretch, in_batches
from ._evaluate import one_second_windows
from ._inspect import FrictionProfile, Inspection, Profile, identified_parameters

LEVEL: Final = 0.9  # Of every band.
_DEVIATIONS = 48  # Along which rollouts are linearised: a standard deviation from so many is 10 % right.
_BINS = 20
_BATCH = 8192  # Samples that are linearised at once.
_TINY = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Certainty:
    """Half widths of 90 % bands, to first order in the parameters.

    Where nothing fixes the scale, they are those at a fixed mean of log det M: the common factor of M, V, g and D is
    then not part of them, for no data of positions and velocities tell it.

    Attributes:
        level: Probability that a band is meant to cover.
        profiles: Half widths of the blocks in the inspection's profiles.
        friction: The same of friction along every velocity.
        identified: Half widths of the parameters of given formulas.
        relative: For M, V, g and D the half width over the size of the block (its root mean square over the profiles),
            in the median along the profiles.
        undetermined: Entries of blocks whose band is wider than what is learned is large, everywhere.
        effective: Number of parameters that the data, rather than the prior, determine.
        parameters: Number of parameters that training set free.
        windows: Number of windows of training data.
    """

    level: float
    profiles: tuple[Profile, ...]
    friction: tuple[FrictionProfile, ...]
    identified: dict[str, float]
    relative: dict[str, float]
    undetermined: tuple[str, ...]
    effective: float
    parameters: int
    windows: int


@dataclass(frozen=True, kw_only=True)
class BandScore:
    """How well the bands of predicted positions cover recordings that were not trained on.

    Attributes:
        level: Probability that a band is meant to cover.
        calibrated_on: Part that set the width of the bands: validation recordings, or training without them.
        split: Part that was looked at.
        coverage: Share of its positions that lie in their bands, over windows of 1 s.
        half_width: Median half width, in the data's units.
        from_parameters: Median share of the band's variance that comes from uncertain parameters; the rest is noise and
            what the model leaves out.
    """

    level: float
    calibrated_on: str
    split: str
    coverage: float
    half_width: float
    from_parameters: float


class _Blocks(NamedTuple):
    """Blocks at some states."""

    mass: Float[Array, "K n n"]
    potential: Float[Array, " K"]
    inputs: Float[Array, "K n m"]
    dissipation: Float[Array, "K d d"]


def certainty(posterior: Posterior, inspection: Inspection) -> Certainty:
    """Bands on everything that an inspection shows.

    Args:
        posterior: What the data say of the model's parameters.
        inspection: What the model learned.

    Returns:
        The bands.

    Raises:
        ValueError: If the model has no M, V, g and D of its own.
    """
    model = posterior.restore(jnp.asarray(posterior.theta))
    if not isinstance(model, StructuredModel) or inspection.velocities is None:
        raise ValueError("Bands need a model with M, V, g and D; this kind has none.")
    n, speeds, middle = model.space.size, inspection.velocities, inspection.middle
    profile_states = [_along(profile, middle, speeds / 2) for profile in inspection.profiles]
    friction_states = [(np.tile(middle, (len(f.velocities), 1)), _only(f, n)) for f in inspection.friction]
    lowest = [int(np.argmin(p.potential_energy)) if p.potential_energy is not None else 0 for p in inspection.profiles]
    free = not parts_that_fix_the_scale(model) and not model.momenta

    def everything(model: StructuredModel) -> tuple:
        along = [
            blocks._replace(potential=blocks.potential - blocks.potential[k])
            for blocks, k in zip((_blocks(model, *states) for states in profile_states), lowest, strict=True)
        ]
        forces = [
            _blocks(model, q, v).dissipation[:, -n + i, -n + i] * v[:, i] for i, (q, v) in enumerate(friction_states)
        ]
        named = jnp.zeros(0) if model.parameters is None else model.parameters.values
        if free:
            masses = jnp.concatenate([blocks.mass for blocks in along])
            factor = jnp.exp(-jnp.mean(jnp.linalg.slogdet(masses)[1]) / n)
            factor = factor / jax.lax.stop_gradient(factor)
            along, forces = jax.tree.map(lambda x: factor * x, (along, forces))
        return along, forces, named

    values, structure = jax.tree.flatten(everything(model))
    rows = posterior.project(
        lambda model: jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(everything(model))])
    )
    half = float(ndtri((1 + LEVEL) / 2)) * np.linalg.norm(rows, axis=1)
    ends = np.cumsum([leaf.size for leaf in values])[:-1]
    widths = [part.reshape(leaf.shape) for part, leaf in zip(np.split(half, ends), values, strict=True)]
    learned: tuple = jax.tree.unflatten(structure, [np.asarray(leaf) for leaf in values])
    found: tuple = jax.tree.unflatten(structure, widths)
    return Certainty(
        level=LEVEL,
        profiles=tuple(map(_as_profile, inspection.profiles, found[0])),
        friction=tuple(map(_as_friction, inspection.friction, found[1])),
        identified=dict(zip(identified_parameters(model), found[2].tolist(), strict=True)),
        relative=_relative(learned[0], found[0]),
        undetermined=_undetermined(learned[0], found[0]),
        effective=posterior.effective,
        parameters=len(posterior.theta),
        windows=posterior.windows,
    )


def score_bands(posterior: Posterior, dataset: Dataset, *, solver: AbstractSolver, split: str = "test") -> BandScore:
    """Predict with bands, and see how many measured positions they cover.

    The variance of a predicted position is that of the uncertain parameters, to first order, and the mean squared error
    on the training recordings so long after the start. A common factor makes the bands cover as much of the validation
    recordings as they should (split conformal prediction); without any, it is 1.

    Args:
        posterior: What the data say of the model's parameters.
        dataset: Recordings, with the validation part that training held out.
        solver: What advances rollouts.
        split: Part to look at.

    Returns:
        The score.

    Raises:
        ValueError: If that part or the training part is empty.
    """
    parts = {name: _windows_of(getattr(dataset, name)) for name in ("train", "validation", split)}
    if not parts[split] or not parts["train"]:
        raise ValueError(f"Bands need recordings in the parts `train` and `{split}`; there are none.")
    deviations = posterior.deviations(_DEVIATIONS)
    errors = {
        name: _errors(posterior, deviations, windows, HOLDS[dataset.hold], solver) for name, windows in parts.items()
    }
    common = _by_elapsed(errors["train"])
    calibration = "validation" if parts["validation"] else "train"
    scaled = {name: np.abs(e.error) / np.sqrt(e.variance + common(e.elapsed)) for name, e in errors.items()}
    factor = float(np.quantile(scaled[calibration], LEVEL)) if parts["validation"] else float(ndtri((1 + LEVEL) / 2))
    judged = errors[split]
    variance = judged.variance + common(judged.elapsed)
    return BandScore(
        level=LEVEL,
        calibrated_on=calibration,
        split=split,
        coverage=float(np.mean(scaled[split] <= factor)),
        half_width=float(np.median(factor * np.sqrt(variance))),
        from_parameters=float(np.median(judged.variance / variance)),
    )


class _Errors(NamedTuple):
    """Errors of predicted positions, sample after sample."""

    elapsed: Float[np.ndarray, " N"]
    error: Float[np.ndarray, "N n"]
    variance: Float[np.ndarray, "N n"]


def _windows_of(recordings: Sequence[Trajectory]) -> list[Stretch]:
    """Windows of 1 s; a recording that is shorter, such as a held-out end, is one window."""
    return [
        Stretch(trajectory=recording, start=start, stop=stop)
        for recording in recordings
        for start, stop in one_second_windows(recording) or [(0, len(recording))]
    ]


def _errors(
    posterior: Posterior, deviations: tuple, stretches: Sequence[Stretch], hold: Hold, solver: AbstractSolver
) -> _Errors:
    """Errors over windows, and the variance that uncertain parameters explain."""
    found: list[_Errors] = []
    function = eqx.Partial(_predicted, posterior.restore, *deviations, solver, hold)
    for i, (q, variance) in in_batches(function, stretches, samples=_BATCH):
        stretch = stretches[i]
        ts = stretch.trajectory.ts[stretch.start : stretch.stop]
        error = (q[: len(stretch)] - stretch.q)[1:]
        finite = np.isfinite(error).all(axis=1) & np.isfinite(variance[1 : len(stretch)]).all(axis=1)
        found.append(_Errors((ts - ts[0])[1:][finite], error[finite], variance[1 : len(stretch)][finite]))
    if not found:
        empty = np.zeros((0, 1))
        return _Errors(empty[:, 0], empty, empty)
    return _Errors(*(np.concatenate(column) for column in zip(*found, strict=True)))


@eqx.filter_jit
def _predicted(
    restore: eqx.Module,
    theta: Float[Array, " P"],
    deviations: Float[Array, "k P"],
    solver: AbstractSolver,
    hold: Hold,
    batch: Segment,
) -> tuple[Float[Array, "B T n"], Float[Array, "B T n"]]:
    """Positions, and their variance to first order in the parameters."""

    def one(segment: Segment) -> tuple[Array, Array]:
        def positions(theta: Float[Array, " P"]) -> Float[Array, "T n"]:
            model = restore(theta)  # pyright: ignore[reportCallIssue]
            return rollout(model, segment.q[0], segment.rates[0], segment.ts, segment.us, solver=solver, hold=hold).q

        q, push = jax.linearize(positions, theta)
        return q, jnp.mean(jax.vmap(push)(deviations) ** 2, axis=0)

    return jax.vmap(one)(batch)


def _by_elapsed(errors: _Errors):  # noqa: ANN202 - a function of times
    """Mean squared error of each coordinate as a function of the time since the start."""
    last = float(errors.elapsed.max())
    edges = np.linspace(0.0, last, _BINS + 1)
    which = np.clip(np.digitize(errors.elapsed, edges) - 1, 0, _BINS - 1)
    filled = [k for k in range(_BINS) if np.any(which == k)]
    means = np.array([np.mean(errors.error[which == k] ** 2, axis=0) for k in filled])
    centres = (edges[:-1] + edges[1:])[filled] / 2

    def at(elapsed: Float[np.ndarray, " N"]) -> Float[np.ndarray, "N n"]:
        return np.stack([np.interp(elapsed, centres, column) for column in means.T], axis=1) + _TINY**2

    return at


def _blocks(model: AbstractPortHamiltonian, q: np.ndarray, v: np.ndarray) -> _Blocks:
    """Blocks at some states."""

    def one(q: Array, v: Array) -> _Blocks:
        return _Blocks(
            mass=jnp.linalg.inv(model.inverse_mass_matrix(q)),
            potential=model.hamiltonian(q, jnp.zeros_like(q)),
            inputs=model.input_matrix(q),
            dissipation=model.dissipation_matrix(q, v),
        )

    return jax.vmap(one)(jnp.asarray(q), jnp.asarray(v))


def _as_profile(profile: Profile, blocks: _Blocks) -> Profile:
    """Other blocks along the same coordinate."""
    return dataclasses.replace(
        profile,
        mass_matrix=blocks.mass,
        potential_energy=blocks.potential,
        input_matrix=blocks.inputs,
        dissipation_matrix=blocks.dissipation,
    )


def _as_friction(profile: FrictionProfile, force: np.ndarray) -> FrictionProfile:
    """Another force along the same velocity."""
    return dataclasses.replace(profile, coefficient=force / np.abs(profile.velocities), force=force)


def _along(profile: Profile, middle: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States of a profile."""
    q = np.tile(middle, (len(profile.values), 1))
    q[:, profile.coordinate] = profile.values
    return q, np.tile(v, (len(q), 1))


def _only(profile: FrictionProfile, n: int) -> np.ndarray:
    """Velocities of a friction profile, the others zero."""
    v = np.zeros((len(profile.velocities), n))
    v[:, profile.coordinate] = profile.velocities
    return v


_SYMBOLS: Final = {"mass": "M", "potential": "V", "inputs": "g", "dissipation": "D"}


def _relative(learned: Sequence[_Blocks], widths: Sequence[_Blocks]) -> dict[str, float]:
    """Half widths over the size of each block, in the median along the profiles."""
    found: dict[str, float] = {}
    for name, symbol in _SYMBOLS.items():
        value, width = (
            np.concatenate([np.reshape(getattr(b, name), (len(b.mass), -1)) for b in blocks])
            for blocks in (learned, widths)
        )
        size = float(np.sqrt(np.mean(value**2))) if value.size else 0.0
        if size:
            found[symbol] = float(np.median(np.sqrt(np.mean(width**2, axis=1)))) / size
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

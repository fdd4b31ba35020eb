"""What training begins with where M and V are given: inputs, drives and friction that a regression finds by itself."""

import dataclasses
import itertools
from collections.abc import Callable
from typing import Final, NamedTuple, TypeGuard

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import lsq_linear

from symoden.blocks import (
    FRICTION,
    AbstractFriction,
    AbstractFunction,
    CholeskyBlock,
    Constant,
    Correction,
    JointFriction,
    Known,
    KnownFriction,
    Links,
    MatrixBlock,
    NoFriction,
    Reduced,
    Sum,
    ViscousFriction,
)
from symoden.mechanics import AbstractDynamics
from symoden.models import StructuredModel, energies_are_given, given_parts, parts_that_fix_the_scale, rescale
from symoden.shapes import Coordinates, DissipationMatrix, Velocities

from ._data import Data
from ._gauss_newton import linearize
from ._objective import Batch
from ._verdicts import CHANCE, compare

_KNEE: Final = 0.03  # Of the typical velocity: about where dry friction sets in.
_RIDGE: Final = 1e-3  # Beside what each number is known to: what nothing tells is zero.
_STEPS: Final = 20
_HALVINGS: Final = 6
_SETTLED: Final = 1e-3  # Relative decrease of the loss.
_SMALLEST_DRIVE: Final = 0.01  # Of the inertia that it begins with.
_USUAL_DRIVE: Final = 30.0  # The same, one standard deviation: gears make large ones of small rotors.
_LEAST_FRICTION: Final = 1e-3  # In natural units; a square of zero would have no slope.
_WINDOWS: Final = 16  # At a time.


class FirstGuess(NamedTuple):
    """Numbers to begin with, in physical units; None for what is given, or not of that kind.

    Attributes:
        inputs: A constant g.
        drives: Inertia of each body's drive.
        viscous: Viscous friction of each coordinate.
        dry: Dry friction of each; None where validation does not ask for it.
    """

    inputs: Float[np.ndarray, "n m"] | None = None
    drives: Float[np.ndarray, " n"] | None = None
    viscous: Float[np.ndarray, " n"] | None = None
    dry: Float[np.ndarray, " n"] | None = None


def can_be_guessed(model: StructuredModel) -> bool:
    """Whether M and V are given, up to something, and inputs or the drives of a robot are not.

    Args:
        model: An untrained model.

    Returns:
        Whether it is so.
    """
    return not model.momenta and energies_are_given(model) and (_learns_inputs(model) or _links(model) is not None)


def silent(step: int, steps: int, loss: float) -> None:
    """Report nothing."""
    del step, steps, loss


def guess(model: StructuredModel, data: Data, progress: Callable[[int, int, float], None] = silent) -> FirstGuess:
    """Find the g, drives and friction that explain the recordings best with M and V as they are given.

    In weak form the equations of motion are linear in all of these, but for the inertia that makes a velocity of an
    impulse. From zero, Gauss-Newton takes a handful of steps. Where nothing fixes the unit of inertia, energy and force
    (currents for inputs), it becomes that of the links' weights in the file that describes them.

    Args:
        model: Model that `can_be_guessed`, in double precision.
        data: Windows for the weak form.
        progress: Called after every step with how many there have been, how many there are at most, and the loss.

    Returns:
        The numbers.
    """
    taken = itertools.count(1)

    def report(loss: float) -> None:
        progress(next(taken), 4 * _STEPS, loss)  # Without and with dry friction, each with drives as they are and free.

    plain = _solved(_Unknowns(model, dry=False), data, report)
    if plain.viscous is None or not _has_laws(model.friction):
        return plain
    dry = _solved(_Unknowns(model, dry=True), data, report)
    one, other = (_driven(begin_with(model, found), found) for found in (dry, plain))
    return dry if compare(data, one, other, data.objective) < -CHANCE else plain


def as_heavy(model: AbstractDynamics, begun: AbstractDynamics, q: Float[np.ndarray, "k n"]) -> AbstractDynamics:
    """Give a robot's weights their unit where nothing else does: V is as steep on the whole as it was in the file.

    Drives, which are part of M, are often in none.

    Args:
        model: A learned model.
        begun: The model that training began with.
        q: Configurations.

    Returns:
        The equivalent model; itself where it is no robot, its scale is known, or it weighs nothing.
    """
    if not isinstance(model, StructuredModel) or not isinstance(begun, StructuredModel) or _links(model) is None:
        return model
    fixed = {"input_matrix", "dissipation_matrix"} & set(given_parts(model))  # Nearly right ones, too.
    if model.momenta or fixed or parts_that_fix_the_scale(model):
        return model
    learned, first = (float(_steepness(each, jnp.asarray(q, float))) for each in (model, begun))
    factor = learned / first if first > 0 else 0.0
    return rescale(model, factor) if np.isfinite(factor) and factor > 0 else model


@eqx.filter_jit
def _steepness(model: StructuredModel, q: Float[Array, "k n"]) -> Float[Array, ""]:
    """Root mean square of V's slope."""
    return jnp.sqrt(jnp.mean(jax.vmap(jax.grad(model.potential_energy))(q) ** 2))


def begin_with(model: StructuredModel, found: FirstGuess) -> StructuredModel:
    """Let a model begin with the inputs and the friction that were found.

    Args:
        model: Model that `can_be_guessed`, its robot's drives as they were found.
        found: The numbers.

    Returns:
        The model.
    """
    if found.inputs is not None and isinstance(model.actuation, MatrixBlock):
        entries = (found.inputs / np.asarray(model.actuation.scale.array)).ravel()
        block = dataclasses.replace(model.actuation, function=_started(model.actuation.function, entries))
        model = dataclasses.replace(model, actuation=block)
    if found.viscous is not None:
        model = dataclasses.replace(model, friction=_braked(model.friction, found.viscous, found.dry))
    return model


class _Unknowns:
    """What is looked for, as one vector: g, viscous and dry friction, and how much larger drives are."""

    def __init__(self, model: StructuredModel, *, dry: bool) -> None:
        """Lay it out.

        Args:
            model: The model.
            dry: Whether to look for dry friction.
        """
        self._model, self._links = model, _links(model)
        n, entries = model.space.size, model.space.size * model.inputs
        rubs = "dissipation_matrix" not in given_parts(model) and not isinstance(model.friction, NoFriction)
        counts = entries * _learns_inputs(model), n * rubs, n * (rubs and dry), n * (self._links is not None)
        self._ends = np.cumsum(counts)[:-1]
        self.least = np.repeat([-np.inf, 0.0, 0.0, _SMALLEST_DRIVE - 1], counts)
        self.drives = counts[-1]

    def model(self, x: Float[Array, " k"]) -> StructuredModel:
        """The model with these numbers."""
        inputs, viscous, dry, larger = jnp.split(x, self._ends)
        model = self._model
        if inputs.size:
            one = Known.of(np.ones((model.space.size, model.inputs)))
            model = dataclasses.replace(model, actuation=MatrixBlock(Constant(inputs), one))
        if viscous.size:

            def friction(q: Coordinates, v: Velocities) -> DissipationMatrix:
                del q
                return jnp.diag(viscous + dry / jnp.sqrt(v**2 + _knee(self._model.friction)[1] ** 2))

            def smooth(q: Coordinates, v: Velocities) -> DissipationMatrix:
                del q, v
                return jnp.diag(viscous)

            model = dataclasses.replace(model, friction=KnownFriction(friction if dry.size else smooth))
        if self._links is not None:
            logarithms = self._links.theta.at[:, -1].set(jnp.log1p(larger))
            model = _linked(model, dataclasses.replace(self._links, theta=logarithms))
        return model

    def found(self, x: Float[np.ndarray, " k"]) -> FirstGuess:
        """The numbers in physical units."""
        inputs, viscous, dry, larger = np.split(x, self._ends)
        return FirstGuess(
            inputs=inputs.reshape(self._model.space.size, -1) if inputs.size else None,
            drives=None if self._links is None else np.asarray(self._links.rotors.array) * (1 + larger),
            viscous=viscous if viscous.size else None,
            dry=dry if dry.size else None,
        )


def _solved(unknowns: _Unknowns, data: Data, report: Callable[[float], None]) -> FirstGuess:
    """Gauss-Newton within the bounds, first with drives as they are: without any force nothing tells of an inertia."""
    linear = _linearization(unknowns.model, data)
    size = len(unknowns.least)
    x = np.zeros(size)
    for free in dict.fromkeys((size - unknowns.drives, size)):  # Once where there are none.
        if free:
            x = _descended(linear, x, unknowns.least, report, free=free, drives=unknowns.drives)
    return unknowns.found(x)


def _descended(
    linear: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    x: Float[np.ndarray, " k"],
    least: Float[np.ndarray, " k"],
    report: Callable[[float], None],
    *,
    free: int,
    drives: int,
) -> Float[np.ndarray, " k"]:
    """Steps as long as the first `free` numbers fit better by them; the last ones, drives, have a prior about zero.

    Where nothing but a drive holds a joint, its inertia, inputs and friction are known up to a factor, which the prior
    alone keeps.

    Returns:
        The numbers.
    """
    r, J = linear(x)
    variance = float(np.mean(r**2))
    prior = np.zeros(len(x))
    for _ in range(_STEPS):
        columns = J[:, :free]
        size = np.linalg.norm(columns, axis=0)
        size = np.where(size > 0, size, 1.0)
        size[len(x) - drives :] = 1.0
        weights = np.full(free, _RIDGE)
        weights[len(x) - drives :] = prior[len(x) - drives : free] = np.sqrt(variance) / _USUAL_DRIVE
        rows = np.concatenate([columns / size, np.diag(weights)])
        ahead = np.concatenate([columns @ x[:free] - r, np.zeros(free)])
        step = np.zeros(len(x))
        step[:free] = lsq_linear(rows, ahead, bounds=(least[:free] * size, np.inf)).x / size - x[:free]
        before = float(np.sum(r**2) + np.sum((prior * x) ** 2))
        for _ in range(_HALVINGS):
            residuals, jacobian = linear(x + step)
            after = float(np.sum(residuals**2) + np.sum((prior * (x + step)) ** 2))
            if after < before:
                break
            step = step / 2
        else:
            return x
        x, r, J, variance = x + step, residuals, jacobian, float(np.mean(residuals**2))
        report(variance)
        if after > (1 - _SETTLED) * before:
            break
    return x


def _linearization(
    restore: Callable[[Float[Array, " k"]], StructuredModel], data: Data
) -> Callable[[np.ndarray], tuple[Float[np.ndarray, " r"], Float[np.ndarray, "r k"]]]:
    """Residuals of all windows, and their derivatives."""

    @jax.jit
    def compiled(x: Float[Array, " k"], windows: Batch) -> tuple[Array, Array]:
        return jax.lax.map(lambda window: linearize(restore, x, data.objective, window), windows, batch_size=_WINDOWS)

    def linear(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        residuals, jacobians = compiled(jnp.asarray(x), data.train)
        return np.asarray(residuals, float).ravel(), np.asarray(jacobians, float).reshape(-1, len(x))

    return linear


def _learns_inputs(model: StructuredModel) -> bool:
    """Whether there is a g to learn that is constant at first."""
    return model.inputs > 0 and isinstance(model.actuation, MatrixBlock) and _is_constant(model.actuation.function)


def _links(model: StructuredModel) -> Links | None:
    """Rigid bodies of a model, if it has any."""
    return None if model.parameters is None else model.parameters.links


def _linked(model: StructuredModel, links: Links) -> StructuredModel:
    """The same model with other rigid bodies in the place of its own."""
    return eqx.tree_at(_links, model, links)


def _driven(model: StructuredModel, found: FirstGuess) -> StructuredModel:
    """The same model with the drives that were found."""
    links = _links(model)
    if links is None or found.drives is None:
        return model
    return _linked(model, dataclasses.replace(links, rotors=Known.of(found.drives)))


def _is_constant(function: AbstractFunction) -> bool:
    """Whether a function is a constant, but for what may be added."""
    if isinstance(function, Reduced):
        return _is_constant(function.function)
    return isinstance(function.terms[0] if isinstance(function, Sum) else function, Constant)


def _started(function: AbstractFunction, values: Float[np.ndarray, " k"]) -> AbstractFunction:
    """The same function from another constant on."""
    if isinstance(function, Reduced):
        return dataclasses.replace(function, function=_started(function.function, values))
    constant = Constant(jnp.asarray(values, float))
    return Sum((constant, *function.terms[1:])) if isinstance(function, Sum) else constant


def _has_laws(friction: AbstractFriction) -> TypeGuard[JointFriction]:
    """Whether joints may have dry friction."""
    return isinstance(friction, JointFriction) and isinstance(friction.laws, Correction)


def _knee(friction: AbstractFriction) -> tuple[int, Float[np.ndarray, " n"]]:
    """The law of dry friction to begin with, and the velocities below which it is smooth."""
    if not _has_laws(friction):
        raise TypeError(f"Dry friction must be a law of joints; got {type(friction).__name__}.")
    k = int(np.argmin(np.abs(np.log(np.array(friction.knees) / _KNEE))))
    return k, friction.knees[k] * np.asarray(friction.speed.array, float)


def _braked(
    friction: AbstractFriction, viscous: Float[np.ndarray, " n"], dry: Float[np.ndarray, " n"] | None
) -> AbstractFriction:
    """The same friction from these coefficients on."""
    match friction:
        case JointFriction(viscous=function, scale=scale):
            if _is_constant(function):
                friction = dataclasses.replace(friction, viscous=_started(function, _triangle(viscous, scale)))
            if dry is not None:
                k, knee = _knee(friction)
                laws = np.zeros((len(dry), JointFriction.shapes(friction.knees)))
                laws[:, k] = dry / knee / np.asarray(scale.array, float) ** 2
                constant = Constant(jnp.asarray(laws.ravel(), float))
                friction = dataclasses.replace(friction, laws=Correction(constant, kind=FRICTION))
            return friction
        case ViscousFriction(matrix=CholeskyBlock(function=function, scale=scale) as matrix) if _is_constant(function):
            started = dataclasses.replace(matrix, function=_started(function, _triangle(viscous, scale)))
            return ViscousFriction(started)
    return friction


def _triangle(viscous: Float[np.ndarray, " n"], scale: Known) -> Float[np.ndarray, " k"]:
    """Entries of the lower triangle of a diagonal matrix, row by row."""
    natural = np.maximum(viscous / np.asarray(scale.array, float) ** 2, _LEAST_FRICTION)
    return np.diag(np.sqrt(natural))[np.tril_indices(len(natural))]

"""A learned model beside the system that made its data: blocks in one gauge, rollouts, errors."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from numpy.typing import ArrayLike

from symoden.blocks import KnownValue
from symoden.data import Trajectory
from symoden.evaluation import Prediction, Ranges, predict
from symoden.integrate import AbstractSolver
from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian, friction_matrix, potential
from symoden.models import StructuredModel, UnstructuredModel
from symoden.shapes import Coordinates, Velocities
from symoden.spaces import Space
from symoden.units import titled, units_of_entries

from ._paper import PaperErrors
from ._score_task import TaskScore
from ._simulate import simulate
from ._sources import Source
from ._tasks import Task

_MOST_STATES = 2000


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockCurves:
    """Entries of one block along a coordinate, learned and true.

    Attributes:
        symbol: The paper's letter.
        unit: Unit of the entries.
        entries: Name of each entry.
        coordinate: Name and unit of the coordinate.
        values: Its values.
        truth: True entries.
        learned: Learned entries, in the truth's gauge.
        visited: Least and largest of the values that the training data visited.
        error: Largest deviation over the visited values, relative to the largest true entry; infinite where the truth
            is zero and the learned block is not.
    """

    symbol: str
    unit: str
    entries: tuple[str, ...]
    coordinate: str
    values: Float[np.ndarray, " K"]
    truth: Float[np.ndarray, "K k"]
    learned: Float[np.ndarray, "K k"]
    visited: tuple[float, float]
    error: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Portrait:
    """Blocks M⁻¹, V, g and D along one coordinate, the others being in the middle of the data.

    Attributes:
        blocks: Curves of each block; V up to a constant, D at the root mean square of each velocity.
        gauge: β = true g / learned g, the learned model being `rescale(truth, β)`; already taken out of the blocks, as
            `rescale(model, 1 / gauge)` does.
        anchored: Whether the data fix the scale, so that β is 1 and was not fitted.
    """

    blocks: tuple[BlockCurves, ...]
    gauge: float
    anchored: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class RolloutComparison:
    """Rollouts of a model beside the truth, from initial conditions that it never saw.

    Attributes:
        coordinate: Name and unit of the coordinate to show.
        index: Its index.
        labels: What each trajectory was driven by.
        truth: True trajectories.
        predictions: The model's.
        trained: How long the training trajectories last [s].
    """

    coordinate: str
    index: int
    labels: tuple[str, ...]
    truth: tuple[Trajectory, ...]
    predictions: tuple[Prediction, ...]
    trained: float


@dataclass(frozen=True, kw_only=True)
class ErrorComparison:
    """Errors of a model on a task beside the paper's.

    Attributes:
        task: Name of the task.
        ours: Errors of the model.
        paper: Errors of the same kind of model in the paper, if it has them.
    """

    task: str
    ours: TaskScore
    paper: PaperErrors | None


class _Blocks(NamedTuple):
    """Blocks at one state, or at many."""

    inverse_mass: Float[Array, "*K n n"]
    potential: Float[Array, "*K"]
    input_matrix: Float[Array, "*K n m"]
    dissipation: Float[Array, "*K n n"]


class _Axis(NamedTuple):
    """The coordinate along which blocks are compared."""

    name: str
    values: Float[np.ndarray, " K"]
    visited: tuple[float, float]
    inside: Bool[np.ndarray, " K"]


def portrait(
    model: AbstractDynamics, source: Source, *, coordinate: int = 0, points: int = 129, beyond: float = 0.0
) -> Portrait:
    """Compare a model's blocks with those of the system that made its data.

    Args:
        model: Learned port-Hamiltonian model.
        source: The task that it learned.
        coordinate: Index of the coordinate along which to compare, over the range that the training data visited; of
            an angle that they turned round, one turn.
        points: Number of values along it.
        beyond: How much farther to look on both sides, as a share of the visited range; nothing is beyond one turn.

    Returns:
        Learned and true blocks in the truth's gauge.

    Raises:
        ValueError: If the source is no task, or the model has no such blocks.
    """
    task = _task(source)
    if not isinstance(model, AbstractPortHamiltonian):
        raise ValueError(
            f"A portrait shows M⁻¹, V, g and D; a {type(model).__name__} has not all of them. Choose another model."
        )
    truth, train = task.system, source.dataset.train
    q, v = _states(truth, train)
    anchored = model.momenta or _knows_inputs(model)
    gauge = 1.0 if anchored else fit_gauge(model, truth, q, v)
    low, high = Ranges.of(train, model.space).configurations(model.space)
    along = np.tile((low + high) / 2, (points, 1))
    visited = (float(low[coordinate]), float(high[coordinate]))
    all_round = model.space.is_angle[coordinate] and visited == (-np.pi, np.pi)
    farther = 0.0 if all_round else beyond * (visited[1] - visited[0])
    along[:, coordinate] = np.linspace(visited[0] - farther, visited[1] + farther, points)
    speeds = np.tile(np.sqrt(np.mean(v**2, axis=0)), (points, 1))
    true, learned = _evaluate(truth, along, speeds), _regauged(_evaluate(model, along, speeds), gauge)
    inside = (along[:, coordinate] >= visited[0]) & (along[:, coordinate] <= visited[1])
    true = true._replace(potential=true.potential - np.min(true.potential))
    offset = np.mean(true.potential[inside]) - np.mean(learned.potential[inside])
    learned = learned._replace(potential=learned.potential + offset)
    axis = _Axis(name=coordinate_title(task, coordinate), values=along[:, coordinate], visited=visited, inside=inside)
    pairs = zip(("M⁻¹", "V", "g", "D"), _units(truth.space), true, learned, strict=True)
    blocks = tuple(_curves(symbol, unit, axis, pair) for symbol, unit, *pair in pairs)
    return Portrait(blocks=blocks, gauge=gauge, anchored=anchored)


def fit_gauge(
    model: AbstractPortHamiltonian,
    truth: AbstractPortHamiltonian,
    q: Float[np.ndarray, "K n"],
    v: Float[np.ndarray, "K n"],
) -> float:
    """Find the β of the symmetry p → p/β, under which M⁻¹ → β M⁻¹ and (V, g, D) → (V, g, D)/β, by least squares.

    Friction has no say, so that an error in it stays visible as one.

    Args:
        model: Learned model.
        truth: System to compare with.
        q: Configurations at which M⁻¹, g and, up to a constant, V are compared.
        v: Velocities there.

    Returns:
        The least squares estimate; exact if the model is `rescale(truth, β)`.
    """
    true, learned = _evaluate(truth, q, v), _evaluate(model, q, v)
    pairs = (
        (learned.inverse_mass, true.inverse_mass),
        (true.potential - np.mean(true.potential), learned.potential - np.mean(learned.potential)),
        (true.input_matrix, learned.input_matrix),
    )
    # Each block asks for a = β b; weighed by its size, so that units do not matter.
    weighed = [(np.sum(a * b) / np.sum(a**2), np.sum(b**2) / np.sum(a**2)) for a, b in pairs if np.any(a)]
    products, squares = np.sum(weighed, axis=0)
    return float(products / squares)


def unseen_rollouts(
    model: AbstractDynamics, source: Source, *, solver: AbstractSolver, count: int = 5, coordinate: int = 0
) -> RolloutComparison:
    """Roll out a model from test initial conditions, each under another input, for as long as prediction is measured.

    Args:
        model: Learned model or analytic system.
        source: The task that it learned.
        solver: What advances rollouts.
        count: Number of trajectories.
        coordinate: Index of the coordinate to show.

    Returns:
        Rollouts beside the truth.
    """
    task = _task(source)
    longer = dataclasses.replace(task, points=max(task.points, task.prediction_points))
    tests = simulate(longer, seed=source.seed, train_initials=1, test_initials=count).dataset.test
    inputs = len(task.input_values)
    chosen = tuple(tests[(i % inputs) * count + i] for i in range(count))
    return RolloutComparison(
        coordinate=coordinate_title(task, coordinate),
        index=coordinate,
        labels=tuple(_driven(task, trajectory) for trajectory in chosen),
        truth=chosen,
        predictions=tuple(predict(model, chosen, hold=source.dataset.hold, solver=solver)),
        trained=(task.points - 1) * task.dt,
    )


def _task(source: Source) -> Task:
    """The task, whose truth is known."""
    if source.task is None:
        raise ValueError(f"Only a task has a truth to compare with; got the data set `{source.name}`.")
    return source.task


def _knows_inputs(model: AbstractPortHamiltonian) -> bool:
    """Whether g was given."""
    return isinstance(model, StructuredModel | UnstructuredModel) and isinstance(model.actuation, KnownValue)


def _states(truth: AbstractPortHamiltonian, trajectories: Sequence[Trajectory]) -> tuple[np.ndarray, np.ndarray]:
    """Measured configurations and velocities, at most so many."""
    q = np.concatenate([trajectory.q for trajectory in trajectories])
    rates = np.concatenate([trajectory.rates for trajectory in trajectories])
    every = -(-len(q) // _MOST_STATES)
    q, rates = q[::every], rates[::every]
    return q, np.asarray(_velocities(truth, jnp.asarray(q), jnp.asarray(rates))) if truth.momenta else rates


@eqx.filter_jit
def _velocities(system: AbstractPortHamiltonian, q: Float[Array, "K n"], p: Float[Array, "K n"]) -> Float[Array, "K n"]:
    """Velocities of measured momenta."""
    return jax.vmap(lambda q, p: system.inverse_mass_matrix(q) @ p)(q, p)


def _evaluate(system: AbstractPortHamiltonian, q: Float[np.ndarray, "K n"], v: Float[np.ndarray, "K n"]) -> _Blocks:
    """Blocks of a system at many states, as NumPy arrays."""
    return jax.tree.map(np.asarray, _at(system, jnp.asarray(q), jnp.asarray(v)))


@eqx.filter_jit
def _at(system: AbstractPortHamiltonian, q: Float[Array, "K n"], v: Float[Array, "K n"]) -> _Blocks:
    """Blocks of a system at many states."""

    def one(q: Coordinates, v: Velocities) -> _Blocks:
        parts = system.inverse_mass_matrix(q), potential(system, q), system.input_matrix(q)
        return _Blocks(*parts, friction_matrix(system, q, v))

    return jax.vmap(one)(q, v)


def _regauged(blocks: _Blocks, gauge: float) -> _Blocks:
    """Blocks with the factor taken out."""
    return _Blocks(
        blocks.inverse_mass / gauge, blocks.potential * gauge, blocks.input_matrix * gauge, blocks.dissipation * gauge
    )


def _curves(symbol: str, unit: str, axis: _Axis, pair: Sequence[ArrayLike]) -> BlockCurves:
    """Flatten the entries of a block; of a symmetric one, the lower triangle."""
    true, found = (np.asarray(block) for block in pair)
    shape = true.shape[1:]
    where = [index for index in np.ndindex(*shape) if symbol == "g" or len(index) < 2 or index[0] >= index[1]]
    truth, learned = (np.stack([block[:, *index] for index in where], axis=1) for block in (true, found))
    names = tuple("".join(str(i + 1) for i in index) for index in where) if len(where) > 1 else (symbol,)
    worst, size = (float(np.max(np.abs(x[axis.inside]))) for x in (learned - truth, truth))
    return BlockCurves(
        symbol=symbol,
        unit=unit,
        entries=names,
        coordinate=axis.name,
        values=axis.values,
        truth=truth,
        learned=learned,
        visited=axis.visited,
        error=worst / size if size else (np.inf if worst else 0.0),
    )


def coordinate_title(task: Task, coordinate: int) -> str:
    """Name of a coordinate, with its unit.

    Args:
        task: The task.
        coordinate: Index of the coordinate.

    Returns:
        Title of an axis.
    """
    return titled(task.position_names[coordinate], task.system.space.units[coordinate])


def _driven(task: Task, trajectory: Trajectory) -> str:
    """The constant input of a trajectory in words."""
    values = zip(task.input_names, trajectory.us[0], strict=True)
    return ", ".join(f"{name} {value:g}" for name, value in values)


def _units(space: Space) -> tuple[str, str, str, str]:
    """Units of M⁻¹, V, g and D where inputs are forces or torques; entries of a mixed space have different ones."""
    (inertia, *others), (friction, *_) = (units_of_entries(of, space.units) for of in ("inertia", "friction"))
    return ("SI", "J", "SI", "SI") if others else (f"1/({inertia})", "J", "1", friction)

"""How far learned blocks lie from those of the true system, at the states that training visited."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian

from ._portrait import _evaluate, _regauged, _states
from ._sources import Source


@dataclass(frozen=True, kw_only=True)
class BlockErrors:
    """Relative errors of M⁻¹, V, g and D in the gauge of the known scale of the inputs.

    Of a matrix, the Frobenius norm of the deviation relative to that of the truth, worst over the states.

    Attributes:
        gauge: β = true g / learned g, found from g alone; 1 for momentum data.
        inverse_mass: Of M⁻¹.
        potential: Largest deviation of V up to a constant, relative to the range of the true V.
        actuation: Of g.
        dissipation: Of D, for the full D of its part on the momenta.
        dissipation_median: Of D, the median over the states.
    """

    gauge: float
    inverse_mass: float
    potential: float
    actuation: float
    dissipation: float
    dissipation_median: float


def block_errors(model: AbstractDynamics, source: Source) -> BlockErrors | None:
    """Compare a model's blocks with the truth's at the states of the training recordings, at most 2000 of them.

    Args:
        model: Learned model.
        source: The task that it learned.

    Returns:
        The errors; None if there is no truth, or the model has no such blocks.
    """
    if source.task is None or not isinstance(model, AbstractPortHamiltonian):
        return None
    truth = source.task.system
    q, v = _states(truth, source.dataset.train)
    true, learned = _evaluate(truth, q, v), _evaluate(model, q, v)
    gauge = 1.0 if model.momenta else _input_gauge(learned.input_matrix, true.input_matrix)
    learned = _regauged(learned, gauge)
    friction = _relative(learned.dissipation, true.dissipation)
    return BlockErrors(
        gauge=gauge,
        inverse_mass=float(np.max(_relative(learned.inverse_mass, true.inverse_mass))),
        potential=_up_to_constant(learned.potential, true.potential),
        actuation=float(np.max(_relative(learned.input_matrix, true.input_matrix))),
        dissipation=float(np.max(friction)),
        dissipation_median=float(np.median(friction)),
    )


def _input_gauge(learned: ArrayLike, true: ArrayLike) -> float:
    """Least squares estimate of β in g = β g'; 1 where g' is zero and says nothing."""
    size = np.sum(np.square(learned))
    return float(np.sum(np.multiply(true, learned)) / size) if size else 1.0


def _relative(learned: ArrayLike, true: ArrayLike) -> Float[np.ndarray, " K"]:
    """Norm of the deviation relative to the truth's at each state; infinite where only the truth is zero."""
    away, size = (np.linalg.norm(block, axis=(1, 2)) for block in (np.subtract(learned, true), true))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(away == 0, 0.0, away / size)


def _up_to_constant(learned: ArrayLike, true: ArrayLike) -> float:
    """Largest deviation after the best constant, relative to the truth's range."""
    away, size = np.ptp(np.subtract(learned, true)) / 2, np.ptp(true)
    if size:
        return float(away / size)
    return np.inf if away else 0.0

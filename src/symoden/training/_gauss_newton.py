"""The Gauss-Newton matrix JᵀJ of the residuals, gathered window by window."""

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Float
from threadpoolctl import threadpool_limits

from symoden.mechanics import AbstractDynamics

from ._flatten import Flattening, cast
from ._objective import AbstractObjective, Batch, Objective
from ._residuals import filled, find_starts, follow_starts, mean_square
from ._sensitivities import Parameters, linearize_rollout
from ._starts import Found

MOST_PARAMETERS: Final = 4000  # Beyond, matrices take gigabytes, and what is done with them in every step minutes.
MOST_SOLVED: Final = 12_000  # Beyond, each of these matrices takes more than a gigabyte.

_LARGEST_JACOBIAN = 2**23  # Entries of a block.
_MOST_KEPT = 2**28  # Entries of all blocks that are.
_CACHED_WINDOWS = 16  # They stay in the processor's cache (`benchmarks/`).
_PINNED = 1e-5  # Relative standard deviation.
_FAR: Final = 1e3  # From zero, beside what changes: beyond, rounding in single precision is 1e-4 of that.
_FEW_PARAMETERS: Final = 512  # Threads wait longer for each other than products of so few take.


class NormalEquations(NamedTuple):
    """Second-order model of the loss at one point: loss + 2 gradientᵀ δ + δᵀ matrix δ.

    Attributes:
        matrix: Mean of JᵀJ over the residuals.
        gradient: Mean of Jᵀr.
        residuals: The residuals r of every window.
        scores: Jᵀr of every window; how much they disagree about the parameters.
    """

    matrix: np.ndarray
    gradient: np.ndarray
    residuals: np.ndarray
    scores: np.ndarray

    @property
    def loss(self) -> float:
        """Mean of r²; infinite where a rollout diverges."""
        return mean_square(self.residuals)

    def pinned(self, direction: np.ndarray, variance: float) -> "NormalEquations":
        """The same with what a relative change along a direction would be known to, as if it had been measured.

        Args:
            direction: Gradient of the logarithm of what stays as it is.
            variance: Of the residuals.

        Returns:
            The equations.
        """
        information = variance / (_PINNED**2 * self.residuals.size)
        return self._replace(matrix=self.matrix + information * np.outer(direction, direction))


def linearize(
    restore: Callable[[Parameters], AbstractDynamics], theta: Parameters, objective: AbstractObjective, window: Batch
) -> tuple[Float[Array, " r"], Float[Array, "r P"]]:
    """Residuals of one window and their Jacobian: by sensitivities where it is rolled out, else in reverse mode.

    Args:
        restore: Makes the dynamics from flat parameters.
        theta: Flat parameters.
        objective: What makes residuals.
        window: One window.

    Returns:
        Residuals, row by row, and their derivatives by the parameters.
    """
    if isinstance(objective, Objective):
        return linearize_rollout(restore, theta, objective, window)

    def residuals(theta: Parameters) -> tuple[Float[Array, " r"], Float[Array, " r"]]:
        found = objective.residuals(restore(theta), window).ravel()
        return found, found

    jacobian, found = jax.jacrev(residuals, has_aux=True)(theta)
    return found, jacobian


@eqx.filter_jit
def _jacobian(
    restore: Callable, theta: Parameters, objective: AbstractObjective, batch: Batch
) -> Float[Array, "b r P"]:
    """Jacobians of a few windows, which stay in the processor's cache."""
    return jax.vmap(lambda window: linearize(restore, theta, objective, window)[1])(batch)


def _are_far(q: Float[np.ndarray, "B h n"]) -> bool:
    """Whether some coordinate is far from zero beside what it changes by in windows; not so one that never moves."""
    changes = np.ptp(q, axis=1).max(axis=0)
    return bool(np.any((changes > 0) & (np.abs(q).max(axis=(0, 1)) > _FAR * changes)))


def _threads(parameters: int) -> int | None:
    """Threads of the matrix products; None for as many as there are."""
    return 1 if parameters <= _FEW_PARAMETERS else None


@final
@dataclass(frozen=True, kw_only=True)
class Linearization:
    """Residuals r and their Jacobian J about one point, block of windows by block of windows.

    J may have less precision than the parameters: its rounding is a small error of a step, not of the loss, and takes a
    third of the time off. Where positions are far from zero beside what they change by in a window, as those of a
    machine on long rails or of an angle that has wound up, rounding would be that of the motion, and J has the
    parameters' precision. Starts, where they are free, follow the parameters.

    Attributes:
        restore: Makes the dynamics from flat parameters.
        theta: Flat parameters.
        objective: How rollouts are compared with windows.
        found: Windows from their best starts.
        chunk: Number of windows in a block; if None 16, or fewer of so many numbers that these are more than 64 MB.
        precision: Of J.
    """

    restore: Flattening
    theta: Parameters
    objective: AbstractObjective
    found: Found
    chunk: int | None = None
    precision: DTypeLike = jnp.float32
    _kept: dict[int, np.ndarray] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def at(cls, restore: Flattening, theta: Parameters, objective: AbstractObjective, batch: Batch) -> "Linearization":
        """Linearise about a point, from the starts that are best there.

        Args:
            restore: Makes the dynamics from flat parameters.
            theta: The point.
            objective: How rollouts are compared with windows.
            batch: Windows.

        Returns:
            The linearization, with J in single precision unless positions are far from zero.
        """
        found = find_starts(restore(theta), objective, batch)
        precision = theta.dtype if _are_far(np.asarray(batch.q)) else jnp.float32
        return cls(restore=restore, theta=theta, objective=objective, found=found, precision=precision)

    def normal_equations(self) -> NormalEquations:
        """Gather JᵀJ and Jᵀr in bounded memory.

        Products run in double precision, which keeps JᵀJ positive semidefinite, and in NumPy's BLAS: on a CPU it is
        three times as fast as XLA's (`benchmarks/`), and it sees that JᵀJ is symmetric.

        Returns:
            The normal equations, in double precision.
        """
        residuals = np.asarray(self.found.residuals, float)
        size = self.theta.size
        matrix, gradient, scores = np.zeros((size, size)), np.zeros(size), np.zeros((len(residuals), size))
        # Callers see that the sums are not finite.
        with threadpool_limits(_threads(size), user_api="blas"), np.errstate(over="ignore", invalid="ignore"):
            for some, block in self._blocks():
                J, r = block.astype(float), residuals[some]
                scores[some] = np.einsum("wrp,wr->wp", J, r.reshape(len(r), -1), optimize=True)
                J = J.reshape(-1, size)
                matrix += J.T @ J
                gradient += scores[some].sum(axis=0)
        count = residuals.size
        return NormalEquations(matrix / count, gradient / count, residuals, scores)

    def residuals(self, theta: Float[np.ndarray, " P"]) -> Float[np.ndarray, "B k o"]:
        """Residuals at a point nearby, from the starts that are best there.

        Args:
            theta: The point.

        Returns:
            The residuals; not finite where a rollout diverges.
        """
        model, found = self.restore(jnp.asarray(theta, self.theta.dtype)), self.found
        return np.asarray(follow_starts(model, self.objective, found.windows, found.inverse), float)

    def pull_back(self, cotangents: Float[np.ndarray, "B k o"]) -> Float[np.ndarray, " P"]:
        """Jᵀ c.

        Args:
            cotangents: One number c for each residual.

        Returns:
            The product; blocks in the precision of J, their sum in double precision.
        """
        total = np.zeros(self.theta.size)
        for some, block in self._blocks():
            total += block.reshape(-1, total.size).T @ cotangents[some].ravel().astype(block.dtype)
        return total

    @functools.cached_property
    def _rough(self) -> tuple[Flattening, Parameters, AbstractObjective, Batch]:
        """What J is computed from, in its precision."""
        parts = self.restore.lean(self.theta), self.theta, self.objective, self.found.windows
        restore, theta, objective, windows = (cast(part, self.precision) for part in parts)
        return restore, theta, objective, windows

    def _blocks(self) -> Iterator[tuple[slice, Float[np.ndarray, "b r P"]]]:
        """Every block and its windows; as many as fit into memory are kept for the next time."""
        total, *rest = self.found.residuals.shape
        rows = math.prod(rest)
        chunk = self.chunk or min(_CACHED_WINDOWS, max(1, _LARGEST_JACOBIAN // (rows * self.theta.size)))
        ahead = self._begin(0, chunk, total)
        for start in range(0, total, chunk):
            some, begun = slice(start, min(start + chunk, total)), ahead
            if some.stop < total:  # Computed while what is made of this one is.
                ahead = self._begin(some.stop, chunk, total)
            block = np.asarray(begun)[: some.stop - start]
            if some.stop * rows * self.theta.size <= _MOST_KEPT:
                self._kept[start] = block
            yield some, block

    def _begin(self, start: int, chunk: int, total: int) -> Float[Array, "b r P"] | Float[np.ndarray, "b r P"]:
        """Let a block be computed, which takes its time elsewhere, or take the one that is kept."""
        if start in self._kept:
            return self._kept[start]
        restore, theta, objective, windows = self._rough
        return _jacobian(restore, theta, objective, windows.take(filled(start, chunk, total)))

"""Automatic relevance determination: every group of parameters has a prior of its own, as wide as the data want it."""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jaxtyping import Array, Float, Int, PyTree
from threadpoolctl import threadpool_limits

from symoden.blocks import FRICTION, Correction, trainable
from symoden.models import StructuredModel, parts_that_fix_the_scale

from ._gauss_newton import NormalEquations
from ._level import LEAST_WINDOWS, independent_variance, is_sound
from ._levenberg_marquardt import CLOSED

_INNER: Final = 20
_SETTLED: Final = 0.1  # Change of the evidence's logarithm that is none.
_SILENT: Final = 1e-8  # Share of a group that the data determine, below which it is rounding.
_LARGEST_CHANGE: Final = 3.0  # More, and which of several optima is found is a matter of rounding (`benchmarks/`).
_PRECISIONS: Final = (1e-6, 1e8)
_NARROW: Final = 1e4  # Precision of what must first show that it is needed; parameters are of the order of 1.


class Relevance(NamedTuple):
    """Gaussian priors about zero.

    Attributes:
        precision: λ of every parameter, as a tree like all that can be free in the model.
        variance: Of the residuals, times their design effect: what one independent residual would have. Zero as long as
            it is not known.
        evidence: Its logarithm by the linearised model, but for what all priors beside this variance share; −∞ before
            any were learned.
    """

    precision: PyTree
    variance: Float[Array, ""]
    evidence: Float[Array, ""]

    @classmethod
    def start(cls, model: PyTree, prior: float) -> "Relevance":
        """Priors of equal width before anything is known, but as wide as the laws of friction that the model has.

        At a narrow knee a law of usual force has a coefficient of a hundred. Pulled at as if it were of the order of 1,
        one that was guessed would be undone before priors are learned, and one that was learned seem far too certain.

        Args:
            model: Model.
            prior: Precision of each.

        Returns:
            The priors.
        """

        def precision(node: PyTree) -> PyTree:
            begun = float(isinstance(node, Correction) and node.kind == FRICTION)
            return jax.tree.map(lambda x: jax.device_put(prior / np.fmax(1.0, begun * np.asarray(x, float) ** 2)), node)

        free = eqx.filter(model, trainable(model))
        precision = jax.tree.map(precision, free, is_leaf=lambda node: isinstance(node, Correction))
        return cls(precision, jnp.zeros((), float), jnp.full((), -jnp.inf, float))

    def unrecorded(self) -> "Relevance":
        """The same priors where nothing is known of their evidence."""
        return self._replace(evidence=jnp.full((), -jnp.inf, float))

    def forgotten(self) -> "Relevance":
        """The same priors where nothing is known of the residuals either."""
        return self.unrecorded()._replace(variance=jnp.zeros((), float))

    def opened(self, prior: float) -> "Relevance":
        """The same priors, but what was closed is open again.

        Args:
            prior: Its precision.

        Returns:
            The priors.
        """
        return self._replace(precision=jax.tree.map(lambda x: jnp.where(x >= CLOSED, prior, x), self.precision))

    def narrowed(self, model: PyTree, kept: int, corrections: int) -> "Relevance":
        """The same priors, but narrow ones for corrections that validation saw no need of.

        From wide ones on, noise fills them before priors can be learned, and evidence has an optimum there too; from
        narrow ones on they come in only where the evidence rises all the way.

        Args:
            model: Model.
            kept: Kinds of corrections that were kept, as flags.
            corrections: Kinds that are free now.

        Returns:
            The priors.
        """
        wide, rest = eqx.partition(self.precision, trainable(model, corrections=kept))
        opened, closed = eqx.partition(rest, trainable(model, corrections=corrections))
        opened = jax.tree.map(lambda x: jnp.maximum(x, _NARROW), opened)
        return self._replace(precision=eqx.combine(wide, opened, closed))

    def precisions(self, model: PyTree, corrections: int) -> Float[np.ndarray, " P"]:
        """The precisions as a vector, in the order of the flat parameters.

        Args:
            model: Model.
            corrections: Which kinds of its corrections are free, as flags.

        Returns:
            The vector.
        """
        chosen = eqx.filter(self.precision, trainable(model, corrections=corrections))
        return np.concatenate([np.asarray(leaf).ravel() for leaf in jax.tree.leaves(chosen)])

    def learn(
        self, equations: NormalEquations, theta: Float[np.ndarray, " P"], model: PyTree, corrections: int
    ) -> "Relevance":
        """Widen the priors of what the data ask for and narrow the others, towards the largest evidence.

        With Σ = (JᵀJ / σ² + Λ)⁻¹ and the θ̂ that is best for the Λ at hand, both of the model linearised at θ, the
        evidence has no slope where λ = γ / ‖θ̂‖² for each group of n parameters, of which the data determine
        γ = n − λ tr Σ. That is iterated; expectation maximisation, λ = n / (‖θ̂‖² + tr Σ), ends at the same, but takes
        many times the steps (`benchmarks/`). λ is at most n / ‖θ‖². From a handful of windows, or where sensitivities
        overflow, nothing is learned.
        Residuals of one window are not independent; σ² is their variance times the factor by which the windows' scores
        vary more than independent residuals would make them, the design effect. It stays
        what it is at first: falling with the residuals it would widen the priors before they have been narrowed.

        Parameters of formulas keep the priors that they have: about zero is about the guess that a user gave. So does
        what is closed.

        Args:
            equations: Gauss-Newton's equations at θ.
            theta: θ.
            model: Model.
            corrections: Which kinds of its corrections are free, as flags.

        Returns:
            The priors, none of them changed by more than a factor of three.

        References:
            MacKay (1992), *Bayesian interpolation*; Tipping (2001), *Sparse Bayesian learning and the relevance vector
            machine*: groups of one; Kish (1965), *Survey sampling*: the design effect.
        """
        if len(equations.residuals) < LEAST_WINDOWS or not is_sound(equations):
            return self
        try:
            return self._learned(equations, theta, model, corrections)
        except np.linalg.LinAlgError:  # Rounding, where a model is nearly exact.
            return self

    def _learned(
        self, equations: NormalEquations, theta: Float[np.ndarray, " P"], model: PyTree, corrections: int
    ) -> "Relevance":
        """The priors that are learned from equations that are sound."""
        chosen, rest = eqx.partition(self.precision, trainable(model, corrections=corrections))
        paths, structure = jax.tree.flatten_with_path(chosen)
        shapes = [leaf.shape for _, leaf in paths]
        given = [jax.tree_util.keystr(path).startswith(".parameters") for path, _ in paths]
        groups = parameter_groups(shapes)
        sizes = np.bincount(groups)
        variance = float(self.variance) or independent_variance(equations)
        count = equations.residuals.size / variance
        squares, gradient = equations.matrix * count, equations.gradient * count
        pull = squares @ theta - gradient
        before = np.bincount(groups, self.precisions(model, corrections)) / sizes
        held = np.concatenate([np.full(shape[:1] or 1, fixed) for shape, fixed in zip(shapes, given, strict=True)])
        held |= before >= CLOSED
        low, high = (np.clip(before * factor, *_PRECISIONS) for factor in (1 / _LARGEST_CHANGE, _LARGEST_CHANGE))
        # θ̂ is a linear forecast. Priors that outran θ itself would drag it along, whatever the data say.
        with np.errstate(divide="ignore", over="ignore"):
            high = np.maximum(low, np.minimum(high, sizes / np.bincount(groups, theta**2)))
        precision = np.where(held, before, np.clip(before, *_PRECISIONS))
        rounding = float(np.finfo(float).eps * np.trace(squares))  # Lest it makes eigenvalues negative.
        last = evidence = -math.inf
        with threadpool_limits(1, user_api="blas"):
            for _ in range(_INNER):
                best, variances, logdet = _posterior(squares + np.diag(precision[groups] + rounding), pull)
                evidence = (sizes[~held] @ np.log(precision[~held]) - logdet + pull @ best) / 2
                if abs(evidence - last) < _SETTLED:
                    break
                last = evidence
                determined = sizes - (precision + rounding) * np.bincount(groups, variances)
                with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
                    wanted = determined / np.bincount(groups, best**2)
                heard = determined > _SILENT * sizes
                precision = np.where(held | ~heard, precision, np.clip(wanted, low, high))
        if not np.isfinite(precision).all():
            return self
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
        parts = zip(np.split(precision[groups], ends), shapes, strict=True)
        learned = jax.tree.unflatten(structure, [jnp.asarray(part.reshape(shape), float) for part, shape in parts])
        evidence -= (equations.loss * count + (pull - gradient) @ theta) / 2
        found = eqx.combine(learned, rest)
        return Relevance(found, jnp.asarray(variance, float), jnp.asarray(evidence, float))


def remembered(memory: PyTree, fresh: Relevance) -> Relevance:
    """The priors that a stage before has left, if it has.

    Args:
        memory: What that stage remembers.
        fresh: The priors else.

    Returns:
        The priors.
    """
    return memory if isinstance(memory, Relevance) else fresh


def _posterior(
    precision: Float[np.ndarray, "P P"], pull: Float[np.ndarray, " P"]
) -> tuple[Float[np.ndarray, " P"], Float[np.ndarray, " P"], float]:
    """Mean, variances and log det of the precision: by the inverse of a triangle, a third of the covariance's price."""
    triangle = scipy.linalg.cholesky(precision, lower=True, overwrite_a=True, check_finite=False)
    logdet = 2 * float(np.sum(np.log(np.diag(triangle))))
    (invert,) = scipy.linalg.get_lapack_funcs(("trtri",), (triangle,))
    inverse, _ = invert(triangle, lower=True, overwrite_c=True)
    return inverse.T @ (inverse @ pull), np.einsum("ij,ij->j", inverse, inverse), logdet


def free_scale(
    model: PyTree, restore: Callable[[Float[Array, " P"]], PyTree], theta: Float[Array, " P"], q: Float[Array, "k n"]
) -> Float[np.ndarray, " P"] | None:
    """How the parameters change the scale of the inertia, where data of velocities leave that open.

    Priors about zero would pull inertia, energy, actuation and friction to nothing together: no prediction changes.

    Args:
        model: Model.
        restore: Makes the model from flat parameters.
        theta: Flat parameters.
        q: Configurations.

    Returns:
        Gradient of the logarithm of the mean trace of M; None where the scale is known.
    """
    if not isinstance(model, StructuredModel) or model.momenta or parts_that_fix_the_scale(model):
        return None

    return np.asarray(_scale_gradient(restore, theta, q), float)


@eqx.filter_jit
def _scale_gradient(
    restore: Callable[[Float[Array, " P"]], PyTree], theta: Float[Array, " P"], q: Float[Array, "k n"]
) -> Float[Array, " P"]:
    """`free_scale`, compiled."""

    def scale(theta: Float[Array, " P"]) -> Float[Array, ""]:
        matrices = jax.vmap(restore(theta).mass_matrix)(q)
        return jnp.log(jnp.mean(jnp.trace(matrices, axis1=1, axis2=2)))

    return jax.grad(scale)(theta)


def parameter_groups(shapes: Sequence[tuple[int, ...]]) -> Int[np.ndarray, " P"]:
    """Which parameters share a prior: those of a row of a matrix, such as a product's in all outputs.

    Args:
        shapes: Shapes of the model's free arrays.

    Returns:
        Number of its group for every parameter.
    """
    groups, first = [], 0
    for shape in shapes:
        rows = shape[0] if shape else 1
        groups.append(first + np.repeat(np.arange(rows), int(np.prod(shape[1:]))))
        first += rows
    return np.concatenate(groups)

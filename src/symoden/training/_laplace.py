"""How certain a trained model is: the Gauss-Newton matrix at the optimum, and what it says of anything computed."""

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
import scipy.stats
from jaxtyping import Array, Float, Int

from symoden.blocks import DIRECTIONS, FRICTION, JointFriction, count_parameters, kinds_in_use
from symoden.data import FEWEST_LOGS, Dataset
from symoden.integrate import RK4
from symoden.mechanics import AbstractDynamics
from symoden.models import StructuredModel
from symoden.storage import StorageError, load_arrays, save_arrays

from ._config import TrainingConfig
from ._data import hold_out, levenberg_data
from ._flatten import Flattening, cast
from ._gauss_newton import MOST_PARAMETERS, Linearization
from ._level import LEAST_WINDOWS, expected_level
from ._objective import measured_channels
from ._posterior import AbstractPosterior, AbstractScatter, Quantities, Restore
from ._relevance import Relevance
from ._residuals import evaluate_loss, evaluate_residuals, mean_square
from ._stages import EXPLAINED
from ._weighing import Weighing

_SUBSTEPS = 4
_UNEVEN: Final = 0.1  # Of friction: what it may differ by between the directions, where no difference was kept.
_DEVIATIONS = 48  # A standard deviation from so many is 10 % right.


@final
class _Linearized(AbstractScatter):
    """Deviations with the posterior's covariance, along which quantities are linearised."""

    restore: Restore
    theta: Float[Array, " P"]
    deviations: Float[Array, "k P"]

    def moments(self, quantities: Quantities) -> tuple[Float[Array, "*K"], Float[Array, "*K"]]:
        value, push = jax.linearize(lambda theta: quantities(self.restore(theta)), self.theta)
        return value, jnp.mean(jax.vmap(push)(self.deviations) ** 2, axis=0)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Laplace(AbstractPosterior):
    """Gaussian approximation about the optimum.

    Attributes:
        factor: F, where F Fᵀ is the covariance.
        effective: Number of parameters that the data, rather than the prior, determine.
        independent: Number of those that tell the variance: windows, or logs where these disagree.
    """

    factor: Float[np.ndarray, "P P"]
    effective: float
    independent: int

    def quantile(self, level: float) -> float:
        """Student's, with a degree of freedom less than there are that tell the variance."""
        return float(scipy.stats.t.ppf((1 + level) / 2, self.independent - 1))

    def project(self, quantities: Quantities) -> Float[np.ndarray, "K P"]:
        """G F, where G is the Jacobian of the quantities, for which friction's laws are not rounded off at zero."""
        with jax.enable_x64(True):  # noqa: FBT003 - JAX's signature
            theta = jnp.asarray(self.theta)

            def of(theta: Float[Array, " P"]) -> Float[Array, " K"]:
                return quantities(_opened(self.restore(theta)))

            # One pass for each of the fewer.
            forward = theta.size < jax.eval_shape(of, theta).size
            jacobian = jax.jit((jax.jacfwd if forward else jax.jacrev)(of))(theta)
        return np.asarray(jacobian, float) @ self.factor

    def scatter(self) -> AbstractScatter:
        """Random deviations, always the same ones."""
        draws = np.random.default_rng(0).normal(size=(_DEVIATIONS, len(self.theta)))
        return _Linearized(self.restore, jnp.asarray(self.theta, float), jnp.asarray(draws @ self.factor.T, float))


def infer_posterior(
    model: AbstractDynamics, dataset: Dataset, config: TrainingConfig | None = None, *, substeps: int | None = None
) -> Laplace:
    """Infer how certain a trained model's parameters are, from the data that it was trained on.

    With J the Jacobian of the residuals r, H = JᵀJ / σ² + λ I is the posterior's precision where the residuals are
    independent (Laplace's approximation, Gauss-Newton's matrix). Those of one window are not, and models are never
    quite right, so that the covariance is H⁻¹ (W/(W−1) Σ_w s_w s_wᵀ + λ I) H⁻¹ with the scores s_w = J_wᵀ r_w / σ² of
    the W windows (the sandwich of Huber and White, by windows; at the optimum the scores sum to zero). σ² is the larger
    of the mean squared residuals on the training and on the validation data, and the r_w are scaled up to it: a model
    that follows its training data more closely than others is not more certain. What one window alone tells it is
    fitted to, and its score is zero: along no combination of parameters is the covariance less than H⁻¹. Where three
    logs or more disagree by more than independent windows would, all is wider by that design effect, and by how little
    so few tell of it.

    Residuals are weighed by what is new in each, as a likelihood of errors that follow each other has it, also where
    training kept all alike since validation lost by that.

    Priors that training has learned are left out: what they narrowed to nothing counts as open again, so that bands are
    rather too wide than too narrow where the data say little. Likewise friction in which training
    kept no difference between the directions may differ all the same: each odd shape has a standard deviation of a
    tenth of the friction at the typical speed. Training keeps clear gains alone, and a difference below these moves V
    and D by many times the bands that leave it out.

    Args:
        model: What `fit` found.
        dataset: What it was fitted to.
        config: With which settings.
        substeps: RK4 steps in each sampling interval, as many as training found that its rollouts need
            (`FitResult.substeps`); if None, as many as `config` says, or 4.

    Returns:
        The posterior of the parameters that training has set free.

    Raises:
        ValueError: If there are none, or too many; if `substeps` is below 1; if there are too few windows, or rollouts
            diverge there.

    References:
        White (1982), *Maximum likelihood estimation of misspecified models*; Cameron & Miller (2015), *A practitioner's
        guide to cluster-robust inference* (few windows); MacKay (1992), *A practical Bayesian framework for
        backpropagation networks* (the number of effective parameters).
    """
    config = config or TrainingConfig()
    substeps = config.lm_substeps or _SUBSTEPS if substeps is None else substeps
    if substeps < 1:
        raise ValueError(f"`substeps` must be at least 1, or None for those of the settings; got {substeps}.")
    with jax.enable_x64(True), jax.numpy_dtype_promotion("standard"):  # noqa: FBT003 - JAX's signature
        model, restore, theta = _open_parts(model)
        data = levenberg_data(hold_out(dataset, config), model, config)
        if (windows := data.train.ts.shape[0]) < LEAST_WINDOWS:
            raise ValueError(
                f"Bands need {LEAST_WINDOWS} windows of training data or more, to tell how much these disagree; there "
                f"{'is' if windows == 1 else 'are'} {windows}. Record longer."
            )
        solver = RK4(jnp.asarray(substeps))
        where = restore, theta, data.objective, solver, data.train
        weighing = Weighing.plain(data.objective.weights.size, expected_level(*where))
        # By what is new in each, once all that training kept is free.
        residuals = np.asarray(evaluate_residuals(model, data.objective.refined(solver, weighing), data.train), float)
        explained = config.scaled_loss and mean_square(residuals) < EXPLAINED  # Losses that carry units do not tell.
        if config.relevance_steps and not explained:
            weighing = weighing.whitened(residuals, measured_channels(data.objective))
        objective = data.objective.refined(solver, weighing)
        equations = Linearization.at(restore, theta, objective, data.train).normal_equations()
        elsewhere = None if data.validation is None else evaluate_loss(model, objective, data.validation)
        prior = _priors(model, data.train.q[:, 0], max(config.prior, np.finfo(float).eps), restore.corrections)
    if not (np.isfinite(equations.matrix).all() and math.isfinite(equations.loss) and math.isfinite(elsewhere or 0.0)):
        raise ValueError(
            "Bands need rollouts along the training recordings that stay finite; this model's do not. Were these the "
            "data, and their units, that it was trained on? Else train longer."
        )
    factor, effective, independent = _sandwich(
        equations.matrix * equations.residuals.size,
        equations.scores,
        variance=equations.loss,
        inflation=max(1.0, (elsewhere or 0.0) / max(equations.loss, np.finfo(float).tiny)),
        prior=prior,
        recording=None if data.train.recording is None else np.asarray(data.train.recording),
    )
    return Laplace(
        restore=restore.lean(theta),
        theta=np.asarray(theta, float),
        windows=windows,
        factor=factor,
        effective=effective,
        independent=independent,
    )


def save_laplace(path: Path, posterior: Laplace, *, origin: str) -> None:
    """Write a posterior beside its model.

    Args:
        path: The file.
        posterior: The posterior.
        origin: Names what it was inferred from.

    Raises:
        StorageError: If it cannot be written.
    """
    names = ("windows", "effective", "independent")
    facts = {"origin": origin} | {name: getattr(posterior, name) for name in names}
    save_arrays(path, {"theta": posterior.theta, "factor": posterior.factor}, facts)


def load_laplace(path: Path, model: AbstractDynamics, *, origin: str) -> Laplace:
    """Read a posterior.

    Args:
        path: The file.
        model: The trained model that it belongs to.
        origin: Names what it must have been inferred from.

    Returns:
        The posterior.

    Raises:
        StorageError: If the file is absent or damaged, or was inferred from something else.
        ValueError: If no posterior can belong to the model, which has no parameters or too many.
    """
    arrays, facts = load_arrays(path)
    with jax.enable_x64(True):  # noqa: FBT003 - JAX's signature
        _, restore, theta = _open_parts(model)
    shapes = {name: array.shape for name, array in arrays.items()}
    told = isinstance(facts, dict) and facts.get("origin") == origin
    if not told or shapes != {"theta": theta.shape, "factor": 2 * theta.shape}:
        raise StorageError(f"`{path}` must tell of the run's model, data and settings; it tells of others. Remove it.")
    return Laplace(
        restore=restore.lean(theta),
        theta=arrays["theta"],
        windows=int(facts["windows"]),
        factor=arrays["factor"],
        effective=float(facts["effective"]),
        independent=int(facts["independent"]),
    )


def _open_parts(model: AbstractDynamics) -> tuple[AbstractDynamics, Flattening, Float[Array, " P"]]:
    """The model in double precision, and what of it the data are asked about.

    Returns:
        The model, what restores it, and its flat parameters.

    Raises:
        ValueError: If there are none, or too many.
    """
    model = cast(model, float)
    corrections = kinds_in_use(model) | (DIRECTIONS if _is_even(model) else 0)
    size = count_parameters(model, corrections=corrections)
    if not 0 < size <= MOST_PARAMETERS:
        hint = "Train a smaller one" if size else "All of it is given, and nothing uncertain"
        raise ValueError(f"The posterior needs 1 to {MOST_PARAMETERS} free parameters; the model has {size}. {hint}.")
    return model, *Flattening.of(model, corrections=corrections)


def _is_even(model: AbstractDynamics) -> bool:
    """Whether friction's laws were set free, and no difference between the directions was kept."""
    if not isinstance(model, StructuredModel) or not isinstance(model.friction, JointFriction):
        return False
    return model.friction.directions is not None and kinds_in_use(model) & (FRICTION | DIRECTIONS) == FRICTION


def _opened(model: AbstractDynamics) -> AbstractDynamics:
    """The model with friction that may rise where its laws are below zero, and rounded off."""
    if not isinstance(model, StructuredModel) or not isinstance(model.friction, JointFriction):
        return model
    return dataclasses.replace(model, friction=dataclasses.replace(model.friction, open=True))


def _priors(model: AbstractDynamics, q: Float[Array, "W n"], prior: float, corrections: int) -> Float[np.ndarray, " P"]:
    """Precisions of the parameters' priors."""
    priors = Relevance.start(model, prior)
    if _is_even(model) and isinstance(model, StructuredModel) and isinstance(model.friction, JointFriction):
        size = _UNEVEN * _mean_directions(model.friction, q)
        where = lambda tree: tree.friction.directions.function.values
        priors = priors._replace(precision=eqx.tree_at(where, priors.precision, jnp.maximum(prior, size**-2.0)))
    return priors.precisions(model, corrections)


@eqx.filter_jit
def _mean_directions(friction: JointFriction, q: Float[Array, "W n"]) -> Float[Array, " K"]:
    """Means over configurations of what each odd shape of friction has for its unit."""
    return jnp.mean(jax.vmap(friction.whole_directions)(q), axis=0)


def _sandwich(
    squares: Float[np.ndarray, "P P"],
    scores: Float[np.ndarray, "W P"],
    *,
    variance: float,
    inflation: float,
    prior: Float[np.ndarray, " P"],
    recording: Int[np.ndarray, " W"] | None = None,
) -> tuple[Float[np.ndarray, "P P"], float, int]:
    """A factor of the covariance, the number of effective parameters, and of what tells the covariance.

    In units in which every prior is as wide, and in the eigenbasis of JᵀJ, the inverse is one of numbers, so that what
    is known best and worst lose no digits to each other.

    What one window alone tells it is fitted to, so that its score is zero and the sandwich holds it for certain: along
    no combination of parameters is the covariance less than that of independent residuals.

    Returns:
        These three.
    """
    least = float(prior.min())
    unit = np.sqrt(least / prior)
    eigenvalues, basis = scipy.linalg.eigh(np.outer(unit, unit) * squares)
    eigenvalues, scores = np.maximum(eigenvalues, 0.0), (scores * unit) @ basis
    independent = len(scores)
    if recording is not None:
        alike = _likeness(scores / np.sqrt(eigenvalues + least * inflation * variance), recording)
        inflation *= alike
        independent = len(scores) if alike == 1 else len(np.unique(recording))
    known = eigenvalues / (inflation * variance)
    deviation = 1 / np.sqrt(known + least)  # Of independent residuals.
    pulls = scores * deviation / (math.sqrt(inflation) * variance)
    filling = pulls.T @ pulls * _few(len(pulls)) + np.diag(least * deviation**2)
    ratios, vectors = scipy.linalg.eigh(filling)
    half = deviation[:, None] * vectors * np.sqrt(np.maximum(ratios, 1.0))
    return unit[:, None] * (basis @ half), float(np.sum(known / (known + least))), independent


def _likeness(pulls: Float[np.ndarray, "W P"], recording: Int[np.ndarray, " W"]) -> float:
    """How much more recordings disagree about the parameters than they would if their windows were independent.

    An encoder that has another zero in every recording pulls all of its windows alike. It is a mean over all that the
    data tell: recordings are too few to say of each combination of parameters how much they disagree.

    Returns:
        The design effect, at least 1; also where there are too few recordings.
    """
    together = np.array([pulls[recording == number].sum(axis=0) for number in np.unique(recording)])
    if len(together) < FEWEST_LOGS:
        return 1.0
    of_recordings, of_windows = (float(np.sum(each**2)) * _few(len(each)) for each in (together, pulls))
    return max(1.0, of_recordings / max(of_windows, np.finfo(float).tiny))


def _few(count: int) -> float:
    """What squares of so many pulls count, whose sum is zero at the optimum."""
    return count / (count - 1)

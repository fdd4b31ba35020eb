"""What an error counts: as what is new in it, where the errors before it tell the rest."""

import enum
import math
from typing import Final, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from symoden.spaces import Space

LARGEST: Final = 1e100  # Error whose square is a number.

_ORDER: Final = 2  # Lags: mechanisms are of second order, and so is what a force that is not modelled does to them.
_RIDGE: Final = 1e-6  # Relative to the mean square.
_FLOOR: Final = 1e-4  # Of a channel's innovations, relative to their mean variance: what is exact has no weight alone.
_ASTRAY: Final = 0.9  # Share of the squares that one window has if its rollout diverges.
_SAMPLES: Final = 10  # For each coefficient of an autoregression, or none is fitted.


class Errors(enum.Enum):
    """What the errors of a rollout count in a stage of training."""

    ALIKE = "all alike"
    WHITENED = "what is new in them, where starts are as measured"
    AS_FOUND = "the same, unless models were found to predict worse by it"


class Whitening(NamedTuple):
    """Makes independent errors of unlike size out of those of a rollout, which follow each other.

    With the lags A₁ … A_p of a vector autoregression and a scale W, an error e_k becomes W (e_k − Σⱼ Aⱼ e_{k−j}), those
    before the first sample being zero: its innovation, in units in which channels vary alike, but for exact ones.

    Attributes:
        lags: A₁ … A_p.
        scale: W.
    """

    lags: Float[Array, "p o o"]
    scale: Float[Array, "o o"]

    @classmethod
    def none(cls, channels: int) -> "Whitening":
        """The one that changes nothing.

        Args:
            channels: Number of channels.

        Returns:
            No lags, and a scale of one.
        """
        return cls(*map(jax.device_put, (np.zeros((_ORDER, channels, channels)), np.eye(channels))))

    def __call__(self, errors: Float[Array, "k o *P"]) -> Float[Array, "k o *P"]:
        """Innovations of the errors of one window, or of their derivatives.

        Args:
            errors: Sample by sample.

        Returns:
            As many.
        """
        news = errors - jnp.einsum("jab,jkb...->ka...", self.lags, _before(errors))
        return jnp.einsum("ab,kb...->ka...", self.scale, news)


class Weighing(NamedTuple):
    """What errors count, among each other and beside the sensors.

    Attributes:
        level: Root of the variance that an independent residual is expected to have; infinite where windows start from
            the measured states.
        whitening: What is new in an error; where starts are estimated, all of it is.
        effect: How many residuals count as one beside priors: what the whitening has left of their likeness.
        refused: Whether models were found to predict worse by whitened errors.
    """

    level: Float[Array, ""]
    whitening: Whitening
    effect: Float[Array, ""]
    refused: Bool[Array, ""]

    @classmethod
    def plain(cls, channels: int, level: float = math.inf) -> "Weighing":
        """All errors count alike.

        Args:
            channels: Number of channels.
            level: See above.

        Returns:
            The weighing.
        """
        one, accepted = jnp.asarray(1.0, float), jnp.asarray(a=False)
        return cls(jnp.asarray(level, float), Whitening.none(channels), one, accepted)

    @classmethod
    def alike(cls, space: Space, before: "Weighing | None" = None) -> "Weighing":
        """All errors of a mechanism's rollouts count alike.

        Args:
            space: Its space.
            before: The weighing before, if it is to be remembered what was found of whitened errors.

        Returns:
            The weighing.
        """
        plain = cls.plain(space.embedded_size + space.size)
        return plain if before is None else plain._replace(refused=before.refused)

    @property
    def is_whitened(self) -> bool:
        """Whether errors count by what is new in them."""
        return bool(np.any(np.asarray(self.whitening.lags)))

    def refusing(self) -> "Weighing":
        """The same where models were found to predict worse by whitened errors."""
        return self._replace(refused=jnp.asarray(a=True))

    def unwhitened(self) -> "Weighing":
        """The same, but errors count as they are, as they do for who wants to know how well a model predicts."""
        return Weighing.plain(len(self.whitening.scale), float(self.level))

    def whitened(self, residuals: Float[np.ndarray, "B k o"], measured: Float[Array, " o"] | None = None) -> "Weighing":
        """The same with errors weighed by what is new in them; where starts are estimated, all of it is.

        Args:
            residuals: Of every window.
            measured: Which channels tell anything, see `fit_whitening`.

        Returns:
            The weighing.
        """
        if math.isfinite(self.level):
            return self
        return self._replace(whitening=fit_whitening(residuals, measured))


def fit_whitening(residuals: Float[np.ndarray, "B k o"], measured: Float[Array, " o"] | None = None) -> Whitening:
    """Fit an autoregression to the residuals of windows, by least squares over all of them.

    What a force that no model has does to a rollout adds up: its errors grow, and those of late samples are alike.
    Ordinary least squares takes them for so many measurements and fits what is largest; generalised least squares
    weighs them by what they tell, and has the least variance.

    The scale leaves the mean square as it is.

    Rates that were estimated from positions have errors that no autoregression explains, smoothed over as many samples
    as the estimate took: their innovations would look small and weigh most, with what smoothing took away. They are the
    positions once more, and left out.

    Args:
        residuals: Of every window.
        measured: 0 for channels that are left out, whose innovations are zero; if None, there are none.

    Returns:
        The whitening; one that changes nothing where residuals are too few, all zero or not finite, or one window has
        nearly all of them.

    References:
        Aitken (1935), *On least squares and linear combinations of observations*; Cochrane & Orcutt (1949),
        *Application of least squares regression to relationships containing auto-correlated error terms*; Ljung
        (1999), *System identification*, chapter 7: models of the noise.
    """
    every = residuals.shape[2]
    kept = np.flatnonzero(np.ones(every) if measured is None else np.asarray(measured))
    residuals = np.take(residuals, kept, axis=2)
    windows, samples, channels = residuals.shape
    enough = windows * (samples - _ORDER) >= _SAMPLES * _ORDER * channels
    if not enough or not np.abs(residuals).max() < LARGEST:
        return Whitening.none(every)
    squares = np.mean(residuals**2, axis=(1, 2))
    square = float(squares.mean())
    if not square > np.finfo(float).tiny or squares.max() > _ASTRAY * squares.sum():
        return Whitening.none(every)
    errors = residuals / math.sqrt(square)
    before = np.moveaxis(np.asarray(jax.vmap(_before)(jnp.asarray(errors, float))), 1, 2)
    regressors, targets = before.reshape(-1, _ORDER * channels), errors.reshape(-1, channels)
    ridge = _RIDGE * len(targets) * np.eye(_ORDER * channels)
    coefficients = np.linalg.solve(regressors.T @ regressors + ridge, regressors.T @ targets)
    news = targets - regressors @ coefficients
    covariance = news.T @ news / len(news)
    floor = _FLOOR * np.trace(covariance) / channels * np.eye(channels)
    scale = np.linalg.inv(np.linalg.cholesky(covariance + floor))
    scale *= math.sqrt(channels / np.trace(scale @ covariance @ scale.T))
    lags = np.swapaxes(coefficients.reshape(_ORDER, channels, channels), 1, 2)
    whole = np.zeros((_ORDER + 1, every, every))
    whole[:, kept[:, None], kept] = [*lags, scale]
    return Whitening(jnp.asarray(whole[:_ORDER], float), jnp.asarray(whole[_ORDER], float))


def _before(errors: Float[Array, "k o *P"]) -> Float[Array, "p k o *P"]:
    """The errors one sample earlier, two, and so on; zero before the first."""
    padded = jnp.pad(errors, [(_ORDER, 0), *[(0, 0)] * (errors.ndim - 1)])
    return jnp.stack([padded[_ORDER - j : _ORDER - j + len(errors)] for j in range(1, _ORDER + 1)])

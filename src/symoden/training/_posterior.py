"""What data leave open about a model's parameters, and what that says of anything computed."""

import abc
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._flatten import cast

Restore: TypeAlias = Callable[[Float[Array, " P"]], Any]
Quantities: TypeAlias = Callable[[Any], Float[Array, "*K"]]


class AbstractScatter(eqx.Module):
    """How a model's parameters scatter, as a PyTree that compiled functions take."""

    @abc.abstractmethod
    def moments(self, quantities: Quantities) -> tuple[Float[Array, "*K"], Float[Array, "*K"]]:
        """Something computed from a model, and how it scatters.

        Args:
            quantities: A differentiable function of the model.

        Returns:
            Its value, and its mean squared deviation from it.
        """


@dataclass(frozen=True, kw_only=True, eq=False)
class AbstractPosterior(abc.ABC):
    """What the data leave open about a model's parameters.

    Attributes:
        restore: Makes the model from flat parameters.
        theta: Flat parameters of the trained model.
        windows: Number of windows of training data.
    """

    restore: Restore
    theta: Float[np.ndarray, " P"]
    windows: int

    @property
    def model(self) -> Any:  # noqa: ANN401 - any kind of model
        """The trained model, in the user's precision."""
        return cast(self.restore(jnp.asarray(self.theta)), jnp.zeros(()).dtype)

    @abc.abstractmethod
    def quantile(self, level: float) -> float:
        """Half of the width of a band, in standard deviations.

        Args:
            level: Probability that the band is to cover.

        Returns:
            The factor.
        """

    @abc.abstractmethod
    def project(self, quantities: Quantities) -> Float[np.ndarray, "K r"]:
        """How quantities vary with the parameters.

        Args:
            quantities: A differentiable function of the model, with a vector as its value.

        Returns:
            The rows' norms are standard deviations; their products covariances. What no data of positions and
            velocities tell, the common scale of M, V, g and D where nothing fixes it, is part of them.
        """

    def half_width(self, quantities: Quantities, level: float = 0.9) -> Float[np.ndarray, "*K"]:
        """Half of the bands of quantities.

        Args:
            quantities: A differentiable function of the model, such as `lambda model: model.mass_matrix(q)`.
            level: Probability that each band is to cover.

        Returns:
            Half of each band, in the quantities' shape.
        """
        shape = jax.eval_shape(quantities, self.model).shape
        rows = self.project(lambda model: jnp.ravel(quantities(model)))
        return np.asarray(self.quantile(level) * np.linalg.norm(rows, axis=1).reshape(shape))

    @abc.abstractmethod
    def scatter(self) -> AbstractScatter:
        """The same for use inside compiled functions."""

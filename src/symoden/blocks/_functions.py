"""Functions from a configuration to coefficients: networks of the embedded coordinates, learned constants, sums."""

import abc
import itertools
from collections.abc import Callable
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, PRNGKeyArray

from symoden.shapes import Coordinates
from symoden.spaces import Space

from ._known import Known

Coefficients = Float[Array, " k"]

ACTIVATIONS: dict[str, Callable[[Array], Array]] = {
    "tanh": jnp.tanh,
    "silu": jax.nn.silu,
    "gelu": jax.nn.gelu,
    "softplus": jax.nn.softplus,
    "sin": jnp.sin,
}
"""Activation functions of networks by name."""


class AbstractFunction(eqx.Module):
    """Map from a configuration to a vector of coefficients."""

    @abc.abstractmethod
    def __call__(self, q: Coordinates) -> Coefficients:
        """Coefficients at the configuration `q`."""


FRICTION = 1
"""Corrections that are laws of friction: dry and quadratic parts."""
DIRECTIONS = 2
"""Those that make friction depend on the direction."""
ACTUATION = 4
"""Those by which inputs act otherwise from configuration to configuration."""
NETWORKS = 8
"""Networks, which can be anything."""
INERTIA = 16
"""Those by which the inertia depends on lengths."""
POTENTIAL = 32
"""Those by which the potential energy is no polynomial of lengths, or has more than first harmonics of angles."""
CORRECTIONS = FRICTION | DIRECTIONS | ACTUATION | NETWORKS | INERTIA | POTENTIAL
"""All kinds of corrections."""

_WAVES = 2.0  # Spread of the first frequencies of a network of sines, relative to the inputs' scale.


@final
class Perceptron(eqx.Module):
    """Fully connected network with standardised inputs and a linear last layer.

    Attributes:
        weights: Matrices (inputs, outputs) of the layers.
        biases: Offsets of the layers.
        center: Subtracted from the input.
        scale: Divides the centred input.
        activation: Name of the nonlinearity, a key of `ACTIVATIONS`.
    """

    weights: tuple[Float[Array, "_ _"], ...]
    biases: tuple[Float[Array, " _"], ...]
    center: Known
    scale: Known
    activation: str = eqx.field(static=True)

    def __check_init__(self) -> None:
        """Refuse an unknown nonlinearity.

        Raises:
            ValueError: If `activation` is no key of `ACTIVATIONS`.
        """
        if self.activation not in ACTIVATIONS:
            raise ValueError(f"`activation` must be one of {', '.join(ACTIVATIONS)}; got {self.activation!r}.")

    @classmethod
    def init(
        cls,
        sizes: tuple[int, ...],
        *,
        activation: str = "silu",
        center: np.ndarray | None = None,
        scale: np.ndarray | None = None,
        key: PRNGKeyArray,
    ) -> "Perceptron":
        """Draw orthogonal weights and zero biases; sines start with waves of many lengths and any phase.

        Args:
            sizes: Widths of the layers, from the input to the output.
            activation: Name of the nonlinearity.
            center: Subtracted from the input; zeros if absent.
            scale: Divides the centred input; ones if absent.
            key: Source of the weights.

        Returns:
            The network.

        References:
            Sitzmann et al. (2020), *Implicit neural representations with periodic activation functions*: sines need
            a first layer of high frequencies, or they learn smooth functions only.
        """
        wave_key, phase_key, *keys = jax.random.split(key, len(sizes) + 1)
        weights = [_orthogonal(k, *shape) for k, shape in zip(keys, itertools.pairwise(sizes), strict=True)]
        biases = [jnp.asarray(np.zeros(size), float) for size in sizes[1:]]
        if activation == "sin":
            weights[0] = _WAVES * jax.random.normal(wave_key, weights[0].shape, float)
            biases[0] = jax.random.uniform(phase_key, biases[0].shape, float, -jnp.pi, jnp.pi)
            weights[-1] = weights[-1] / _WAVES  # Slopes are forces: of waves they would let first rollouts diverge.
        return cls(
            weights=tuple(weights),
            biases=tuple(biases),
            center=Known(jnp.asarray(np.zeros(sizes[0]) if center is None else center, float)),
            scale=Known(jnp.asarray(np.ones(sizes[0]) if scale is None else scale, float)),
            activation=activation,
        )

    def silenced(self) -> "Perceptron":
        """The same network with an output of zero."""
        last = lambda network: (network.weights[-1], network.biases[-1])
        return eqx.tree_at(last, self, replace_fn=jnp.zeros_like)

    def __call__(self, z: Float[Array, " i"]) -> Float[Array, " o"]:
        """Output of the last layer for one input vector."""
        activate = ACTIVATIONS[self.activation]
        z = (z - self.center.value) / self.scale.value
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            z = activate(z @ weight + bias)
        return z @ self.weights[-1] + self.biases[-1]


@final
class Network(AbstractFunction):
    """Perceptron of the embedded coordinates: 2π-periodic in every angle.

    Attributes:
        space: Configuration space.
        perceptron: Network on the embedding.
    """

    space: Space
    perceptron: Perceptron

    def __call__(self, q: Coordinates) -> Coefficients:
        """Coefficients at the configuration `q`."""
        return self.perceptron(self.space.embed(q))


@final
class Constant(AbstractFunction):
    """Learned coefficients that do not depend on the configuration.

    Attributes:
        values: The coefficients.
    """

    values: Coefficients

    def __call__(self, q: Coordinates) -> Coefficients:
        """The coefficients, whatever `q` is."""
        return as_precise_as(q, self.values)


@final
class Correction(AbstractFunction):
    """A function that starts at zero and stays frozen until validation data ask for it (see `trainable`).

    Attributes:
        function: What is added once it is set free.
        kind: What it is for, a flag: kinds are set free one after the other.
    """

    function: AbstractFunction
    kind: int = eqx.field(static=True, default=NETWORKS)

    def __check_init__(self) -> None:
        """Refuse anything but one kind.

        Raises:
            ValueError: If `kind` is no flag, or several.
        """
        if self.kind not in (FRICTION, DIRECTIONS, ACTUATION, NETWORKS, INERTIA, POTENTIAL):
            raise ValueError(
                f"`kind` must be FRICTION, DIRECTIONS, ACTUATION, NETWORKS, INERTIA or POTENTIAL; got {self.kind}."
            )

    def __call__(self, q: Coordinates) -> Coefficients:
        """Coefficients at the configuration `q`."""
        return self.function(q)


@final
class Sum(AbstractFunction):
    """Sum of functions, such as a learned constant and its correction.

    Attributes:
        terms: What is added.
    """

    terms: tuple[AbstractFunction, ...]

    def __call__(self, q: Coordinates) -> Coefficients:
        """Coefficients at the configuration `q`."""
        return sum((term(q) for term in self.terms[1:]), start=self.terms[0](q))


@final
class Reduced(AbstractFunction):
    """A function on the configuration space modulo the coordinates that nothing depends on.

    Attributes:
        function: Function of the coordinates that are kept.
        kept: Which those are.
    """

    function: AbstractFunction
    kept: tuple[int, ...] = eqx.field(static=True)

    def __call__(self, q: Coordinates) -> Coefficients:
        """Coefficients at the configuration `q`."""
        return self.function(jnp.stack([q[i] for i in self.kept]))  # No gather, which is slow to differentiate.


def as_precise_as(q: Coordinates, values: Float[Array, "*K"]) -> Float[Array, "*K"]:
    """Values that do not depend on a configuration, in the precision of what does.

    Args:
        q: The configuration.
        values: The values.

    Returns:
        The values, no less precise than they were.
    """
    return values.astype(np.promote_types(values.dtype, q.dtype))


def _orthogonal(key: PRNGKeyArray, rows: int, columns: int) -> Float[Array, "_ _"]:
    """A matrix of orthonormal rows or columns, whichever are fewer, drawn evenly: as JAX's initializer does."""
    normal = jax.random.normal(key, (max(rows, columns), min(rows, columns)), float)
    # By NumPy where it can: JAX compiles for every shape, which takes longer than all else that makes a model.
    xp = jnp if isinstance(normal, Tracer) else np
    Q, R = xp.linalg.qr(xp.asarray(normal))
    Q = jnp.asarray(Q * xp.sign(xp.diag(R))[None])
    return Q.T if rows < columns else Q

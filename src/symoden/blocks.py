"""What fills M⁻¹, V, g and D: networks, learned constants, known functions; positive (semi)definite by Cholesky factor.

A *function* maps a configuration to a flat vector of coefficients; a *block* gives those coefficients their shape,
their sign and their physical scale. Every function goes into every block.
"""

import abc
from collections.abc import Callable
from typing import Self, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray, PyTree

from .shapes import Coordinates, DissipationMatrix, Scalar, SquareMatrix, Velocities
from .spaces import Space

Coefficients = Float[Array, " k"]

ACTIVATIONS: dict[str, Callable[[Array], Array]] = {
    "tanh": jnp.tanh,
    "silu": jax.nn.silu,
    "gelu": jax.nn.gelu,
    "softplus": jax.nn.softplus,
    "sin": jnp.sin,
}


@final
class Known(eqx.Module):
    """An array that training leaves alone: a unit's scale, a given input matrix.

    Attributes:
        array: The value.
    """

    array: Float[Array, "..."]

    @property
    def value(self) -> Float[Array, "..."]:
        """The array, cut off from differentiation."""
        return jax.lax.stop_gradient(self.array)


class AbstractFunction(eqx.Module):
    """Map from a configuration to a vector of coefficients."""

    @abc.abstractmethod
    def __call__(self, q: Coordinates) -> Coefficients:
        """Coefficients at the configuration `q`."""


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

    weights: tuple[Float[Array, "i o"], ...]
    biases: tuple[Float[Array, " o"], ...]
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
        cls, sizes: tuple[int, ...], *, activation: str = "silu", last: float = 1.0, key: PRNGKeyArray
    ) -> Self:
        """Draw orthogonal weights and zero biases.

        Args:
            sizes: Widths of the layers, from the input to the output.
            activation: Name of the nonlinearity.
            last: Factor on the last layer's weights; 0 makes the network start as zero.
            key: Source of the weights.

        Returns:
            The network, its inputs not standardised.
        """
        keys = jax.random.split(key, len(sizes) - 1)
        orthogonal = jax.nn.initializers.orthogonal()
        weights = [orthogonal(k, shape, float) for k, shape in zip(keys, zip(sizes, sizes[1:], strict=False), strict=True)]
        weights[-1] = last * weights[-1]
        return cls(
            weights=tuple(weights),
            biases=tuple(jnp.zeros(size, float) for size in sizes[1:]),
            center=Known(jnp.zeros(sizes[0], float)),
            scale=Known(jnp.ones(sizes[0], float)),
            activation=activation,
        )

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
        del q
        return self.values


@final
class Correction(AbstractFunction):
    """A function that starts at zero and stays frozen until validation data ask for it (see `trainable`).

    Attributes:
        function: What is added once it is set free.
    """

    function: AbstractFunction

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


class AbstractBlock(eqx.Module):
    """Field on the configuration space in physical units: M⁻¹, V, g or viscous friction."""

    @abc.abstractmethod
    def __call__(self, q: Coordinates) -> Float[Array, "..."]:
        """Value at the configuration `q`."""


@final
class KnownValue(AbstractBlock):
    """A given constant.

    Attributes:
        value: The constant in physical units.
    """

    value: Known

    def __call__(self, q: Coordinates) -> Float[Array, "..."]:
        """The constant, whatever `q` is."""
        del q
        return self.value.value


@final
class KnownFunction(AbstractBlock):
    """A given function of the configuration.

    Attributes:
        function: Maps q to the value in physical units. It is code, hence not saved with a model.
    """

    function: Callable[[Coordinates], Float[Array, "..."]] = eqx.field(static=True)

    def __call__(self, q: Coordinates) -> Float[Array, "..."]:
        """Value at the configuration `q`."""
        return self.function(q)


@final
class ScalarBlock(AbstractBlock):
    """A scalar field, such as the potential energy.

    Attributes:
        function: Gives one coefficient.
        scale: Physical unit of the coefficient.
    """

    function: AbstractFunction
    scale: Known

    def __call__(self, q: Coordinates) -> Scalar:
        """Value at `q`."""
        return self.scale.value * self.function(q)[0]


@final
class MatrixBlock(AbstractBlock):
    """A matrix field, such as the input matrix.

    Attributes:
        function: Gives the entries, row by row.
        scale: Physical unit of each entry; its shape is the matrix's.
    """

    function: AbstractFunction
    scale: Known

    def __call__(self, q: Coordinates) -> Float[Array, "n m"]:
        """Matrix at `q`."""
        scale = self.scale.value
        return scale * self.function(q).reshape(scale.shape)


@final
class CholeskyBlock(AbstractBlock):
    """A symmetric matrix field S (L Lᵀ + ε I) S, positive definite for ε > 0 and semidefinite for ε = 0.

    Attributes:
        function: Gives the entries of the lower triangle L, row by row.
        scale: Diagonal of S: square roots of the physical units.
        floor: The constant ε that bounds the scaled eigenvalues from below.
    """

    function: AbstractFunction
    scale: Known
    floor: float = eqx.field(static=True, default=0.0)

    def __check_init__(self) -> None:
        """Refuse a negative floor.

        Raises:
            ValueError: If `floor` is negative, for the matrix could then be indefinite.
        """
        if self.floor < 0:
            raise ValueError(f"`floor` must be at least 0; got {self.floor}.")

    def __call__(self, q: Coordinates) -> SquareMatrix:
        """Matrix at `q`."""
        scale = self.scale.value
        factor = scale[:, None] * lower_triangle(self.function(q), size=scale.shape[0])
        return factor @ factor.T + jnp.diag(self.floor * scale**2)


class AbstractFriction(eqx.Module):
    """Dissipation matrix as a function of configuration and velocity, positive semidefinite by construction."""

    @abc.abstractmethod
    def __call__(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Matrix at the configuration `q` and the velocity `v`."""


@final
class ViscousFriction(AbstractFriction):
    """Friction D(q) that does not depend on the velocity; n × n on the momenta, or the paper's full 2n × 2n.

    Attributes:
        matrix: The block D(q).
    """

    matrix: AbstractBlock

    def __call__(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Matrix at the configuration `q`, whatever `v` is."""
        del v
        return self.matrix(q)


@final
class JointFriction(AbstractFriction):
    """Friction D(q, v) = B(q) + S diag(d(v)) S: viscous, dry and quadratic, each joint's own law beside a coupled B.

    With w = vᵢ / `speed`ᵢ, joint i has dᵢ = Σₖ cᵢₖ² φₖ(w): φₖ = 1/√(1 + (w/wₖ)²) is dry (Coulomb) friction smoothed
    below the speed wₖ, φₖ = 1/(1 + (w/wₖ)²) its excess at low speed (Stribeck), and φ = √(1 + w²) − 1 quadratic drag.

    Attributes:
        viscous: The block B(q), n × n.
        coefficients: The cᵢₖ, a row for each joint.
        scale: Diagonal of S: square roots of the physical units.
        speed: Typical speed of each joint.
        knees: The wₖ.

    References:
        Armstrong-Hélouvry, Dupont & Canudas de Wit (1994), *A survey of models, analysis tools and compensation
        methods for the control of machines with friction*, Automatica 30(7), for the shapes of dry friction.
    """

    viscous: AbstractBlock
    coefficients: Float[Array, "n k"]
    scale: Known
    speed: Known
    knees: tuple[float, ...] = eqx.field(static=True)

    @staticmethod
    def laws(knees: tuple[float, ...]) -> int:
        """Number of coefficients of each joint."""
        return 2 * len(knees) + 1

    def __call__(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Matrix at the configuration `q` and the velocity `v`."""
        w = v / self.speed.value
        squared = (w[:, None] / jnp.asarray(self.knees, w.dtype)) ** 2
        shapes = [1 / jnp.sqrt(1 + squared), 1 / (1 + squared), (jnp.sqrt(1 + w**2) - 1)[:, None]]
        joint = jnp.sum(self.coefficients**2 * jnp.concatenate(shapes, axis=1), axis=1)
        return self.viscous(q) + jnp.diag(self.scale.value**2 * joint)


@final
class NoFriction(AbstractFriction):
    """The zero matrix of a conservative system."""

    def __call__(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Zero matrix of the size of `q`."""
        del v
        return jnp.zeros((q.shape[0], q.shape[0]), q.dtype)


def lower_triangle(coefficients: Coefficients, *, size: int) -> SquareMatrix:
    """Fill a lower triangle row by row.

    Args:
        coefficients: `size` (`size` + 1) / 2 entries.
        size: Number of rows.

    Returns:
        The matrix, zero above the diagonal.

    Example:
        >>> lower_triangle(jnp.array([1.0, 2.0, 3.0]), size=2).tolist()
        [[1.0, 0.0], [2.0, 3.0]]
    """
    # Stacking beats scattering: XLA fuses it, and its derivative is a slice.
    rows = np.split(np.arange(size * (size + 1) // 2), np.cumsum(np.arange(1, size)))
    zero = jnp.zeros((), coefficients.dtype)
    return jnp.stack([jnp.stack([*(coefficients[i] for i in row), *[zero] * (size - len(row))]) for row in rows])


def identity_triangle(size: int) -> np.ndarray:
    """Entries of the identity's Cholesky factor, as `lower_triangle` reads them."""
    return np.eye(size)[np.tril_indices(size)]


def trainable(model: PyTree, *, corrections: bool = True) -> PyTree:
    """Say which leaves training may change.

    Args:
        model: Any tree of modules.
        corrections: Whether terms marked as `Correction` are free.

    Returns:
        Tree prefix of booleans, for `eqx.partition`: false for `Known` arrays, for whatever is no array of floats,
        and for frozen corrections.
    """
    fixed = (Known,) if corrections else (Known, Correction)
    return jax.tree.map(
        lambda leaf: not isinstance(leaf, fixed) and eqx.is_inexact_array(leaf),
        model,
        is_leaf=lambda node: isinstance(node, fixed),
    )


def count_parameters(model: PyTree) -> int:
    """Number of trainable parameters.

    Args:
        model: Any tree of modules.

    Returns:
        Number of scalars that training may change, corrections included.
    """
    return sum(leaf.size for leaf in jax.tree.leaves(eqx.filter(model, trainable(model))))

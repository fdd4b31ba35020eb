"""The symmetry that velocity data leave open: one common factor of inertia, energy, actuation and friction."""

import dataclasses
import math
from typing import TypeVar, cast

import numpy as np

from symoden.blocks import (
    AbstractBlock,
    AbstractFriction,
    CholeskyBlock,
    CorrectedBlock,
    CorrectedFriction,
    CorrectedMatrix,
    FormulaBlock,
    FormulaFriction,
    GramBlock,
    InverseBlock,
    JointFriction,
    KnownFriction,
    KnownFunction,
    KnownValue,
    LinksBlock,
    MatrixBlock,
    NoFriction,
    Perceptron,
    ScalarBlock,
    ViscousFriction,
)

from ._baselines import GeometricModel
from ._structured import StructuredModel
from ._unstructured import UnstructuredModel

Model = TypeVar("Model", StructuredModel, UnstructuredModel, GeometricModel)


def rescale(model: Model, beta: float) -> Model:
    """Change the unit of momentum, p' = p/β, which leaves every prediction as it was.

    With it M⁻¹' = β M⁻¹, V' = V/β, g' = g/β and D' = D/β (in the paper's full D, the blocks on ∂H/∂q and ∂H/∂p
    change by β and 1/β). Only given scales change, and what rigid bodies weigh; the weights
    stay. With β = learned g / true g, learned parts can be held against true ones.

    Args:
        model: Model of velocity data.
        beta: The factor β, positive.

    Returns:
        The equivalent model.

    Raises:
        TypeError: If the model has no inertia, as the naive one.
        ValueError: If `beta` is not positive and finite, or the model's rates are momenta, which fix the factor.

    References:
        Zhong, Dey & Chakraborty (2020), *Dissipative SymODEN*: the scale β of its figures.

    Example:
        >>> import jax
        >>> import jax.numpy as jnp
        >>> from symoden.models import ModelConfig, build
        >>> from symoden.spaces import Space
        >>> model = build(ModelConfig(), Space.parse("T1"), 1, key=jax.random.key(0))
        >>> q = jnp.zeros(1)
        >>> bool(jnp.allclose(rescale(model, 4.0).inverse_mass_matrix(q), 4 * model.inverse_mass_matrix(q)))
        True
    """
    if not (math.isfinite(beta) and beta > 0):
        raise ValueError(f"`beta` must be positive and finite; got {beta}.")
    if not isinstance(model, StructuredModel | UnstructuredModel | GeometricModel):
        raise TypeError(f"A model must have an inertia for its scale to be changed; {type(model).__name__} has none.")
    if model.momenta:
        raise ValueError("A model of momentum data has no free scale: the momenta are measured.")
    inverse_mass = _block(cast("AbstractBlock", model.inverse_mass), beta)
    if isinstance(model, GeometricModel):
        n = model.space.size
        scale = model.scale.times(np.repeat([1.0, 1 / beta], n))
        flow = _with_momenta(model.flow, model.space.embedded_size, n, 1 / beta)
        return dataclasses.replace(model, inverse_mass=inverse_mass, flow=flow, scale=scale)
    parts = {"actuation": _block(model.actuation, 1 / beta), "friction": _friction(model.friction, model, beta)}
    if isinstance(model, UnstructuredModel):
        parts["energy"] = _with_momenta(model.energy, model.space.embedded_size, model.space.size, 1 / beta)
        parts["energy_scale"] = model.energy_scale.times(1 / beta)
        return dataclasses.replace(model, inverse_mass=inverse_mass, **parts)
    parameters = model.parameters
    if parameters is not None and parameters.links is not None:
        parameters = dataclasses.replace(parameters, links=parameters.links.times(1 / beta))
    potential = _block(model.potential, 1 / beta)
    return dataclasses.replace(model, inverse_mass=inverse_mass, potential=potential, parameters=parameters, **parts)


def _block(block: AbstractBlock, factor: float) -> AbstractBlock:
    """Scale a field."""
    match block:
        case InverseBlock():
            return InverseBlock(_block(block.matrix, 1 / factor))
        case LinksBlock():
            return block  # The bodies take the factor.
        case FormulaBlock():
            return dataclasses.replace(block, unit=block.unit.times(factor))
        case KnownValue() | KnownFunction() | CorrectedBlock() | CorrectedMatrix():
            return _given(block, factor)
        case CholeskyBlock() | GramBlock():
            return dataclasses.replace(block, scale=block.scale.times(math.sqrt(factor)))
        case ScalarBlock() | MatrixBlock():
            return dataclasses.replace(block, scale=block.scale.times(factor))
    raise ValueError(f"Every block must be one of `symoden.blocks`; got {type(block).__name__}. Scale it yourself.")


def _given(block: KnownValue | KnownFunction | CorrectedBlock | CorrectedMatrix, factor: float) -> AbstractBlock:
    """Scale a field that was given."""
    match block:
        case KnownValue():
            return KnownValue(block.value.times(factor))
        case KnownFunction():
            function = block.function
            return KnownFunction(lambda q: factor * function(q))
        case CorrectedBlock():
            return CorrectedBlock(_block(block.given, factor), _block(block.correction, factor))
        case CorrectedMatrix():
            return CorrectedMatrix(_block(block.given, factor), block.correction)


def _friction(friction: AbstractFriction, model: StructuredModel | UnstructuredModel, beta: float) -> AbstractFriction:
    """Scale friction: on the momenta by 1/β; on the full state also by β where it acts on ∂H/∂q."""
    match friction:
        case NoFriction():
            return friction
        case FormulaFriction() | KnownFriction() | CorrectedFriction():
            return _given_friction(friction, model, beta)
        case JointFriction():
            return dataclasses.replace(friction, scale=friction.scale.times(beta**-0.5))
        case ViscousFriction(matrix=CholeskyBlock() as matrix) if len(matrix.scale.array) == 2 * model.space.size:
            halves = np.repeat([beta**0.5, beta**-0.5], model.space.size)
            return ViscousFriction(dataclasses.replace(matrix, scale=matrix.scale.times(halves)))
        case ViscousFriction():
            return ViscousFriction(_block(friction.matrix, 1 / beta))
    raise ValueError(f"Friction must be one of `symoden.blocks`; got {type(friction).__name__}. Scale it yourself.")


def _given_friction(
    friction: FormulaFriction | KnownFriction | CorrectedFriction,
    model: StructuredModel | UnstructuredModel,
    beta: float,
) -> AbstractFriction:
    """Scale friction that was given."""
    match friction:
        case FormulaFriction():
            return dataclasses.replace(friction, unit=friction.unit.times(1 / beta))
        case KnownFriction():
            function = friction.function
            return KnownFriction(lambda q, v: function(q, v) / beta)
        case CorrectedFriction():
            return CorrectedFriction(_friction(friction.given, model, beta), friction.correction)


def _with_momenta(network: Perceptron, start: int, size: int, factor: float) -> Perceptron:
    """Let a network read momenta of another unit, which stand after `start` in its input."""
    factors = np.ones(len(network.scale.array))
    factors[start : start + size] = factor
    return dataclasses.replace(network, center=network.center.times(factors), scale=network.scale.times(factors))

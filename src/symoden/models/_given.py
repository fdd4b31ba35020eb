"""What of a model was given, and whether that fixes the scale of the rest."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Final, Literal, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from symoden.blocks import (
    CorrectedBlock,
    CorrectedFriction,
    CorrectedMatrix,
    Formula,
    FormulaBlock,
    FormulaFriction,
    InverseBlock,
    KnownFriction,
    KnownFunction,
    KnownValue,
    LinksBlock,
    ViscousFriction,
    trainable,
)
from symoden.mechanics import AbstractDynamics, gradient

from ._structured import StructuredModel
from ._unstructured import UnstructuredModel

Given: TypeAlias = Literal["given", "given up to parameters", "given up to a correction"]
"""How far a part of a model is given."""

_STATES: Final = 16
_SMALL: Final = 1e-3  # Relative; single precision, and states drawn at random.


def given_parts(model: AbstractDynamics) -> dict[str, Given]:
    """Say which parts of a model were given.

    Args:
        model: Any model.

    Returns:
        By the part's name, how much of it was given; parts that were learned are left out.

    Example:
        >>> from symoden.models import ModelConfig, build
        >>> from symoden.spaces import Space
        >>> model = build(ModelConfig(), Space.parse("T1"), 1, input_matrix=np.eye(1), key=jax.random.key(0))
        >>> given_parts(model)
        {'input_matrix': 'given'}
    """
    blocks: dict[str, object] = {}
    if isinstance(model, StructuredModel):
        mass = model.inverse_mass
        blocks["mass_matrix"] = mass.matrix if isinstance(mass, InverseBlock) else mass
        blocks["potential_energy"] = model.potential
    if isinstance(model, StructuredModel | UnstructuredModel):
        friction = model.friction
        blocks["input_matrix"] = model.actuation if model.inputs else None
        blocks["dissipation_matrix"] = friction.matrix if isinstance(friction, ViscousFriction) else friction
    return {name: how for name, block in blocks.items() if (how := _how(block)) is not None}


def energies_are_given(model: AbstractDynamics) -> bool:
    """Whether M and V are given, at least up to something.

    Args:
        model: Any model.

    Returns:
        Whether they are.
    """
    return {"mass_matrix", "potential_energy"} <= set(given_parts(model))


def parts_that_fix_the_scale(model: AbstractDynamics) -> tuple[str, ...]:
    """Name the given parts that leave no common factor of inertia, energy, input and friction open.

    A part that is zero fixes nothing, nor does one whose parameters can take the factor up: then P lies in the span of
    the ∂P/∂θ.

    Args:
        model: Any model.

    Returns:
        Parts each of which fixes the scale; if none does, but they do so together, those that were given.
    """
    if not isinstance(model, StructuredModel | UnstructuredModel):
        return ()
    names = [name for name, how in given_parts(model).items() if how != "given up to a correction"]
    found = {name: _value_and_slopes(model, name) for name in names}
    alone = tuple(name for name in names if _is_fixed([found[name]]))
    return alone or (tuple(names) if names and _is_fixed(list(found.values())) else ())


def _how(block: object) -> Given | None:
    """How much of a block was given."""
    match block:
        case KnownValue() | KnownFunction() | KnownFriction():
            return "given"
        case FormulaBlock(formula=formula) | FormulaFriction(formula=formula):
            return "given up to parameters" if _has_parameters(formula) else "given"
        case LinksBlock():
            return "given up to parameters"
        case CorrectedBlock() | CorrectedMatrix() | CorrectedFriction():
            return "given up to a correction"
    return None


def _has_parameters(formula: Formula) -> bool:
    """Whether a formula has a number that is learned."""
    return any(expression.names & set(formula.parameters) for expression in formula.expressions)


@eqx.filter_jit
def _value_and_slopes(
    model: StructuredModel | UnstructuredModel, name: str
) -> tuple[Float[Array, " r"], Float[Array, "r k"]]:
    """A part at some states, and its derivatives by the learned parameters."""
    generator = np.random.default_rng(0)
    q, v = (jnp.asarray(generator.normal(size=(_STATES, model.space.size)), float) for _ in range(2))

    def part(model: StructuredModel | UnstructuredModel) -> Float[Array, " r"]:
        of: dict[str, Callable[..., Array]] = {
            "mass_matrix": lambda q, v: model.mass_matrix(q),
            "potential_energy": lambda q, v: gradient(model, q),
            "input_matrix": lambda q, v: model.input_matrix(q),
            "dissipation_matrix": model.dissipation_matrix,
        }
        return jax.vmap(of[name])(q, v).ravel()

    value = part(model)
    parameters = model.parameters if isinstance(model, StructuredModel) else None
    if parameters is None:
        return value, jnp.zeros((len(value), 0), value.dtype)

    free, rest = eqx.partition(parameters, trainable(parameters))
    theta, restore = ravel_pytree(jax.tree.map(lambda leaf: leaf.astype(q.dtype), free))

    def at(theta: Float[Array, " k"]) -> Float[Array, " r"]:
        return part(dataclasses.replace(model, parameters=eqx.combine(restore(theta), rest)))

    return value, jax.jacfwd(at)(theta)


def _is_fixed(found: Sequence[tuple[Array, Array]]) -> bool:
    """Whether no change of the parameters does what a common factor does."""
    parts = []
    for value, slopes in ((np.asarray(value), np.asarray(slopes)) for value, slopes in found):
        told = np.isfinite(value) & np.isfinite(slopes).all(axis=1)  # A formula may have a root or a logarithm.
        parts.append((value[told], slopes[told]))
    values = np.concatenate([value / (np.linalg.norm(value) or 1) for value, _ in parts])
    slopes = np.concatenate([slope / (np.linalg.norm(value) or 1) for value, slope in parts])
    left = values - slopes @ np.linalg.lstsq(slopes, values, rcond=1e-6)[0] if slopes.shape[1] else values
    return bool(np.linalg.norm(left) > _SMALL)

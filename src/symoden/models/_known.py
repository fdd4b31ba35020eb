"""Blocks of the parts of a mechanism that are given."""

import dataclasses
import warnings
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from symoden.blocks import (
    AbstractBlock,
    AbstractFriction,
    Congruence,
    CorrectedBlock,
    CorrectedFriction,
    CorrectedMatrix,
    Formula,
    FormulaBlock,
    FormulaFriction,
    InverseBlock,
    Known,
    KnownFriction,
    KnownFunction,
    KnownValue,
    Links,
    LinksBlock,
    Parameters,
    ViscousFriction,
)
from symoden.known import KnownParts, Robot
from symoden.spaces import Space

from ._structured import StructuredModel


class KnownBlocks(NamedTuple):
    """Blocks of what is given; None for what is learned.

    Attributes:
        mass: M, not inverted.
        potential: V.
        actuation: g.
        friction: D.
        parameters: Parameters that formulas share, and rigid bodies.
    """

    mass: AbstractBlock | None = None
    potential: AbstractBlock | None = None
    actuation: AbstractBlock | None = None
    friction: AbstractFriction | None = None
    parameters: Parameters | None = None


class Corrections(NamedTuple):
    """What corrects given parts that are only nearly right.

    Attributes:
        mass: Matrix C of M' = C M Cᵀ.
        potential: Added to V.
        actuation: Added to g.
        friction: Matrix C of D' = C D Cᵀ.
    """

    mass: Congruence
    potential: AbstractBlock
    actuation: AbstractBlock
    friction: Congruence


def insert_known(
    model: StructuredModel, known: KnownParts, corrections: Corrections, units: Mapping[str, float] | None = None
) -> StructuredModel:
    """Put what is given in the place of what would be learned.

    Args:
        model: Model that learns all of its blocks.
        known: The given parts.
        corrections: What corrects those of which `known` says so.
        units: Natural units of parameters that start at 0; ones if absent.

    Returns:
        The model.

    Raises:
        ValueError: If a part has another shape than its block.
    """
    given = known_blocks(known, model.space, model.inputs, units)
    mass, potential, actuation, friction = given.mass, given.potential, given.actuation, given.friction
    if mass is not None:
        mass = InverseBlock(CorrectedMatrix(mass, corrections.mass) if "mass_matrix" in known.correct else mass)
    if potential is not None and "potential_energy" in known.correct:
        potential = CorrectedBlock(potential, corrections.potential)
    if actuation is not None and "input_matrix" in known.correct:
        actuation = CorrectedBlock(actuation, corrections.actuation)
    if friction is not None and "dissipation_matrix" in known.correct:
        friction = CorrectedFriction(friction, corrections.friction)
    return dataclasses.replace(
        model,
        inverse_mass=model.inverse_mass if mass is None else mass,
        potential=model.potential if potential is None else potential,
        actuation=model.actuation if actuation is None else actuation,
        friction=model.friction if friction is None else friction,
        parameters=given.parameters,
    )


def known_blocks(known: KnownParts, space: Space, inputs: int, units: Mapping[str, float] | None = None) -> KnownBlocks:
    """Make the blocks of what is given.

    Args:
        known: The given parts.
        space: Configuration space, of n coordinates.
        inputs: Number of inputs m.
        units: Natural units of parameters that start at 0; ones if absent.

    Returns:
        The blocks.

    Raises:
        ValueError: If a part has another shape than its block, or a formula a coordinate that is not there.
    """
    n = space.size
    _refuse_coordinates("cyclic", set(known.cyclic), space)
    shapes = {"mass_matrix": (n, n), "potential_energy": (), "input_matrix": (n, inputs), "dissipation_matrix": (n, n)}
    found: dict[str, Any] = {
        name: _part(known, name, shapes[name], space) for name in known.given if getattr(known, name) is not None
    }
    links = None
    if known.robot is not None:
        links, one = _links(known.robot, space), Known.of(1.0)
        found |= {part: LinksBlock(part, one) for part in ("mass_matrix", "potential_energy")}
    friction = found.get("dissipation_matrix")
    if isinstance(friction, AbstractBlock):
        friction = ViscousFriction(friction)
    named = Parameters.init(dict(known.parameters), links, units) if known.parameters or links is not None else None
    return KnownBlocks(
        mass=found.get("mass_matrix"),
        potential=found.get("potential_energy"),
        actuation=found.get("input_matrix"),
        friction=friction,
        parameters=named,
    )


def _links(robot: Robot, space: Space) -> Links:
    """The bodies of a robot whose joints are the coordinates."""
    names = [body.joint for body in sorted(robot.bodies, key=lambda body: body.coordinate)]
    if len(names) != space.size:
        raise ValueError(
            f"A robot must have one joint for each of the {space.size} coordinates; got {len(names)}: "
            f"{', '.join(names)}. Name those that move in `joints`, in the order of the positions."
        )
    for body in robot.bodies:
        if body.prismatic and space.is_angle[body.coordinate]:
            raise ValueError(
                f"Joint `{body.joint}` slides, but the space {space} has an angle for it, q{body.coordinate + 1}. "
                "Correct the space, or the order of `joints`."
            )
    return Links.of(robot)


def _part(known: KnownParts, name: str, shape: tuple[int, ...], space: Space) -> AbstractBlock | AbstractFriction:
    """Block of one part: a function, a constant or formulas."""
    part, texts = getattr(known, name), known.formulas(name)
    moves = name == "dissipation_matrix"
    if texts is None:
        _refuse_other_shape(name, shape, part, space, moves=moves)
        if isinstance(part, AbstractBlock | AbstractFriction):
            return part
        with warnings.catch_warnings():  # A module's arrays are to stay as they are, of which Equinox warns.
            warnings.filterwarnings("ignore", message="A JAX array is being set as static")
            return KnownFriction(part) if moves else KnownFunction(part)
    given = () if name == "potential_energy" else (len(part), len(part[0]))
    if given != shape:
        raise ValueError(f"`{name}` must be {_size(shape)}; got {_size(given)}. Give one row per coordinate.")
    formula = Formula(texts, shape, tuple(known.constants.items()), tuple(known.parameters))
    names = {name for expression in formula.expressions for name in expression.names}
    _refuse_coordinates(name, names - set(known.constants) - set(known.parameters), space)
    one = Known.of(1.0)
    if not names - set(known.constants):
        return KnownValue(Known(formula(jnp.zeros(space.size, float))))
    if moves and any(name.startswith("v") for name in names - set(known.constants) - set(known.parameters)):
        return FormulaFriction(formula, one)
    return FormulaBlock(formula, one)


def _refuse_coordinates(part: str, names: set[str], space: Space) -> None:
    """Refuse names of coordinates that the space does not have."""
    beyond = sorted(name for name in names if int(name[1:]) > space.size)
    if beyond:
        raise ValueError(
            f"`{part}`: the space {space} has the coordinates q1 to q{space.size}; got `{beyond[0]}`. Correct the "
            "name, or the space."
        )


def _refuse_other_shape(
    name: str, shape: tuple[int, ...], part: Callable[..., Any], space: Space, *, moves: bool
) -> None:
    """Refuse a function that gives no array of its block's shape, or that JAX cannot trace."""
    q = jnp.zeros(space.size, float)
    both = isinstance(part, AbstractFriction) or (moves and not isinstance(part, AbstractBlock))
    try:
        value = eqx.filter_eval_shape(part, *((q, q) if both else (q,)))
    except (jax.errors.JAXTypeError, jax.errors.JAXIndexError) as error:
        raise ValueError(
            f"`{name}` must be a function that JAX can trace and differentiate; it wants numbers in place of arrays. "
            "Write `jax.numpy` in place of `numpy`, `float` and `math`, and `jnp.where` in place of `if` and of "
            "`x[x > 0]`."
        ) from error
    if value is None or isinstance(value, list | tuple | dict):
        raise ValueError(
            f"`{name}` must be a function that gives an array; got {type(value).__name__}. Return `jnp.array(…)`."
        )
    given = np.shape(value)
    if given != shape:
        raise ValueError(
            f"`{name}` must be a function that gives an array, {_size(shape)}; got {_size(given)}. One state goes in, "
            "without a batch."
        )


def _size(shape: tuple[int, ...]) -> str:
    """A shape in words."""
    return " × ".join(map(str, shape)) if shape else "one number"

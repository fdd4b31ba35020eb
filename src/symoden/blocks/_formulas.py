"""Formulas as blocks: their text is data, and their parameters are learned once for all blocks that use them."""

from collections.abc import Callable, Mapping
from typing import Final, TypeVar, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from symoden.known import Expression
from symoden.shapes import Coordinates, DissipationMatrix, Velocities

from ._fields import AbstractBlock
from ._friction import AbstractFriction
from ._known import Known
from ._links import Links, LinksBlock

Tree = TypeVar("Tree", bound=PyTree)

_FUNCTIONS: Final[dict[str, Callable[[Array], Array]]] = {
    "sin": jnp.sin,
    "cos": jnp.cos,
    "tan": jnp.tan,
    "asin": jnp.arcsin,
    "acos": jnp.arccos,
    "atan": jnp.arctan,
    "sinh": jnp.sinh,
    "cosh": jnp.cosh,
    "tanh": jnp.tanh,
    "exp": jnp.exp,
    "log": jnp.log,
    "sqrt": jnp.sqrt,
    "abs": jnp.abs,
}


@final
class Parameters(eqx.Module):
    """Numbers with names and start values: start · exp(θ), or unit · θ where the start is 0.

    θ is zero at the start and of order one whatever the unit, so that a prior on it pulls to the start value; and a
    mass or a coefficient of friction keeps its sign.

    Attributes:
        names: Names in formulas.
        start: Start values.
        theta: What is learned.
        links: Rigid bodies, whose numbers are learned likewise; None without any.
        unit: Natural unit of each number that starts at 0, for the others anything; None for ones.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    start: Known
    theta: Float[Array, " k"]
    links: Links | None = None
    unit: Known | None = None

    @classmethod
    def init(
        cls, start: dict[str, float], links: Links | None = None, units: Mapping[str, float] | None = None
    ) -> "Parameters":
        """Begin at the start values, what starts at 0 in units of 1 where none is given."""
        values = jnp.asarray(list(start.values()), float)
        unit = Known(jnp.asarray([units.get(name, 1.0) for name in start], float)) if units else None
        return cls(tuple(start), Known(values), jnp.zeros_like(values), links, unit)

    @property
    def quantities(self) -> dict[str, Array]:
        """All that is learned, in physical units, by name."""
        named = {name: self.values[i] for i, name in enumerate(self.names)}
        return named if self.links is None else named | self.links.quantities

    @property
    def values(self) -> Float[Array, " k"]:
        """Values now, in physical units."""
        start = self.start.value
        additive = self.theta if self.unit is None else self.unit.value * self.theta
        return jnp.where(start == 0, additive, start * jnp.exp(self.theta))


@final
class Formula(eqx.Module):
    """Formulas of the configuration and the velocity, as an array.

    Attributes:
        texts: The formulas, row by row.
        shape: Shape of the array.
        constants: Names and values that stay.
        parameters: Names that are learned.
        values: Values of the parameters, which `with_parameters` fills in.
    """

    texts: tuple[str, ...] = eqx.field(static=True)
    shape: tuple[int, ...] = eqx.field(static=True)
    constants: tuple[tuple[str, float], ...] = eqx.field(static=True, default=())
    parameters: tuple[str, ...] = eqx.field(static=True, default=())
    values: Float[Array, " k"] | None = None
    expressions: tuple[Expression, ...] = eqx.field(static=True, init=False)

    def __post_init__(self) -> None:
        """Read the formulas."""
        self.expressions = tuple(Expression(text) for text in self.texts)

    def __call__(self, q: Coordinates, v: Velocities | None = None) -> Float[Array, "..."]:
        """Array at the configuration `q` and, where the formulas have it, the velocity `v`."""
        values: dict[str, Array] = {f"q{i + 1}": q[i] for i in range(q.shape[0])}
        if v is not None:
            values |= {f"v{i + 1}": v[i] for i in range(v.shape[0])}
        values |= {name: jnp.asarray(value, q.dtype) for name, value in self.constants}
        if self.values is not None:
            values |= {name: self.values[i] for i, name in enumerate(self.parameters)}
        entries = [
            expression.evaluate(values, number=lambda number: jnp.asarray(number, q.dtype), functions=_FUNCTIONS)
            for expression in self.expressions
        ]
        return jnp.stack(entries).reshape(self.shape)


def with_parameters(tree: Tree, parameters: Parameters | None) -> Tree:
    """Give every formula in a tree the values of its parameters, and every block of rigid bodies these.

    They are kept once in a model, since formulas of several blocks share them.

    Args:
        tree: A block.
        parameters: The parameters; None where there are none.

    Returns:
        The tree, ready to be called.
    """
    if parameters is None:
        return tree

    def fill(node: PyTree) -> PyTree:
        match node:
            case Formula():
                return Formula(node.texts, node.shape, node.constants, parameters.names, parameters.values)
            case LinksBlock():
                return LinksBlock(node.part, node.unit, parameters.links)
        return node

    return jax.tree.map(fill, tree, is_leaf=lambda node: isinstance(node, Formula | LinksBlock))


@final
class FormulaBlock(AbstractBlock):
    """A field given by formulas.

    Attributes:
        formula: The formulas.
        unit: Factor, 1 unless the unit of momentum was changed.
    """

    formula: Formula
    unit: Known

    def __call__(self, q: Coordinates) -> Float[Array, "..."]:
        """Value at the configuration `q`."""
        return self.unit.value * self.formula(q)


@final
class FormulaFriction(AbstractFriction):
    """A dissipation matrix given by formulas.

    Attributes:
        formula: The formulas.
        unit: Factor, 1 unless the unit of momentum was changed.
    """

    formula: Formula
    unit: Known

    def __call__(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Matrix at the configuration `q` and the velocity `v`."""
        return self.unit.value * self.formula(q, v)

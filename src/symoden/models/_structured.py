"""Port-Hamiltonian model with kinetic plus potential energy: the paper's dissipative SymODEN, and SymODEN without D."""

import functools
import inspect
from collections.abc import Callable
from typing import TypeVar, cast, final

import equinox as eqx

from symoden.blocks import (
    AbstractBlock,
    AbstractFriction,
    InverseBlock,
    Parameters,
    inverse_of_positive,
    with_parameters,
)
from symoden.mechanics import AbstractMechanical
from symoden.shapes import Coordinates, DissipationMatrix, InputMatrix, Scalar, SquareMatrix, Velocities, floats
from symoden.spaces import Space

_Method = TypeVar("_Method", bound=Callable)


def traced_once(method: _Method) -> _Method:
    """The method as a program of its own, which JAX traces and differentiates once for all that compute with it.

    Args:
        method: The method.

    Returns:
        The program; it takes lists of numbers, too.
    """
    # Tracing is half of the time that programs take until they run (`benchmarks/`), and a vector field asks for M⁻¹
    # several times. Outside of programs it is one call instead of hundreds.
    program, signature = eqx.filter_jit(method), inspect.signature(method)

    @functools.wraps(method)
    def called(self: eqx.Module, *places: object, **named: object) -> object:
        _, *given = signature.bind(self, *places, **named).arguments.items()
        return program(self, **{name: floats(value, f"`{name}`") for name, value in given})

    return cast("_Method", called)


@final
class StructuredModel(AbstractMechanical):
    """Learned H(q, p) = ½ pᵀ M⁻¹(q) p + V(q), input matrix g(q) and friction D(q, v).

    Attributes:
        space: Configuration space.
        inputs: Number of inputs.
        momenta: Whether the rates in the data are momenta.
        inverse_mass: Block of M⁻¹(q).
        potential: Block of V(q).
        actuation: Block of g(q).
        friction: D(q, v); `NoFriction` makes it the paper's SymODEN.
        parameters: Learned parameters that given formulas in the blocks share; None without any.

    References:
        Zhong, Dey & Chakraborty (2020), *Dissipative SymODEN*, section 3.
    """

    space: Space
    inputs: int = eqx.field(static=True)
    momenta: bool = eqx.field(static=True)
    inverse_mass: AbstractBlock
    potential: AbstractBlock
    actuation: AbstractBlock
    friction: AbstractFriction
    parameters: Parameters | None = None

    @traced_once
    def inverse_mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Learned M⁻¹, or the inverse of the given M."""
        return with_parameters(self.inverse_mass, self.parameters)(q)

    @traced_once
    def mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inverse of the learned M⁻¹, or the given M."""
        block = with_parameters(self.inverse_mass, self.parameters)
        return block.matrix(q) if isinstance(block, InverseBlock) else inverse_of_positive(block(q))

    @traced_once
    def potential_energy(self, q: Coordinates) -> Scalar:
        """Learned V, known up to a constant, or the given one."""
        return with_parameters(self.potential, self.parameters)(q)

    @traced_once
    def input_matrix(self, q: Coordinates) -> InputMatrix:
        """Learned or given g."""
        return with_parameters(self.actuation, self.parameters)(q)

    @traced_once
    def dissipation_matrix(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Learned or given D."""
        return with_parameters(self.friction, self.parameters)(q, v)

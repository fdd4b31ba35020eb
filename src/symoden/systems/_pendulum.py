"""Pendulum: a uniform rod on a hinge."""

from typing import final

import equinox as eqx
import jax.numpy as jnp

from symoden.shapes import Coordinates, DissipationMatrix, InputMatrix, Scalar, SquareMatrix, Velocities
from symoden.spaces import Space

from ._parameters import Parameter, require_non_negative, require_positive
from ._planar import AbstractPlanarMechanism, Points


@final
class Pendulum(AbstractPlanarMechanism):
    """Uniform rod swinging in a vertical plane under gravity, torque and friction.

    With q the angle from the downward vertical [rad], p its momentum [kg m²/s] and u the torque about the hinge
    [N m],

        H(q, p) = ½ p² / (m l²/3) + ½ m g l (1 − cos q),   q̇ = ∂H/∂p,   ṗ = −∂H/∂q − d q̇ + u.

    With `upright`, q is measured from the upward vertical instead, as Gymnasium's `Pendulum-v1` does, and the
    potential energy is ½ m g l (1 + cos q).

    Attributes:
        mass: Mass m of the rod [kg].
        length: Length l of the rod [m].
        gravity: Acceleration of gravity g [m/s²].
        damping: Viscous friction d at the hinge [N m s/rad].
        upright: Whether q = 0 is the upward vertical; otherwise it is the downward one.
        momenta: Whether the rates in the data are momenta; otherwise they are velocities.
        space: Configuration space.
        inputs: Number of inputs.

    References:
        Zhong, Dey & Chakraborty (2020), *Dissipative SymODEN*, section 4.2: M⁻¹ = 3, V = 5 (1 − cos q), D = 0.1.
        Gymnasium, `Pendulum-v1`: q̈ = 3 g/(2 l) sin q + 3/(m l²) u.

    Example:
        >>> round(float(Pendulum().potential_energy(jnp.array([jnp.pi]))), 4)
        9.81
    """

    mass: Parameter = 1.0
    length: Parameter = 1.0
    gravity: Parameter = 9.81
    damping: Parameter = 0.0
    upright: bool = eqx.field(default=False, static=True)
    momenta: bool = eqx.field(default=False, static=True)
    space: Space = eqx.field(init=False, static=True)
    inputs: int = eqx.field(init=False, static=True)

    def __post_init__(self) -> None:
        """Set what follows from the kind of mechanism: one angle, one torque."""
        self.space = Space((True,))
        self.inputs = 1

    def __check_init__(self) -> None:
        """Refuse parameters that are unphysical or make the pendulum active.

        Raises:
            ValueError: If `mass` or `length` is not positive, or `gravity` or `damping` is negative.
        """
        require_positive(mass=self.mass, length=self.length)
        require_non_negative(gravity=self.gravity, damping=self.damping)

    def potential_energy(self, q: Coordinates) -> Scalar:
        """Potential energy [J], zero where the rod hangs."""
        height = 1 + jnp.cos(q[0]) if self.upright else 1 - jnp.cos(q[0])
        return 0.5 * self.mass * self.gravity * self.length * height

    def mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inertia about the hinge, m l²/3 [kg m²]."""
        return jnp.asarray([[self.mass * self.length**2 / 3]], q.dtype)

    def inverse_mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inverse inertia about the hinge, 3/(m l²) [1/(kg m²)]."""
        return jnp.asarray([[3 / (self.mass * self.length**2)]], q.dtype)

    def input_matrix(self, q: Coordinates) -> InputMatrix:
        """The input is the torque about the hinge."""
        return jnp.ones((1, 1), q.dtype)

    def dissipation_matrix(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Viscous friction at the hinge [N m s/rad]."""
        del v
        return jnp.asarray([[self.damping]], q.dtype)

    def points(self, q: Coordinates) -> Points:
        """Places of hinge and tip [m]."""
        upward = 1 if self.upright else -1
        return self.length * jnp.asarray([[0.0, 0.0], [-upward * jnp.sin(q[0]), upward * jnp.cos(q[0])]], q.dtype)

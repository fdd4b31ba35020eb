"""Cart-pole: a pole on a hinge that rides on a cart."""

from typing import final

import equinox as eqx
import jax.numpy as jnp

from symoden.shapes import Coordinates, DissipationMatrix, InputMatrix, Scalar, SquareMatrix, Velocities
from symoden.spaces import Space

from ._inverse import inverse_of_symmetric_2x2
from ._parameters import Parameter, require_non_negative, require_positive
from ._planar import AbstractPlanarMechanism, Points


@final
class CartPole(AbstractPlanarMechanism):
    """Uniform pole hinged to a cart on a horizontal rail.

    With q = (x, θ), x the cart's place [m] and θ the pole's angle from the upward vertical [rad], positive towards
    positive x, and l half the pole's length,

        M(q) = [[m_c + m_p, m_p l cos θ], [m_p l cos θ, 4/3 m_p l²]],   V(q) = m_p g l (1 + cos θ).

    The input is the force on the cart [N]; if `fully_actuated`, a torque at the hinge [N m] follows it.

    Attributes:
        cart_mass: Mass m_c of the cart [kg].
        pole_mass: Mass m_p of the pole [kg].
        half_length: Distance l from the hinge to the pole's centre [m].
        gravity: Acceleration of gravity g [m/s²].
        cart_damping: Viscous friction of the cart on its rail [N s/m].
        pole_damping: Viscous friction at the hinge [N m s/rad].
        fully_actuated: Whether there is a torque at the hinge beside the force on the cart.
        momenta: Whether the rates in the data are momenta; otherwise they are velocities.
        space: Configuration space.
        inputs: Number of inputs.

    References:
        Barto, Sutton & Anderson (1983), *Neuronlike adaptive elements that can solve difficult learning control
        problems*, appendix; Florian (2007), *Correct equations for the dynamics of the cart-pole system*, eq. (23).
        Zhong, Dey & Chakraborty (2020), *Dissipative SymODEN*, section 4.4: the values of the defaults.

    Example:
        >>> CartPole().mass_matrix(jnp.zeros(2))[0].tolist()
        [1.0, 0.25]
    """

    cart_mass: Parameter = 0.5
    pole_mass: Parameter = 0.5
    half_length: Parameter = 0.5
    gravity: Parameter = 9.8
    cart_damping: Parameter = 0.0
    pole_damping: Parameter = 0.0
    fully_actuated: bool = eqx.field(default=False, static=True)
    momenta: bool = eqx.field(default=False, static=True)
    space: Space = eqx.field(init=False, static=True)
    inputs: int = eqx.field(init=False, static=True)

    def __post_init__(self) -> None:
        """Set what follows from the parameters: a length and an angle, one input or two."""
        self.space = Space((False, True))
        self.inputs = 2 if self.fully_actuated else 1

    def __check_init__(self) -> None:
        """Refuse parameters that are unphysical or make the cart-pole active.

        Raises:
            ValueError: If a mass or the length is not positive, or gravity or a damping is negative.
        """
        require_positive(cart_mass=self.cart_mass, pole_mass=self.pole_mass, half_length=self.half_length)
        require_non_negative(gravity=self.gravity, cart_damping=self.cart_damping, pole_damping=self.pole_damping)

    def potential_energy(self, q: Coordinates) -> Scalar:
        """Potential energy [J], zero where the pole hangs."""
        return self.pole_mass * self.gravity * self.half_length * (1 + jnp.cos(q[1]))

    def mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inertia; [kg], [kg m] and [kg m²] for the blocks of cart, coupling and pole."""
        total = self.cart_mass + self.pole_mass
        coupling = self.pole_mass * self.half_length * jnp.cos(q[1])
        return jnp.asarray([[total, coupling], [coupling, 4 / 3 * self.pole_mass * self.half_length**2]], q.dtype)

    def inverse_mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inverse of the inertia."""
        return inverse_of_symmetric_2x2(self.mass_matrix(q))

    def input_matrix(self, q: Coordinates) -> InputMatrix:
        """The force acts on x, the torque on θ."""
        return jnp.eye(2, self.inputs, dtype=q.dtype)

    def dissipation_matrix(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Viscous friction of rail [N s/m] and hinge [N m s/rad]."""
        del v
        return jnp.asarray([[self.cart_damping, 0.0], [0.0, self.pole_damping]], q.dtype)

    def points(self, q: Coordinates) -> Points:
        """Places of the hinge on the cart and of the pole's tip [m]."""
        x, length = q[0], 2 * self.half_length
        return jnp.asarray([[x, 0.0], [x + length * jnp.sin(q[1]), length * jnp.cos(q[1])]], q.dtype)

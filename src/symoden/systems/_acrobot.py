"""Acrobot: two links on a fixed hinge, driven at the elbow."""

from typing import final

import equinox as eqx
import jax.numpy as jnp

from symoden.shapes import Coordinates, DissipationMatrix, InputMatrix, Scalar, SquareMatrix, Velocities
from symoden.spaces import Space

from ._inverse import inverse_of_symmetric_2x2
from ._parameters import Parameter, require_count, require_non_negative, require_positive
from ._planar import AbstractPlanarMechanism, Points, hanging_chain

_LINKS = 2


@final
class Acrobot(AbstractPlanarMechanism):
    """Two links in a vertical plane, hinged to the world and to each other.

    With q = (θ₁, θ₂), θ₁ the first link's angle from the downward vertical and θ₂ the second link's angle from the
    first [rad], l_i the links' lengths, c_i the distances from their hinges to their centres and I_i their inertias
    about these,

        M₁₁ = m₁ c₁² + m₂ (l₁² + c₂² + 2 l₁ c₂ cos θ₂) + I₁ + I₂,   M₂₂ = m₂ c₂² + I₂,
        M₁₂ = m₂ (c₂² + l₁ c₂ cos θ₂) + I₂,
        V = (m₁ c₁ + m₂ l₁) g (1 − cos θ₁) + m₂ c₂ g (1 − cos(θ₁ + θ₂)).

    The input is the torque at the elbow [N m]; if `fully_actuated`, the torque at the shoulder goes before it.
    Friction is a torque −d_i θ̇_i at each joint.

    Attributes:
        masses: Masses m of the links [kg].
        lengths: Lengths l of the links [m]; that of the second has no effect on the motion.
        centres: Distances c from each link's hinge to its centre of mass [m].
        inertias: Inertias I about the centres of mass [kg m²].
        dampings: Viscous friction d at shoulder and elbow [N m s/rad].
        gravity: Acceleration of gravity g [m/s²].
        fully_actuated: Whether there is a torque at the shoulder too.
        momenta: Whether the rates in the data are momenta; otherwise they are velocities.
        space: Configuration space.
        inputs: Number of inputs.

    References:
        Spong (1995), *The swing up control problem for the acrobot*, eqs. (1)-(2), for its equations of motion.
        Gymnasium, `Acrobot-v1`: the values of the defaults.

    Example:
        >>> Acrobot().mass_matrix(jnp.zeros(2)).tolist()
        [[4.5, 1.75], [1.75, 1.25]]
    """

    masses: tuple[Parameter, Parameter] = (1.0, 1.0)
    lengths: tuple[Parameter, Parameter] = (1.0, 1.0)
    centres: tuple[Parameter, Parameter] = (0.5, 0.5)
    inertias: tuple[Parameter, Parameter] = (1.0, 1.0)
    dampings: tuple[Parameter, Parameter] = (0.0, 0.0)
    gravity: Parameter = 9.8
    fully_actuated: bool = eqx.field(default=False, static=True)
    momenta: bool = eqx.field(default=False, static=True)
    space: Space = eqx.field(init=False, static=True)
    inputs: int = eqx.field(init=False, static=True)

    def __post_init__(self) -> None:
        """Set what follows from the parameters: two angles, one torque or two."""
        self.space = Space((True,) * _LINKS)
        self.inputs = _LINKS if self.fully_actuated else 1

    def __check_init__(self) -> None:
        """Refuse parameters that are unphysical or make the acrobot active.

        Raises:
            ValueError: If a mass, length or inertia is not positive, or gravity or a damping is negative.
        """
        groups = {"masses": self.masses, "lengths": self.lengths, "centres": self.centres, "inertias": self.inertias}
        require_count(_LINKS, dampings=self.dampings, **groups)
        for name, values in groups.items():
            require_positive(**{f"{name}[{i}]": value for i, value in enumerate(values)})
        require_non_negative(gravity=self.gravity, **{f"dampings[{i}]": d for i, d in enumerate(self.dampings)})

    def potential_energy(self, q: Coordinates) -> Scalar:
        """Potential energy [J], zero where both links hang."""
        (m1, m2), (c1, c2), l1 = self.masses, self.centres, self.lengths[0]
        first = (m1 * c1 + m2 * l1) * (1 - jnp.cos(q[0]))
        return self.gravity * (first + m2 * c2 * (1 - jnp.cos(q[0] + q[1])))

    def mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inertia [kg m²]."""
        (m1, m2), (c1, c2), (I1, I2), l1 = self.masses, self.centres, self.inertias, self.lengths[0]
        cos2 = jnp.cos(q[1])
        M11 = m1 * c1**2 + m2 * (l1**2 + c2**2 + 2 * l1 * c2 * cos2) + I1 + I2
        M12 = m2 * (c2**2 + l1 * c2 * cos2) + I2
        return jnp.asarray([[M11, M12], [M12, m2 * c2**2 + I2]], q.dtype)

    def inverse_mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inverse of the inertia."""
        return inverse_of_symmetric_2x2(self.mass_matrix(q))

    def input_matrix(self, q: Coordinates) -> InputMatrix:
        """Torques act on the angles of their joints."""
        return jnp.eye(_LINKS, dtype=q.dtype)[:, -self.inputs :]

    def dissipation_matrix(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Viscous friction at the joints [N m s/rad]."""
        del v
        return jnp.diag(jnp.asarray(self.dampings, q.dtype))

    def points(self, q: Coordinates) -> Points:
        """Places of shoulder, elbow and tip [m]."""
        return hanging_chain(self.lengths, q)

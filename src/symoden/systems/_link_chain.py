"""Chain of any number of links in a vertical plane."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.shapes import Coordinates, DissipationMatrix, InputMatrix, Scalar, SquareMatrix, Velocities
from symoden.spaces import Space

from ._parameters import Parameter, require_count, require_non_negative, require_positive
from ._planar import AbstractPlanarMechanism, Points, hanging_chain


@final
class LinkChain(AbstractPlanarMechanism):
    """Links in a vertical plane, each hinged to the one before it, the first to the world.

    The coordinates are the joints' angles [rad]: the first link's from the downward vertical, each other's from the
    link before it. With φ = S q the links' angles from the vertical, S the lower triangle of ones, and A_ki = l_i for
    i < k, c_k for i = k, 0 for i > k (what link i contributes to the place of centre k),

        M(q) = Sᵀ (Σ_k m_k A_ki A_kj cos(φ_i − φ_j) + δ_ij I_i) S,   V(q) = g Σ_k m_k Σ_i A_ki (1 − cos φ_i).

    The inputs are torques at the actuated joints [N m]; friction is a torque −d_i q̇_i at each joint.

    Attributes:
        masses: Masses m of the links [kg]; their number is the number of links.
        lengths: Lengths l of the links [m].
        centres: Distances c from each link's hinge to its centre of mass [m].
        inertias: Inertias I about the centres of mass [kg m²].
        dampings: Viscous friction d at the joints [N m s/rad].
        gravity: Acceleration of gravity g [m/s²].
        actuated: For each joint, whether there is a torque at it.
        momenta: Whether the rates in the data are momenta; otherwise they are velocities.
        space: Configuration space.
        inputs: Number of inputs.

    Example:
        >>> chain = LinkChain.of_rods(3)
        >>> str(chain.space), chain.inputs
        ('T3', 3)
    """

    masses: tuple[Parameter, ...]
    lengths: tuple[Parameter, ...]
    centres: tuple[Parameter, ...]
    inertias: tuple[Parameter, ...]
    dampings: tuple[Parameter, ...]
    gravity: Parameter = 9.81
    actuated: tuple[bool, ...] = eqx.field(kw_only=True, static=True)
    momenta: bool = eqx.field(default=False, static=True)
    space: Space = eqx.field(init=False, static=True)
    inputs: int = eqx.field(init=False, static=True)

    @classmethod
    def of_rods(
        cls, links: int, *, mass: Parameter = 1.0, length: Parameter = 1.0, damping: Parameter = 0.0
    ) -> "LinkChain":
        """Chain of equal uniform rods with a torque at every joint.

        Args:
            links: Number of rods.
            mass: Mass of each rod [kg].
            length: Length of each rod [m].
            damping: Viscous friction at each joint [N m s/rad].

        Returns:
            The chain.

        Example:
            >>> LinkChain.of_rods(2).centres
            (0.5, 0.5)
        """
        return cls(
            masses=(mass,) * links,
            lengths=(length,) * links,
            centres=(length / 2,) * links,
            inertias=(mass * length**2 / 12,) * links,
            dampings=(damping,) * links,
            actuated=(True,) * links,
        )

    def __post_init__(self) -> None:
        """Set what follows from the parameters: an angle for each link, a torque for each actuated joint."""
        self.space = Space((True,) * len(self.masses))
        self.inputs = sum(self.actuated)

    def __check_init__(self) -> None:
        """Refuse parameters that are unphysical or make the chain active.

        Raises:
            ValueError: If the numbers of entries differ, a mass, length, centre or inertia is not
                positive, or gravity or a damping is negative.
        """
        groups = {"lengths": self.lengths, "centres": self.centres, "inertias": self.inertias}
        require_count(len(self.masses), dampings=self.dampings, actuated=self.actuated, **groups)
        for name, values in {"masses": self.masses, **groups}.items():
            require_positive(**{f"{name}[{i}]": value for i, value in enumerate(values)})
        require_non_negative(gravity=self.gravity, **{f"dampings[{i}]": d for i, d in enumerate(self.dampings)})

    def potential_energy(self, q: Coordinates) -> Scalar:
        """Potential energy [J], zero where all links hang."""
        masses = jnp.asarray(self.masses, q.dtype)
        return self.gravity * masses @ self._reach(q) @ (1 - jnp.cos(jnp.cumsum(q)))

    def mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inertia [kg m²]."""
        A, angles = self._reach(q), jnp.cumsum(q)
        masses, inertias = jnp.asarray(self.masses, q.dtype), jnp.asarray(self.inertias, q.dtype)
        coupling = A.T @ jnp.diag(masses) @ A * jnp.cos(angles[:, None] - angles[None, :])
        S = jnp.tri(q.size, dtype=q.dtype)
        return S.T @ (coupling + jnp.diag(inertias)) @ S

    def inverse_mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """Inverse of the inertia."""
        return jnp.linalg.inv(self.mass_matrix(q))

    def input_matrix(self, q: Coordinates) -> InputMatrix:
        """Torques act on the angles of their joints."""
        joints = [joint for joint, driven in enumerate(self.actuated) if driven]
        return jnp.eye(q.size, dtype=q.dtype)[:, jnp.asarray(joints, int)]

    def dissipation_matrix(self, q: Coordinates, v: Velocities) -> DissipationMatrix:
        """Viscous friction at the joints [N m s/rad]."""
        del v
        return jnp.diag(jnp.asarray(self.dampings, q.dtype))

    def points(self, q: Coordinates) -> Points:
        """Places of the hinge, the joints and the tip [m]."""
        return hanging_chain(self.lengths, q)

    def _reach(self, q: Coordinates) -> Float[Array, "n n"]:
        """Lengths A_ki that link i contributes to the place of centre k [m]."""
        lengths, centres = jnp.asarray(self.lengths, q.dtype), jnp.asarray(self.centres, q.dtype)
        before = jnp.tri(q.size, k=-1, dtype=q.dtype)
        return before @ jnp.diag(lengths) + jnp.diag(centres)

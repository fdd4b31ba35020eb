"""Rigid bodies on joints as blocks: kinematics are given, what the bodies weigh is learned once for M and V."""

import dataclasses
import math
from typing import Final, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.known import Robot
from symoden.shapes import Coordinates, Momenta, Scalar, SquareMatrix, Velocities

from ._fields import AbstractBlock
from ._known import Known

_ROTOR: Final = 0.05  # Inertia of a drive at the start, beside that of what it moves.
_LEAST: Final = 1e-3  # The same beside the largest of all joints.
_LEVI_CIVITA: Final = np.array(
    [[[(i - j) * (j - k) * (k - i) / 2 for k in range(3)] for j in range(3)] for i in range(3)]
)
_QUANTITIES: Final = ("m", "cx", "cy", "cz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz", "rotor")


@final
class Links(eqx.Module):
    """Rigid bodies on the joints of a tree.

    A body with the pseudo-inertia J = ∫ x xᵀ dm of its points x = (x, y, z, 1) and the pose T has the kinetic energy
    ½ tr(Ṫ J Ṫᵀ). With ξᵢ T the derivative of its pose by the joint i that it hangs on, Mᵢⱼ = tr(ξᵢ C ξⱼᵀ), where C is
    the sum of T J Tᵀ over the bodies that hang on both joints: the composite rigid bodies of Walker & Orin. V is
    −Σ m gᵀ c.

    What is learned is Λ in J = L Λ Λᵀ Lᵀ, lower triangular with a positive diagonal, one at the start. So every J is
    positive definite: the numbers are those of a body that can be. Drives add an inertia to the diagonal of M.

    Attributes:
        joints: Names of the joints, body by body.
        coordinates: The number of each one's coordinate.
        parents: The body that carries each one, standing before it; -1 for the base.
        prismatic: Which ones slide.
        axes: Their axes, of length one, in their own frames.
        origins: Poses at coordinate zero, in that of the parent.
        roots: L, lower triangular.
        rotors: Inertia of each joint's drive at the start [kg m², or kg].
        gravity: Acceleration of free fall [m/s²].
        theta: What is learned: logarithms of the diagonal of Λ, its rows below that, and the logarithm of the factor on
            the drive's inertia.

    References:
        Walker & Orin (1982), *Efficient dynamic computer simulation of robotic mechanisms*; Wensing, Kim & Slotine
        (2018), *Linear matrix inequalities for physically consistent inertial parameter identification*: the
        pseudo-inertia; Rucker & Wensing (2022), *Smooth parameterization of rigid-body inertia*: its triangle.
    """

    joints: tuple[str, ...] = eqx.field(static=True)
    coordinates: tuple[int, ...] = eqx.field(static=True)
    parents: tuple[int, ...] = eqx.field(static=True)
    prismatic: tuple[bool, ...] = eqx.field(static=True)
    axes: Known
    origins: Known
    roots: Known
    rotors: Known
    gravity: Known
    theta: Float[Array, "b 11"]

    @classmethod
    def of(cls, robot: Robot) -> "Links":
        """Begin with the robot's own numbers.

        Args:
            robot: The robot.

        Returns:
            The bodies.
        """
        bodies = robot.bodies
        inertias = np.array([body.inertia for body in bodies])
        roots = np.array([np.linalg.cholesky(J) if J[3, 3] > 0 else np.zeros((4, 4)) for J in inertias])
        found = cls(
            joints=tuple(body.joint for body in bodies),
            coordinates=tuple(body.coordinate for body in bodies),
            parents=tuple(body.parent for body in bodies),
            prismatic=tuple(body.prismatic for body in bodies),
            axes=Known.of(np.array([body.axis for body in bodies])),
            origins=Known.of(np.array([body.origin for body in bodies])),
            roots=Known.of(roots),
            rotors=Known.of(np.zeros(len(bodies))),
            gravity=Known.of(np.array(robot.gravity)),
            theta=jnp.zeros((len(bodies), len(_QUANTITIES)), float),
        )
        moved = np.diag(found.mass_matrix(jnp.zeros(len(bodies), float)))[list(found.coordinates)]
        drives = np.array([np.nan if body.drive is None else body.drive for body in bodies])
        usual = np.maximum(_ROTOR * moved, _LEAST * moved.max())
        return dataclasses.replace(found, rotors=Known.of(np.where(np.isnan(drives), usual, drives)))

    def mass_matrix(self, q: Coordinates) -> SquareMatrix:
        """M at the configuration `q`."""
        poses, composites = self._composites(q)
        twists = self._twists(poses)
        matrix = jnp.einsum("iab,jab->ij", twists, jnp.einsum("kab,kbc->kac", twists, composites))
        matrix = matrix * self._hangs.astype(q.dtype)
        matrix = matrix + jnp.triu(matrix, 1).T + jnp.diag(self.drives)
        order = np.argsort(self.coordinates)
        return matrix[np.ix_(order, order)]

    def potential_energy(self, q: Coordinates) -> Scalar:
        """V at the configuration `q` [J]."""
        _, composites = self._composites(q)
        roots = [k for k, parent in enumerate(self.parents) if parent < 0]
        return -jnp.sum(composites[np.array(roots), :3, 3] @ self.gravity.value)

    def momenta(self, q: Coordinates, v: Velocities) -> tuple[Momenta, Momenta]:
        """M v, and the slope of the kinetic energy along the coordinates where the velocities `v` stay.

        With Vⱼ the sum of ξᵢ vᵢ over the joints that the body j hangs on, and h the sum of Vⱼ Tⱼ Jⱼ Tⱼᵀ over the bodies
        that hang on the joint i, they are tr(ξᵢ hᵀ) and tr([Vᵢ, ξᵢ] hᵀ): M is not differentiated, nor made.

        Args:
            q: Configuration.
            v: Velocities.

        Returns:
            Both.
        """
        hangs, rates = jnp.asarray(self._hangs, q.dtype), v[np.array(self.coordinates)]
        poses = self._poses(q)
        twists = self._twists(poses)
        moving = (hangs.T @ (twists * rates[:, None, None]).reshape(-1, 12)).reshape(twists.shape)
        carried = _product(_product(_product(moving, poses), self.inertias), jnp.swapaxes(poses, 1, 2))
        beyond = (hangs @ carried.reshape(-1, 12)).reshape(twists.shape)
        turning = _product(moving[:, :, :3], twists) - _product(twists[:, :, :3], moving)
        momenta = jnp.sum(twists * beyond, axis=(1, 2)) + self.drives * rates
        order = np.argsort(self.coordinates)
        return momenta[order], jnp.sum(turning * beyond, axis=(1, 2))[order]

    def weights(self, q: Coordinates) -> Momenta:
        """−∂V/∂q, what gravity pulls with at every coordinate [N m, or N].

        Args:
            q: Configuration.

        Returns:
            The forces.
        """
        poses = self._poses(q)
        places = jnp.sum(poses * self.inertias[:, None, :, 3], axis=2)  # Mass times centre, and the mass.
        beyond = self._hangs.astype(q.dtype) @ places
        shifts = jnp.sum(self._twists(poses) * beyond[:, None, :], axis=2)
        return (shifts @ self.gravity.value)[np.argsort(self.coordinates)]

    def times(self, factor: float | int) -> "Links":
        """The same bodies with all masses, moments and drives multiplied.

        Args:
            factor: The factor, positive.

        Returns:
            The bodies.
        """
        return dataclasses.replace(self, roots=self.roots.times(math.sqrt(factor)), rotors=self.rotors.times(factor))

    @property
    def inertias(self) -> Float[Array, "b 4 4"]:
        """Pseudo-inertia of each body in the frame of its joint [kg m², kg m, kg]."""
        roots = self._roots()
        return _product(roots, jnp.swapaxes(roots, 1, 2))

    @property
    def drives(self) -> Float[Array, " b"]:
        """Inertia of each joint's drive as seen at the joint [kg m², or kg]."""
        return self.rotors.value * jnp.exp(self.theta[:, -1])

    @property
    def quantities(self) -> dict[str, Array]:
        """Mass [kg], centre of mass [m], moments of inertia about it [kg m²] and the drive's, by joint and name."""
        found: dict[str, Array] = {}
        for joint, J, rotor in zip(self.joints, self.inertias, self.drives, strict=True):
            m = jnp.maximum(J[3, 3], jnp.finfo(J.dtype).tiny)
            centre = J[:3, 3] / m
            second = J[:3, :3] - m * jnp.outer(centre, centre)
            inertia = jnp.trace(second) * jnp.eye(3, dtype=J.dtype) - second
            rest = (inertia[i, k] for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
            found |= {
                f"{joint}.{name}": value for name, value in zip(_QUANTITIES, (m, *centre, *rest, rotor), strict=True)
            }
        return found

    @property
    def _hangs(self) -> np.ndarray:
        """Which body j hangs on which joint i, its own included."""
        found = np.eye(len(self.parents), dtype=bool)
        for j, parent in enumerate(self.parents):
            if parent >= 0:
                found[:, j] |= found[:, parent]
        return found

    def _roots(self) -> Float[Array, "b 4 4"]:
        """L Λ of every body."""
        diagonal = jax.vmap(jnp.diag)(jnp.exp(self.theta[:, :4]))
        rows, columns = np.tril_indices(4, -1)
        return _product(self.roots.value, diagonal.at[:, rows, columns].set(self.theta[:, 4:10]))

    def _composites(self, q: Coordinates) -> tuple[Float[Array, "b 4 4"], Float[Array, "b 4 4"]]:
        """Pose of every body, and the sum of T J Tᵀ over all that hang on its joint."""
        poses = self._poses(q)
        rooted = _product(poses, self._roots())
        own = _product(rooted, jnp.swapaxes(rooted, 1, 2))
        return poses, jnp.einsum("ij,jab->iab", self._hangs.astype(q.dtype), own)

    def _poses(self, q: Coordinates) -> Float[Array, "b 4 4"]:
        """Pose of every body."""
        poses: list[Float[Array, "4 4"]] = []
        for parent, placed in zip(self.parents, self._placed(q), strict=True):
            poses.append(placed if parent < 0 else _product(poses[parent], placed))
        return jnp.stack(poses)

    def _twists(self, poses: Float[Array, "b 4 4"]) -> Float[Array, "b 3 4"]:
        """The first three rows of every ξ; the last is zero."""
        slides = np.array(self.prismatic)[:, None]
        axes = jnp.sum(poses[:, :3, :3] * self.axes.value[:, None], axis=2)
        x, y, z = jnp.where(slides, 0, axes).T
        none = jnp.zeros_like(x)
        turns = jnp.stack([none, -z, y, z, none, -x, -y, x, none], axis=1).reshape(-1, 3, 3)
        shifts = jnp.where(slides, axes, -jnp.sum(turns * poses[:, None, :3, 3], axis=2))
        return jnp.concatenate([turns, shifts[:, :, None]], axis=2)

    def _placed(self, q: Coordinates) -> Float[Array, "b 4 4"]:
        """Pose of every body in that of its parent, by Rodrigues' formula or a shift along the axis."""
        slides = np.array(self.prismatic)[:, None, None]
        cross = jnp.einsum("abc,kb->kac", _LEVI_CIVITA.astype(q.dtype), self.axes.value)
        generators = jnp.where(
            slides,
            jnp.pad(self.axes.value[:, :, None], ((0, 0), (0, 1), (3, 0))),
            jnp.pad(cross, ((0, 0), (0, 1), (0, 1))),
        )
        first = self.origins.value @ generators
        second = first @ generators
        x = q[np.array(self.coordinates)][:, None, None]
        return self.origins.value + jnp.where(slides, x, jnp.sin(x)) * first + (1 - jnp.cos(x)) * second


@final
class LinksBlock(AbstractBlock):
    """M or V of rigid bodies on joints.

    Attributes:
        part: Which of both, `mass_matrix` or `potential_energy`.
        unit: Factor, 1 unless the unit of momentum was changed.
        links: The bodies, which `with_parameters` fills in.
    """

    part: str = eqx.field(static=True)
    unit: Known
    links: Links | None = None

    def __call__(self, q: Coordinates) -> Float[Array, "..."]:
        """Value at the configuration `q`."""
        if self.links is None:
            raise ValueError("Rigid bodies must be filled in by `with_parameters` before their block is called.")
        value = self.links.mass_matrix(q) if self.part == "mass_matrix" else self.links.potential_energy(q)
        return self.unit.value * value


def _product(A: Float[Array, "*B i j"], B: Float[Array, "*B j k"]) -> Float[Array, "*B i k"]:
    """A B: sums of products, which a compiler makes one loop of, are faster than many products of small matrices."""
    return jnp.sum(A[..., :, :, None] * B[..., None, :, :], axis=-2)

"""Configuration spaces Rⁿ × Tᵐ with coordinates in any order."""

import re
from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .shapes import Coordinates, Embedding, vector

_FACTOR = re.compile(r"([RT])([1-9][0-9]?)")
_LARGEST = 64


@final
class Space(eqx.Module):
    """Product of lines and circles on which a mechanism's coordinates live.

    A coordinate is a length on R or an angle [rad] on T = R/2πZ. Functions of the configuration are written as
    functions of the embedding (r, cos φ, sin φ), which makes them 2π-periodic in every angle by construction.

    Attributes:
        is_angle: For each coordinate, in the order of `q`, whether it is an angle.

    Example:
        >>> space = Space.parse("R1 T1")
        >>> space.size, space.embedded_size, str(space)
        (2, 3, 'R1 T1')
    """

    is_angle: tuple[bool, ...] = eqx.field(static=True)

    def __check_init__(self) -> None:
        """Refuse a space without coordinates.

        Raises:
            ValueError: If there is no coordinate, or more than a mechanism can have, or it is not said of each whether
                it is an angle.
        """
        if isinstance(self.is_angle, str):
            raise ValueError(
                f"A space must be told which coordinates are angles; got {self.is_angle!r}. `Space.parse` reads names."
            )
        if not 1 <= len(self.is_angle) <= _LARGEST:
            raise ValueError(f"A space must have 1 to {_LARGEST} coordinates; got {len(self.is_angle)}.")

    @classmethod
    def parse(cls, text: str) -> "Space":
        """Read a space from its name: factors `R<n>` and `T<m>` in the order of the coordinates.

        Args:
            text: Such as "R1", "T2", "R1 T1" or "T1 R2 T1".

        Returns:
            The space.

        Raises:
            ValueError: If the text is no such name.

        Example:
            >>> Space.parse("T1 R2").is_angle
            (True, False, False)
        """
        factors = [_FACTOR.fullmatch(word) for word in text.split()]
        matches = [match for match in factors if match is not None]
        sizes = [int(match[2]) for match in matches]
        if not factors or len(matches) < len(factors) or sum(sizes) > _LARGEST:
            raise ValueError(
                f"`space` must be factors R<n> and T<m> with n, m ≥ 1, in the order of the coordinates; got {text!r}. "
                'Write for example "R1", "T2", "R1 T1" (a length, then an angle).'
            )
        return cls(tuple(match[1] == "T" for match, size in zip(matches, sizes, strict=True) for _ in range(size)))

    def __str__(self) -> str:
        """Name of the space, as `parse` reads it."""
        letters = "".join("T" if angle else "R" for angle in self.is_angle)
        return " ".join(f"{run[0]}{len(run)}" for run in re.findall(r"R+|T+", letters))

    @property
    def size(self) -> int:
        """Number of coordinates n."""
        return len(self.is_angle)

    @property
    def embedded_size(self) -> int:
        """Number of embedded coordinates: one for a length, two for an angle."""
        return len(self.is_angle) + sum(self.is_angle)

    @property
    def angles(self) -> np.ndarray:
        """Indices of the coordinates that are angles."""
        return np.flatnonzero(self.is_angle)

    @property
    def lengths(self) -> np.ndarray:
        """Indices of the coordinates that are lengths."""
        return np.flatnonzero(~np.asarray(self.is_angle))

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the coordinates where lengths are in SI: rad and m."""
        return tuple("rad" if angle else "m" for angle in self.is_angle)

    def embed(self, q: Coordinates) -> Embedding:
        """Map coordinates to (r, cos φ, sin φ): all lengths, then all cosines, then all sines.

        Args:
            q: Coordinates; lengths in their unit, angles [rad].

        Returns:
            Embedded coordinates.

        Raises:
            ValueError: If there is not one number per coordinate.

        Example:
            >>> Space.parse("T1 R1").embed(jnp.array([0.0, 3.0])).tolist()
            [3.0, 1.0, 0.0]
        """
        q = vector(q, self.size, "`q`", f"coordinate of {self}")
        angles = q[self.angles]
        return jnp.concatenate([q[self.lengths], jnp.cos(angles), jnp.sin(angles)])

    def project(self, embedding: Embedding) -> Coordinates:
        """Invert `embed` on the torus and off it: the angle of the nearest point of the circle, in [-π, π].

        Args:
            embedding: Embedded coordinates (r, cos φ, sin φ), the circles' radii being free.

        Returns:
            Coordinates.

        Example:
            >>> Space.parse("T1").project(jnp.array([0.0, 2.0])).round(4).tolist()
            [1.5708]
        """
        lengths, angles = self.lengths, self.angles
        r, cosines, sines = jnp.split(embedding, [len(lengths), len(lengths) + len(angles)])
        q = jnp.zeros(self.size, embedding.dtype)
        return q.at[lengths].set(r).at[angles].set(jnp.arctan2(sines, cosines))

    def wrap(self, q: Coordinates) -> Coordinates:
        """Bring every angle into [-π, π).

        Args:
            q: Coordinates.

        Returns:
            The same configuration in the principal chart.

        Example:
            >>> Space.parse("T1 R1").wrap(jnp.array([7.0, 7.0])).round(4).tolist()
            [0.7168, 7.0]
        """
        return jnp.where(np.asarray(self.is_angle), jnp.mod(q + jnp.pi, 2 * jnp.pi) - jnp.pi, q)

    def difference(self, q1: Coordinates, q0: Coordinates) -> Coordinates:
        """Subtract configurations, angles the short way round.

        Args:
            q1: Coordinates of the end.
            q0: Coordinates of the start.

        Returns:
            q1 − q0 with angles in [-π, π).

        Example:
            >>> Space.parse("T1").difference(jnp.array([3.0]), jnp.array([-3.0])).round(4).tolist()
            [-0.2832]
        """
        return self.wrap(q1 - q0)

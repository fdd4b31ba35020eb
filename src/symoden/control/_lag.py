"""Lags: what acts follows what was commanded, as a motor or a propeller does, and a controller must know how far."""

import math
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.shapes import Inputs


@final
class Lag(eqx.Module):
    """First-order lag of each input, τ ẋ = u − x: x acts where u was commanded.

    Attributes:
        seconds: Time constant τ of each input [s]; 0 where it acts at once.
    """

    seconds: tuple[float, ...] = eqx.field(static=True)

    def __check_init__(self) -> None:
        """Refuse what is no time.

        Raises:
            ValueError: If a time is negative or not finite.
        """
        if not all(0 <= each < math.inf for each in self.seconds):
            raise ValueError(f"A lag must be at least 0 s, and finite; got {self.seconds}.")

    def follow(self, acting: Inputs, u: Inputs, seconds: float) -> tuple[Inputs, Inputs]:
        """Let what acts follow a held command; the solution of the lag's equation.

        Args:
            acting: What acts at first.
            u: The command.
            seconds: For how long [s].

        Returns:
            What acts at the end, and in the mean over that time, which is the same impulse.
        """
        if not any(self.seconds):
            return u, u
        if seconds == 0:
            return acting, acting
        shares = [seconds / each if each else math.inf for each in self.seconds]
        mean = jnp.array([-math.expm1(-share) / share if math.isfinite(share) else 0.0 for share in shares], u.dtype)
        left = jnp.array([math.exp(-share) for share in shares], u.dtype)
        return u + (acting - u) * left, u + (acting - u) * mean

    def through(
        self, acting: Inputs, us: Float[Array, "w m"], *, first: float, period: float
    ) -> tuple[Float[Array, "w m"], Inputs]:
        """Let what acts follow commands that are on their way.

        Args:
            acting: What acts now.
            us: The commands, the one that is followed now first.
            first: For how long the first one is still followed [s]; a whole period if zero.
            period: For how long each other one is [s].

        Returns:
            What acts in the mean over each of these times, and at the end of the last; without any lag the commands.
        """
        if len(us) == 0 or not any(self.seconds):
            return us, acting
        acting, mean = self.follow(acting, us[0], first or period)
        acting, means = jax.lax.scan(lambda acting, u: self.follow(acting, u, period), acting, us[1:])
        return jnp.concatenate([mean[None], means]), acting

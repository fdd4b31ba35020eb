"""Follow a planned motion from wherever along it the state is nearest; without memory."""

from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractPortHamiltonian, potential
from symoden.shapes import Coordinates, Inputs, Scalar, SquareMatrix, Velocities
from symoden.spaces import Space

from ._controller import AbstractController, as_array, saturate
from ._plan import Motion, motion_step
from ._regulator import Regulator
from ._scales import bandwidth


@final
class Follower(AbstractController):
    """Time-varying linear-quadratic regulator about a motion, at the sample with the least cost to go.

    Near the motion, u = u_k − K_k (x − x_k) with the k of the least (x − x_k)ᵀ P_k (x − x_k). Elsewhere the system is
    calmed towards the start of the motion, u = −K_p gᵀ e − K gᵀ v, which takes energy out of it.

    Attributes:
        model: System or learned model.
        x: States x_k.
        u: Inputs u_k.
        gain: Gains K_k.
        cost: Costs P_k.
        level: Cost to go below which a state counts as near.
        stiffness: K_p of calming.
        damping: K of calming.
        limits: Largest magnitude of each input.

    References:
        Tedrake, Manchester, Tobenkin & Roberts (2010), *LQR-trees: feedback motion planning via sums-of-squares
        verification*.
    """

    model: AbstractPortHamiltonian
    x: Float[Array, "k s"]
    u: Float[Array, "k m"]
    gain: Float[Array, "k m s"]
    cost: Float[Array, "k s s"]
    level: Scalar
    stiffness: SquareMatrix
    damping: SquareMatrix
    limits: Inputs

    @classmethod
    def of(cls, model: AbstractPortHamiltonian, motion: Motion, end: Regulator) -> "Follower":
        """Compute the gains backwards from the regulator at the end.

        Args:
            model: What the motion was planned on.
            motion: The motion.
            end: Regulator at its end; its weights hold along the motion.

        Returns:
            The controller, following from everywhere: `level` is infinite.
        """
        start = motion.x[0, : model.space.size]
        g = np.asarray(model.input_matrix(start))
        omega = bandwidth(model, start)
        back = np.linalg.pinv(g)
        inertia = back @ np.asarray(model.mass_matrix(start)) @ back.T
        gain, cost = _gains(model, motion.x, motion.u, motion.period, end)
        return cls(
            model=model,
            x=motion.x[:-1],
            u=motion.u,
            gain=gain,
            cost=cost,
            level=as_array(np.inf),
            stiffness=as_array(omega**2 * inertia),
            damping=as_array(omega * inertia),
            limits=end.limits,
        )

    @property
    def space(self) -> Space:
        """Configuration space."""
        return self.model.space

    def desired_energy(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Scalar:
        """Least cost to go along the motion, or the energy that calming takes out."""
        del t
        costs, _ = self._costs(q, v)
        e = self.model.input_matrix(q).T @ self.model.space.difference(q, self._start)
        energy = 0.5 * v @ self.model.mass_matrix(q) @ v + potential(self.model, q) + 0.5 * e @ self.stiffness @ e
        return jnp.where(jnp.min(costs) < self.level, jnp.min(costs), energy)

    def __call__(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Inputs:
        """Input."""
        del t
        costs, x = self._costs(q, v)
        k = jnp.argmin(costs)
        following = self.u[k] - self.gain[k] @ x[k]
        g = self.model.input_matrix(q)
        calming = -self.stiffness @ (g.T @ self.model.space.difference(q, self._start)) - self.damping @ (g.T @ v)
        return saturate(jnp.where(costs[k] < self.level, following, calming), self.limits)

    @property
    def _start(self) -> Coordinates:
        """Configuration from which the motion starts."""
        return self.x[0, : self.model.space.size]

    def _costs(self, q: Coordinates, v: Velocities) -> tuple[Float[Array, " k"], Float[Array, "k s"]]:
        """Cost to go from every sample of the motion, and the deviations from them."""
        n = self.model.space.size
        e = jax.vmap(self.model.space.difference, (None, 0))(q, self.x[:, :n])
        x = jnp.concatenate([e, v[None] - self.x[:, n:]], axis=1)
        return jnp.sum(x * jnp.squeeze(self.cost @ x[:, :, None], -1), axis=1), x


@eqx.filter_jit
def _gains(
    model: AbstractPortHamiltonian, x: Float[Array, "T s"], u: Float[Array, "k m"], period: float, end: Regulator
) -> tuple[Float[Array, "k m s"], Float[Array, "k s s"]]:
    """Discrete Riccati equation backwards along a motion."""
    A, B = jax.vmap(jax.jacfwd(lambda x, u: motion_step(model, x, u, period), (0, 1)))(x[:-1], u)

    def step(P: Float[Array, "s s"], at: tuple) -> tuple:
        A, B = at
        K = jnp.linalg.solve(period * end.input_weight + B.T @ P @ B, B.T @ P @ A)
        P = period * end.state_weight + A.T @ P @ (A - B @ K)
        P = 0.5 * (P + P.T)
        return P, (K, P)

    _, gains = jax.lax.scan(step, end.cost, (A, B), reverse=True)
    return gains

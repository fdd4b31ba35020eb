"""Matching conditions of the linearised mechanism, solved in closed form, and the cheapest of their solutions."""

from typing import Final, NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractPortHamiltonian
from symoden.shapes import Coordinates

from ._controller import Limits
from ._matching import unactuated
from ._regulator import Regulator, linearize

_ALIGNED: Final = 1e-6
_ROUNDS: Final = 10
_CANDIDATES: Final = 200
_ELITE: Final = 20
_FIRST_SPREAD: Final = 1.5
_LEAST_SPREAD: Final = 0.02


class Gains(NamedTuple):
    """Values at the target.

    Attributes:
        ratio: r of K = h hᵀ/(hᵀ w) + r (M − M w wᵀ M/(wᵀ M w)).
        P: Hessian of V_d.
        damping: K_v.
        cost: Mean quadratic cost beside that of the best linear regulator, which is 1; infinite if unstable.
    """

    ratio: float
    P: Float[np.ndarray, "n n"]
    damping: Float[np.ndarray, "m m"]
    cost: float


class LinearMatching(NamedTuple):
    """Mechanism linearised at the target, M v̇ + D v + C e = g (u − u*), with a regulator to compare with.

    With h = M G⊥ᵀ, f = C G⊥ᵀ and any w with hᵀ w > 0 and fᵀ w > 0,

        K = h hᵀ/(hᵀ w) + r N,   P = f fᵀ/(fᵀ w) + s N,   N = M − M w wᵀ M/(wᵀ M w),

    are positive definite and match, K w = h and P w = f, for all r, s > 0.

    Attributes:
        A: Slope of (e, v).
        B: Effect of the inputs on it.
        M: Inertia.
        row: G⊥.
        regulator: Linear-quadratic regulator for the same limits.
    """

    A: Float[np.ndarray, "s s"]
    B: Float[np.ndarray, "s m"]
    M: Float[np.ndarray, "n n"]
    row: Float[np.ndarray, " n"]
    regulator: Regulator

    @classmethod
    def of(cls, model: AbstractPortHamiltonian, target: Coordinates, limits: Limits) -> "LinearMatching":
        """Linearise.

        Args:
            model: System or model of one coordinate more than inputs.
            target: Equilibrium.
            limits: Largest magnitude of the inputs.

        Returns:
            The linearised mechanism.

        Raises:
            ValueError: If it cannot be stabilised, or the load is proportional to the inertia where no input acts.
        """
        A, B, _ = linearize(model, target)
        regulator = Regulator.of(model, target, limits=limits)
        M, row = (np.asarray(part) for part in _at_target(model, target))
        linear = cls(A=A, B=B, M=M, row=row, regulator=regulator)
        h, f = linear.inertia, linear.load
        products = np.array([h, f]) @ np.linalg.solve(M, np.array([h, f]).T)
        if np.linalg.det(products) <= _ALIGNED * products[0, 0] * products[1, 1]:
            raise ValueError(
                "IDA-PBC needs inputs that reach every motion; at the target the load where none acts is proportional "
                "to the inertia there."
            )
        return linear

    @property
    def inertia(self) -> Float[np.ndarray, " n"]:
        """Inertia that w sees, h."""
        return self.M @ self.row

    @property
    def load(self) -> Float[np.ndarray, " n"]:
        """Stiffness that w sees, f."""
        return self.row @ self.stiffness

    @property
    def stiffness(self) -> Float[np.ndarray, "n n"]:
        """C."""
        n = len(self.M)
        return -self.M @ self.A[n:, :n]

    @property
    def g(self) -> Float[np.ndarray, "n m"]:
        """Input matrix."""
        return self.M @ self.B[len(self.M) :]

    @property
    def rate(self) -> float:
        """Fastest rate without friction, squared [1/s²]."""
        return float(np.abs(np.linalg.eigvals(np.linalg.solve(self.M, self.stiffness))).max())

    def direction(self, ratio: float) -> Float[np.ndarray, " n"]:
        """The w of least inertia with a given ratio of fᵀ w to hᵀ w.

        Args:
            ratio: In units of the fastest rate of the linearised mechanism, squared.

        Returns:
            w, with hᵀ w = G⊥ M G⊥ᵀ, as without control.
        """
        both = np.array([self.inertia, self.load])
        spread = np.linalg.solve(self.M, both.T)
        return spread @ np.linalg.solve(both @ spread, np.array([1.0, ratio * self.rate])) * (self.row @ self.inertia)

    def cheapest(self, w: Float[np.ndarray, " n"]) -> Gains:
        """Choose r, s and the damping for the least quadratic cost, friction included, by the cross-entropy method.

        Args:
            w: With hᵀ w > 0 and fᵀ w > 0.

        Returns:
            The gains.
        """
        generator = np.random.default_rng(0)
        mean, spread = np.zeros(3), np.full(3, _FIRST_SPREAD)
        best, least = mean, np.inf
        for _ in range(_ROUNDS):
            draw = mean + spread * generator.standard_normal((_CANDIDATES, 3))
            draw[0] = best
            costs = self.costs(w, np.exp(draw))
            order = np.argsort(costs)[:_ELITE]
            if costs[order[0]] < least:
                best, least = draw[order[0]], costs[order[0]]
            mean, spread = draw[order].mean(axis=0), np.maximum(draw[order].std(axis=0), _LEAST_SPREAD)
        _, P, damping = self._matrices(w, np.exp(best)[None])
        return Gains(ratio=float(np.exp(best[0])), P=P[0], damping=damping[0], cost=float(least))

    def costs(self, w: Float[np.ndarray, " n"], gains: Float[np.ndarray, "c 3"]) -> Float[np.ndarray, " c"]:
        """Mean quadratic cost of the closed loop from states of one unit of cost each.

        Args:
            w: Direction.
            gains: r, s/ω² and a factor of the damping, for each candidate.

        Returns:
            The costs beside the least possible; infinite where the closed loop is unstable.
        """
        n, g = len(self.M), self.g
        K, P, damping = self._matrices(w, gains)
        by_q = np.linalg.pinv(g) @ (self.stiffness - self.M @ np.linalg.solve(K, P))
        by_v = -damping @ g.T @ np.linalg.solve(self.M, K)
        F = np.concatenate([by_q, by_v], axis=2)
        closed = self.A + self.B @ F
        Q, R = (np.asarray(part) for part in (self.regulator.state_weight, self.regulator.input_weight))
        eye = np.eye(2 * n)
        first, second = np.einsum("cij,kl->cikjl", closed, eye), np.einsum("ij,ckl->cikjl", eye, closed)
        both = (first + second).reshape(len(gains), (2 * n) ** 2, -1)
        with np.errstate(all="ignore"):
            stable = np.linalg.eigvals(closed).real.max(axis=1) < 0
            both[~stable] = np.eye((2 * n) ** 2)
            start = -np.linalg.inv(Q).reshape(-1, 1)
            X = np.linalg.solve(both, np.broadcast_to(start, (len(gains), *start.shape))).reshape(-1, 2 * n, 2 * n)
            costs = np.einsum("cij,cji->c", Q + np.swapaxes(F, 1, 2) @ R @ F, X)
        least = np.trace(np.asarray(self.regulator.cost) @ np.linalg.inv(Q))
        return np.where(stable, costs / least, np.inf)

    def _matrices(
        self, w: Float[np.ndarray, " n"], gains: Float[np.ndarray, "c 3"]
    ) -> tuple[Float[np.ndarray, "c n n"], Float[np.ndarray, "c n n"], Float[np.ndarray, "c m m"]]:
        """K, P and K_v of candidates."""
        h, f, g, rate, Mw = self.inertia, self.load, self.g, self.rate, self.M @ w
        across = self.M - np.outer(Mw, Mw) / (w @ Mw)
        r, s, factor = (column[:, None, None] for column in gains.T)
        unit = np.sqrt(rate) * np.linalg.inv(g.T @ np.linalg.solve(self.M, g))
        return np.outer(h, h) / (h @ w) + r * across, np.outer(f, f) / (f @ w) + s * rate * across, factor * unit


@eqx.filter_jit
def _at_target(model: AbstractPortHamiltonian, target: Coordinates) -> tuple[Array, Array]:
    """M and G⊥ in one compiled program."""
    return model.mass_matrix(target), unactuated(model, target)

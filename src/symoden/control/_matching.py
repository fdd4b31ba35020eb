"""Matching conditions of IDA-PBC with one coordinate more than inputs, solved about a target by collocation."""

from dataclasses import dataclass
from typing import Final, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
import scipy.optimize
from jaxtyping import Array, Float

from symoden.mechanics import AbstractPortHamiltonian, gradient
from symoden.shapes import Coordinates, InputMatrix, Scalar

from ._expansion import Expansion

_POINTS: Final = 400
_ORDER: Final = 6
_RIDGE: Final = 1e-6
_LINEAR_RIDGE: Final = 1e-7
_EVALUATIONS: Final = 50  # Five suffice where a solution exists.
_RANK: Final = 1e-9


class Rows(NamedTuple):
    """What the conditions are made of at one configuration, G⊥ being the direction in which no input acts.

    Attributes:
        load: G⊥ ∇V.
        h: M G⊥ᵀ.
        h_slope: ∂h/∂q.
        inertia: Matrix B of G⊥ c(q, v) = vᵀ B v, c being the Coriolis and centrifugal forces.
    """

    load: Scalar
    h: Float[Array, " n"]
    h_slope: Float[Array, "n n"]
    inertia: Float[Array, "n n"]


def annihilator(g: InputMatrix) -> Float[Array, " n"]:
    """Direction G⊥ with G⊥ g = 0, smooth in g: the cofactors of a column beside it.

    Args:
        g: Input matrix of one column less than rows.

    Returns:
        The row.
    """
    beside = [jnp.concatenate([g, unit[:, None]], axis=1) for unit in jnp.eye(len(g), dtype=g.dtype)]
    return jnp.linalg.det(jnp.stack(beside))


def unactuated(model: AbstractPortHamiltonian, q: Coordinates) -> Float[Array, " n"]:
    """G⊥ of a model.

    Args:
        model: System or model of one coordinate more than inputs.
        q: Coordinates.

    Returns:
        The row.
    """
    return annihilator(model.input_matrix(q))


def coriolis_tensor(M_slope: Float[Array, "n n n"]) -> Float[Array, "n n n"]:
    """C with c_i = C_ijk v_j v_k for the Coriolis and centrifugal forces c = Ṁ v − ½ ∇(vᵀ M v).

    Args:
        M_slope: ∂M_ij/∂q_k.

    Returns:
        The tensor.
    """
    return M_slope - 0.5 * jnp.einsum("jki->ijk", M_slope)


def coriolis_form(C: Float[Array, "n n n"], row: Float[Array, " n"]) -> Float[Array, "n n"]:
    """Symmetric B with row · c(q, v) = vᵀ B v.

    Args:
        C: What `coriolis_tensor` gives.
        row: The row.

    Returns:
        The matrix.
    """
    B = jnp.einsum("i,ijk->jk", row, C)
    return 0.5 * (B + B.T)


@dataclass(frozen=True, kw_only=True, eq=False)
class Collocation:
    """The conditions at points about a target, and the products that solutions are made of there.

    With w = K⁻¹ M G⊥ᵀ and h = M G⊥ᵀ, the closed loop of H_d = ½ vᵀ K v + V_d can be had by some input exactly if

        hᵀ (∂w/∂q) w − wᵀ (∂h/∂q) w + 2 G⊥ c(q, w) = 0,   wᵀ ∇V_d = G⊥ ∇V,   hᵀ w > 0:

    where the damping injection sees nothing, v ∥ w, H_d must neither rise nor fall. Any K = Kᵀ > 0 with K w = h serves.

    Attributes:
        target: The configuration.
        q: Points, the target first.
        rows: What the conditions are made of at them, in NumPy.
        empty: Expansion with no coefficients yet.
        products: Values of its products at the points.
        slopes: Their derivatives there.
        anchors: Value, gradient and entries of the Hessian of each product at the target.
    """

    target: Float[np.ndarray, " n"]
    q: Float[np.ndarray, "k n"]
    rows: Rows
    empty: Expansion
    products: Float[np.ndarray, "k f"]
    slopes: Float[np.ndarray, "k f n"]
    anchors: Float[np.ndarray, "a f"]

    @classmethod
    def of(cls, model: AbstractPortHamiltonian, target: Coordinates, reach: Float[np.ndarray, " n"]) -> "Collocation":
        """Evaluate a model at random points, always the same.

        Args:
            model: System or model of one coordinate more than inputs.
            target: Middle of the region.
            reach: Half its width in each coordinate.

        Returns:
            The conditions.
        """
        shifts = np.random.default_rng(0).uniform(-1, 1, (_POINTS, model.space.size))
        shifts[0] = 0
        q = np.asarray(target) + shifts * reach
        empty = Expansion(space=model.space, target=target, coefficients=jnp.zeros((0, 0)), order=_ORDER)
        rows, products, slopes, anchors = _evaluate(model, empty, jnp.asarray(q, target.dtype))
        return cls(
            target=np.asarray(target),
            q=q,
            rows=jax.tree.map(np.asarray, rows),
            empty=empty,
            products=np.asarray(products),
            slopes=np.asarray(slopes),
            anchors=np.concatenate([np.asarray(part).reshape(products.shape[1], -1).T for part in anchors]),
        )

    def field(self, w: Float[np.ndarray, " n"]) -> tuple[Expansion, Float[np.ndarray, " k"]]:
        """Solve the condition on the kinetic energy for w(q), starting from a constant: Gauss-Newton with a ridge.

        Args:
            w: Value at the target.

        Returns:
            The field, and hᵀ w at the points: negative where no K > 0 exists.
        """
        n, f = len(w), self.products.shape[1] - 1
        moving, slopes = self.products[:, 1:], self.slopes[:, 1:]
        h, h_slope, B = self.rows.h, self.rows.h_slope, self.rows.inertia
        scale = np.abs(h[0] @ w) * np.linalg.norm(w) * np.sqrt(_POINTS)
        ridge = _RIDGE / np.linalg.norm(w) * np.repeat(self.empty.degrees()[1:] ** 2, n)

        def parts(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            z = z.reshape(f, n)
            return w + moving @ z, np.einsum("kfj,fi->kij", slopes, z)

        def residual(z: np.ndarray) -> np.ndarray:
            at, slope = parts(z)
            form = 2 * B - h_slope
            rest = np.einsum("ki,kij,kj->k", h, slope, at) + np.einsum("ki,kij,kj->k", at, form, at)
            return np.concatenate([rest / scale, ridge * z])

        def jacobian(z: np.ndarray) -> np.ndarray:
            at, slope = parts(z)
            form = 4 * B - h_slope - np.swapaxes(h_slope, 1, 2)
            direct = np.einsum("kl,kli->ki", h, slope) + np.einsum("kij,kj->ki", form, at)
            rest = moving[:, :, None] * direct[:, None, :] + np.einsum("ki,kfj,kj->kfi", h, slopes, at)
            return np.concatenate([rest.reshape(len(rest), -1) / scale, np.diag(ridge)])

        solution = scipy.optimize.least_squares(
            residual,
            np.zeros(f * n),
            jac=jacobian,  # pyright: ignore[reportArgumentType] - SciPy's annotations know names only.
            method="lm",
            max_nfev=_EVALUATIONS,
        )
        whole = np.concatenate([w[None], solution.x.reshape(f, n)])
        return self._expansion(whole), np.einsum("ki,ki->k", h, self.products @ whole)

    def shape(self, field: Expansion, P: Float[np.ndarray, "n n"]) -> Expansion:
        """Solve the condition on the potential energy for V_d(q), by linear least squares with a ridge.

        Args:
            field: w(q).
            P: Hessian of V_d at the target, where V_d and its gradient vanish.

        Returns:
            V_d.
        """
        n, soft = len(P), self.empty.degrees() ** -2
        wanted = np.concatenate([np.zeros(1 + n), P.ravel()])
        scaled = self.anchors * soft
        base = np.linalg.lstsq(scaled, wanted, rcond=_RANK)[0]
        free = scipy.linalg.null_space(scaled, rcond=_RANK)
        w = self.products @ np.asarray(field.coefficients)
        along = np.einsum("kfj,kj->kf", self.slopes, w) * soft
        ridge = _LINEAR_RIDGE * np.linalg.norm(along) * np.eye(free.shape[1])
        rest = np.concatenate([self.rows.load - along @ base, np.zeros(free.shape[1])])
        found = np.linalg.lstsq(np.concatenate([along @ free, ridge]), rest, rcond=None)[0]
        return self._expansion((soft * (base + free @ found))[:, None])

    def values(self, function: Expansion) -> Float[np.ndarray, " k"]:
        """Values of a function at the points.

        Args:
            function: With one output.

        Returns:
            The values.
        """
        return self.products @ np.asarray(function.coefficients)[:, 0]

    def _expansion(self, coefficients: Float[np.ndarray, "f k"]) -> Expansion:
        """Expansion with these coefficients."""
        return eqx.tree_at(lambda e: e.coefficients, self.empty, jnp.asarray(coefficients, self.empty.target.dtype))


@eqx.filter_jit
def _evaluate(
    model: AbstractPortHamiltonian, empty: Expansion, q: Float[Array, "k n"]
) -> tuple[Rows, Array, Array, tuple[Array, Array, Array]]:
    """Conditions and products at the points; value, gradient and Hessian of the products at the target."""
    target = empty.target

    def h(q: Coordinates) -> Float[Array, " n"]:
        return model.mass_matrix(q) @ unactuated(model, q)

    def at(q: Coordinates) -> Rows:
        row = unactuated(model, q)
        B = coriolis_form(coriolis_tensor(jax.jacfwd(model.mass_matrix)(q)), row)
        return Rows(load=row @ gradient(model, q), h=h(q), h_slope=jax.jacfwd(h)(q), inertia=B)

    products = empty.products
    anchors = products(target), jax.jacfwd(products)(target), jax.jacfwd(jax.jacfwd(products))(target)
    return jax.vmap(at)(q), jax.vmap(products)(q), jax.vmap(jax.jacfwd(products))(q), anchors

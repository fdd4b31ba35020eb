"""IDA-PBC: another inertia, potential energy and damping for a mechanism with one coordinate more than inputs."""

from typing import Final, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.mechanics import AbstractPortHamiltonian, gradient
from symoden.shapes import Coordinates, Inputs, Scalar, SquareMatrix, Velocities
from symoden.spaces import Space

from ._controller import AbstractController, Limits, Target, as_array, input_limits, saturate
from ._expansion import Expansion
from ._linear_matching import Gains, LinearMatching
from ._matching import Collocation, annihilator, coriolis_form, coriolis_tensor, unactuated
from ._scales import bandwidth

_LENGTH: Final = 0.5
_FREQUENCIES: Final = np.geomspace(0.15, 5.0, 16)
_MARGIN: Final = 0.1
_REST: Final = 0.01
_CHECKED: Final = 1000


class Matching(NamedTuple):
    """Forces that no input can provide and that remain, beside the largest load G⊥ ∇V of the region.

    Attributes:
        rest: Largest one at rest.
        rest_q: Where.
        moving: Largest one due to motion, along w at the natural speed; it grows with its square.
        moving_q: Where.
    """

    rest: float
    rest_q: tuple[float, ...]
    moving: float
    moving_q: tuple[float, ...]


@final
class IdaPbc(AbstractController):
    """Gives the closed loop the energy H_d = ½ vᵀ K v + V_d, least at the target, K being M M_d⁻¹ M.

    With G⊥ g = 0, w = K⁻¹ M G⊥ᵀ and y = gᵀ M⁻¹ K v,

        g u = c + ∇V − M K⁻¹ (c_K + ∇V_d + S v) − g K_v y,

    so that Ḣ_d = −yᵀ K_v y − vᵀ K M⁻¹ D v + a force that remains, where c and c_K are the Coriolis and centrifugal
    forces of M and K. The skew S(q, v) takes up what it can of the kinetic energy: all but the condition along w,
    which `Collocation` solves for w, and the one at rest for V_d. K is (h hᵀ)/(hᵀ w) + r (M − M w wᵀ M/(wᵀ M w)).

    Attributes:
        model: System or learned model.
        target: Configuration to hold.
        field: w(q).
        shape: V_d(q).
        ratio: r.
        damping: K_v, symmetric positive definite.
        reach: Half the width of the region in which the conditions were solved.
        limits: Largest magnitude of each input.

    References:
        Ortega, Spong, Gómez-Estern & Blankenstein (2002), *Stabilization of a class of underactuated mechanical
        systems via interconnection and damping assignment*.
        Auckly & Kapitanski (2002), *On the λ-equations for matching control laws*: conditions in one field.
        Gómez-Estern & van der Schaft (2004), *Physical damping in IDA-PBC controlled underactuated mechanical
        systems*: friction where no input acts.
    """

    model: AbstractPortHamiltonian
    target: Coordinates
    field: Expansion
    shape: Expansion
    ratio: Scalar
    damping: Float[Array, "m m"]
    reach: Coordinates
    limits: Inputs

    @classmethod
    def of(
        cls, model: AbstractPortHamiltonian, target: Target, *, limits: Limits = None, reach: float = 0.8
    ) -> "IdaPbc":
        """Solve the matching conditions, with the values at the target for which the linear closed loop costs least.

        Args:
            model: System or learned model of one coordinate more than inputs.
            target: Configuration to hold, an equilibrium.
            limits: Largest magnitude of the inputs; None for none.
            reach: Distance of every angle from the target up to which the conditions are solved [rad].

        Returns:
            The controller; its `matching()` says how well the conditions hold.

        Raises:
            ValueError: If there is not one coordinate more than inputs, the target is no equilibrium, or no solution
                with positive K and V_d was found in the region.
        """
        n, m = model.space.size, model.inputs
        if m < 1 or n != m + 1:
            raise ValueError(
                f"IDA-PBC is for mechanisms of one coordinate more than inputs; the model has {n} coordinates and "
                f"{m} inputs. Use energy shaping where every coordinate has an input."
            )
        goal = as_array(target)
        widths = np.where(model.space.is_angle, reach, _LENGTH)
        conditions = Collocation.of(model, goal, widths)
        loads = np.abs(conditions.rows.load)
        if loads[0] > _REST * loads.max():
            raise ValueError(
                f"The target must be an equilibrium; at {goal.tolist()} the load where no input acts is "
                f"{loads[0] / loads.max():.1%} of the largest nearby."
            )
        gains, field, shape = _best(LinearMatching.of(model, goal, limits), conditions)
        return cls(
            model=model,
            target=goal,
            field=field,
            shape=shape,
            ratio=as_array(gains.ratio),
            damping=as_array(gains.damping),
            reach=as_array(widths),
            limits=as_array(input_limits(limits, m)),
        )

    @property
    def space(self) -> Space:
        """Configuration space."""
        return self.model.space

    def inertia(self, q: Coordinates) -> SquareMatrix:
        """K.

        Args:
            q: Coordinates.

        Returns:
            The matrix, positive definite where hᵀ w > 0.
        """
        return self._kinetic(q)[1][1]

    def _kinetic(self, q: Coordinates) -> tuple[tuple[SquareMatrix, SquareMatrix], tuple[Array, ...]]:
        """M and K, to be differentiated; then M, K, g, G⊥ and w as they are."""
        M, g, w = self.model.mass_matrix(q), self.model.input_matrix(q), self.field(q)
        row = annihilator(g)
        h, Mw = M @ row, M @ w
        K = jnp.outer(h, h) / (h @ w) + self.ratio * (M - jnp.outer(Mw, Mw) / (w @ Mw))
        return (M, K), (M, K, g, row, w)

    def _forms(self, q: Coordinates) -> tuple[tuple[Array, Array], tuple[Array, ...]]:
        """Coriolis tensors of M and K; then M, K, g, G⊥ and w."""
        (M_slope, K_slope), values = jax.jacfwd(self._kinetic, has_aux=True)(q)
        return (coriolis_tensor(M_slope), coriolis_tensor(K_slope)), values

    def desired_potential(self, q: Coordinates) -> Scalar:
        """Desired potential energy V_d, zero at the target.

        Args:
            q: Coordinates.

        Returns:
            The energy.
        """
        return self.shape(q)[0]

    def desired_energy(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Scalar:
        """H_d."""
        del t
        return 0.5 * v @ self.inertia(q) @ v + self.desired_potential(q)

    def __call__(self, q: Coordinates, v: Velocities, t: Scalar | None = None) -> Inputs:
        """Input."""
        del t
        (C, C_K), (M, K, g, row, w) = self._forms(q)
        B = coriolis_form(C, row) - coriolis_form(C_K, w)
        a = K @ w / (w @ K @ w)
        b = B @ (v + (a @ v) * w)
        gyroscopic = a * (b @ v) - b * (a @ v)
        wanted = C_K @ v @ v + jax.grad(self.desired_potential)(q) + gyroscopic
        forces = C @ v @ v + gradient(self.model, q) - M @ jnp.linalg.solve(K, wanted)
        y = g.T @ jnp.linalg.solve(M, K @ v)
        return saturate(jnp.linalg.solve(g.T @ g, g.T @ forces) - self.damping @ y, self.limits)

    def unmatched(self, q: Coordinates) -> tuple[Scalar, Scalar]:
        """Forces along G⊥ that remain: what no input can provide.

        Args:
            q: Coordinates.

        Returns:
            The one at rest, and the one at unit rate along w (times the rate's square at others).
        """
        (C, C_K), (_, _, _, row, w) = self._forms(q)
        B = coriolis_form(C, row) - coriolis_form(C_K, w)
        return row @ gradient(self.model, q) - w @ jax.grad(self.desired_potential)(q), w @ B @ w

    def matching(self) -> Matching:
        """How well the matching conditions hold in the region, in numbers.

        Returns:
            The forces that remain, and where they are largest.
        """
        shifts = np.random.default_rng(1).uniform(-1, 1, (_CHECKED, self.space.size)) * np.asarray(self.reach)
        q = as_array(np.asarray(self.target) + shifts)
        speed = as_array(bandwidth(self.model, self.target))
        load, rest, moving = (np.abs(np.asarray(part)) for part in _forces(self, q, speed))
        largest = load.max()
        at, then = int(rest.argmax()), int(moving.argmax())
        where = np.asarray(q)
        return Matching(
            rest=float(rest[at] / largest),
            rest_q=tuple(where[at].tolist()),
            moving=float(moving[then] / largest),
            moving_q=tuple(where[then].tolist()),
        )


@eqx.filter_jit
def _forces(controller: IdaPbc, q: Float[Array, "k n"], speed: Scalar) -> tuple[Array, Array, Array]:
    """G⊥ ∇V, and the forces that remain, at rest and where w's fastest coordinate has the given speed."""

    def at(q: Coordinates) -> tuple[Scalar, Scalar, Scalar]:
        rest, moving = controller.unmatched(q)
        load = unactuated(controller.model, q) @ gradient(controller.model, q)
        return load, rest, moving * (speed / jnp.abs(controller.field(q)).max()) ** 2

    return jax.vmap(at)(q)


def _best(linear: LinearMatching, conditions: Collocation) -> tuple[Gains, Expansion, Expansion]:
    """The cheapest values at the target that go on to positive K and V_d in the whole region."""
    found = []
    for stiffness in _FREQUENCIES**2:
        w = linear.direction(stiffness)
        field, inertia = conditions.field(w)
        if inertia.min() > _MARGIN * inertia[0]:
            found.append((linear.cheapest(w), field))
    for gains, field in sorted(found, key=lambda each: each[0].cost):
        shape = conditions.shape(field, gains.P)
        if np.isfinite(gains.cost) and conditions.values(shape)[1:].min() > 0:
            return gains, field, shape
    raise ValueError(
        "No positive K and V_d that match were found about the target. Use swing-up, or `IdaPbc.of` "
        "with a smaller `reach`."
    )

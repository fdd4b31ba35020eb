"""Solvers that advance a state over one sampling interval under an input that is linear in time there."""

import abc
from collections.abc import Callable
from typing import Final, NamedTuple, TypeAlias, final

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float, Int, PyTree

from symoden.shapes import Inputs, Scalar

Field: TypeAlias = Callable[[Scalar, PyTree, Inputs], PyTree]

FEWEST_SUBSTEPS: Final = 4
"""RK4 steps in a sampling interval by which models are evaluated, or more where training needed more."""

OFFSETS: Final = (0.0, 1 / 2, 1 / 2, 1.0)
"""Where in a step the classical Runge-Kutta method takes its slopes, each from the one before."""
WEIGHTS: Final = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
"""What they count."""


class AbstractSolver(eqx.Module):
    """Advances a state, any PyTree of arrays, from one sample to the next."""

    @abc.abstractmethod
    def step(self, field: Field, state: PyTree, t0: Scalar, t1: Scalar, u0: Inputs, u1: Inputs) -> PyTree:
        """State at `t1`, from the one at `t0`, with the input going linearly from `u0` to `u1`."""


@final
class RK4(AbstractSolver):
    """The classical Runge-Kutta method of order four with a fixed number of steps in each sampling interval.

    Attributes:
        substeps: Number of steps; more of them where friction is stiff. An integer array instead of an `int` lets it
            change without compiling again, but then reverse-mode differentiation does not reach through.
        unroll: Write the stages out instead of looping over them: slower to compile, faster for large networks.
    """

    substeps: int | Int[Array, ""] = 1
    unroll: bool = eqx.field(static=True, default=False)

    def __check_init__(self) -> None:
        """Refuse an interval without steps.

        Raises:
            ValueError: If `substeps` is below 1.
        """
        if isinstance(self.substeps, int) and self.substeps < 1:
            raise ValueError(f"`substeps` must be at least 1; got {self.substeps}.")

    def step(self, field: Field, state: PyTree, t0: Scalar, t1: Scalar, u0: Inputs, u1: Inputs) -> PyTree:
        """State at `t1`."""

        def one(x: PyTree, start: Scalar) -> PyTree:
            return self.substep(field, x, start, t0, t1, u0, u1)[0]

        if isinstance(self.substeps, int) and self.substeps == 1:
            return one(state, jnp.zeros_like(t0))
        return jax.lax.fori_loop(0, self.substeps, lambda i, x: one(x, i.astype(t0.dtype)), state)

    def substep(
        self, field: Field, state: PyTree, start: Scalar, t0: Scalar, t1: Scalar, u0: Inputs, u1: Inputs
    ) -> tuple[PyTree, "Stages"]:
        """One of the steps from `t0` to `t1`.

        Args:
            field: Right-hand side.
            state: State before the step.
            start: How many steps of the interval lie before it.
            t0: Time of the sample before.
            t1: Time of the sample after.
            u0: Input at the one.
            u1: Input at the other.

        Returns:
            The state after the step, and where the field was asked for its four slopes.
        """
        count = jnp.asarray(self.substeps, t0.dtype)
        h = (t1 - t0) / count

        def add(x: PyTree, k: PyTree, factor: Scalar) -> PyTree:
            return jax.tree.map(lambda a, b: a + factor * b, x, k)

        def stage(carry: tuple[PyTree, PyTree], coefficients: tuple[Scalar, Scalar]) -> tuple:
            total, k = carry
            offset, weight = coefficients
            share = (start + offset) / count
            at = t0 + (start + offset) * h, add(state, k, offset * h), u0 + share * (u1 - u0)
            k = field(*at)
            return (add(total, k, weight * h), k), at

        # A loop over the stages instead of four copies of the field halves the time to compile.
        still = jax.tree.map(jnp.zeros_like, state)
        table = jnp.asarray([OFFSETS, WEIGHTS], t0.dtype)
        (total, _), at = jax.lax.scan(stage, (state, still), (table[0], table[1]), unroll=self.unroll)
        return total, Stages(*at)


class Stages(NamedTuple):
    """Where a Runge-Kutta step asks for slopes; the first axis counts them.

    Attributes:
        ts: Times.
        states: States, any PyTrees of arrays.
        us: Inputs.
    """

    ts: Float[Array, " 4"]
    states: PyTree
    us: Float[Array, "4 m"]


@final
class DiffraxSolver(AbstractSolver):
    """Any solver of Diffrax, with step sizes controlled by its error estimate; implicit ones too.

    The solver starts anew at every sample, so that a held input's jumps fall between its steps. Where it gives up
    (diverging state, too many steps), the state becomes NaN and stays so: a rollout always ends.

    Attributes:
        solver: Such as `diffrax.Tsit5()` or `diffrax.Kvaerno5()`.
        rtol: Relative tolerance.
        atol: Absolute tolerance.
        max_steps: Bound on the steps in one sampling interval.

    References:
        Kidger (2021), *On Neural Differential Equations*; Diffrax.
    """

    solver: diffrax.AbstractAdaptiveSolver
    rtol: float = eqx.field(static=True, default=1e-6)
    atol: float = eqx.field(static=True, default=1e-8)
    max_steps: int = eqx.field(static=True, default=256)

    def step(self, field: Field, state: PyTree, t0: Scalar, t1: Scalar, u0: Inputs, u1: Inputs) -> PyTree:
        """State at `t1`, NaN where the solver gave up."""

        def driven(t: ArrayLike, x: PyTree, args: PyTree) -> PyTree:
            del args
            t = jnp.asarray(t, t0.dtype)
            return field(t, x, u0 + (t - t0) / (t1 - t0) * (u1 - u0))

        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(driven),
            self.solver,
            t0,
            t1,
            dt0=t1 - t0,
            y0=state,
            stepsize_controller=diffrax.PIDController(rtol=self.rtol, atol=self.atol),
            max_steps=self.max_steps,
            throw=False,
        )
        done = solution.result == diffrax.RESULTS.successful
        return jax.tree.map(lambda y: jnp.where(done, y[-1], jnp.nan), solution.ys)

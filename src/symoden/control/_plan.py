"""Plan a motion to the target on the model, for what energy pumping does not catch."""

from typing import Final, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from symoden.integrate import RK4
from symoden.mechanics import AbstractPortHamiltonian
from symoden.shapes import Inputs, Scalar, State

from ._controller import Limits, Target, as_array, input_limits
from ._motion import velocity_field
from ._scales import bandwidth

_GUESSES: Final = 6
_ITERATIONS: Final = 80
_SHARE: Final = 0.7  # of the limits that the plan may use; the rest is for following it.
_EFFORT: Final = 0.05
_SPEED: Final = 0.002
_END: Final = 100.0
_HALVINGS: Final = 8
_REACHED: Final = 0.05


class _Plan(NamedTuple):
    """A planned motion, sampled with held inputs, or a batch of them.

    Attributes:
        x: States (q, v), angles not wrapped, one more than inputs.
        w: Inputs before they are squashed into the limits, u = U tanh w.
        cost: What was minimised.
    """

    x: Float[Array, "*c T s"]
    w: Float[Array, "*c N m"]
    cost: Float[Array, "*c"]


class Motion(NamedTuple):
    """A motion that a model can make, sampled with held inputs.

    Attributes:
        x: States (q, v), angles not wrapped; the last one is the end.
        u: Inputs, one fewer than states.
        period: Time for which each input is held [s].
    """

    x: Float[Array, "T s"]
    u: Float[Array, "N m"]
    period: float


@final
class _Problem(eqx.Module):
    """What is optimised.

    Attributes:
        model: What moves.
        goal: (q, v) to reach.
        limits: Largest inputs that a plan uses.
        period: Time for which each input is held [s].
    """

    model: AbstractPortHamiltonian
    goal: State
    limits: Inputs
    period: float = eqx.field(static=True)

    def step(self, x: State, w: Inputs) -> State:
        """State after one period."""
        return motion_step(self.model, x, self.limits * jnp.tanh(w), self.period)

    def running(self, x: State, w: Inputs) -> Scalar:
        """Cost of one period: effort, and speed that the data may not have."""
        _, v = jnp.split(x, 2)
        return 0.5 * self.period * (_EFFORT * w @ w + _SPEED * v @ v)

    def end(self, x: State) -> Scalar:
        """Cost of the end: angles any number of turns away are at the target too."""
        e, v = jnp.split(x - self.goal, 2)
        e = jnp.where(np.asarray(self.model.space.is_angle), 2 * jnp.sin(e / 2), e)
        return 0.5 * _END * (e @ e + v @ v)

    def total(self, x: Float[Array, "T s"], w: Float[Array, "N m"]) -> Scalar:
        """Cost of a motion."""
        return jnp.sum(jax.vmap(self.running)(x[:-1], w)) + self.end(x[-1])


def motion_step(model: AbstractPortHamiltonian, x: State, u: Inputs, period: float) -> State:
    """State (q, v) after one period under a held input.

    Args:
        model: System or model.
        x: State (q, v).
        u: Input.
        period: How long [s].

    Returns:
        The state then.
    """

    def field(t: Scalar, x: State, u: Inputs) -> State:
        del t
        q, v = jnp.split(x, 2)
        return jnp.concatenate(velocity_field(model, q, v, u))

    return RK4(2).step(field, x, jnp.zeros((), x.dtype), jnp.asarray(period, x.dtype), u, u)


def plan_motion(
    model: AbstractPortHamiltonian,
    start: Target,
    target: Target,
    *,
    limits: Limits,
    duration: float = 4.0,
    period: float = 0.02,
    seed: int = 0,
) -> Motion:
    """Find a motion from rest at one configuration to rest at another by iterative linear-quadratic regulators.

    Several sines of random frequency are improved at once; the best end is taken.

    Args:
        model: System or learned model.
        start: Configuration to start from.
        target: Configuration to reach.
        limits: Largest magnitude of the inputs; the plan uses a share of it.
        duration: Length of the motion [s].
        period: Time for which an input is held [s].
        seed: Seed of the first guesses.

    Returns:
        The best motion.

    Raises:
        ValueError: If there are no limits, or no guess reached the target.

    References:
        Li & Todorov (2004), *Iterative linear quadratic regulator design for nonlinear biological movement systems*.
    """
    bounds = input_limits(limits, model.inputs)
    if not np.isfinite(bounds).all():
        raise ValueError(f"A motion is planned within limits, which must be finite; got {bounds.tolist()}.")
    q0, goal = as_array(start), as_array(target)
    still = jnp.zeros_like(goal)
    problem = _Problem(
        model=model,
        goal=jnp.concatenate([goal, still]),
        limits=as_array(_SHARE * bounds),
        period=period,
    )
    generator = np.random.default_rng(seed)
    ts = period * np.arange(round(duration / period))
    shape = (_GUESSES, 1, model.inputs)
    size, turn = generator.uniform(0.1, 0.8, shape), generator.uniform(0, 2 * np.pi, shape)
    frequency = generator.uniform(0.5, 1.5, shape) * bandwidth(model, q0) / 3
    guesses = size * np.sin(frequency * ts[:, None] + turn)
    plans = _improved(problem, jnp.concatenate([q0, still]), jnp.asarray(guesses, goal.dtype))
    best = int(jnp.nanargmin(plans.cost))
    if not float(jnp.sqrt(2 * problem.end(plans.x[best, -1]) / _END)) < _REACHED:
        raise ValueError(
            f"No motion of {duration} s from {q0.tolist()} to {goal.tolist()} within the limits was found on the "
            "model. Allow more input or time."
        )
    return Motion(plans.x[best], problem.limits[None] * jnp.tanh(plans.w[best]), period)


class _Iterate(NamedTuple):
    """Where the iteration stands: a motion, and its damping."""

    plan: _Plan
    damping: Scalar


@eqx.filter_jit
def _improved(problem: _Problem, start: State, guesses: Float[Array, "c N m"]) -> _Plan:
    """Improve every guess."""

    def advance(x: State, w: Inputs) -> tuple[State, State]:
        after = problem.step(x, w)
        return after, after

    def one(w: Float[Array, "N m"]) -> _Plan:
        x = jnp.concatenate([start[None], jax.lax.scan(advance, start, w)[1]])
        first = _Iterate(_Plan(x, w, problem.total(x, w)), jnp.asarray(1e-2, start.dtype))
        return jax.lax.scan(lambda it, _: (_iteration(problem, it), None), first, None, length=_ITERATIONS)[0].plan

    return jax.vmap(one)(guesses)


def _iteration(problem: _Problem, before: _Iterate) -> _Iterate:
    """Solve the linear-quadratic problem about a motion, and go along its solution as far as the cost falls."""
    x, w, cost = before.plan
    k, K = _backward(problem, x, w, before.damping)

    def follow(share: Scalar) -> _Plan:
        def step(state: State, at: tuple) -> tuple:
            old_x, old_w, k, K = at
            new_w = old_w + share * k + K @ (state - old_x)
            after = problem.step(state, new_w)
            return after, (after, new_w)

        _, (later, new_w) = jax.lax.scan(step, x[0], (x[:-1], w, k, K))
        new_x = jnp.concatenate([x[:1], later])
        total = problem.total(new_x, new_w)
        return _Plan(new_x, new_w, jnp.where(jnp.isfinite(total), total, jnp.inf))

    tried = jax.vmap(follow)(0.5 ** jnp.arange(_HALVINGS, dtype=x.dtype))
    best = jax.tree.map(lambda leaf: leaf[jnp.argmin(tried.cost)], tried)
    better = best.cost < cost
    plan = jax.tree.map(lambda new, old: jnp.where(better, new, old), best, before.plan)
    damping = before.damping
    return _Iterate(plan, jnp.where(better, jnp.maximum(damping / 2, 1e-9), jnp.minimum(damping * 5, 1e6)))


def _backward(
    problem: _Problem, x: Float[Array, "T s"], w: Float[Array, "N m"], damping: Scalar
) -> tuple[Float[Array, "N m"], Float[Array, "N m s"]]:
    """Gains of the linear-quadratic problem about a motion."""
    A, B = jax.vmap(jax.jacfwd(problem.step, (0, 1)))(x[:-1], w)
    lx, lw = jax.vmap(jax.grad(problem.running, (0, 1)))(x[:-1], w)
    lxx = jax.vmap(jax.hessian(problem.running, 0))(x[:-1], w)
    lww = jax.vmap(jax.hessian(problem.running, 1))(x[:-1], w)
    more = damping * jnp.eye(w.shape[1], dtype=x.dtype)

    def step(value: tuple, at: tuple) -> tuple:
        Vx, Vxx = value
        A, B, lx, lw, lxx, lww = at
        Qx, Qw = lx + A.T @ Vx, lw + B.T @ Vx
        Qxx, Qww, Qwx = lxx + A.T @ Vxx @ A, lww + B.T @ Vxx @ B + more, B.T @ Vxx @ A
        k, K = -jnp.linalg.solve(Qww, Qw), -jnp.linalg.solve(Qww, Qwx)
        Vx = Qx + K.T @ (Qww @ k + Qw) + Qwx.T @ k
        Vxx = Qxx + K.T @ (Qww @ K + Qwx) + Qwx.T @ K
        return (Vx, 0.5 * (Vxx + Vxx.T)), (k, K)

    end = jax.grad(problem.end)(x[-1]), _END * jnp.eye(x.shape[1], dtype=x.dtype)
    _, gains = jax.lax.scan(step, end, (A, B, lx, lw, lxx, lww), reverse=True)
    return gains

"""Simulate any dynamics forward under sampled inputs."""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from symoden.mechanics import AbstractDynamics
from symoden.shapes import Coordinates, Rates, Times, floats, vector

from ._solvers import FEWEST_SUBSTEPS, RK4, AbstractSolver

SampledInputs: TypeAlias = Float[Array, "T m"]
Ends: TypeAlias = tuple[Float[Array, "T-1 m"], Float[Array, "T-1 m"]]
Hold: TypeAlias = Callable[[SampledInputs], Ends]
"""From inputs at the samples to those at the start and at the end of every sampling interval."""


def zero_hold(us: SampledInputs) -> Ends:
    """Hold each input until the next sample, as digital controllers do.

    Args:
        us: Inputs at the samples; the last one never acts.

    Returns:
        Inputs at the start and at the end of every sampling interval.
    """
    return us[:-1], us[:-1]


def linear_hold(us: SampledInputs) -> Ends:
    """Join the samples of the input by straight lines, as for a measured smooth force.

    Args:
        us: Inputs at the samples.

    Returns:
        Inputs at the start and at the end of every sampling interval.
    """
    return us[:-1], us[1:]


HOLDS: dict[str, Hold] = {"zero": zero_hold, "linear": linear_hold}
"""What inputs do between samples, by the name that data sets give it."""


class Rollout(NamedTuple):
    """A simulated trajectory; from the sample on where it diverges, it holds NaN or infinities.

    Attributes:
        states: States of the dynamics at the samples.
        q: Coordinates.
        rates: Velocities or momenta, as the data have them.
        observations: Embedded coordinates, then the rates.
    """

    states: Float[Array, "T s"]
    q: Float[Array, "T n"]
    rates: Float[Array, "T n"]
    observations: Float[Array, "T o"]


def rollout(
    dynamics: AbstractDynamics,
    q0: Coordinates,
    rates0: Rates,
    ts: Times,
    us: SampledInputs,
    *,
    solver: AbstractSolver | None = None,
    hold: Hold | str = "zero",
    unroll: bool = False,
) -> Rollout:
    """Simulate from a measured configuration and its rates.

    A number of samples that is new compiles anew, which takes seconds for a learned model: pad `ts` and `us` to a
    length that comes again where many differ.

    Args:
        dynamics: Analytic system or learned model.
        q0: Coordinates at the first sample.
        rates0: Velocities or momenta there, as `dynamics.momenta` says.
        ts: Times of the samples [s], increasing; the intervals may differ. The dynamics count from the first one.
        us: Inputs at the samples, one row per time; without inputs, no columns.
        solver: What advances the state from sample to sample; four RK4 steps if absent, as `predict`
            takes. Where training needed more, `FitResult.solver` or a run's `evaluation_solver(config)` has as many.
        hold: How an input acts between samples: "zero", "linear", or a function as `zero_hold` and `linear_hold` are.
        unroll: Write the samples out instead of looping over them: slower to compile, faster for large networks.

    Returns:
        The trajectory at the samples, the first one included.

    Raises:
        ValueError: If a shape or `hold` is wrong, or the times do not increase (which is not looked at while JAX traces
            them).

    Example:
        >>> from symoden.systems import Pendulum
        >>> ts = jnp.linspace(0.0, 1.0, 21)
        >>> path = rollout(Pendulum(), jnp.array([0.1]), jnp.zeros(1), ts, jnp.zeros((21, 1)))
        >>> path.q.shape
        (21, 1)
    """
    q0, rates0 = (
        vector(each, dynamics.space.size, f"`rollout`: `{name}`", f"coordinate of {dynamics.space}")
        for name, each in (("q0", q0), ("rates0", rates0))
    )
    ts, us = _checked_samples(ts, us, dynamics.inputs)
    advance = RK4(FEWEST_SUBSTEPS) if solver is None else solver
    if isinstance(hold, str) and hold not in HOLDS:
        raise ValueError(f"`rollout`: `hold` must be one of {', '.join(HOLDS)}, or a function; got {hold!r}.")
    ends = HOLDS[hold] if isinstance(hold, str) else hold
    traced = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((dynamics, q0, rates0, ts, us, advance)))
    simulate = _simulate if traced else _compiled
    return simulate(dynamics, q0, rates0, ts, us, advance, ends, unroll)


def _simulate(
    dynamics: AbstractDynamics,
    q0: Coordinates,
    rates0: Rates,
    ts: Times,
    us: SampledInputs,
    advance: AbstractSolver,
    hold: Hold,
    unroll: bool,  # noqa: FBT001 - filter_jit takes what is static by its place
) -> Rollout:
    """Simulate from arguments that have been checked."""

    def step(state: Float[Array, " s"], sample: tuple) -> tuple[Float[Array, " s"], Float[Array, " s"]]:
        after = advance.step(dynamics.derivative, state, *sample)
        return after, after

    start = dynamics.encode(q0, rates0)
    _, later = jax.lax.scan(step, start, (ts[:-1], ts[1:], *hold(us)), unroll=unroll)
    states = jnp.concatenate([start[None], later])
    q, rates = jax.vmap(dynamics.decode)(states)
    return Rollout(states=states, q=q, rates=rates, observations=jax.vmap(dynamics.observe)(states))


_compiled = eqx.filter_jit(_simulate)  # A loop that is not would be compiled anew in every call, and be kept.


def _checked_samples(ts: object, us: object, inputs: int) -> tuple[jax.Array, jax.Array]:
    """Times from the first one on, which increase, and as many inputs."""
    times, driven = floats(ts, "`rollout`: `ts`"), floats(us, "`rollout`: `us`")
    if times.ndim != 1 or not times.size:
        raise ValueError(
            f"`rollout`: `ts` must be the times of one rollout, (T,) with T at least 1; got shape {times.shape}. "
            "`jax.vmap` takes many rollouts."
        )
    if driven.shape != (times.size, inputs):
        raise ValueError(
            f"`rollout`: `us` must have the shape ({times.size}, {inputs}), a row per time of `ts` and a column per "
            f"input; got {driven.shape}. If the inputs of the T − 1 intervals are known, repeat the last row: under "
            "`zero_hold` it never acts."
        )
    if isinstance(times, Tracer):
        return times - times[0], driven
    # Seconds since 1970, or since a robot was switched on, lose their fractions in single precision.
    exact = np.asarray(ts, np.float64)
    late = np.flatnonzero(~(np.diff(exact) > 0))
    if late.size:
        k = int(late[0])
        raise ValueError(
            f"`rollout`: `ts` must increase; got {float(exact[k + 1])} after {float(exact[k])} at index {k + 1}. "
            "Sort the samples by time, and keep one of each."
        )
    return jnp.asarray(exact - exact[0], times.dtype), driven

"""Predictor feedback: a controller that sees the state in which its inputs will act, filtered and looked ahead."""

from typing import NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from symoden.shapes import Coordinates, Inputs, Scalar, Velocities

from ._controller import AbstractController
from ._loop import Loop
from ._motion import moved
from ._observer import Estimate, Observer


class Memory(NamedTuple):
    """What predictor feedback remembers from one period to the next.

    Attributes:
        guess: What is believed of the state.
        waiting: Inputs that were given and do not act yet, the oldest first.
        acting: What acts.
    """

    guess: Estimate
    waiting: Float[Array, "w m"]
    acting: Inputs


@final
class PredictorFeedback(eqx.Module):
    """Give each input for the state in which it will act, which the model predicts from what was measured and given.

    Noise is filtered by the observer. A delay is looked through by the inputs that wait; a lag τ is to slow motions a
    delay of τ more, over which what acts is taken to stay.

    Attributes:
        controller: What is asked for inputs.
        observer: What filters and predicts.
        loop: How the machine is connected: period, delay and lag count.

    References:
        Krstic (2009), *Delay compensation for nonlinear, adaptive, and PDE systems*, chapter 2: predictor feedback.
    """

    controller: AbstractController
    observer: Observer
    loop: Loop = eqx.field(static=True)

    def start(self, q: Coordinates, v: Velocities) -> Memory:
        """Begin with a machine that no input moves.

        Args:
            q: Measured coordinates.
            v: Measured velocities.

        Returns:
            What to remember.
        """
        none = jnp.zeros((self.loop.waiting + 1, self.observer.model.inputs), q.dtype)
        return Memory(self.observer.start(q, v), none[1:], none[0])

    def answer(self, memory: Memory, q: Coordinates, v: Velocities, t: Scalar | None = None) -> tuple[Inputs, Memory]:
        """Input for a measurement, once in each period; where a number is lost, for what was predicted.

        Args:
            memory: What was remembered.
            q: Measured coordinates.
            v: Measured velocities.
            t: Time [s], zero if absent.

        Returns:
            The input, within the controller's limits, or zeros where it is no number; and what to remember.

        Raises:
            ValueError: If the number of lags is wrong.
        """
        loop, t = self.loop, jnp.zeros((), q.dtype) if t is None else t
        lag = loop.lag_of(self.observer.model.inputs)
        guess = _either(memory.guess, self.observer.start(q, v))  # It begins anew where it has lost the machine.
        guess = _either(self.observer.correct(guess, q, v), guess)
        coming, then = lag.through(memory.acting, memory.waiting, first=loop.early, period=loop.period)
        ahead = self.observer.look_ahead(guess, coming, first=loop.early, period=loop.period)
        u = self._anticipated(*ahead, then, t + loop.delay, lag.seconds)
        u = jnp.where(jnp.isfinite(u).all(), u, 0.0)
        given, acting = jnp.concatenate([memory.waiting, u[None]]), memory.acting
        for held, seconds in loop.parts(given):
            acting, mean = lag.follow(acting, held, seconds)
            guess = self.observer.predict(guess, mean, seconds)
        return u, Memory(guess, given[1:], acting)

    def _anticipated(self, q: Coordinates, v: Velocities, acting: Inputs, t: Scalar, lags: tuple[float, ...]) -> Inputs:
        """Each input for the state that will be reached a lag from then."""
        us = {lag: self.controller(*moved(self.observer.model, q, v, acting, lag), t + lag) for lag in set(lags)}
        return jnp.stack([us[lag][i] for i, lag in enumerate(lags)])


def _either(first: Estimate, second: Estimate) -> Estimate:
    """The first one; the second where a number of the first is lost."""
    finite = jnp.all(jnp.array([jnp.isfinite(part).all() for part in first]))
    return jax.tree.map(lambda one, other: jnp.where(finite, one, other), first, second)

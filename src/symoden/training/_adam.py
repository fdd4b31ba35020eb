"""First-order training: Adam on random batches of windows, many steps compiled as one call."""

from typing import Any, Final, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax.typing import ArrayLike, DTypeLike
from jaxtyping import Array, Float, Int, PyTree

from symoden.shapes import Scalar

from ._config import TrainingConfig
from ._objective import AbstractObjective, Batch

MOST_STEPS: Final = 200
"""Steps of one compiled call."""


class AdamState(NamedTuple):
    """Everything that Adam needs to go on.

    Attributes:
        free: Trainable parameters, a model with None for all else.
        optimizer: State of the optimiser.
        step: Number of steps done.
    """

    free: PyTree
    optimizer: Any
    step: Int[Array, ""]


@final
class Adam(eqx.Module):
    """Settings of the optimiser, as numbers of the parameters' precision: other ones need no new compilation.

    A step whose gradient is not finite is skipped: under untrained weights a rare window may diverge.

    Attributes:
        steps: Number of steps over which a cosine schedule falls to zero.
        learning_rate: First learning rate.
        clip: Largest norm of the gradient, if any.
        weight_decay: Factor of the L2 term in the gradient, as in the paper (not decoupled).
        cosine: Let the learning rate fall; otherwise it is constant, as in the paper.
    """

    steps: Float[Array, ""]
    learning_rate: Float[Array, ""]
    clip: Float[Array, ""] | None
    weight_decay: Float[Array, ""]
    cosine: bool = eqx.field(static=True)

    @classmethod
    def of(cls, config: TrainingConfig, dtype: DTypeLike) -> "Adam":
        """The optimiser of some settings.

        Args:
            config: Settings.
            dtype: Precision of the parameters.

        Returns:
            The optimiser.
        """
        return cls(
            steps=jnp.asarray(max(config.adam_steps, 1), dtype),
            learning_rate=jnp.asarray(config.learning_rate, dtype),
            clip=None if config.clip is None else jnp.asarray(config.clip, dtype),
            weight_decay=jnp.asarray(config.weight_decay, dtype),
            cosine=config.cosine,
        )

    @eqx.filter_jit
    def init(self, free: PyTree) -> PyTree:
        """Its state before the first step.

        Args:
            free: Trainable parameters, a model with None for all else.

        Returns:
            The state.
        """
        return self.rule.init(free)

    @property
    def rule(self) -> optax.GradientTransformation:
        """What it does in a step."""
        fall = optax.cosine_decay_schedule(1.0, 1)

        def falling(count: ArrayLike) -> Array:
            return self.learning_rate * fall(jnp.asarray(count, self.steps.dtype) / self.steps)

        rate = falling if self.cosine else self.learning_rate
        clipping = optax.identity() if self.clip is None else optax.clip_by_global_norm(self.clip)
        chain = optax.chain(optax.add_decayed_weights(self.weight_decay), clipping, optax.adam(rate))
        return optax.apply_if_finite(chain, max_consecutive_errors=np.iinfo(np.int32).max)


@final
class Sampler(eqx.Module):
    """Chooses the windows of every step by the step's number alone, so that a resumed run draws the same ones.

    Attributes:
        windows: All training windows.
        seed: Of the whole training.
        size: Windows in a step.
        shuffle: Draw them at random; otherwise take consecutive blocks in turn, as the paper does with the windows of
            one input. The last block goes on with the first windows where it is not full.
    """

    windows: Batch
    seed: Int[Array, ""]
    size: int = eqx.field(static=True)
    shuffle: bool = eqx.field(static=True)

    def draw(self, step: Int[Array, ""]) -> Batch:
        """Windows of one step."""
        total = self.windows.ts.shape[0]
        if self.shuffle:
            key = jax.random.fold_in(jax.random.key(self.seed), step)
            return self.windows.take(jax.random.randint(key, (self.size,), 0, total))
        return self.windows.take((step * self.size + jnp.arange(self.size)) % total)


@eqx.filter_jit
def adam_steps(
    state: AdamState,
    fixed: PyTree,
    objective: AbstractObjective,
    sampler: Sampler,
    optimizer: Adam,
    steps: Int[Array, ""],
) -> tuple[AdamState, Float[Array, " k"]]:
    """Take some steps in one compiled call.

    Args:
        state: Where to start.
        fixed: What is not trained, a model with None for the parameters.
        objective: How rollouts are compared with windows.
        sampler: Chooses the windows.
        optimizer: What updates the parameters.
        steps: Number of steps to take, at most `MOST_STEPS`.

    Returns:
        The state after the steps and the loss before each of them; NaN for those that were not taken.
    """
    rule = optimizer.rule

    def loss(free: PyTree, windows: Batch) -> Scalar:
        return objective.loss(eqx.combine(free, fixed), windows)

    def one(k: Int[Array, ""], pair: tuple[AdamState, Float[Array, " k"]]) -> tuple[AdamState, Float[Array, " k"]]:
        state, losses = pair
        value, gradient = jax.value_and_grad(loss)(state.free, sampler.draw(state.step))
        updates, memory = rule.update(gradient, state.optimizer, state.free)
        after = AdamState(optax.apply_updates(state.free, updates), memory, state.step + 1)
        return after, losses.at[k].set(value)

    dtype = optimizer.learning_rate.dtype
    return jax.lax.fori_loop(0, steps, one, (state, jnp.full(MOST_STEPS, jnp.nan, dtype)))

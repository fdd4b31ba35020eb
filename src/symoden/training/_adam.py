"""First-order training: Adam on random batches of windows, many steps compiled as one call."""

from typing import Any, NamedTuple, final

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int, PyTree

from symoden.shapes import Scalar

from ._objective import AbstractObjective, Batch


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


def adam(
    *, steps: int, learning_rate: float, cosine: bool, clip: float | None, weight_decay: float
) -> optax.GradientTransformation:
    """Compose the optimiser.

    A step whose gradient is not finite is skipped: under untrained weights a rare window may diverge.

    Args:
        steps: Number of steps over which a cosine schedule falls to zero.
        learning_rate: First learning rate.
        cosine: Let the learning rate fall; otherwise it is constant, as in the paper.
        clip: Largest norm of the gradient, if any.
        weight_decay: Factor of the L2 term in the gradient, as in the paper (not decoupled).

    Returns:
        The optimiser.
    """
    rate = optax.cosine_decay_schedule(learning_rate, max(steps, 1)) if cosine else learning_rate
    decay = optax.add_decayed_weights(weight_decay) if weight_decay else optax.identity()
    clipping = optax.identity() if clip is None else optax.clip_by_global_norm(clip)
    return optax.apply_if_finite(optax.chain(decay, clipping, optax.adam(rate)), max_consecutive_errors=max(steps, 1))


@final
class Sampler(eqx.Module):
    """Chooses the windows of every step by the step's number alone, so that a resumed run draws the same ones.

    Attributes:
        windows: All training windows.
        seed: Of the whole training.
        size: Windows in a step.
        shuffle: Draw them at random; otherwise take consecutive blocks in turn, as the paper does with the windows of
            one input.
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
        return self.windows.take((step % (total // self.size)) * self.size + jnp.arange(self.size))


@eqx.filter_jit
def adam_steps(
    state: AdamState,
    fixed: PyTree,
    objective: AbstractObjective,
    sampler: Sampler,
    optimizer: optax.GradientTransformation,
    *,
    steps: int,
) -> tuple[AdamState, Float[Array, " k"]]:
    """Take some steps in one compiled call.

    Args:
        state: Where to start.
        fixed: What is not trained, a model with None for the parameters.
        objective: How rollouts are compared with windows.
        sampler: Chooses the windows.
        optimizer: From `adam`.
        steps: Number of steps to take.

    Returns:
        The state after the steps and the loss before each of them.
    """

    def loss(free: PyTree, windows: Batch) -> Scalar:
        return objective.loss(eqx.combine(free, fixed), windows)

    def one(state: AdamState, _: None) -> tuple[AdamState, Scalar]:
        value, gradient = jax.value_and_grad(loss)(state.free, sampler.draw(state.step))
        updates, memory = optimizer.update(gradient, state.optimizer, state.free)
        return AdamState(optax.apply_updates(state.free, updates), memory, state.step + 1), value

    return jax.lax.scan(one, state, length=steps)

"""First-order training: Adam on random batches of windows, many steps compiled as one call."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float, Int, PRNGKeyArray, PyTree

from symoden.shapes import Scalar

from ._problem import Batch, Objective


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
    return optax.chain(decay, clipping, optax.adam(rate))


def start_adam(optimizer: optax.GradientTransformation, free: PyTree) -> AdamState:
    """State before the first step."""
    return AdamState(free, optimizer.init(free), jnp.zeros((), int))


@eqx.filter_jit(donate="none")
def adam_steps(
    state: AdamState,
    fixed: PyTree,
    objective: Objective,
    batch: Batch,
    optimizer: optax.GradientTransformation,
    *,
    steps: int,
    batch_size: int,
    shuffle: bool,
    key: PRNGKeyArray,
) -> tuple[AdamState, Float[Array, " k"]]:
    """Take some steps in one compiled call.

    Args:
        state: Where to start.
        fixed: What is not trained, a model with None for the parameters.
        objective: How rollouts are compared with windows.
        batch: All training windows.
        optimizer: From `adam`.
        steps: Number of steps to take.
        batch_size: Windows in a step.
        shuffle: Draw the windows of every step at random; otherwise take consecutive blocks in turn, as the paper does
            with the windows of one input.
        key: Of the whole training; each step folds in its number, so that a resumed run draws the same windows.

    Returns:
        The state after the steps and the loss before each of them.
    """
    total = batch.ts.shape[0]
    blocks = max(total // batch_size, 1)

    def loss(free: PyTree, windows: Batch) -> Scalar:
        return objective.loss(eqx.combine(free, fixed), windows)

    def one(state: AdamState, _: None) -> tuple[AdamState, Scalar]:
        if shuffle:
            index = jax.random.randint(jax.random.fold_in(key, state.step), (batch_size,), 0, total)
        else:
            index = (state.step % blocks) * batch_size + jnp.arange(batch_size)
        value, gradient = jax.value_and_grad(loss)(state.free, batch.take(index))
        updates, optimizer_state = optimizer.update(gradient, state.optimizer, state.free)
        return AdamState(optax.apply_updates(state.free, updates), optimizer_state, state.step + 1), value

    return jax.lax.scan(one, state, length=steps)

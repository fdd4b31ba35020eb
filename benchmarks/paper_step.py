"""Time of one training step at the paper's sizes (batch 1088, float32), beside a matrix product's peak.

    python benchmarks/paper_step.py [TASK ...]

Figures to beat, the authors' PyTorch code on two cores: 0.31 s (task 1) and 2.2 s (tasks 3 and 4) a step.
"""

import sys
import time
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from symoden.blocks import count_parameters, trainable
from symoden.data import windows
from symoden.experiments import preset, simulate, task
from symoden.integrate import RK4, zero_hold
from symoden.models import build
from symoden.spaces import Space
from symoden.training._adam import Adam, AdamState, Sampler, adam_steps
from symoden.training._objective import Batch, Objective

STEPS = 5


def seconds_of(function: Callable[..., Any], *arguments: Any) -> float:  # noqa: ANN401 - whatever it takes
    """Least time of three calls, after one that compiles."""
    jax.block_until_ready(function(*arguments))
    times = []
    for _ in range(3):
        start = time.perf_counter()
        jax.block_until_ready(function(*arguments))
        times.append(time.perf_counter() - start)
    return min(times)


def peak() -> float:
    """Floating-point operations a second of a large product in single precision."""
    size = 2048
    a = jnp.ones((size, size), jnp.float32)
    return 2 * size**3 / seconds_of(jax.jit(lambda a: a @ a), a)


def step_seconds(name: str) -> tuple[float, int]:
    """Time of a step and number of parameters."""
    model_config, config = preset("paper", task=name, kind="dissipative")
    dataset = simulate(task(name)).dataset
    space = Space.parse(dataset.space)
    model = build(model_config, space, dataset.inputs, momenta=dataset.momenta, key=jax.random.key(0))
    batch = Batch.of(windows(dataset.train, config.horizon or 3), jnp.float32)
    free, fixed = eqx.partition(model, trainable(model))
    optimizer = Adam.of(config, jnp.float32)
    objective = Objective(jnp.ones(space.embedded_size + space.size), RK4(unroll=True), zero_hold, unroll=True)
    sampler = Sampler(batch, jnp.asarray(0), config.batch_size, shuffle=False)

    def run(state: AdamState) -> tuple:
        return adam_steps(state, fixed, objective, sampler, optimizer, jnp.asarray(STEPS))

    return seconds_of(run, AdamState(free, optimizer.init(free), jnp.zeros((), int))) / STEPS, count_parameters(model)


def main() -> None:
    """Print a line for each task."""
    flops = peak()
    print(f"peak of a matrix product: {flops / 1e9:.0f} GFLOP/s")
    for name in sys.argv[1:] or ["pendulum-canonical", "pendulum", "cartpole", "acrobot"]:
        seconds, parameters = step_seconds(name)
        print(f"{name}: {parameters} parameters, {seconds:.3f} s a step")


if __name__ == "__main__":
    main()

"""Few and noisy trajectories of a pendulum: symoden's default beside PySINDy, on the same data.

    python benchmarks/noise.py [--seeds 3] [--noise 0.05]

32 trajectories of 1 s at 20 Hz under constant torques, Gaussian noise on position and velocity; then 16 unseen rollouts
of 5 s from clean states. Printed is the mean squared error over position (the short way round) and velocity of each
model's rollouts, its median and mean over the 16. PySINDy is no dependency of symoden: `pip install pysindy` beside it.
"""

import argparse
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

import symoden
from symoden.data import Dataset, Trajectory
from symoden.experiments import task
from symoden.integrate import RK4, rollout
from symoden.mechanics import AbstractDynamics

STEP, SAMPLES, LONG = 0.05, 21, 101
SUBSTEPS, DIVERGED = 4, 1e3
TASK = task("pendulum")
Predict = Callable[[np.ndarray, float], np.ndarray]  # State (q, v) and torque to the states of a rollout.


def roll(dynamics: AbstractDynamics, start: np.ndarray, torque: float, samples: int) -> np.ndarray:
    """States (q, v) of a rollout at 20 Hz."""
    ts, us = jnp.arange(samples) * STEP, jnp.full((samples, 1), torque)
    path = rollout(dynamics, jnp.asarray(start[:1]), jnp.asarray(start[1:]), ts, us, solver=RK4(20))
    return np.concatenate([np.asarray(path.q), np.asarray(path.rates)], axis=1)


def draw(generator: np.random.Generator, count: int, samples: int) -> list[tuple[np.ndarray, float]]:
    """Clean rollouts of the truth from random states under random constant torques."""
    low, high = np.asarray(TASK.position_bounds + TASK.rate_bounds).T
    starts = generator.uniform(low, high, (count, 2))
    torques = generator.uniform(-2, 2, count)
    return [(roll(TASK.system, start, torque, samples), torque) for start, torque in zip(starts, torques, strict=True)]


def learn_symoden(states: list[np.ndarray], torques: list[float], seed: int) -> Predict:
    """The default preset."""
    ts = STEP * np.arange(SAMPLES)
    recordings = tuple(
        Trajectory(name=f"r{i}", ts=ts, q=x[:, :1], rates=x[:, 1:], us=np.full((SAMPLES, 1), torque))
        for i, (x, torque) in enumerate(zip(states, torques, strict=True))
    )
    config = symoden.TrainingConfig(seed=seed)
    model = symoden.fit(Dataset(name="noisy", space="T1", train=recordings), config=config).model
    return lambda start, torque: roll(model, start, torque, LONG)


def learn_sindy(states: list[np.ndarray], torques: list[float], library: str) -> Predict:
    """PySINDy with smoothed differences, and sparse least squares on polynomials or on the right trigonometry."""
    import pysindy  # pyright: ignore[reportMissingImports]

    # PySINDy looks into the code of its functions, which NumPy's own have not.
    terms = [lambda x: x, lambda x: np.sin(x), lambda x: np.cos(x)]  # noqa: PLW0108
    names = [lambda x: x, lambda x: f"sin({x})", lambda x: f"cos({x})"]
    features = {
        "trigonometric": pysindy.CustomLibrary(terms, function_names=names, include_bias=True),
        "polynomial": pysindy.PolynomialLibrary(3),
    }[library]
    model = pysindy.SINDy(
        feature_library=features,
        optimizer=pysindy.STLSQ(threshold=0.1),
        differentiation_method=pysindy.SmoothedFiniteDifference(),
    )
    inputs = [np.full((SAMPLES, 1), torque) for torque in torques]
    model.fit([np.asarray(x) for x in states], t=STEP, u=inputs)

    def predict(start: np.ndarray, torque: float) -> np.ndarray:
        u, step, path = np.array([[torque]]), STEP / SUBSTEPS, [start]

        def slope(x: np.ndarray) -> np.ndarray:
            return np.asarray(model.predict(x[None], u=u))[0]

        x = start
        with np.errstate(all="ignore"):
            for k in range(SUBSTEPS * (LONG - 1)):  # RK4 of its own: adaptive solvers stall where a rollout diverges.
                if not np.all(np.abs(x) < DIVERGED):
                    return np.full((LONG, 2), np.inf)
                k1 = slope(x)
                k2 = slope(x + step / 2 * k1)
                k3 = slope(x + step / 2 * k2)
                x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + step * k3))
                if (k + 1) % SUBSTEPS == 0:
                    path.append(x)
        return np.array(path)

    return predict


def errors(predict: Predict, unseen: list[tuple[np.ndarray, float]]) -> np.ndarray:
    """Mean squared error of each unseen rollout."""
    found = []
    for states, torque in unseen:
        off = predict(states[0], torque)[:LONG] - states
        if not np.isfinite(off).all():
            found.append(np.inf)
            continue
        off[:, 0] = np.mod(off[:, 0] + np.pi, 2 * np.pi) - np.pi
        found.append(float(np.mean(off**2)))
    return np.array(found)


def main() -> None:
    """Learn, roll out, print."""
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's signature
    parser = argparse.ArgumentParser(description="Few and noisy trajectories of a pendulum.")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--noise", type=float, default=0.05)
    words = parser.parse_args()
    print("| seed | model | median | mean | seconds |\n|---|---|---|---|---|")
    for seed in range(words.seeds):
        generator = np.random.default_rng(seed)
        train, unseen = draw(generator, 32, SAMPLES), draw(generator, 16, LONG)
        noisy = [states + words.noise * generator.standard_normal(states.shape) for states, _ in train]
        torques = [torque for _, torque in train]
        for name, learn in (
            ("symoden", lambda: learn_symoden(noisy, torques, seed)),  # noqa: B023 - called at once
            ("PySINDy, trigonometric", lambda: learn_sindy(noisy, torques, "trigonometric")),  # noqa: B023
            ("PySINDy, polynomial", lambda: learn_sindy(noisy, torques, "polynomial")),  # noqa: B023
        ):
            start = time.perf_counter()
            try:
                predict = learn()
            except ImportError:
                print(f"| {seed} | {name} | not installed | | |")
                continue
            seconds = time.perf_counter() - start
            found = errors(predict, unseen)
            print(f"| {seed} | {name} | {np.median(found):.2g} | {np.mean(found):.2g} | {seconds:.0f} |", flush=True)


if __name__ == "__main__":
    main()

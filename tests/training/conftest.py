"""Recordings of a damped pendulum, of a chain and of any motion, and settings that train in a moment."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.data import Dataset, Trajectory
from symoden.integrate import RK4, rollout
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space
from symoden.systems import LinkChain, Pendulum
from symoden.training import TrainingConfig, _data, fit
from symoden.training._levenberg_stage import LevenbergStage
from symoden.training._state import Incumbent, TrainingState
from symoden.training._weighing import Weighing

CONSTANT = BlockConfig(constant=True)
CORRECTED = BlockConfig(hidden=(3,), constant=True)


@pytest.fixture(scope="session")
def small():
    """A model with a correction in it, so that every stage has something to do."""
    return ModelConfig(
        inverse_mass=CONSTANT,
        potential=BlockConfig(hidden=(4,)),
        actuation=CONSTANT,
        friction=CORRECTED,
        energy=(4,),
        flow=(4,),
        knees=(),
    )


@pytest.fixture(scope="session")
def plain():
    """A model of chains, with viscous friction alone."""
    return ModelConfig(
        inverse_mass=BlockConfig(harmonics=True),
        potential=BlockConfig(harmonics=True),
        actuation=CONSTANT,
        friction=CONSTANT,
        knees=(),
    )


@pytest.fixture(scope="session")
def quick():
    """A few steps in every stage."""
    return TrainingConfig(
        validation=0.25,
        adam_steps=300,
        batch_size=8,
        horizon=3,
        lm_steps=3,
        lm_horizon=5,
        lm_substeps=1,
        growth_steps=2,
        relevance_steps=2,
    )


@pytest.fixture(scope="session")
def second_order():
    """Levenberg-Marquardt, then all that is asked for one after the other, on rollouts of 0.4 s."""
    return TrainingConfig(adam_steps=0, lm_steps=10, growth_steps=12, relevance_steps=0, lm_horizon=20, lm_substeps=2)


@pytest.fixture(scope="session")
def pendulum():
    """Simulate recordings of a damped pendulum."""

    def simulate(*, samples=25, count=3, inputs=1, momenta=False, seed=0):
        generator = np.random.default_rng(seed)
        system = Pendulum(damping=0.2, momenta=momenta)
        ts = np.linspace(0.0, 0.05 * (samples - 1), samples)
        recordings = []
        for k in range(count):
            us = np.repeat(generator.normal(size=(samples // 5 + 1, 1)), 5, axis=0)[:samples] * inputs
            q0, v0 = generator.uniform(-2, 2, 1), generator.normal(size=1)
            path = rollout(system, *(jnp.asarray(x) for x in (q0, v0, ts, us)), solver=RK4(4))
            recording = {"ts": ts, "q": np.asarray(path.q), "rates": np.asarray(path.rates), "us": us[:, :inputs]}
            recordings.append(Trajectory(name=f"swing{k}", **recording))
        return Dataset(name="swings", space="T1", train=tuple(recordings), momenta=momenta)

    return simulate


@pytest.fixture(scope="session")
def swings():
    """Simulate recordings of a chain of three links under inputs that change at some pace."""

    def simulate(*, step=0.01, seconds=1.0, count=6, pace=3.0, seed=0):
        chain = LinkChain.of_rods(3, mass=0.5, length=0.4, damping=0.1)
        generator = np.random.default_rng(seed)
        ts = np.arange(round(seconds / step) + 1) * step
        recordings = []
        for k in range(count):
            phase = generator.uniform(0, 6, 3)
            us = np.sin(pace * ts[:, None] + phase)
            q0, v0 = generator.uniform(-1, 1, (2, 3))
            path = rollout(chain, *map(jnp.asarray, (q0, v0, ts, us)), solver=RK4(8))
            parts = {"ts": ts, "q": np.asarray(path.q), "rates": np.asarray(path.rates), "us": us}
            recordings.append(Trajectory(name=f"swing{k}", **parts))
        return Dataset(name="swings", space="T3", train=tuple(recordings))

    return simulate


@pytest.fixture(scope="session")
def driven():
    """Simulate four recordings, 6 s each, of something under smooth forces, by midpoint steps of 2 ms."""
    step, fine = 0.02, 10

    def simulate(accelerate, start, *, space, amplitude: Any = 1.0, fastest=4.0, noise=0.0, **parts):
        generator, recordings, h = np.random.default_rng(0), [], step / fine
        for k in range(4):
            ts = step * np.arange(300)
            pace = generator.uniform(0.25 * fastest, fastest, (3, len(start)))
            phase = generator.uniform(0.0, 6.0, (3, len(start)))
            us = amplitude * np.sin(pace[:, None] * ts[:, None] + phase[:, None]).sum(axis=0)
            q, v, path = np.array(start), np.zeros(len(start)), []
            for u in us:
                path.append((q, v))
                for _ in range(fine):
                    middle = v + h / 2 * accelerate(q, v, u)
                    q, v = q + h * middle, v + h * accelerate(q + h / 2 * v, middle, u)
            seen = np.array(path) + noise * generator.standard_normal((len(ts), 2, len(start)))
            recordings.append(Trajectory(name=f"run{k}", ts=ts, q=seen[:, 0], rates=seen[:, 1], us=us))
        return Dataset(name="driven", space=space, train=tuple(recordings), **parts)

    return simulate


@pytest.fixture(scope="session")
def in_strides():
    """Fit in runs of one stride, each of which resumes the one before; yields what each of at most `most` found."""

    def fit_on(dataset, *, most, **settings):
        for _ in range(most):
            part = fit(dataset, **settings, resume=True, max_minutes=1e-9)
            yield part
            if part.completed:
                return

    return fit_on


@pytest.fixture
def stage(pendulum, small, quick):
    """Levenberg-Marquardt on a pendulum, and the state that it begins with."""
    dataset = pendulum()
    model = build(small, Space.parse("T1"), 1, key=jax.random.key(0))
    data = _data.levenberg_data(dataset, model, quick)
    state = TrainingState(
        stage=0,
        step=1,
        model=model,
        memory=None,
        damping=1e-4,
        substeps=1,
        weighing=Weighing.plain(3),
        best=model,
        best_loss=1.0,
        origin=0,
        stale=0,
        incumbent=Incumbent(model, None, 0, Weighing.plain(3), rival=model),
    )
    return LevenbergStage(data, quick, "levenberg-marquardt", quick.lm_steps), state

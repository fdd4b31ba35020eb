"""Velocities that were estimated from positions, which tell no more than these do."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden import Dataset, KnownParts
from symoden.data import Trajectory, choose_spans, estimate_velocities, velocity_noise_gain
from symoden.evaluation import predict
from symoden.integrate import RK4
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.systems import Pendulum
from symoden.training import TrainingConfig
from symoden.training._data import levenberg_data
from symoden.training._flatten import Flattening
from symoden.training._gauss_newton import Linearization
from symoden.training._level import expected_level
from symoden.training._objective import measured_channels
from symoden.training._weighing import Weighing

STEP, ENCODER = 0.02, 1.5e-3
TRUTH = {"inertia": 1 / 3, "gravity": 4.905, "damping": 0.1}


def recording(seed, *, samples=400):
    """A pendulum under sines, of which a turn takes a dozen rows, by an encoder."""
    generator = np.random.default_rng(seed)
    ts = STEP * np.arange(samples)
    hertz, sizes = np.array([0.5, 2.5, 4.0]), np.array([2.0, 8.0, 30.0])
    torque = np.sin(2 * np.pi * ts[:, None] * hertz + generator.uniform(0, 6, 3)) @ sizes
    rest = np.zeros((samples, 1))
    still = Trajectory(name=f"r{seed}", ts=ts, q=rest, rates=rest, us=torque[:, None])
    (path,) = predict(Pendulum(damping=TRUTH["damping"]), [still])
    q = np.round(path.q / ENCODER) * ENCODER
    spans = choose_spans([ts], [q])
    rates = estimate_velocities(ts, q, name="r", spans=spans)
    gain = velocity_noise_gain(ts, spans)
    return dataclasses.replace(still, q=q, rates=rates, noise_gain=gain, one_sided=int(spans[0]) // 2 * STEP)


@pytest.fixture(scope="module")
def dataset():
    known = KnownParts(
        mass_matrix=[["inertia"]],
        potential_energy="-gravity*cos(q1)",
        input_matrix=[[1]],
        dissipation_matrix=[["damping"]],
        parameters=TRUTH,
    )
    return Dataset(name="pendulum", space="T1", train=tuple(map(recording, range(3))), known=known)


def untrained(dataset):
    return build(ModelConfig(), Space.parse("T1"), 1, known=dataset.known, key=jax.random.key(0))


def refined(dataset, measured):
    """What training minimises once a model is about right, and the windows."""
    data = levenberg_data(dataset, untrained(dataset), TrainingConfig())
    objective = dataclasses.replace(data.objective, measured=measured)
    restore, theta = Flattening.of(untrained(dataset), corrections=0)
    level = expected_level(restore, theta, objective, RK4(4), data.train)
    return objective.refined(RK4(4), Weighing.plain(3, level)), data.train


def missed(dataset, objective, batch):
    """By how much inertia, gravity and friction are off after some of Gauss-Newton's steps from the true ones."""
    restore, theta = Flattening.of(untrained(dataset), corrections=0)
    for _ in range(3):
        equations = Linearization.at(restore, theta, objective, batch).normal_equations()
        theta = theta - np.linalg.solve(equations.matrix, equations.gradient)
    model, q = restore(theta), jnp.array([0.5])
    found = {
        "inertia": model.mass_matrix(q),
        "gravity": jax.grad(model.potential_energy)(q) / jnp.sin(q),
        "damping": model.dissipation_matrix(q, q),
    }
    return {name: abs(float(value.ravel()[0]) / TRUTH[name] - 1) for name, value in found.items()}


def test_smoothing_does_not_bias_what_is_learned(dataset):
    measured = measured_channels(levenberg_data(dataset, untrained(dataset), TrainingConfig()).objective)
    assert measured is not None
    assert measured.tolist() == [1, 1, 0]
    objective, batch = refined(dataset, measured)
    assert objective.frees_starts
    after, before = missed(dataset, objective, batch), missed(dataset, *refined(dataset, None))
    assert after["inertia"] < 1e-3 < 1e-2 < before["inertia"]
    assert after["gravity"] < 2e-3 < 1e-2 < before["gravity"]
    assert after["damping"] < 0.03 < 0.05 < before["damping"]


@pytest.mark.parametrize("which", [slice(0, 1), slice(0, 3)])
def test_measured_rates_count(dataset, which):
    logged = [dataclasses.replace(each, noise_gain=None) for each in dataset.train]
    mixed = dataclasses.replace(dataset, train=(*logged[which], *dataset.train[which.stop :]))
    assert measured_channels(levenberg_data(mixed, untrained(mixed), TrainingConfig()).objective) is None

"""The paper's errors: against loops written out, exact on the true system, counted where a model diverges."""

import dataclasses
import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.evaluation import predict
from symoden.experiments import Source, score_task, simulate, task
from symoden.integrate import RK4, rollout
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space
from symoden.systems import Pendulum

FINE = RK4(16)
PLAIN = BlockConfig(constant=True)
SMALL = {"inverse_mass": PLAIN, "potential": BlockConfig(hidden=(4,)), "flow": (8,), "energy": (8,)}


def small(kind, space, inputs=1, *, momenta=False):
    config = ModelConfig(kind=kind, actuation=PLAIN, friction=PLAIN, knees=(), **SMALL)
    return build(config, Space.parse(space), inputs, momenta=momenta, key=jax.random.key(1))


@functools.cache
def few_simulated(name):
    return simulate(task(name), train_initials=2, test_initials=1)


def few(name, *, space=None):
    chosen, data = task(name), few_simulated(name)
    dataset = data.dataset if space is None else dataclasses.replace(data.dataset, space=space)
    return Source(name=name, dataset=dataset, task=chosen, prediction=data.prediction)


@eqx.filter_jit
def roll_out(system, q0, rates0, ts, us):
    return rollout(system, q0, rates0, ts, us, solver=RK4(4))


@pytest.mark.parametrize("name", ["pendulum-canonical", "cartpole-full"])
def test_the_true_system_has_no_error(name):
    source = few(name)
    score = score_task(task(name).system, source, solver=FINE)
    assert max(score.train.mean, score.test.mean, score.prediction.mean) < 1e-8


def test_errors_are_sums_over_samples_and_channels_and_means_over_trajectories():
    source = few("cartpole")
    model = small("dissipative", "R1 T1")
    score = score_task(model, source, solver=RK4(4))
    sums = []
    for recording in source.dataset.train:
        columns = (recording.q[0], recording.rates[0], recording.ts, recording.us)
        path = roll_out(model, *map(jnp.asarray, columns))
        x, phi = recording.q.T
        truth = np.stack([x, np.cos(phi), np.sin(phi), *recording.rates.T], axis=1)
        sums.append(np.sum((np.asarray(path.observations) - truth) ** 2))
    assert score.train.mean == pytest.approx(np.mean(sums), rel=1e-9)
    assert score.train.std == pytest.approx(np.std(sums), rel=1e-9)


def test_a_model_told_that_a_number_is_an_angle_is_scored_on_the_number():
    source = few("pendulum-canonical", space="T1")
    truth = Pendulum(gravity=10.0, damping=0.1, momenta=True)
    assert score_task(truth, source, solver=FINE).prediction.mean < 1e-6
    model = small("naive", "T1", momenta=True)
    paths = predict(model, source.prediction, hold="zero", solver=RK4(4))
    sums = [
        np.sum((path.q - recording.q) ** 2) + np.sum((path.rates - recording.rates) ** 2)
        for path, recording in zip(paths, source.prediction, strict=True)
    ]
    assert score_task(model, source, solver=RK4(4)).prediction.mean == pytest.approx(np.mean(sums), rel=1e-9)


def test_a_data_set_has_no_task_errors():
    source = Source(name="arm", dataset=few("pendulum").dataset)
    with pytest.raises(ValueError, match="those of a task"):
        score_task(Pendulum(), source, solver=RK4())


def test_a_diverging_model_has_no_finite_errors():
    model = eqx.tree_at(lambda m: m.scale.array, small("naive", "T1"), replace_fn=lambda x: 1e150 * x)
    score = score_task(model, source := few("pendulum"), solver=RK4(1))
    assert not np.isfinite(score.train.mean)
    parts = {"train": source.dataset.train, "test": source.dataset.test, "prediction": source.prediction}
    assert score.diverged == {name: len(part) for name, part in parts.items()}

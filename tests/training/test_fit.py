"""Fitting: known parameters are recovered, and what is odd but sound trains as well."""

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import CORRECTIONS, FRICTION, count_parameters
from symoden.data import DataError, Dataset, DataWarning, Trajectory
from symoden.models import KINDS, BlockConfig, ModelConfig, StructuredModel
from symoden.systems import Pendulum
from symoden.training import TrainingConfig, TrainingError, _fit, _line_up, fit
from symoden.training._late_inputs import LateInputs
from symoden.training._prepare import prepare

CONSTANT = BlockConfig(constant=True)


def finite(model):
    return all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(eqx.filter(model, eqx.is_inexact_array)))


def test_the_parameters_of_a_damped_pendulum_are_recovered(pendulum):
    truth = Pendulum(damping=0.2)
    model = ModelConfig(
        inverse_mass=CONSTANT, potential=BlockConfig(hidden=(6,)), actuation=CONSTANT, friction=CONSTANT, knees=()
    )
    config = TrainingConfig(
        validation=0.2, adam_steps=300, batch_size=64, horizon=5, lm_steps=20, lm_horizon=7, growth_steps=0
    )
    dataset = pendulum(samples=41, count=6)
    found: Any = fit(dataset, model=model, config=config).model
    q, v = jnp.array([0.4]), jnp.array([0.7])
    g = found.input_matrix(q)[0, 0]  # The gauge: only ratios to it are known.
    ratios = [found.mass_matrix(q)[0, 0] / g, found.dissipation_matrix(q, v)[0, 0] / g]
    expected = [truth.mass_matrix(q)[0, 0], truth.dissipation_matrix(q, v)[0, 0]]
    assert [float(x) for x in ratios] == pytest.approx([float(x) for x in expected], rel=0.02)
    angles = jnp.linspace(-1.5, 1.5, 9)[:, None]
    learned, true = (np.asarray(jax.vmap(jax.grad(s.potential_energy))(angles)) for s in (found, truth))
    assert learned / float(g) == pytest.approx(true, abs=0.05 * np.abs(true).max())


@pytest.mark.usefixtures("single_use_keys")
def test_the_same_seed_gives_the_same_bits_and_another_others(pendulum, small, quick):
    config = dataclasses.replace(quick, restarts=1, growth_steps=0, relevance_steps=0)
    first, again, other = (
        fit(pendulum(), model=small, config=dataclasses.replace(config, seed=seed)).model for seed in (5, 5, 6)
    )
    assert eqx.tree_equal(first, again)
    assert not eqx.tree_equal(first, other)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_model_trains(kind, pendulum, small, quick):
    model = dataclasses.replace(small, kind=kind)
    short, long = (
        fit(pendulum(), model=model, config=dataclasses.replace(quick, adam_steps=steps, lm_steps=0, validation=0.0))
        for steps in (1, 300)
    )
    assert finite(long.model)
    assert long.completed
    assert long.loss < short.loss


def test_nine_samples_a_period_are_enough():
    ts = 0.7 * np.arange(60)
    swings = [
        Trajectory(name=f"{a}", ts=ts, q=a * np.sin(ts)[:, None], rates=a * np.cos(ts)[:, None], us=np.zeros((60, 0)))
        for a in (0.5, 1.0, 1.5, 2.0)
    ]
    config = TrainingConfig(adam_steps=200, restarts=1, lm_steps=12, growth_steps=0, relevance_steps=0)
    result = fit(Dataset(name="spring", space="R1", train=tuple(swings)), config=config)
    assert result.loss < 1e-4


@pytest.mark.parametrize("change", [{"inputs": 0}, {"momenta": True}, {"count": 1}], ids=["free", "momenta", "single"])
def test_odd_recordings_train(change, pendulum, small, quick):
    result = fit(pendulum(**change), model=small, config=dataclasses.replace(quick, adam_steps=20))
    assert finite(result.model)
    assert result.model.inputs == change.get("inputs", 1)
    assert result.model.momenta == change.get("momenta", False)


def test_one_window_in_a_batch_trains(pendulum, small, quick):
    result = fit(pendulum(), model=small, config=dataclasses.replace(quick, batch_size=1, lm_steps=0, adam_steps=50))
    assert finite(result.model)
    assert math.isfinite(result.loss)


def test_a_recording_shorter_than_a_window_is_refused(pendulum, small, quick):
    with pytest.raises(DataError, match="swing0"):
        fit(pendulum(samples=6, count=1), model=small, config=dataclasses.replace(quick, horizon=20, validation=0.0))


def test_recordings_of_a_few_samples_train(pendulum, small):
    config = TrainingConfig(adam_steps=5, lm_steps=2, growth_steps=0, validation=0.0)
    assert finite(fit(pendulum(samples=4, count=2), model=small, config=config).model)


def test_a_hopeless_learning_rate_ends_with_a_clear_outcome(pendulum, small, quick):
    config = dataclasses.replace(quick, learning_rate=1e6, clip=None, cosine=False, lm_steps=0, adam_steps=600)
    with pytest.raises(TrainingError, match=r"another `--seed`; in Python another `seed` or a lower `learning_rate`"):
        fit(pendulum(), model=small, config=config)


def test_data_without_a_finite_model_is_a_training_error(small, quick):
    ts = np.linspace(0.0, 2.0, 30)
    huge = 1e30 * np.stack([np.exp(ts)], axis=1)
    trajectory = Trajectory(name="huge", ts=ts, q=huge, rates=huge, us=np.zeros((30, 0)))
    dataset = Dataset(name="huge", space="R1", train=(trajectory,))
    raw = dataclasses.replace(small, scaled=False)
    config = dataclasses.replace(quick, lm_steps=0, scaled_loss=False)
    with pytest.raises(TrainingError, match="whose errors are finite"):
        fit(dataset, model=raw, config=config)


def test_what_cannot_be_trained_is_refused_before_anything_is(pendulum, small, quick):
    with pytest.raises(ValueError, match="must have steps; `adam_steps` and `lm_steps` are both 0"):
        TrainingConfig(adam_steps=0, lm_steps=0)
    dataset = pendulum()
    with pytest.raises(DataError, match="must have recordings in `train`; got none"):
        fit(dataclasses.replace(dataset, train=(), test=dataset.train), model=small, config=quick)
    large = dataclasses.replace(small, potential=BlockConfig(hidden=(120, 120)))
    with pytest.raises(ValueError, match=r"at most 12000 numbers to learn.*the model has 1\d{4}\. .*`lm_steps=0`"):
        fit(dataset, model=large, config=quick)


def test_adam_alone_leaves_integration_as_fine_as_it_was(pendulum, small, quick):
    config = dataclasses.replace(quick, adam_steps=2, lm_steps=0, substeps=3)
    result = fit(pendulum(), model=small, config=config)
    assert (result.substeps, result.solver.substeps) == (3, 4)
    assert dataclasses.replace(result, substeps=16).solver.substeps == 16


@pytest.mark.parametrize(("keep_best", "strides"), [(True, [60]), (False, [20, 40, 60])])
def test_adam_is_heard_of_often_where_no_stride_chooses(keep_best, strides, pendulum, small):
    """The paper's networks take half a second a step."""
    heard, config = [], TrainingConfig(adam_steps=60, restarts=1, lm_steps=0, growth_steps=0, keep_best=keep_best)
    fit(pendulum(), model=small, config=config, progress=heard.append)
    assert [each.step for each in heard if each.stage.startswith("adam")] == strides


def test_a_fit_that_predicts_nothing_is_a_training_error(pendulum, small, quick, monkeypatch):
    monkeypatch.setattr(_fit, "_NOTHING", 1e-9)
    with pytest.raises(TrainingError, match="not far larger than the motion"):
        fit(pendulum(), model=small, config=dataclasses.replace(quick, adam_steps=20, lm_steps=0))


def test_a_joint_that_rests_does_not_hide_one_that_moves(pendulum, quick):
    """Weights that grew with its stillness made training diverge."""
    plain = BlockConfig(constant=True)
    spring = ModelConfig(
        inverse_mass=plain, potential=BlockConfig(hidden=(8,)), actuation=plain, friction=plain, knees=()
    )
    ts = np.arange(200) * 0.02
    recordings = []
    for k in range(4):
        q, v = np.cos(3 * ts + k), -3 * np.sin(3 * ts + k)
        rests, flickers = np.full(200, 0.4), np.where(np.arange(200) % 90 == 0, 1e-4, 0.0)
        positions, rates = np.stack([q, rests], axis=1), np.stack([v, flickers], axis=1)
        recordings.append(Trajectory(name=f"{k}", ts=ts, q=positions, rates=rates, us=np.zeros((200, 0))))
    config = dataclasses.replace(
        quick, restarts=1, horizon=5, lm_steps=8, lm_horizon=20, growth_steps=0, relevance_steps=0
    )
    found = fit(Dataset(name="d", space="R2", train=tuple(recordings)), model=spring, config=config).model
    assert isinstance(found, StructuredModel)
    q = jnp.array([0.5, 0.4])
    force = -jax.grad(found.potential_energy)(q)
    np.testing.assert_allclose((found.inverse_mass_matrix(q) @ force)[0], -4.5, rtol=0.05)


def test_windows_are_cut_from_what_is_long_enough(pendulum, small, quick):
    dataset = pendulum(samples=60)
    short = dataclasses.replace(pendulum(samples=5, count=1, seed=1).train[0], name="short")
    config = dataclasses.replace(quick, adam_steps=20, lm_steps=1, growth_steps=0, relevance_steps=0, validation=0.0)
    with pytest.warns(DataWarning, match="`short`.*shorter than a window of 6 samples"):
        beside = fit(dataclasses.replace(dataset, train=(*dataset.train, short)), model=small, config=config)
    assert np.isfinite(beside.loss)


def test_the_global_precision_is_left_alone_and_followed(pendulum, small, quick):
    dataset = pendulum()
    config = dataclasses.replace(quick, adam_steps=20)
    with jax.enable_x64(False):
        result = fit(dataset, model=small, config=config)
        assert jnp.zeros(()).dtype == jnp.float32
    assert jnp.zeros(()).dtype == jnp.float64
    leaves = jax.tree.leaves(eqx.filter(result.model, eqx.is_inexact_array))
    assert {leaf.dtype for leaf in leaves} == {np.dtype(np.float32)}
    double = fit(dataset, model=small, config=config)
    for single, other in zip(leaves, jax.tree.leaves(eqx.filter(double.model, eqx.is_inexact_array)), strict=True):
        assert other.dtype == jnp.float64
        assert np.array_equal(single, other.astype(np.float32))


def test_validation_windows_are_no_training_windows(pendulum, small, quick):
    for count in (2, 12):
        stages, _ = prepare(pendulum(count=count), small, quick)[:2]
        stage: Any
        for stage in stages:
            if isinstance(stage, LateInputs):
                continue
            if stage.data.validation is None:  # Too short for a bump.
                assert stage.name.startswith("regression")
                continue
            rows = [
                {tuple(row) for row in np.concatenate([part.q, part.rates], axis=-1).reshape(-1, 2).tolist()}
                for part in (stage.data.train, stage.data.validation)
            ]
            assert rows[0].isdisjoint(rows[1])


def test_networks_of_too_many_numbers_stay_closed_and_priors_of_too_many_as_they_are(
    pendulum, small, quick, monkeypatch
):
    model = prepare(pendulum(), small, quick)[1].model
    few, all_of_them = (count_parameters(model, corrections=kinds) for kinds in (FRICTION, CORRECTIONS))

    def names(most):
        monkeypatch.setattr(_line_up, "MOST_PARAMETERS", most)
        names = [stage.name for stage in prepare(pendulum(), small, quick)[0][3:]]
        return [name for name in names if "regression" not in name]

    assert few < all_of_them
    first, priors = ["levenberg-marquardt", "late inputs"], ["relevance", "whitened errors", "refit"]
    assert names(all_of_them) == [*first, *priors, "growth"]
    assert names(all_of_them - 1) == names(few) == [*first, *priors]
    assert names(few - 1) == first


def test_of_long_logs_windows_that_are_spaced_evenly_are_predicted(pendulum, small, quick):
    def windows(most):
        config = dataclasses.replace(quick, lm_samples=most)
        stages, _ = prepare(pendulum(samples=100, count=4), small, config)[:2]
        stage: Any = next(stage for stage in stages if stage.name == "levenberg-marquardt")
        return stage.data

    whole = windows(10_000)
    with pytest.warns(DataWarning, match="predicts 90 of the 300 training samples"):
        some = windows(90)
    for few, many in ((some.train, whole.train), (some.validation, whole.validation)):
        kept = [int(np.flatnonzero((many.q == q[None]).all(axis=(1, 2)))[0]) for q in few.q]
        assert len(kept) == min(15, len(many.q))
        assert (kept[0], kept[-1]) == (0, len(many.q) - 1)
        assert np.ptp(np.diff(kept)) <= 1
    with pytest.warns(DataWarning, match="predicts 6 of the 300"):
        assert windows(1).validation.ts.shape == (1, 6)

"""Where few windows validate, models of few numbers are judged by windows that are left out in turn."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import Dataset, Trajectory
from symoden.known import KnownParts
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space
from symoden.training import TrainingConfig, fit
from symoden.training._data import hold_out, levenberg_data, longer_data
from symoden.training._flatten import Flattening
from symoden.training._left_out import Contender, _folds, by_left_out
from symoden.training._levenberg_marquardt import levenberg_marquardt_step
from symoden.training._objective import Batch
from symoden.training._prepare import prepare
from symoden.training._residuals import evaluate_loss
from symoden.training._stopwatch import Stopwatch
from symoden.training._verdicts import CHANCE, CLEAR, Judge

CONSTANT = BlockConfig(constant=True)
MODEL = ModelConfig(inverse_mass=CONSTANT, potential=CONSTANT, actuation=CONSTANT, friction=CONSTANT, knees=(0.01,))
CONFIG = TrainingConfig(validation=0.1, adam_steps=0, lm_substeps=2, relevance_steps=0)
WEIGHT, VISCOUS, DRY = 9.0, 0.1, 0.5
EQUATIONS = KnownParts(
    mass_matrix=[[1.0]], potential_energy="-w*cos(q1)", input_matrix=[[1.0]], parameters={"w": 0.8 * WEIGHT}
)


@pytest.fixture(scope="module")
def resting():
    """A pendulum with dry friction that is pushed, swings and comes to rest, seen through noise."""
    generator, step, fine = np.random.default_rng(0), 0.02, 20
    ts = step * np.arange(200)
    us = np.where(ts < 0.4, 12.0, 0.0)
    q, v, path = 0.0, 0.0, []
    for u in us:
        path.append((q, v))
        for _ in range(fine):
            v += step / fine * (u - WEIGHT * np.sin(q) - VISCOUS * v - DRY * np.tanh(v / 0.02))
            q += step / fine * v
    seen = np.array(path) + [1e-3, 1e-2] * generator.standard_normal((len(ts), 2))
    swing = Trajectory(name="swing", ts=ts, q=seen[:, :1], rates=seen[:, 1:], us=us[:, None])
    return Dataset(name="rest", space="T1", train=(swing,), known=EQUATIONS)


@pytest.fixture(scope="module")
def prepared(resting):
    """Its windows, the model and the stages."""
    held = hold_out(resting, CONFIG)
    stages: list[Any]
    stages, state = prepare(resting, MODEL, CONFIG)[:2]
    return held, state.model, stages


@pytest.fixture(scope="module")
def whole(resting):
    """What an uninterrupted training finds."""
    return fit(resting, model=MODEL, config=CONFIG)


@given(count=st.integers(2, 60))
def test_every_window_is_left_out_once_and_as_many_are_fitted_as_before(count):
    ts = jnp.arange(count, dtype=float)[:, None]
    batch = Batch(ts=ts, q=ts[..., None], rates=ts[..., None], us=ts[..., None], start=jnp.zeros((count, 2)))
    folds = list(_folds(batch))
    assert np.concatenate([left_out.ts[:, 0] for _, left_out in folds]).tolist() == ts[:, 0].tolist()
    for fitted, left_out in folds:
        others = set(range(count)) - set(left_out.ts[:, 0].tolist())
        assert set(fitted.ts[:, 0].tolist()) == others
        assert fitted.ts.shape == ts.shape


def test_dry_friction_is_found_though_the_windows_of_validation_rest(whole):
    assert whole.verdicts["friction"].startswith("kept (a loss of ")
    assert "windows left out in turn" in whole.verdicts["friction"]
    found: Any = whole.model
    for speed in (0.5, 2.0):
        q, v = jnp.zeros(1), jnp.array([speed])
        assert found.dissipation_matrix(q, v)[0, 0] * speed == pytest.approx(VISCOUS * speed + DRY, rel=0.2)


def test_steps_are_chosen_by_the_training_loss(prepared):
    _, model, stages = prepared
    (stage,) = (each for each in stages if each.name == "friction")
    state = prepare(prepared[0], MODEL, CONFIG)[1]._replace(best=model, best_loss=1.0, substeps=2)
    state = stage.start(state)
    for _ in range(3):
        state, report = stage.advance(state)
        assert state.best_loss == pytest.approx(report.loss, rel=1e-6)
        assert state.best_loss != pytest.approx(report.validation, rel=0.1)


def test_both_models_are_fitted_to_what_is_not_left_out(prepared):
    held, model, _ = prepared
    data = levenberg_data(held, model, CONFIG)
    seen = []

    def step(state, restore, batch):
        seen.append(set(np.asarray(batch.start[:, 0]).tolist()))
        return levenberg_marquardt_step(state, restore, data.objective, batch)

    contender = Contender(model, 0, step, 1, 1e-3)
    verdict = by_left_out(data, contender, contender, data.objective, wanted=1.0)
    assert (verdict.by, verdict.gained, verdict.wanted) == (Judge.LEFT_OUT, 0.0, 1.0)
    starts, count = np.asarray(data.train.start[:, 0]).tolist(), len(data.train.ts) + len(data.held_out.ts)
    parts = [set(part.tolist()) for part in np.array_split(starts, 5)]
    assert seen == [set(starts) - part for part in parts for _ in "12"]
    fold = evaluate_loss(model, data.objective, data.train)
    assert verdict.windows == count
    assert verdict.loss != pytest.approx(fold, rel=0.01)  # What was fitted is another model.


def test_the_loss_of_what_is_found_is_that_of_validation(resting, prepared):
    held, model, _ = prepared
    config = dataclasses.replace(CONFIG, growth_steps=0)
    result = fit(resting, model=MODEL, config=config)
    data = levenberg_data(held, model, config)
    expected, other = (evaluate_loss(result.model, data.objective, each) for each in (data.held_out, data.train))
    assert result.loss == pytest.approx(expected, rel=0.1)
    assert result.loss != pytest.approx(other, rel=0.5)


def test_what_left_out_windows_taught_is_forgotten(prepared):
    held, model, _ = prepared
    data = levenberg_data(held, model, CONFIG)

    def step(state, restore, batch):
        return levenberg_marquardt_step(state, restore, data.objective, batch)

    fitted, _ = next(_folds(data.train))
    restore, theta = Flattening.of(model, corrections=0)
    found = [Contender(restore(start * theta), 0, step, 30, 1e-3).refitted(fitted) for start in (0.8, 1.0, 1.2)]
    numbers = [np.asarray(Flattening.of(each, corrections=0)[1]) for each in found]
    assert np.ptp(numbers, axis=0) == pytest.approx(0, abs=1e-3 * np.abs(numbers[0]).max())


def test_it_is_for_given_energies_or_one_coordinate_and_few_windows_of_validation(resting, prepared):
    held, model, stages = prepared
    data = levenberg_data(held, model, CONFIG)
    assert data.in_turn
    assert data.choosing is data.train
    assert [stage.data.in_turn for stage in stages if stage.name == "friction"] == [True]
    networked = dataclasses.replace(MODEL, friction=BlockConfig(hidden=(3,), constant=True))
    growth: list[Any] = [stage for stage in prepare(resting, networked, CONFIG)[0] if stage.name == "growth"]
    assert [stage.data.in_turn for stage in growth] == [False]
    assert {stage.margin for stage in stages if stage.name.startswith("longer windows")} == {-CHANCE}
    free = dataclasses.replace(resting, known=None)
    assert levenberg_data(held, prepare(free, MODEL, CONFIG)[1].model, CONFIG).in_turn
    two = build(MODEL, Space.parse("T2"), 2, key=jax.random.key(0))
    assert not data._replace(in_turn=False).left_out_in_turn(two, few=100).in_turn
    assert not levenberg_data(dataclasses.replace(held, validation=()), model, CONFIG).in_turn


@pytest.mark.parametrize(("count", "in_turn"), [(5, True), (6, True), (7, False)])
def test_more_windows_judge_longer_ones_and_many_judge_all(prepared, count, in_turn):
    held, model, _ = prepared
    size = len(held.validation[0])
    starts = [k * size // 2 for k in range(count)]
    pieces = tuple(held.train[0].cut(start, start + size, name=f"piece{start}") for start in starts)
    judged = dataclasses.replace(held, validation=pieces)
    data = levenberg_data(judged, model, CONFIG)
    assert (data.held_out.ts.shape[0], data.in_turn) == (2 * count, in_turn)  # Two windows a piece.
    assert not any(each.in_turn for each in longer_data(judged, model, data, CONFIG))
    many: list[Any] = prepare(judged, MODEL, CONFIG)[0]
    assert {stage.margin for stage in many if stage.name.startswith("longer windows")} == {-CLEAR}


def test_longer_windows_may_be_few_where_few_numbers_are_learned(prepared, resting):
    held, model, _ = prepared
    data = levenberg_data(held, model, CONFIG)
    long = longer_data(held, model, data, CONFIG)
    assert long
    assert all(6 <= each.train.ts.shape[0] < 20 for each in long)
    assert all(each.in_turn for each in long)
    for samples in (20, 40, 60):  # Of thinned ones fewer than six are left.
        assert not longer_data(held, model, data, dataclasses.replace(CONFIG, lm_samples=samples))
    free = prepare(dataclasses.replace(resting, known=None), MODEL, CONFIG)[1].model
    assert longer_data(held, free, data, CONFIG)  # Of one coordinate, without energies that are given.
    assert not longer_data(held, free, data._replace(in_turn=False), CONFIG)


def test_a_verdict_that_takes_too_long_is_left_to_the_next_run(resting, whole, tmp_path, monkeypatch):
    refits = []

    def is_up(watch):
        refits.append(watch)
        return len(refits) > 3  # In the middle of the first verdict.

    monkeypatch.setattr(Stopwatch, "is_up", is_up)
    cut = fit(resting, model=MODEL, config=CONFIG, folder=tmp_path, max_minutes=100.0)
    assert not cut.completed
    assert cut.outcome.startswith("stopped at the time limit of 100 minutes")
    assert len(refits) == 4
    runs = 0
    while not cut.completed:
        cut = fit(resting, model=MODEL, config=CONFIG, folder=tmp_path, resume=True, max_minutes=100.0)
        runs += 1
    assert 1 < runs < 20  # Every run ends the verdict that the one before could not.
    assert cut.verdicts == whole.verdicts
    assert eqx.tree_equal(cut.model, whole.model)

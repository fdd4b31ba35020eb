"""Regression of the equations of motion in weak form: where it stands in training, and what it leaves to do."""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import ACTUATION, FRICTION, Correction, kinds_in_use, trainable
from symoden.integrate import RK4
from symoden.models import KINDS, BlockConfig, build
from symoden.spaces import Space
from symoden.training import TrainingConfig, _ensemble, fit
from symoden.training._adam_stage import AdamStage
from symoden.training._beginnings import Best, Untrained
from symoden.training._data import adam_data, hold_out, levenberg_data, regression_data
from symoden.training._flatten import cast
from symoden.training._levenberg_stage import LevenbergStage
from symoden.training._line_up import line_up
from symoden.training._relevance import Relevance
from symoden.training._residuals import evaluate_loss
from symoden.training._scales import measure_scales
from symoden.training._state import Incumbent, TrainingState
from symoden.training._weighing import Weighing

SHORT = TrainingConfig(validation=0.25, horizon=3, lm_horizon=10, lm_substeps=1)


@pytest.fixture(scope="module")
def turning(plain):
    """What allows inputs to act as configurations say, and dry friction."""
    return dataclasses.replace(plain, actuation=BlockConfig(hidden=(3,), constant=True), knees=(0.1,))


def regressions(dataset, model, config, *, drawn=True):
    space = Space.parse(dataset.space)
    dynamics = build(model, space, dataset.inputs, momenta=dataset.momenta, key=jax.random.key(0))
    stages = line_up(dataset, dynamics, (dynamics,) if drawn else (), config)
    return [stage.name for stage in stages if stage.name.startswith("regression")]


@pytest.mark.parametrize("kind", KINDS)
def test_three_coordinates_and_velocities_begin_with_it(kind, quick, pendulum, swings, plain):
    dataset, model = swings(), dataclasses.replace(plain, kind=kind)
    wanted = ["regression", "regression: relevance", "regression: refit"] if kind in ("dissipative", "symoden") else []
    assert regressions(dataset, model, quick) == wanted
    assert regressions(dataclasses.replace(dataset, momenta=True), model, quick) == []
    assert regressions(swings(seconds=0.06), model, quick) == []  # Too few samples in a row.
    fewer = regressions(pendulum(), model, dataclasses.replace(quick, scaled_loss=False))
    assert fewer == []  # Nor where Adam cannot tell whether it has found the basin.
    guessed = regressions(pendulum(), model, quick, drawn=False)
    assert guessed == wanted[:1]  # Without what learned priors might narrow to nothing.


def test_one_and_two_coordinates_come_back_to_it_where_adam_found_no_basin(quick, pendulum, plain):
    dataset, model = pendulum(), build(plain, Space.parse("T1"), 1, key=jax.random.key(0))
    stages = line_up(dataset, model, (model, model), quick)
    names = [stage.name for stage in stages]
    again = ["regression", "regression: inertia", "regression: relevance", "regression: refit"]
    assert names[:7] == ["adam 1 of 2", "adam 2 of 2", *again, "levenberg-marquardt"]
    lost, found, saved = (
        begun_with(model, model)._replace(best_loss=x, origin=k) for x, k in ((0.2, 1), (0.05, 1), (0.05, 2))
    )
    applies = [[stage.applies(state) for stage in stages] for state in (lost, found, saved)]
    assert [row[2:6] for row in applies] == [[True, *[False] * 3], [False] * 4, [False, *[True] * 3]]
    assert all(all(row[6:]) for row in applies)
    raw = line_up(dataset, model, (model, model), dataclasses.replace(quick, scaled_loss=False))
    assert [stage.name for stage in raw][:3] == ["adam 1 of 2", "adam 2 of 2", "levenberg-marquardt"]


def test_nothing_is_set_free_where_no_rollout_is_finite(quick, pendulum, plain):
    dataset, model = pendulum(), build(plain, Space.parse("T1"), 1, key=jax.random.key(0))
    stages = [stage for stage in line_up(dataset, model, (), quick) if isinstance(stage, LevenbergStage)]
    for loss in (1e3, math.inf):
        applies = [stage.applies(begun_with(model, model)._replace(best_loss=loss)) for stage in stages]
        assert applies == [stage.margin is None or math.isfinite(loss) for stage in stages]
    assert len(stages) > 1


@pytest.mark.parametrize("better", [True, False])
def test_a_second_way_into_a_basin_is_kept_where_rollouts_are_better(better, searching):
    dataset, config, model = searching
    astray = diverging(model)
    best, fresh = (astray, model) if better else (model, astray)
    rollouts = adam_data(dataset, model, config)
    stage = LevenbergStage(
        regression(dataset, model, config), config, "regression", 1, begins=Untrained(fresh), rollouts=rollouts
    )
    start = begun_with(best, model)._replace(stage=3, origin=1)
    assert stage.applies(start)
    state, report = stage.advance(stage.start(start))
    assert (state.step, report.finished) == (1, True)
    assert state.origin == (3 if better else 1)
    assert eqx.tree_equal(state.best, cast(best, float)) == (not better)
    assert str(report.verdict).startswith("kept (a loss of" if better else "not kept (a loss of inf over rollouts, ")


def test_inputs_that_turn_are_asked_for_once_more_from_the_untrained_model_on(searching, turning, scrambled):
    (dataset, config, _), model = searching, build(turning, Space.parse("T3"), 3, key=jax.random.key(0))
    stages = [stage for stage in line_up(dataset, model, (), config) if isinstance(stage, LevenbergStage)]
    names = [stage.name.removeprefix("regression: ") for stage in stages]
    asked = names.index("actuation anew")
    closed = ["no potential", "constant inertia"]
    assert names[:asked] == ["regression", "actuation", "friction", "directions", *closed, "relevance"]
    assert names[asked + 1] == "refit"
    stage = stages[asked]
    assert isinstance(stage.begins, Untrained)
    assert stage.begins.fresh is model
    assert (stage.corrections, stage.learns, stage.plain) == (ACTUATION, True, config.lm_steps)
    assert stage.steps == config.lm_steps + config.relevance_steps
    state = begun_with(model, model)
    assert stage.applies(state)
    assert not stage.applies(state._replace(best_loss=1e-7))
    assert not stage.applies(state._replace(best=scrambled(model, 0, 0.1)))
    assert not any(isinstance(each.begins, Untrained) for each in stages if each is not stage)
    unvalidated = dataclasses.replace(dataset, validation=())
    assert "regression: actuation anew" not in [stage.name for stage in line_up(unvalidated, model, (), config)]


def test_it_begins_anew_without_laws_of_friction_and_learns_priors_after_plain_steps(searching, scrambled, turning):
    dataset, config, _ = searching
    model = build(turning, Space.parse("T3"), 3, key=jax.random.key(0))
    rubbed = scrambled(eqx.filter(model, trainable(model, corrections=FRICTION)), 0, 0.1)
    before, data = eqx.combine(rubbed, model), regression(dataset, model, config)
    stage = LevenbergStage(
        data, config, "stage", 4, ACTUATION, margin=-1e9, learns=True, plain=2, begins=Untrained(model)
    )
    state, variances = stage.start(begun_with(before, model)), []
    assert eqx.tree_equal(state.best, cast(model, float))
    report = None
    while report is None or not report.finished:
        state, report = stage.advance(state)
        variances.append(float(state.memory.variance) > 0)
        assert kinds_in_use(state.model) == ACTUATION
    assert variances == [False, False, True, True]
    assert eqx.tree_equal(dataclasses.replace(stage, margin=1e9)._undone(state).best, cast(before, float))


def test_friction_on_the_full_state_has_none(quick, swings, plain):
    assert regressions(swings(), dataclasses.replace(plain, full_friction=True), quick) == []


def regression(dataset, model, config):
    data = regression_data(dataset, model, config)
    assert data is not None
    return data


@pytest.fixture(scope="module")
def searching(swings, plain):
    dataset = hold_out(swings(count=8), SHORT)
    model = build(plain, Space.parse("T3"), 3, key=jax.random.key(0))
    return dataset, SHORT, model


@pytest.mark.parametrize(("yields", "loss", "skipped"), [(True, 0.05, True), (True, 0.2, False), (False, 0.05, False)])
def test_adam_looks_for_a_basin_only_where_none_is_found(yields, loss, skipped, searching, monkeypatch):
    dataset, config, model = searching
    data = regression(dataset, model, config)
    stage = AdamStage(data, config, "adam", 1, model, yields=yields)
    monkeypatch.setattr("symoden.training._adam_stage.evaluate_loss", lambda *_: loss)
    before = begun_with(model, model)._replace(memory=Relevance.start(model, 3.0))
    with jax.numpy_dtype_promotion("standard"):
        state, report = stage.advance(stage.start(before))
    assert report.finished
    assert state.step == (0 if skipped else 1)
    assert isinstance(state.memory, Relevance) == skipped
    assert (report.outcome == "found already") == skipped


def diverging(model):
    """A model of which nothing is a number."""
    return jax.tree.map(lambda x: x * jnp.nan if eqx.is_inexact_array(x) else x, model)


def corrections_of(model):
    """What corrects its blocks."""
    nodes = jax.tree.leaves(model, is_leaf=lambda node: isinstance(node, Correction))
    return [node for node in nodes if isinstance(node, Correction)]


def begun_with(best, model):
    """State of training with a best model."""
    weighing = Weighing.plain(9)
    incumbent = Incumbent(model, None, 0, weighing, rival=model)
    return TrainingState(0, 0, model, None, 1e-4, 1, weighing, best, 1.0, 0, 0, incumbent)


def test_what_the_regression_set_free_stays_free_and_is_not_asked_again(searching, scrambled, plain):
    dataset, config, _ = searching
    model = build(dataclasses.replace(plain, knees=(0.1,)), Space.parse("T3"), 3, key=jax.random.key(0))
    data, freed = levenberg_data(dataset, model, config), scrambled(model, 0, 0.1)
    for best, frees, corrections in ((model, False, 0), (freed, False, 0), (model, True, 1), (freed, True, 1)):
        stage = LevenbergStage(data, config, "stage", 1, corrections, frees=frees)
        state, report = stage.advance(stage.start(begun_with(best, model)))
        assert (report.outcome == "free already") == (frees and best is freed)
        assert state.step == (0 if frees and best is freed else 1)
        still = eqx.tree_equal(corrections_of(state.model), corrections_of(best))
        assert still == (state.step == 0 or (best is model and not corrections))
    asked = [stage for stage in line_up(dataset, model, (), config) if stage.name.endswith("friction")]
    assert [isinstance(stage, LevenbergStage) and stage.frees for stage in asked] == [True, True]


def test_rollouts_begin_with_a_guess_that_is_better(searching):
    dataset, config, model = searching
    data = levenberg_data(dataset, model, config)
    astray = diverging(model)
    for best, guess in ((astray, model), (model, astray)):
        state = LevenbergStage(data, config, "stage", 1, begins=Best(guess)).start(begun_with(best, model))
        assert eqx.tree_equal(state.best, cast(model, float))
    assert LevenbergStage(data, config, "stage", 1).start(begun_with(astray, model)).best_loss == np.inf
    for candidates, guess in (((), model), ((model,), None)):
        first = next(s for s in line_up(dataset, model, candidates, config) if s.name == "levenberg-marquardt")
        assert isinstance(first, LevenbergStage)
        assert isinstance(first.begins, Best)
        assert first.begins.guess is guess


def test_a_model_that_diverges_gives_way(searching):
    dataset, config, model = searching
    data = adam_data(dataset, model, config)
    stage = AdamStage(data, config, "adam", 2, model, yields=True)
    before = begun_with(diverging(model), model)._replace(memory=Relevance.start(model, 3.0))
    with jax.numpy_dtype_promotion("standard"):
        state, report = stage.advance(stage.start(before))
    assert state.step == 2
    assert state.best_loss == report.validation


def test_where_time_ends_before_rollouts_the_loss_is_that_of_rollouts(searching, plain):
    dataset, config, _ = searching
    longer = dataclasses.replace(config, lm_substeps=None, growth_steps=0, relevance_steps=0, adam_steps=0)
    found = fit(dataset, model=plain, config=longer, max_minutes=1e-6)
    assert not found.completed
    data = levenberg_data(hold_out(dataset, longer), found.model, longer)
    objective = data.objective.refined(RK4(found.substeps), Weighing.plain(9))
    assert data.validation is not None
    loss = evaluate_loss(cast(found.model, float), objective, data.validation)
    assert found.loss == pytest.approx(loss, rel=1e-4)


@pytest.mark.slow
def test_three_links_are_found_from_random_weights(swings, plain):
    config = TrainingConfig(validation=0.2)
    dataset = hold_out(swings(seconds=4.0, count=10), config)
    scales = measure_scales(dataset.train, Space.parse("T3"), momenta=False)
    model = build(plain, Space.parse("T3"), 3, scales=scales, input_matrix=np.eye(3), key=jax.random.key(0))
    stage = LevenbergStage(regression(dataset, model, config), config, "regression", 15)
    state = stage.start(begun_with(model, model))
    assert state.best_loss > 1.0
    for _ in range(15):
        state, _ = stage.advance(state)
    assert state.best_loss < 0.01


def test_a_run_that_begins_with_it_and_is_stopped_after_every_stride_gives_the_same_bits(
    tmp_path, swings, plain, in_strides
):
    model = dataclasses.replace(plain, inverse_mass=BlockConfig(constant=True), knees=(0.1,))
    config = dataclasses.replace(
        SHORT, restarts=2, adam_steps=1, batch_size=4, lm_steps=2, growth_steps=1, relevance_steps=1
    )
    dataset = swings(seconds=0.5, count=8)
    whole = fit(dataset, model=model, config=config, folder=tmp_path / "whole")
    stages = []
    *_, part = in_strides(
        dataset,
        most=20,
        model=model,
        config=config,
        folder=tmp_path / "parts",
        progress=lambda now: stages.append(now.stage),
    )
    names = ("friction", "directions", "no potential", "relevance", "refit")
    order = ["regression", *(f"regression: {name}" for name in names)]
    assert list(dict.fromkeys(stages))[:7] == [*order, "levenberg-marquardt"]
    assert part.completed
    assert eqx.tree_equal(part.model, whole.model)


def test_members_begin_with_it_too(monkeypatch, swings, plain):
    begun = []
    real = _ensemble._Member._sought

    def sought(self, fresh):
        for loss, model in real(self, fresh):
            begun.append((self.number, loss))
            yield loss, model

    monkeypatch.setattr(_ensemble._Member, "_sought", sought)
    config = dataclasses.replace(
        SHORT, restarts=1, adam_steps=1, batch_size=4, lm_steps=3, growth_steps=0, relevance_steps=0
    )
    seen = []
    fit(swings(count=8), model=plain, config=config, members=2, progress=seen.append)
    strides = [number for number, _ in begun]
    assert [strides.count(number) for number in dict.fromkeys(strides)][:2] == [4, 4]  # Three steps, then Adam's one.
    assert sum(each.stage == "model 1 of 2" and not each.step for each in seen) >= 4

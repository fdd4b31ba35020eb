"""Networks of few recordings are judged by recordings that they were not fitted to."""

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import numpy as np
import pytest

from symoden.data import Dataset, Trajectory, halves
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.training import _levenberg_stage, fit
from symoden.training._beginnings import Best, Joined, Refitted
from symoden.training._config import TrainingConfig
from symoden.training._data import across_recordings, hold_out, levenberg_data
from symoden.training._flatten import cast
from symoden.training._gauss_newton import NormalEquations
from symoden.training._levenberg_marquardt import LevenbergStep
from symoden.training._levenberg_stage import LevenbergStage
from symoden.training._line_up import line_up
from symoden.training._prepare import prepare
from symoden.training._residuals import evaluate_loss
from symoden.training._verdicts import Judge, Verdict

CONFIG = TrainingConfig(adam_steps=1, lm_horizon=6, lm_steps=1, relevance_steps=1, growth_steps=1)


def swing(k, samples=120):
    ts = 0.05 * np.arange(samples)
    q = (1 + 0.1 * k) * np.cos(ts + k)[:, None]
    return Trajectory(name=f"run{k}", ts=ts, q=q, rates=np.gradient(q, ts, axis=0), us=np.zeros((samples, 0)))


def recorded(count, **parts):
    return hold_out(Dataset(name="runs", space="T1", train=tuple(map(swing, range(count))), **parts), CONFIG)


def apart(dataset):
    model = build(ModelConfig(), Space.parse("T1"), 0, key=jax.random.key(0))
    data = levenberg_data(dataset, model, CONFIG)
    return model, data, across_recordings(dataset, model, data, CONFIG)


@pytest.mark.parametrize("count", [2, 5])
def test_half_of_the_recordings_judge_what_the_rest_was_fitted_to(count):
    dataset = recorded(count)
    _, data, parted = apart(dataset)
    assert parted is not None
    assert parted.validation is not None
    sources = [{float(abs(each.q[0, 0])) for each in part} for part in halves(dataset.train)]
    for batch, own, other in zip((parted.train, parted.validation), sources, sources[::-1], strict=True):
        firsts = {float(abs(q)) for q in np.asarray(batch.q)[:, 0, 0]}
        assert own <= firsts
        assert not other & firsts
    assert len(parted.train.ts) + len(parted.validation.ts) == len(data.train.ts)
    assert parted.objective is data.objective


def test_it_is_not_asked_of_one_recording_nor_of_few_windows_nor_where_others_judge_already():
    assert apart(recorded(1))[2] is None
    assert apart(recorded(3, validation=(swing(9),)))[2] is None
    assert apart(recorded(12))[2] is None  # Of so many, whole recordings are held out.
    for samples, enough in ((30, False), (31, True)):  # Four windows, or five.
        dataset = hold_out(Dataset(name="runs", space="T1", train=(swing(0), swing(1, samples))), CONFIG)
        assert (apart(dataset)[2] is not None) == enough


@pytest.mark.parametrize("count", [1, 4])
def test_what_networks_learned_is_fitted_to_all_recordings_then(count):
    dataset = recorded(count)
    model, data, parted = apart(dataset)
    stages = [each for each in line_up(dataset, model, [model], CONFIG) if isinstance(each, LevenbergStage)]
    names = [each.name for each in stages]
    if parted is None:
        assert names[-1] == "growth"
        assert not any(each.data.parted for each in stages)
        return
    assert names[-3:] == ["refit on half", "growth", "growth on all"]
    roles = [(each.data.parted, each.rivals, type(each.begins)) for each in stages[-3:]]
    assert roles == [(True, True, Best), (True, False, Refitted), (False, False, Joined)]
    assert stages[-3].data is stages[-2].data
    assert len(stages[-2].data.train.ts) == len(parted.train.ts)
    assert len(stages[-1].data.train.ts) == len(data.train.ts)
    everything = line_up(dataset, model, [model], CONFIG)
    assert everything[stages[-1].after] is not everything[-1]
    assert everything[stages[-1].after].name == "growth"  # Not where these were refused.


@pytest.fixture
def rivalry(pendulum, small, quick, monkeypatch):
    """What networks must improve on, fitted; the stage of that and of networks, and the state before and after it."""
    monkeypatch.setattr(_levenberg_stage, "EXPLAINED", 0.0)
    stages, before = prepare(pendulum(count=6), small, dataclasses.replace(quick, growth_steps=3))[:2]
    rival: Any = stages[-3]
    before = before._replace(best_loss=1.0)
    state, report = rival.start(before), None
    while report is None or not report.finished:
        state, report = rival.advance(state)
    assert not report.verdict
    return rival, stages[-2], before, state


def test_networks_must_improve_on_what_the_rest_becomes_by_the_same_recordings(rivalry, monkeypatch):
    rival, growth, before, state = rivalry
    best = cast(before.best, float)
    assert eqx.tree_equal(state.best, best)
    assert state.origin == before.origin
    assert eqx.tree_equal(state.incumbent.rival, state.model)
    fitted = [evaluate_loss(model, rival.data.objective, rival.data.train) for model in (state.model, best)]
    assert fitted[0] < fitted[1]
    monkeypatch.setattr(_levenberg_stage, "FOUND", math.inf)
    begun = growth.start(state)
    assert eqx.tree_equal(begun.best, state.model)
    assert eqx.tree_equal(begun.incumbent.model, best)
    after, _ = growth.advance(begun)
    assert after.step == 1
    compared = []

    def lost(_, model, other, *__, **___):
        compared.extend((model, other))
        return Verdict(Judge.VALIDATION, 9.0, 1.0, 20, gained=-9.0, wanted=1.64)

    monkeypatch.setattr(_levenberg_stage, "by_validation", lost)
    undone, verdict = growth._concluded(after._replace(best=after.model))
    assert eqx.tree_equal(tuple(compared), (after.model, state.model))
    assert not verdict.kept
    assert eqx.tree_equal(undone.best, best)


def test_networks_are_not_asked_for_where_half_of_the_recordings_tell_nothing_of_the_others(rivalry, monkeypatch):
    _, growth, before, state = rivalry
    begun = growth.start(state)
    for bound, skipped in ((begun.best_loss * 1.01, False), (begun.best_loss * 0.99, True)):
        monkeypatch.setattr(_levenberg_stage, "FOUND", bound)
        after, report = growth.advance(begun)
        assert (report.outcome.startswith("what half of the recordings taught does not predict")) == skipped
        assert (after.step == 0) == skipped
        if skipped:
            assert eqx.tree_equal(after.best, cast(before.best, float))


def test_the_loss_is_that_of_validation_whoever_judged_networks(pendulum, small, quick, monkeypatch):
    monkeypatch.setattr(_levenberg_stage, "EXPLAINED", 0.0)  # Else nothing is left to explain.
    config = dataclasses.replace(quick, growth_steps=1)
    dataset = pendulum(count=6)
    result = fit(dataset, model=small, config=config)
    assert "not kept" in result.verdicts["growth"]
    last: Any = prepare(dataset, small, config)[0][-1]
    parted: Any = prepare(dataset, small, config)[0][-2]
    losses = [each._loss(result.model, result.substeps, each.data.choosing) for each in (last, parted)]
    assert result.loss == pytest.approx(losses[0], rel=1e-3)
    assert result.loss != pytest.approx(losses[1], rel=1e-3)


def test_all_that_networks_made_is_judged_against_what_was_before_halves(rivalry, monkeypatch, quick):
    rival, growth, before, state = rivalry
    monkeypatch.setattr(_levenberg_stage, "FOUND", math.inf)
    begun, best = growth.start(state), cast(before.best, float)
    assert eqx.tree_equal(growth.settled(begun)[0].best, best)  # At a time limit.
    after, _ = growth.advance(begun)
    assert eqx.tree_equal(growth.settled(after)[0].best, best)
    after = after._replace(best=after.model)
    on_all = LevenbergStage(rival.data, quick, "growth on all", 2, margin=-1.0, begins=Joined())
    joined = on_all.start(after)
    assert eqx.tree_equal((joined.best, joined.incumbent.model, joined.incumbent.rival), (after.best, best, best))
    assert joined.incumbent.origin == before.origin
    assert eqx.tree_equal(on_all.settled(joined)[0].best, best)
    assert eqx.tree_equal(on_all._undone(joined).best, best)


@pytest.mark.parametrize(("judged", "goes_on"), [(0.5, True), (2.9, True), (3.1, False), (np.inf, False)])
def test_steps_that_fit_better_are_no_reason_to_go_on_once_validation_is_lost(judged, goes_on):
    dataset = recorded(2)
    _, data, _ = apart(dataset)
    stage = LevenbergStage(data, CONFIG, "growth", 5, frees=True)
    equations = NormalEquations(*np.zeros((2, 1, 1)), residuals=np.ones((1, 1, 1)), scores=np.zeros((1, 1)))
    step = LevenbergStep(1.0, 0.5, accepted=True, equations=equations)
    assert stage.gains(step, judged, 1.0) == goes_on
    assert dataclasses.replace(stage, frees=False).gains(step, judged, 1.0) == (judged < 1)
    assert stage.gains(step, np.inf, np.inf)  # Nothing was found yet.

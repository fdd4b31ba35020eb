"""Networks of few recordings are judged by recordings that they were not fitted to."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from symoden.data import Dataset, Trajectory
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.training._config import TrainingConfig
from symoden.training._data import across_recordings, hold_out, levenberg_data
from symoden.training._gauss_newton import NormalEquations
from symoden.training._levenberg_marquardt import LevenbergStep
from symoden.training._levenberg_stage import LevenbergStage
from symoden.training._line_up import line_up

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
def test_every_other_recording_judges_what_the_rest_was_fitted_to(count):
    dataset = recorded(count)
    _, data, halves = apart(dataset)
    assert halves is not None
    assert halves.validation is not None
    sources = [{float(abs(each.q[0, 0])) for each in part} for part in (dataset.train[::2], dataset.train[1::2])]
    for batch, own, other in zip((halves.train, halves.validation), sources, sources[::-1], strict=True):
        firsts = {float(abs(q)) for q in np.asarray(batch.q)[:, 0, 0]}
        assert own <= firsts
        assert not other & firsts
    assert len(halves.train.ts) + len(halves.validation.ts) == len(data.train.ts)
    assert halves.objective is data.objective


def test_it_is_not_asked_of_one_recording_nor_where_others_judge_already():
    assert apart(recorded(1))[2] is None
    assert apart(recorded(3, validation=(swing(9),)))[2] is None
    assert apart(recorded(12))[2] is None  # Of so many, whole recordings are held out.


@pytest.mark.parametrize("count", [1, 4])
def test_what_networks_learned_is_fitted_to_all_recordings_then(count):
    dataset = recorded(count)
    model, data, halves = apart(dataset)
    stages = [each for each in line_up(dataset, model, [model], CONFIG) if isinstance(each, LevenbergStage)]
    names = [each.name for each in stages]
    if halves is None:
        assert names[-1] == "growth"
        return
    assert names[-2:] == ["growth", "growth on all"]
    assert len(stages[-2].data.train.ts) == len(halves.train.ts)
    assert len(stages[-1].data.train.ts) == len(data.train.ts)
    everything = line_up(dataset, model, [model], CONFIG)
    assert everything[stages[-1].after] is not everything[-1]
    assert everything[stages[-1].after].name == "growth"  # Not where these were refused.


@pytest.mark.parametrize(("judged", "goes_on"), [(0.5, True), (2.9, True), (3.1, False), (np.inf, False)])
def test_steps_that_fit_better_are_no_reason_to_go_on_once_validation_is_lost(judged, goes_on):
    dataset = recorded(2)
    _, data, _ = apart(dataset)
    stage = LevenbergStage(data, CONFIG, "growth", 5, frees=True)
    equations = NormalEquations(*np.zeros((2, 1, 1)), residuals=np.ones((1, 1, 1)), spread=np.zeros((1, 1)))
    step = LevenbergStep(1.0, 0.5, accepted=True, equations=equations)
    assert stage.gains(step, judged, 1.0) == goes_on
    assert replace(stage, frees=False).gains(step, judged, 1.0) == (judged < 1)
    assert stage.gains(step, np.inf, np.inf)  # Nothing was found yet.

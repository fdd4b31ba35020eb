"""Errors are weighed by what is new in them where models predict better by it, and nowhere else."""

import dataclasses

import equinox as eqx
import numpy as np
import pytest

from symoden import KnownParts, Trajectory, fit
from symoden.blocks import FRICTION
from symoden.data import Dataset, DataWarning
from symoden.training import TrainingConfig, _data, _levenberg_stage
from symoden.training._beginnings import Again
from symoden.training._flatten import cast
from symoden.training._verdicts import Judge, Skipped, Verdict
from symoden.training._weighing import Errors


def test_errors_are_weighed_by_what_is_new_in_them_where_a_stage_says_so(stage, pendulum, quick, monkeypatch):
    stage, state = stage
    stage = dataclasses.replace(stage, data=_data.levenberg_data(pendulum(count=8), state.model, quick))

    def whitened(errors, weighing=state.weighing):
        started = dataclasses.replace(stage, errors=errors).start(state._replace(weighing=weighing)).weighing
        assert started.is_whitened != np.array_equal(started.whitening.scale, np.eye(3))
        assert started.refused == weighing.refused
        return started.is_whitened

    assert [whitened(each) for each in Errors] == [False, True, True]
    assert [whitened(each, state.weighing.refusing()) for each in Errors] == [False, True, False]
    monkeypatch.setattr(_levenberg_stage, "EXPLAINED", 1e9)  # As where a model is exact, and errors are rounding.
    assert [whitened(each) for each in Errors] == [False, False, False]


@pytest.mark.parametrize("gained", [-0.9, -1.1])
def test_what_judges_whitened_errors_counts_them_as_they_are_and_is_remembered(
    stage, pendulum, quick, monkeypatch, gained
):
    stage, state = stage
    data = _data.levenberg_data(pendulum(count=8), state.model, quick)
    stage = dataclasses.replace(stage, data=data._replace(validation=data.train), errors=Errors.WHITENED, margin=-1.0)
    seen = []

    def judge(data, model, before, objective, *, last, wanted):
        seen.append(objective.whitening)
        return Verdict(Judge.VALIDATION, 1.0, 1.0, len(data.validation.ts), gained, wanted)

    monkeypatch.setattr(_levenberg_stage, "by_validation", judge)
    after, verdict = stage.settled(stage.start(state)._replace(step=1))
    assert verdict.kept == (gained > -1)
    assert not np.any(seen[0].lags)
    assert after.weighing.is_whitened == verdict.kept
    assert after.weighing.refused != verdict.kept
    unstepped, _ = stage.settled(stage.start(state))
    assert not unstepped.weighing.refused


def test_errors_that_are_the_sensors_are_not_whitened(stage, pendulum, quick, monkeypatch):
    stage, state = stage
    stage = dataclasses.replace(stage, data=_data.levenberg_data(pendulum(count=8), state.model, quick))
    monkeypatch.setattr(_levenberg_stage, "weigh", lambda *where: where[-1])
    stage = dataclasses.replace(stage, errors=Errors.WHITENED)
    after, report = stage.advance(stage.start(state))
    assert (after.step, report.outcome) == (0, "errors are independent, or too few")
    assert isinstance(report.verdict, Skipped)


def late_pendulum(lag):
    """A pendulum with damping whose motor follows its steps by a lag, seen at 25 Hz."""
    generator = np.random.default_rng(0)
    us = np.repeat(generator.uniform(-3.0, 3.0, 20), 20)
    states, fine = [np.zeros(3)], 0.04 / 20
    for u in us:
        q, v, x = states[-1]
        for _ in range(20):
            x = x + fine * (u - x) / lag
            v = v + fine * (x - 5.0 * np.sin(q) - 0.3 * v)
            q = q + fine * v
        states.append(np.array([q, v, x]))
    q, v, _ = np.array(states[:-1]).T
    noise = 1e-4 * generator.normal(size=q.shape)
    ts = 0.04 * np.arange(len(us))
    return Trajectory(name="late", ts=ts, q=(q + noise)[:, None], rates=v[:, None], us=us[:, None])


def test_what_a_model_lacks_is_not_taken_for_noise():
    """A lag makes errors alike that no parameter explains; whitened ones would tell gravity and gain wrongly."""
    known = KnownParts(
        mass_matrix=[["1"]],
        potential_energy="-k*cos(q1)",
        input_matrix=[["b"]],
        parameters={"k": 3.0, "b": 2.0},
    )
    dataset = Dataset(name="late", space="T1", train=(late_pendulum(0.12),), known=known)
    with pytest.warns(DataWarning, match=r"inputs seem to act late.* with a lag"):
        result = fit(dataset, config=TrainingConfig(seed=0))
    assert result.verdicts["whitened errors"].startswith("not kept")


def test_they_begin_with_what_ordinary_ones_began_with(stage, scrambled):
    stage, state = stage
    before, after = state.best, scrambled(state.best, 0, 0.1)
    began = stage.start(state).incumbent
    learned = began.memory.narrowed(after, 0, FRICTION)
    state = state._replace(best=after, incumbent=began._replace(model=before), memory=learned)
    again = dataclasses.replace(stage, errors=Errors.WHITENED, margin=-1.0, begins=Again()).start(state)
    assert eqx.tree_equal(again.model, cast(before, float))
    assert eqx.tree_equal(again.incumbent.rival, cast(after, float))
    assert eqx.tree_equal(again.memory.precision, began.memory.precision)
    assert eqx.tree_equal(again.incumbent.memory.precision, learned.precision)

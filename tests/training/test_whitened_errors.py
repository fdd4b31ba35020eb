"""Errors are weighed by what is new in them where models predict better by it, and nowhere else."""

import dataclasses

import numpy as np

from symoden import KnownParts, Trajectory, fit
from symoden.data import Dataset
from symoden.training import TrainingConfig, _data, _levenberg_stage
from symoden.training._verdicts import Judge, Skipped, Verdict
from symoden.training._weighing import Errors


def test_errors_are_weighed_by_what_is_new_in_them_where_a_stage_says_so(stage, pendulum, quick, monkeypatch):
    stage, state = stage
    stage = dataclasses.replace(stage, data=_data.levenberg_data(pendulum(count=8), state.model, quick))

    def whitened(errors, weighing=state.weighing):
        started = dataclasses.replace(stage, errors=errors).start(state._replace(weighing=weighing))
        assert started.weighing.is_whitened != np.array_equal(started.weighing.whitening.scale, np.eye(3))
        return started.weighing.is_whitened

    white = dataclasses.replace(stage, errors=Errors.WHITENED).start(state).weighing
    assert [whitened(each) for each in Errors] == [False, True, False]
    assert [whitened(each, white) for each in Errors] == [False, True, True]
    monkeypatch.setattr(_levenberg_stage, "EXPLAINED", 1e9)  # As where a model is exact, and errors are rounding.
    assert [whitened(each, white) for each in Errors] == [False, False, False]


def test_what_judges_errors_that_are_whitened_counts_them_as_they_are(stage, pendulum, quick, monkeypatch):
    stage, state = stage
    data = _data.levenberg_data(pendulum(count=8), state.model, quick)
    stage = dataclasses.replace(stage, data=data._replace(validation=data.train), errors=Errors.WHITENED, margin=0.0)
    seen = []

    def judge(data, model, before, objective, *, last, wanted):
        seen.append(objective.whitening)
        return Verdict(Judge.VALIDATION, 1.0, 1.0, len(data.validation.ts), 0.0, wanted)

    monkeypatch.setattr(_levenberg_stage, "by_validation", judge)
    after, verdict = stage.settled(stage.start(state)._replace(step=1))
    assert not verdict.kept  # Whitening must gain.
    assert not np.any(seen[0].lags)
    assert not after.weighing.is_whitened


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
    result = fit(dataset, config=TrainingConfig(seed=0))
    assert result.verdicts["whitened errors"].startswith("not kept")

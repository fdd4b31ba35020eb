"""What is said of a stage beside whether it is kept."""

import dataclasses
import math

import jax
import numpy as np
import pytest

from symoden.blocks import FRICTION
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.training import _verdicts
from symoden.training._residuals import evaluate_loss
from symoden.training._verdicts import gain


def test_friction_that_learned_priors_set_free_is_named(stage, monkeypatch):
    stage, state = stage
    model = build(ModelConfig(), Space.parse("T1"), 1, key=jax.random.key(0))  # It has laws of friction.
    state = state._replace(model=model, best=model, incumbent=state.incumbent._replace(model=model))
    data = stage.data._replace(validation=stage.data.train)
    relevance = dataclasses.replace(stage, data=data, steps=1, corrections=FRICTION, learns=True, margin=-1.0)
    monkeypatch.setattr(_verdicts, "compare", lambda *_: 0.5)
    for named in (True, False):  # The second time they are free already.
        state, report = relevance.advance(relevance.start(state))
        assert report.verdict.startswith("kept (")
        assert report.verdict.endswith("; frees friction's laws too, under learned priors)") == named


@pytest.mark.parametrize(("windows", "words"), [(1, " of 1 window"), (4, " of 4 windows"), (5, "")])
def test_verdicts_of_few_windows_say_how_many(stage, windows, words):
    stage, state = stage
    data = stage.data._replace(validation=stage.data.train.take(np.arange(windows) % len(stage.data.train.ts)))
    _, why = gain(data, state.best, 0.0, state.best, stage.objective(1, state.weighing))
    assert why.endswith(f"+0.00 standard errors{words}")


@pytest.mark.parametrize("windows", [1, 2, 4, 5])
def test_what_few_windows_lose_is_lost_whatever_standard_errors_say(stage, windows):
    stage, state = stage
    data = stage.data._replace(validation=stage.data.train.take(np.arange(windows) % len(stage.data.train.ts)))
    objective = stage.objective(1, state.weighing)
    before = float(evaluate_loss(state.best, objective, data.judged))
    for times in (2.9, 3.1):
        gained, why = gain(data, state.best, times * before, state.best, objective)
        lost = windows < 5 and times > 3
        assert gained == (-math.inf if lost else 0.0)
        assert ("3 times as much or more" in why) == lost

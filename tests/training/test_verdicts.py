"""What is said of a stage beside whether it is kept."""

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import numpy as np
import pytest

from symoden.blocks import FRICTION
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.training import _verdicts
from symoden.training._residuals import evaluate_loss
from symoden.training._state import Findings
from symoden.training._verdicts import CLEAR, Judge, Skipped, Verdict, by_windows


def test_friction_that_learned_priors_set_free_is_named(stage, monkeypatch):
    stage, state = stage
    model = build(ModelConfig(), Space.parse("T1"), 1, key=jax.random.key(0))  # It has laws of friction.
    state = state._replace(model=model, best=model, incumbent=state.incumbent._replace(model=model))
    data = stage.data._replace(validation=stage.data.train)
    relevance = dataclasses.replace(stage, data=data, steps=1, corrections=FRICTION, learns=True, margin=-1.0)
    monkeypatch.setattr(_verdicts, "standard_errors", lambda *_: 0.5)
    for named in (True, False):  # The second time they are free already.
        state, report = relevance.advance(relevance.start(state))
        assert report.verdict.kept
        assert str(report.verdict).endswith("; frees friction's laws too, under learned priors)") == named


@pytest.mark.parametrize(("windows", "words"), [(2, " of 2 windows"), (4, " of 4 windows"), (5, "")])
def test_verdicts_of_few_windows_say_how_many(windows, words):
    verdict = Verdict(Judge.VALIDATION, 0.2, 0.3, windows, gained=0.9, wanted=1.64)
    told = f"(validation loss 0.2, before 0.3: +0.90 standard errors{words}, more than +1.64 wanted)"
    assert str(verdict) == f"not kept {told}"
    assert str(verdict._replace(gained=1.7)) == f"kept {told}".replace("+0.90", "+1.70")


def test_one_window_keeps_what_must_not_lose_if_its_loss_is_no_larger():
    for loss in (0.9, 1.0, 1.1):
        verdict = by_windows(Judge.VALIDATION, np.array([loss]), np.array([1.0]), wanted=-1.0)
        assert verdict.kept == (loss <= 1)
        assert verdict._replace(windows=2).kept  # By less than a standard error.
        assert not verdict._replace(wanted=0.0).kept  # It cannot say that anything is gained.
    assert str(verdict) == "not kept (validation loss 1.1, before 1: one window, whose loss must not be larger)"
    asked = str(verdict._replace(loss=0.9, wanted=1.0))
    assert asked == "not kept (validation loss 0.9, before 1: one window, which has no standard error)"
    assert verdict._replace(loss=2.0, moved=False).kept  # The model is the one before, the loss that of another.


@pytest.mark.parametrize("windows", [2, 4, 5])
def test_what_few_windows_lose_is_lost_whatever_standard_errors_say(windows):
    for times in (2.9, 3.1):
        verdict = Verdict(Judge.VALIDATION, times, 1.0, windows, gained=0.0, wanted=-1.0)
        assert verdict.kept == (windows > 4 or times < 3)
        assert ("standard errors of" in str(verdict)) == (windows < 5)
        assert ("which hardly tell, but 3 times as much or more)" in str(verdict)) != verdict.kept


@pytest.mark.parametrize("windows", [3, 14, 60])
def test_what_loses_threefold_over_windows_left_out_in_turn_is_lost(windows):
    # Of ten windows one went astray: a loss of 3.5 for 0.096 was less than a standard error.
    for times in (2.9, 3.1):
        verdict = Verdict(Judge.LEFT_OUT, times, 1.0, windows, gained=-0.95, wanted=-1.0)
        assert verdict.kept == (times < 3)


def test_what_few_windows_refuse_is_hardly_a_verdict():
    refused = Verdict(Judge.VALIDATION, 0.2, 0.3, 2, gained=0.9, wanted=1.64)
    assert refused.hardly
    assert refused._replace(loss=1.0).hardly
    assert not refused._replace(windows=5).hardly
    assert not refused._replace(gained=1.7).hardly
    assert not refused._replace(gained=-math.inf).hardly  # Tenfold is no chance.
    assert not Skipped("free already").hardly


def test_each_verdict_says_what_judged():
    left_out = Verdict(Judge.LEFT_OUT, 0.2, 0.3, 40, gained=2.0, wanted=1.64)
    size = "+2.00 standard errors, more than +1.64 wanted"
    assert str(left_out) == f"kept (a loss of 0.2 over 40 windows left out in turn, before 0.3: {size})"
    rollouts = Verdict(Judge.ROLLOUTS, 0.2, math.inf, 3, gained=math.inf, wanted=0.0)
    assert str(rollouts) == "kept (a loss of 0.2 over rollouts, inf without)"
    assert not rollouts._replace(gained=-math.inf).hardly
    tenfold = left_out._replace(by=Judge.VALIDATION, gained=-math.inf, cut_short=True)
    assert str(tenfold) == "cut short, not kept (validation loss 0.2, before 0.3: tenfold or more)"
    assert str(Skipped("free already")) == "skipped (free already)"


def test_fewer_numbers_must_fit_the_training_windows_better_too():
    verdict = Verdict(Judge.VALIDATION, 0.2, 0.3, 9, gained=1.0, wanted=0.0, fitted=(0.5, 0.4))
    assert not verdict.kept
    assert str(verdict).endswith("; training loss 0.5, before 0.4, must fall too)")
    better = verdict._replace(fitted=(0.4, 0.5))
    assert better.kept
    assert str(better).endswith("; training loss 0.4, before 0.5)")


@pytest.mark.parametrize(("margin", "kept"), [(1.0, "not kept"), (-1.0, "kept as it was")])
@pytest.mark.parametrize("in_turn", [True, False])
def test_where_no_step_was_better_no_model_is_compared_with_itself(stage, margin, kept, in_turn):
    stage, state = stage
    data = stage.data._replace(validation=stage.data.train, in_turn=in_turn)
    config = dataclasses.replace(stage.config, scaled_loss=False)  # Else nothing was left to explain.
    worse = dataclasses.replace(stage, data=data, config=config, steps=1, corrections=1, margin=margin)
    started = worse.start(state)._replace(best_loss=0.0)  # No step is below.
    after, report = worse.advance(started)
    verdict: Any = report.verdict
    assert eqx.tree_equal(after.best, started.best)
    objective = worse.objective(after.substeps, after.weighing)
    losses = [evaluate_loss(model, objective, data.choosing) for model in (after.model, started.best)]
    assert (verdict.moved, verdict.loss, verdict.before) == (False, *losses)
    judged = "training" if in_turn else "validation"
    words = f"no step lowered the {judged} loss: {losses[1]:.2g} before, {losses[0]:.2g} at the end"
    assert str(verdict) == f"{kept} ({words})"


def test_what_hardly_any_windows_refused_is_remembered():
    refused = Verdict(Judge.VALIDATION, 0.2, 0.3, 2, gained=0.9, wanted=1.64)
    findings = Findings.none().told("potential", refused).told("refit", None).told("growth", Skipped("exact"))
    findings = findings.told("friction", refused._replace(windows=20)).told("inertia", refused)
    assert list(findings.verdicts) == ["potential", "growth", "friction", "inertia"]
    assert findings.verdicts["growth"] == "skipped (exact)"
    assert findings.hardly_judged == ("potential", "inertia")


@pytest.mark.parametrize(
    ("here", "there", "gained"),
    [
        ([math.inf] + [1.0] * 9, [math.inf] + [100.0] * 9, math.inf),  # What both lose tells nothing.
        ([math.inf, 1.0, 2.0], [math.inf, 1.0, 2.0], 0.0),
        ([math.inf, 1.0, 2.0, 3.0], [4.0, math.inf, 2.0, 3.0], 0.0),  # Each loses one.
        ([math.inf, 1.0, 1.0, 1.0], [math.inf, math.inf, 0.01, 0.01], math.inf),  # Fewer, whatever the others say.
        ([math.inf, 0.01, 0.01, 0.01], [1.0, 1.0, 1.0, 1.0], -math.inf),
    ],
)
def test_windows_that_diverge_in_both_models_are_not_what_tells_them_apart(here, there, gained):
    verdict = by_windows(Judge.VALIDATION, np.array(here), np.array(there), wanted=CLEAR)
    assert verdict.gained == pytest.approx(gained)
    turned = by_windows(Judge.VALIDATION, np.array(there), np.array(here), wanted=CLEAR)
    assert turned.gained == pytest.approx(-gained)
    assert (verdict.kept, turned.kept) == (gained > CLEAR, -gained > CLEAR)


def test_verdicts_say_what_diverges_and_count_the_windows_that_told():
    both, one = np.array([math.inf, 1.0, 1.2, 1.1]), np.array([math.inf, 0.9, 1.3, 1.2])
    verdict = by_windows(Judge.LEFT_OUT, both, one, wanted=CLEAR)
    assert (verdict.windows, verdict.loss, verdict.before) == pytest.approx((3, 1.1, 3.4 / 3))
    fewer = by_windows(Judge.LEFT_OUT, np.ones(4), both, wanted=CLEAR)
    assert str(fewer) == (
        "kept (a loss of 1 over 4 windows left out in turn, before inf: rollouts diverge in fewer windows)"
    )
    lost = by_windows(Judge.VALIDATION, np.full(2, math.inf), np.full(2, math.inf), wanted=-1.0)
    assert str(lost) == "not kept (validation loss inf, before inf: rollouts diverge in no fewer windows)"


@pytest.mark.parametrize("loss", [0.05, 0.4, math.inf])
def test_nothing_is_closed_of_what_predicts_hardly_anything(loss):
    """Of a twin rotor that was predicted by nothing, V seemed to be needed by nothing."""
    for closes in (False, True):
        verdict = Verdict(Judge.VALIDATION, loss, loss, 9, gained=0.6, wanted=-1.0, closes=closes)
        assert verdict.kept == (not closes or loss < 0.1)
        assert ("tells nothing of what it lacks" in str(verdict)) != verdict.kept

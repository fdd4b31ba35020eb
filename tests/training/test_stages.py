"""When Levenberg-Marquardt ends, and when growth is left out."""

import dataclasses
import itertools
import math
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import ACTUATION, CORRECTIONS, DIRECTIONS, FRICTION, INERTIA, NETWORKS, POTENTIAL, count_parameters
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.training import _data, _levenberg_stage, _verdicts
from symoden.training._adam_stage import DIVERGED, AdamStage
from symoden.training._beginnings import Without
from symoden.training._flatten import Flattening
from symoden.training._gauss_newton import Linearization, NormalEquations
from symoden.training._levenberg_marquardt import LevenbergStep
from symoden.training._levenberg_stage import LevenbergStage
from symoden.training._line_up import line_up
from symoden.training._relevance import Relevance
from symoden.training._verdicts import Skipped, compare
from symoden.training._weighing import Errors, Weighing


def test_it_ends_when_nothing_is_left_to_explain_or_nothing_is_gained_or_steps_run_out(stage, quick):
    stage, state = stage
    assert stage._ended(state) == (False, "")
    assert stage._ended(state._replace(best_loss=9e-12)) == (True, "nothing left to explain")
    assert stage._ended(state._replace(best_loss=2e-11)) == (False, "")
    assert stage._ended(state._replace(stale=quick.patience)) == (True, "converged")
    assert stage._ended(state._replace(step=quick.lm_steps)) == (True, "all steps taken")


def test_a_loss_in_the_units_of_the_data_has_no_such_bound(stage):
    stage, state = stage
    raw = dataclasses.replace(stage, config=dataclasses.replace(stage.config, scaled_loss=False))
    assert raw._ended(state._replace(best_loss=1e-30)) == (False, "")


def test_no_block_grows_where_the_rest_explains_the_motion(stage):
    stage, state = stage
    growth = dataclasses.replace(stage, corrections=NETWORKS, margin=2.0)
    started = growth.start(state)
    after, report = growth.advance(started._replace(best_loss=9e-7))
    assert (after.step, report.finished, report.outcome) == (0, True, "nothing left to explain")
    assert report.verdict == Skipped("nothing left to explain")
    after, _ = growth.advance(started._replace(best_loss=2e-6))
    assert after.step == 1


@pytest.mark.parametrize("learns", [False, True])
@pytest.mark.parametrize(
    ("margin", "errors", "kept"),
    [
        (1.0, -1.1, True),
        (1.0, -0.9, False),
        (-2.0, 1.9, True),
        (-2.0, 2.1, False),
        (None, 9.0, True),
        (2.0, -math.inf, True),
        (-2.0, math.inf, False),
    ],
)
def test_what_comes_of_a_stage_is_kept_if_validation_gains_as_much_as_is_asked_for(
    stage, monkeypatch, learns, margin, errors, kept
):
    stage, state = stage
    data = stage.data._replace(validation=stage.data.train)
    last = dataclasses.replace(stage, data=data, steps=1, corrections=1, learns=learns, margin=margin)
    monkeypatch.setattr(_verdicts, "standard_errors", lambda *_: errors)
    started = last.start(state)
    after, report = last.advance(started)
    assert report.finished
    size = f"{-errors:+.2f} standard errors, more than {margin or 0:+.0f} wanted"
    if math.isinf(errors):
        size = "a tenth or less" if errors < 0 else "tenfold or more"
    assert told(report.verdict) == ("" if margin is None else f"{kept} {size}")
    first, best = (jax.tree.leaves(each) for each in (started.best, after.best))
    assert kept == any(np.any(np.asarray(x) != np.asarray(y)) for x, y in zip(first, best, strict=True))
    assert after.best_loss == pytest.approx(report.validation if kept else started.best_loss)
    assert (float(after.memory.variance) > 0) == (learns and kept)


def test_what_sets_more_free_must_gain_and_all_errors_count_while_it_does(pendulum, quick, monkeypatch):
    monkeypatch.setattr(_data, "_FEWEST_LONGER", 2)
    config = dataclasses.replace(quick, growth_steps=1, relevance_steps=1, lm_horizon=None, validation=0.0)
    model = build(ModelConfig(), Space.parse("T1"), 1, key=jax.random.key(0))
    every = line_up(pendulum(samples=400), model, [model], config)
    stages = [each for each in every if isinstance(each, LevenbergStage) and not each.regresses]
    both = FRICTION | DIRECTIONS
    kinds = [0, INERTIA, ACTUATION, POTENTIAL, FRICTION, POTENTIAL | FRICTION, both]
    kinds += [*[FRICTION] * 4, FRICTION | NETWORKS]
    names = [
        "inertia",
        "actuation",
        "potential",
        "friction",
        "potential and friction",
        "directions",
        "relevance",
        "longer windows 2x",
        "longer windows 4x",
        "refit",
        "growth",
    ]
    assert [(each.name, each.corrections) for each in stages] == list(
        zip(["levenberg-marquardt", *names], kinds, strict=True)
    )
    assert stages[0].margin is None
    assert [each.name for each in stages if each.unless] == ["potential and friction"]
    assert not any(
        isinstance(each.begins, Without) for each in stages
    )  # Without validation it would be kept whatever it is.
    held_out = _data.hold_out(pendulum(samples=400), dataclasses.replace(config, validation=0.25))
    judged = line_up(held_out, model, [model], config)
    closing = [each for each in judged if isinstance(each, LevenbergStage) and isinstance(each.begins, Without)]
    instead = FRICTION, Without(POTENTIAL), 0.0
    assert [(each.name, each.corrections, each.begins, each.margin) for each in closing] == [
        ("regression: friction instead", *instead),  # What begins anew must not take dry friction for viscous.
        ("friction instead", *instead),
    ]
    for before, after in itertools.pairwise(stages):
        goes_on = not after.corrections & ~before.corrections  # What sets nothing free.
        assert after.errors is (Errors.AS_FOUND if goes_on else Errors.ALIKE)
        assert after.margin is not None
        assert not after.widens  # Longer windows go on with the priors of shorter ones.
        assert (after.margin > 0) != after.learns  # Simpler models are to be preferred; priors make them so.


def test_what_was_best_is_judged_anew_where_integration_is_refined(stage, monkeypatch):
    stage, state = stage
    monkeypatch.setattr(LevenbergStage, "_refined", lambda *_: 2)
    after, _ = stage.advance(stage.start(state)._replace(best_loss=1e-9))  # As the errors of integration have it.
    assert after.best_loss > 1e-9
    assert after.substeps == 2


def test_integration_is_refined_where_rollouts_diverge(stage, monkeypatch):
    stage, state = stage
    stage = dataclasses.replace(stage, config=dataclasses.replace(stage.config, lm_substeps=None))
    for lost in (np.inf, np.nan):
        monkeypatch.setattr(_levenberg_stage, "evaluate_loss", lambda *_, lost=lost: lost)
        monkeypatch.setattr(_levenberg_stage, "integration_error", lambda *_, lost=lost: lost)
        assert [stage._refined(state._replace(substeps=n)) for n in (1, 4, 16)] == [2, 8, 16]


def test_adam_goes_on_where_a_window_diverges_and_says_so_where_all_do(stage, pendulum, quick):
    _, state = stage
    quick = dataclasses.replace(quick, batch_size=4)
    data = _data.adam_data(pendulum(), state.model, quick)
    fast = jnp.asarray(1e30, data.train.rates.dtype)  # Its square is no number in single precision.
    for lost in (slice(0, 1), slice(None)):
        spoilt = data.train._replace(rates=data.train.rates.at[lost].set(fast))
        adam = AdamStage(data._replace(train=spoilt), quick, "adam", quick.adam_steps, state.model)
        started = adam.start(state)
        with jax.numpy_dtype_promotion("standard"):
            after, report = adam.advance(started)
        same = eqx.tree_equal(started.model, after.model)
        assert (report.outcome == DIVERGED) == same == (lost == slice(None))
        assert all(np.isfinite(x).all() for x in jax.tree.leaves(eqx.filter(after.model, eqx.is_inexact_array)))


def test_where_priors_are_not_learned_they_fade_with_the_loss(stage, monkeypatch):
    stage, state = stage
    learned = Relevance.start(state.model, 50.0)._replace(variance=jnp.asarray(1e3))
    plain, priors = _levenberg_stage.levenberg_marquardt_step, []

    def watched(*arguments, prior, **options):
        priors.append(prior)
        return plain(*arguments, prior=prior, **options)

    monkeypatch.setattr(_levenberg_stage, "levenberg_marquardt_step", watched)
    for learns in (True, False):
        last = dataclasses.replace(stage, learns=learns)
        last.advance(last.start(state)._replace(memory=learned))
    assert [prior.variance for prior in priors] == [1e3, None]
    assert all(np.array_equal(prior.precision, np.full_like(prior.precision, 50.0)) for prior in priors)


def test_priors_are_learned_beside_the_residuals_at_hand(stage):
    stage, state = stage
    learned = Relevance.start(state.model, 50.0)._replace(variance=jnp.asarray(1e3))
    for learns, variance in ((True, 0.0), (False, 1e3)):
        memory = dataclasses.replace(stage, learns=learns).start(state._replace(memory=learned)).memory
        assert float(memory.variance) == variance
        assert set(memory.precisions(state.model, 0)) == {50.0}


def test_what_validation_refused_begins_with_narrow_priors_where_these_are_learned(stage):
    stage, state = stage
    learning = dataclasses.replace(stage, corrections=FRICTION, learns=True)
    model = build(ModelConfig(), Space.parse("T1"), 1, key=jax.random.key(0))
    state = state._replace(model=model, best=model, memory=Relevance.start(model, 50.0))

    def opened(best):
        """Precisions of friction's laws and of the rest."""
        memory = learning.start(state._replace(best=best, model=best)).memory
        counts = [count_parameters(best, corrections=kinds) for kinds in (0, FRICTION, CORRECTIONS)]
        found = [memory.precisions(best, kinds) for kinds in (0, FRICTION, CORRECTIONS)]
        assert [len(each) for each in found] == counts
        return [sorted(set(each)) for each in found]

    assert opened(model) == [[50.0], [50.0, 1e4], [50.0, 1e4]]
    restore, theta = Flattening.of(model, corrections=FRICTION)
    kept = restore(theta + 0.1)  # What is free and not zero was kept.
    assert opened(kept) == [[50.0]] * 3
    assert eqx.tree_equal(dataclasses.replace(learning, learns=False).start(state).memory, state.memory)
    memory = learning.start(state).memory  # Learned since, and not zero any more: longer windows go on from there.
    longer = learning.start(state._replace(best=kept, model=kept, memory=memory))
    assert sorted(set(longer.memory.precisions(model, FRICTION))) == [50.0, 1e4]


def test_a_stage_may_begin_with_wide_priors_and_what_was_learned_comes_back_if_it_is_refused(stage, monkeypatch):
    stage, state = stage
    data = stage.data._replace(validation=stage.data.train)
    config = dataclasses.replace(stage.config, prior=2.0)
    longer = dataclasses.replace(stage, data=data, config=config, steps=1, corrections=1, margin=-2.0, widens=True)
    learned = Relevance.start(state.model, 7.0)
    started = longer.start(state._replace(memory=learned))
    assert {
        float(x) for x in jnp.concatenate([leaf.ravel() for leaf in jax.tree.leaves(started.memory.precision)])
    } == {2.0}
    monkeypatch.setattr(_verdicts, "standard_errors", lambda *_: 2.1)
    after, report = longer.advance(started)
    assert report.finished
    assert after.memory is learned
    monkeypatch.setattr(_verdicts, "standard_errors", lambda *_: 1.9)
    after, report = longer.advance(started)
    assert after.memory is started.memory


def told(verdict):
    """Whether a stage was kept, and by what; both losses must be numbers."""
    if verdict is None:
        return ""
    found = re.fullmatch(r"(not )?kept \(validation loss (\S+), before (\S+): (.*)\)", str(verdict))
    assert found is not None
    assert min(float(found[2]), float(found[3])) > 0
    return f"{found[1] is None} {found[4]}"


def test_windows_are_twice_and_four_times_as_long_as_far_as_there_are_enough(pendulum, small, quick, monkeypatch):
    monkeypatch.setattr(_data, "_FEWEST_LONGER", 2)
    monkeypatch.setattr(_data, "_FEWEST_IN_TURN", 2)
    dataset = pendulum()
    dataset = dataclasses.replace(dataset, train=dataset.train[1:], validation=dataset.train[:1])
    model = build(small, Space.parse("T1"), 1, key=jax.random.key(0))
    samples = min(map(len, dataset.train))
    for horizon, factors in (((samples - 1) // 8, [2, 4]), ((samples - 1) // 4, [2]), (samples - 1, [])):
        data = _data.levenberg_data(dataset, model, dataclasses.replace(quick, lm_horizon=horizon))
        longer = _data.longer_data(dataset, model, data, dataclasses.replace(quick, lm_horizon=None))
        assert [each.train.ts.shape[1] - 1 for each in longer] == [factor * horizon for factor in factors]
        assert all(each.validation is not None for each in longer)
        assert (
            _data.longer_data(dataset, model, data, dataclasses.replace(quick, lm_horizon=horizon)) == []
        )  # as asked for
    monkeypatch.setattr(_data, "_FEWEST_LONGER", 10**6)
    monkeypatch.setattr(_data, "_FEWEST_IN_TURN", 10**6)
    assert _data.longer_data(dataset, model, data, dataclasses.replace(quick, lm_horizon=None)) == []


@pytest.mark.parametrize(("worse", "kept"), [(0.9, True), (1.1, False)])
def test_priors_that_time_ran_out_for_have_brought_what_they_have_by_then(stage, monkeypatch, worse, kept):
    stage, state = stage
    data = stage.data._replace(validation=stage.data.train)
    relevance = dataclasses.replace(stage, data=data, corrections=1, learns=True, margin=-1.0)
    monkeypatch.setattr(_verdicts, "standard_errors", lambda *_: worse)
    started = relevance.start(state)
    settled, verdict = relevance.settled(started)
    assert not verdict
    assert eqx.tree_equal(settled.best, started.best)
    during, report = relevance.advance(started)
    assert not report.finished
    assert eqx.tree_equal(during.best, started.best)
    settled, verdict = relevance.settled(during)
    assert told(verdict) == f"{kept} -{worse:.2f} standard errors, more than -1 wanted"
    assert eqx.tree_equal(settled.best, during.model if kept else started.best)
    assert settled.best_loss == pytest.approx(report.validation if kept else started.best_loss)


def test_learning_ends_where_neither_the_evidence_nor_the_fit_gains(stage, monkeypatch):
    stage, state = stage
    evidences, losses = [0.0, 2.0, 2.5, 2.9, 3.1, 3.0, 3.0], [1.0] * 5 + [0.97, 0.96]
    state = stage.start(state)._replace(memory=Relevance.start(state.model, 1.0))
    monkeypatch.setattr(Relevance, "learn", lambda self, *_: self._replace(evidence=jnp.asarray(evidences.pop(0))))
    nothing = NormalEquations(*np.zeros((4, 1, 1)))
    stale, step = [], LevenbergStep(before=1.0, after=1.0, accepted=True, equations=nothing)
    for loss in losses:
        state = stage._learned(state, step._replace(after=loss), np.zeros(1), 0)
        stale.append(state.stale)
    assert stale == [0, 0, 1, 2, 0, 0, 0]
    assert float(state.memory.evidence) == 3.1
    monkeypatch.setattr(Relevance, "learn", lambda self, *_: self)  # As with a handful of windows.
    for loss, expected in ((0.5, 0), (0.99, 1), (0.99, 2)):
        state = stage._learned(state, step._replace(after=loss), np.zeros(1), 0)
        assert state.stale == expected


def test_the_evidence_is_counted_anew_where_integration_is_refined(stage, monkeypatch):
    stage, state = stage
    relevance = dataclasses.replace(stage, learns=True)
    monkeypatch.setattr(_levenberg_stage, "_FALLING", 2.0)  # No loss falls so far.
    state = relevance.start(state)
    state = state._replace(step=1, stale=3, memory=state.memory._replace(evidence=jnp.asarray(1e9)))
    assert relevance.advance(state)[0].stale == 4
    monkeypatch.setattr(LevenbergStage, "_refined", lambda _, state: 2 * state.substeps)
    after, _ = relevance.advance(state)
    assert after.stale == (0 if np.isfinite(after.memory.evidence) else 1)
    assert float(after.memory.evidence) < 1e9


def test_learned_priors_do_not_shrink_a_scale_that_the_data_leave_open(stage):
    stage, state = stage
    relevance = dataclasses.replace(stage, corrections=1, learns=True)
    state = relevance.start(state)
    # Priors far too narrow for anything: without a pin, all would go to nothing together.
    narrow = jax.tree.map(lambda x: jnp.full_like(x, 1e4), state.memory.precision)
    state = state._replace(memory=state.memory._replace(precision=narrow, variance=jnp.asarray(1.0)))
    q, models = stage.data.train.q[:, 0], [state.model]
    for _ in range(3):
        state, _ = relevance.advance(state)
        models.append(state.model)
    scales = [float(jnp.mean(jax.vmap(model.mass_matrix)(q))) for model in models]
    assert models[-1] is not models[0]
    assert scales[1:] == pytest.approx([scales[0]] * 3, rel=0.05)


def test_models_are_compared_window_against_window(stage):
    stage, state = stage
    objective = stage.objective(1, Weighing.plain(3))
    data = stage.data._replace(validation=stage.data.train)
    worse = jax.tree.map(lambda x: 1.5 * x if eqx.is_inexact_array(x) else x, state.model)
    assert compare(data, state.model, state.model, objective) == 0
    assert compare(data, state.model, worse, objective) == -compare(data, worse, state.model, objective) != 0
    assert compare(stage.data._replace(validation=None), state.model, worse, objective) == 0
    lost = jax.tree.map(lambda x: jnp.nan * x if eqx.is_inexact_array(x) else x, state.model)
    assert compare(data, lost, worse, objective) == np.inf
    assert compare(data, worse, lost, objective) == -np.inf


@pytest.mark.parametrize(
    ("losses", "others", "told"),
    [
        ([1.0, 2.0, 90.0], [0.01, 0.1, 8.9], math.inf),  # Its standard error is as large as the difference.
        ([1.0, 2.0, 90.0], [0.01, 0.1, 9.3], 1.0),
        ([1.0, 1.0, 90.0], [0.01, 0.2, 0.1], 1.0),
        ([1.0, 1.0, 90.0], [0.2, 0.2, 0.1], 1.0),  # One window alone, which may have been about to turn over.
        ([1.0, 1.0, 1.0, 90.0], [0.01, 0.01, 1.0, 0.1], math.inf),
        ([1.0, 1.0, 1.0, 90.0], [0.01, 1.0, 1.0, 0.1], 1.0),
        ([3.0, 4.0], [0.2, 0.2], 1.66),  # 6.6 standard errors, of two windows.
        ([3.0, 3.0], [2.0, 2.0], 3.42),
        ([3.0], [0.2], 0.0),
        ([1.0], [0.2], 0.0),
        ([0.0, 0.0], [0.0, 0.0], 0.0),
    ],
)
def test_a_loss_that_is_tenfold_in_three_of_four_windows_is_no_chance(stage, monkeypatch, losses, others, told):
    stage, state = stage
    data = stage.data._replace(validation=stage.data.train)
    found = {True: losses, False: others}
    monkeypatch.setattr(
        _verdicts, "evaluate_residuals", lambda model, *_: np.sqrt(np.array(found[model is state.model]))[:, None, None]
    )
    objective, other = stage.objective(1, Weighing.plain(3)), jax.tree.map(lambda x: x, state.model)
    assert compare(data, state.model, other, objective) == pytest.approx(told, abs=0.3)
    assert compare(data, other, state.model, objective) == pytest.approx(-told, abs=0.3)


def test_sensitivities_that_overflow_in_single_precision_are_computed_in_double(stage, monkeypatch):
    stage, state = stage
    plain, precisions = Linearization.normal_equations, []

    def overflowing(self):
        equations = plain(self)
        precisions.append(jnp.dtype(self.precision))
        single = self.precision == jnp.float32
        return equations._replace(matrix=np.full_like(equations.matrix, np.inf)) if single else equations

    monkeypatch.setattr(Linearization, "normal_equations", overflowing)
    _, report = stage.advance(stage.start(state))
    assert precisions == [jnp.float32, jnp.float64]
    assert report.loss < stage.start(state).best_loss

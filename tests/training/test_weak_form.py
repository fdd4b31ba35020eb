"""The weak form of the equations of motion: true of true motions, and where training begins."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import ACTUATION, FRICTION, Correction, trainable
from symoden.data import Dataset, Trajectory
from symoden.integrate import HOLDS, RK4, rollout
from symoden.models import KINDS, BlockConfig, ModelConfig, build, rescale
from symoden.spaces import Space
from symoden.systems import LinkChain
from symoden.training import TrainingConfig, _ensemble, fit
from symoden.training._adam_stage import AdamStage
from symoden.training._data import adam_data, hold_out, levenberg_data, regression_data
from symoden.training._flatten import Flattening, cast, freed
from symoden.training._gauss_newton import linearize
from symoden.training._levenberg_stage import LevenbergStage
from symoden.training._line_up import adam_optimizer, line_up
from symoden.training._objective import Batch
from symoden.training._relevance import Relevance
from symoden.training._residuals import evaluate_loss
from symoden.training._scales import measure_scales
from symoden.training._state import Incumbent, TrainingState
from symoden.training._weak_form import WeakForm
from symoden.training._weighing import Weighing

CHAIN = LinkChain.of_rods(3, mass=0.5, length=0.4, damping=0.1)
PLAIN = ModelConfig(
    inverse_mass=BlockConfig(harmonics=True),
    potential=BlockConfig(harmonics=True),
    actuation=BlockConfig(constant=True),
    friction=BlockConfig(constant=True),
    knees=(),
)


def swings(*, step=0.01, seconds=1.0, count=6, pace=3.0, seed=0):
    """Recordings of a chain of three links under inputs that change at some pace."""
    generator = np.random.default_rng(seed)
    ts = np.arange(round(seconds / step) + 1) * step
    recordings = []
    for k in range(count):
        phase = generator.uniform(0, 6, 3)
        us = np.sin(pace * ts[:, None] + phase)
        q0, v0 = generator.uniform(-1, 1, (2, 3))
        path = rollout(CHAIN, *map(jnp.asarray, (q0, v0, ts, us)), solver=RK4(8))
        parts = {"ts": ts, "q": np.asarray(path.q), "rates": np.asarray(path.rates), "us": us}
        recordings.append(Trajectory(name=f"swing{k}", **parts))
    return Dataset(name="swings", space="T3", train=tuple(recordings))


def random_window(n, m, seed, samples=9):
    """Noise: no motion of anything."""
    generator = np.random.default_rng(seed)
    ts = np.cumsum(generator.uniform(0.005, 0.02, samples))
    q, rates = generator.normal(size=(2, samples, n))
    us = generator.normal(size=(samples, m))
    return Batch(*(jnp.asarray(x) for x in (ts - ts[0], q, rates, us, np.concatenate([q[0], rates[0]]))))


def motion(step, hold, kind):
    """A motion of the chain as one window, under inputs that stay, swing or jump between samples."""
    ts = np.arange(round(0.48 / step) + 1) * step
    us = {
        "constant": np.ones((len(ts), 3)),
        "sine": np.sin(3 * ts[:, None] + np.arange(1, 4)),
        "steps": np.where(ts[:, None] + 1e-9 > [0.12, 0.2, 0.3], 3.0, -3.0),
    }[kind]
    start = np.random.default_rng(1).uniform(-1, 1, (2, 3))
    path = rollout(CHAIN, *map(jnp.asarray, (*start, ts, us)), solver=RK4(8), hold=HOLDS[hold])
    return Batch(*(jnp.asarray(x)[None] for x in (ts, path.q, path.rates, us, np.concatenate(start))))


@pytest.mark.parametrize("hold", HOLDS)
@pytest.mark.parametrize("kind", ["constant", "sine", "steps"])
def test_true_motions_satisfy_it_to_the_fourth_order_of_even_steps(hold, kind):
    form = WeakForm(jnp.ones(3), HOLDS[hold])
    # With linear hold what steps is a ramp, another one with every step.
    errors = [float(jnp.sqrt(form.loss(CHAIN, motion(step, hold, kind)))) for step in (0.02, 0.01)]
    assert errors[0] < 0.01  # Of velocities of 2 rad/s.
    assert np.log2(errors[0] / errors[1]) > 3.5


def test_uneven_steps_weigh_by_their_lengths():
    fine, form = motion(0.005, "zero", "constant"), WeakForm(jnp.ones(3), HOLDS["zero"])
    kept = np.concatenate([np.arange(0, 48, 1), np.arange(48, 97, 2)])
    ts, q, rates, us = (x[:, kept] for x in fine[:4])
    thinned = Batch(ts, q, rates, us, fine.start)
    wrong = LinkChain.of_rods(3, mass=0.5, length=0.4, damping=0.3)
    even, uneven = (np.asarray(form.residuals(wrong, jax.tree.map(lambda x: x[0], b))) for b in (fine, thinned))
    assert np.abs(even).max() > 0.1
    assert uneven == pytest.approx(even, abs=0.02 * float(np.abs(even).max()))


@pytest.mark.parametrize("hold", HOLDS)
def test_it_is_newtons_second_law_under_a_bump(hold, scrambled):
    config = dataclasses.replace(PLAIN, knees=(0.1,))
    model = scrambled(build(config, Space.parse("R1 T2"), 2, key=jax.random.key(0)), 0, 0.5)
    window = random_window(3, 2, 0)
    window = window._replace(us=jnp.broadcast_to(window.us[:1], window.us.shape))  # Nothing jumps.
    ts, halves = np.asarray(window.ts), np.diff(np.asarray(window.ts)) / 2
    x = 2 * ts / ts[-1] - 1
    bump = (1 - x**2) ** 3
    slope = np.asarray(jax.vmap(jax.grad(lambda t: (1 - (2 * t / ts[-1] - 1) ** 2) ** 3))(jnp.asarray(ts)), float)
    whole = np.pad(halves, (1, 0)) + np.pad(halves, (0, 1))
    states = jax.vmap(model.encode)(window.q, window.rates)
    rates = jax.vmap(lambda s, u: model.derivative(jnp.zeros(()), s, u))(states, window.us)
    impulse = (whole * bump) @ rates[:, 3:] + (whole * slope) @ states[:, 3:]
    velocity = model.inverse_mass_matrix(window.q[np.argmax(bump)]) @ impulse * ts[-1] / (whole @ bump)
    found = WeakForm(jnp.array([1.0, 2.0, 3.0]), HOLDS[hold]).residuals(model, window)
    assert np.asarray(found)[0] == pytest.approx(np.asarray(velocity) * [1, 2, 3], rel=1e-9, abs=1e-12)


def test_no_scale_of_the_energy_changes_it(scrambled):
    model = scrambled(build(PLAIN, Space.parse("T3"), 3, key=jax.random.key(0)), 0, 0.5)
    form, window = WeakForm(jnp.ones(3), HOLDS["zero"]), random_window(3, 3, 0)
    here, there = (np.asarray(form.residuals(each, window)) for each in (model, rescale(model, 7.0)))
    assert there == pytest.approx(here, rel=1e-9, abs=1e-12)


def test_its_derivative_is_that_of_the_residuals(scrambled):
    model = scrambled(build(PLAIN, Space.parse("T3"), 3, key=jax.random.key(0)), 0, 0.5)
    restore, theta = Flattening.of(model, corrections=0)
    form, window = WeakForm(jnp.ones(3), HOLDS["zero"]), random_window(3, 3, 0)
    r, J = linearize(restore, theta, form, window)
    direction = jnp.asarray(np.random.default_rng(1).normal(size=theta.size))
    value, slope = jax.jvp(lambda theta: form.residuals(restore(theta), window)[0], (theta,), (direction,))
    assert np.asarray(r) == pytest.approx(np.asarray(value), rel=1e-12)
    assert np.asarray(J @ direction) == pytest.approx(np.asarray(slope), rel=1e-9)


def test_a_model_without_energies_is_refused():
    model = build(dataclasses.replace(PLAIN, kind="naive"), Space.parse("T3"), 3, key=jax.random.key(0))
    with pytest.raises(TypeError, match="must be mechanical; got NaiveModel"):
        WeakForm(jnp.ones(3), HOLDS["zero"]).residuals(model, random_window(3, 3, 0))


def regressions(dataset, model, config):
    space = Space.parse(dataset.space)
    stages = line_up(
        dataset, build(model, space, dataset.inputs, momenta=dataset.momenta, key=jax.random.key(0)), (), config
    )
    return [stage.name for stage in stages if stage.name.startswith("regression")]


@pytest.mark.parametrize("kind", KINDS)
def test_three_coordinates_and_velocities_begin_with_it(kind, quick, pendulum):
    dataset, model = swings(), dataclasses.replace(PLAIN, kind=kind)
    wanted = ["regression", "regression: relevance", "regression: refit"] if kind in ("dissipative", "symoden") else []
    assert regressions(dataset, model, quick) == wanted
    assert regressions(dataclasses.replace(dataset, momenta=True), model, quick) == []
    assert regressions(swings(seconds=0.06), model, quick) == []  # Too few samples in a row.
    assert regressions(pendulum(), model, quick) == []


def test_one_and_two_coordinates_come_back_to_it_where_adam_found_no_basin(quick, pendulum):
    dataset, model = pendulum(), build(PLAIN, Space.parse("T1"), 1, key=jax.random.key(0))
    stages = line_up(dataset, model, (model, model), quick)
    names = [stage.name for stage in stages]
    again = ["regression", "regression: relevance", "regression: refit"]
    assert names[:6] == ["adam 1 of 2", "adam 2 of 2", *again, "levenberg-marquardt"]
    lost, found, saved = (
        begun_with(model, model)._replace(best_loss=x, origin=k) for x, k in ((0.2, 1), (0.05, 1), (0.05, 2))
    )
    applies = [[stage.applies(state) for stage in stages] for state in (lost, found, saved)]
    assert [row[2:5] for row in applies] == [[True, False, False], [False, False, False], [False, True, True]]
    assert all(all(row[5:]) for row in applies)
    raw = line_up(dataset, model, (model, model), dataclasses.replace(quick, scaled_loss=False))
    assert [stage.name for stage in raw][:3] == ["adam 1 of 2", "adam 2 of 2", "levenberg-marquardt"]


@pytest.mark.parametrize("better", [True, False])
def test_a_second_way_into_a_basin_is_kept_where_rollouts_are_better(better, searching):
    dataset, config, model = searching
    astray = diverging(model)
    best, fresh = (astray, model) if better else (model, astray)
    rollouts = adam_data(dataset, model, config)
    stage = LevenbergStage(regression(dataset, model, config), config, "regression", 1, fresh=fresh, rollouts=rollouts)
    start = begun_with(best, model)._replace(stage=3, origin=1)
    assert stage.applies(start)
    state, report = stage.advance(stage.start(start))
    assert (state.step, report.finished) == (1, True)
    assert state.origin == (3 if better else 1)
    assert eqx.tree_equal(state.best, cast(best, float)) == (not better)
    assert report.verdict.startswith("kept (a loss of" if better else "not kept (a loss of inf over rollouts, ")


TURNING = dataclasses.replace(PLAIN, actuation=BlockConfig(hidden=(3,), constant=True), knees=(0.1,))


def test_inputs_that_turn_are_asked_for_from_the_untrained_model_on(quick):
    dataset, model = swings(), build(TURNING, Space.parse("T3"), 3, key=jax.random.key(0))
    stages = [stage for stage in line_up(dataset, model, (), quick) if isinstance(stage, LevenbergStage)]
    names = [stage.name for stage in stages]
    asked = names.index("regression: actuation")
    assert names[asked - 1 : asked + 2] == ["regression: relevance", "regression: actuation", "regression: refit"]
    stage = stages[asked]
    assert stage.fresh is model
    assert (stage.corrections, stage.learns, stage.plain) == (ACTUATION, True, quick.lm_steps)
    assert stage.steps == quick.lm_steps + quick.relevance_steps
    state = begun_with(model, model)
    assert stage.applies(state)
    assert not stage.applies(state._replace(best_loss=1e-7))
    assert [each.fresh for each in stages if each is not stage] == [None] * (len(stages) - 1)


def test_it_begins_anew_without_laws_of_friction_and_learns_priors_after_plain_steps(searching, scrambled):
    dataset, config, _ = searching
    model = build(TURNING, Space.parse("T3"), 3, key=jax.random.key(0))
    rubbed = scrambled(eqx.filter(model, trainable(model, corrections=FRICTION)), 0, 0.1)
    before, data = eqx.combine(rubbed, model), regression(dataset, model, config)
    stage = LevenbergStage(data, config, "stage", 4, ACTUATION, margin=-1e9, learns=True, plain=2, fresh=model)
    state, variances = stage.start(begun_with(before, model)), []
    assert eqx.tree_equal(state.best, cast(model, float))
    report = None
    while report is None or not report.finished:
        state, report = stage.advance(state)
        variances.append(float(state.memory.variance) > 0)
        assert freed(state.model) == ACTUATION
    assert variances == [False, False, True, True]
    assert eqx.tree_equal(dataclasses.replace(stage, margin=1e9)._undone(state).best, cast(before, float))


def test_friction_on_the_full_state_has_none(quick):
    assert regressions(swings(), dataclasses.replace(PLAIN, full_friction=True), quick) == []


def regression(dataset, model, config):
    data = regression_data(dataset, model, config)
    assert data is not None
    return data


@pytest.fixture(scope="module")
def searching():
    config = TrainingConfig(validation=0.25, horizon=3, lm_horizon=10, lm_substeps=1)
    dataset = hold_out(swings(count=8), config)
    model = build(PLAIN, Space.parse("T3"), 3, key=jax.random.key(0))
    return dataset, config, model


@pytest.mark.parametrize(("yields", "loss", "skipped"), [(True, 0.05, True), (True, 0.2, False), (False, 0.05, False)])
def test_adam_looks_for_a_basin_only_where_none_is_found(yields, loss, skipped, searching, monkeypatch):
    dataset, config, model = searching
    data = regression(dataset, model, config)
    optimizer = adam_optimizer(dataclasses.replace(config, adam_steps=1))
    stage = AdamStage(data, config, "adam", 1, model, optimizer, yields=yields)
    monkeypatch.setattr("symoden.training._adam_stage.evaluate_loss", lambda *_: loss)
    priors = Relevance.start(model, 3.0)
    weighing = Weighing.plain(9)
    before = TrainingState(
        0, 0, model, priors, 1e-4, 1, weighing, model, 1.0, 0, 0, Incumbent(model, None, 0, weighing)
    )
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
    incumbent = Incumbent(model, None, 0, weighing)
    return TrainingState(0, 0, model, None, 1e-4, 1, weighing, best, 1.0, 0, 0, incumbent)


def test_what_the_regression_set_free_stays_free_and_is_not_asked_again(searching, scrambled):
    dataset, config, _ = searching
    model = build(dataclasses.replace(PLAIN, knees=(0.1,)), Space.parse("T3"), 3, key=jax.random.key(0))
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
        state = LevenbergStage(data, config, "stage", 1, guess=guess).start(begun_with(best, model))
        assert eqx.tree_equal(state.best, cast(model, float))
    assert LevenbergStage(data, config, "stage", 1).start(begun_with(astray, model)).best_loss == np.inf
    for candidates, guess in (((), model), ((model,), None)):
        first = next(s for s in line_up(dataset, model, candidates, config) if s.name == "levenberg-marquardt")
        assert isinstance(first, LevenbergStage)
        assert first.guess is guess


def test_a_model_that_diverges_gives_way(searching):
    dataset, config, model = searching
    data = adam_data(dataset, model, config)
    optimizer = adam_optimizer(dataclasses.replace(config, adam_steps=2))
    stage = AdamStage(data, config, "adam", 2, model, optimizer, yields=True)
    before = begun_with(diverging(model), model)._replace(memory=Relevance.start(model, 3.0))
    with jax.numpy_dtype_promotion("standard"):
        state, report = stage.advance(stage.start(before))
    assert state.step == 2
    assert state.best_loss == report.validation


def test_where_time_ends_before_rollouts_the_loss_is_that_of_rollouts(searching):
    dataset, config, _ = searching
    longer = dataclasses.replace(config, lm_substeps=None, growth_steps=0, relevance_steps=0, adam_steps=0)
    found = fit(dataset, model=PLAIN, config=longer, max_minutes=1e-6)
    assert not found.completed
    data = levenberg_data(hold_out(dataset, longer), found.model, longer)
    objective = data.objective.refined(RK4(found.substeps), Weighing.plain(9))
    assert data.validation is not None
    loss = evaluate_loss(cast(found.model, float), objective, data.validation)
    assert found.loss == pytest.approx(loss, rel=1e-4)


def test_three_links_are_found_from_random_weights():
    config = TrainingConfig(validation=0.2)
    dataset = hold_out(swings(seconds=4.0, count=10), config)
    scales = measure_scales(dataset.train, Space.parse("T3"), momenta=False)
    model = build(PLAIN, Space.parse("T3"), 3, scales=scales, input_matrix=np.eye(3), key=jax.random.key(0))
    weighing = Weighing.plain(9)
    before = TrainingState(0, 0, model, None, 1e-4, 1, weighing, model, 1.0, 0, 0, Incumbent(model, None, 0, weighing))
    stage = LevenbergStage(regression(dataset, model, config), config, "regression", 15)
    state = stage.start(before)
    assert state.best_loss > 1.0
    for _ in range(15):
        state, _ = stage.advance(state)
    assert state.best_loss < 0.01


def test_a_run_that_begins_with_it_and_is_stopped_after_every_stride_gives_the_same_bits(tmp_path):
    model = dataclasses.replace(PLAIN, inverse_mass=BlockConfig(constant=True), knees=(0.1,))
    config = TrainingConfig(
        validation=0.25,
        restarts=2,
        adam_steps=1,
        batch_size=4,
        horizon=3,
        lm_steps=2,
        lm_horizon=10,
        lm_substeps=1,
        growth_steps=1,
        relevance_steps=1,
    )
    dataset = swings(seconds=0.5, count=8)
    whole = fit(dataset, model=model, config=config, folder=tmp_path / "whole")
    stages, part = [], whole
    for _ in range(20):
        part = fit(
            dataset,
            model=model,
            config=config,
            folder=tmp_path / "parts",
            resume=True,
            max_minutes=0.0,
            progress=lambda now: stages.append(now.stage),
        )
        if part.completed:
            break
    order = ["regression", *(f"regression: {name}" for name in ("friction", "directions", "relevance", "refit"))]
    assert list(dict.fromkeys(stages))[:6] == [*order, "levenberg-marquardt"]
    assert part.completed
    assert eqx.tree_equal(part.model, whole.model)


def test_members_begin_with_it_too(monkeypatch):
    begun = []
    real = _ensemble._Member._sought

    def sought(self, fresh):
        for loss, model in real(self, fresh):
            begun.append((self.number, loss))
            yield loss, model

    monkeypatch.setattr(_ensemble._Member, "_sought", sought)
    config = TrainingConfig(
        validation=0.25,
        restarts=1,
        adam_steps=1,
        batch_size=4,
        horizon=3,
        lm_horizon=10,
        lm_substeps=1,
        lm_steps=3,
        growth_steps=0,
        relevance_steps=0,
    )
    seen = []
    fit(swings(count=8), model=PLAIN, config=config, members=2, progress=seen.append)
    strides = [number for number, _ in begun]
    assert [strides.count(number) for number in dict.fromkeys(strides)][:2] == [4, 4]  # Three steps, then Adam's one.
    assert sum(each.stage == "model 1 of 2" and not each.step for each in seen) >= 4

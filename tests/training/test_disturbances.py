"""What moves a machine beside its inputs is found, left out of training, and of all that follows from it."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.data import (
    DataError,
    Dataset,
    DataWarning,
    split_validation,
    validates_by_ends,
    without_spans,
)
from symoden.integrate import HOLDS
from symoden.models import KINDS, ModelConfig
from symoden.storage import StorageError
from symoden.systems import Pendulum
from symoden.training import TrainingConfig, _disturbances, _fit, fit, hold_out
from symoden.training._data import Data, levenberg_data, regression_data
from symoden.training._disturbances import _bound, disturbed_spans
from symoden.training._objective import Batch
from symoden.training._prepare import prepare
from symoden.training._weak_form import WeakForm

from .swings import MODEL, SIZE, STEP, SYSTEM, swings

CONFIG = TrainingConfig()


def gain(model):
    """Acceleration for each unit of the input, where the pendulum hangs: known, whatever the scale of M and g."""
    return model.inverse_mass_matrix(jnp.zeros(1)) @ model.input_matrix(jnp.zeros(1))


def pushes_at(count, rows):
    """Pushes of the same size at these rows of so many recordings."""
    return {k: [(row, row + 5, 60.0) for row in rows] for k in range(count)}


def found_in(dataset, model=SYSTEM, left_out=()):
    with jax.enable_x64(True):
        data = regression_data(hold_out(dataset, CONFIG), model, CONFIG)
        assert data is not None
        return disturbed_spans(model, data, dataset.train, left_out)


@settings(max_examples=15)
@given(
    seed=st.integers(0, 10_000),
    at=st.integers(30, SIZE - 50),
    length=st.integers(3, 10),
    size=st.floats(20.0, 60.0),
    sign=st.sampled_from([-1, 1]),
    noise=st.floats(0.0, 5e-3),
)
def test_a_push_is_found_where_it_is_and_nothing_else(seed, at, length, size, sign, noise):
    dataset = swings(seed, {1: [(at, at + length, sign * size)]}, noise)
    ((name, start, end),) = found_in(dataset)
    assert name == "run1"
    assert start <= 100 + STEP * (at + length)
    assert end >= 100 + STEP * at
    assert end - start < STEP * length + 0.8
    assert found_in(dataset, left_out=[(name, start, end)]) == []
    assert found_in(swings(seed, {}, noise)) == []


def test_a_wrong_velocity_is_found():
    (first, *others) = swings(0, {}).train
    rates = first.rates.copy()
    rates[222] += 8.0
    dataset = Dataset(name="runs", space="T1", train=(dataclasses.replace(first, rates=rates), *others))
    ((name, start, end),) = found_in(dataset)
    assert name == "run0"
    assert start < first.ts[222] < end


def test_training_looks_at_all_that_it_is_fitted_to_whatever_its_rate():
    first, *others = swings(0, {0: [(200, 206, 60.0)]}, count=4).train
    thin = {name: getattr(first, name)[::3] for name in ("ts", "q", "rates", "us")}
    dataset = Dataset(name="runs", space="T1", train=(dataclasses.replace(first, **thin), *others))
    ((name, start, end),) = found_in(dataset)
    assert name == "run0"
    assert start < first.ts[203] < end


def test_what_is_often_unexplained_is_the_models_fault():
    assert found_in(swings(1, {}), Pendulum(mass=3.0, damping=0.2)) == []
    assert len(found_in(swings(1, pushes_at(3, rows=[250])))) == 3
    assert found_in(swings(1, pushes_at(3, rows=[150, 350]))) == []  # Beyond what is usual all the same.
    assert found_in(swings(1, pushes_at(3, rows=range(10, SIZE - 10, 60)))) == []


@pytest.mark.parametrize(
    ("spans", "pieces"),
    [
        ([], {"run0": 500, "run1": 500}),
        ([("run1", 102.0, 103.0)], {"run0": 500, "run1#1": 100, "run1#2": 349}),
        ([("run0", 0.0, 101.0), ("run1", 109.7, 120.0)], {"run0#1": 449, "run1#1": 485}),
        ([("run1", 100.2, 100.4), ("run1", 100.3, 101.0)], {"run0": 500, "run1#1": 449}),  # Ten samples are no piece.
        ([("run1", 0.0, 1e3)], {"run0": 500}),
        ([("run1", 0.0, 99.0)], {"run0": 500, "run1": 500}),
    ],
)
def test_recordings_are_split_where_something_is_left_out(spans, pieces):
    dataset = swings(0, {}, count=2)
    left = without_spans(dataset, spans)
    assert {each.name: len(each) for each in left.train} == pieces
    for each in left.train:
        assert not any(each.name.startswith(name) and ((each.ts >= a) & (each.ts <= b)).any() for name, a, b in spans)
    judged = dataclasses.replace(dataset, train=dataset.train[:1], validation=dataset.train[1:])
    assert [each.name for each in without_spans(judged, spans).validation] == [
        name for name in pieces if name.startswith("run1")
    ]


def test_spans_that_are_none_are_refused():
    dataset = swings(0, {}, count=2)
    with pytest.raises(DataError, match=r"recordings in `train` or `validation`; got `fall`. There are `run0`, `run1`"):
        without_spans(dataset, [("fall", 0.0, 1.0)])
    with pytest.raises(DataError, match="something must be left to train on"):
        without_spans(dataset, [("run0", 0.0, 1e3), ("run1", 0.0, 1e3)])
    with pytest.raises(ValueError, match="that end after they begin; got"):
        TrainingConfig(left_out=(("run0", 2.0, 1.0),))


def test_spans_are_kept_in_order_each_once():
    first, second = ("run0", 1.0, 2.0), ("run1", 0.0, 1.0)
    assert TrainingConfig(left_out=(second, first, first)).left_out == (first, second)


def test_what_was_held_out_before_is_looked_at_by_its_whole_name():
    split = split_validation(swings(0, {1: [(480, 485, -60.0)]}), 0.1)
    every = (*split.train, *split.validation)
    with jax.enable_x64(True):
        data = regression_data(split, SYSTEM, CONFIG)
        assert data is not None
        spans = disturbed_spans(SYSTEM, data, every)
    assert [name for name, _, _ in spans] == ["run1"]
    assert sum(map(len, without_spans(split, spans).validation)) < sum(map(len, split.validation))
    assert disturbed_spans(SYSTEM, data, every, spans) == []


def test_what_judges_is_as_long_as_before_or_other_recordings_do():
    dataset = swings(0, {}, count=2)
    before = hold_out(dataset, CONFIG)
    one = hold_out(dataset, dataclasses.replace(CONFIG, left_out=(("run0", 109.3, 109.6),)))
    assert [each.name for each in one.validation] == ["run1#tail"]  # No piece is as long as a window.
    lost = hold_out(dataset, dataclasses.replace(CONFIG, left_out=(("run0", 109.0, 110.0), ("run1", 109.0, 110.0))))
    assert [each.name for each in lost.validation] == ["run0#tail", "run1#tail"]
    assert all(each.ts[-1] < 109 for each in lost.validation)
    long = dataclasses.replace(CONFIG, lm_horizon=40)
    short = hold_out(dataset, dataclasses.replace(long, left_out=(("run0", 109.3, 109.36),)))
    assert [each.name for each in short.validation] == ["run1#tail"]  # A piece of 31 samples is no window.
    for held in (before, one, lost, short):
        assert validates_by_ends(held)
    late = hold_out(dataset, dataclasses.replace(CONFIG, left_out=(("run0", 109.9, 110.0), ("run1", 109.9, 110.0))))
    assert validates_by_ends(late)
    steps = [levenberg_data(held, SYSTEM, CONFIG).train.ts.shape[1] for held in (before, one)]
    assert steps[0] == steps[1]


def test_poor_ends_stay_out_where_recordings_are_cut():
    estimated = dataclasses.replace(swings(0, {}).train[0], noise_gain=1.0, one_sided=0.1)
    dataset = Dataset(name="runs", space="T1", train=(estimated,))
    held = hold_out(dataset, dataclasses.replace(CONFIG, left_out=(("run0", 104.0, 104.5),)))
    assert held.train[0].ts[0] >= 100.1 - 1e-9
    assert [each.ts[0] for each in held.train[1:]] == [pytest.approx(104.52)]


def test_a_joint_that_seldom_moves_is_measured_while_it_does():
    generator = np.random.default_rng(0)
    windows, samples = 600, 20
    path = generator.normal(size=(windows, samples, 2)) * [1.0, 1e-3]
    path[::20, :, 1] = generator.normal(size=(30, samples))
    ts = jnp.broadcast_to(jnp.asarray(STEP * np.arange(samples)), (windows, samples))
    batch = Batch(ts, jnp.asarray(path), jnp.asarray(path), ts[..., None], jnp.zeros((windows, 4)))
    data = Data(batch, None, WeakForm(jnp.array([1.0, 4.0]), HOLDS["zero"]))
    residuals = 1e-3 * generator.normal(size=(windows, 2))
    residuals[::20, 1] = generator.uniform(0.5, 1.0, 30)  # The model is poor where it moves.
    bound = _bound(residuals, data, np.array([0.01, 0.01]))
    assert bound[1] > 2 * residuals[:, 1].max()
    assert bound[0] == pytest.approx(0.5 * np.sqrt(2), rel=0.1)
    residuals[0, 0] = np.inf
    assert _bound(residuals, data, np.array([0.01, 0.01]))[0] == np.inf
    assert _bound(residuals, data, np.array([0.01, 9.0]))[1] == np.inf  # Of nothing that moves nothing is known.


PUSHED = {0: [(100, 105, 60.0)], 1: [(480, 485, -60.0)]}
BRIEF = TrainingConfig(
    restarts=1, adam_steps=200, batch_size=32, lm_steps=3, growth_steps=1, relevance_steps=2, lm_substeps=1
)


@pytest.fixture(scope="module")
def pushed():
    return swings(0, PUSHED)


@pytest.fixture(scope="module")
def trained(pushed, tmp_path_factory):
    """What is learned of pushed recordings, and the folder."""
    folder = tmp_path_factory.mktemp("pushed") / "run"
    with pytest.warns(DataWarning, match=r"left out of training is `run0` from 10\d.* to .* s, `run1` from 10\d"):
        return fit(pushed, model=MODEL, config=BRIEF, folder=folder), folder


def test_training_begins_anew_without_what_disturbs(pushed, trained):
    result, _ = trained
    assert {name for name, _, _ in result.config.left_out} == {"run0", "run1"}
    plain = dataclasses.replace(BRIEF, left_out=())
    disturbed = fit(pushed, model=MODEL, config=plain)
    given = fit(pushed, model=MODEL, config=result.config)
    assert disturbed.config == plain
    assert eqx.tree_equal(given.model, result.model)

    def error(model):
        return abs(float(gain(model)[0, 0] / gain(SYSTEM)[0, 0]) - 1)

    assert error(result.model) < 0.02
    assert error(disturbed.model) > 3 * error(result.model)


def test_what_follows_leaves_it_out_too(pushed, trained):
    result, _ = trained
    blind = dataclasses.replace(result, config=BRIEF)
    narrow, wide = (float(each.posterior(pushed).half_width(gain)[0, 0]) for each in (result, blind))
    assert narrow < wide / 3


def test_resumed_in_strides_it_is_the_same(pushed, trained, tmp_path, in_strides):
    result, _ = trained
    with pytest.warns(DataWarning, match="left out of training"):
        *_, last = in_strides(pushed, most=60, model=MODEL, config=BRIEF, folder=tmp_path / "parts")
    assert last.config == result.config
    assert eqx.tree_equal(last.model, result.model)


def test_a_run_goes_on_with_what_it_left_out_and_nothing_else(pushed, trained):
    result, folder = trained
    again = fit(pushed, model=MODEL, config=result.config, folder=folder, resume=True)  # As a run's settings have it.
    assert eqx.tree_equal(again.model, result.model)
    for other in ((), (("run0", 101.0, 102.0),)):
        with pytest.raises(StorageError, match="same data, settings and version"):
            fit(pushed, model=MODEL, config=dataclasses.replace(BRIEF, left_out=other), folder=folder, resume=True)
    with pytest.raises(StorageError, match="same data, settings and version"):
        fit(swings(1, {}), model=MODEL, config=BRIEF, folder=folder, resume=True)


def found_twice(model, data, recordings, left_out):
    """In place of `disturbed_spans`: one span, and another one once that is left out."""
    del model, data, recordings
    return [("run0", 102.0, 102.5), ("run1", 104.0, 104.5)][len(left_out) :][:1]


def test_what_is_small_is_found_in_a_round_of_its_own_also_by_a_run_in_strides(tmp_path, in_strides, monkeypatch):
    monkeypatch.setattr(_disturbances, "disturbed_spans", found_twice)
    dataset = swings(0, {})
    with pytest.warns(DataWarning, match="Training begins anew"):
        whole = fit(dataset, model=MODEL, config=BRIEF)
    assert whole.config.left_out == (("run0", 102.0, 102.5), ("run1", 104.0, 104.5))
    with pytest.warns(DataWarning, match="Training begins anew"):
        *_, last = in_strides(dataset, most=60, model=MODEL, config=BRIEF, folder=tmp_path / "parts")
    assert last.config == whole.config
    assert eqx.tree_equal(last.model, whole.model)


@pytest.mark.slow
def test_a_run_that_is_killed_before_it_begins_anew_finds_it_again(tmp_path, monkeypatch):
    monkeypatch.setattr(_disturbances, "disturbed_spans", found_twice)
    dataset, prepared = swings(0, {}), []

    def prepare_once(*arguments, **settings):
        if prepared:
            raise KeyboardInterrupt
        prepared.append(prepare(*arguments, **settings))
        return prepared[0]

    with pytest.warns(DataWarning, match="Training begins anew"):
        whole = fit(dataset, model=MODEL, config=BRIEF)
    with monkeypatch.context() as patch:
        patch.setattr(_fit, "prepare", prepare_once)
        with pytest.warns(DataWarning, match="Training begins anew"), pytest.raises(KeyboardInterrupt):
            fit(dataset, model=MODEL, config=BRIEF, folder=tmp_path / "run")
    with pytest.warns(DataWarning, match="Training begins anew"):
        last = fit(dataset, model=MODEL, config=BRIEF, folder=tmp_path / "run", resume=True)
    assert last.config == whole.config
    assert eqx.tree_equal(last.model, whole.model)


@pytest.mark.parametrize("growth_steps", [1, 0])  # Without, it is found after the last stage.
def test_a_run_that_ends_soon_after_it_began_anew_has_the_model_from_before(growth_steps, monkeypatch):
    config = dataclasses.replace(BRIEF, growth_steps=growth_steps)
    monkeypatch.setattr(_disturbances, "disturbed_spans", found_twice)
    dataset = swings(0, {})

    def stop_after(name, times):
        def progress(now):
            nonlocal times
            times -= now.stage == name and bool(now.outcome)
            if times == 0:
                raise StopIteration

        return progress

    with pytest.warns(DataWarning, match="Training begins anew"):
        first = fit(dataset, model=MODEL, config=config, progress=stop_after("whitened errors", 1))
    with pytest.warns(DataWarning, match="Training begins anew"):
        second = fit(dataset, model=MODEL, config=config, progress=stop_after("adam", 2))
    assert second.config.left_out is None
    assert first.config.left_out is None
    assert second.outcome.startswith("stopped by `progress`")
    assert not second.completed
    assert eqx.tree_equal(first.model, second.model)


@pytest.mark.parametrize(
    ("kind", "looks"),
    [(ModelConfig(kind=kind), kind in {"dissipative", "symoden"}) for kind in KINDS]
    + [(ModelConfig(full_friction=True, knees=()), False)],
)
def test_it_is_looked_for_where_there_is_a_weak_form(kind, looks):
    with jax.enable_x64(True):
        dataset = swings(0, {})
        assert (prepare(dataset, kind, CONFIG, screened=True).screening is not None) == looks
        assert prepare(dataset, kind, CONFIG).screening is None


def test_where_names_tell_no_recordings_apart_nothing_is_looked_for():
    dataset = swings(0, {})
    alike = dataclasses.replace(dataset, train=tuple(dataclasses.replace(each, name="run") for each in dataset.train))
    with jax.enable_x64(True):
        assert prepare(alike, MODEL, CONFIG, screened=True).screening is None

"""Bands on blocks and on predictions: gauge, entries that the data do not tell, coverage."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import Known, KnownValue
from symoden.data import Dataset, Trajectory
from symoden.evaluation import (
    Ranges,
    Stretch,
    _bands,
    bands_along,
    calibrate_bands,
    certainty,
    inspect_model,
    predict,
    recorded_paths,
    score_bands,
)
from symoden.evaluation._batches import entire
from symoden.experiments import simulate, task
from symoden.integrate import RK4, rollout
from symoden.models import BlockConfig, ModelConfig, build, rescale
from symoden.spaces import Space
from symoden.training import Ensemble, TrainingConfig, fit, hold_out, infer_posterior
from symoden.training._flatten import Flattening

CONSTANT = BlockConfig(constant=True)
MODEL = ModelConfig(
    inverse_mass=CONSTANT, potential=BlockConfig(harmonics=True), actuation=CONSTANT, friction=CONSTANT, knees=()
)
STEPS = TrainingConfig(adam_steps=100, restarts=1, lm_steps=12, growth_steps=0, relevance_steps=0, validation=0.2)
NOISE = 0.03


def noisy(recordings, seed):
    generator = np.random.default_rng(seed)
    return tuple(
        dataclasses.replace(
            recording,
            q=recording.q + NOISE * generator.normal(size=recording.q.shape),
            rates=recording.rates + NOISE * generator.normal(size=recording.rates.shape),
        )
        for recording in recordings
    )


@pytest.fixture(scope="module")
def trained() -> tuple:
    """A pendulum in noise, without anything that fixes the scale."""
    clean = simulate(task("pendulum"), train_initials=12, test_initials=12).dataset
    dataset: Dataset = dataclasses.replace(clean, train=noisy(clean.train, 0), test=noisy(clean.test, 1))
    return fit(dataset, model=MODEL, config=STEPS, members=4), dataset


@pytest.fixture(scope="module")
def learned(trained) -> tuple:
    """The model and its data."""
    return trained[0].model, trained[1]


def bands(model, dataset) -> tuple[Any, Any]:
    found = inspect_model(model, Ranges.of(dataset.train, model.space))
    return found, certainty(infer_posterior(model, dataset, STEPS), found)


def test_bands_contain_the_truth_of_a_pendulum_in_noise(learned):
    model, dataset = learned
    found, band = bands(model, dataset)
    truth = task("pendulum").system
    q = jnp.zeros(1)
    mass, g, D = truth.mass_matrix(q)[0, 0], truth.input_matrix(q)[0, 0], truth.dissipation_matrix(q, q)[0, 0]
    learned_mass = found.profiles[0].mass_matrix[0, 0, 0]
    # The mean of log det M is held fixed and M is constant: its band is none, and those of g and D are of g/M and D/M.
    assert band.profiles[0].mass_matrix.max() < 1e-6 * learned_mass
    for name, true in (("input_matrix", g), ("dissipation_matrix", D)):
        value, width = (getattr(part.profiles[0], name)[0, 0, 0] for part in (found, band))
        assert abs(value / learned_mass - true / mass) < 3 * width / learned_mass
        assert 0 < width < 0.3 * value
    assert band.accelerations["inputs"] == pytest.approx(band.relative["g"], rel=1e-3)
    assert band.accelerations["friction"] == pytest.approx(band.relative["D"], rel=1e-3)
    assert 0 < band.accelerations["potential"] < 0.3


def test_of_free_motion_nothing_is_said_of_inputs(learned):
    """Means over no inputs would be none, with a warning of NumPy's."""
    _, dataset = learned
    model = build(MODEL, Space.parse("T1"), 0, key=jax.random.key(0))
    free = [dataclasses.replace(each, us=each.us[:, :0]) for each in dataset.train]
    restore, theta = Flattening.of(model, corrections=0)
    ensemble = Ensemble(
        restore=restore,
        theta=np.asarray(theta),
        windows=9,
        members=np.asarray(theta) + 0.01 * np.random.default_rng(0).normal(size=(3, len(theta))),
        tried=3,
        corrections=0,
    )
    band = certainty(ensemble, inspect_model(model, Ranges.of(free, model.space)))
    assert {"V", "D"} <= set(band.relative) <= {"M", "V", "D"}
    assert set(band.accelerations) == {"potential", "friction"}


def test_the_gauge_changes_no_relative_band(learned):
    model, dataset = learned
    (_, one), (_, other) = bands(model, dataset), bands(rescale(model, 3.0), dataset)
    assert other.relative == pytest.approx(one.relative, rel=1e-3, abs=1e-9)
    assert other.accelerations == pytest.approx(one.accelerations, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("full", [False, True])
def test_members_that_differ_in_the_gauge_alone_differ_in_nothing(learned, full):
    model, dataset = learned
    if full:
        config = dataclasses.replace(MODEL, full_friction=True)
        model = build(config, Space.parse("T1"), 1, key=jax.random.key(0))

    def in_units(change) -> Any:
        return lambda theta: change(model, float(theta[0]))

    units = np.array([[0.5], [2.0], [3.0]])
    ensemble = Ensemble(
        restore=in_units(rescale),
        theta=np.ones(1),
        windows=10,
        members=units,
        tried=3,
        corrections=0,
    )
    found = inspect_model(model, Ranges.of(dataset.train, model.space))
    band = certainty(ensemble, found)
    assert band.relative == pytest.approx(dict.fromkeys(band.relative, 0.0), abs=1e-5)
    assert (band.members, band.tried, band.effective) == (3, 3, None)
    uneven = dataclasses.replace(ensemble, restore=in_units(spoilt))
    band = certainty(uneven, found)
    assert band.relative["D"] > 0.1
    assert band.accelerations["friction"] > 0.1 > band.accelerations["inputs"]


def test_what_inputs_alone_tell_is_a_common_factor(learned):
    model, dataset = learned
    anchored = eqx.tree_at(lambda one: one.actuation, model, KnownValue(Known(jnp.ones((1, 1)))))

    def stronger(model, factor):
        return eqx.tree_at(lambda one: one.actuation, rescale(model, factor), anchored.actuation)

    units = np.array([[0.98], [1.01], [1.02]])
    for change, common, apart in ((stronger, 0.0173, 0.0), (spoilt, 0.0, 0.0173)):
        ensemble = Ensemble(
            restore=lambda theta, change=change: change(anchored, float(theta[0])),
            theta=np.ones(1),
            windows=10,
            members=units,
            tried=3,
            corrections=0,
        )
        band = certainty(ensemble, inspect_model(anchored, Ranges.of(dataset.train, anchored.space)))
        wide = ensemble.quantile(0.9)
        assert (band.common_factor or 0.0) == pytest.approx(wide * common, rel=0.03)
        assert band.relative["D"] == pytest.approx(wide * 0.0173, rel=0.03)
        assert band.accelerations == {}  # The scale is known.
        left = band.apart or band.relative
        assert left["D"] == pytest.approx(wide * apart, abs=1e-3)
        assert (left["M"], left["V"]) == pytest.approx((0.0, 0.0), abs=1e-3)


def spoilt(model, factor):
    """Other friction, all else the same."""
    other = rescale(model, factor)
    return eqx.tree_at(lambda one: one.friction, model, other.friction)


def test_a_joint_at_rest_has_a_band_of_its_friction():
    model = build(MODEL, Space.parse("T2"), 1, key=jax.random.key(0))
    ensemble = Ensemble(
        restore=lambda theta: spoilt(model, float(theta[0])),
        theta=np.ones(1),
        windows=10,
        members=np.array([[0.98], [1.01], [1.02]]),
        tried=3,
        corrections=0,
    )
    ranges = Ranges(positions=((-1.0, 1.0), (0.0, 0.0)), rates=((-2.0, 2.0), (0.0, 0.0)), inputs=((-1.0, 1.0),))
    found = inspect_model(model, ranges)
    for along, band in zip(found.friction, certainty(ensemble, found).friction, strict=True):
        assert band.coefficient == pytest.approx(ensemble.quantile(0.9) * 0.0173 * along.coefficient, rel=0.01)
        assert band.force == pytest.approx(band.coefficient * np.abs(along.velocities))


def test_a_coupling_that_is_smaller_than_its_band_is_not_told():
    def coupled(theta):
        known = KnownValue(Known(jnp.array([[1.0, float(theta[0])], [0.2, 1.0]])))
        return eqx.tree_at(lambda one: one.actuation, build(MODEL, space, 2, key=jax.random.key(0)), known)

    space, ranges = (
        Space.parse("T2"),
        Ranges(positions=((-1.0, 1.0),) * 2, rates=((-2.0, 2.0),) * 2, inputs=((-1.0, 1.0),) * 2),
    )
    found = inspect_model(coupled([0.2]), ranges)
    for scatter, told in ((0.05, ()), (0.2, ("g[1, 2]",))):
        ensemble = Ensemble(
            restore=coupled,
            theta=np.array([0.2]),
            windows=10,
            members=0.2 + scatter * np.array([[-1.0], [0.5], [1.0]]),
            tried=3,
            corrections=0,
        )
        assert certainty(ensemble, found).undetermined == told


def test_more_noise_is_less_certain(learned):
    model, dataset = learned
    _, band = bands(model, dataset)
    train = dataset.train
    for seed in (2, 3, 4):  # Twice the standard deviation in all.
        train = noisy(train, seed)
    noisier = dataclasses.replace(dataset, train=train)
    _, wider = bands(model, noisier)
    assert wider.relative["V"] > 1.2 * band.relative["V"]
    assert band.effective <= band.parameters


@pytest.mark.parametrize("kind", ["laplace", "ensemble"])
def test_bands_cover_what_they_say(trained, kind):
    result, dataset = trained
    held = hold_out(dataset, STEPS)
    posterior = result.ensemble if kind == "ensemble" else infer_posterior(result.model, dataset, STEPS)
    score = score_bands(calibrate_bands(posterior, held, solver=RK4(2)), held.test)
    assert score.calibrated_on == "validation"
    assert score.coverage == pytest.approx(0.9, abs=0.04)
    assert NOISE < score.half_width < 5 * NOISE
    assert 0 < score.from_parameters < 1
    blind = dataclasses.replace(held, validation=())
    bands = calibrate_bands(posterior, blind, solver=RK4(2))
    assert (bands.calibrated_on, bands.factor) == ("train", 1)
    assert score_bands(bands, held.test).coverage == pytest.approx(0.9, abs=0.05)


@pytest.mark.parametrize(
    ("windows", "share", "narrower", "wider"), [(1, 0.1, False, False), (12, 0.1, True, False), (1, 5.0, False, True)]
)
def test_few_windows_of_validation_widen_bands_but_do_not_narrow_them(trained, windows, share, narrower, wider):
    result, dataset = trained
    held = hold_out(dataset, STEPS)
    posterior = infer_posterior(result.model, dataset, STEPS)

    def nearer(recording: Trajectory) -> Trajectory:
        log = (jnp.asarray(each) for each in (recording.q[0], recording.rates[0], recording.ts, recording.us))
        path = np.asarray(rollout(result.model, *log, solver=RK4(2)).q)
        return dataclasses.replace(recording, q=path + share * (recording.q - path))

    validation = tuple(map(nearer, held.test[:windows]))
    bands = calibrate_bands(posterior, dataclasses.replace(held, validation=validation), solver=RK4(2))
    assert (bands.factor < 1, bands.factor > 1) == (narrower, wider)
    assert bands.calibrated_on == ("validation" if narrower or wider else "train")
    coverage = score_bands(bands, held.test).coverage
    assert (coverage < 0.6, coverage > 0.97) == (narrower, wider)


def test_recordings_shorter_than_a_window_are_judged_and_drawn_as_a_whole(trained):
    result, dataset = trained
    held = hold_out(dataset, STEPS)
    bands = calibrate_bands(infer_posterior(result.model, dataset, STEPS), held, solver=RK4(2))
    recording = held.test[0].cut(0, 10, name="short")
    assert score_bands(bands, [recording]).horizon_s == pytest.approx(recording.duration)
    (drawn,) = recorded_paths(result.model, [recording], hold="zero", solver=RK4(2), bands=bands)
    (window,) = drawn.windows
    assert window.ts == pytest.approx(recording.ts)


def test_bands_along_a_recording_are_those_that_are_drawn_and_nan_elsewhere(trained):
    result, dataset = trained
    held = hold_out(dataset, STEPS)
    bands = calibrate_bands(infer_posterior(result.model, dataset, STEPS), held, solver=RK4(2))
    bands = dataclasses.replace(bands, horizon=0.5)
    (first,), second = simulate(task("pendulum"), train_initials=1, test_initials=1).prediction, held.test[0]
    recordings = [first.cut(0, 37, name="longer"), second.cut(0, 5, name="short")]
    paths = predict(result.model, recordings, solver=RK4(2))
    found = bands_along(bands, recordings, paths)
    drawn = recorded_paths(result.model, recordings, hold="zero", solver=RK4(2), bands=bands)
    for along, recording, path, shown in zip(found, recordings, paths, drawn, strict=True):
        judged = np.zeros(len(recording), bool)
        for window in shown.windows:
            rows = np.searchsorted(recording.ts, window.ts - 1e-9)[1:]
            assert np.array_equal(along.windows[rows], window.q[1:])
            assert np.array_equal(along.windows_half_width[rows], window.half_width[1:])
            judged[rows] = True
        assert np.array_equal(np.isfinite(along.windows_half_width[1:, 0]), judged[1:])
        inside = np.abs(along.windows - recording.q)[judged] <= along.windows_half_width[judged]
        assert along.coverage == inside.mean()
        early = recording.ts - recording.ts[0] <= bands.horizon + 1e-9
        assert np.array_equal(np.isfinite(along.half_width[:, 0]), early)
        # It is also about the rollout from the first sample, which the first of the windows is.
        assert path.q[early] == pytest.approx(along.windows[early], abs=1e-6)
        assert along.half_width[early][1:-1] == pytest.approx(shown.windows[0].half_width[1:-1], rel=1e-3)
    longer, short = found
    assert len(drawn[0].windows) > 1
    assert np.isnan(longer.windows_half_width[-1]).all()
    assert np.isfinite(short.half_width).all()


def test_the_band_of_a_rollout_is_about_the_state_that_it_starts_in(trained):
    result, dataset = trained
    held = hold_out(dataset, STEPS)
    bands = calibrate_bands(infer_posterior(result.model, dataset, STEPS), held, solver=RK4(2))
    bands = dataclasses.replace(bands, horizon=0.5)
    (recording,) = (dataclasses.replace(each, initial_samples=6) for each in held.test[:1])
    (path,) = predict(result.model, [recording], solver=RK4(2))
    begun = dataclasses.replace(
        recording,
        q=np.concatenate([path.q[:1], recording.q[1:]]),
        rates=np.concatenate([path.rates[:1], recording.rates[1:]]),
    )
    assert not np.array_equal(path.q[0], recording.q[0])
    (along,) = bands_along(bands, [recording], [path])
    (band,) = bands.predict([Stretch(trajectory=begun, start=0, stop=len(begun))])
    early = recording.ts - recording.ts[0] <= bands.horizon + 1e-9
    assert along.half_width[early] == pytest.approx(band.half_width[early], rel=1e-5)
    assert band.q[early] == pytest.approx(path.q[early], abs=1e-5)
    assert np.isnan(along.windows[:5]).all()  # Windows start after the initial samples.


def test_no_band_covers_what_diverges(trained):
    result, dataset = trained
    held = hold_out(dataset, STEPS)
    bands = calibrate_bands(infer_posterior(result.model, dataset, STEPS), held, solver=RK4(2))
    calm = held.test[0]
    us = np.where(np.arange(len(calm)) < len(calm) // 2, 0.0, 1e300)[:, None] * np.ones_like(calm.us)
    wild = dataclasses.replace(calm, name="wild", us=us)
    (error, half, _), lost = bands.along([calm, wild])
    assert lost > 0
    assert len(error) + lost == sum(
        stop - start - 1 for one in (calm, wild) for start, stop in _bands.judged_windows(one, bands.horizon)
    )
    held_by_bands = np.sum(error <= half) / (error.size + lost * error.shape[1])
    assert score_bands(bands, [calm, wild]).coverage == pytest.approx(held_by_bands, rel=1e-9)
    thrown = dataclasses.replace(calm, name="thrown", us=np.full_like(calm.us, 1e300))
    (along,) = bands_along(bands, [thrown], predict(result.model, [thrown], solver=RK4(2)))
    assert along.coverage == 0
    assert np.isnan(along.half_width[1:]).all()
    assert np.isnan(along.windows_half_width[1:]).all()


def test_bands_go_on_where_angles_go_round_whatever_the_model(trained):
    _, dataset = trained
    ts, us = np.linspace(0.0, 1.0, 21), np.zeros((21, 1))
    fall = np.exp(-ts)[:, None]  # Under viscous friction.
    spun = [
        Trajectory(name=f"spun{k}", ts=ts, q=q0 + rate * (1 - fall), rates=rate * fall, us=us)
        for k, (q0, rate) in enumerate([(9.0, 4.0), (-2.0, -5.0), (0.0, 7.0), (3.0, 1.0), (-9.0, 6.0), (3.1, -2.0)])
    ]
    spinning = dataclasses.replace(dataset, train=tuple(spun), test=(), validation=())
    naive = fit(spinning, model=ModelConfig(kind="naive", flow=(4,)), config=STEPS).model
    bands = calibrate_bands(infer_posterior(naive, spinning, STEPS), spinning, solver=RK4(2))
    for drawn, recording in zip(bands.predict(entire(spun)), spun, strict=True):
        assert np.abs(np.diff(drawn.q, axis=0)).max() < 1.0  # Without jumps of 2π.
        assert np.abs(drawn.q - recording.q).max() < 1.0
        assert drawn.half_width.max() < 3.0


@pytest.mark.parametrize("lost", [0, 1, 2])
def test_validation_windows_that_diverge_widen_bands(trained, lost):
    result, dataset = trained
    held = hold_out(dataset, STEPS)
    posterior = infer_posterior(result.model, dataset, STEPS)
    calm = held.test[0]
    wild = dataclasses.replace(calm.cut(0, 10, name="wild"), us=np.full_like(calm.us, 1e300)[:10])
    validation = (*held.test[:12], *[wild] * lost)
    bands = calibrate_bands(posterior, dataclasses.replace(held, validation=validation, test=()), solver=RK4(2))
    score = score_bands(bands, validation)
    assert score.coverage == pytest.approx(0.9, abs=0.01)  # Of all, what diverges included.


def test_bands_look_at_some_windows_of_long_logs_that_are_spaced_evenly(monkeypatch):
    ts = np.linspace(0.0, 10.0, 201)
    rest = np.zeros((len(ts), 1))
    log = Trajectory(name="log", ts=ts, q=rest, rates=rest, us=rest)
    every = [stretch.start for stretch in _bands._windows_of([log, log], 1.0)]
    assert len(every) == 2 * 37
    monkeypatch.setattr(_bands, "_MOST_WINDOWS", 5)
    some = [stretch.start for stretch in _bands._windows_of([log, log], 1.0)]
    assert some == [0, *(every[i] for i in (18, 36, 55)), every[-1]]


def test_models_without_blocks_have_no_bands(learned):
    _, dataset = learned
    model = fit(
        dataset, model=ModelConfig(kind="naive", flow=(3,)), config=dataclasses.replace(STEPS, lm_steps=1)
    ).model
    with pytest.raises(ValueError, match="need a model with M, V, g and D"):
        bands(model, dataset)
    assert jax.tree.leaves(model)

"""Members of an ensemble scatter as the model would if the recordings were made anew."""

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import t as student

from symoden.blocks import DIRECTIONS, FRICTION, NETWORKS
from symoden.known import KnownParts
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space
from symoden.storage import StorageError, save_arrays
from symoden.training import Ensemble, TrainingConfig, _ensemble, _fit, fit, ignore, infer_posterior, load_ensemble
from symoden.training._ensemble import train_members
from symoden.training._flatten import Flattening
from symoden.training._levenberg_stage import LevenbergStage
from symoden.training._prepare import prepare
from symoden.training._stopwatch import Stopwatch

CONSTANT = BlockConfig(constant=True)
MODEL = ModelConfig(inverse_mass=CONSTANT, potential=CONSTANT, actuation=CONSTANT, friction=CONSTANT, knees=())
HORIZON = 5
STEPS = TrainingConfig(
    validation=0.0, adam_steps=0, lm_steps=8, lm_horizon=HORIZON, lm_substeps=1, growth_steps=0, relevance_steps=0
)
NOISE = 0.02


@pytest.fixture(scope="module")
def noisy(pendulum):
    generator = np.random.default_rng(0)
    clean = pendulum(count=6, samples=51)

    def disturbed(recording):
        later = (np.arange(len(recording)) % HORIZON > 0)[:, None]
        return dataclasses.replace(recording, q=recording.q + NOISE * later * generator.normal(size=recording.q.shape))

    known = KnownParts(
        mass_matrix=[["m"]],
        potential_energy="-w*cos(q1)",
        input_matrix=[[1]],
        dissipation_matrix=[["d"]],
        parameters={"m": 0.5, "w": 3.0, "d": 0.1},
    )
    return dataclasses.replace(clean, train=tuple(map(disturbed, clean.train)), known=known)


@pytest.fixture(scope="module")
def found(noisy, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    return fit(noisy, model=MODEL, config=STEPS, folder=folder, members=12), folder


def quantities(model):
    q = jnp.array([2.0])
    energy = model.potential_energy(q) - model.potential_energy(jnp.zeros(1))
    return jnp.stack([energy, model.mass_matrix(q)[0, 0], model.dissipation_matrix(q, q)[0, 0]])


def test_they_scatter_as_the_gauss_newton_matrix_says(found, noisy):
    result, _ = found
    ensemble, laplace = result.ensemble, infer_posterior(result.model, noisy, STEPS)
    assert (len(ensemble.members), ensemble.tried, ensemble.windows) == (12, 12, laplace.windows)
    told, said = (np.linalg.norm(each.project(quantities), axis=1) for each in (ensemble, laplace))
    ratio = told / said  # 12 draws tell a standard deviation to 20 %; the windows that say it are 60
    assert (ratio > 0.45).all(), ratio
    assert (ratio < 2.2).all(), ratio


def test_what_is_computed_scatters_alike_in_compiled_functions_and_outside(found):
    ensemble = found[0].ensemble
    value, variance = jax.jit(lambda scatter: scatter.moments(quantities))(ensemble.scatter())
    assert np.sqrt(variance) == pytest.approx(np.linalg.norm(ensemble.project(quantities), axis=1), rel=1e-4)
    assert np.asarray(value) == pytest.approx(np.asarray(quantities(ensemble.model)), rel=1e-5)
    others = np.array([quantities(model) for model in ensemble.models()])
    assert np.mean((others - np.asarray(value)) ** 2, axis=0) == pytest.approx(np.asarray(variance), rel=1e-4)


def test_half_a_band_has_the_shape_of_what_it_is_of(found, noisy):
    result, _ = found
    laplace = dataclasses.replace(result, ensemble=None).posterior(noisy)
    assert result.posterior(noisy) is result.ensemble
    for posterior in (result.ensemble, laplace):
        band = posterior.half_width(lambda model: quantities(model)[:, None] * jnp.ones((3, 2)), level=0.8)
        rows = posterior.quantile(0.8) * np.linalg.norm(posterior.project(quantities), axis=1)
        assert band == pytest.approx(np.stack([rows, rows], axis=1))
    same = infer_posterior(result.model, noisy, STEPS, substeps=result.substeps)
    assert laplace.half_width(quantities) == pytest.approx(same.half_width(quantities))
    energy = laplace.half_width(lambda model: model.potential_energy(jnp.ones(1)))
    assert (energy.shape, energy > 0) == ((), True)


def test_too_few_members_leave_the_bands_to_laplace(found, noisy):
    result, _ = found
    for count in (0, 1):
        few = dataclasses.replace(result.ensemble, members=result.ensemble.members[:count])
        assert not isinstance(dataclasses.replace(result, ensemble=few).posterior(noisy), Ensemble)


def test_where_the_data_say_nothing_they_scatter_as_the_prior_does(noisy):
    idle = tuple(dataclasses.replace(recording, us=np.zeros_like(recording.us)) for recording in noisy.train)
    known = dataclasses.replace(noisy.known, input_matrix=None)
    dataset = dataclasses.replace(noisy, train=idle, known=known)
    result = fit(dataset, model=MODEL, config=STEPS, members=8)
    assert result.ensemble is not None

    def gain(model):
        return model.input_matrix(jnp.zeros(1)).ravel()

    told, said = (
        float(np.linalg.norm(each.project(gain)))
        for each in (result.ensemble, infer_posterior(result.model, dataset, STEPS))
    )
    assert 0.4 < told / said < 2.5  # 8 draws tell a standard deviation to 25 %


def test_members_go_through_adam_and_validation_and_keep_learned_priors(pendulum, small, quick, monkeypatch):
    begun = []
    real = _ensemble._Member._sought

    def sought(self, fresh):
        *_, (loss, model) = real(self, fresh)
        begun.append(model)
        yield loss, model

    monkeypatch.setattr(_ensemble._Member, "_sought", sought)
    result = fit(pendulum(count=4, samples=41), model=small, config=quick, members=2)
    ensemble = result.ensemble
    assert ensemble is not None
    assert len(begun) == ensemble.tried >= len(ensemble.members)
    starts = [Flattening.of(model, corrections=ensemble.corrections)[1] for model in begun]
    for start in starts:
        assert not np.allclose(start, ensemble.theta, rtol=1e-3)
    assert not np.allclose(starts[0], starts[1], rtol=1e-3)
    assert np.isfinite(ensemble.members).all()
    assert result.completed


@pytest.fixture
def prepared(pendulum):
    """What training with windows of three lengths begins with."""
    data = pendulum(count=20, samples=101)
    config = TrainingConfig(validation=0.0, adam_steps=0, lm_steps=3, lm_substeps=1, growth_steps=1, patience=1)
    with jax.enable_x64(True):
        return prepare(data, MODEL, config), config


def samples_of(stages):
    """Samples in windows of the stages that fit any."""
    return {k: each.data.train.ts.shape[1] for k, each in enumerate(stages) if isinstance(each, LevenbergStage)}


def test_members_begin_with_the_windows_of_all_stages_before_theirs(prepared):
    (stages, state, fresh, _), config = prepared
    lengths = {k: samples for k, samples in samples_of(stages).items() if not stages[k].regresses}
    assert len(set(lengths.values())) == 3
    for origin, length in lengths.items():
        pattern = _fit._pattern(stages, state._replace(origin=origin), fresh, config)
        shorter = sorted({each for each in lengths.values() if each < length})
        assert [windows.ts.shape[1] for windows in pattern.shorter] == shorter


def test_a_member_is_fitted_to_short_windows_before_its_own(prepared, monkeypatch):
    (stages, state, fresh, _), config = prepared
    seen = []
    real = LevenbergStage.step

    def step(self, state, restore, windows, **told):
        seen.append(windows.ts.shape)
        return real(self, state, restore, windows, **told)

    monkeypatch.setattr(LevenbergStage, "step", step)
    with jax.enable_x64(True):
        lengths = samples_of(stages)
        last = max(lengths, key=lambda k: lengths[k])
        state = stages[last].start(state)._replace(origin=last, stage=len(stages))
        pattern = _fit._pattern(stages, state, fresh, config)._replace(first=())
        train_members(pattern, 2, path=None, resume=False, watch=Stopwatch(None, ignore))
    shapes = [windows.ts.shape for windows in pattern.shorter] + [pattern.stage.data.train.ts.shape]
    assert len(shapes) == 3
    changes = [seen[0], *(after for before, after in itertools.pairwise(seen) if after != before)]
    assert changes == shapes * (len(changes) // 3)  # Each member begins anew.
    assert len(changes) >= 6


def test_few_models_make_wider_bands_than_many(found):
    ensemble = found[0].ensemble
    few = dataclasses.replace(ensemble, members=ensemble.members[:2])
    assert ensemble.quantile(0.9) == pytest.approx(student.ppf(0.95, 12))
    assert few.quantile(0.9) > 1.5 * ensemble.quantile(0.9) > 1.5 * 1.645


@pytest.mark.parametrize(
    ("rung", "kinds"),
    [(0, 0), (1, FRICTION), (2, FRICTION | DIRECTIONS), (3, FRICTION | DIRECTIONS | NETWORKS)],
)
def test_older_files_counted_the_rungs_that_were_free(small, tmp_path, rung, kinds):
    model = build(dataclasses.replace(small, knees=(0.1,)), Space.parse("T1"), 1, key=jax.random.key(0))
    theta = np.asarray(Flattening.of(model, corrections=kinds)[1], float)
    facts = {"tried": 2, "windows": 9, "corrections": rung}
    save_arrays(tmp_path / "e.safetensors", {"model": theta, "members": np.stack([theta, theta])}, facts)
    assert load_ensemble(tmp_path / "e.safetensors", model).corrections == kinds


def test_it_is_read_back_beside_its_own_model_alone(found, tmp_path):
    result, folder = found
    path = folder / "ensemble.safetensors"
    back = load_ensemble(path, result.model)
    assert np.array_equal(back.members, result.ensemble.members)
    assert np.linalg.norm(back.project(quantities)) == pytest.approx(
        np.linalg.norm(result.ensemble.project(quantities)), rel=1e-6
    )
    another = jax.tree.map(lambda x: 1.01 * x if isinstance(x, jax.Array) else x, result.model)
    with pytest.raises(StorageError, match="belongs to another"):
        load_ensemble(path, another)
    save_arrays(tmp_path / "other.safetensors", {"x": np.zeros(3)}, {})
    with pytest.raises(StorageError, match="must be an ensemble"):
        load_ensemble(tmp_path / "other.safetensors", result.model)
    (tmp_path / "cut.safetensors").write_bytes(path.read_bytes()[:-9])
    with pytest.raises(StorageError, match=r"whole safetensors file.* The model is whole: remove this file"):
        load_ensemble(tmp_path / "cut.safetensors", result.model)


def test_interrupted_and_resumed_it_is_the_same(found, noisy, tmp_path):
    class StopError(Exception):
        pass

    def stop(progress):
        if progress.stage == "model 3 of 4":
            raise StopError

    with pytest.raises(StopError):
        fit(noisy, model=MODEL, config=STEPS, folder=tmp_path, members=4, progress=stop)
    assert (tmp_path / "model.safetensors").is_file()
    seen = set()
    again = {"folder": tmp_path, "resume": True, "progress": lambda progress: seen.add(progress.stage)}
    resumed = fit(noisy, model=MODEL, config=STEPS, members=4, **again).ensemble
    assert seen == {"model 3 of 4", "model 4 of 4"}
    assert resumed is not None
    assert np.array_equal(resumed.members, found[0].ensemble.members[:4])


def test_what_ended_in_another_basin_is_no_member(noisy, monkeypatch):
    astray = {0, 2}

    def sought(self, fresh):
        wrong = self.number in astray
        monkeypatch.setattr(_ensemble._Member, "steps", 1 if wrong else 8)
        yield 1.0, jax.tree.map(lambda x: 3 * x if x.dtype.kind == "f" else x, fresh) if wrong else fresh

    monkeypatch.setattr(_ensemble._Member, "_sought", sought)
    ensemble = fit(noisy, model=MODEL, config=STEPS, members=2).ensemble
    assert isinstance(ensemble, Ensemble)
    assert (len(ensemble.members), ensemble.tried) == (2, 4)


def test_a_member_that_is_cut_short_by_the_limit_of_time_is_none(noisy, tmp_path):
    ended = fit(noisy, model=MODEL, config=STEPS, folder=tmp_path)
    assert ended.completed
    limited = fit(noisy, model=MODEL, config=STEPS, folder=tmp_path, resume=True, members=3, max_minutes=1e-4)
    assert limited.ensemble is not None
    assert (limited.completed, len(limited.ensemble.members), limited.ensemble.tried) == (False, 0, 0)
    assert limited.outcome.startswith("stopped at the time limit of 0.0001 minutes, with members still to come")
    assert jax.tree.all(jax.tree.map(np.array_equal, limited.model, ended.model))


@pytest.mark.parametrize(
    ("members", "change", "message"),
    [
        (1, {}, "must be 0, or at least 2"),
        (4, {"lm_steps": 0, "adam_steps": 1}, "need settings with Levenberg-Marquardt"),
        (4, {"lm_horizon": 50}, "5 windows or more"),
    ],
)
def test_members_that_could_not_tell_anything_are_refused(noisy, members, change, message):
    few = dataclasses.replace(noisy, train=noisy.train[:3])
    with pytest.raises(ValueError, match=message):
        fit(few, model=MODEL, config=dataclasses.replace(STEPS, **change), members=members)

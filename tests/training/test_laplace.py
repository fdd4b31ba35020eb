"""What a posterior says of parameters is how they scatter when the noise is drawn anew."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.blocks import FRICTION, NETWORKS, Constant, Correction, JointFriction, Sum, kinds_in_use
from symoden.data import Dataset, Trajectory
from symoden.known import KnownParts
from symoden.models import BlockConfig, ModelConfig, StructuredModel, build
from symoden.spaces import Space
from symoden.systems import Pendulum
from symoden.training import Laplace, TrainingConfig, _laplace, fit, infer_posterior
from symoden.training._flatten import Flattening
from symoden.training._laplace import _sandwich

CONSTANT = BlockConfig(constant=True)
SYSTEM = Pendulum(damping=0.2)
LOAD = float(SYSTEM.potential_energy(jnp.array([jnp.pi]))) / 2
MODEL = ModelConfig(inverse_mass=CONSTANT, potential=CONSTANT, actuation=CONSTANT, friction=CONSTANT, knees=())
STEPS = TrainingConfig(
    validation=0.0, adam_steps=0, lm_steps=6, lm_horizon=8, lm_substeps=2, growth_steps=0, relevance_steps=0
)
NOISE = 0.02


def identified(dataset: Dataset, seed: int) -> tuple[Any, Dataset]:
    """Load and damping from recordings with noise on the velocities that are predicted, not on those started from."""
    generator = np.random.default_rng(seed)

    def noisy(recording):
        q = (
            recording.q
            + NOISE * generator.normal(size=recording.q.shape) * (np.arange(len(recording)) % 8 > 0)[:, None]
        )
        return dataclasses.replace(recording, q=q)

    known = KnownParts(
        mass_matrix=[[float(SYSTEM.mass_matrix(jnp.zeros(1))[0, 0])]],
        potential_energy="-w*cos(q1)",
        input_matrix=[[1]],
        dissipation_matrix=[["d"]],
        parameters={"w": LOAD, "d": 0.2},
    )
    dataset = dataclasses.replace(dataset, train=tuple(map(noisy, dataset.train)), known=known)
    return fit(dataset, model=MODEL, config=STEPS).model, dataset


def test_parameters_scatter_as_their_posterior_says(pendulum):
    clean = pendulum(count=3, samples=41)
    found = [identified(clean, seed) for seed in range(16)]
    values = np.array([model.parameters.values for model, _ in found])
    posteriors = [infer_posterior(*pair, STEPS) for pair in found]
    rows = [posterior.project(lambda model: model.parameters.values) for posterior in posteriors]
    said = np.sqrt(np.mean(np.sum(np.square(rows), axis=2), axis=0))
    assert (np.abs(values.mean(axis=0) - [LOAD, 0.2]) < said).all()  # four standard errors of a mean of 16
    ratio = values.std(axis=0, ddof=1) / said
    assert (ratio > 0.55).all(), ratio  # 16 draws tell a standard deviation to 18 %
    assert (ratio < 1.8).all(), ratio
    assert posteriors[0].effective == pytest.approx(2.0, abs=0.01)
    assert posteriors[0].windows == 15


def test_quantities_vary_by_the_rule_of_the_chain(pendulum, monkeypatch):
    model, dataset = identified(pendulum(count=2, samples=25), 0)
    posterior = infer_posterior(model, dataset, STEPS)
    load, damping = posterior.project(lambda model: model.parameters.values)
    (energy,) = posterior.project(lambda model: model.potential_energy(jnp.array([2.0]))[None])
    assert energy == pytest.approx(-np.cos(2.0) * load, rel=1e-9)
    (product,) = posterior.project(lambda model: jnp.prod(model.parameters.values)[None])
    w, d = np.asarray(model.parameters.values)
    assert product == pytest.approx(d * load + w * damping, rel=1e-6)
    monkeypatch.setattr(_laplace, "_DEVIATIONS", 4000)
    value, variance = posterior.scatter().moments(lambda model: model.parameters.values)
    assert np.asarray(variance) == pytest.approx([load @ load, damping @ damping], rel=0.15)
    assert np.asarray(value) == pytest.approx([w, d])


@given(seed=st.integers(0, 2**32 - 1), prior=st.floats(0.1, 10.0), inflation=st.floats(1.0, 5.0))
def test_the_covariance_is_the_sandwich_but_no_less_than_of_independent_residuals(seed, prior, inflation):
    generator = np.random.default_rng(seed)
    J, scores = generator.normal(size=(5, 3, 4)) * [1.0, 2.0, 0.5, 0.0], generator.normal(size=(5, 4)) * [1, 1, 1, 0]
    variance, squares = 0.3, np.einsum("wri,wrj->ij", J, J)
    priors = prior * np.array([1.0, 30.0, 0.2, 4.0])
    bread = np.linalg.inv(squares / (inflation * variance) + np.diag(priors))

    def both(scores):
        factor, effective, _ = _sandwich(squares, scores, variance=variance, inflation=inflation, prior=priors)
        assert effective == pytest.approx(np.trace(bread @ squares) / (inflation * variance), rel=1e-9)
        filling = 5 / 4 * scores.T @ scores / (inflation * variance**2) + np.diag(priors)
        return factor @ factor.T, bread @ filling @ bread

    covariance, sandwich = both(scores)
    for least in (bread, sandwich):
        assert np.linalg.eigvalsh(covariance - least).min() > -1e-9 * np.abs(covariance).max()
    assert covariance[3, 3] == pytest.approx(1 / priors[3], rel=1e-9)  # Without information the prior.
    assert both(0 * scores)[0] == pytest.approx(bread, rel=1e-6, abs=1e-9 * np.abs(bread).max())
    large = 1e3 * np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [1, 1, 1, 1]])
    covariance, sandwich = both(large)
    assert covariance == pytest.approx(sandwich, rel=1e-6, abs=1e-9 * np.abs(sandwich).max())


def coverage(draw, *, recording=None, draws=200):
    """How often a band of 90 % covers what least squares find of the true numbers, which are zero."""
    covered, generator = [], np.random.default_rng(0)
    for _ in range(draws):
        J, y = draw(generator)
        squares = np.einsum("wrp,wrq->pq", J, J)
        found = np.linalg.solve(squares, np.einsum("wrp,wr->p", J, y))
        left = y - J @ found
        scores, prior = np.einsum("wrp,wr->wp", J, left), np.full(len(found), 1e-6)
        variance = float(np.mean(left**2))
        factor, effective, independent = _sandwich(
            squares, scores, variance=variance, inflation=1.0, prior=prior, recording=recording
        )
        posterior = Laplace(
            restore=lambda theta: theta,
            theta=found,
            windows=len(J),
            factor=factor,
            effective=effective,
            independent=independent,
        )
        covered.append(np.abs(found) <= posterior.quantile(0.9) * np.linalg.norm(factor, axis=1))
    return np.mean(covered, axis=0)


@pytest.mark.parametrize("windows", [5, 8, 20])
def test_bands_from_few_windows_cover_what_they_say(windows):
    def draw(generator):
        J = generator.normal(size=(windows, 30, 4))
        alike = 0.3 * generator.normal(size=(windows, 4))  # What is wrong with the model in each window.
        return J, np.einsum("wrp,wp->wr", J, alike) + 0.3 * generator.normal(size=(windows, 30))

    assert coverage(draw, draws=300).mean() == pytest.approx(0.9, abs=0.025)


@pytest.mark.parametrize("windows", [1, 2, 3, 5, 20])
def test_what_few_windows_tell_is_no_surer_than_they_make_it(windows):
    def draw(generator):
        J = generator.normal(size=(20, 50, 2))
        J[windows:, :, 1] = 0.0
        return J, generator.normal(size=(20, 50))

    covered = coverage(draw)
    assert (covered > 0.84).all()  # 0.05 of one window by the sandwich alone.
    assert (covered < 0.98).all()


@pytest.mark.parametrize("alike", [0.0, 1.0])
@pytest.mark.parametrize("each", [1, 5, 20])
def test_bands_are_as_wide_as_recordings_disagree(alike, each):
    def draw(generator):
        J, own = generator.normal(size=(8 * each, 30, 4)), alike * generator.normal(size=(8, 4))
        return J, np.einsum("wrp,wp->wr", J, np.repeat(own, each, axis=0)) + generator.normal(size=(8 * each, 30))

    covered = coverage(draw, recording=np.repeat(np.arange(8), each), draws=100).mean()
    assert 0.82 < covered < 0.97  # 0.28 of twenty windows if they were taken to be independent.


@pytest.mark.parametrize("logs", [3, 4, 6])
def test_few_logs_that_disagree_are_no_surer_than_they_make_it(logs):
    def draw(generator):
        J, own = generator.normal(size=(30 * logs, 20, 1)), generator.normal(size=(logs, 1))
        together = np.einsum("wrp,wp->wr", J, np.repeat(own, 30, axis=0))
        return J, together + generator.normal(size=(30 * logs, 20))

    covered = coverage(draw, recording=np.repeat(np.arange(logs), 30), draws=400).mean()
    assert covered == pytest.approx(0.89, abs=0.035)  # 0.76 of three with as many degrees of freedom as windows.


@pytest.mark.parametrize(("times", "wider"), [(0.5, 1.0), (3.0, 3.0)])
def test_errors_on_validation_data_widen_bands_where_they_are_larger_than_those_of_training(pendulum, times, wider):
    clean = pendulum(count=2, samples=25)
    model, dataset = identified(clean, 0)

    def erring(recording, true):
        return dataclasses.replace(recording, q=true.q + times * (recording.q - true.q), name=f"{recording.name} again")

    validation = tuple(map(erring, dataset.train, clean.train))
    posteriors = [
        infer_posterior(model, dataclasses.replace(dataset, validation=part), STEPS) for part in ((), validation)
    ]
    without, judged = (
        np.linalg.norm(posterior.project(lambda model: model.parameters.values), axis=1) for posterior in posteriors
    )
    assert judged == pytest.approx(wider * without, rel=0.2)  # The model is not quite the true one.


def test_errors_that_add_up_count_as_what_is_new_in_them_where_training_learns_priors():
    """A cart under forces of known pattern, and under others at random that were not recorded."""
    generator, dt, sigma, steps = np.random.default_rng(0), 0.05, 0.3, 160
    known = KnownParts(
        mass_matrix=[[1]],
        potential_energy=0,
        input_matrix=[["g"]],
        dissipation_matrix=[[0]],
        parameters={"g": 1.0},
    )

    def recording(k):
        us = generator.choice([-1.0, 1.0], size=(steps, 1))
        a = us + sigma * generator.normal(size=us.shape)
        rates = np.concatenate([[[0.0]], np.cumsum(dt * a, axis=0)])
        q = np.concatenate([[[0.0]], np.cumsum(dt * rates[:-1] + dt**2 / 2 * a, axis=0)])
        return Trajectory(
            name=f"run{k}", ts=dt * np.arange(steps + 1), q=q, rates=rates, us=np.append(us, us[-1:], axis=0)
        )

    dataset = Dataset(name="cart", space="R1", train=tuple(map(recording, range(25))), known=known)
    model = build(MODEL, Space.parse("R1"), 1, known=known, key=jax.random.key(0))
    plain, learning = (
        np.linalg.norm(infer_posterior(model, dataset, config).project(lambda model: model.parameters.values))
        for config in (dataclasses.replace(STEPS, lm_horizon=20, relevance_steps=count) for count in (0, 1))
    )
    least = sigma / np.sqrt(25 * steps)  # Of the regression of accelerations, whose errors are independent, on inputs.
    assert learning == pytest.approx(least, rel=0.2)
    assert plain > 2 * least


def test_rollouts_that_diverge_tell_nothing(pendulum, small, quick, scrambled):
    model = scrambled(build(small, Space.parse("T1"), 1, key=jax.random.key(0)), 1, 1e6)
    with pytest.raises(ValueError, match="need rollouts along the training recordings that stay finite"):
        infer_posterior(model, pendulum(), quick)


def test_it_takes_the_steps_that_training_found(pendulum):
    model, dataset = identified(pendulum(), 0)
    for steps in (1, 16):
        told = infer_posterior(model, dataset, STEPS, substeps=steps)
        same = infer_posterior(model, dataset, dataclasses.replace(STEPS, lm_substeps=steps))
        assert np.array_equal(told.factor, same.factor)
        assert not np.array_equal(told.factor, infer_posterior(model, dataset, STEPS).factor)
    with pytest.raises(ValueError, match="`substeps` must be at least 1, or None"):
        infer_posterior(model, dataset, STEPS, substeps=0)


def test_nothing_learned_leaves_nothing_uncertain(pendulum):
    known = KnownParts(mass_matrix=[[1]], potential_energy="-cos(q1)", input_matrix=[[1]], dissipation_matrix=[[0.2]])
    model = build(MODEL, Space.parse("T1"), 1, known=known, key=jax.random.key(0))
    with pytest.raises(ValueError, match=r"the model has 0\. All of it is given"):
        infer_posterior(model, pendulum(), STEPS)


def test_too_few_windows_are_refused(pendulum):
    model, dataset = identified(pendulum(count=2, samples=17), 0)
    with pytest.raises(ValueError, match=r"Bands need 5 windows of training data or more, .* there are 4"):
        infer_posterior(model, dataset, STEPS)


def test_corrections_that_were_never_free_are_no_part_of_it():
    silent, said = Correction(Constant(jnp.zeros(2))), Correction(Constant(jnp.ones(2)), kind=FRICTION)
    assert kinds_in_use(Sum((silent, said))) == FRICTION
    assert kinds_in_use(Sum((silent, Constant(jnp.ones(2))))) == 0
    assert kinds_in_use(Sum((said, Correction(Constant(jnp.ones(2)))))) == FRICTION | NETWORKS


def test_friction_may_differ_a_little_where_no_difference_between_the_directions_was_kept(pendulum):
    dataset = pendulum(count=2, samples=41)
    config = ModelConfig(inverse_mass=CONSTANT, potential=CONSTANT, actuation=CONSTANT, friction=CONSTANT)
    model = build(config, Space.parse("T1"), 1, key=jax.random.key(0))
    assert isinstance(model, StructuredModel)
    assert isinstance(model.friction, JointFriction)

    def posterior(laws, directions):
        where = lambda m: (m.friction.laws.function.values, m.friction.directions.function.values)
        values = (jnp.full(JointFriction.shapes(config.knees), laws), jnp.full(2, directions))
        return infer_posterior(eqx.tree_at(where, model, values), dataset, STEPS)

    without, even, kept = posterior(0.0, 0.0), posterior(0.2, 0.0), posterior(0.2, 0.1)
    assert even.theta.size == kept.theta.size == without.theta.size + JointFriction.shapes(config.knees) + 2
    assert isinstance(even.model, StructuredModel)
    assert isinstance(even.model.friction, JointFriction)
    whole = np.asarray(even.model.friction.whole_directions(jnp.zeros(1)))
    rows = [each.project(lambda m: m.friction.directions.function.values) for each in (even, kept)]
    narrow, wide = (np.linalg.norm(each, axis=1) for each in rows)
    assert (narrow < 0.3 * whole).all()
    assert (narrow > 1e-6 * whole).all()
    assert wide[1] > 3 * narrow[1]


@given(laws=st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3), v=st.floats(-3.0, 3.0))
@settings(max_examples=10)
def test_friction_that_is_rounded_off_may_be_as_much_more_as_its_law(laws, v):
    """Bands of D were nothing where laws were below zero, though a little more of one would lift it."""
    config = ModelConfig(inverse_mass=CONSTANT, potential=CONSTANT, actuation=CONSTANT, friction=CONSTANT, knees=(0.5,))
    model: Any = build(config, Space.parse("T1"), 1, key=jax.random.key(0))
    model = eqx.tree_at(lambda m: m.friction.laws.function.values, model, jnp.array(laws))
    restore, theta = Flattening.of(model, corrections=FRICTION, dtype=np.dtype(float))
    posterior = Laplace(
        restore=restore, theta=np.asarray(theta), windows=9, factor=np.eye(len(theta)), effective=1.0, independent=9
    )
    at = lambda m: m.dissipation_matrix(jnp.zeros(1), jnp.array([v]))
    (row,) = posterior.project(lambda m: jnp.ravel(at(m)))
    (scale,), (speed,) = (np.asarray(each.value) for each in (model.friction.scale, model.friction.speed))
    w = v / speed
    shapes = [1 / np.hypot(1, 2 * w), 1 / (1 + (2 * w) ** 2), np.hypot(1, w) - 1]
    viscous = float(model.friction.viscous(jnp.zeros(1))[0])
    assert sorted(row) == pytest.approx(
        sorted([*(scale**2 * np.array(shapes)), 2 * viscous * scale**2, *[0] * (len(row) - 4)])
    )
    assert float(at(posterior.model)[0, 0]) == pytest.approx(float(at(model)[0, 0]), rel=1e-12)


def test_models_too_large_for_it_are_refused(pendulum):
    large = ModelConfig(kind="unstructured", energy=(80, 80))
    model = build(large, Space.parse("T1"), 1, key=jax.random.key(0))
    with pytest.raises(ValueError, match="needs 1 to 4000 free parameters"):
        infer_posterior(model, pendulum(), STEPS)

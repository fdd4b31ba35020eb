"""What an independent residual is expected to vary by, and when starts are left where they were measured."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden import TrainingConfig, fit
from symoden.blocks import CORRECTIONS
from symoden.data import windows
from symoden.integrate import HOLDS, RK4
from symoden.models import build
from symoden.spaces import Space
from symoden.training import _level
from symoden.training._flatten import Flattening
from symoden.training._gauss_newton import NormalEquations
from symoden.training._level import expected_level, independent_variance, weigh
from symoden.training._objective import Batch, Objective
from symoden.training._weighing import Weighing

WEIGHTS = jnp.array([1.0, 0.5, 2.0])


@pytest.fixture
def problem(pendulum, small):
    """Windows that are rollouts of the model itself, with noise on every sample."""
    model = build(small, Space.parse("T1"), 1, key=jax.random.key(3))
    batch = Batch.of(windows(pendulum().train, 9, stride=9))
    plain = Objective(jnp.ones(3), RK4(), HOLDS["zero"])

    def measured(sigma, seed=0):
        generator = np.random.default_rng(seed)
        q, rates = np.array(batch.q), np.array(batch.rates)
        nothing = batch._replace(q=jnp.zeros_like(batch.q), rates=jnp.zeros_like(batch.rates))
        seen = np.asarray(jax.vmap(lambda window: plain.residuals(model, window))(nothing)) + np.array([1.0, 0.0, 0.0])
        q[:, 1:, 0], rates[:, 1:, 0] = np.arctan2(seen[:, :, 1], seen[:, :, 0]), seen[:, :, 2]
        q += sigma[0] * generator.normal(size=q.shape)
        rates += sigma[1] * generator.normal(size=rates.shape)
        start = np.concatenate([q[:, 0], rates[:, 0]], axis=1)
        return batch._replace(q=jnp.asarray(q), rates=jnp.asarray(rates), start=jnp.asarray(start))

    def level(sigma, batch, change=0.0):
        noise = jnp.array([sigma[0], sigma[0], sigma[1]])
        objective = Objective(WEIGHTS, RK4(), HOLDS["zero"], noise=noise)
        restore, theta = Flattening.of(model, corrections=CORRECTIONS)
        return expected_level(restore, theta * (1 + change), objective, RK4(), batch)

    return measured, level


def test_noise_alone_frees_the_starts_and_is_the_level(problem):
    measured, level = problem
    found = level((0.05, 0.05), measured((0.05, 0.05)))
    assert 0.04 < found < 0.25  # Weighted noise is 0.025 to 0.1.


def test_a_channel_without_noise_does_not_pin_the_others(problem):
    measured, level = problem
    assert level((0.0, 0.1), measured((0.0, 0.1))) < 0.4


def test_a_model_that_is_wrong_by_more_than_the_noise_pins_them(problem):
    measured, level = problem
    assert level((1e-4, 1e-4), measured((1e-4, 1e-4)), change=0.5) == math.inf
    levels = [level((0.05, 0.05), measured((0.05, 0.05)), change=change) for change in (0.0, 0.1, 0.2)]
    assert levels == sorted(levels)
    assert levels[0] < levels[-1]


@pytest.mark.parametrize("share", [0.1, 0.25, 0.4])
def test_what_fitting_many_parameters_has_used_up_is_not_taken_for_less_noise(share):
    generator, windows, samples = np.random.default_rng(0), 12, 10
    variances, losses = [], []
    for _ in range(50):
        J = 1e3 * generator.normal(size=(windows, samples, round(share * windows * samples)))
        rows, noise = J.reshape(windows * samples, -1), generator.normal(size=windows * samples)
        residuals = noise - rows @ np.linalg.lstsq(rows, noise)[0]
        scores = np.einsum("wkp,wk->wp", J, residuals.reshape(windows, samples))
        equations = NormalEquations(
            rows.T @ rows / len(rows),
            scores.sum(axis=0) / len(rows),
            residuals.reshape(windows, samples, 1),
            scores,
        )
        variances.append(independent_variance(equations))
        losses.append(equations.loss)
    assert np.mean(losses) == pytest.approx(1 - share, rel=0.08)
    assert np.mean(variances) == pytest.approx(1.0, rel=0.08)  # The noise's own.


def test_what_steps_have_still_to_take_off_is_no_scatter_of_windows():
    windows, samples = 40, 10
    noise = np.random.default_rng(0).normal(size=(windows, samples))
    residuals = noise + 1.0  # Of one parameter, of which J is one: its optimum is a unit away.
    scores = residuals.sum(axis=1, keepdims=True)
    equations = NormalEquations(np.ones((1, 1)), np.array([residuals.mean()]), residuals[..., None], scores)
    assert independent_variance(equations) == pytest.approx(equations.loss, rel=0.01)


def test_no_more_residuals_count_as_one_than_a_window_has(pendulum, small, monkeypatch):
    model = build(small, Space.parse("T1"), 1, key=jax.random.key(3))
    batch = Batch.of(windows(pendulum().train, 9, stride=9))
    problem = Objective(WEIGHTS, RK4(), HOLDS["zero"]), RK4(), batch, Weighing.plain(3)
    for effect, counted in ((5.0, 5.0), (1e9, 9 * 3)):
        monkeypatch.setattr(_level, "independent_variance", lambda found, effect=effect: effect * found.loss)
        assert float(weigh(*Flattening.of(model, corrections=0), *problem).effect) == pytest.approx(counted)


def test_they_stay_as_measured_where_nothing_can_be_told(problem):
    measured, level = problem
    batch = measured((0.05, 0.05))
    assert level((0.05, 0.05), batch.take(slice(0, 4))) == math.inf
    assert level((0.05, 0.05), batch._replace(q=batch.q * 1e200, rates=batch.rates * 1e200)) == math.inf


def test_noisy_training_goes_on_bit_for_bit_with_its_level(pendulum, small, tmp_path):
    generator = np.random.default_rng(0)
    clean = pendulum()
    noisy = tuple(
        dataclasses.replace(
            each,
            q=each.q + 0.05 * generator.normal(size=each.q.shape),
            rates=each.rates + 0.05 * generator.normal(size=each.rates.shape),
        )
        for each in clean.train
    )
    dataset = dataclasses.replace(clean, train=noisy)
    config = TrainingConfig(adam_steps=100, restarts=1, lm_steps=3, growth_steps=2, relevance_steps=0, patience=9)
    seen = []

    def interrupted(progress):
        seen.append(progress)
        if progress.stage == "friction" and progress.step == 1:
            raise KeyboardInterrupt

    small = dataclasses.replace(small, knees=(0.1,))
    whole = fit(dataset, model=small, config=config)
    with pytest.raises(KeyboardInterrupt):
        fit(dataset, model=small, config=config, folder=tmp_path, progress=interrupted)
    again = fit(dataset, model=small, config=config, folder=tmp_path, resume=True)
    assert again.loss == whole.loss
    leaves = zip(jax.tree.leaves(again.model), jax.tree.leaves(whole.model), strict=True)
    assert all(np.array_equal(a, b) for a, b in leaves)

"""Errors that follow each other count as what is new in them."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import CORRECTIONS
from symoden.data import windows
from symoden.integrate import HOLDS, RK4
from symoden.models import build
from symoden.spaces import Space
from symoden.training._flatten import Flattening
from symoden.training._gauss_newton import Linearization, linearize
from symoden.training._level import independent_variance, weigh
from symoden.training._objective import Batch, Objective
from symoden.training._weighing import Weighing, Whitening, fit_whitening

SEEDS = (0, 1, 2)


def autoregression(generator, channels):
    """Lags of a stable process, and what mixes its innovations."""
    rotation = np.linalg.qr(generator.normal(size=(channels, channels)))[0]
    first, second = (
        rotation @ np.diag(generator.uniform(*ends, channels)) @ rotation.T for ends in ((0.6, 1.2), (-0.4, 0))
    )
    mixing = np.eye(channels) + 0.3 * np.tril(generator.normal(size=(channels, channels)))
    return np.stack([first, second - 0.1 * np.eye(channels)]), mixing


def errors_of(generator, lags, mixing, *, windows=400, samples=30):
    """Errors of windows that start from nothing."""
    found = np.zeros((windows, samples + 2, len(mixing)))
    for k in range(2, samples + 2):
        found[:, k] = sum(found[:, k - 1 - j] @ lag.T for j, lag in enumerate(lags))
        found[:, k] += generator.normal(size=(windows, len(mixing))) @ mixing.T
    return found[:, 2:]


def whiten(whitening, errors):
    return np.asarray(jax.vmap(whitening)(jnp.asarray(errors)))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_law_by_which_errors_follow_each_other_is_found(seed):
    generator = np.random.default_rng(seed)
    lags, mixing = autoregression(generator, 3)
    errors = errors_of(generator, lags, mixing, windows=1000)
    whitening = fit_whitening(errors)
    assert np.asarray(whitening.lags) == pytest.approx(lags, abs=0.06)
    news = whiten(whitening, errors)
    square = np.mean(errors**2)
    assert np.mean(news**2) == pytest.approx(square, rel=1e-9)
    covariance = np.einsum("wka,wkb->ab", news, news) / (news[..., 0].size * square)
    assert covariance == pytest.approx(np.eye(3), abs=0.02)
    following = np.einsum("wka,wkb->ab", news[:, 1:], news[:, :-1]) / (news[..., 0].size * square)
    assert following == pytest.approx(np.zeros((3, 3)), abs=0.03)


@pytest.mark.parametrize("seed", SEEDS)
def test_what_was_estimated_from_other_channels_is_no_news(seed):
    generator = np.random.default_rng(seed)
    errors = errors_of(generator, *autoregression(generator, 3), windows=50)
    news = whiten(fit_whitening(errors, jnp.array([1.0, 0.0, 1.0])), errors)
    measured = errors[:, :, ::2]
    assert news[..., ::2] == pytest.approx(whiten(fit_whitening(measured), measured), rel=1e-9)
    assert not news[..., 1].any()


def test_it_does_not_matter_how_large_errors_are():
    generator = np.random.default_rng(0)
    errors = errors_of(generator, *autoregression(generator, 2))
    news = [whiten(fit_whitening(x), x) / np.sqrt(np.mean(x**2)) for x in (errors, 1e3 * errors)]
    assert news[0] == pytest.approx(news[1], rel=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_whitening_is_linear_so_that_derivatives_are_whitened_alike(seed):
    generator = np.random.default_rng(seed)
    lags, scale = generator.normal(size=(2, 3, 3)), generator.normal(size=(3, 3))
    whitening = Whitening(jnp.asarray(lags), jnp.asarray(scale))
    errors, J = jnp.asarray(generator.normal(size=(9, 3))), jnp.asarray(generator.normal(size=(9, 3, 4)))
    step = jnp.asarray(generator.normal(size=4))
    moved = whitening(errors + J @ step) - whitening(errors)
    assert np.asarray(moved) == pytest.approx(np.asarray(whitening(J) @ step), abs=1e-12)


@pytest.mark.parametrize("shape", [(7, 3), (1, 3), (7, 3, 2)])
def test_none_changes_no_bit(shape):
    errors = jnp.asarray(np.random.default_rng(0).normal(size=shape))
    assert np.array_equal(Whitening.none(3)(errors), errors)


@pytest.mark.parametrize(
    "errors",
    [
        np.zeros((50, 9, 2)),
        np.full((50, 9, 2), np.nan),
        np.full((50, 9, 2), 1e200),
        np.ones((2, 9, 2)),
        np.random.default_rng(0).normal(size=(300, 2, 2)),
        np.random.default_rng(0).normal(size=(60, 9, 2)) * np.where(np.arange(60) == 7, 1e5, 1)[:, None, None],
        np.ones((0, 9, 2)),
    ],
    ids=["exact", "nan", "huge", "few", "short", "one astray", "none"],
)
def test_nothing_is_whitened_where_errors_tell_nothing(errors):
    found = fit_whitening(errors)
    assert np.array_equal(found.lags, np.zeros((2, 2, 2)))
    assert np.array_equal(found.scale, np.eye(2))


@pytest.mark.parametrize("still", [0.0, 1e-12])
def test_a_channel_without_errors_does_not_outweigh_the_others(still):
    generator = np.random.default_rng(0)
    errors = generator.normal(size=(100, 20, 2)) * np.array([1.0, still])
    assert 1 < np.abs(fit_whitening(errors).scale).max() < 200 * np.abs(fit_whitening(errors).scale[0, 0])


def test_estimates_from_errors_that_add_up_vary_less():
    """What a start is off by, beside forces at random that push the rollout away from it."""
    generator = np.random.default_rng(0)
    J = np.ones((30, 1))
    estimates = {"ordinary": [], "generalised": []}
    for _ in range(200):
        errors = np.cumsum(generator.normal(size=(40, 30, 1)), axis=1)
        news, slopes = whiten(fit_whitening(errors), errors), np.asarray(fit_whitening(errors)(jnp.asarray(J)))
        estimates["ordinary"].append((errors.sum(axis=0) * J).sum() / (40 * (J**2).sum()))
        estimates["generalised"].append((news.sum(axis=0) * slopes).sum() / (40 * (slopes**2).sum()))
    assert np.std(estimates["generalised"]) == pytest.approx(1 / math.sqrt(40), rel=0.15)  # The least of all.
    assert np.std(estimates["ordinary"]) > 2 * np.std(estimates["generalised"])


@pytest.fixture
def pushed(pendulum, small):
    """A model, and windows in which it is pushed by random forces that it does not know."""
    model = build(small, Space.parse("T1"), 1, key=jax.random.key(3))
    data = pendulum(count=30)
    batch = Batch.of(windows(data.train, 9, stride=9))
    objective = Objective(jnp.array([1.0, 0.5, 2.0]), RK4(), HOLDS["zero"])
    generator = np.random.default_rng(0)
    forces = 0.3 * generator.normal(size=batch.us.shape)
    shaken = batch._replace(us=batch.us + jnp.asarray(forces))
    nothing = shaken._replace(q=jnp.zeros_like(batch.q), rates=jnp.zeros_like(batch.rates))
    seen = np.asarray(jax.vmap(lambda window: objective.residuals(model, window))(nothing)) / np.array([1.0, 0.5, 2.0])
    q, rates = np.array(batch.q), np.array(batch.rates)
    q[:, 1:, 0], rates[:, 1:, 0] = np.arctan2(seen[:, :, 1], 1 + seen[:, :, 0]), seen[:, :, 2]
    return model, objective, batch._replace(q=jnp.asarray(q), rates=jnp.asarray(rates))


def test_sensitivities_are_whitened_as_the_residuals_are(pushed):
    model, objective, batch = pushed
    restore, theta = Flattening.of(model, corrections=CORRECTIONS)
    weighing = weigh(restore, theta, objective, RK4(), batch, Weighing.plain(3))
    whitened = objective.refined(RK4(), weighing)
    window = jax.tree.map(lambda x: x[0], batch)
    r, J = linearize(restore, theta, whitened, window)
    residuals, jacobian = (
        f(theta)
        for f in (
            lambda x: whitened.residuals(restore(x), window).ravel(),
            jax.jacfwd(lambda x: whitened.residuals(restore(x), window).ravel()),
        )
    )
    assert np.asarray(r) == pytest.approx(np.asarray(residuals), abs=1e-12)
    assert np.asarray(J) == pytest.approx(np.asarray(jacobian), abs=1e-10 * (1 + np.abs(jacobian).max()))
    assert np.abs(np.asarray(r) - np.asarray(objective.residuals(model, window)).ravel()).max() > 1e-3


def test_random_forces_make_residuals_alike_and_whitening_undoes_it(pushed):
    model, objective, batch = pushed
    restore, theta = Flattening.of(model, corrections=0)
    weighing = weigh(restore, theta, objective, RK4(), batch, Weighing.plain(3))
    plain = Linearization.at(restore, theta, objective.refined(RK4(), Weighing.plain(3)), batch).normal_equations()
    alike = independent_variance(plain) / plain.loss
    assert float(weighing.effect) < 0.6 * alike


def test_estimated_starts_leave_errors_as_they_are(pushed):
    model, objective, batch = pushed
    restore, theta = Flattening.of(model, corrections=0)
    noisy = dataclasses.replace(objective, noise=jnp.full(3, 0.1))
    weighing = weigh(restore, theta, noisy, RK4(), batch, Weighing.plain(3, 0.3))
    assert np.array_equal(weighing.whitening.scale, np.eye(3))
    assert float(weighing.level) == 0.3


def test_a_handful_of_windows_or_a_model_that_diverges_tells_nothing(pushed):
    model, objective, batch = pushed
    restore, theta = Flattening.of(model, corrections=0)
    few = weigh(restore, theta, objective, RK4(), batch.take(slice(0, 4)), Weighing.plain(3))
    lost = weigh(restore, theta, objective, RK4(), batch._replace(rates=batch.rates * 1e200), Weighing.plain(3))
    for each in (few, lost):
        assert np.array_equal(each.whitening.scale, np.eye(3))
        assert float(each.effect) == 1

"""Where nothing pulls there is no potential, and where joints carry each other evenly M is the same everywhere."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.integrate import rollout
from symoden.known import KnownParts
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space
from symoden.training import fit
from symoden.training._beginnings import Uniform
from symoden.training._flatten import Flattening
from symoden.training._gauss_newton import NormalEquations
from symoden.training._levenberg_marquardt import CLOSED
from symoden.training._relevance import Relevance
from symoden.training._residuals import evaluate_loss, evaluate_residuals
from symoden.training._state import Incumbent, TrainingState
from symoden.training._verdicts import Judge, Skipped, Verdict, by_price, by_windows
from symoden.training._weighing import Weighing

MODEL = ModelConfig(
    inverse_mass=BlockConfig(harmonics=True),
    potential=BlockConfig(harmonics=True),
    friction=BlockConfig(constant=True),
    knees=(),
)
PARTS = ("potential", "inverse_mass")


def redrawn(model, seed):
    """A model with other weights everywhere."""
    restore, theta = Flattening.of(model, corrections=0)
    return restore(jnp.asarray(np.random.default_rng(seed).normal(size=theta.size)))


def trained(model, memory=None):
    """A state of training whose best model this is."""
    plain = Weighing.plain(1)
    return TrainingState(
        stage=0,
        step=0,
        model=model,
        memory=memory,
        damping=1e-4,
        substeps=1,
        weighing=plain,
        best=model,
        best_loss=1.0,
        origin=0,
        stale=0,
        incumbent=Incumbent(model, None, 0, plain, rival=model),
    )


@settings(max_examples=15)
@given(
    seed=st.integers(0, 1000),
    space=st.sampled_from(["R2", "T2", "R1 T1", "T1"]),
    part=st.sampled_from(PARTS),
    q=st.lists(st.floats(-3, 3), min_size=4, max_size=4),
)
def test_a_uniform_part_is_the_same_everywhere_and_all_else_as_it_was(seed, space, part, q):
    model: Any = redrawn(build(MODEL, Space.parse(space), 1, key=jax.random.key(seed)), seed)
    size = model.space.size
    here, there = jnp.array(q[:size]), jnp.array(q[2 : 2 + size])
    found: Any = model if not Uniform(part).has(model) else Uniform(part).model(trained(model), lambda _: 0.0)
    if Uniform(part).has(model):
        value = found.potential if part == "potential" else found.mass_matrix
        np.testing.assert_allclose(value(here), value(there), rtol=1e-9)
    other = model.mass_matrix if part == "potential" else model.potential
    kept = found.mass_matrix if part == "potential" else found.potential
    np.testing.assert_array_equal(other(here), kept(here))
    assert Uniform(part).applies(trained(model)) == Uniform(part).has(model)
    memory = Relevance.start(model, 1.0)
    assert Uniform(part).applies(trained(model, memory)) == Uniform(part).has(model)
    assert not Uniform(part).applies(trained(found, Uniform(part).priors(memory)))


@pytest.mark.parametrize("part", PARTS)
def test_what_is_closed_is_not_learned_and_all_else_is(part):
    model = build(MODEL, Space.parse("T2"), 2, key=jax.random.key(0))
    _, theta = Flattening.of(model, corrections=0)
    before = Uniform(part).priors(Relevance.start(model, 1.0))
    closed = before.precisions(model, 0) == CLOSED
    generator = np.random.default_rng(0)
    X = generator.normal(size=(20, 2 * theta.size, theta.size))
    r = generator.normal(size=X.shape[:2]) - X @ np.ones(theta.size)
    flat, scores = X.reshape(-1, theta.size), np.einsum("wrp,wr->wp", X, r)
    equations = NormalEquations(flat.T @ flat / r.size, scores.sum(axis=0) / r.size, r, scores)
    after = before.learn(equations, np.where(closed, 0.0, 1.0), model, 0).precisions(model, 0)
    assert 0 < closed.sum() < theta.size
    np.testing.assert_array_equal(after == CLOSED, closed)
    assert np.all(after[~closed] != 1.0)


def test_parts_that_do_not_depend_on_anything_cannot_be_closed():
    lengths = build(MODEL, Space.parse("R2"), 2, key=jax.random.key(0))
    assert [Uniform(part).has(lengths) for part in PARTS] == [True, False]  # M of lengths is constant.
    arm: Any = build(MODEL, Space.parse("T2"), 2, key=jax.random.key(0))
    assert [Uniform(part).has(arm) for part in PARTS] == [True, True]
    known = KnownParts(potential_energy="cos(q1)")
    weighed: Any = build(MODEL, Space.parse("T2"), 2, known=known, key=jax.random.key(0))
    assert [Uniform(part).has(weighed) for part in PARTS] == [False, True]
    structureless = build(dataclasses.replace(MODEL, kind="unstructured"), Space.parse("T2"), 2, key=jax.random.key(0))
    assert not any(Uniform(part).has(structureless) for part in PARTS)


@pytest.mark.parametrize("stiffness", [0.0, pytest.param(4.0, marks=pytest.mark.slow)])
def test_a_motor_has_no_potential_and_a_spring_has_one(stiffness, driven, second_order):
    def accelerate(q, v, u):
        return (u - 0.3 * v - stiffness * q) / 0.5

    dataset = driven(accelerate, [0.3], space="R1", input_matrix=np.eye(1), noise=0.002)
    result = fit(dataset, model=MODEL, config=second_order)
    model: Any = result.model
    assert result.verdicts["no potential"].startswith("not kept" if stiffness else "kept")
    for q in (-0.3, 0.2):
        force = float(jax.grad(model.potential)(jnp.array([q]))[0])
        assert force == pytest.approx(stiffness * q, abs=0.1 if stiffness else 1e-6)


M = np.array([[0.5, 0.1], [0.1, 0.2]])


def pair(bends):
    """A pendulum that carries another joint, which bends it or, as a wheel does, turns with it."""

    def inertia(q):
        return M + 0.15 * bends * np.cos(q[1]) * np.array([[2.0, 1.0], [1.0, 0.0]])

    def accelerate(q, v, u):
        sine = 0.15 * bends * np.sin(q[1])
        coriolis = sine * np.array([-2 * v[0] * v[1] - v[1] ** 2, v[0] ** 2])
        forces = u - 0.2 * v - np.array([2.0 * np.sin(q[0]), 0.0])
        return np.linalg.solve(inertia(q), forces - coriolis)

    return inertia, accelerate


@pytest.mark.parametrize("bends", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_wheel_leaves_the_inertia_constant_and_an_elbow_does_not(bends, driven, second_order):
    inertia, accelerate = pair(bends)
    dataset = driven(accelerate, [0.3, 0.0], space="T2", input_matrix=np.eye(2), noise=0.002)
    result = fit(dataset, model=MODEL, config=second_order)
    model: Any = result.model
    assert result.verdicts["constant inertia"].startswith("not kept" if bends else "kept")
    assert result.verdicts["no potential"].startswith("not kept")
    for q in ([0.5, 1.0], [-0.4, -0.3]):
        assert np.asarray(model.mass_matrix(jnp.array(q))) == pytest.approx(inertia(q), abs=0.02)


@pytest.mark.parametrize("closes", [False, True])
def test_few_windows_that_refuse_to_close_something_do_not_ask_for_more_data(closes):
    verdict = Verdict(Judge.VALIDATION, 1.2, 1.0, windows=2, gained=-0.5, wanted=0.0, closes=closes)
    assert verdict.hardly != closes
    assert not verdict.kept


@pytest.mark.parametrize("windows", [5, 20, 60])
@pytest.mark.parametrize("closes", [False, True])
def test_what_one_window_misses_is_not_closed(windows, closes):
    before = np.full(windows, 1e-3)
    here = before.copy()
    here[0] = 1.0
    verdict = by_windows(Judge.VALIDATION, here, before, wanted=-1.0)._replace(closes=closes)
    assert verdict.gained > -1.0  # Of one window that differs Student's t is 1, however much it does.
    assert verdict.kept != closes
    assert not closes or "more than 1.25 times as much" in str(verdict)


def test_what_training_windows_miss_is_not_closed(stage):
    stage, state = stage
    data = stage.data._replace(validation=stage.data.train)
    restore, theta = Flattening.of(state.model, corrections=0)
    losses = {evaluate_loss(each, data.objective, data.train): each for each in (state.model, restore(2.0 * theta))}
    least, most = sorted(losses)
    better, worse = losses[least], losses[most]
    assert most > 1.3 * least
    assert by_price(data, better, worse, data.objective, wanted=-1.0) is None
    refused = by_price(data, worse, better, data.objective, wanted=-1.0)
    assert refused is not None
    assert (refused.by, refused.kept, refused.loss) == (Judge.TRAINING, False, most)


def test_nothing_is_closed_of_a_model_that_is_exact(stage):
    stage, state = stage
    model: Any = build(MODEL, Space.parse("T1"), 1, key=jax.random.key(0))
    closing = dataclasses.replace(stage, begins=Uniform("potential"), margin=-1.0)
    began = closing.start(state._replace(model=model, best=model, best_loss=9e-7))
    assert began.best_loss > 1e-6  # Of data that it does not explain.
    exact = data_of(model, stage.data)
    began = dataclasses.replace(closing, data=exact).start(state._replace(model=model, best=model, best_loss=9e-7))
    assert began.best_loss < 1e-6
    _, report = dataclasses.replace(closing, data=exact).advance(began)
    assert report.verdict == Skipped("nothing left to explain")


def data_of(model, data):
    """Windows that a model explains."""
    residuals = evaluate_residuals(model, data.objective, data.train)
    assert np.max(np.abs(residuals)) > 1e-3
    batch = data.train

    def rolled(q0, v0, ts, us):
        path = rollout(model, q0, v0, ts, us, solver=data.objective.solver)
        return path.q, path.rates

    q, rates = jax.vmap(rolled)(batch.q[:, 0], batch.rates[:, 0], batch.ts, batch.us)
    return data._replace(train=batch._replace(q=q, rates=rates))


@pytest.mark.slow
def test_what_is_closed_stays_so_through_priors_that_are_learned_and_longer_windows(driven, second_order):
    def accelerate(q, v, u):
        return (u - 0.3 * v - 0.4 * v / np.sqrt(v**2 + 0.01**2)) / 0.5

    dataset = driven(accelerate, [0.3], space="R1", input_matrix=np.eye(1), noise=0.002, amplitude=2.0)
    config = dataclasses.replace(second_order, relevance_steps=8, lm_horizon=None)
    model: Any
    result = fit(dataset, model=dataclasses.replace(MODEL, knees=(0.01, 0.1)), config=config)
    model = result.model
    assert result.verdicts["no potential"].startswith("kept")
    assert "relevance" in result.verdicts
    for q in (-0.5, 0.2, 5.0):
        assert float(jax.grad(model.potential)(jnp.array([q]))[0]) == pytest.approx(0, abs=1e-8)


@pytest.mark.parametrize("margin", [None, -1.0])
def test_rollouts_have_all_open_that_a_regression_has_closed(stage, margin):
    stage, state = stage
    model = build(MODEL, Space.parse("T1"), 1, key=jax.random.key(0))
    memory = Uniform("potential").priors(Relevance.start(model, 2.0))
    began = dataclasses.replace(stage, margin=margin).start(state._replace(model=model, best=model, memory=memory))
    closed = began.memory.precisions(model, 0) == CLOSED
    np.testing.assert_array_equal(closed, (margin is not None) & (memory.precisions(model, 0) == CLOSED))
    assert np.all(began.memory.precisions(model, 0)[~closed & (memory.precisions(model, 0) < CLOSED)] == 2.0)

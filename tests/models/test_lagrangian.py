"""Lagrange's equations beside Hamilton's: the same motion, and the same derivatives as by plain differentiation."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import CORRECTIONS
from symoden.integrate import HOLDS, RK4
from symoden.known import Body, KnownParts, Robot
from symoden.models import BlockConfig, Lagrangian, ModelConfig, build, lagrangian
from symoden.spaces import Space
from symoden.training._flatten import Flattening, cast
from symoden.training._gauss_newton import linearize
from symoden.training._objective import Batch, Objective
from symoden.training._residuals import evaluate_loss
from symoden.training._weak_form import WeakForm

SMALL = BlockConfig(hidden=(3,))
LEARNED = ModelConfig(inverse_mass=BlockConfig(hidden=(3,), harmonics=True), potential=SMALL, actuation=SMALL)


def robot():
    """Three joints of a tree, one of which slides; their coordinates are in another order."""
    generator = np.random.default_rng(0)
    bodies = []
    for k in range(3):
        points = generator.normal(size=(10, 4)) * [0.1, 0.2, 0.05, 0] + [*generator.normal(size=3) * 0.1, 1]
        frame = np.eye(4)
        frame[:3, :3] = np.linalg.qr(generator.normal(size=(3, 3)))[0]
        frame[:3, 3] = 0.3 * generator.normal(size=3)
        axis = generator.normal(size=3)
        matrices = (tuple(map(tuple, each.tolist())) for each in (frame, 0.1 * points.T @ points))
        origin, inertia = matrices
        bodies.append(
            Body(
                joint=f"j{k}",
                coordinate=(1, 2, 0)[k],
                parent=(-1, 0, 0)[k],
                prismatic=k == 2,
                axis=tuple((axis / np.linalg.norm(axis)).tolist()),
                origin=origin,
                inertia=inertia,
            )
        )
    return Robot(bodies=tuple(bodies), gravity=(0.3, -0.2, -9.7))


def made(name, config=LEARNED):
    space = Space.parse("R1 T2")
    formula = "(2 + a) * (1 + 0.1 * sin(q2)) + a * q1**2"
    known = {
        "robot": KnownParts(robot=robot()),
        "formulas": KnownParts(
            mass_matrix=[[formula, "0", "0.1"], ["0", "3", "0"], ["0.1", "0", "1"]],
            potential_energy="a * cos(q3)",
            parameters={"a": 0.5},
        ),
        "corrected": KnownParts(robot=robot(), correct=("mass_matrix", "potential_energy")),
        "cyclic": KnownParts(cyclic=("q2",)),
    }
    return build(config, space, 2, known=known.get(name), key=jax.random.key(0))


NAMES = ("learned", "robot", "formulas", "corrected", "cyclic")


@pytest.fixture(params=NAMES)
def model(request, scrambled):
    return scrambled(made(request.param), 1, 0.3)


def state(seed):
    q, p = np.random.default_rng(seed).normal(size=(2, 3))
    return jnp.asarray([*q, *p]), jnp.asarray(np.random.default_rng(seed).normal(size=2))


def close(found, expected, accuracy=1e-10):
    assert np.asarray(found) == pytest.approx(np.asarray(expected), abs=accuracy * (1 + np.abs(expected).max()))


def test_the_equations_of_motion_are_those_of_hamilton(model):
    other = lagrangian(model)
    assert isinstance(other, Lagrangian)
    for seed in range(3):
        x, u = state(seed)
        close(other.derivative(0.0 * x[0], x, u), model.derivative(0.0 * x[0], x, u))
        close(other.observe(x), model.observe(x))
        close(other.encode(*jnp.split(x, 2)), model.encode(*jnp.split(x, 2)))


def test_the_derivative_by_the_state_is_that_of_plain_differentiation(model):
    for seed in range(3):
        x, u = state(seed)
        plain = jax.jacfwd(lambda x, u=u: model.derivative(0.0 * x[0], x, u))(x)
        close(lagrangian(model).linearize(x, u)[0], plain)


@pytest.mark.parametrize(
    ("name", "free"), [*((name, False) for name in (*NAMES, "momenta")), ("learned", True), ("momenta", True)]
)
def test_the_jacobian_of_a_window_is_that_of_plain_differentiation(name, free, scrambled):
    if name == "momenta":
        model = build(LEARNED, Space.parse("R1 T2"), 2, momenta=True, key=jax.random.key(1))
    else:
        model = scrambled(made(name), 1, 0.3)
    generator = np.random.default_rng(2)
    ts = jnp.asarray(np.cumsum(generator.uniform(0.01, 0.03, 5)))
    q, rates, us = (jnp.asarray(generator.normal(size=(5, k))) for k in (3, 3, 2))
    window = Batch(ts - ts[0], q, rates, us, jnp.concatenate([q[0], rates[0]]))
    channels = model.space.embedded_size + 3
    weights = jnp.asarray(generator.uniform(1, 2, channels))
    solver = RK4(jnp.asarray(3))
    objective = Objective(weights, solver, HOLDS["linear"])
    if free:
        noise, level = jnp.full(channels, 0.1), jnp.asarray(0.2)
        objective = Objective(weights, solver, HOLDS["linear"], noise=noise, level=level)
    restore, theta = Flattening.of(model, corrections=CORRECTIONS)

    def residuals(theta, start):
        return objective.residuals(restore(theta), window._replace(start=start)).ravel()

    r, J = jax.jit(lambda theta: linearize(restore, theta, objective, window))(theta)
    by_theta, by_start = jax.jit(jax.jacfwd(residuals, argnums=(0, 1)))(theta, window.start)
    if free:  # Starts follow the parameters.
        Q = np.linalg.qr(by_start)[0]
        by_theta = by_theta - Q @ (Q.T @ by_theta)
    close(r, residuals(theta, window.start), 1e-12)
    close(J, by_theta, 1e-9)
    assert np.abs(by_theta).max() > 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_it_runs_in_the_precision_of_its_numbers(name, scrambled):
    x, u = state(0)
    model = scrambled(made(name), 1, 0.3)
    single, double = (cast((lagrangian(model), 0 * x[0], x, u), dtype) for dtype in (jnp.float32, jnp.float64))
    other: Any = lagrangian(cast(model, jnp.float32))
    slope = other.derivative(*single[1:])
    assert slope.dtype == jnp.float32
    close(slope, model.derivative(*double[1:]), 1e-3)


def test_a_regression_of_the_equations_of_motion_asks_for_the_energy(model):
    generator = np.random.default_rng(3)
    ts, channels = 0.02 * jnp.arange(9.0), model.space.size
    q, rates, us = (jnp.asarray(generator.normal(size=(1, 9, k))) for k in (3, 3, 2))
    batch = Batch(ts[None], q, rates, us, jnp.concatenate([q[:, 0], rates[:, 0]], axis=1))
    loss = evaluate_loss(model, WeakForm(jnp.ones(channels), HOLDS["zero"]), batch)
    assert np.isfinite(loss)


def test_other_models_stay_as_they_are():
    full = made("learned", ModelConfig(full_friction=True, knees=()))
    inverse = made("learned", ModelConfig(inverse_mass=SMALL))
    geometric = made("learned", ModelConfig(kind="geometric"))
    few = build(LEARNED, Space.parse("T2"), 2, key=jax.random.key(0))
    for each in (full, inverse, geometric, few):
        assert lagrangian(each) is each

"""Simulation: against textbook equations by SciPy, closed forms, conservation, determinism."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from symoden.experiments import TASKS, simulate, task
from symoden.systems import Acrobot, CartPole, Pendulum

FEW = {"train_initials": 3, "test_initials": 2}


def canonical_pendulum(x, u):
    """The paper's equations in q and p."""
    q, p = x
    return [3 * p, -5 * np.sin(q) - 0.1 * 3 * p + u[0]]


def upright_pendulum(x, u):
    """Gymnasium's equation, with friction 0.1 N m s at the hinge."""
    angle, rate = x
    return [rate, 15 * np.sin(angle) + 3 * u[0] - 0.3 * rate]


def cart_pole(x, u):
    """Barto, Sutton & Anderson (1983), with friction of the pole and a torque at the hinge."""
    force, torque = (*u, 0.0)[:2]
    _, angle, speed, rate = x
    mass, pole, length, sin, cos = 1.0, 0.5, 0.5, np.sin(angle), np.cos(angle)
    push = (force + pole * length * rate**2 * sin) / mass
    turning = (9.8 * sin - cos * push + (torque - 0.05 * rate) / (pole * length)) / (
        length * (4 / 3 - pole * cos**2 / mass)
    )
    return [speed, rate, push - pole * length * turning * cos / mass, turning]


def acrobot(x, u):
    """Spong (1995) with Gymnasium's sizes, and friction 0.2 N m s at each joint."""
    torque1, torque2 = (0.0, *u)[-2:]
    q1, q2, v1, v2 = x
    torque1, torque2 = torque1 - 0.2 * v1, torque2 - 0.2 * v2
    d11, d12, d22 = 3.5 + np.cos(q2), 1.25 + 0.5 * np.cos(q2), 1.25
    phi2 = 0.5 * 9.8 * np.sin(q1 + q2)
    phi1 = 1.5 * 9.8 * np.sin(q1) + phi2
    h1 = -0.5 * np.sin(q2) * (v2**2 + 2 * v1 * v2)
    h2 = 0.5 * np.sin(q2) * v1**2
    accelerations = np.linalg.solve([[d11, d12], [d12, d22]], [torque1 - h1 - phi1, torque2 - h2 - phi2])
    return [v1, v2, *accelerations]


TEXTBOOK = {
    "pendulum-canonical": canonical_pendulum,
    "pendulum": upright_pendulum,
    "cartpole": cart_pole,
    "acrobot": acrobot,
    "cartpole-full": cart_pole,
    "acrobot-full": acrobot,
}


@pytest.fixture(scope="module")
def simulated():
    """A few trajectories of every task."""
    return {name: simulate(task(name), seed=7, **FEW) for name in TASKS}


@pytest.mark.parametrize("name", TASKS)
def test_every_sample_is_that_of_textbook_equations_to_1e_9(name, simulated):
    data, field = simulated[name], TEXTBOOK[name]
    for path in (*data.dataset.train[::4], data.dataset.test[-1], data.prediction[1]):
        start = np.concatenate([path.q[0], path.rates[0]])
        truth = solve_ivp(
            lambda t, x, u: field(x, u),
            (0.0, path.ts[-1]),
            start,
            method="DOP853",
            t_eval=path.ts,
            args=(path.us[0],),
            rtol=1e-13,
            atol=1e-13,
            max_step=0.01,
        )
        assert np.abs(np.concatenate([path.q, path.rates], axis=1) - truth.y.T).max() < 1e-9


@pytest.mark.parametrize("system", [Pendulum(), CartPole(), Acrobot()], ids=lambda system: type(system).__name__)
def test_energy_is_conserved_without_input_and_friction(system):
    known = {"Pendulum": "pendulum", "CartPole": "cartpole", "Acrobot": "acrobot"}[type(system).__name__]
    data = simulate(dataclasses.replace(task(known), system=system), **FEW)
    for path in data.prediction:
        states = jax.vmap(system.encode)(jnp.asarray(path.q), jnp.asarray(path.rates))
        energies = jax.vmap(lambda x: system.hamiltonian(*jnp.split(x, 2)))(states)
        assert np.abs(energies - energies[0]).max() < 1e-9


def test_a_pendulum_without_gravity_coasts_to_rest_as_its_closed_form():
    system = Pendulum(mass=3.0, gravity=0.0, damping=0.5)
    for path in simulate(dataclasses.replace(task("pendulum"), system=system), **FEW).prediction:
        decay = np.exp(-0.5 * path.ts)
        assert path.rates[:, 0] == pytest.approx(path.rates[0, 0] * decay, abs=1e-10)
        assert path.q[:, 0] == pytest.approx(path.q[0, 0] + path.rates[0, 0] * (1 - decay) / 0.5, abs=1e-10)


@pytest.mark.parametrize("name", TASKS)
def test_the_data_are_laid_out_as_the_task_says(name, simulated):
    data, found = simulated[name], task(name)
    inputs = np.array(found.input_values)
    assert [path.name for path in data.dataset.train[:4]] == [
        "train-000-u0",
        "train-001-u0",
        "train-002-u0",
        "train-000-u1",
    ]
    assert len(data.dataset.train) == 3 * len(inputs)
    assert len(data.dataset.test) == 2 * len(inputs)
    assert (data.dataset.space, data.dataset.momenta) == (found.space, found.system.momenta)
    assert data.dataset.position_units == found.system.space.units  # Whatever space is told: task 1's angle is on R.
    assert data.dataset.input_names == found.input_names
    for index, path in enumerate(data.dataset.train):
        assert path.ts == pytest.approx(found.dt * np.arange(20))
        assert np.all(path.us == inputs[index // 3])
        assert np.array_equal(path.q[0], data.prediction[index % 3].q[0])
        assert np.array_equal(path.rates[0], data.prediction[index % 3].rates[0])
    for path in data.prediction:
        assert path.q.shape == (40, found.system.space.size)
        assert not path.us.any()


@pytest.mark.parametrize("name", TASKS)
def test_initial_conditions_fill_their_bounds(name):
    found = task(name)
    data = simulate(dataclasses.replace(found, points=2, prediction_points=2, input_values=found.input_values[:1]))
    starts = np.array([np.concatenate([path.q[0], path.rates[0]]) for path in data.dataset.recordings])
    low, high = np.array(found.position_bounds + found.rate_bounds).T
    assert len(starts) == 128
    assert np.all((low - 1e-12 <= starts) & (starts <= high + 1e-12))
    assert np.all(np.ptp(starts, axis=0) > 0.9 * (high - low))


def test_the_same_seed_gives_the_same_bits_and_another_one_other_data(simulated):
    again, other = simulate(task("acrobot"), seed=7, **FEW), simulate(task("acrobot"), seed=8, **FEW)
    first = simulated["acrobot"]
    for one, two in zip(
        first.dataset.recordings + first.prediction, again.dataset.recordings + again.prediction, strict=True
    ):
        assert np.array_equal(one.q, two.q)
        assert np.array_equal(one.rates, two.rates)
    assert not np.array_equal(first.dataset.train[0].q, other.dataset.train[0].q)


def test_fewer_initial_conditions_are_the_first_of_more(simulated):
    fewer = simulate(task("acrobot"), seed=7, train_initials=1, test_initials=1).dataset
    more = simulated["acrobot"].dataset
    assert fewer.train[0].q == pytest.approx(more.train[0].q, abs=1e-9)
    assert fewer.test[0].q == pytest.approx(more.test[0].q, abs=1e-9)


def test_the_users_precision_neither_matters_nor_changes(simulated):
    with jax.enable_x64(False):
        again = simulate(task("pendulum"), seed=7, **FEW)
        assert jnp.ones(1).dtype == jnp.float32
    for one, two in zip(simulated["pendulum"].dataset.recordings, again.dataset.recordings, strict=True):
        assert np.array_equal(one.q, two.q)


@pytest.mark.parametrize("counts", [{"train_initials": 0}, {"test_initials": -1}])
def test_data_without_training_trajectories_are_refused(counts):
    with pytest.raises(ValueError, match="at least 1 training and 0 test initial conditions"):
        simulate(task("pendulum"), **counts)


def test_a_task_can_be_without_test_trajectories():
    assert simulate(task("pendulum"), train_initials=1, test_initials=0).dataset.test == ()

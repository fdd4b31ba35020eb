"""Rollouts under sampled inputs, against SciPy."""

import dataclasses
import inspect
from typing import final

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate

from symoden.data import Trajectory
from symoden.evaluation import predict
from symoden.integrate import HOLDS, RK4, DiffraxSolver, linear_hold, rollout, zero_hold
from symoden.mechanics import AbstractDynamics
from symoden.spaces import Space
from symoden.systems import Acrobot, CartPole, Pendulum

TIGHT = DiffraxSolver(diffrax.Dopri8(), rtol=1e-11, atol=1e-11)
SOLVERS = {
    "RK4": RK4(16),
    "Tsit5": DiffraxSolver(diffrax.Tsit5(), rtol=1e-9, atol=1e-9),
    "Dopri8": TIGHT,
    "Kvaerno5": DiffraxSolver(diffrax.Kvaerno5(), rtol=1e-9, atol=1e-9),
}
FEW = ["RK4", "Tsit5", "Kvaerno5"]
IRREGULAR = jnp.array([0.0, 0.03, 0.1, 0.12, 0.3, 0.31, 0.5])
US = jnp.array([[1.0], [-2.0], [0.5], [3.0], [-1.0], [2.0], [99.0]])


TRACED = []


@final
class Integrator(AbstractDynamics):
    """ẋ = u: a rollout is the integral of the input. It notes how often it is traced."""

    space: Space = eqx.field(default=Space((False,)), static=True)
    inputs: int = eqx.field(default=1, static=True)
    momenta: bool = eqx.field(default=False, static=True)

    def encode(self, q, rates):
        return jnp.concatenate([q, rates])

    def derivative(self, t, state, u):
        TRACED.append(t)
        return jnp.concatenate([u, 0 * u])

    def decode(self, state):
        return state[:1], state[1:]

    def observe(self, state):
        return state


@final
class Exploding(AbstractDynamics):
    """ẋ = x³ (1 + u²): infinite after a finite time."""

    space: Space = eqx.field(default=Space((False,)), static=True)
    inputs: int = eqx.field(default=1, static=True)
    momenta: bool = eqx.field(default=False, static=True)

    def encode(self, q, rates):
        return jnp.concatenate([q, rates])

    def derivative(self, t, state, u):
        return state**3 * (1 + u[0] ** 2)

    def decode(self, state):
        return state[:1], state[1:]

    def observe(self, state):
        return state


@eqx.filter_jit
def simulate(system, q0, v0, ts, us, solver, hold):
    return rollout(system, q0, v0, ts, us, solver=solver, hold=hold)


def by_scipy(system, q0, v0, ts, us, *, linear):
    """Integrate each interval on its own, with the input that acts there."""
    derivative = jax.jit(system.derivative)
    state = np.asarray(system.encode(q0, v0))
    states = [state]
    for k in range(len(ts) - 1):
        t0, t1, u0, u1 = float(ts[k]), float(ts[k + 1]), np.asarray(us[k]), np.asarray(us[k + 1])

        def field(t, x, t0=t0, t1=t1, u0=u0, u1=u1):
            u = u0 + (t - t0) / (t1 - t0) * (u1 - u0) if linear else u0
            return np.asarray(derivative(jnp.asarray(t), jnp.asarray(x), jnp.asarray(u)))

        state = scipy.integrate.solve_ivp(field, (t0, t1), state, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
        states.append(state)
    return np.stack(states)


@pytest.mark.parametrize("hold", ["zero", "linear"])
@pytest.mark.parametrize("system", [CartPole(pole_damping=0.05), Acrobot()], ids=lambda system: type(system).__name__)
def test_a_rollout_at_irregular_times_is_scipy_s(system, hold):
    q0, v0 = jnp.array([0.3, 2.5]), jnp.array([-0.5, 1.0])
    path = simulate(system, q0, v0, IRREGULAR, US, TIGHT, hold)
    expected = by_scipy(system, q0, v0, IRREGULAR, US, linear=hold == "linear")
    assert np.asarray(path.states) == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("name", FEW)
@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_every_solver_feels_the_input_as_it_is_held(name, hold):
    path = simulate(Integrator(), jnp.zeros(1), jnp.zeros(1), IRREGULAR, US, SOLVERS[name], HOLDS[hold])
    us = np.asarray(US[:, 0])
    acting = us[:-1] if hold == "zero" else (us[:-1] + us[1:]) / 2
    expected = np.concatenate([[0.0], np.cumsum(acting * np.diff(IRREGULAR))])
    assert np.asarray(path.q[:, 0]) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("name", FEW)
def test_solvers_agree(name):
    arguments = (Pendulum(damping=0.2), jnp.array([1.0]), jnp.array([0.5]), IRREGULAR, US)
    path, reference = (simulate(*arguments, solver, zero_hold) for solver in (SOLVERS[name], TIGHT))
    assert np.asarray(path.q) == pytest.approx(np.asarray(reference.q), abs=1e-6)


def test_the_last_sample_of_a_held_input_never_acts():
    arguments = (Pendulum(), jnp.array([1.0]), jnp.array([0.5]), IRREGULAR)
    one, other = (simulate(*arguments, us, RK4(), zero_hold) for us in (US, US.at[-1].set(-5.0)))
    assert np.array_equal(one.q, other.q)
    joined = [simulate(*arguments, us, RK4(), linear_hold) for us in (US, US.at[-1].set(-5.0))]
    assert not np.array_equal(joined[0].q, joined[1].q)


def test_a_rollout_tells_the_same_by_states_configurations_and_observations():
    system = CartPole(pole_damping=0.1)
    path = simulate(system, jnp.array([0.1, 3.0]), jnp.array([0.2, -0.4]), IRREGULAR, US, RK4(2), zero_hold)
    assert np.asarray(path.q) == pytest.approx(np.asarray(path.states[:, :2]), abs=0)
    assert np.asarray(path.rates[0]) == pytest.approx([0.2, -0.4], abs=1e-12)
    embedded = jax.vmap(system.space.embed)(path.q)
    assert np.asarray(path.observations) == pytest.approx(np.concatenate([embedded, path.rates], axis=1), abs=1e-12)


def test_a_batch_of_one_and_a_single_interval_work():
    q0, v0, ts, us = jnp.ones((1, 1)), jnp.ones((1, 1)), IRREGULAR[None, :2], US[None, :2]
    path = jax.vmap(lambda q, v, ts, us: rollout(Pendulum(), q, v, ts, us))(q0, v0, ts, us)
    assert path.q.shape == (1, 2, 1)
    single = rollout(Pendulum(), q0[0], v0[0], ts[0], us[0])
    assert np.asarray(path.q[0]) == pytest.approx(np.asarray(single.q), abs=1e-15)


@pytest.mark.parametrize("name", FEW)
def test_a_diverging_rollout_ends_and_says_so(name):
    ts, us = 0.5 * jnp.arange(40.0), jnp.ones((40, 1))
    solver = SOLVERS[name]
    if isinstance(solver, DiffraxSolver):
        solver = dataclasses.replace(solver, max_steps=32)
    path = simulate(Exploding(), jnp.array([1.0]), jnp.array([1.0]), ts, us, solver, zero_hold)
    assert np.isfinite(path.q[0]).all()
    assert not np.isfinite(path.q[-1]).any()
    finite = np.isfinite(np.asarray(path.q[:, 0]))
    assert not finite[int(np.argmin(finite)) :].any()


@pytest.mark.parametrize("name", FEW)
def test_single_precision_in_is_single_precision_out(name):
    system = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), Pendulum(damping=0.1))
    solver = SOLVERS[name]
    if isinstance(solver, DiffraxSolver):
        solver = dataclasses.replace(solver, rtol=1e-3, atol=1e-4)
    arrays = [x.astype(jnp.float32) for x in (jnp.ones(1), jnp.ones(1), IRREGULAR, US)]
    q0, v0, ts, us = arrays
    path = simulate(system, q0, v0, ts, us, solver, linear_hold)
    assert {part.dtype for part in path} == {np.dtype(np.float32)}
    assert np.isfinite(path.q).all()


# What a rollout is given

PLAIN = inspect.unwrap(rollout)  # as users have it, without the check of types that tests add
LINE = jnp.linspace(0.0, 1.0, 5)


def test_a_rollout_is_as_fine_as_a_prediction_where_no_solver_is_given():
    us = jnp.zeros((5, 1))
    path = rollout(Pendulum(), jnp.ones(1), jnp.zeros(1), LINE, us)
    assert np.array_equal(path.q, rollout(Pendulum(), jnp.ones(1), jnp.zeros(1), LINE, us, solver=RK4(4)).q)
    rest = Trajectory(name="swing", ts=np.asarray(LINE), q=np.ones((5, 1)), rates=np.zeros((5, 1)), us=np.zeros((5, 1)))
    (predicted,) = predict(Pendulum(), [rest])
    np.testing.assert_allclose(path.q, predicted.q, rtol=1e-12)


def test_a_rollout_in_a_loop_is_compiled_once():
    """Each compilation is kept: some three hundred of them ended the process."""
    counts = []
    for k in range(3):
        path = rollout(Integrator(), jnp.array([0.1 * k]), jnp.zeros(1), IRREGULAR, US)
        assert path.q[-1, 0] == pytest.approx(0.1 * k + float(jnp.diff(IRREGULAR) @ US[:-1, 0]))
        counts.append(len(TRACED))
    assert counts == counts[:1] * 3


def test_lists_are_as_good_as_arrays():
    us = [[1.0], [0.5], [0.0], [2.0], [0.0]]
    path = PLAIN(Pendulum(), [1], [0], [0.0, 0.25, 0.5, 0.75, 1.0], us)
    assert np.array_equal(path.q, rollout(Pendulum(), jnp.ones(1), jnp.zeros(1), LINE, jnp.array(us)).q)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"q0": jnp.zeros(2)}, r"`q0` must have the shape \(1,\), one number per coordinate of T1; got \(2,\)"),
        ({"rates0": jnp.zeros((1, 1))}, r"`rates0` must have the shape \(1,\), .*; got \(1, 1\).*`jax.vmap`"),
        ({"ts": LINE[None]}, r"`ts` must be the times of one rollout, .*; got shape \(1, 5\)"),
        ({"ts": jnp.zeros(0)}, r"`ts` must be .* T at least 1; got shape \(0,\)"),
        ({"us": jnp.zeros((4, 1))}, r"`us` must have the shape \(5, 1\), .*; got \(4, 1\).*repeat the last row"),
        ({"us": jnp.zeros(5)}, r"`us` must have the shape \(5, 1\), .*; got \(5,\)"),
        ({"us": None}, r"`us` must be an array of numbers; got None"),
        ({"ts": LINE[::-1]}, r"`ts` must increase; got 0.75 after 1.0 at index 1"),
        ({"ts": LINE.at[3].set(LINE[2])}, r"`ts` must increase; got 0.5 after 0.5 at index 3"),
        ({"ts": LINE.at[3].set(jnp.nan)}, r"`ts` must increase; got nan after 0.5 at index 3"),
    ],
)
def test_a_rollout_says_what_is_wrong_with_its_samples(wrong, message):
    fit = {"q0": jnp.zeros(1), "rates0": jnp.zeros(1), "ts": LINE, "us": jnp.zeros((5, 1))}
    with pytest.raises(ValueError, match=message):
        PLAIN(Pendulum(), **(fit | wrong))


@pytest.mark.parametrize("start", [1e3, 1.7e9])
def test_single_precision_keeps_steps_of_a_millisecond_whenever_they_were_taken(start):
    """Seconds since a robot was switched on, and since 1970."""
    ts, us = start + 1e-3 * np.arange(200), np.zeros((200, 1))
    with jax.enable_x64(False):
        late, early = (PLAIN(Pendulum(), [0.3], [0.0], times, us).q for times in (ts, ts - start))
    assert late.dtype == jnp.float32
    np.testing.assert_allclose(late, early, rtol=1e-5)
    assert late[-1, 0] < 0.29


def test_shapes_are_checked_while_jax_traces_but_the_order_of_times_is_not():
    traced = jax.jit(lambda ts, us: PLAIN(Pendulum(), jnp.zeros(1), jnp.zeros(1), ts, us).q)
    assert traced(LINE[::-1], jnp.zeros((5, 1))).shape == (5, 1)
    with pytest.raises(ValueError, match="`us` must have the shape"):
        traced(LINE, jnp.zeros((4, 1)))


def test_a_hold_that_there_is_not_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match="`hold` must be one of zero, linear, or a function; got 'first'"):
        rollout(Integrator(), jnp.zeros(1), jnp.zeros(1), IRREGULAR, US, hold="first")

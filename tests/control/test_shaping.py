"""Energy shaping: the laws of its energy, its equilibrium, its limits."""

import equinox as eqx
import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given

from symoden.control import EnergyShaping, Loop, audit_energy, find_stuck, judge, run_episodes
from symoden.control._scales import bandwidth
from symoden.known import KnownParts
from symoden.mechanics import AbstractPortHamiltonian
from symoden.models import ModelConfig, build
from symoden.spaces import Space

from .conftest import CART_POLE, FULL, PENDULUM, rate_of, slide

CONTROLLERS = {name: EnergyShaping.of(system, target, limits=limit) for name, (system, target, limit) in FULL.items()}
FREE = {name: EnergyShaping.of(system, target) for name, (system, target, _) in FULL.items()}
CALLS = {name: eqx.filter_jit(controller) for name, controller in CONTROLLERS.items()}
numbers = st.lists(st.floats(-4, 4), min_size=4, max_size=4)


def state(name, values):
    n = FULL[name][0].space.size
    return jnp.array(values[:n]), jnp.array(values[2 : 2 + n])


@pytest.mark.parametrize("name", FULL)
@given(values=numbers)
def test_the_desired_energy_falls_by_friction_and_by_damping_alone(name, values):
    system, controller, free = FULL[name][0], CONTROLLERS[name], FREE[name]
    q, v = state(name, values)
    rate, _ = rate_of(system, controller, q, v)
    friction = float(v @ system.dissipation_matrix(q, v) @ v)
    assert rate <= -(1 - float(controller.compensation)) * friction + 1e-9
    y = system.input_matrix(q).T @ v
    rate, _ = rate_of(system, free, q, v)  # Without limits all of it acts.
    assert rate == pytest.approx(
        -(1 - float(free.compensation)) * friction - float(y @ free.damping @ y), rel=1e-6, abs=1e-9
    )
    assert float(controller.desired_energy(q, v)) >= 0


def test_dry_friction_does_not_make_the_way_a_creep():
    rough = KnownParts(
        mass_matrix=[["1/3"]],
        potential_energy="5*cos(q1)",
        input_matrix=[[1]],
        dissipation_matrix=[["2/sqrt(v1**2 + 0.01)"]],  # 2 N m, smoothed below 0.1 rad/s
    )
    plant = build(ModelConfig(), Space.parse("T1"), 1, known=rough, key=jax.random.key(0))
    assert isinstance(plant, AbstractPortHamiltonian)
    controller = EnergyShaping.of(plant, [0.0], frequency=15**0.5, limits=10.0)
    starts = np.array([[-3.0], [-1.0], [0.5], [2.0]])
    creeping = EnergyShaping.of(plant, [0.0], frequency=15**0.5, limits=10.0, compensation=0.0)
    for each, arrive in ((controller, 4), (creeping, 0)):
        episodes = run_episodes(plant, each, starts, 0 * starts, Loop(duration=10.0))
        assert judge(episodes, plant.space, np.zeros(1)).success.sum() == arrive


def go(plant, period=0.005):
    """Move a slide to 0.3 m with 2 V."""
    starts = 0.3 + np.linspace(-0.5, 0.5, 6)[:, None]
    controller = EnergyShaping.of(plant, [0.3], limits=2.0, period=period)
    episodes = run_episodes(plant, controller, starts, 0 * starts, Loop(duration=15.0, period=period, step=0.001))
    return controller, episodes, judge(episodes, plant.space, np.array([0.3]))


@pytest.mark.parametrize(("friction", "damping"), [(0.0, 0.0), (1.5, 3.0), (4.5, 3.0)])
def test_a_slide_on_which_nothing_but_friction_acts_arrives(friction, damping):
    plant = slide(friction, damping)
    controller, episodes, verdict = go(plant)
    assert verdict.success.all()
    assert np.median(verdict.settling) < 4
    assert audit_energy(plant, controller, episodes).share == 1
    assert not find_stuck(plant, episodes, np.array([0.3])).held.any()


def test_what_friction_holds_beside_the_target_is_told_in_inputs():
    plant = slide(11.0)  # of the 10 N that there are
    _, episodes, verdict = go(plant)
    stuck = find_stuck(plant, episodes, np.array([0.3]))
    assert stuck.held.sum() == (~verdict.success).sum() >= 4
    np.testing.assert_allclose(stuck.friction, (11 + 0.3) / 5, rtol=1e-3)
    assert np.all(stuck.push[stuck.held] < 2.0)
    assert np.all(stuck.distance[stuck.held] > 0.05)
    naive = build(ModelConfig(kind="naive", flow=(4,)), Space.parse("R1"), 1, key=jax.random.key(0))
    assert not find_stuck(naive, episodes, np.array([0.3])).held.any()


def test_what_creeps_on_against_viscous_friction_is_not_held():
    plant = slide(0.0, damping=2000.0)
    _, episodes, verdict = go(plant)
    assert not verdict.success.all()
    assert not find_stuck(plant, episodes, np.array([0.3])).held.any()


@pytest.mark.parametrize("coupling", [0.0, 0.5, 0.9, 0.97])
def test_damping_that_is_held_for_a_period_does_not_push_whatever_couples_the_coordinates(coupling):
    parts = KnownParts(
        mass_matrix=[[1, coupling], [coupling, 1]],
        potential_energy="0*q1",
        input_matrix=[[1, 0], [0, 1]],
        dissipation_matrix=[["500/sqrt(v1**2 + 1e-4)", 0], [0, 0.1]],
    )
    plant = build(ModelConfig(), Space.parse("R2"), 2, known=parts, key=jax.random.key(0))
    assert isinstance(plant, AbstractPortHamiltonian)
    controller = EnergyShaping.of(plant, [0.0, 0.0], limits=1000.0, period=0.005)
    rates = np.linalg.eigvals(np.linalg.solve(plant.mass_matrix(jnp.zeros(2)), controller.damping))
    assert 0.2 < 0.005 * rates.real.max() <= 0.5 + 1e-6


@pytest.mark.parametrize("name", FULL)
def test_where_the_potential_energy_asks_for_more_neither_limits_nor_friction_change_gains(name):
    system, target, limit = FULL[name]
    goal = jnp.array(target)
    expected = bandwidth(system, goal) ** 2 * np.diag(system.mass_matrix(goal))
    np.testing.assert_allclose(EnergyShaping.of(system, target, limits=limit).stiffness, expected, rtol=1e-9)


def test_the_period_bounds_what_limits_and_friction_ask_for():
    stiffness = [float(EnergyShaping.of(slide(4.5), [0.3], limits=2.0, period=T).stiffness[0]) for T in (0.005, 0.1)]
    assert stiffness[0] == pytest.approx((4.5 + 0.3) / 0.05, rel=1e-3)
    assert stiffness[1] == pytest.approx(2 * (0.25 / 0.1) ** 2)


@pytest.mark.parametrize("name", FULL)
@given(values=numbers)
def test_inputs_stay_within_their_limits(name, values):
    q, v = state(name, [100 * x for x in values])
    assert np.all(np.abs(CALLS[name](q, v)) <= FULL[name][2])


@pytest.mark.parametrize("name", FULL)
def test_the_target_is_an_equilibrium_with_the_least_desired_energy(name):
    system, controller = FULL[name][0], CONTROLLERS[name]
    still = jnp.zeros(system.space.size)
    q_dot, p_dot = system.vector_field(controller.target, still, controller(controller.target, still))
    np.testing.assert_allclose([q_dot, p_dot], 0, atol=1e-9)
    assert float(controller.desired_energy(controller.target, still)) == 0


@given(q=st.floats(-3, 3), v=st.floats(-5, 5), turns=st.integers(-3, 3))
def test_angles_go_the_short_way_round(q, v, turns):
    call, v = CALLS["pendulum"], jnp.array([v])
    np.testing.assert_allclose(call(jnp.array([q]), v), call(jnp.array([q + 2 * np.pi * turns]), v), atol=1e-9)


def test_far_away_the_desired_force_leaves_room_for_damping():
    q, still = jnp.array([[-3.1], [-2.0], [2.0], [3.1]]), jnp.zeros(1)
    load = 5.0  # what half the weight at the end of the rod takes
    for each in q:
        assert abs(float(CONTROLLERS["pendulum"](each, still)[0])) <= load + 0.5 * (15 - load) + 1e-6


def test_without_limits_the_desired_potential_energy_is_a_parabola():
    controller = EnergyShaping.of(PENDULUM, [0.0], frequency=3.0)
    assert float(controller.desired_energy(jnp.array([2.0]), jnp.zeros(1))) == pytest.approx(0.5 * 9 / 3 * 4)


def test_what_cannot_be_shaped_is_refused():
    with pytest.raises(ValueError, match="an input for each of the 2 coordinates; the model has 1"):
        EnergyShaping.of(CART_POLE, [0.0, 0.0])
    with pytest.raises(ValueError, match=r"must exceed the static load \[5.0\]"):
        EnergyShaping.of(PENDULUM, [0.0], limits=4.0)
    with pytest.raises(ValueError, match="between 0 and 1; got"):
        EnergyShaping.of(PENDULUM, [0.0], compensation=1.5)
    for name, gain in (("frequency", -2.0), ("frequency", np.inf), ("damping_ratio", 0.0), ("damping_ratio", np.nan)):
        with pytest.raises(ValueError, match=f"`{name}` must be positive and finite; got {gain}"):
            EnergyShaping.of(PENDULUM, [0.0], **{name: gain})
    for limits in (-1.0, (1.0, 2.0)):
        with pytest.raises(ValueError, match="Limits must be positive"):
            EnergyShaping.of(PENDULUM, [0.0], limits=limits)

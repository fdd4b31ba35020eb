"""Controllers by name, compiled, and what none of them may depend on."""

import re
import time

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.control import (
    METHODS,
    CollocatedPump,
    Compiled,
    ControlledLagrangian,
    EnergyPump,
    EnergyShaping,
    Follower,
    Handover,
    Loop,
    Regulator,
    Tracking,
    _causes,
    _design,
    audit_energy,
    choose_method,
    design,
    judge,
    plan_motion,
    run_episodes,
)
from symoden.control._attraction import follower_level
from symoden.control._design import lowest, slow_swing
from symoden.control._regulator import linearize, remaining_motion
from symoden.control._scales import bandwidth
from symoden.control._search import searched
from symoden.known import KnownParts
from symoden.mechanics import AbstractPortHamiltonian
from symoden.models import ModelConfig, build, rescale
from symoden.spaces import Space

from .conftest import ACROBOT, CART_POLE, FULL_ACROBOT, PENDULUM, slide


@pytest.fixture(scope="module")
def swing_up():
    return design(PENDULUM, [0.0], method="swing-up", limits=4.0)


def test_the_method_follows_from_actuation_and_strength():
    assert choose_method(PENDULUM, [0.0], limits=15.0) == "energy-shaping+lqr"
    assert choose_method(PENDULUM, [0.0], limits=4.0) == "swing-up"
    assert choose_method(FULL_ACROBOT, [np.pi, 0.0]) == "energy-shaping+lqr"
    assert choose_method(FULL_ACROBOT, [np.pi, 0.0], limits=(40.0, 4.0)) == "swing-up"
    assert choose_method(CART_POLE, [0.0, 0.0], limits=15.0) == "swing-up"
    naive = build(ModelConfig(kind="naive", flow=(4,)), Space.parse("T1"), 1, key=jax.random.key(0))
    assert choose_method(naive, [0.0]) == "lqr"
    assert choose_method(slide(1.5), [0.3], limits=2.0) == "energy-shaping+lqr"
    with pytest.raises(ValueError, match="needs a model with an energy; got NaiveModel"):
        design(naive, [0.0], method="energy-shaping")


def test_names_make_their_controllers():
    made = {
        "energy-shaping": design(PENDULUM, [0.0], method="energy-shaping", limits=15.0),
        "energy-shaping+lqr": design(PENDULUM, [0.0], limits=15.0),
        "tracking": design(PENDULUM, [0.0], method="tracking"),
        "lqr": design(PENDULUM, [0.0], method="lqr"),
        "controlled-lagrangian": design(CART_POLE, [0.0, 0.0], method="controlled-lagrangian", limits=15.0),
    }
    assert [type(each) for each in made.values()] == [
        EnergyShaping,
        Handover,
        Tracking,
        Regulator,
        ControlledLagrangian,
    ]
    assert {*made, "swing-up"} <= set(METHODS)
    with pytest.raises(ValueError, match="Swing-up needs limits"):
        design(PENDULUM, [0.0], method="swing-up")


@pytest.mark.parametrize(
    ("target", "settings", "message"),
    [
        ([np.pi + 0.01, 0.0], {"limits": 15.0}, r"must be an equilibrium of the model.*nearby that is \[3\.14"),
        ([np.pi, 0.0], {"limits": 15.0, "period": 2.0}, r"A period of 2 s is too long .* with 0.01 s it does"),
    ],
)
def test_why_a_regulator_does_not_hold_the_target_is_told(target, settings, message):
    with pytest.raises(ValueError, match=message):
        design(ACROBOT, target, method="swing-up", **settings)


def test_a_period_that_is_too_long_is_named_where_inputs_are_too_small_as_well(monkeypatch):
    def held(model, regulator, *, period):
        return float(period <= 0.01 and np.asarray(regulator.limits).min() >= 10)

    monkeypatch.setattr(_causes, "attraction", held)
    regulator = Regulator.of(ACROBOT, [np.pi, 0.0], limits=(1.0,), period=1.0)
    told = _causes.why_not_held(ACROBOT, regulator, 1.0)
    assert "inputs up to 1 and a period of 1 s; with 10 times as much and 0.01 s it does." in told
    assert told.endswith("Allow more input and shorten the period.")


def test_the_target_that_is_named_instead_is_an_equilibrium():
    with pytest.raises(ValueError, match=r"nearby that is \[") as refused:
        design(ACROBOT, [np.pi + 0.2, 0.0], method="swing-up", limits=15.0)
    numbers = re.findall(r"nearby that is \[(.*?), (.*?)\]", str(refused.value))[0]
    nearby = jnp.array([float(number) for number in numbers])
    hold = jnp.asarray(linearize(ACROBOT, nearby)[2])
    assert np.abs(remaining_motion(ACROBOT, nearby, hold)).max() < 1e-2
    assert np.abs(nearby - np.array([np.pi + 0.2, 0.0])).max() < 0.5


@pytest.mark.parametrize(
    ("limit", "message"),
    [(0.04, "with 100 times as much it does"), (0.004, "would not with 100 times the input")],
)
def test_whether_more_input_helps_against_friction_is_tried(limit, message):
    parts = KnownParts(
        mass_matrix=[["1/3"]],
        potential_energy="5*cos(q1)",
        input_matrix=[[1]],
        dissipation_matrix=[["0.3/sqrt(v1**2 + 1e-12)"]],
    )
    plant = build(ModelConfig(), Space.parse("T1"), 1, known=parts, key=jax.random.key(0))
    with pytest.raises(ValueError, match=message):
        design(plant, [0.0], method="swing-up", limits=limit)


def eccentric(friction):
    """A disk with a weight of 1 N m at its rim, and dry friction [N m]."""
    parts = KnownParts(
        mass_matrix=[[0.05]],
        potential_energy="cos(q1)",
        input_matrix=[[1]],
        dissipation_matrix=[[f"{friction}/sqrt(v1**2 + 4e-4)"]],
    )
    return build(ModelConfig(), Space.parse("T1"), 1, known=parts, key=jax.random.key(0))


@pytest.mark.parametrize(
    ("friction", "limit", "method"),
    [
        (0.2, 1.45, "energy-shaping+lqr"),
        (0.2, 1.35, "swing-up"),
        (1.5, 1.2, "energy-shaping+lqr"),
    ],
)
def test_half_of_what_the_weight_leaves_must_overcome_friction(friction, limit, method):
    assert choose_method(eccentric(friction), [0.0], limits=limit) == method


def test_frictions_add_up_where_two_inputs_share_a_joint():
    parts = KnownParts(
        mass_matrix=[[1, 0], [0, 1]],
        potential_energy="-2*cos(q1)",
        input_matrix=[[1, 1], [0, 1]],
        dissipation_matrix=[["0.5/sqrt(v1**2 + 1e-4)", 0], [0, "0.5/sqrt(v2**2 + 1e-4)"]],
    )
    plant = build(ModelConfig(), Space.parse("T2"), 2, known=parts, key=jax.random.key(0))
    assert choose_method(plant, [np.pi, 0.0], limits=2.05) == "swing-up"
    assert choose_method(plant, [np.pi, 0.0], limits=4.1) == "energy-shaping+lqr"


def test_a_regulator_ends_what_friction_makes_energy_shaping_creep():
    plant, loop = eccentric(0.3), Loop(duration=6.0, period=0.01)
    q0 = np.linspace(-3, 3, 5)[:, None]
    settling = []
    for method in ("energy-shaping", "energy-shaping+lqr"):
        controller = design(plant, [1.0], method=method, limits=1.7, period=0.01)
        verdict = judge(run_episodes(plant, controller, q0, 0 * q0, loop), plant.space, np.array([1.0]))
        settling.append(np.where(verdict.success, verdict.settling, np.inf).max())
    assert settling[1] < 0.6 * min(settling[0], 6.0)


def test_energy_shaping_stays_alone_where_no_regulator_holds_the_model(monkeypatch):
    monkeypatch.setattr(_design, "attraction", lambda *_, **__: 0.0)
    assert isinstance(design(PENDULUM, [0.0], limits=15.0), EnergyShaping)

    def none(*_, **__):
        raise ValueError

    monkeypatch.setattr(_design, "by_stiffness", none)
    assert isinstance(design(PENDULUM, [0.0], limits=15.0), EnergyShaping)


def test_what_no_regulator_can_do_is_refused_before_it_is_tried():
    for method in ("lqr", "swing-up"):
        with pytest.raises(ValueError, match=r"must exceed what holding the target takes, \[2.397\]; they are \[2.0\]"):
            design(PENDULUM, [0.5], method=method, limits=2.0)
    with pytest.raises(ValueError, match=r"along those of R1 the potential energy is flat"):
        design(slide(1.5), [0.3], method="swing-up", limits=2.0)


def test_a_weak_pendulum_swings_up_from_anywhere(swing_up):
    q0 = np.linspace(-np.pi, np.pi, 20)[:, None]
    episodes = run_episodes(PENDULUM, swing_up, q0, np.zeros((20, 1)), Loop(duration=12.0, period=0.01))
    assert judge(episodes, PENDULUM.space, np.zeros(1)).success.all()
    assert float(jnp.abs(episodes.u).max()) <= 4.0
    audit = audit_energy(PENDULUM, swing_up, episodes)
    assert audit.share > 0.97


def test_the_audit_finds_where_the_desired_energy_rises(swing_up):
    episodes = run_episodes(PENDULUM, swing_up, np.array([[3.0]]), np.zeros((1, 1)), Loop(duration=3.0, period=0.01))
    backwards = eqx.tree_at(lambda c: c.near.gain, swing_up, -swing_up.near.gain)
    assert audit_energy(PENDULUM, backwards, episodes).share < audit_energy(PENDULUM, swing_up, episodes).share
    turned = audit_energy(PENDULUM, backwards, episodes._replace(q=episodes.q + 6 * np.pi))
    assert abs(turned.worst_q[0]) <= np.pi
    lost = episodes._replace(q=episodes.q * jnp.nan)
    with pytest.raises(ValueError, match="Nothing to audit"):
        audit_energy(PENDULUM, swing_up, lost)


def test_a_planned_motion_is_one_of_the_model_and_is_followed():
    motion = plan_motion(PENDULUM, [np.pi], [0.0], limits=4.0, duration=3.0)
    end = Regulator.of(PENDULUM, [0.0], limits=4.0, period=0.02)
    assert float(jnp.abs(motion.u).max()) < 4.0
    follower = Follower.of(PENDULUM, motion, end)
    np.testing.assert_allclose(follower(motion.x[40, :1], motion.x[40, 1:]), motion.u[40], atol=1e-9)
    whole = Handover(far=follower, near=end, level=jnp.asarray(0.1), limits=end.limits)
    level = follower_level(PENDULUM, whole, period=0.02)
    assert 0.02 <= level <= 2.0
    whole = eqx.tree_at(lambda c: c.far.level, whole, jnp.asarray(level))
    q0 = np.pi + np.linspace(-0.5, 0.5, 8)[:, None]
    episodes = run_episodes(PENDULUM, whole, q0, np.zeros((8, 1)), Loop(duration=12.0, period=0.02))
    assert judge(episodes, PENDULUM.space, np.zeros(1)).success.all()
    with pytest.raises(ValueError, match=r"No motion of 0.3 s from \[3.14"):
        plan_motion(PENDULUM, [np.pi], [0.0], limits=4.0, duration=0.3)
    with pytest.raises(ValueError, match=r"within limits, which must be finite; got \[inf\]"):
        plan_motion(PENDULUM, [np.pi], [0.0], limits=None)


def test_a_search_on_the_model_does_not_make_a_swing_up_worse():
    near = Regulator.of(CART_POLE, [0.0, 0.0], limits=15.0)
    pump = CollocatedPump.of(CART_POLE, [0.0, 0.0], limits=15.0)
    first = Handover(far=pump, near=near, level=jnp.asarray(0.15), limits=near.limits)
    q0, v0 = np.array([[0.0, 3.0], [0.3, -2.0], [-0.3, 1.0]]), np.zeros((3, 2))
    loop = Loop(duration=8.0, period=0.02, step=0.02)
    found = searched(CART_POLE, first, q0, v0, rounds=2, loop=loop)

    def away(controller):
        episodes = run_episodes(CART_POLE, controller, q0, v0, loop)
        cost = jax.vmap(jax.vmap(near.desired_energy))(episodes.q, episodes.v)
        return float((cost > 0.15).mean())

    assert isinstance(found.far, CollocatedPump)
    assert away(found) < away(first)
    assert np.all(np.asarray(found.far.gains) > 0)


def test_an_angle_without_weight_stays_where_the_target_has_it():
    parts = KnownParts(mass_matrix=[[1, 0], [0, 1]], potential_energy="5*cos(q2)", input_matrix=[[1], [0]])
    rotary = build(ModelConfig(), Space.parse("T2"), 1, known=parts, key=jax.random.key(0))
    assert isinstance(rotary, AbstractPortHamiltonian)
    found = lowest(rotary, jnp.array([0.7, 0.0]))
    assert float(found[0]) == 0.7
    assert float(jnp.cos(found[1])) == pytest.approx(-1)


def test_the_lowest_configuration_hangs():
    np.testing.assert_allclose(ACROBOT.space.wrap(lowest(ACROBOT, jnp.array([np.pi, 0.0]))), 0, atol=1e-9)


@pytest.mark.parametrize(("seed", "beta"), [(0, 0.2), (1, 7.0)])
def test_the_unit_of_momentum_changes_no_input(learned, beta, seed):
    full, under, single = learned("T2", 2, seed), learned("R1 T1", 1, seed), learned("T1", 1, seed)
    limit, generator = 50.0, np.random.default_rng(seed)
    makers = [
        (full, lambda m: EnergyShaping.of(m, [0.3, 0.2])),
        (full, lambda m: Tracking.of(m, lambda t: jnp.stack([jnp.sin(t), t]))),
        (single, lambda m: EnergyPump.of(m, [0.3], limits=limit)),
        (under, lambda m: CollocatedPump.of(m, [0.0, 0.3], limits=limit)),
        (single, lambda m: Regulator.of(m, [0.3])),
    ]
    for model, make in makers:
        q, v = (jnp.asarray(x) for x in generator.uniform(-1, 1, (2, model.space.size)))
        u, other = make(model)(q, v), make(rescale(model, beta))(q, v)
        np.testing.assert_allclose(u, other, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("system", [PENDULUM, FULL_ACROBOT])
def test_a_slow_swing_takes_longer_than_the_systems_own(system):
    target = jnp.asarray([0.0] if system is PENDULUM else [np.pi, 0.0])
    period = 2 * np.pi / bandwidth(system, target)
    swing = slow_swing(system, target)
    at = np.array([swing(jnp.asarray(t * period)) for t in (0.0, 1.0, 1 / 0.63, 2 / 0.63)])
    np.testing.assert_allclose(at[2:], at[[0, 0]], atol=1e-9)
    assert np.abs(at[1] - at[0]).max() > 0.1


def test_a_compiled_controller_gives_the_same_and_is_quick():
    controller = EnergyShaping.of(FULL_ACROBOT, [np.pi, 0.0], limits=40.0)
    call = Compiled(controller)
    q, v = np.array([1.0, 2.0]), np.array([0.1, -0.2])
    np.testing.assert_allclose(call(q, v), controller(jnp.asarray(q), jnp.asarray(v)), rtol=1e-12)
    times = []
    for _ in range(300):
        start = time.perf_counter()
        call(q, v)
        times.append(time.perf_counter() - start)
    assert np.median(times) < 2e-3  # ten times what it takes, for machines that are busy


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_lost_measurement_is_an_error_or_the_safe_input_as_chosen(bad):
    controller = EnergyShaping.of(PENDULUM, [0.0], limits=15.0)
    with pytest.raises(ValueError, match="Measurements must be finite"):
        Compiled(controller)(np.array([bad]), np.zeros(1))
    safe = Compiled(controller, on_nan="safe", safe=np.array([2.5]))
    assert safe(np.zeros(1), np.array([bad])).tolist() == [2.5]
    assert safe(np.zeros(1), np.zeros(1)).tolist() != [2.5]
    with pytest.raises(ValueError, match="must have 1 coordinates"):
        safe(np.zeros(2), np.zeros(2))
    with pytest.raises(ValueError, match="safe input must be within the limits"):
        Compiled(controller, safe=np.array([16.0]))

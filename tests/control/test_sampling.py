"""How long a control period may be: what the linearised loop says against simulations."""

import re

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from symoden import design
from symoden.control import EnergyShaping, Loop, Method, Tracking, judge, run_episodes
from symoden.control._sampling import check_period
from symoden.systems import Pendulum

from .conftest import CART_POLE, FULL, PENDULUM, slide

PLAIN = slide(0.0)


def longest(model, controller, target, method: Method = "energy-shaping"):
    """The period that the refusal of a far too long one names."""
    with pytest.raises(ValueError, match=f"A period of 3 s is too long for {method}") as refused:
        check_period(model, controller, jnp.asarray(target), 3.0, method=method)
    (period,) = re.findall(r"up to ([\d.e-]+) s", str(refused.value))
    return float(period)


@pytest.mark.parametrize("name", FULL)
def test_small_deviations_fall_up_to_the_period_that_is_named_and_grow_beyond(name):
    system, target, limits = FULL[name]
    controller = EnergyShaping.of(system, target, limits=limits)
    period = longest(system, controller, target)
    start = np.asarray(target)[None] + 1e-3
    for factor, falls in ((0.85, True), (1.2, False)):
        loop = Loop(duration=40 * factor * period, period=factor * period, step=0.001)
        away = np.abs(np.asarray(run_episodes(system, controller, start, 0 * start, loop).q)[0] - target).max(axis=1)
        assert (away[-1] < 0.5 * away[0]) == falls
        assert (away.max() > 10 * away[0]) != falls


@pytest.mark.parametrize(("method", "limits"), [("energy-shaping", 15.0), ("tracking", 60.0)])
def test_design_refuses_a_period_whose_loop_does_not_arrive(method: Method, limits):
    design(PENDULUM, [0.0], method=method, limits=limits, period=0.2)
    with pytest.raises(ValueError, match=rf"A period of 0.5 s is too long for {method}: .* Shorten the period"):
        design(PENDULUM, [0.0], method=method, limits=limits, period=0.5)


@pytest.mark.parametrize(("gravity", "limits", "period"), [(10.0, 15.0, 0.5), (1.0, 25.0, 0.8), (10.0, 30.0, 2.0)])
def test_the_period_that_is_named_and_shorter_ones_will_do(gravity, limits, period):
    pendulum = Pendulum(gravity=gravity)
    with pytest.raises(ValueError, match="too long for energy-shaping") as refused:
        design(pendulum, [0.0], method="energy-shaping", limits=limits, period=period)
    (named,) = map(float, re.findall(r"up to ([\d.e-]+) s", str(refused.value)))
    for share in (1.0, 0.7, 0.3, 0.1):
        design(pendulum, [0.0], method="energy-shaping", limits=limits, period=share * named)
    with pytest.raises(ValueError, match="too long for energy-shaping"):
        design(pendulum, [0.0], method="energy-shaping", limits=limits, period=1.15 * named)


def test_inputs_at_their_limits_do_not_hide_it():
    """Where an input is held at its limit, its derivative says nothing of what it does when it is not."""
    swing = Tracking.of(PENDULUM, lambda t: jnp.array([1.0]) + 0.1 * t, frequency=5.0, limits=0.5)
    assert longest(PENDULUM, swing, [0.0], method="tracking") == pytest.approx(0.2, rel=0.3)


def test_what_neither_grows_nor_falls_is_no_reason():
    """A slide that nothing but drag acts on comes to rest anywhere, as long as its target is left alone."""
    with pytest.raises(ValueError, match="too long"):
        check_period(PENDULUM, EnergyShaping.of(PENDULUM, [0.0]), jnp.zeros(1), 3.0, method="energy-shaping")
    idle = eqx.tree_at(
        lambda each: (each.stiffness, each.damping),
        EnergyShaping.of(PLAIN, [0.0]),
        (jnp.zeros(1), jnp.zeros((1, 1))),
    )
    for period in (0.02, 0.1, 1.0):
        check_period(PLAIN, idle, jnp.zeros(1), period, method="energy-shaping")


def test_a_controlled_lagrangian_is_made_for_continuous_control_too():
    with pytest.raises(ValueError, match="A period of 1 s is too long for controlled-lagrangian"):
        design(CART_POLE, [0.0, 0.0], method="controlled-lagrangian", limits=15.0, period=1.0)


def test_dry_friction_that_holds_still_does_not_stand_for_damping():
    """At rest it is as stiff as 500 N s/m; at speed the slide goes on past the target."""
    plant, target = slide(1.0), np.array([0.3])
    controller = EnergyShaping.of(plant, target, limits=20.0, frequency=6.0)
    period = longest(plant, controller, target)
    start = target + np.linspace(-0.5, 0.5, 6)[:, None]
    for factor, arrives in ((0.5, True), (1.5, False)):
        loop = Loop(duration=20.0, period=factor * period, step=0.001)
        episodes = run_episodes(plant, controller, start, 0 * start, loop)
        assert judge(episodes, plant.space, target).success.all() == arrives


def test_where_no_period_is_short_enough_none_is_refused():
    """It is not the period that makes a controller unstable that brakes the wrong way."""
    right = EnergyShaping.of(PENDULUM, [0.0])
    wrong = eqx.tree_at(lambda each: each.damping, right, -right.damping)
    check_period(PENDULUM, wrong, jnp.zeros(1), 3.0, method="energy-shaping")


def test_a_reference_is_linearised_where_it_begins():
    def away(t):
        return jnp.array([1.0]) + 0.1 * t

    tracking = Tracking.of(PENDULUM, away, frequency=5.0)
    assert longest(PENDULUM, tracking, [0.0], method="tracking") == pytest.approx(0.2, rel=0.3)

"""How stiff a regulator is made: tried on the model, where friction and limits decide."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.control import Handover, Loop, Regulator, _design, design, judge, linearize, run_episodes
from symoden.control._attraction import by_stiffness
from symoden.known import KnownParts
from symoden.models import ModelConfig, build
from symoden.spaces import Space

from .conftest import CART_POLE

LIMIT, PERIOD = 12.0, 0.01
DRY = 4.0  # [N]


def crane(coulomb, viscous=6.0):
    """A cart in volts, whose back-EMF is friction beside the dry one, and its hanging pole."""
    parts = KnownParts(
        mass_matrix=[["0.7", "0.03 * cos(q2)"], ["0.03 * cos(q2)", "0.012"]],
        potential_energy="-0.3 * cos(q2)",
        input_matrix=[[1.7], [0]],
        dissipation_matrix=[[f"{viscous} + {coulomb} / sqrt(v1**2 + 1e-4)", 0], [0, "3e-4"]],
    )
    return build(ModelConfig(), Space.parse("R1 T1"), 1, known=parts, key=jax.random.key(0))


def home(plant, regulator):
    """Whether episodes that begin up to half a metre away are at rest at zero after ten seconds."""
    q0 = np.random.default_rng(0).uniform(-0.5, 0.5, (16, 2))
    episodes = run_episodes(plant, regulator, q0, np.zeros((16, 2)), Loop(duration=10.0, period=PERIOD))
    return judge(episodes, plant.space, np.zeros(2)).success


def test_stiffer_is_as_with_larger_limits_that_are_kept():
    stiff = Regulator.of(CART_POLE, [0.0, 0.0], limits=5.0, period=PERIOD, stiffness=3.0)
    strong = Regulator.of(CART_POLE, [0.0, 0.0], limits=15.0, period=PERIOD)
    np.testing.assert_allclose(stiff.gain, strong.gain, rtol=1e-9)
    np.testing.assert_allclose(stiff.limits, 5.0)


def test_a_cart_that_dry_friction_holds_is_brought_home_by_larger_gains():
    plant = crane(DRY)
    chosen = by_stiffness(plant, [0.0, 0.0], limits=LIMIT, period=PERIOD)[0]
    softest = Regulator.of(plant, [0.0, 0.0], limits=LIMIT, period=PERIOD)
    there, slowly = home(plant, chosen), home(plant, softest)
    assert there.all()
    assert not slowly.any()


def test_without_friction_the_softest_does():
    for plant in (crane(0.0), CART_POLE):
        softest = Regulator.of(plant, [0.0, 0.0], limits=LIMIT, period=PERIOD)
        chosen = by_stiffness(plant, [0.0, 0.0], limits=LIMIT, period=PERIOD)[0]
        np.testing.assert_array_equal(chosen.gain, softest.gain)


def test_a_regulator_is_as_stiff_as_the_model_asks_for():
    plant = crane(DRY)
    wanted = by_stiffness(plant, [0.0, 0.0], limits=LIMIT, period=PERIOD)[0]
    made = design(plant, [0.0, 0.0], method="lqr", limits=LIMIT, period=PERIOD)
    assert isinstance(made, Regulator)
    np.testing.assert_array_equal(made.gain, wanted.gain)


def test_a_swing_up_ends_with_a_regulator_that_holds_the_model(monkeypatch):
    def held(model, regulator, *, period):
        return float(regulator.gain[0, 0] == softest.gain[0, 0])

    plant = crane(DRY)
    softest = Regulator.of(plant, [0.0, 0.0], limits=LIMIT, period=PERIOD)
    monkeypatch.setattr(_design, "attraction", held)
    monkeypatch.setattr(_design, "searched", lambda model, handover, *starts: handover)
    made = design(plant, [0.0, 0.0], method="swing-up", limits=LIMIT, period=PERIOD)
    assert isinstance(made, Handover)
    np.testing.assert_array_equal(made.near.gain, softest.gain)


def test_what_is_too_stiff_for_its_period_is_left_out(monkeypatch):
    plant, whole = crane(DRY), Regulator.of

    def of(*args, stiffness=1.0, **settings):
        if stiffness > 1:
            raise ValueError
        return whole(*args, **settings)

    monkeypatch.setattr(Regulator, "of", of)
    made = by_stiffness(plant, [0.0, 0.0], limits=LIMIT, period=PERIOD)
    assert len(made) == 1


def test_a_motion_is_planned_where_no_gains_bring_the_model_to_its_regulator(monkeypatch):
    def planned(*args, **settings):
        raise ValueError("planned")

    def idle(model, handover, *starts):
        return eqx.tree_at(lambda whole: whole.far.gains, handover, jnp.zeros(7))

    monkeypatch.setattr(_design, "plan_motion", planned)
    monkeypatch.setattr(_design, "searched", idle)
    with pytest.raises(ValueError, match="planned"):
        design(CART_POLE, [0.0, 0.0], method="swing-up", limits=LIMIT, period=PERIOD)


def test_what_counts_is_friction_at_the_speed_of_the_tolerance():
    """At rest it is twenty times as steep; of viscous friction, and of none, the regulator is that of the slopes."""
    A, _, _ = linearize(crane(DRY), jnp.zeros(2), speed=0.1)
    M = np.array([[0.7, 0.03], [0.03, 0.012]])
    D = np.diag([6 + DRY / np.hypot(0.1, 0.01), 3e-4])
    np.testing.assert_allclose(A[2:, 2:], -np.linalg.solve(M, D), rtol=1e-9)
    for each in (linearize(CART_POLE, jnp.zeros(2), speed=speed)[0] for speed in (0.1, 1.0)):
        np.testing.assert_allclose(each, linearize(CART_POLE, jnp.zeros(2))[0], atol=1e-9)


def test_a_regulator_with_dry_friction_is_that_with_as_much_viscous_friction_at_this_speed():
    viscous = crane(0.0, viscous=6 + DRY / np.hypot(0.1, 0.01))
    dry, smooth = (Regulator.of(each, [0.0, 0.0], limits=LIMIT, period=PERIOD) for each in (crane(DRY), viscous))
    np.testing.assert_allclose(dry.gain, smooth.gain, rtol=1e-6)

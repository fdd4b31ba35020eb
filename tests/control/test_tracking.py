"""Tracking: the error's energy falls as its formula says."""

import hypothesis.strategies as st
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given

from symoden.control import Loop, Tracking, run_episodes

from .conftest import CART_POLE, FULL_ACROBOT, FULL_CART_POLE, rate_of


def reference(t):
    return jnp.stack([0.3 * jnp.sin(2 * t), 1.0 + 0.5 * jnp.cos(t)])


CONTROLLERS = {
    "cart-pole": (FULL_CART_POLE, Tracking.of(FULL_CART_POLE, reference)),
    "acrobot": (FULL_ACROBOT, Tracking.of(FULL_ACROBOT, reference)),
}


@pytest.mark.parametrize("name", CONTROLLERS)
@given(values=st.lists(st.floats(-1, 1), min_size=4, max_size=4), t=st.floats(0, 10))
def test_the_energy_of_the_error_falls_as_its_formula_says(name, values, t):
    system, controller = CONTROLLERS[name]
    e, e_rate = jnp.array(values[:2]), jnp.array(values[2:])
    goal, goal_rate, _ = controller.wanted(jnp.asarray(t))
    q, v = goal + e, goal_rate + e_rate
    rate, _ = rate_of(system, controller, q, v, t)
    s = e_rate + controller.rate * e
    wanted = -s @ system.dissipation_matrix(q, v) @ s - e_rate @ (controller.damping * e_rate)
    wanted = wanted - controller.rate**2 * e @ (controller.damping * e)
    assert rate == pytest.approx(float(wanted), rel=1e-7, abs=1e-7)


def test_on_the_reference_it_stays():
    system, controller = CONTROLLERS["acrobot"]
    q, v, _ = controller.wanted(jnp.asarray(0.0))
    episodes = run_episodes(system, controller, q[None], v[None], Loop(duration=2.0, period=0.002))
    wanted = np.stack([np.asarray(reference(t)) for t in episodes.ts[0]])
    np.testing.assert_allclose(episodes.q[0], wanted, atol=2e-3)


def test_only_fully_actuated_systems_follow_any_reference():
    with pytest.raises(ValueError, match="Tracking needs an input for each of the 2 coordinates"):
        Tracking.of(CART_POLE, reference)

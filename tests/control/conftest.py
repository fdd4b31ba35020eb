"""Systems that controllers are tried on, with the parameters of the paper's tasks."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.control import energy_rate
from symoden.known import KnownParts
from symoden.mechanics import AbstractPortHamiltonian
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space
from symoden.systems import Acrobot, CartPole, Pendulum

PENDULUM = Pendulum(gravity=10.0, damping=0.1, upright=True)
CART_POLE = CartPole(pole_damping=0.05)
FREE_CART_POLE = CartPole()
FULL_CART_POLE = CartPole(cart_damping=0.1, pole_damping=0.05, fully_actuated=True)
ACROBOT = Acrobot(dampings=(0.2, 0.2))
FULL_ACROBOT = Acrobot(dampings=(0.2, 0.2), fully_actuated=True)
FULL = {"pendulum": (PENDULUM, [0.0], 15.0), "cart-pole": (FULL_CART_POLE, [0.0, 0.0], 15.0)}
RATE = eqx.filter_jit(energy_rate)
FULL["acrobot"] = (FULL_ACROBOT, [np.pi, 0.0], 40.0)


def rate_of(plant, controller, q, v, t=0.0):
    """dH_d/dt and the input, as numbers."""
    rate, u = RATE(plant, controller, jnp.asarray(q), jnp.asarray(v), jnp.asarray(t))
    return float(rate), np.asarray(u)


def slide(friction, damping=3.0):
    """A slide of 2 kg on a rail, driven by 5 N/V against dry friction [N], smoothed below 2 mm/s; V is flat."""
    parts = KnownParts(
        mass_matrix=[[2]],
        potential_energy="0*q1",
        input_matrix=[[5]],
        dissipation_matrix=[[f"{damping} + {friction}/sqrt(v1**2 + 4e-6)"]],
    )
    plant = build(ModelConfig(), Space.parse("R1"), 1, known=parts, key=jax.random.key(0))
    assert isinstance(plant, AbstractPortHamiltonian)
    return plant


@pytest.fixture
def learned(scrambled):
    """A model with random weights, known input directions, and a strong potential energy."""

    def make(space, inputs, seed):
        small = BlockConfig(hidden=(4,))
        plain = BlockConfig(constant=True)
        config = ModelConfig(inverse_mass=small, potential=small, actuation=plain, friction=small, knees=(0.5,))
        parsed = Space.parse(space)
        return scrambled(build(config, parsed, inputs, key=jax.random.key(seed)), seed, 0.3)

    return make

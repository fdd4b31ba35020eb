"""One table of spaces, models and systems, and every conformance check on every row."""

import jax
import numpy as np
import pytest

from symoden.models import KINDS, BlockConfig, ModelConfig, Scales, build
from symoden.spaces import Space
from symoden.systems import Acrobot, CartPole, LinkChain, Pendulum
from symoden.testing import check_all

NETWORK = BlockConfig(hidden=(4,))
CORRECTED = BlockConfig(hidden=(3,), constant=True)
SETTINGS = {"inverse_mass": NETWORK, "potential": NETWORK, "actuation": CORRECTED, "energy": (4,), "flow": (4,)}
JOINT = ModelConfig(**SETTINGS, friction=CORRECTED, knees=(0.1, 1.0))
FULL = ModelConfig(**SETTINGS, friction=NETWORK, knees=(), full_friction=True, scaled=False, activation="tanh")

ROWS = {
    "R1": (JOINT, 1, False),
    "T1": (JOINT, 0, True),
    "R2": (FULL, 2, False),
    "T2": (FULL, 1, True),
    "R1 T1": (JOINT, 2, False),
    "T1 R2 T1": (JOINT, 1, False),
}
SYSTEMS = [Pendulum(damping=0.1), CartPole(pole_damping=0.05), Acrobot(dampings=(0.2, 0.2)), LinkChain.of_rods(3)]


def model(config, space, inputs, *, momenta=False):
    space = Space.parse(space)
    units = Scales.units(space, inputs)
    return build(config, space, inputs, momenta=momenta, scales=units, key=jax.random.key(2))


@pytest.mark.parametrize("space", ROWS)
def test_models_on_every_space_keep_every_contract(space, scrambled):
    config, inputs, momenta = ROWS[space]
    check_all(scrambled(model(config, space, inputs, momenta=momenta), 1, 0.7), seed=3)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "dissipative"])
def test_every_kind_of_model_keeps_every_contract(kind, scrambled):
    config = ModelConfig(**SETTINGS, kind=kind, friction=CORRECTED, knees=())
    check_all(scrambled(model(config, "T1 R1", 1), 1, 0.7), seed=4)


def test_a_model_in_single_precision_keeps_every_contract():
    single = jax.tree.map(lambda leaf: leaf.astype(np.float32), model(JOINT, "R1 T1", 1))
    check_all(single)


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda system: type(system).__name__)
def test_analytic_systems_keep_every_contract(system):
    check_all(system, seed=5)

"""A controller for one's own machine is tried on what was learned of it."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.control import Loop, audit_energy, run_episodes
from symoden.evaluation import Ranges
from symoden.experiments import ControlConfig, learned_machine, outside_data, starts_of, try_control
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.systems import Acrobot, CartPole, Pendulum

MODEL = Pendulum(gravity=10.0, damping=0.1)
OTHERS = (dataclasses.replace(MODEL, damping=0.5), dataclasses.replace(MODEL, gravity=9.0))
FULL_ACROBOT = Acrobot(dampings=(0.2, 0.2), fully_actuated=True)
RANGES = Ranges(positions=((-1.0, 1.0),), rates=((-2.0, 2.0),), inputs=((-6.0, 5.0),))
CONFIG = ControlConfig(loop=Loop(duration=2.0, period=0.02), episodes=5)


def test_the_inputs_of_the_logs_are_the_limits():
    machine = learned_machine(MODEL, [1.5], RANGES)
    assert (machine.max_input, machine.target, machine.system) == ((6.0,), (1.5,), MODEL)


@pytest.mark.parametrize(
    ("target", "cyclic", "ends"),
    [
        (0.0, (), (-0.02, 0.3)),  # The data end at 0.3 m, beyond -0.02 m nothing is known.
        (0.9, (), (0.4, 0.9)),  # Outside of the data, but wanted.
        (math.nan, (), (-0.02, 0.3)),
        (math.nan, (0,), (-0.5, 0.5)),
        (0.0, (0,), (-0.5, 0.5)),
    ],
)
def test_carts_begin_where_the_data_were(target, cyclic, ends):
    ranges = Ranges(
        positions=((-0.02, 0.3), (3.0, 3.3)), rates=((-1.0, 1.0),) * 2, inputs=((-5.0, 5.0),), cyclic=cyclic
    )
    machine = learned_machine(CartPole(), [target, 0.0], ranges)
    starts = starts_of(machine, "swing-up")
    assert starts.middle + starts.q == pytest.approx([ends[1], np.pi])
    assert starts.middle - starts.q == pytest.approx([ends[0], -np.pi])
    q, _ = starts.draw(100, 0)
    assert np.all((q[:, 0] >= ends[0]) & (q[:, 0] <= ends[1]))
    free = starts_of(dataclasses.replace(machine, seen=None), "swing-up")
    assert free.q == pytest.approx([0.5, np.pi])


@pytest.mark.parametrize(
    ("seen", "target", "size"),
    [((-0.15, 0.19), 0.0, 0.19), ((6.2, 6.4), 0.0, 0.1168), ((-0.01, 0.02), 0.0, 0.1), ((-1.2, 3.1), 3.14, 0.6)],
)
def test_what_holds_a_balanced_machine_is_tried_from_where_it_was(seen, target, size):
    ranges = Ranges(positions=((-1.0, 1.0), seen), rates=((-1.0, 1.0),) * 2, inputs=((-5.0, 5.0),), cyclic=(0,))
    machine = learned_machine(CartPole(), [0.0, target], ranges)
    assert starts_of(machine, "lqr").q == pytest.approx([0.5, size], abs=1e-4)
    assert starts_of(machine, "swing-up").q == pytest.approx([0.5, np.pi])


def test_episodes_that_no_memory_holds_are_refused():
    with pytest.raises(ValueError, match="at most 10000000 control periods; got 100 of 200000"):
        ControlConfig(loop=Loop(duration=2.0, period=1e-5))


def test_what_is_learned_is_integrated_finely_whatever_its_name():
    """Learned dry friction is stiff."""
    machine = dataclasses.replace(learned_machine(MODEL, [np.pi], RANGES), name="the arm in the cellar")
    results = [try_control(MODEL, each, CONFIG) for each in (machine, dataclasses.replace(machine, seen=None))]
    for result, step in zip(results, (0.001, CONFIG.loop.step), strict=True):
        q0, v0 = starts_of(result.machine, result.method).draw(5, 0)
        again = run_episodes(MODEL, result.controller, q0, v0, dataclasses.replace(CONFIG.loop, step=step))
        np.testing.assert_array_equal(result.episodes.q, again.q)
    assert [result.tried_on for result in results] == ["the learned model", "the arm in the cellar"]


def test_each_stand_in_has_its_share_of_the_episodes():
    result = try_control(MODEL, learned_machine(MODEL, [np.pi], RANGES), CONFIG, plants=OTHERS)
    q0, v0 = starts_of(result.machine, result.method).draw(5, 0)
    loop = dataclasses.replace(CONFIG.loop, step=0.001)
    parts = [run_episodes(OTHERS[k], result.controller, q0[k::2], v0[k::2], loop) for k in range(2)]
    np.testing.assert_allclose(result.episodes.q, np.concatenate([part.q for part in parts]), atol=1e-9)
    rates = [audit_energy(plant, result.controller, part).rates for plant, part in zip(OTHERS, parts, strict=True)]
    np.testing.assert_allclose(result.audit.rates, np.concatenate(rates), atol=1e-9)
    assert result.tried_on == "2 of the ensemble's models"


def test_fewer_episodes_than_stand_ins_are_said_to_be():
    said = []
    config = dataclasses.replace(CONFIG, episodes=1)
    result = try_control(MODEL, learned_machine(MODEL, [np.pi], RANGES), config, plants=OTHERS, tell=said.append)
    assert result.tried_on == "1 of the ensemble's models"
    assert "so few episodes are on 1 of the 2 models" in said


def test_an_input_that_did_nothing_needs_a_limit():
    idle = dataclasses.replace(RANGES, inputs=((0.0, 0.0),))
    with pytest.raises(ValueError, match=r"An input did nothing in the logs.*`--max-input`"):
        try_control(MODEL, learned_machine(MODEL, [np.pi], idle), CONFIG)
    limited = dataclasses.replace(CONFIG, max_input=8.0)
    assert try_control(MODEL, learned_machine(MODEL, [np.pi], idle), limited).limits == (8.0,)


def test_each_input_may_have_a_limit_of_its_own():
    ranges = Ranges(positions=((-4.0, 4.0),) * 2, rates=((-1.0, 1.0),) * 2, inputs=((-1.0, 1.0), (-2.0, 2.0)))
    machine = learned_machine(FULL_ACROBOT, [np.pi, 0.0], ranges)
    config = dataclasses.replace(CONFIG, method="energy-shaping", max_input=(40.0, 30.0), episodes=1)
    assert try_control(FULL_ACROBOT, machine, config).limits == (40.0, 30.0)
    with pytest.raises(ValueError, match="one number for all 2 inputs or one for each"):
        try_control(FULL_ACROBOT, machine, dataclasses.replace(config, max_input=(1.0, 2.0, 3.0)))


def test_free_motion_has_no_controller():
    free = build(ModelConfig(), Space.parse("T1"), 0, key=jax.random.key(0))
    with pytest.raises(ValueError, match="learned from free motion"):
        learned_machine(free, [0.0], dataclasses.replace(RANGES, inputs=()))


def test_a_model_without_energy_is_tried_too_unless_it_was_told_momenta():
    told = build(ModelConfig(kind="naive", flow=(4,)), Space.parse("T1"), 1, momenta=True, key=jax.random.key(0))
    with pytest.raises(ValueError, match=r"A model of momenta must have an inertia, .* NaiveModel has none"):
        try_control(told, learned_machine(told, [0.0], RANGES), CONFIG)
    naive = build(ModelConfig(kind="naive", flow=(4,)), Space.parse("T1"), 1, key=jax.random.key(0))
    config = dataclasses.replace(CONFIG, episodes=2)
    result = try_control(naive, learned_machine(naive, [0.0], RANGES), config)
    assert result.method == "lqr"
    assert 0 <= outside_data(result, RANGES) <= 1
    assert jnp.isfinite(result.episodes.q).all()

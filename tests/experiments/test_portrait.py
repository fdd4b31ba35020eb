"""What is drawn beside the truth: the gauge is found exactly, and the truth compared with itself has no error."""

import dataclasses
import functools
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st
from jaxtyping import Array, Float

from symoden.data import Dataset
from symoden.experiments import Source, fit_gauge, portrait, simulate, task, unseen_rollouts
from symoden.integrate import RK4
from symoden.mechanics import AbstractMechanical
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space

PLAIN = BlockConfig(constant=True)
factors = st.floats(0.01, 100.0)


@functools.cache
def few(name):
    chosen, data = task(name), simulate(task(name), train_initials=3, test_initials=1)
    return Source(name=name, dataset=data.dataset, task=chosen, prediction=data.prediction)


@final
class Rescaled(AbstractMechanical):
    """The motion of a system in other units of momentum: M⁻¹ → β M⁻¹; V, g and D → 1/β of them."""

    truth: AbstractMechanical
    beta: Float[Array, ""]
    offset: Float[Array, ""]
    friction: Float[Array, ""]
    full: bool = eqx.field(static=True)
    momenta: bool = eqx.field(static=True)
    space: Space = eqx.field(static=True)
    inputs: int = eqx.field(static=True)

    def __init__(self, truth, *, beta, offset, friction, full):
        self.truth, self.full, self.momenta = truth, full, False
        self.beta, self.offset, self.friction = (jnp.asarray(float(number)) for number in (beta, offset, friction))
        self.space, self.inputs = truth.space, truth.inputs

    def inverse_mass_matrix(self, q):
        return self.beta * self.truth.inverse_mass_matrix(q)

    def mass_matrix(self, q):
        return self.truth.mass_matrix(q) / self.beta

    def potential_energy(self, q):
        return self.truth.potential_energy(q) / self.beta + self.offset

    def input_matrix(self, q):
        return self.truth.input_matrix(q) / self.beta

    def dissipation_matrix(self, q, v):
        D = self.friction * self.truth.dissipation_matrix(q, v) / self.beta
        return jnp.kron(jnp.array([[0.0, 0.0], [0.0, 1.0]]), D) if self.full else D


def rescaled(truth, beta, *, offset=0.0, friction=1.0, full=False):
    return Rescaled(truth, beta=beta, offset=offset, friction=friction, full=full)


def states(source):
    recordings = source.dataset.train
    return np.concatenate([r.q for r in recordings]), np.concatenate([r.rates for r in recordings])


@pytest.mark.parametrize("name", ["pendulum", "cartpole", "acrobot-full"])
@given(beta=factors, offset=st.floats(-10.0, 10.0))
def test_the_gauge_of_a_rescaled_truth_is_found_exactly(name, beta, offset):
    source = few(name)
    truth = task(name).system
    assert fit_gauge(rescaled(truth, beta, offset=offset), truth, *states(source)) == pytest.approx(beta, rel=1e-9)


def test_wrong_friction_leaves_the_gauge_alone_and_stays_visible():
    source = few("pendulum")
    found = portrait(rescaled(task("pendulum").system, 0.4, friction=1.5), source)
    assert found.gauge == pytest.approx(0.4, rel=1e-9)
    assert [block.error for block in found.blocks] == pytest.approx([0.0, 0.0, 0.0, 0.5], abs=1e-9)


@pytest.mark.parametrize("name", ["pendulum", "cartpole", "acrobot"])
@pytest.mark.parametrize("coordinate", [0, -1])
def test_the_blocks_of_a_rescaled_truth_lie_on_the_truth(name, coordinate):
    source = few(name)
    chosen = range(task(name).system.space.size)[coordinate]
    found = portrait(rescaled(task(name).system, 3.0, offset=1.0), source, coordinate=chosen, points=33)
    assert not found.anchored
    assert [block.symbol for block in found.blocks] == ["M⁻¹", "V", "g", "D"]
    for block in found.blocks:
        assert block.truth.shape == block.learned.shape == (33, len(block.entries))
        np.testing.assert_allclose(block.learned, block.truth, atol=1e-9 * (1 + np.abs(block.truth).max()))
        assert block.error < 1e-9


def test_curves_have_the_values_of_the_system():
    source = few("cartpole")
    truth = task("cartpole").system
    found = {block.symbol: block for block in portrait(truth, source, coordinate=1, points=5).blocks}
    x = np.mean([extreme(states(source)[0][:, 0]) for extreme in (np.min, np.max)])
    q = jnp.array([x, found["V"].values[1]])
    M = truth.inverse_mass_matrix(q)
    assert found["M⁻¹"].entries == ("11", "21", "22")
    np.testing.assert_allclose(found["M⁻¹"].truth[1], [M[0, 0], M[1, 0], M[1, 1]], rtol=1e-12)
    assert found["g"].entries == ("11", "21")
    assert found["V"].truth.min() == 0.0
    assert found["V"].coordinate == "theta [rad]"


def test_what_the_data_fix_is_not_fitted():
    momenta = portrait(task("pendulum-canonical").system, few("pendulum-canonical"))
    assert (momenta.gauge, momenta.anchored) == (1.0, True)
    config = ModelConfig(inverse_mass=PLAIN, potential=BlockConfig(hidden=(4,)), friction=PLAIN, knees=())
    model = build(config, Space.parse("T1"), 1, input_matrix=np.array([[2.0]]), key=jax.random.key(0))
    found = portrait(model, few("pendulum"))
    assert (found.gauge, found.anchored) == (1.0, True)
    assert found.blocks[2].error == pytest.approx(1.0)


def test_one_turn_of_an_angle_is_shown():
    turns = portrait(task("pendulum-canonical").system, few("pendulum-canonical")).blocks[0].values
    assert (turns[0], turns[-1]) == (-np.pi, np.pi)


def test_friction_on_the_whole_state_is_compared_on_the_momenta():
    (*_, friction) = portrait(rescaled(task("cartpole").system, 3.0, full=True), few("cartpole"), points=5).blocks
    assert friction.learned.shape == (5, 3)
    assert friction.error < 1e-9


def test_friction_where_there_is_none_has_no_finite_error():
    source = few("pendulum")
    free = dataclasses.replace(task("pendulum").system, damping=0.0)
    still = dataclasses.replace(source, task=dataclasses.replace(task("pendulum"), system=free))
    assert portrait(task("pendulum").system, still).blocks[3].error == np.inf
    assert portrait(free, still).blocks[3].error == 0.0


def test_rollouts_of_the_truth_lie_on_the_truth_and_go_on_beyond_training():
    found = unseen_rollouts(task("cartpole").system, few("cartpole"), solver=RK4(16), count=7, coordinate=1)
    assert found.coordinate == "theta [rad]"
    assert found.trained == pytest.approx(19 * 0.02)
    assert found.labels == ("force -2", "force -1", "force 0", "force 1", "force 2", "force -2", "force -1")
    starts = {tuple(trajectory.q[0]) for trajectory in found.truth}
    assert len(starts) == 7
    assert not starts & {tuple(trajectory.q[0]) for trajectory in few("cartpole").dataset.train}
    for truth, prediction in zip(found.truth, found.predictions, strict=True):
        assert len(truth) == 40
        np.testing.assert_allclose(prediction.q, truth.q, atol=1e-6)


def test_only_a_task_has_a_truth():
    data = Source(name="arm.toml", dataset=Dataset(name="arm", space="T1", train=few("pendulum").dataset.train))
    with pytest.raises(ValueError, match="Only a task"):
        portrait(task("pendulum").system, data)
    with pytest.raises(ValueError, match="Only a task"):
        unseen_rollouts(task("pendulum").system, data, solver=RK4())


def test_a_model_without_energy_has_no_portrait():
    model = build(ModelConfig(kind="naive", flow=(4,)), Space.parse("T1"), 1, key=jax.random.key(0))
    with pytest.raises(ValueError, match="NaiveModel"):
        portrait(model, few("pendulum"))

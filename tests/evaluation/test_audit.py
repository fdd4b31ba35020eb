"""The power audit: silent on the true system, loud on a wrong one."""

import dataclasses
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.data import Trajectory
from symoden.evaluation import Ranges, anchor, audit, inspect_model
from symoden.evaluation._inspect import units
from symoden.experiments import simulate, task
from symoden.integrate import RK4, rollout
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space
from symoden.systems import Pendulum

PLAIN = BlockConfig(constant=True)
SMALL = {"inverse_mass": PLAIN, "potential": BlockConfig(hidden=(4,)), "flow": (8,), "energy": (8,)}


def small(kind, space, inputs=1, **options):
    settings = {"actuation": PLAIN, "friction": PLAIN, "knees": (), **SMALL}
    config = ModelConfig(kind=kind, **(settings | options.pop("config", {})))
    return build(config, Space.parse(space), inputs, key=jax.random.key(1), **options)


@pytest.fixture(scope="module")
def cartpole():
    return simulate(task("cartpole"), train_initials=4, test_initials=2).dataset


def audited(model, dataset, **options):
    solver = RK4(options.pop("substeps", 4))
    ranges = Ranges.of(dataset.train, model.space)
    found = audit(model, dataset.test, ranges=ranges, hold=dataset.hold, solver=solver)
    return SimpleNamespace(**vars(found))  # Whatever is None for some models is a number here.


def inspected(model, dataset, **options):
    found = inspect_model(model, Ranges.of(dataset.train, model.space), **options)
    profiles = [SimpleNamespace(**vars(profile)) for profile in found.profiles]
    return SimpleNamespace(**(vars(found) | {"profiles": profiles}))


def test_the_true_system_balances_its_energy(cartpole):
    found = audited(task("cartpole").system, cartpole)
    assert found.rollout_violation < 1e-7
    assert found.log_residual_max < 1e-5
    assert found.diverged == 0
    assert found.inverse_mass_min > 0
    assert found.dissipation_min == pytest.approx(0, abs=1e-12)


def test_the_violation_along_rollouts_falls_with_the_fourth_power_of_the_step(cartpole):
    coarse, fine = (audited(task("cartpole").system, cartpole, substeps=k).rollout_violation for k in (1, 2))
    assert np.log2(coarse / fine) == pytest.approx(4, abs=0.6)


@pytest.mark.parametrize("kind", ["dissipative", "unstructured", "symoden"])
@pytest.mark.parametrize("full", [False, True])
def test_every_model_with_an_energy_balances_it_along_rollouts_whatever_its_weights(cartpole, kind, full):
    found = audited(small(kind, "R1 T1", config={"full_friction": full}), cartpole)
    assert found.rollout_violation < 1e-6
    assert found.dissipation_min > -1e-12


def test_a_wrong_model_fails_the_balance_of_the_recordings(cartpole):
    heavy = dataclasses.replace(task("cartpole").system, pole_mass=1.0)
    assert audited(heavy, cartpole).log_residual_median > 0.01
    assert audited(heavy, cartpole).rollout_violation < 1e-7


@pytest.mark.parametrize("kind", ["naive", "geometric"])
def test_a_model_without_energy_is_audited_for_its_range_alone(cartpole, kind):
    found = audited(small(kind, "R1 T1"), cartpole)
    assert found.rollout_violation is found.log_residual_max is found.dissipation_min is None
    assert 0 <= found.outside <= 1


def test_training_data_lie_inside(cartpole):
    system = task("cartpole").system
    ranges = Ranges.of(cartpole.train, system.space)
    found = audit(system, cartpole.train, ranges=ranges, hold="zero", solver=RK4())
    assert found.outside == 0
    assert found.recordings == len(cartpole.train)


def test_no_recording_is_no_audit(cartpole):
    system = task("cartpole").system
    ranges = Ranges.of(cartpole.train, system.space)
    with pytest.raises(ValueError, match="at least one recording"):
        audit(system, (), ranges=ranges, hold="zero", solver=RK4())


def test_eigenvalues_of_the_true_mass_matrix_are_found(cartpole):
    found = inspected(task("cartpole").system, cartpole)
    low, high = found.mass_matrix_eigenvalues
    # Of [[1, a], [a, 1/6]] with a = cos θ / 4.
    extreme = np.linalg.eigvalsh([[1, 0.25], [0.25, 1 / 6]])
    assert low == pytest.approx(extreme[0], rel=0.05)
    assert high == pytest.approx(extreme[1], rel=0.05)
    assert found.dissipation_eigenvalues == pytest.approx((0, 0.05), abs=1e-12)


def test_profiles_follow_the_blocks(cartpole):
    system = task("cartpole").system
    along_angle = inspected(system, cartpole, points=7).profiles[1]
    assert along_angle.values[[0, -1]] == pytest.approx(Ranges.of(cartpole.train, system.space).positions[1])
    expected = 0.5 * 9.8 * 0.5 * (1 + np.cos(along_angle.values))
    np.testing.assert_allclose(along_angle.potential_energy, expected - expected.min(), atol=1e-9)
    np.testing.assert_allclose(along_angle.mass_matrix[:, 0, 1] ** 2, np.cos(along_angle.values) ** 2 / 16, atol=1e-9)
    np.testing.assert_allclose(along_angle.input_matrix[:, :, 0], [[1, 0]] * 7, atol=1e-12)


def test_friction_is_a_force_along_each_velocity(cartpole):
    found = inspected(task("cartpole").system, cartpole)
    _, pole = found.friction
    np.testing.assert_allclose(pole.force, 0.05 * pole.velocities)
    assert pole.velocities[-1] == -pole.velocities[0] == pytest.approx(found.velocities[1])


@pytest.mark.parametrize("kind", ["dissipative", "unstructured", "symoden", "naive", "geometric"])
@pytest.mark.parametrize("momenta", [False, True])
def test_every_model_can_be_inspected(cartpole, kind, momenta):
    model = small(kind, "R1 T1", momenta=momenta)
    found = inspected(model, cartpole)
    for each in (found.mass_matrix_eigenvalues, found.dissipation_eigenvalues, found.profiles[0].mass_matrix):
        assert (each is None) == (kind in ("naive", "geometric"))
    if found.mass_matrix_eigenvalues is not None and (kind, momenta) != ("unstructured", True):
        assert 0 < found.mass_matrix_eigenvalues[0] <= found.mass_matrix_eigenvalues[1]
    scaled = "momenta measured" if momenta else "none: only ratios are known"
    none = "nothing: such a model has neither inertia nor energy"
    assert found.anchor.partition(";")[0] == (none if kind in ("naive", "geometric") else scaled)


@pytest.mark.parametrize(
    ("space", "told", "expected"),
    [
        ("T2", ("rad", "rad"), {"M": "kg m²", "V": "J", "D": "N m s"}),
        ("R2", ("", "m"), {"M": "kg", "V": "J", "D": "N s/m"}),
        ("R1 T1", ("m", "rad"), {"M": "kg, kg m, kg m²", "V": "J", "D": "N s/m, N s, N m s"}),
        ("R1 T1", ("rad", "rad"), {"M": "kg m²", "V": "J", "D": "N m s"}),  # An angle that winds something up.
    ],
)
def test_blocks_have_units_where_something_fixes_the_scale(space, told, expected):
    assert units(small("dissipative", space, input_matrix=np.array([[1.0], [0.0]])), told) == expected
    assert units(small("dissipative", space, momenta=True), told) == expected
    assert units(small("dissipative", space), told) == {}
    assert units(small("naive", space, momenta=True), told) == {}


@pytest.mark.parametrize(
    ("told", "measured", "inertia"),
    [((), ("", "rad"), "kg, kg m, kg m²"), (("rad", ""), ("rad", "rad"), "kg m²"), (("m", "rad"), ("m", "rad"), None)],
)
def test_what_coordinates_are_measured_in_is_told_with_what_was_learned(cartpole, told, measured, inertia):
    found = inspected(small("dissipative", "R1 T1", momenta=True), cartpole, position_units=told)
    assert found.position_units == measured
    assert found.units["M"] == (inertia or "kg, kg m, kg m²")


@pytest.mark.parametrize("kind", ["dissipative", "unstructured", "symoden"])
def test_a_known_input_matrix_fixes_the_scale(kind):
    assert anchor(small(kind, "R1 T1", input_matrix=np.array([[1.0], [0.0]]))) == "input_matrix given"


@pytest.mark.parametrize("damping", [0.15, 0.5])
def test_noise_at_rest_is_no_error_of_the_model(damping):
    """Of a swing that has died down long before its end."""
    system = Pendulum(damping=damping)
    ts, us = 0.01 * np.arange(6001.0), np.zeros((6001, 1))
    path = rollout(system, jnp.array([1.2]), jnp.zeros(1), jnp.asarray(ts), jnp.asarray(us))
    noise = np.random.default_rng(0).normal(size=(2, 6001, 1))
    q, rates = np.asarray(path.q) + 1e-4 * noise[0], np.asarray(path.rates) + 1e-3 * noise[1]
    log = Trajectory(name="decay", ts=ts, q=q, rates=rates, us=us)
    found = audit(system, [log], ranges=Ranges.of([log], system.space), hold="zero", solver=RK4(4))
    assert found.log_residual_median is not None
    assert found.log_residual_median < 0.1

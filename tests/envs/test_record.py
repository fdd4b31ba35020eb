"""Recordings are what happened: in our environments, in Gymnasium's pendulum and in MuJoCo."""

import dataclasses

import equinox as eqx
import gymnasium
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.data import DataError, DataWarning
from symoden.envs import MechanismEnv, Sensors, random_levels, record, sensors_of
from symoden.integrate import HOLDS, RK4, rollout
from symoden.systems import Acrobot, CartPole, Pendulum

compiled = eqx.filter_jit(rollout)


def test_a_recording_of_our_own_environment_is_a_rollout_of_its_system():
    system = Acrobot(dampings=(0.2, 0.1))
    data = record(MechanismEnv(system, max_input=4.0), 3, test_episodes=1, steps=60, seed=5)
    assert (data.space, data.momenta, data.hold) == ("T2", False, "zero")
    assert [each.name for each in data.recordings] == ["episode-000", "episode-001", "episode-002", "episode-003"]
    assert len(data.test) == 1
    for each in data.recordings:
        q0, v0 = jnp.array(each.q[0]), jnp.array(each.rates[0])
        path = compiled(system, q0, v0, jnp.array(each.ts), jnp.array(each.us), solver=RK4(4))
        np.testing.assert_allclose(each.q, path.q, atol=1e-8)
        np.testing.assert_allclose(each.rates, path.rates, atol=1e-8)


def test_momenta_are_recorded_as_momenta():
    data = record(MechanismEnv(Pendulum(momenta=True)), 1, steps=10)
    assert data.momenta


def test_equal_seeds_give_equal_recordings_and_others_do_not():
    first, same, other = (record(MechanismEnv(CartPole()), 2, steps=5, seed=seed) for seed in (1, 1, 2))
    for ours, theirs, different in zip(first.train, same.train, other.train, strict=True):
        for array in ("q", "rates", "us"):
            assert np.array_equal(getattr(ours, array), getattr(theirs, array))
            assert (getattr(ours, array)[0] != getattr(different, array)[0]).all()


def test_actions_are_recorded_as_they_acted():
    env = MechanismEnv(CartPole(), max_input=1.5)
    data = record(env, 1, steps=4, policy=lambda observation: np.array([10.0 * np.sign(observation[1])]))
    assert set(np.unique(np.abs(data.train[0].us))) == {1.5}


def test_a_policy_sees_what_the_environment_shows():
    seen = []
    env = MechanismEnv(Pendulum())
    record(env, 1, steps=3, policy=lambda observation: seen.append(observation) or np.zeros(1))
    assert [each.shape for each in seen] == [(3,)] * 3


# Gymnasium's pendulum


def test_the_recording_of_gymnasiums_pendulum_obeys_its_integrator():
    data = record(gymnasium.make("Pendulum-v1"), 6)
    assert (data.name, data.space) == ("Pendulum-v1", "T1")
    assert np.concatenate([np.abs(each.rates) for each in data.train]).max() < 8
    assert np.concatenate([np.abs(each.q) for each in data.train]).max() > np.pi
    raw = record(gymnasium.make("Pendulum-v1"), 6, sensors=dataclasses.replace(SENSORS, staggered=False))
    for each in raw.train:
        v = each.rates[:-1] + 0.05 * (15 * np.sin(each.q[:-1]) + 3 * each.us[:-1])
        np.testing.assert_allclose(each.rates[1:], v, atol=1e-5)
        np.testing.assert_allclose(each.q[1:], each.q[:-1] + 0.05 * v, atol=1e-5)


def test_a_staggered_recording_is_that_of_the_continuous_pendulum_to_second_order():
    errors = {}
    for staggered in (False, True):
        env = gymnasium.make("Pendulum-v1")
        data = record(env, 10, sensors=dataclasses.replace(SENSORS, staggered=staggered))
        assert data.hold == ("linear" if staggered else "zero")
        ends = [_end_after_one_second(each, HOLDS[data.hold]) for each in data.train if len(each) > 20]
        errors[staggered] = np.median(ends)
    assert errors[True] < 0.005
    assert errors[True] < errors[False] / 5


SENSORS = sensors_of(gymnasium.make("Pendulum-v1"))


def _end_after_one_second(recording, hold):
    """Distance of a recording from the true pendulum's rollout after 1 s [rad]."""
    q0, v0, ts, us = (
        jnp.array(each) for each in (recording.q[0], recording.rates[0], recording.ts[:21], recording.us[:21])
    )
    path = compiled(Pendulum(gravity=10.0, upright=True), q0, v0, ts, us, solver=RK4(4), hold=hold)
    return abs(path.q[-1, 0] - recording.q[20, 0])


def test_columns_of_the_observation_can_be_the_sensors():
    sensors = Sensors.columns("R1", dt=0.05, positions=[1], velocities=[2])
    data, known = (record(gymnasium.make("Pendulum-v1"), 1, sensors=each, steps=5) for each in (sensors, None))
    np.testing.assert_allclose(data.train[0].q[:-1], np.sin(known.train[0].q), atol=1e-6)
    rates = data.train[0].rates
    np.testing.assert_allclose((rates[1:] + rates[:-1]) / 2, known.train[0].rates, atol=1e-6)


def test_a_recording_ends_where_the_episode_does_unless_it_may_go_on():
    env = MechanismEnv(CartPole(), max_input=10.0, track=1.0)
    short, long = (record(env, 3, steps=50, past_end=past_end) for past_end in (False, True))
    assert all(len(each) == 51 for each in long.train)
    assert min(len(each) for each in short.train) < 51
    for ours, theirs in zip(short.train, long.train, strict=True):
        outside = np.flatnonzero(np.abs(ours.q[:, 0]) > 1.0)
        assert outside.tolist() == ([] if len(ours) == 51 else [len(ours) - 1])
        assert len(ours) <= len(theirs)


def test_episodes_without_a_step_are_left_out():
    def read(env, observation, info):
        return None if info["q"][0] < 0 else (info["q"], info["v"])

    env = MechanismEnv(CartPole())
    sensors = Sensors(space="R1 T1", dt=0.05, read=read)
    with pytest.warns(DataWarning, match="CartPole|MechanismEnv.*episodes ended before their first step"):
        data = record(env, 8, steps=5, sensors=sensors)
    assert 0 < len(data.train) < 8
    never = Sensors(space="R1 T1", dt=0.05, read=lambda env, observation, info: None)
    with pytest.raises(DataError, match=r"must last for a step .* none of 2 did. Record with `past_end=True`"):
        record(env, 2, sensors=never)


# MuJoCo


@pytest.fixture(scope="module")
def mujoco():
    pytest.importorskip("mujoco", reason="mujoco is not installed: pip install gymnasium[mujoco]")
    pytest.importorskip("imageio", reason="imageio is not installed: pip install gymnasium[mujoco]")
    env = gymnasium.make("InvertedDoublePendulum-v5", frame_skip=2)
    policy = random_levels(env.action_space, dt=0.02, scale=0.03, seed=0)
    return env, record(env, 5, policy=policy, past_end=True)


def test_mujocos_joints_are_read_until_an_end_stop(mujoco):
    env, data = mujoco
    assert (data.name, data.space) == ("InvertedDoublePendulum-v5", "R1 T1 T1")
    assert env.unwrapped.dt == 0.02
    for each in data.train:
        assert np.diff(each.ts) == pytest.approx(0.02)
        assert np.abs(each.q[:, 0] + 0.02 * each.rates[:, 0]).max() < 1.0
        lag = np.diff(each.q, axis=0) - 0.01 * (each.rates[1:] + each.rates[:-1])
        assert np.median(np.abs(lag), axis=0).max() < 1e-3  # positions follow velocities, by the trapezoidal rule


def test_without_input_mujocos_joint_damping_takes_energy(mujoco):
    env, _ = mujoco
    env.reset(seed=1)
    state, energies = env.unwrapped.data, []
    env.unwrapped.model.opt.enableflags |= 2  # `mjENBL_ENERGY`
    for _ in range(30):
        env.step(np.zeros(1, np.float32))
        energies.append(state.energy.sum())
    assert np.diff(energies).max() < 1e-3
    assert energies[-1] < energies[0]


# The default excitation


@given(seed=st.integers(0, 99), inputs=st.integers(1, 3), scale=st.floats(0.1, 1.0))
@settings(max_examples=10)
def test_random_levels_stay_within_their_limits_and_are_held(seed, inputs, scale):
    box = gymnasium.spaces.Box(np.float32(-1.0), np.float32(3.0), (inputs,))
    policy = random_levels(box, dt=0.05, hold=(0.1, 0.3), scale=scale, seed=seed)
    levels = np.stack([policy(None) for _ in range(400)])
    assert levels.shape == (400, inputs)
    assert np.abs(levels - 1.0).max() <= 2 * scale + 1e-6
    assert np.abs(levels - 1.0).max() > 1.8 * scale
    for column in levels.T:
        steps = np.diff(np.flatnonzero(np.diff(column)))
        assert set(steps) == set(range(2, 7))


# Refusals


def test_what_cannot_be_recorded_is_refused():
    with pytest.raises(ValueError, match="at least 1 episode, 0 test episodes, 1 step; got 0, 0 and 500"):
        record(MechanismEnv(Pendulum()), 0)
    with pytest.raises(ValueError, match=r"Actions must be continuous, a bounded `Box` of one axis; got Discrete\(2\)"):
        record(gymnasium.make("CartPole-v1"))
    with pytest.raises(ValueError, match=r"cannot be read without `sensors`. Give `Sensors.columns"):
        sensors_of(gymnasium.make("MountainCarContinuous-v0"))
    box = gymnasium.spaces.Box(-1.0, 1.0, (1,))
    for hold, scale in (((0.5, 0.1), 1.0), ((0.1, 0.5), 0.0), ((0.01, 0.02), 1.0)):
        with pytest.raises(ValueError, match="`hold` must be a shortest and a longest time"):
            random_levels(box, dt=0.05, hold=hold, scale=scale)
    with pytest.raises(ValueError, match="Actions must be continuous"):
        random_levels(gymnasium.spaces.Box(-np.inf, np.inf, (1,)), dt=0.05)

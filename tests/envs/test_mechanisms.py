"""The registered environments: Gymnasium's own check, and what they are."""

import subprocess
import sys

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from symoden.envs import MechanismEnv
from symoden.mechanics import AbstractMechanical
from symoden.systems import Pendulum

IDS = {
    "symoden/DampedPendulum-v0": (1, 0.05, 200),
    "symoden/DampedCartPole-v0": (1, 0.02, 1000),
    "symoden/DampedAcrobot-v0": (1, 0.05, 400),
    "symoden/FullyActuatedCartPole-v0": (2, 0.02, 1000),
    "symoden/FullyActuatedAcrobot-v0": (2, 0.05, 400),
}


def made(name, **options):
    """The environment and its system."""
    env = gymnasium.make(name, **options).unwrapped
    assert isinstance(env, MechanismEnv)
    assert isinstance(env.dynamics, AbstractMechanical)
    return env, env.dynamics


every_id = pytest.mark.parametrize("name", IDS)


@every_id
@pytest.mark.usefixtures("advice_ignored")
def test_gymnasiums_own_check_passes(name):
    check_env(gymnasium.make(name).unwrapped)


@every_id
def test_the_target_is_upright_where_the_potential_energy_is_largest(name):
    env, system = made(name)
    n = system.space.size
    target = np.zeros(n) if env.target is None else np.array(env.target)
    around = np.random.default_rng(0).uniform(-np.pi, np.pi, (200, n))
    assert system.potential_energy(jnp.array(target)) > jax.vmap(system.potential_energy)(jnp.array(around)).max()
    rewards = []
    for away in (0.0, 2 * np.pi - 0.5):
        env.reset(options={"q": target + away * np.eye(n)[-1], "v": np.zeros(n)})
        rewards.append(env.step(np.zeros(system.inputs))[1])
    assert rewards[0] == pytest.approx(0.0, abs=1e-6)
    assert -0.4 < rewards[1] < -0.2


@every_id
def test_sizes_periods_and_lengths_of_episodes(name):
    inputs, dt, steps = IDS[name]
    assert made(name)[0].dt == dt
    env = gymnasium.make(name)
    assert env.action_space.shape == (inputs,)
    assert env.metadata["render_fps"] == round(1 / dt)
    env.reset(seed=0)
    ends = [env.step(env.action_space.sample())[2:4] for _ in range(steps)]
    assert ends == [(False, False)] * (steps - 1) + [(False, True)]


def test_limits_of_the_fully_actuated_hold_them_anywhere_and_those_of_the_others_do_not():
    holds = {}
    for name in IDS:
        env, system = made(name)
        angles = jnp.array(np.random.default_rng(0).uniform(-np.pi, np.pi, (100, system.space.size)))
        slopes = jax.vmap(jax.grad(system.potential_energy))(angles)
        driven = np.asarray(system.input_matrix(angles[0])).any(axis=1)
        needed = np.abs(slopes)[:, driven]
        holds[name] = not slopes[:, ~driven].any() and bool((needed <= env._limits).all())
    assert holds == {name: "Fully" in name for name in IDS}


def test_gymnasium_makes_them_without_our_import():
    program = "import gymnasium; print(gymnasium.make('symoden.envs:symoden/DampedPendulum-v0').spec.id)"
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False, text=True)
    assert answer.stdout.strip() == "symoden/DampedPendulum-v0", answer.stderr


@pytest.mark.parametrize(
    ("absent", "module", "message"),
    [
        ("gymnasium", "symoden.envs", 'Environments need Gymnasium. Install "symoden[gym]".'),
        ("pygame", "symoden.envs._window", 'A window needs pygame. Install "symoden[gym]".'),
    ],
)
def test_the_message_says_what_to_install(absent, module, message):
    program = f"import sys; sys.modules['{absent}'] = None; import symoden.data, symoden.systems, {module}"
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False, text=True)
    assert answer.stderr.strip().endswith(message)


def test_parameters_of_a_registered_environment_can_be_changed():
    heavy = Pendulum(mass=3.0, upright=True)
    env, system = made("symoden/DampedPendulum-v0", dynamics=heavy, dt=0.01, max_input=7.5)
    assert system is heavy
    assert (env.dt, env._limits.tolist()) == (0.01, [7.5])

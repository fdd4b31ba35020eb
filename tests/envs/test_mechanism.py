"""One class for systems and models: it adds nothing to their physics, keeps its limits, and says what is wrong."""

import copy
import pickle

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.envs import registration
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings, strategies as st

from symoden.envs import MechanismEnv
from symoden.integrate import RK4, rollout
from symoden.models import BlockConfig, Kind, ModelConfig, build
from symoden.spaces import Space
from symoden.systems import Acrobot, CartPole, Pendulum

SYSTEMS = [
    Pendulum(damping=0.1, upright=True),
    Pendulum(damping=0.1, momenta=True),
    CartPole(pole_damping=0.05, cart_damping=0.2),
    Acrobot(dampings=(0.2, 0.2), fully_actuated=True),
]
every_system = pytest.mark.parametrize("system", SYSTEMS, ids=lambda s: f"{type(s).__name__}-{s.momenta}")


def model(space="R1 T1", inputs=1, kind: Kind = "dissipative"):
    config = ModelConfig(
        kind=kind, inverse_mass=BlockConfig(hidden=(4,)), potential=BlockConfig(hidden=(4,)), flow=(4,)
    )
    return build(config, Space.parse(space), inputs, key=jax.random.key(0))


def rates_name(system):
    return "p" if system.momenta else "v"


def start(env, q, rates):
    return env.reset(options={"q": q, rates_name(env.dynamics): rates})


def state_of(env, action=None):
    """State of the dynamics, after a step if there is an action."""
    if action is not None:
        env.step(action)
    assert env._motion is not None
    return env._motion.state


@every_system
@given(seed=st.integers(0, 1000))
@settings(max_examples=5)
def test_steps_are_a_rollout_of_the_system(system, seed):
    generator, env = np.random.default_rng(seed), MechanismEnv(system, dt=0.03, substeps=2, max_input=5.0)
    n, us = system.space.size, generator.uniform(-5, 5, (8, system.inputs))
    q, rates = generator.uniform(-3, 3, (2, n))
    start(env, q, rates)
    seen = [env.step(u) for u in us]
    held = jnp.array(np.concatenate([us, us[-1:]]))
    path = rollout(system, jnp.array(q), jnp.array(rates), jnp.array(0.03 * np.arange(9)), held, solver=RK4(2))
    for k, (observation, *_, info) in enumerate(seen, start=1):
        np.testing.assert_allclose(info[rates_name(system)], path.rates[k], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(info["q"], system.space.wrap(path.q[k]), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(observation, path.observations[k], rtol=1e-6, atol=1e-6)


@every_system
def test_the_default_substeps_are_accurate(system):
    paths = []
    for substeps in (4, 64):
        env = MechanismEnv(system, substeps=substeps)
        start(env, [1.0] * system.space.size, [3.0] * system.space.size)
        paths.append([env.step([2.0] * system.inputs)[4]["q"] for _ in range(40)])
    assert np.abs(system.space.difference(jnp.array(paths[0][-1]), jnp.array(paths[1][-1]))).max() < 1e-4


@every_system
def test_energy_never_grows_without_input(system):
    env = MechanismEnv(system)
    env.reset(seed=3)
    states = [state_of(env), *(state_of(env, np.zeros(system.inputs)) for _ in range(100))]
    energies = np.array([system.hamiltonian(*jnp.split(jnp.array(state), 2)) for state in states])
    assert (np.diff(energies) < 1e-6).all()
    assert energies[-1] < energies[0] - 0.01


@every_system
def test_equal_seeds_give_equal_episodes_and_others_do_not(system):
    def episode(seed):
        env = MechanismEnv(system, noise=0.01)
        env.action_space.seed(5)
        seen = [env.reset(seed=seed)[0], *(env.step(env.action_space.sample())[0] for _ in range(10))]
        return np.stack([*seen, env.reset()[0]])

    assert (episode(1) == episode(1)).all()
    assert (episode(1) != episode(2)).any(axis=1).all()


@given(action=st.lists(st.floats(-1e9, 1e9) | st.sampled_from([np.inf, -np.inf]), min_size=2, max_size=2))
def test_inputs_stay_within_their_limits(action):
    env = MechanismEnv(SYSTEMS[3], max_input=(3.0, 0.5))
    env.reset(seed=0)
    *_, info = env.step(action)
    assert (np.abs(info["u"]) <= [3.0, 0.5]).all()
    again = MechanismEnv(SYSTEMS[3], max_input=(3.0, 0.5))
    again.reset(seed=0)
    assert (state_of(again, np.clip(action, [-3, -0.5], [3, 0.5])) == state_of(env)).all()


def test_the_reward_is_of_distance_rates_and_inputs():
    env = MechanismEnv(CartPole(), target=(1.0, 3.0))
    start(env, [0.5, -3.0], [0.3, -0.2])
    _, reward, *_, info = env.step([1.5])
    distance = info["q"] - [1.0, 3.0]
    distance[1] += 2 * np.pi
    assert abs(distance[1]) < 1
    assert reward == pytest.approx(-(distance @ distance + 0.1 * info["v"] @ info["v"] + 0.001 * 1.5**2))


def test_noise_is_on_the_measurement_and_not_on_the_motion():
    quiet, noisy = (MechanismEnv(CartPole(), noise=noise) for noise in (0.0, (0.1, 0.2, 0.3, 0.4)))
    errors = []
    for _ in range(300):
        start(quiet, [0.2, 1.0], [0.0, 0.0])
        start(noisy, [0.2, 1.0], [0.0, 0.0])
        (_, reward, *_, truth), (observation, same, *_, measured) = quiet.step([1.0]), noisy.step([1.0])
        assert same == reward
        np.testing.assert_allclose(observation[:3], CartPole().space.embed(jnp.array(measured["q"])), rtol=1e-6)
        errors.append(np.concatenate([measured["q"] - truth["q"], measured["v"] - truth["v"]]))
    assert np.std(errors, axis=0) == pytest.approx([0.1, 0.2, 0.3, 0.4], rel=0.15)


def test_an_episode_ends_where_the_track_does_and_nowhere_without_one():
    ends = {}
    for track in (1.0, None):
        env = MechanismEnv(CartPole(), max_input=10.0, track=track)
        start(env, [0.0, np.pi], [0.0, 0.0])
        steps = [env.step([10.0]) for _ in range(30)]
        ends[track] = [(bool(info["q"][0] > 1.0), terminated) for _, _, terminated, _, info in steps]
    assert {left == terminated for left, terminated in ends[1.0]} == {True}
    assert ends[1.0][-1] == (True, True)
    assert not any(terminated for _, terminated in ends[None])


@pytest.mark.parametrize("kind", ["dissipative", "geometric", "naive"])
@pytest.mark.usefixtures("advice_ignored")
def test_a_model_is_an_environment(kind):
    learned = model(kind=kind)
    env = MechanismEnv(learned, render_mode="rgb_array")
    registration.register("Learned-v0", lambda **options: MechanismEnv(learned, **options))
    try:
        check_env(gymnasium.make("Learned-v0").unwrapped)
    finally:
        del registration.registry["Learned-v0"]
    start(env, [0.1, 2.0], [0.3, -0.4])
    *_, info = env.step([1.0])
    u, ts = jnp.ones((2, 1)), jnp.array([0.0, 0.05])
    path = rollout(learned, jnp.array([0.1, 2.0]), jnp.array([0.3, -0.4]), ts, u, solver=RK4(4))
    np.testing.assert_allclose(info["q"], path.q[1], rtol=1e-9)
    np.testing.assert_allclose(info["v"], path.rates[1], rtol=1e-9)


def test_a_model_in_single_precision_moves_in_double():
    single = jax.tree.map(lambda leaf: leaf.astype(np.float32) if leaf.dtype == np.float64 else leaf, model("T1"))
    env = MechanismEnv(single)
    env.reset(seed=0)
    with jax.enable_x64(False):
        *_, info = env.step([0.5])
    assert info["q"].dtype == np.float64
    assert info["q"].item() != float(np.float32(info["q"].item()))


def test_where_a_model_diverges_the_episode_ends_at_its_last_finite_state():
    wild = jax.tree.map(lambda leaf: 1e3 * leaf, model("T1"))
    env = MechanismEnv(wild)
    env.reset(seed=0)
    steps = [env.step([1.0]) for _ in range(50)]
    assert any(terminated for _, _, terminated, _, _ in steps)
    assert all(np.isfinite(observation).all() for observation, *_ in steps)


@pytest.mark.parametrize("again", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
@pytest.mark.parametrize("dynamics", [CartPole(), model()])
def test_a_copy_goes_on_as_the_original_does(again, dynamics):
    env = MechanismEnv(dynamics, noise=0.1)
    env.reset(seed=0)
    env.step([1.0])
    twin = again(env)
    assert (env.step([-1.0])[0] == twin.step([-1.0])[0]).all()
    twin.step([1.0])
    assert (state_of(env) != state_of(twin)).any()


# Pictures


@pytest.mark.parametrize(
    ("dynamics", "options"),
    [
        (Pendulum(), {}),
        (CartPole(), {"track": 1.0, "size": (300, 100)}),
        (Acrobot(), {}),
        (model(), {}),
        (model(), {"points": CartPole().points}),
    ],
)
def test_pictures_have_their_size_and_show_the_motion(dynamics, options):
    env = MechanismEnv(dynamics, render_mode="rgb_array", **options)
    env.reset(seed=0)
    before = env.render()
    env.step([2.0])
    after = env.render()
    width, height = options.get("size", (480, 480))
    assert before is not None
    assert after is not None
    assert before.shape == after.shape == (height, width, 3)
    assert before.dtype == np.uint8
    assert (before != after).any()


def test_a_model_with_known_joints_is_drawn_as_the_mechanism_is():
    pictures = []
    for dynamics in (CartPole(), model()):
        env = MechanismEnv(dynamics, render_mode="rgb_array", points=CartPole().points)
        start(env, [0.1, 0.4], [0.0, 0.0])
        pictures.append(np.asarray(env.render()))
    assert np.array_equal(*pictures)


def test_a_window_opens_and_closes():
    import pygame

    env = MechanismEnv(Pendulum(), render_mode="human", dt=0.005)
    env.reset(seed=0)
    env.step([1.0])
    surface = pygame.display.get_surface()
    assert surface is not None
    shown = pygame.surfarray.array3d(surface).swapaxes(0, 1)
    env.render_mode = "rgb_array"
    assert np.array_equal(shown, np.asarray(env.render()))
    env.close()
    assert pygame.display.get_surface() is None
    env.close()


def test_no_picture_without_a_render_mode():
    env = MechanismEnv(Pendulum())
    env.reset()
    with pytest.warns(UserWarning, match="draws only if `render_mode`"):
        assert env.render() is None


# Refusals


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"dt": 0.0}, "`dt` must be a positive number of seconds; got 0.0"),
        ({"dt": float("nan")}, "`dt` must be a positive"),
        ({"track": -1.0}, "`track` must be positive; got -1.0"),
        ({"substeps": 0}, "`substeps` must be at least 1; got 0"),
        ({"render_mode": "film"}, "`render_mode` must be .* got 'film'"),
        ({"max_input": 0.0}, "`max_input` must be 1 positive numbers; got 0.0"),
        ({"max_input": (1.0, 2.0)}, r"`max_input` must be 1 numbers; got \(1.0, 2.0\), of shape \(2,\)"),
        ({"noise": (0.1, 0.1)}, "`noise` must be 4 numbers"),
        ({"target": (float("nan"), 0.0)}, "`target` must be 2 numbers; got .* with NaN"),
        ({"position_bounds": [(0.0, 1.0)]}, "`position_bounds` must be 2 pairs"),
        ({"rate_bounds": [(1.0, 0.0)] * 2}, "`rate_bounds` must be 2 pairs of a lowest and a highest"),
    ],
)
def test_unfit_settings_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        MechanismEnv(CartPole(), **options)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([float("nan")], "`action` must be 1 numbers; got .* with NaN"),
        ([1.0, 2.0], r"`action` must be 1 numbers; got \[1.0, 2.0\], of shape \(2,\)"),
        (np.array(["strong"]), "`action` must be 1 numbers; got"),
    ],
)
def test_unfit_actions_are_refused_and_change_nothing(action, message):
    env = MechanismEnv(CartPole())
    env.reset(seed=0)
    before = state_of(env)
    with pytest.raises(ValueError, match=message):
        env.step(action)
    assert (state_of(env) == before).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"angle": 1.0}, "`options` may name 'q' and 'v'; got 'angle'"),
        ({"q": [1.0]}, r"`q` must be 2 numbers; got \[1.0\]"),
        ({"v": [np.inf, 0.0]}, "must start at finite numbers"),
    ],
)
def test_unfit_starts_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        MechanismEnv(CartPole()).reset(options=options)


@pytest.mark.parametrize("method", ["step", "render"])
def test_an_episode_must_be_started_first(method):
    env = MechanismEnv(CartPole(), render_mode="rgb_array")
    with pytest.raises(gymnasium.error.ResetNeeded, match=f"before `{method}`; call `reset"):
        env.step([0.0]) if method == "step" else env.render()

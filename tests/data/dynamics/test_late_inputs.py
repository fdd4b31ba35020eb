"""Inputs that act later or sooner than is said are named with their delay, others are not."""

import dataclasses

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset
from symoden.data.dynamics._late_inputs import find_late_inputs

STEP = 0.01


def pendulum(path, delay, *, seed=0, samples=2000, noise=1e-3, step=STEP, friction=0.5):
    """A damped pendulum with steps of its input, logged as they are commanded."""
    rng = np.random.default_rng(seed)
    ts = step * np.arange(samples)
    u = np.repeat(rng.uniform(-2, 2, samples // 50 + 1), 50)[:samples]
    late = round(delay / step)
    acts = np.concatenate([np.zeros(max(0, late)), u[max(0, -late) :], np.zeros(max(0, -late))])[:samples]
    states = np.zeros((samples, 2))
    for k in range(samples - 1):
        q, v = states[k]
        for _ in range(10):
            v += step / 10 * (acts[k] - 4 * np.sin(q) - friction * v)
            q += step / 10 * v
        states[k + 1] = q, v
    measured = states + rng.normal(0, noise, states.shape) * [1, 3]
    np.savetxt(path / "run.csv", np.column_stack([ts, measured, u]), delimiter=",", header="t,q,v,u", comments="")


def description(path, more=""):
    """A description of it."""
    file = path / "run.toml"
    file.write_text(
        f'space = "T1"\ntime = "t"\npositions = ["q"]\nvelocities = ["v"]\ninputs = ["u"]\n{more}\n'
        '[train]\nfiles = ["run.csv"]\n'
    )
    return file


def described(path, more=""):
    """What is said of its delay."""
    return [one for one in check_dataset(description(path, more)).findings if one.kind == "delay"]


def said_of_inputs(file):
    """Kinds of what is said of how inputs act."""
    return [one.kind for one in check_dataset(file).findings if one.kind in {"delay", "hold", "feedback", "sign"}]


def advised(one):
    """The delay that is advised."""
    return float(one.advice.partition("`input_delay = ")[2].partition("`")[0])


@pytest.mark.parametrize("delay", [0.05, 0.1, 0.15])
@pytest.mark.parametrize("noise", [0.0, 3e-3])
def test_a_late_input_is_named_with_its_delay(tmp_path, delay, noise):
    pendulum(tmp_path, delay, noise=noise)
    (one,) = described(tmp_path)
    assert one.channel == "u"
    assert advised(one) == pytest.approx(delay, abs=0.0051)
    (rest,) = described(tmp_path, "input_delay = 0.02")  # Both together are as late.
    assert advised(rest) == pytest.approx(delay, abs=0.0051)
    assert described(tmp_path, f"input_delay = {delay}") == []


@pytest.mark.parametrize("told", [0.1, 0.2])
@pytest.mark.parametrize("noise", [1e-3, 3e-3])
def test_a_delay_that_is_too_long_is_said_by_training_too(tmp_path, told, noise):
    pendulum(tmp_path, 0.05, noise=noise)
    file = description(tmp_path, f"input_delay = {told}")
    (one,) = (each for each in check_dataset(file).findings if each.kind == "delay")
    assert one.level == "warning"
    assert advised(one) == pytest.approx(0.05, abs=0.0051)
    with pytest.warns(DataWarning, match="sooner than `input_delay` says"):
        read_dataset(file)


@pytest.mark.parametrize(("told", "more"), [(0.08, {"step": 0.025}), (0.1, {"friction": 15.0, "noise": 3e-4})])
def test_what_another_delay_seems_to_be_is_not_said(tmp_path, told, more):
    """As they are, the inputs are tried with the other hold, or told by the velocity of what has much friction."""
    pendulum(tmp_path, 0.05, **more)
    assert said_of_inputs(description(tmp_path, f"input_delay = {told}")) == ["delay"]
    assert "delay" not in said_of_inputs(description(tmp_path, "input_delay = 0.05"))


def test_inputs_that_come_after_the_end_of_a_recording_are_not_asked_for(tmp_path):
    pendulum(tmp_path, 0.05)
    with pytest.warns(DataWarning):
        whole = read_dataset(description(tmp_path, "input_delay = 0.2"))
    pieces = [whole.train[0].cut(k, k + 100, name=f"{k}") for k in range(0, 1000, 100)]
    (one,) = find_late_inputs(dataclasses.replace(whole, train=tuple(pieces)), [0.2], np.array([True]))
    assert advised(one) == pytest.approx(0.05, abs=0.0051)


def test_an_input_that_acts_at_once_needs_no_delay(tmp_path):
    pendulum(tmp_path, 0.0)
    (one,) = described(tmp_path, "input_delay = 0.032")
    assert "0.032 s sooner" in one.text
    assert one.advice.startswith("Try without `input_delay`")


@pytest.mark.parametrize("delay", [-0.02, -0.04])
def test_an_input_that_was_logged_late_is_named_and_can_be_told(tmp_path, delay):
    pendulum(tmp_path, delay)
    (one,) = described(tmp_path)
    assert f"{-delay:g} s before their rows" in one.text
    assert advised(one) == pytest.approx(delay, abs=1e-3)
    assert described(tmp_path, f"input_delay = {delay}") == []
    (rest,) = described(tmp_path, "input_delay = 0.02")
    assert advised(rest) == pytest.approx(delay, abs=1e-3)


def test_a_delay_in_another_unit_is_named_as_well(tmp_path):
    pendulum(tmp_path, 0.02, samples=4000)
    (one,) = described(tmp_path, "input_delay = 5")
    assert advised(one) == pytest.approx(0.02, abs=1e-3)


def test_no_more_than_all_is_unexplained(tmp_path):
    """Of stretches that a regression did not see it may leave more than their variance."""
    pendulum(tmp_path, 0.3, step=0.1, samples=220, friction=0.1, seed=3)
    for one in described(tmp_path):
        assert 0 < float(one.text.partition("best ")[2].partition(": ")[2].partition("%")[0]) <= 100


def test_a_delay_that_explains_little_more_is_a_note(tmp_path):
    pendulum(tmp_path, 0.05, noise=0.01)
    (one,) = described(tmp_path)
    assert one.level == "note"
    read_dataset(description(tmp_path))  # Warnings are errors.


def test_a_clock_that_is_doubted_tells_no_delay(tmp_path):
    pendulum(tmp_path, 0.03)
    assert described(tmp_path, "units = {t = 100.0, v = 0.01}") == []


@pytest.mark.parametrize("delay", [0.025, 0.05, 0.125])
def test_a_delay_of_whole_samples_is_found_to_the_sample_where_inputs_are_held(tmp_path, delay):
    pendulum(tmp_path, delay, step=0.025, samples=1500)
    (one,) = described(tmp_path)
    assert advised(one) == pytest.approx(delay, abs=1e-3)
    assert described(tmp_path, f"input_delay = {delay}") == []


@pytest.mark.parametrize("seed", range(4))
def test_an_input_that_acts_at_once_is_not(tmp_path, seed):
    pendulum(tmp_path, 0.0, seed=seed)
    assert described(tmp_path) == []


@pytest.mark.parametrize("delay", [0.1, 0.3])
@pytest.mark.parametrize("seed", range(3))
def test_where_rows_are_rare_delays_of_a_few_of_them_are_looked_for(tmp_path, delay, seed):
    pendulum(tmp_path, delay, seed=seed, step=0.1, samples=400)
    (one,) = described(tmp_path)
    assert advised(one) == pytest.approx(delay, abs=1e-3)
    assert described(tmp_path, f"input_delay = {delay}") == []
    pendulum(tmp_path, 0.0, seed=seed, step=0.1, samples=400)
    assert described(tmp_path) == []


def test_few_rows_tell_no_delay(tmp_path):
    pendulum(tmp_path, 0.3, step=0.1, samples=150)
    assert described(tmp_path) == []


def test_noise_hides_it_and_nothing_is_said(tmp_path):
    pendulum(tmp_path, 0.1, noise=0.3)
    assert described(tmp_path) == []


def servo(path, *, seed, frequency, lag, samples=2000, dead=0.5):
    """A drive with a lag and a dead zone under a sine, which periods later is the same."""
    rng = np.random.default_rng(seed)
    ts = STEP * np.arange(samples)
    u = 3 * np.sin(2 * np.pi * frequency * ts + rng.uniform(0, 6))
    states = np.zeros((samples, 2))
    q = v = drive = 0.0
    for k in range(samples):
        states[k] = q, v
        for _ in range(10):
            drive += STEP / 10 * (u[k] - drive) / lag
            v += STEP / 10 * (60 * np.sign(drive) * max(abs(drive) - dead, 0.0) - 10 * v)
            q += STEP / 10 * v
    measured = states + rng.normal(0, 1e-3, states.shape) * [1, 3]
    np.savetxt(path / "run.csv", np.column_stack([ts, measured, u]), delimiter=",", header="t,q,v,u", comments="")


@pytest.mark.parametrize("frequency", [5.0, 7.0, 10.0])
@pytest.mark.parametrize("lag", [0.03, 0.05])
def test_periods_later_a_periodic_input_is_no_delay(tmp_path, frequency, lag):
    for seed in range(3):
        servo(tmp_path, seed=seed, frequency=frequency, lag=lag)
        for one in described(tmp_path):
            assert advised(one) < 0.5 / frequency


@pytest.mark.parametrize("told", [0.003, 0.01])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_targets_that_a_servo_follows_are_not_late_because_its_motion_tells_them(tmp_path, told, seed):
    """Positions and velocities tell the target: a regression takes the one for the other, and is worse than none."""
    rng = np.random.default_rng(seed)
    ts = np.cumsum(rng.uniform(0.019, 0.022, 330))
    a, b = rng.uniform(1.5, 2.5), rng.uniform(4.0, 6.0)

    def target(t):
        return 0.7 * np.sin(a * t) + 0.3 * np.sin(b * t)

    q, v, t, states = target(0.0), 0.7 * a + 0.3 * b, 0.0, []
    for end in ts:
        for step in np.full(40, (end - t) / 40):
            t += step
            v += step * (900 * (target(t) - q) - 60 * v - 2 * np.tanh(v / 0.05) - 25 * np.sin(q))
            q += step * v
        states.append([np.round(q / 0.0015) * 0.0015, v + 0.02 * rng.normal()])
    rows = np.column_stack([ts, states, target(ts)])
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,q,v,u", comments="")
    file = description(tmp_path, f"input_delay = {told}")
    file.write_text(file.read_text().replace("T1", "R1"))
    assert [one.text for one in check_dataset(file).findings if one.kind == "delay"] == []

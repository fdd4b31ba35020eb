"""A sensor that is late beside others is named with its delay, others are not."""

import re

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset
from symoden.data.dynamics import _late_positions

STEP, FINE = 0.02, 10


def crane(path, *, camera=0.0, encoder=0.0, motor=0.0, seed=0, samples=2000, noise=1e-3):
    """A cart that is pulled by steps and a spring, and its swinging load; a camera sees the load, an encoder the cart.

    Both may be late, and the motor too [s].
    """
    rng = np.random.default_rng(seed)
    count = samples * FINE
    ts = STEP / FINE * np.arange(count)
    command = np.repeat(rng.uniform(-12, 12, samples // 8 + 1), 8 * FINE)[:count]
    acts = command[np.maximum(0, np.arange(count) - round(motor / STEP * FINE))]
    q, v, states = np.zeros(2), np.zeros(2), np.zeros((count, 2))
    for k in range(count):
        states[k] = q
        M = np.array([[2.0, 0.3 * np.cos(q[1])], [0.3 * np.cos(q[1]), 0.2]])
        push = [acts[k] - 4 * q[0] - 3 * v[0] + 0.3 * np.sin(q[1]) * v[1] ** 2, -3 * np.sin(q[1]) - 0.02 * v[1]]
        v = v + STEP / FINE * np.linalg.solve(M, push)
        q = q + STEP / FINE * v
    rows = slice(None, None, FINE)
    seen = [np.interp(ts[rows] - late, ts, states[:, j]) for j, late in enumerate((encoder, camera))]
    seen = np.stack(seen, axis=1) + rng.normal(0, noise, (samples, 2)) * [0.1, 1]
    header = "t,x,theta,u"
    np.savetxt(
        path / "run.csv", np.column_stack([ts[rows], seen, command[rows]]), "%.6f", ",", header=header, comments=""
    )


def description(path, more=""):
    """A description of it."""
    file = path / "run.toml"
    file.write_text(
        f'space = "R1 T1"\ntime = "t"\npositions = ["x", "theta"]\ninputs = ["u"]\n{more}\n'
        '[train]\nfiles = ["run.csv"]\n'
    )
    return file


def described(path, more=""):
    """What is said of delays."""
    return [one for one in check_dataset(description(path, more)).findings if one.kind == "delay"]


def advised(one):
    """The delays that are advised."""
    return [float(each) for each in re.findall(r"`position_delay = \[(.*?)\]`", one.advice)[0].split(", ")]


@pytest.mark.parametrize("late", [0.04, 0.06])
def test_a_late_camera_is_named_with_its_delay(tmp_path, late):
    crane(tmp_path, camera=late)
    (one,) = described(tmp_path)
    assert (one.channel, one.level) == ("theta", "warning")
    assert advised(one) == pytest.approx([0, late], abs=0.0051)
    assert described(tmp_path, f"position_delay = [0, {late}]") == []
    with pytest.warns(DataWarning, match="`theta` goes together with the other coordinates best"):
        read_dataset(description(tmp_path))


@pytest.mark.parametrize("late", [0.0, 0.03])
def test_a_delay_that_is_said_too_long_is_named_too(tmp_path, late):
    crane(tmp_path, camera=late)
    (one,) = described(tmp_path, "position_delay = [0, 0.08]")
    assert "sooner than `position_delay` says" in one.text
    assert advised(one) == pytest.approx([0, late], abs=0.0051)


def test_a_delay_of_all_positions_stays(tmp_path):
    crane(tmp_path, camera=0.06, encoder=0.02)
    (one,) = described(tmp_path, "position_delay = 0.02")
    assert advised(one) == pytest.approx([0.02, 0.06], abs=0.0051)


@pytest.mark.parametrize("seed", range(3))
def test_sensors_that_are_late_alike_and_late_motors_are_not_taken_for_one(tmp_path, seed):
    for camera, encoder, motor in ((0.0, 0.0, 0.0), (0.04, 0.04, 0.0), (0.0, 0.0, 0.06)):
        crane(tmp_path, camera=camera, encoder=encoder, motor=motor, seed=seed)
        assert not [one for one in described(tmp_path) if "position_delay" in one.advice]


def test_what_hardly_follows_any_equation_says_nothing(tmp_path):
    crane(tmp_path, camera=0.06, noise=0.3)
    assert described(tmp_path) == []


def share(best, *, least, most, width=0.02):
    """What is left of an acceleration by the delay of the load: least with the best one."""
    return lambda delay: least + (most - least) * min(1.0, abs(delay - best) / width)


@pytest.mark.parametrize(
    ("cart", "load", "named"),
    [
        (share(0.04, least=0.05, most=0.1), share(0.04, least=0.01, most=0.3), True),
        (share(0.07, least=0.02, most=0.1, width=0.07), share(0.04, least=0.01, most=0.3), False),  # Not the same one.
        (share(0.04, least=0.2, most=0.1), share(0.04, least=0.01, most=0.3), False),  # The cart is told worse.
        (share(0.04, least=0.05, most=0.1), share(0.04, least=0.01, most=0.7), False),  # Hardly told at all before.
        (
            share(0.12, least=0.05, most=0.1, width=0.12),
            share(0.12, least=0.0, most=0.3, width=0.12),
            False,
        ),  # Farther.
        (share(0.04, least=0.05, most=0.1), share(0.04, least=0.001, most=0.009), False),  # Too little to matter.
    ],
)
def test_all_equations_must_tell_the_same_delay(tmp_path, monkeypatch, cart, load, named):
    def left(dataset, delays, is_angle, longest):
        return np.array([each(delays[1]) if delays[0] == 0 else 0.4 for each in (cart, load)])

    crane(tmp_path)
    monkeypatch.setattr(_late_positions, "_left", left)
    assert bool(described(tmp_path)) == named

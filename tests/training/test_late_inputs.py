"""Training says when inputs act late, and whether by a lag or a delay; it leaves the model as it is."""

import dataclasses
import warnings

import equinox as eqx
import jax
import numpy as np
import pytest

from symoden import KnownParts, Trajectory, fit
from symoden.data import Dataset
from symoden.data.signals import delay_inputs, lag_inputs
from symoden.models import build
from symoden.spaces import Space
from symoden.training import TrainingConfig, _late_inputs
from symoden.training._data import levenberg_data
from symoden.training._late_inputs import LateInputs
from symoden.training._lateness import Lateness
from symoden.training._line_up import line_up
from symoden.training._stages import OutOfTime
from symoden.training._verdicts import Skipped

KNOWN = KnownParts(
    mass_matrix=[["1"]],
    potential_energy="-k*cos(q1)",
    input_matrix=[["b"]],
    parameters={"k": 3.0, "b": 2.0},
)
FINE = 40


def swing(*, lag=0.0, delay=0.0, noise=1e-4, push=3.0, start=0.0, seed=0):
    """A pendulum with damping whose motor follows its steps late, seen at 25 Hz."""
    generator = np.random.default_rng(seed)
    us = np.repeat(push * generator.uniform(-1.0, 1.0, 20), 20)
    told = np.repeat(us, FINE)
    late = round(delay / 0.04 * FINE)
    acting = np.concatenate([np.full(late, us[0]), told])[: len(told)]
    fine, states, x = 0.04 / FINE, [(start, 0.0)], us[0]
    for u in acting:
        q, v = states[-1]
        x = u if lag == 0 else u + (x - u) * np.exp(-fine / lag)
        v = v + fine * (x - 5.0 * np.sin(q) - 0.3 * v)
        states.append((q + fine * v, v))
    q, v = np.array(states[:-1:FINE]).T
    seen = q + noise * generator.normal(size=q.shape)
    ts = 0.04 * np.arange(len(us))
    return Trajectory(name="swing", ts=ts, q=seen[:, None], rates=v[:, None], us=us[:, None])


def asked(*recordings):
    """What is found of late inputs, and what is warned of."""
    said = []

    def until_told(progress):
        if progress.stage == "late inputs":
            said.append(progress.verdict)
            raise StopIteration

    dataset = Dataset(name="late", space="T1", train=recordings, known=KNOWN)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fit(dataset, config=TrainingConfig(seed=0), progress=until_told)
    return *said, [str(each.message) for each in caught if "inputs seem to act late" in str(each.message)]


def seconds_in(words, key):
    """The time that is told."""
    return float(words.split(f"`{key} = ")[1].split("`")[0])


@pytest.mark.parametrize(
    ("late", "seconds", "other"),
    [
        ("lag", 0.06, "delay"),
        ("delay", 0.06, "lag"),
        pytest.param("lag", 0.15, "delay", marks=pytest.mark.slow),
        pytest.param("delay", 0.12, "lag", marks=pytest.mark.slow),
    ],
)
def test_lags_and_delays_are_found_and_told_from_each_other(late, seconds, other):
    verdict, (warning,) = asked(swing(**{late: seconds}))
    assert verdict.startswith("found")
    assert seconds_in(verdict, f"input_{late}") == pytest.approx(seconds, rel=0.15)
    assert f"Write `input_{late} = " in warning
    assert f"with a {other} " in warning


@pytest.mark.parametrize("seed", range(3))
def test_of_inputs_that_act_at_once_nothing_is_told(seed):
    verdict, said = asked(swing(noise=0.003, seed=seed))
    assert verdict.startswith("none")
    assert said == []


def test_a_lag_that_is_told_already_is_not_found_again():
    verdict, said = asked(lag_inputs(swing(lag=0.15, noise=0.003), [0.15], hold="zero"))
    assert verdict.startswith("none")
    assert said == []


def test_of_recordings_without_inputs_windows_stay_where_they_were():
    """A free swing beside driven ones, of so many rows that a further one would be a further window."""
    free = swing(push=0.0, start=1.0).cut(0, 100, name="free")
    verdict, (warning,) = asked(swing(lag=0.15), free)
    assert seconds_in(verdict, "input_lag") == pytest.approx(0.15, rel=0.15)
    assert "Write `input_lag = " in warning


def test_training_goes_on_as_if_nothing_was_asked(stage, pendulum, quick):
    levenberg, before = stage
    dataset = pendulum(count=8)
    late = LateInputs(dataset, dataclasses.replace(levenberg, data=levenberg_data(dataset, before.best, quick)))
    state = levenberg.start(before)._replace(origin=3, best_loss=0.5, step=7)
    after, report = late.advance(late.start(state))
    assert report.finished
    assert not report.outcome
    assert eqx.tree_equal(after._replace(step=7), state)
    resumed = late.start(before)  # Which a checkpoint's arrays are put into.
    assert eqx.tree_equal(jax.tree.structure(resumed), jax.tree.structure(state))
    with pytest.raises(OutOfTime):
        late.advance(late.start(state), is_over=lambda: True)
    few = LateInputs(
        dataset,
        dataclasses.replace(
            levenberg, data=late.levenberg.data._replace(train=late.levenberg.data.train.take(slice(0, 4)))
        ),
    )
    assert isinstance(few.advance(state)[1].verdict, Skipped)


def fake_refit(truth):
    """Losses that are least at these times, equal factors being as wrong."""

    def refit(model, seconds):
        off = [np.log((each + 1e-3) / (true + 1e-3)) for each, true in zip(seconds, truth, strict=True)]
        return _late_inputs._Late(tuple(seconds), model, np.full(8, 0.01 + np.sum(np.square(off))))

    return refit


@pytest.mark.parametrize("truth", [(0.03, 0.25), (0.1, 0.0), (0.0, 0.1), (0.1, 0.12)])
def test_inputs_have_times_of_their_own_where_that_leaves_much_less(truth, small):
    model = build(small, Space.parse("T1"), 1, key=jax.random.key(0))
    refit = fake_refit(truth)
    same = _late_inputs._refined(refit(model, (0.1, 0.1)), refit)
    assert same.seconds[0] == same.seconds[1]
    apart = _late_inputs._each_apart(same, refit, (0, 1))
    np.testing.assert_allclose(apart.seconds, truth, rtol=0.2, atol=1e-12)
    assert _late_inputs._each_apart(same, refit, (1,)) is same


def test_nearly_the_same_times_are_told_as_one(small):
    model = build(small, Space.parse("T1"), 1, key=jax.random.key(0))
    refit = fake_refit((0.1, 0.105))
    same = _late_inputs._refined(refit(model, (0.1, 0.1)), refit)
    assert _late_inputs._each_apart(same, refit, (0, 1)) is same


def test_it_is_asked_only_where_inputs_can_tell(pendulum, small, quick):
    model = build(small, Space.parse("T1"), 1, key=jax.random.key(0))

    def is_asked(dataset, config=quick):
        return any(isinstance(each, LateInputs) for each in line_up(dataset, model, (model,), config))

    moved = pendulum(count=8)
    constant = [dataclasses.replace(each, us=np.full_like(each.us, k)) for k, each in enumerate(moved.train)]
    assert is_asked(moved)
    assert not is_asked(dataclasses.replace(moved, train=tuple(constant)))
    assert not is_asked(moved, dataclasses.replace(quick, growth_steps=0))
    assert not is_asked(moved, dataclasses.replace(quick, scaled_loss=False))


@pytest.mark.parametrize("key", ["input_lag", "input_delay"])
@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_windows_stay_where_they_were(key, hold):
    recording = dataclasses.replace(swing(), ts=1.7e9 + swing().ts)
    acting = _late_inputs._acting(recording, key, (0.1,), hold)
    for name in ("ts", "q", "rates"):
        np.testing.assert_array_equal(getattr(acting, name), getattr(recording, name))
    for value in (2.0, 0.0):
        one = dataclasses.replace(recording, us=np.full_like(recording.us, value))
        np.testing.assert_allclose(_late_inputs._acting(one, key, (0.1,), hold).us, one.us, rtol=1e-12)
    both = dataclasses.replace(recording, us=np.hstack([np.zeros_like(recording.us), recording.us]))
    np.testing.assert_allclose(_late_inputs._acting(both, key, (0.1, 0.0), hold).us, both.us, rtol=1e-12)
    # Once what acted before no longer matters, it is what the description's keys make of it.
    late = {"input_lag": lag_inputs, "input_delay": delay_inputs}[key](recording, [0.1], hold=hold)
    np.testing.assert_allclose(acting.us[-200:], late.us[-200:], rtol=0, atol=1e-6)


def test_words_say_what_is_left():
    found = Lateness("input_lag", (0.123, 0.123), 0.01, 0.1, 30, 2.5, found=True, other=(0.08, 0.02))
    assert str(found) == (
        "found (with `input_lag = 0.12` a simple model is left with a loss of 0.01 over 30 windows, 0.1 without "
        "(+2.50 standard errors, with a delay of 0.08 s 0.02))"
    )
    assert "Write `input_lag = 0.12` into the description" in found.advice
    assert not found.hardly
    none = found._replace(key="input_delay", seconds=(0.1, 0.0), gained=np.inf, found=False, other=None)
    assert str(none) == (
        "none (with `input_delay = [0.1, 0]` a simple model is left with a loss of 0.01 over 30 windows, 0.1 without)"
    )


@pytest.mark.parametrize(
    ("losses", "wanted"),
    [
        ((2.0, 1.0, 2.0), 0.2),
        ((np.inf, 1.0, 100.0), 0.2),
        ((np.e, 1.0, np.e**3), 0.175),
        ((1.0, 1.0, 1.0), 0.2),
        ((0.0, 0.0, 0.0), 0.2),
    ],
)
def test_the_lowest_point_of_a_parabola_survives_what_diverges(losses, wanted):
    assert _late_inputs._lowest([0.1, 0.2, 0.3], list(losses)) == pytest.approx(wanted)

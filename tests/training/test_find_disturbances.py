"""Moments of recordings that a model was not trained on are found, where something else than their inputs acts."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.data import DataError
from symoden.integrate import HOLDS, RK4, rollout
from symoden.models import ModelConfig, build
from symoden.systems import Pendulum
from symoden.training import find_disturbances

from .swings import SIZE, STEP, SYSTEM, swing, swings


def others(pushes=(), noise=1e-3):
    """A recording of the same pendulum that nothing was trained on."""
    return swing("other", np.random.default_rng(77), pushes, noise)


@pytest.mark.parametrize(("at", "length"), [(100, 5), (300, 60)])
def test_recordings_of_a_test_are_disturbed_where_they_are_pushed(at, length):
    pushed, quiet, short = others([(at, at + length, 30.0)]), others(), others().cut(0, 8, name="short")
    (span, *more), *none = find_disturbances(SYSTEM, [pushed, quiet, short], swings(0, {}))
    assert more == []
    assert none == [(), ()]
    begin, end = (100 + STEP * row for row in (at, at + length))
    assert begin - 0.3 < span[0] < begin + 0.1
    assert end - 0.1 < span[1] < end + 0.3


def test_a_recording_of_another_machine_is_not_disturbed():
    pushed = others([(100, 105, 30.0)])
    assert find_disturbances(Pendulum(mass=4.0, damping=0.2), [pushed], swings(0, {})) == ((),)  # A poor model.
    backwards = dataclasses.replace(pushed, us=-3 * pushed.us)
    assert find_disturbances(SYSTEM, [backwards], swings(0, {})) == ((),)
    assert find_disturbances(SYSTEM, [], swings(0, {})) == ()
    assert find_disturbances(
        build(ModelConfig(kind="naive"), SYSTEM.space, 1, key=jax.random.key(0)), [pushed], swings(0, {})
    ) == ((),)


@pytest.mark.parametrize("windows", [2, 3, 4, 6])
def test_a_push_is_found_in_short_recordings(windows):
    size = windows * 26 + 1
    whole = others([(300, 304, 30.0)])
    short = whole.cut(300 - size // 2, 300 + size // 2, name="short")
    ((span,),) = find_disturbances(SYSTEM, [short], swings(0, {}))
    assert span[0] < whole.ts[304]
    assert span[1] > whole.ts[300]


@pytest.mark.parametrize("begun", [0.0, 100.0, 1.7e9])
def test_recordings_of_half_the_rate_are_looked_at_and_of_a_third_are_not(begun):
    pushed = others([(200, 206, 30.0)])

    def thinned(step):
        picked = {name: getattr(pushed, name)[::step] for name in ("q", "rates", "us")}
        return dataclasses.replace(pushed, ts=pushed.ts[::step] - pushed.ts[0] + begun, **picked)

    (half, third) = find_disturbances(SYSTEM, [thinned(2), thinned(3)], swings(0, {}))
    assert len(half) == 1
    assert half[0][0] - 0.3 < begun + STEP * 203 < half[0][1] + 0.3
    assert third == ()


def test_a_pause_is_no_push():
    quiet = others()
    late = dataclasses.replace(quiet, ts=quiet.ts + 5 * (np.arange(SIZE) >= 200))
    assert find_disturbances(SYSTEM, [late], swings(0, {})) == ((),)


@pytest.mark.parametrize(("lost", "found"), [(1, 1), (4, 0)])
def test_what_acts_where_rows_are_lost_is_no_push(lost, found):
    """An input that changed there was not logged; a single row says little less."""
    pushed = others([(200, 204, 30.0)])
    kept = np.delete(np.arange(SIZE), 200 + np.arange(lost))
    picked = {name: getattr(pushed, name)[kept] for name in ("ts", "q", "rates", "us")}
    (spans,) = find_disturbances(SYSTEM, [dataclasses.replace(pushed, **picked)], swings(0, {}))
    assert len(spans) == found


def test_recordings_of_another_mechanism_are_refused():
    quiet = others()
    pair = dataclasses.replace(quiet, us=np.zeros((SIZE, 2)))
    with pytest.raises(DataError, match="must have coordinates and inputs as `runs`, 1 and 1; got 1 and 2"):
        find_disturbances(SYSTEM, [pair], swings(0, {}))
    with pytest.raises(ValueError, match="`hold` must be one of zero, linear; got 'cubic'"):
        find_disturbances(SYSTEM, [quiet], swings(0, {}), hold="cubic")


def test_inputs_of_other_recordings_act_as_theirs_do():
    rough = others()
    us = np.where(np.arange(SIZE)[:, None] < SIZE - 15, rough.us, 400.0)
    with jax.enable_x64(True):
        start = map(jnp.asarray, (rough.q[0], rough.rates[0], rough.ts, us))
        path = rollout(SYSTEM, *start, solver=RK4(4), hold=HOLDS["linear"])
        steps = dataclasses.replace(rough, q=np.asarray(path.q), rates=np.asarray(path.rates), us=us)
    ((span,),) = find_disturbances(SYSTEM, [steps], swings(0, {}), hold="zero")  # Half an interval of a large jump.
    assert span[1] > rough.ts[-20]
    assert find_disturbances(SYSTEM, [steps], swings(0, {}), hold="linear") == ((),)

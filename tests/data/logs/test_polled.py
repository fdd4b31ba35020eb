"""Positions that are read more rarely than rows are written lose the rows between readings, and no others do."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from symoden.data import DataWarning, check_dataset, read_dataset
from symoden.data.logs._logs import Log
from symoden.data.logs._polled import on_new_readings

STEP, SIZE = 0.01, 1500
TS = STEP * np.arange(SIZE)
NO_ANGLE = np.zeros(2, bool)


def log(q, us=None):
    q = np.asarray(q).reshape(len(q), -1)
    us = np.sin(5 * TS)[:, None] if us is None else us
    names = {"time": ("t",), "positions": tuple(f"q{i + 1}" for i in range(q.shape[1])), "inputs": ("u",)}
    return Log(
        part="train", name="r", path=Path("r.csv"), rows=np.arange(len(q)), ts=TS[: len(q)], q=q, rates=None, us=us,
        names=names,
    )  # fmt: skip


def swing(seed, noise=2e-4):
    generator = np.random.default_rng(seed)
    a, b, c = generator.uniform(0.5, 1.5, 3)
    return np.sin(2.1 * a * TS) + 0.4 * np.cos(3.7 * b * TS + c) + noise * generator.normal(size=SIZE)


def repeating(signal, stale):
    rows = np.maximum.accumulate(np.where(stale, 0, np.arange(len(signal))))
    return signal[rows]


@given(seed=st.integers(0, 200), every=st.integers(2, 9), first=st.integers(0, 8), noise=st.sampled_from([0.0, 2e-4]))
def test_of_a_sensor_that_is_read_every_few_rows_these_are_left(seed, every, first, noise):
    fresh = np.arange(SIZE) % every == first % every
    fresh[0] = True
    found = on_new_readings(log(repeating(swing(seed, noise), ~fresh)), NO_ANGLE[:1], "zero")
    assert found.polled is not None
    assert (found.polled.rows, found.polled.columns) == (SIZE, ("q1",))
    assert np.array_equal(found.rows, np.flatnonzero(fresh))


@given(seed=st.integers(0, 200), share=st.floats(0.08, 0.5))
def test_of_a_sensor_that_now_and_then_is_late_new_readings_are_left(seed, share):
    stale = np.random.default_rng(seed + 1).random(SIZE) < share
    stale[0] = False
    found = on_new_readings(log(repeating(swing(seed), stale)), NO_ANGLE[:1], "zero")
    assert found.polled is not None
    assert np.isin(np.flatnonzero(~stale), found.rows).all()
    assert len(found) <= np.sum(~stale) + 0.01 * SIZE


@given(seed=st.integers(0, 200), bits=st.integers(6, 16))
def test_a_coarse_encoder_a_rest_and_a_joint_that_sticks_are_no_such_sensor(seed, bits):
    generator = np.random.default_rng(seed)
    encoder = np.round(swing(seed, 0.0) * 2**bits / 6) * 6 / 2**bits
    moves = np.repeat(generator.random(SIZE // 50) < 0.6, 50)
    ramps = np.cumsum(np.convolve(moves * generator.choice([-1.0, 1.0], SIZE // 50).repeat(50), np.ones(20), "same"))
    still = swing(seed)
    still[700:760] = still[700]
    noisy = np.round(swing(seed, 0.05) / 0.02) * 0.02
    steady = np.arange(SIZE) // 4 * 0.01  # A step of the encoder every four rows.
    for each in (steady, noisy, encoder, ramps * STEP, swing(seed), still, np.zeros(SIZE)):
        given_log = log(each)
        assert on_new_readings(given_log, NO_ANGLE[:1], "zero") is given_log


@given(seed=st.integers(0, 200), share=st.floats(0.03, 0.4))
@example(seed=0, share=0.04)  # Nearly every reading is one row.
def test_rows_that_were_written_twice_while_no_time_went_by_are_no_such_sensor(seed, share):
    twice = np.repeat(swing(seed), 1 + (np.random.default_rng(seed + 1).random(SIZE) < share))[:SIZE]
    given_log = log(twice)
    assert on_new_readings(given_log, NO_ANGLE[:1], "zero") is given_log


def test_time_stamps_out_of_order_are_left_to_be_named():
    given_log = log(repeating(swing(1), np.arange(SIZE) % 3 != 0))
    for k in (2, 700):
        ts = np.array(TS)
        ts[k] = ts[k - 2]
        disordered = dataclasses.replace(given_log, ts=ts)
        assert on_new_readings(disordered, NO_ANGLE[:1], "zero") is disordered


def test_a_rest_keeps_rows_as_far_apart_as_readings():
    q = swing(3)
    q[600:900] = q[600]
    fresh = np.arange(SIZE) % 4 == 0
    found = on_new_readings(log(repeating(q, ~fresh)), NO_ANGLE[:1], "zero")
    assert np.array_equal(found.rows, np.flatnonzero(fresh))


@given(seed=st.integers(0, 200))
def test_held_inputs_act_as_their_mean_between_readings(seed):
    us = np.random.default_rng(seed).normal(size=(SIZE, 1))
    found = on_new_readings(log(repeating(swing(seed), np.arange(SIZE) % 5 != 0), us), NO_ANGLE[:1], "zero")
    assert found.us[:-1] == pytest.approx(us.reshape(-1, 5).mean(axis=1)[:-1, None], abs=1e-9)


def test_of_two_sensors_the_rows_of_the_one_that_is_read_more_rarely_are_left():
    fast, slow = swing(1), repeating(swing(2), np.arange(SIZE) % 3 != 0)
    found = on_new_readings(log(np.stack([fast, slow], axis=1)), NO_ANGLE, "zero")
    assert found.polled is not None
    assert found.polled.columns == ("q2",)
    assert np.array_equal(found.rows, np.arange(0, SIZE, 3))
    assert np.array_equal(found.q, np.stack([fast, slow], axis=1)[::3])


def test_two_sensors_that_are_read_in_turn_come_to_the_rows_of_one():
    first, second = (repeating(swing(k, 0.0), np.arange(SIZE) % 4 != phase) for k, phase in ((1, 0), (2, 2)))
    second[:2] = swing(2, 0.0)[0]
    found = on_new_readings(log(np.stack([first, second], axis=1)), NO_ANGLE, "zero")
    truth = np.stack([swing(1, 0.0), swing(2, 0.0)], axis=1)[found.rows]
    assert len(found) == pytest.approx(SIZE / 4, abs=2)
    assert found.q[5:-5] == pytest.approx(truth[5:-5], abs=2e-3)


def test_the_check_and_training_say_so(tmp_path):
    q = repeating(swing(4), np.arange(SIZE) % 4 != 0)
    rows = "\n".join(f"{t:.6f},{x:.8f},{u:.6f}" for t, x, u in zip(TS, q, np.sin(5 * TS), strict=True))
    (tmp_path / "run.csv").write_text(f"t,q,u\n{rows}\n")
    path = tmp_path / "run.toml"
    path.write_text(
        'space = "R1"\ntime = "t"\npositions = ["q"]\ninputs = ["u"]\nhold = "zero"\n[train]\nfiles = ["run.csv"]\n'
    )
    (said,) = [
        each for check in check_dataset(path).recordings for each in check.findings if "last reading" in each.text
    ]
    assert (said.kind, said.level, said.channel) == ("time", "masked", "q")
    assert "375 of 1500 rows" in said.text
    with pytest.warns(DataWarning, match="left out in `run`: `q` repeats its last reading"):
        (recording,) = read_dataset(path).train
    assert len(recording) == SIZE // 4

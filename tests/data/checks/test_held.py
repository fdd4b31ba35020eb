"""A machine that was held and let go, or pushed, is named; what moves from the first row on, or falls, is not."""

import numpy as np
import pytest
import scipy.integrate
from hypothesis import given, settings, strategies as st

from symoden.data import check_dataset

PACE = 5.0  # [rad/s]


def swing(q, v, seconds, step, *, torque=0.0):
    """Positions of a damped pendulum."""
    path = scipy.integrate.solve_ivp(
        lambda _, x: [x[1], -(PACE**2) * np.sin(x[0]) - 0.2 * x[1] + torque],
        (0.0, seconds + step),
        [q, v],
        t_eval=step * np.arange(round(seconds / step) + 1),
        rtol=1e-9,
        atol=1e-12,
    )
    return path.y[0]


def findings(q, step, u=None):
    """What is found of a log of these positions."""
    table = {"t": step * np.arange(len(q)), "q": q} | ({} if u is None else {"u": u})
    description = {"space": "T1", "time": "t", "positions": ["q"], "train": {"files": ["run"]}}
    if u is not None:
        description |= {"inputs": ["u"], "hold": "zero"}
    (check,) = check_dataset(description, tables={"run": table}).recordings
    return [each for each in check.findings if each.kind == "held"]


def rounded(q, step):
    return np.round(q / step) * step if step else q


@settings(max_examples=15)
@given(
    start=st.floats(0.4, 2.5),
    held=st.floats(0.8, 3.0),
    step=st.sampled_from([0.005, 0.01, 0.02, 0.05]),
    counts=st.sampled_from([0, 1200, 4096]),
    noise=st.sampled_from([0.0, 5e-4]),
    driven=st.booleans(),
)
def test_what_is_let_go_is_named_with_its_time(start, held, step, counts, noise, driven):
    still = np.full(round(held / step), start)
    q = np.concatenate([still, swing(start, 0.0, 4.0, step)])
    q = rounded(q + noise * np.random.default_rng(0).normal(size=len(q)), 2 * np.pi / counts if counts else 0.0)
    (found,) = findings(q, step, np.zeros(len(q)) if driven else None)
    ((begin, end),) = found.spans
    assert begin == 0
    assert end == pytest.approx(step * len(still), abs=0.08)
    assert found.level == "warning"
    assert "`q` stands still for the first" in found.text


def test_what_is_pushed_from_its_rest_is_named():
    q = np.concatenate([np.zeros(100), swing(0.0, 2.0, 4.0, 0.01)])
    assert len(findings(rounded(q, 2 * np.pi / 4096), 0.01)) == 1


@settings(max_examples=15)
@given(
    q=st.floats(-2.5, 2.5),
    v=st.floats(-3.0, 3.0),
    step=st.sampled_from([0.005, 0.02, 0.05]),
    counts=st.sampled_from([0, 1200, 4096]),
)
def test_what_moves_from_the_beginning_is_not(q, v, step, counts):
    q = swing(q, v, 4.0, step)
    assert findings(rounded(q, 2 * np.pi / counts if counts else 0.0), step) == []
    assert findings(rounded(q, 2 * np.pi / counts if counts else 0.0)[::-1], step) == []


@pytest.mark.parametrize("offset", [1e-3, 1e-5, 1e-8])
@pytest.mark.parametrize("step", [0.005, 0.02, 0.05])
@pytest.mark.parametrize("counts", [1200, 4096])
def test_a_balance_that_is_lost_is_not(offset, step, counts):
    """Upright: at first, nothing is seen of its motion."""
    q = swing(np.pi - offset, 0.0, 8.0, step)
    assert findings(rounded(q, 2 * np.pi / counts), step) == []


def test_what_an_input_sets_going_is_not():
    q = np.concatenate([np.zeros(100), swing(0.0, 0.0, 4.0, 0.01, torque=15.0)])
    u = np.where(np.arange(len(q)) >= 100, 1.0, 0.0)
    assert findings(q, 0.01, u) == []
    assert len(findings(q, 0.01, 0 * u)) == 1


def test_what_rests_for_good_is_not():
    assert findings(np.concatenate([np.zeros(400), 1e-4 * np.ones(200)]), 0.01) == []  # An encoder's count.
    assert findings(np.zeros(400) + 1e-4 * np.random.default_rng(0).normal(size=400), 0.01) == []

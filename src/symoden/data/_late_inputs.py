"""Inputs that act later than they were logged."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from jaxtyping import Float, Int

from ._dataset import Dataset
from ._findings import Finding
from ._trajectory import Trajectory

_LONGEST: Final = 0.25  # [s] of a delay that is looked for; motors, networks and propellers take less.
_DELAYS: Final = 25
_BUMP: Final = 0.15  # [s], or eight samples: what is shorter is noise of the velocities.
_FEWEST_STEPS: Final = 8
_MOST: Final = 800  # Bumps.
_MANY: Final = 2  # Bumps in either half for each number of the regression.
_BLOCKS: Final = 8  # Stretches.
_RANK: Final = 1e-6  # Relative to the largest singular value: what changes less tells nothing.
_LESS: Final = (
    0.5  # Share of what was left that is left with the delay: 0.3 on a measured aeropendulum, elsewhere 0.67.
)
_EXPLAINED: Final = 0.3  # Share of the accelerations' variance that may be left then.
_SHARP: Final = 0.1  # Of the usual speed, within which dry friction turns round.


def find_late_inputs(dataset: Dataset, delays: Sequence[float], is_angle: np.ndarray) -> list[Finding]:
    """Say where accelerations follow the inputs far better some time later.

    Accelerations under short bumps are predicted by what a mechanism has: functions of single positions, friction,
    products of velocities, and inputs, which may turn with a joint. Every other stretch is predicted from the rest. In
    the weak form no velocity is differentiated: ∫ w dv = −∫ w′ v dt.

    Args:
        dataset: Recordings as training sees them.
        delays: What the description says of inputs already [s].
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding, or none.
    """
    if not dataset.train or not dataset.inputs or dataset.momenta:
        return []
    step = float(np.median(np.concatenate([np.diff(each.ts) for each in dataset.train])))
    size = max(_FEWEST_STEPS, round(_BUMP / step))
    first = int(np.ceil(_LONGEST / step))
    long = [each for each in dataset.train if len(each) > first + size + 1]
    if not long or 4 * step > _LONGEST:
        return []
    stride = max(size // 2, sum(map(len, long)) // _MOST, 1)
    cuts = [(each, np.arange(first, len(each) - size, stride)[:, None] + np.arange(size + 1)) for each in long]
    fixed = np.concatenate([_under_bumps(_motion(each, is_angle), each.ts, bumps) for each, bumps in cuts])
    gained = np.concatenate([_gained(each, bumps) for each, bumps in cuts])
    every = np.linspace(0.0, _LONGEST, _DELAYS)
    left = []
    for delay in every:
        pushed = [_pushed(each, bumps, delay, is_angle) for each, bumps in cuts]
        regressors = np.concatenate([fixed, np.concatenate(pushed)], axis=1)
        if len(regressors) < 2 * _MANY * regressors.shape[1]:
            return []
        left.append(_left(regressors, gained))
    now, best = left[0], int(np.argmin([np.mean(each) for each in left]))
    then, delay = left[best], float(every[best])
    interior = delay > 1.5 * step and best < _DELAYS - 1
    if not interior or np.mean(then) > min(_EXPLAINED, _LESS * np.mean(now)) or (then > 1.05 * now).any():
        return []
    total = [float(f"{each + delay:.2g}") for each in delays]
    said = f"{total[0]:g}" if len(total) == 1 else f"[{', '.join(f'{each:g}' for each in total)}]"
    return [
        Finding(
            kind="delay",
            level="note",
            channel=dataset.input_names[0] if dataset.inputs == 1 else "",
            text=f"in [train] accelerations follow the inputs best {delay:.2g} s late: {np.mean(now):.0%} of their "
            f"variance is unexplained without, {np.mean(then):.0%} with such a delay",
            advice=f"Try `input_delay = {said}`: by drives, networks or slow actuators. Errors of recordings held "
            "out of training tell whether it is better.",
        )
    ]


def _motion(recording: Trajectory, is_angle: np.ndarray) -> Float[np.ndarray, "T k"]:
    """What accelerates a mechanism beside its inputs, up to factors."""
    q, v = recording.q, recording.rates
    usual = np.maximum(np.sqrt(np.mean(v**2, axis=0)), np.finfo(float).tiny)
    places = [np.where(is_angle, np.cos(q), q), np.where(is_angle, np.sin(q), q**2), np.where(is_angle, 0.0, q**3)]
    friction = [v, np.tanh(v / (_SHARP * usual)), v * np.abs(v)]
    i, j = np.triu_indices(q.shape[1])
    return np.concatenate([np.ones((len(q), 1)), *places, *friction, v[:, i] * v[:, j]], axis=1)


def _pushed(
    recording: Trajectory, bumps: Int[np.ndarray, "B s"], delay: float, is_angle: np.ndarray
) -> Float[np.ndarray, "B k"]:
    """∫ w u dt of inputs of some time ago, as they are and as they turn with each angle."""
    ts, q = recording.ts, recording.q[:, is_angle]
    weight, _, times = _bumps(ts, bumps)
    turns = np.concatenate([np.ones((len(q), 1)), np.cos(q), np.sin(q)], axis=1)[bumps]
    us = np.stack([np.interp(ts[bumps] - delay, ts, column) for column in recording.us.T], axis=2)
    return np.einsum("bsm,bsa->bma", us, (weight * times)[:, :, None] * turns, optimize=True).reshape(len(bumps), -1)


def _bumps(ts: np.ndarray, bumps: Int[np.ndarray, "B s"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The weight of every sample of every bump, its slope, and the time that the sample counts for."""
    at = ts[bumps]
    span = at[:, -1:] - at[:, :1]
    x = 2 * (at - at[:, :1]) / span - 1
    times = np.gradient(at, axis=1)
    return (1 - x**2) ** 2, -8 * x * (1 - x**2) / span, times


def _under_bumps(signal: Float[np.ndarray, "T k"], ts: np.ndarray, bumps: Int[np.ndarray, "B s"]) -> np.ndarray:
    """∫ w signal dt of every bump."""
    weight, _, times = _bumps(ts, bumps)
    return np.einsum("bs,bsk->bk", weight * times, signal[bumps])


def _gained(recording: Trajectory, bumps: Int[np.ndarray, "B s"]) -> np.ndarray:
    """∫ w dv of every bump."""
    _, slope, times = _bumps(recording.ts, bumps)
    return -np.einsum("bs,bsk->bk", slope * times, recording.rates[bumps])


def _left(regressors: Float[np.ndarray, "B k"], gained: Float[np.ndarray, "B n"]) -> Float[np.ndarray, " n"]:
    """Share of the variance that either half of the stretches does not tell of the other."""
    scaled = regressors / np.maximum(np.abs(regressors).max(axis=0), np.finfo(float).tiny)
    halves = [np.arange(len(gained)) * _BLOCKS // len(gained) % 2 == k for k in (0, 1)]
    off = [
        gained[a] - scaled[a] @ np.linalg.lstsq(scaled[b], gained[b], rcond=_RANK)[0] for a, b in (halves, halves[::-1])
    ]
    return np.mean(np.concatenate(off) ** 2, axis=0) / np.maximum(np.var(gained, axis=0), np.finfo(float).tiny)

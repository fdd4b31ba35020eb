"""Inputs that act later than they were logged."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ._dataset import Dataset
from ._findings import Finding
from ._regression import unseen_residuals
from ._trajectory import Trajectory

_LONGEST: Final = 0.25  # [s] of a delay that is looked for; motors, networks and propellers take less.
_FINEST: Final = 0.005  # [s] between delays that are tried; half a step else.
_BUMP: Final = 0.15  # [s], or eight samples: what is shorter is noise of the velocities.
_FEWEST_STEPS: Final = 8
_MOST: Final = 800  # Bumps.
_MANY: Final = 2  # Bumps in either half for each number of the regression.
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
    parts = [
        _under_bumps(
            each,
            np.arange(first, len(each) - size, stride)[:, None] + np.arange(size + 1),
            is_angle,
            held=dataset.hold == "zero",
        )
        for each in long
    ]
    fixed, gained = (np.concatenate([getattr(part, name) for part in parts]) for name in ("motion", "gained"))
    numbers = fixed.shape[1] + dataset.inputs * parts[0].turning.shape[2]
    if len(fixed) < 2 * _MANY * numbers:
        return []
    every = np.arange(0.0, _LONGEST, max(step / 2, _FINEST))
    variance = np.maximum(np.var(gained, axis=0), np.finfo(float).tiny)
    left = []
    for delay in every:
        pushed = np.concatenate([part.pushed(delay) for part in parts])
        regressors = np.concatenate([fixed, pushed], axis=1)
        left.append(np.mean(unseen_residuals(regressors, gained) ** 2, axis=0) / variance)
    now, best = left[0], int(np.argmin([np.mean(each) for each in left]))
    then, delay = left[best], float(every[best])
    interior = delay > step / 2 and best < len(every) - 1
    if not interior or np.mean(then) > min(_EXPLAINED, _LESS * np.mean(now)) or (then > 1.05 * now).any():
        return []
    total = [float(f"{each + delay:.4g}") for each in delays]
    said = f"{total[0]:g}" if len(total) == 1 else f"[{', '.join(f'{each:g}' for each in total)}]"
    return [
        Finding(
            kind="delay",
            level="note",
            channel=dataset.input_names[0] if dataset.inputs == 1 else "",
            text=f"in [train] accelerations follow the inputs best {delay:.4g} s late: {100 * np.mean(now):.2g}% of "
            f"their variance is unexplained without, {100 * np.mean(then):.2g}% with such a delay",
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


class _Bumps(NamedTuple):
    """A recording under bumps w.

    Attributes:
        recording: The recording.
        samples: Its samples under each bump.
        motion: ∫ w of what accelerates a mechanism beside its inputs.
        gained: ∫ w dv.
        cells: dt of every sample [s].
        given: ∫ u dt from the first row on.
        turning: w dt of every sample as it is, and as it turns with each angle.
    """

    recording: Trajectory
    samples: Int[np.ndarray, "B s"]
    motion: Float[np.ndarray, "B k"]
    gained: Float[np.ndarray, "B n"]
    cells: Float[np.ndarray, "B s"]
    given: Float[np.ndarray, "T m"]
    turning: Float[np.ndarray, "B s a"]

    def pushed(self, delay: float) -> Float[np.ndarray, "B k"]:
        """∫ w u dt of inputs of some time ago, as they are and as they turn with each angle."""
        # Means over every sample's cell, half of which is before it: of an input that is held until the next row these
        # are (u[k−1] + u[k]) / 2, as it acts half a step later than its row.
        ts = self.recording.ts
        at = ts[self.samples] - delay

        def integral(until: Float[np.ndarray, "B s"]) -> Float[np.ndarray, "B s m"]:
            return np.stack([np.interp(until, ts, column) for column in self.given.T], axis=2)

        means = (integral(at + self.cells / 2) - integral(at - self.cells / 2)) / self.cells[:, :, None]
        return np.einsum("bsm,bsa->bma", means, self.turning, optimize=True).reshape(len(at), -1)


def _under_bumps(recording: Trajectory, samples: Int[np.ndarray, "B s"], is_angle: np.ndarray, *, held: bool) -> _Bumps:
    """Integrate a recording under bumps (1 − x²)²."""
    at, q = recording.ts[samples], recording.q[:, is_angle]
    span, times = at[:, -1:] - at[:, :1], np.gradient(at, axis=1)
    x = 2 * (at - at[:, :1]) / span - 1
    weight, slope = (1 - x**2) ** 2, -8 * x * (1 - x**2) / span
    us = recording.us
    between = us[:-1] if held else (us[:-1] + us[1:]) / 2
    sums = np.cumsum(between * np.diff(recording.ts)[:, None], axis=0)
    turns = np.concatenate([np.ones((len(q), 1)), np.cos(q), np.sin(q)], axis=1)
    return _Bumps(
        recording=recording,
        samples=samples,
        motion=np.einsum("bs,bsk->bk", weight * times, _motion(recording, is_angle)[samples]),
        gained=-np.einsum("bs,bsk->bk", slope * times, recording.rates[samples]),
        cells=times,
        given=np.concatenate([np.zeros((1, us.shape[1])), sums]),
        turning=(weight * times)[:, :, None] * turns[samples],
    )

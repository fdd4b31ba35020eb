"""Inputs that act later than they were logged."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from ._bumps import bumps_of, unexplained
from ._dataset import Dataset
from ._findings import Finding

_LONGEST: Final = 0.25  # [s] of a delay that is looked for; motors, networks and propellers take less;
_STEPS: Final = 5  # and as many steps where these take longer.
_FINEST: Final = 0.005  # [s] between delays that are tried; half a step else.
_LESS: Final = (
    0.5  # Share of what was left that is left with the delay: 0.3 on a measured aeropendulum, elsewhere 0.67.
)
_WORSE: Final = 1.5  # Times what is left without, that a shorter delay may leave.
_EXPLAINED: Final = 0.3  # Share of the accelerations' variance that may be left then.


def find_late_inputs(dataset: Dataset, delays: Sequence[float], is_angle: np.ndarray) -> list[Finding]:
    """Say where accelerations follow the inputs far better some time later.

    Accelerations under short bumps are predicted by what a mechanism has: functions of single positions, friction,
    products of velocities, and inputs, which may turn with a joint. Every other stretch is predicted from the rest. In
    the weak form no velocity is differentiated: ∫ w dv = −∫ w′ v dt. A periodic input is the same periods later: what
    is far worse in between is no delay.

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
    longest = max(_LONGEST, _STEPS * step)
    parts = bumps_of(dataset.train, is_angle, first=longest, held=dataset.hold == "zero")
    if not parts:
        return []
    every = np.arange(0.0, longest, max(step / 2, _FINEST))
    left = [np.mean(unexplained(parts, delay), axis=0) for delay in every]
    means = np.mean(left, axis=1)
    now, best = left[0], int(np.argmin(means))
    then, delay = left[best], float(every[best])
    interior = delay > step / 2 and best < len(every) - 1
    less = means[best] <= min(_EXPLAINED, _LESS * means[0])
    if not (interior and less) or (then > 1.05 * now).any() or means[:best].max() > _WORSE * means[0]:
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

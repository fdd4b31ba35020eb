"""Inputs that act later, or sooner, than the description says."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from jaxtyping import Float

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data._trajectory import median_step
from symoden.data.logs import SLOW
from symoden.wording import percent

from ._bumps import bumps_of, unexplained
from ._told_inputs import shares_told

_LONGEST: Final = 0.25  # [s] of a delay that is looked for; motors, networks and propellers take less;
_STEPS: Final = 5  # and as many steps where these take longer.
_SOONER: Final = 0.05  # [s], or two steps where these take longer, by which filters and stamps of means are late.
_FINEST: Final = 0.005  # [s] between delays that are tried; half a step else.
_LESS: Final = (
    0.5  # Share of what was left that is left with the delay: 0.3 on a measured aeropendulum, elsewhere 0.67.
)
_FAR_LESS: Final = 0.2  # The same, and
_MUCH: Final = 0.01  # what is left as it is, from which nothing else is as wrong.
_HALF: Final = 0.51  # Steps: half of one is what the other hold makes of a smooth input.
_WORSE: Final = 1.5  # Times what is left as it is, that a delay in between may leave.
_TOLD: Final = 0.97  # Share of an input's variance, by positions and velocities, that leaves none to be late.
_EXPLAINED: Final = 0.3  # Share of the accelerations' variance that may be left then.


def find_late_inputs(dataset: Dataset, delays: Sequence[float], is_angle: np.ndarray) -> list[Finding]:
    """Say where accelerations follow the inputs far better some time later or, of delayed inputs, sooner.

    Accelerations under short bumps are predicted by what a mechanism has: functions of single positions, friction,
    products of velocities, and inputs, which may turn with a joint. Every other stretch is predicted from the rest. In
    the weak form no velocity is differentiated: ∫ w dv = −∫ w′ v dt. A periodic input is the same periods later: what
    is far worse in between is no delay. Nor does one show where positions and velocities tell all inputs, as the target
    that a servo follows: a regression takes these for the input, or its delay for them.

    Args:
        dataset: Recordings as training sees them.
        delays: What the description says of inputs already [s].
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding, or none: a warning where much is left as it is and far less then, for whatever else looks wrong
        may be so for the delay.
    """
    if not dataset.train or not dataset.inputs or dataset.momenta:
        return []
    step = median_step(dataset.train)
    if step >= SLOW:  # The clock is doubted rather.
        return []
    every = delays_tried(step, min(delays))
    parts = bumps_of(dataset.train, is_angle, first=every[-1], last=-every[0], held=dataset.hold == "zero")
    if not parts:
        return []
    left = [np.mean(unexplained(parts, change), axis=0) for change in every]
    means = np.mean(left, axis=1)
    said, best = int(np.searchsorted(every, 0.0)), int(np.argmin(means))
    between = means[min(said, best) : max(said, best)]
    clear = abs(every[best]) > _HALF * step and 0 < best < len(every) - 1
    less = means[best] <= min(_EXPLAINED, _LESS * means[said])
    if not (clear and less) or (left[best] > 1.05 * left[said]).any() or between.max() > _WORSE * means[said]:
        return []
    if (shares_told(dataset, is_angle) > _TOLD).all():
        return []
    return [_finding(dataset, delays, float(every[best]), now=float(means[said]), then=float(means[best]))]


def delays_tried(step: float, told: float) -> Float[np.ndarray, " d"]:
    """What to add to a delay, in order: what leads to none, to usual ones, and to what is near.

    Args:
        step: Usual step of the rows [s].
        told: The delay that is told [s].

    Returns:
        What is added [s], the least first; 0 is among them.
    """
    spacing, longest = max(step / 2, _FINEST), max(_LONGEST, _STEPS * step)
    sooner = max(_SOONER, 2 * step)
    usual = spacing * np.arange(np.ceil((-sooner - told) / spacing), (longest - told) / spacing)
    near = spacing * np.arange(-np.floor(min(longest, max(told + sooner, 0.0)) / spacing), longest / spacing)
    return np.unique(np.round([-told, *usual, *near], 9))


def _finding(dataset: Dataset, delays: Sequence[float], change: float, *, now: float, then: float) -> Finding:
    """What to say of another delay, and of the shares of the accelerations that are left now and then."""
    total = [float(f"{each + change:.4g}") for each in delays]
    told = f"{total[0]:g}" if len(total) == 1 else f"[{', '.join(f'{each:g}' for each in total)}]"
    wrong = now > _MUCH and then <= _FAR_LESS * now
    sooner = "sooner than `input_delay` says" if any(delays) else "before their rows"
    when = f"{abs(change):.4g} s {'late' if change > 0 else sooner}"
    why = (
        ": by drives, networks or slow actuators (which an `input_lag` may suit; of up to three coordinates `train` "
        "says which). "
        if change > 0
        else ". "
    )
    if min(total) < 0:
        why = ": by filters, or means that are stamped at their end. "
    return Finding(
        kind="delay",
        level="warning" if wrong else "note",
        channel=dataset.input_names[0] if dataset.inputs == 1 else "",
        text=f"in [train] accelerations follow the inputs best {when}: {percent(now)} of their variance is "
        f"unexplained {'without' if change > 0 else 'as they are'}, {percent(then)} with such a delay",
        advice=(f"Try `input_delay = {told}`" if any(total) else "Try without `input_delay`")
        + why
        + "Errors of recordings held out of training tell whether it is better.",
    )

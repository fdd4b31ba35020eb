"""Sensors that are late beside others: a camera beside encoders."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from jaxtyping import Bool, Float

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data._trajectory import median_step
from symoden.data.logs import SLOW
from symoden.data.signals import advance_positions
from symoden.wording import percent

from ._bumps import Bumps, bumps_of, stacked
from ._regression import unseen_residuals

_LONGEST: Final = 0.1  # [s] of a delay that is looked for, or
_STEPS: Final = 5  # so many steps.
_FINEST: Final = 0.005  # [s] between delays that are tried in the end; half a step else.
_HINTS: Final = 0.7  # Share of what was left, in any equation, for which others in between are tried.
_LESS: Final = 0.2  # The same in one of them, for which something is said, where
_MUCH: Final = 0.01  # this share of the variance is left as it is, or more.
_MOST_LEFT: Final = 0.5  # Share of the variance in any: what hardly follows its equation follows others by chance.
_BEYOND: Final = 2  # Delays sooner than none, by which one that is said and is none has neighbours.
_WORSE: Final = 1.05  # Times what was left, that other equations may leave then.
_MOST_COORDINATES: Final = 8  # Each is asked of each.


def find_late_positions(dataset: Dataset, delays: Sequence[float], is_angle: np.ndarray) -> list[Finding]:
    """Say which coordinate goes together with the others far better if its sensor is late.

    Each equation of motion predicts one acceleration from the others, which may turn with angles, and from what
    `find_late_inputs` takes. Where one sensor is late, all equations of which it is a part say so with the same delay.
    A late input is a part of its own equation alone.

    Args:
        dataset: Recordings as training sees them.
        delays: What the description says of positions already [s], one for all or one each.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding, or none.
    """
    n = len(is_angle)
    if not dataset.train or dataset.momenta or not 1 < n <= _MOST_COORDINATES:
        return []
    step = median_step(dataset.train)
    if step >= SLOW:  # The clock is doubted rather.
        return []
    spacing, longest = max(step / 2, _FINEST), max(_LONGEST, _STEPS * step)
    said = np.broadcast_to(np.asarray(delays, float), n)
    now = _left(dataset, np.zeros(n), is_angle, longest)
    if now is None or (now > _MOST_LEFT).any():
        return []
    found = [
        each for j in range(n) if (each := _late(dataset, j, now, is_angle, spacing, (said[j] - said.min(), longest)))
    ]
    if not found:
        return []
    j, delay, then = min(found, key=lambda each: np.prod(each[2]))
    return [_finding(dataset, said, j, delay, now=now, then=then)]


def _late(
    dataset: Dataset,
    j: int,
    now: Float[np.ndarray, " n"],
    is_angle: np.ndarray,
    spacing: float,
    most: tuple[float, float],
) -> tuple[int, float, Float[np.ndarray, " n"]] | None:
    """Which coordinate is later than is said, or sooner by `most` at most; by how much; and what is left then."""
    tried = {0: now}
    sooner, later = (int(each / spacing + 1e-9) for each in most)
    sooner = sooner + _BEYOND if sooner else 0

    def left(k: int) -> Float[np.ndarray, " n"]:
        if k not in tried:
            some = _left(dataset, k * spacing * (np.arange(len(now)) == j), is_angle, most[1])
            tried[k] = np.full(len(now), np.inf) if some is None else some
        return tried[k]

    rough = [*_rough(later), *(-k for k in _rough(sooner))]
    best = min(rough, key=lambda k: np.prod(left(k)))
    if not (left(best) < _HINTS * now).any():
        return None
    for k in range(max(abs(best) // 2, 1), 2 * abs(best) + 1):
        if -sooner <= np.sign(best) * k <= later:
            left(int(np.sign(best)) * k)
    every = np.array(sorted(tried))
    shares = np.array([tried[k] for k in every])
    at = int(np.argmin(shares.prod(axis=1)))
    then = shares[at]
    told = np.flatnonzero(then < _HINTS * now)  # These have to agree.
    agree = bool(len(told)) and np.abs(every[np.argmin(shares[:, told], axis=0)] - every[at]).max() <= 1
    clear = _far_less(now, then).any() and (then <= _WORSE * now).all()
    inside = 0 < at < len(every) - 1
    return (j, float(every[at] * spacing), then) if agree and clear and inside else None


def _rough(most: int) -> list[int]:
    """Numbers from 1 on, each up to twice the one before."""
    return [*{min(2**k, most): None for k in range(most.bit_length() + 1)}] if most else []


def _far_less(now: Float[np.ndarray, " n"], then: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """In which equations far less is left then."""
    return (then <= _LESS * now) & (now > _MUCH)


def _left(
    dataset: Dataset, delays: Float[np.ndarray, " n"], is_angle: np.ndarray, longest: float
) -> Float[np.ndarray, " n"] | None:
    """Share of each acceleration's variance that is left by what it did not see; None where too little tells."""
    long = [each for each in dataset.train if each.duration > 2 * longest]
    sooner = -min(0.0, float(delays.min()))  # By as much all others are later, inputs too.
    moved = [advance_positions(each, (delays + sooner).tolist()) for each in long]
    # As much of each recording whatever the delays: they must be told by the same motion.
    last = [each.ts[-1] - each.ts[0] - longest for each in long]
    even = [
        each.cut(0, int(np.searchsorted(each.ts - each.ts[0], end)), name=each.name)
        for each, end in zip(moved, last, strict=True)
    ]
    parts = bumps_of(even, is_angle, last=sooner, held=dataset.hold == "zero") if even else []
    if not parts:
        return None
    motion, pushed, gained = stacked(parts, -sooner)
    turned = np.concatenate([_turned(part, is_angle) for part in parts])
    found = []
    for j in range(len(is_angle)):
        others = np.delete(turned, j, axis=1).reshape(len(turned), -1)
        regressors = np.concatenate([motion, pushed, others], axis=1)
        if len(regressors) < 4 * regressors.shape[1]:  # Twice in either half.
            return None
        residuals = unseen_residuals(regressors, gained[:, j : j + 1])
        found.append(np.mean(residuals**2) / max(np.var(gained[:, j]), np.finfo(float).tiny))
    return np.array(found)


def _turned(part: Bumps, is_angle: np.ndarray) -> Float[np.ndarray, "B n f"]:
    """∫ w f(q) dv of each coordinate, with f: 1, sines and cosines of angles and of their differences."""
    q, v = part.recording.q, part.recording.rates
    angles = np.eye(len(is_angle))[is_angle]
    i, j = np.triu_indices(len(angles), 1)
    turns = np.concatenate([angles, angles[i] - angles[j]])
    phases, speeds = q @ turns.T, v @ turns.T
    ones = np.ones((len(q), 1))
    factors = np.concatenate([ones, np.cos(phases), np.sin(phases)], axis=1)
    slopes = np.concatenate([0 * ones, -np.sin(phases) * speeds, np.cos(phases) * speeds], axis=1)

    def with_velocities(columns: Float[np.ndarray, "T f"]) -> Float[np.ndarray, "T k"]:
        return (v[:, :, None] * columns[:, None]).reshape(len(q), -1)

    # ∫ w f dv = ∫ w d(f v) − ∫ w v df.
    turned = part.changes(with_velocities(factors)) - part.integral(with_velocities(slopes))
    return turned.reshape(len(turned), len(is_angle), -1)


def _finding(
    dataset: Dataset,
    said: Float[np.ndarray, " n"],
    j: int,
    delay: float,
    *,
    now: Float[np.ndarray, " n"],
    then: Float[np.ndarray, " n"],
) -> Finding:
    """What to say of a coordinate that is late, and of the shares of the accelerations that are left now and then."""
    total = said + delay * (np.arange(len(now)) == j)
    total = total - (total.min() - said.min())
    told = ", ".join(f"{float(f'{each:.4g}'):g}" for each in total)
    when = f"{abs(delay):.4g} s {'late' if delay > 0 else 'sooner than `position_delay` says'}"
    row = int(np.argmin(np.where(_far_less(now, then), then / now, np.inf)))
    return Finding(
        kind="delay",
        level="warning",
        channel=dataset.position_names[j],
        text=f"in [train] `{dataset.position_names[j]}` goes together with the other coordinates best if it is "
        f"{when}: {percent(float(now[row]))} of the variance of the accelerations of "
        f"`{dataset.position_names[row]}` is unexplained as it is, {percent(float(then[row]))} with such a delay",
        advice=f"Try `position_delay = [{told}]`: cameras, filters and slow buses are late beside encoders. Errors of "
        "recordings held out of training tell whether it is better.",
    )

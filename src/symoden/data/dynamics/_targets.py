"""Targets of position servos: inputs that say where positions go."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from jaxtyping import Float

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data._trajectory import Trajectory, median_step
from symoden.data.description import entry, of_column
from symoden.wording import first_few

_FOLLOWED: Final = 0.9  # Share of a target's variance that its position is; 0.99 of a servo.
_CONSTANT: Final = 1e-12  # Variance that is rounding, relative to the mean square.
_NAMED: Final = 3  # Joints.
_LATEST: Final = 0.25  # [s] after its target that a position is where it said, as so slow a servo has it;
_LAGS: Final = 9  # of which so many are tried.


def find_targets(dataset: Dataset, units: Mapping[str, float], is_angle: np.ndarray) -> list[Finding]:
    """Say which inputs are targets that angles follow: the springs of their servos have no place in a periodic V.

    Args:
        dataset: Recordings as training sees them.
        units: Units of columns that the description gives.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding, or none.
    """
    from symoden.spaces import Space  # imports JAX

    targets = [(i, j) for i, j in enumerate(targets_of(dataset, units)) if j is not None and is_angle[j]]
    if not targets:
        return []
    joints = {j: dataset.position_names[j] for _, j in targets}
    space = Space(tuple(bool(angle) and j not in joints for j, angle in enumerate(is_angle)))
    untold = {name: "rad" for name in joints.values() if of_column(name, units) is None}
    named = first_few((f"`{joints[j]}` goes where `{dataset.input_names[i]}` says" for i, j in targets), _NAMED)
    given = dataset.known is not None and "potential_energy" in dataset.known.given
    spaced = f'write `space = "{space}"`' + (f", {entry(untold, units)}" if untold else "")
    return [
        Finding(
            kind="target",
            level="warning",
            channel=dataset.input_names[targets[0][0]] if len(targets) == 1 else "",
            text=f"in [train] {named}, as the joint of a position servo does. That is a spring between both, which a "
            "periodic V cannot be: predictions may be ten times worse",
            advice=(
                f"If it is a servo, take what its motor does (current or torque) for the input; or {spaced}, and add "
                "the spring to V under [known]."
                if given
                else f"If it is a servo and never goes round, {spaced}, and compare errors of recordings that training "
                "has not seen."
            ),
        )
    ]


def targets_of(dataset: Dataset, units: Mapping[str, float]) -> tuple[int | None, ...]:
    """Find which position each input is the target of: the one that is nearly equal to it a moment later.

    Targets may count from another zero, in the unit of the position, in the one that it was logged in, or in degrees.

    Args:
        dataset: Recordings as training sees them.
        units: Units of columns that the description gives.

    Returns:
        For each input the coordinate that goes where it says; `None` where there is none.
    """
    if not dataset.train or not dataset.inputs:
        return (None,) * dataset.inputs
    logged = [of_column(name, units) or 1.0 for name in dataset.position_names]
    factors = np.array([[1.0, np.pi / 180, factor] for factor in logged])
    lags = np.unique(np.round(np.linspace(0.0, _LATEST / median_step(dataset.train), _LAGS)).astype(int))
    left = np.min([_left(dataset.train, factors, int(lag)) for lag in lags], axis=0)
    nearest = np.argmin(left, axis=1)
    return tuple(int(j) if left[i, j] < 1 - _FOLLOWED else None for i, j in enumerate(nearest))


@np.errstate(divide="ignore", over="ignore", invalid="ignore")
def _left(recordings: Sequence[Trajectory], factors: Float[np.ndarray, "n f"], lag: int) -> Float[np.ndarray, "m n"]:
    """Share of each input's variance that a position some rows later is not, of its nearest unit.

    Returns:
        The shares; infinite where nothing can be compared, as of an input that is constant.
    """
    long = [each for each in recordings if len(each) > lag + 1]
    if not long:
        return np.full((recordings[0].us.shape[1], len(factors)), np.inf)
    us = np.concatenate([each.us[: len(each) - lag] for each in long])
    q = np.concatenate([each.q[lag:] for each in long])
    spread = np.var(us, axis=0)
    spread[spread <= _CONSTANT * np.mean(us**2, axis=0)] = np.nan
    together = (us - us.mean(axis=0)).T @ (q - q.mean(axis=0)) / len(q)
    shares = [
        1 - 2 * together / np.outer(spread, factor) + np.var(q, axis=0) / np.outer(spread, factor**2)
        for factor in factors.T
    ]
    return np.nan_to_num(np.min(shares, axis=0), nan=np.inf)

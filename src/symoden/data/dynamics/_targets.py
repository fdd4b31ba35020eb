"""Targets of position servos: inputs that say where positions go."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data.description import entry

_FOLLOWED: Final = 0.9  # Share of a target's variance that its position is; 0.99 of a servo, elsewhere below 0.4.
_CONSTANT: Final = 1e-12  # Variance that is rounding, relative to the mean square.


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

    targets = [(i, j) for i, j in enumerate(targets_of(dataset)) if j is not None and is_angle[j]]
    if not targets:
        return []
    joints = {j: dataset.position_names[j] for _, j in targets}
    space = Space(tuple(bool(angle) and j not in joints for j, angle in enumerate(is_angle)))
    untold = {name: "rad" for name in joints.values() if name not in units}
    named = ", ".join(f"`{joints[j]}` goes where `{dataset.input_names[i]}` says" for i, j in targets)
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


def targets_of(dataset: Dataset) -> tuple[int | None, ...]:
    """Find which position each input is the target of: the one that is nearly equal to it, in its own unit.

    Args:
        dataset: Recordings as training sees them.

    Returns:
        For each input the coordinate that goes where it says; `None` where there is none.
    """
    if not dataset.train:
        return (None,) * dataset.inputs
    q, us = (np.concatenate([getattr(each, name) for each in dataset.train]) for name in ("q", "us"))
    left = np.mean((us[:, :, None] - q[:, None, :]) ** 2, axis=0)
    spread = np.var(us, axis=0)
    nearest = np.argmin(left, axis=1) if us.shape[1] else []
    moves = spread > _CONSTANT * np.mean(us**2, axis=0)
    return tuple(
        int(j) if moves[i] and left[i, j] < (1 - _FOLLOWED) * spread[i] else None for i, j in enumerate(nearest)
    )

"""What acts on a mechanism while it is recorded."""

from collections.abc import Callable
from typing import Any, TypeAlias

import gymnasium
import numpy as np
from jaxtyping import Float64

Policy: TypeAlias = Callable[[Any], np.ndarray]


def random_levels(
    actions: gymnasium.Space, *, dt: float, hold: tuple[float, float] = (0.1, 0.5), scale: float = 1.0, seed: int = 0
) -> Policy:
    """Excite each input by steps between random levels, each held for a random time.

    The levels are uniform between the limits, so that all sizes of input occur; the steps between them excite fast and
    slow motions alike. Inputs that are held between samples are recorded exactly as they act.

    Args:
        actions: Space of the actions, with limits.
        dt: Control period [s].
        hold: Shortest and longest time between two steps [s].
        scale: Share of the limits that is used.
        seed: Seed of levels and times.

    Returns:
        A policy that looks at nothing; each call is one control period later.

    Raises:
        ValueError: If there are no limits, or a setting is out of range.

    References:
        Nelles (2001), *Nonlinear System Identification*, section 17.7: amplitude-modulated pseudo-random signals.

    Example:
        >>> policy = random_levels(gymnasium.spaces.Box(-2.0, 2.0, (1,)), dt=0.05, hold=(0.1, 0.1))
        >>> levels = [policy(None).item() for _ in range(4)]
        >>> levels[0] == levels[1] != levels[2] == levels[3]
        True
    """
    low, high = limits_of(actions)
    if not (0 < dt <= hold[1] and 0 < hold[0] <= hold[1] and 0 < scale <= 1):
        raise ValueError(
            f"`hold` must be a shortest and a longest time, the longest at least `dt`, and `scale` in (0, 1]; got "
            f"{hold}, {dt} and {scale}."
        )
    generator = np.random.default_rng(seed)
    middle, reach = (high + low) / 2, scale * (high - low) / 2
    level, left = np.zeros_like(low), np.zeros(low.shape, int)

    def policy(observation: Any) -> np.ndarray:  # noqa: ANN401 - whatever the environment shows
        nonlocal level, left
        del observation
        drawn = middle + reach * generator.uniform(-1, 1, low.shape)
        periods = np.maximum(1, np.rint(generator.uniform(*hold, low.shape) / dt)).astype(int)
        level, left = np.where(left == 0, drawn, level), np.where(left == 0, periods, left) - 1
        return level.astype(actions.dtype)

    return policy


def limits_of(actions: gymnasium.Space) -> tuple[Float64[np.ndarray, "..."], Float64[np.ndarray, "..."]]:
    """Lowest and highest continuous action.

    Args:
        actions: Space of the actions.

    Returns:
        Both.

    Raises:
        ValueError: If the actions are no vectors of real numbers between limits.
    """
    if not (isinstance(actions, gymnasium.spaces.Box) and actions.is_bounded() and len(actions.shape) == 1):
        raise ValueError(f"Actions must be continuous, a bounded `Box` of one axis; got {actions}.")
    return actions.low.astype(np.float64), actions.high.astype(np.float64)

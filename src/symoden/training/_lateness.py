"""How late inputs act, and what that leaves of a model's errors."""

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple, TypeAlias

Key: TypeAlias = Literal["input_lag", "input_delay"]
"""What a description calls that which makes inputs late."""


class Lateness(NamedTuple):
    """What inputs that act late would leave of a model's errors; its string says it in words.

    Attributes:
        key: What makes them late.
        seconds: How late they act [s], one for each of them or one for all.
        loss: Loss that is left.
        before: Loss of inputs that act at once.
        windows: Number of windows that tell.
        gained: By how many standard errors it is better.
        found: Whether it is clear.
        other: Time of the other key [s] and what that leaves, if it was asked.
    """

    key: Key
    seconds: tuple[float, ...]
    loss: float
    before: float
    windows: int
    gained: float
    found: bool
    other: tuple[float, float] | None = None

    @property
    def hardly(self) -> bool:
        """It refuses nothing."""
        return False

    def __str__(self) -> str:
        """In words."""
        return f"{'found' if self.found else 'none'} (with `{self._setting}` {self._size})"

    @property
    def advice(self) -> str:
        """What to say where they act late."""
        return (
            "the inputs seem to act late, as through motors, propellers, valves or networks: with a "
            f"{'lag' if self.key == 'input_lag' else 'delay'} {self._size}. Write `{self._setting}` into the "
            "description (longer by it, where it has one), and train again: recordings held out of training tell "
            "whether it is better."
        )

    @property
    def _setting(self) -> str:
        """What a description would have."""
        return f"{self.key} = {_numbers(self.seconds)}"

    @property
    def _size(self) -> str:
        """How much it leaves, in words."""
        other = "delay" if self.key == "input_lag" else "lag"
        notes = [] if math.isinf(self.gained) else [f"{self.gained:+.2f} standard errors"]
        notes += [] if self.other is None else ["with a {} of {:.2g} s {:.2g}".format(other, *self.other)]
        aside = f" ({', '.join(notes)})" if notes else ""
        return (
            f"a simple model is left with a loss of {self.loss:.2g} over {self.windows} windows, {self.before:.2g} "
            f"without{aside}"
        )


def _numbers(seconds: Sequence[float]) -> str:
    """Times as a description has them, to a few percent."""
    every = [f"{each:.2g}" for each in seconds]
    return every[0] if len(set(every)) == 1 else f"[{', '.join(every)}]"

"""How a controller is connected to its machine: sampled with zero-order hold, noise, delay and lag."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from jaxtyping import Array, Float

from symoden.shapes import Inputs

from ._lag import Lag

MOST_PERIODS: Final = 10**7
"""Most control periods in which states are kept."""
_LOUDEST: Final = 1e6
_LONGEST: Final = 10.0  # [s], or the episode: how far is looked ahead.
_STEP = 0.005
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class Loop:
    """How a controller is connected to its machine.

    Attributes:
        duration: Length of an episode [s].
        period: Control period [s]; the input is held in between.
        noise: Standard deviation of the Gaussian noise on every measured coordinate and velocity.
        delay: Time from a measurement to its input [s].
        lag: Time constant of the first-order lag by which what acts follows each input [s], or one for all of them;
            none if empty.
        step: Longest step of the plant's integration [s], within the control period.
    """

    duration: float = 10.0
    period: float = 0.005
    noise: float = 0.0
    delay: float = 0.0
    lag: tuple[float, ...] = ()
    step: float = _STEP

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated.

        Raises:
            ValueError: If a time is not positive, the episode is shorter than a period or has too many, noise, delay or
                a lag is negative, noise is huge, lags are no tuple, or delay or a lag is longer than 10 s and the
                episode.
        """
        values = (self.duration, self.period, self.noise, self.delay, self.step)
        if not all(map(math.isfinite, values)) or min(self.period, self.step) <= 0 or self.duration < self.period:
            raise ValueError(
                "Duration, period and step must be positive, the duration at least one period; got "
                f"{self.duration}, {self.period} and {self.step} s."
            )
        if self.duration / self.period > MOST_PERIODS:
            raise ValueError(
                f"An episode must have at most {MOST_PERIODS} control periods; got {self.duration / self.period:.3g}."
            )
        if not 0 <= self.noise <= _LOUDEST or self.delay < 0:
            raise ValueError(
                f"Noise must be between 0 and {_LOUDEST:g}, delay at least 0; got {self.noise} and {self.delay}."
            )
        if not isinstance(self.lag, tuple):
            raise ValueError(f"Lags must be a tuple of seconds, such as (0.1,); got {self.lag!r}.")
        Lag(self.lag)
        if max(self.delay, *self.lag, 0.0) > max(self.duration, _LONGEST):
            raise ValueError(
                f"Delay and lags must be at most {max(self.duration, _LONGEST):g} s; got {self.delay} and {self.lag}."
            )

    @property
    def samples(self) -> int:
        """Number of control periods."""
        return round(self.duration / self.period)

    @property
    def is_late(self) -> bool:
        """Whether inputs act later than they are given."""
        return self.delay > 0 or any(self.lag)

    def lag_of(self, inputs: int) -> Lag:
        """The lag of each input.

        Args:
            inputs: Number of inputs m.

        Returns:
            The lags.

        Raises:
            ValueError: If their number is wrong.
        """
        if len(self.lag) not in (0, 1, inputs):
            raise ValueError(f"A lag must be one number or one per input, {inputs}; got {len(self.lag)}: {self.lag}.")
        return Lag(self.lag if len(self.lag) == inputs else (self.lag or (0.0,)) * inputs)

    @property
    def waiting(self) -> int:
        """Number of inputs that were given and do not act yet, when the next one is."""
        return math.ceil(self.delay / self.period - _ROUNDING)

    @property
    def early(self) -> float:
        """For how long the oldest of them goes on acting in a period [s], before the next one does; 0 for all of it."""
        first = self.period - (self.waiting * self.period - self.delay)
        return first if self.waiting and first < (1 - _ROUNDING) * self.period else 0.0

    def parts(self, given: Float[Array, "w m"]) -> Iterator[tuple[Inputs, float]]:
        """What a period has of the inputs that were given, before any lag.

        Args:
            given: Those that waited, and this period's.

        Returns:
            Each input with the time for which it is held [s].
        """
        if self.early:
            yield given[0], self.early
        yield given[1 if self.early else 0], self.period - self.early

    def steps(self, seconds: float) -> int:
        """Number of integration steps.

        Args:
            seconds: Of how long [s].

        Returns:
            The number.
        """
        return max(1, math.ceil(seconds / self.step - _ROUNDING))

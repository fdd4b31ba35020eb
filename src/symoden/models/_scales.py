"""Natural units of a mechanism, so that networks read and write numbers of order one whatever the data's units."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from symoden.spaces import Space


@dataclass(frozen=True, kw_only=True, eq=False)
class Scales:
    """Typical magnitudes on the training data.

    Attributes:
        center: Middle of each embedded coordinate; 0 for cosines and sines.
        spread: Spread of each embedded coordinate; 1 for cosines and sines.
        velocity: Root mean square of each velocity.
        momentum: Unit of each momentum: measured where the data are momenta, otherwise the gauge's choice.
        input: Root mean square of each input.
        time: Typical velocity over typical acceleration [s].
        parameters: Of each named parameter that starts at 0, the value that changes forces by typical ones; 1 for those
            that are not named here.
        reach: How far each embedded coordinate goes from its center, in its spread; None where that is not known.
    """

    center: np.ndarray
    spread: np.ndarray
    velocity: np.ndarray
    momentum: np.ndarray
    input: np.ndarray
    time: float
    parameters: Mapping[str, float] = field(default_factory=dict)
    reach: np.ndarray | None = None

    @classmethod
    def units(cls, space: Space, inputs: int) -> "Scales":
        """All ones: the data's own units, as in the paper.

        Args:
            space: Configuration space.
            inputs: Number of inputs.

        Returns:
            Scales that change nothing.
        """
        n, e = space.size, space.embedded_size
        return cls(
            center=np.zeros(e),
            spread=np.ones(e),
            velocity=np.ones(n),
            momentum=np.ones(n),
            input=np.ones(inputs),
            time=1.0,
        )

    @property
    def energy(self) -> float:
        """Unit of energy."""
        return float(np.mean(self.velocity * self.momentum))

    @property
    def force(self) -> np.ndarray:
        """Unit of each generalized force."""
        return self.momentum / self.time

"""Settings of a model."""

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

from symoden.blocks import ACTIVATIONS

Kind = Literal["dissipative", "unstructured", "symoden", "naive", "geometric"]
"""Name of one of the paper's five models."""
KINDS: tuple[Kind, ...] = get_args(Kind)
"""Names of the five models."""


@dataclass(frozen=True, kw_only=True)
class BlockConfig:
    """How a block's coefficients depend on the configuration.

    Attributes:
        hidden: Widths of the hidden layers; none for a plain constant.
        constant: Start from a learned constant. With `hidden`, the network is then a correction that starts at zero
            and stays frozen until validation data ask for it.
        harmonics: On a space with angles, start likewise from products of their first harmonics and of low powers of
            lengths, as rigid bodies on joints have them: of up to three factors, on more than three coordinates of as
            many as leave a block below 2000 numbers. On lengths alone, and on one angle alone, M⁻¹ starts from a
            constant, since what slides or swings alone has one; the angle's harmonics are then a correction. On lengths
            alone any other block starts from a polynomial of degree 4, or of a lower one on many coordinates.
    """

    hidden: tuple[int, ...] = ()
    constant: bool = False
    harmonics: bool = False

    def __post_init__(self) -> None:
        """Refuse a block without parameters, and empty layers.

        Raises:
            ValueError: If there is nothing to start from, or more than one thing, or a width is below 1.
        """
        if not self.hidden and not (self.constant or self.harmonics):
            raise ValueError("A block needs `hidden` layers, `constant=True` or `harmonics=True`; got none.")
        if self.constant and self.harmonics:
            raise ValueError("A block starts from a constant or from harmonics, which have one; got both.")
        if any(width < 1 for width in self.hidden):
            raise ValueError(f"Every width in `hidden` must be at least 1; got {self.hidden}.")


@dataclass(frozen=True, kw_only=True)
class ModelConfig:
    """Settings of a model; the defaults were chosen on the four tasks and the arm (see `benchmarks/`).

    Attributes:
        kind: Which of the five models.
        inverse_mass: Block of M⁻¹; with harmonics, of the Jacobian whose square is M.
        potential: Block of V. Of harmonics with a network, those of single angles up to the 24th are another
            correction, which is asked for first.
        actuation: Block of g, unless it is given. Of a constant with a network, products as of `harmonics` are another
            correction on a space with angles, which is asked for first.
        friction: Block of D, or of its viscous part.
        energy: Hidden layers of the unstructured model's network.
        flow: Hidden layers of the baselines' network.
        full_friction: Use the paper's 2n × 2n D instead of friction on momenta.
        knees: Speeds, relative to the typical one, below which dry friction is smoothed; none for viscous friction. Dry
            and quadratic friction is a correction, which stays zero until validation data ask for it, and so is what
            depends on the direction.
        activation: Nonlinearity of every network. If None, "silu" on a space with angles, whose embedding is bounded,
            and "sin" on one of lengths alone, over which properties may change back and forth many times.
        floor: Lower bound ε of the eigenvalues of the scaled M⁻¹; its square is that of the scaled
            M where it starts from harmonics.
        scaled: Let networks read and write natural units of the data; the paper's do not.
    """

    kind: Kind = "dissipative"
    inverse_mass: BlockConfig = field(default_factory=lambda: BlockConfig(hidden=(20, 20), harmonics=True))
    potential: BlockConfig = field(default_factory=lambda: BlockConfig(hidden=(20, 20), harmonics=True))
    actuation: BlockConfig = field(default_factory=lambda: BlockConfig(hidden=(8,), constant=True))
    friction: BlockConfig = field(default_factory=lambda: BlockConfig(hidden=(8,), constant=True))
    energy: tuple[int, ...] = (32, 32)
    flow: tuple[int, ...] = (48, 48)
    full_friction: bool = False
    knees: tuple[float, ...] = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
    activation: str | None = None
    floor: float = 0.01
    scaled: bool = True

    def __post_init__(self) -> None:
        """Refuse unknown names, contradictory friction, and numbers that no model can have.

        Raises:
            ValueError: If `kind` is no model or `activation` no nonlinearity, dry friction is asked for on the full
                state, or a knee or the floor is out of range.
        """
        if self.kind not in KINDS:
            raise ValueError(f"`kind` must be one of {', '.join(KINDS)}; got {self.kind!r}.")
        if self.full_friction and self.knees:
            raise ValueError("Friction on the full state is viscous; got `knees`. Set `knees=()`.")
        if not all(0 < knee < math.inf for knee in self.knees):
            raise ValueError(f"Every speed in `knees` must be positive and finite; got {self.knees}.")
        if not 0 < self.floor < math.inf:  # Else M could be singular, and nothing would move.
            raise ValueError(f"`floor` must be positive and finite; got {self.floor}.")
        if self.activation is not None and self.activation not in ACTIVATIONS:
            raise ValueError(
                f"`activation` must be one of {', '.join(ACTIVATIONS)}, or None to choose it by the space; got "
                f"{self.activation!r}."
            )

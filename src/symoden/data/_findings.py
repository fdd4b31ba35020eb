"""What is worth saying of a log."""

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from ._errors import DataError

SHOWN_SPANS: Final = 20  # single rows of a finding that are marked, at most

Kind: TypeAlias = Literal[
    "missing", "line", "impossible", "gap", "time", "stuck", "held", "unit", "sign", "velocity", "slope", "wrap",
    "jump", "order", "clocks", "spike", "blind", "saturation", "rounding", "zero", "idle", "feedback", "target",
    "together", "delay", "hold", "copy", "unlike", "cyclic", "few", "refused",
]  # fmt: skip
Level: TypeAlias = Literal["note", "masked", "warning", "refused"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Something worth saying of a log, or of a whole data set.

    Attributes:
        kind: What it is about.
        level: What training does: nothing ("note"), leaves something out ("masked"), warns and takes it as it is
            ("warning"), or refuses the data ("refused"). Of `feedback` `data check` warns alone.
        channel: Column that it is about; empty if it is about all of them.
        text: What was found.
        advice: What to do.
        spans: Start and end of each stretch that it is about [s]; none if it is about everything.
    """

    kind: Kind
    level: Level
    channel: str
    text: str
    advice: str
    spans: tuple[tuple[float, float], ...] = ()


def refusal(error: DataError) -> Finding:
    """Why training refuses the data.

    Args:
        error: The error with which it does.

    Returns:
        The finding.
    """
    return Finding(kind="refused", level="refused", channel="", text=str(error), advice="")

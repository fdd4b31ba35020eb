"""Colours that the colour-blind can tell apart and that print in different greys; nothing is set globally."""

import textwrap
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes

# Okabe & Ito (2008), *Color Universal Design*.
COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
DASHES: Final = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))
INK: Final = "#222222"
TRUTH: Final[Mapping[str, Any]] = MappingProxyType(
    {"linestyle": "none", "marker": "o", "markersize": 3.6, "markerfacecolor": "none", "markeredgewidth": 0.8}
)
EDGE: Final[Mapping[str, Any]] = MappingProxyType({"color": INK, "linewidth": 0.8, "linestyle": ":"})
LABEL: Final = 9
SMALL: Final = 8

_WIDTH: Final = 20  # Letters beside a panel.
_LONG: Final = 100.0  # Times a recording, or seconds: a clock that started so long before it.


def tidy(ax: Axes) -> Axes:
    """Take away what says nothing.

    Args:
        ax: Axes that are drawn.

    Returns:
        The same axes.
    """
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=SMALL)
    ax.grid(visible=True, color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    return ax


def since(ts: Float[np.ndarray, " T"]) -> float:
    """What a picture counts time from: the first stamp of a clock that started long before, such as 1970, else zero.

    Args:
        ts: Time stamps [s], some of them unknown.

    Returns:
        The time [s].
    """
    known = ts[np.isfinite(ts)]
    return float(known[0]) if len(known) and abs(known[0]) > _LONG * max(float(np.ptp(known)), 1.0) else 0.0


def clock(every: Iterable[Float[np.ndarray, " T"]]) -> str:
    """Heading of the axis of time of recordings that are drawn below each other.

    Args:
        every: Time stamps of each [s].

    Returns:
        The words, which say so where `since` moves one.
    """
    return "time since the first row [s]" if any(map(since, every)) else "time [s]"


def wrapped(name: str) -> str:
    """A name in as many lines as fit beside a panel.

    Args:
        name: Of a recording.

    Returns:
        The lines.
    """
    return textwrap.fill(name, _WIDTH)

"""Learned blocks beside the true ones."""

import math

from matplotlib.axes import Axes

from symoden.experiments import BlockCurves

from ._style import COLOURS, DASHES, EDGE, LABEL, SMALL, TRUTH, tidy

_ROOM = 0.25


def plot_block(result: BlockCurves, *, ax: Axes, marks: int = 13) -> Axes:
    """Draw the entries of a block along a coordinate: the truth as circles, what was learned as lines.

    Where values lie beyond the training data, dotted lines mark the range of these.

    Args:
        result: What to draw.
        ax: Where.
        marks: Number of circles, about.

    Returns:
        The same axes.
    """
    many = len(result.entries) > 1
    every = max(1, len(result.values) // marks)
    for k, name in enumerate(result.entries):
        colour, dashes = COLOURS[k % len(COLOURS)], DASHES[k % len(DASHES)]
        ax.plot(result.values[::every], result.truth[::every, k], markeredgecolor=colour, **TRUTH)
        ax.plot(result.values, result.learned[:, k], color=colour, linestyle=dashes, linewidth=1.4, label=name)
    low, high = min(result.truth.min(), result.learned.min()), max(result.truth.max(), result.learned.max())
    # Room around a constant, so that rounding does not fill the panel, and for the names of the entries.
    room = _ROOM * max(high - low, abs(high), abs(low)) or 1.0
    if math.isfinite(room):
        ax.set_ylim(min(low, 0.0) - room * (low < 0), high + (1 + many) * room)
    for edge in result.visited:
        if result.values[0] < edge < result.values[-1]:
            ax.axvline(edge, **EDGE)
    ax.set_xlabel(result.coordinate, fontsize=LABEL)
    ax.set_ylabel(f"{result.symbol} [{result.unit}]", fontsize=LABEL)
    ax.set_title(f"{result.symbol}: relative error {result.error:.1g}", fontsize=LABEL)
    if many:
        ax.legend(fontsize=SMALL, frameon=False, loc="upper center", ncols=3, handlelength=1.6, columnspacing=1.0)
    return tidy(ax)

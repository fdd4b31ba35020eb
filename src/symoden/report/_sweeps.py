"""Errors over the number of training trajectories and over noise."""

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from symoden.experiments import Sweep

from ._looks import LOOKS, WIDTH
from ._style import EDGE, LABEL, SMALL, tidy

_LEFT = 4.0
_SPREAD = 0.035


def plot_sweep(result: Sweep, *, ax: Axes) -> Axes:
    """Draw prediction errors over what was varied, both axes logarithmic; bars are the range over seeds.

    Args:
        result: What to draw.
        ax: Where.

    Returns:
        The same axes; a value of 0 stands at the left edge, and a cross at the upper one where training failed or the
        error is not finite.
    """
    values = np.unique(np.concatenate([curve.values for curve in result.curves.values()]))
    least = np.min(values[values > 0])
    zero = least / _LEFT
    middle = (len(result.curves) - 1) / 2
    for k, (kind, curve) in enumerate(result.curves.items()):
        look = LOOKS[kind]
        # Side by side, so that bars do not hide each other.
        at = np.where(curve.values > 0, curve.values, zero) * (1 + _SPREAD) ** (k - middle)
        median, low, high = (
            np.where(np.isfinite(x) & (x > 0), x, np.nan) for x in (curve.median, curve.least, curve.greatest)
        )
        ax.plot(at, median, marker=look.marker, markersize=4.5, label=kind, **look.line)
        ax.vlines(at, low, high, color=look.colour, linewidth=WIDTH)
        lost = at[~np.isfinite(curve.median)]
        (crosses,) = ax.plot(lost, np.ones_like(lost), "x", color=look.colour, transform=ax.get_xaxis_transform())
        crosses.set(clip_on=False, in_layout=False)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xticks(np.where(values > 0, values, zero), labels=[f"{value:g}" for value in values])
    ax.set_xticks([], minor=True)
    if result.own > 0:
        ax.axvline(result.own, **EDGE)
    ax.set_xlabel(result.quantity, fontsize=LABEL)
    ax.set_ylabel("prediction error [SI], mean", fontsize=LABEL)
    return tidy(ax)


def draw_sweeps(results: Sequence[Sweep], *, figure: Figure) -> Figure:
    """Draw one panel for each quantity that was varied.

    Args:
        results: What to draw, at least one.
        figure: Where; empty, best with `layout="constrained"`.

    Returns:
        The same figure.
    """
    panels = figure.subplots(1, len(results), sharey=True, squeeze=False)[0]
    for result, ax in zip(results, panels, strict=True):
        plot_sweep(result, ax=ax)
    for ax in panels[1:]:
        ax.set_ylabel("")
    named: dict[str, Artist] = {}
    for ax in panels:
        handles, labels = ax.get_legend_handles_labels()
        named |= dict(zip(labels, handles, strict=True))
    figure.legend(
        list(named.values()), list(named), fontsize=SMALL, frameon=False, loc="outside right center", handlelength=2.8
    )
    return figure

"""Where the prediction error comes from."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from symoden.experiments import Extrapolation

from ._looks import note
from ._style import COLOURS, EDGE, INK, LABEL, SMALL, tidy

_BINS = 40


def plot_extrapolation(result: Extrapolation, *, ax: Axes) -> Axes:
    """Draw the error of each trajectory over how far its truth leaves the training range.

    Args:
        result: What to draw.
        ax: Where.

    Returns:
        The same axes; trajectories that stay inside stand left of the dotted line.
    """
    outside = result.outside
    groups = (
        ("inside", ~outside, "o", COLOURS[0], result.inside_median, "-"),
        ("outside", outside, "^", COLOURS[1], result.outside_median, "--"),
    )
    for name, chosen, marker, colour, median, dashes in groups:
        if not np.any(chosen):
            continue
        label = f"{name}: {np.sum(chosen)} trajectories"
        ax.plot(
            result.beyond[chosen],
            result.errors[chosen],
            linestyle="none",
            marker=marker,
            markersize=4.5,
            markerfacecolor="none",
            markeredgecolor=colour,
            label=label,
        )
        ax.axhline(median, color=colour, linestyle=dashes, linewidth=1.0, label=f"their median: {median:.2g}")
    ax.axvline(0.0, **EDGE)
    ax.set_yscale("log")
    ax.set_xlabel(f"how far the truth goes beyond the training range of {result.coordinate}", fontsize=LABEL)
    ax.set_ylabel("squared error of the rollout [SI]", fontsize=LABEL)
    ax.set_title(f"{100 * result.outside_share:.2f} % of the total error comes from outside", fontsize=LABEL)
    ax.legend(fontsize=SMALL, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
    return tidy(ax)


def plot_positions(result: Extrapolation, *, ax: Axes) -> Axes:
    """Draw the squared error of the coordinate over its true value, and where the training data lie.

    Args:
        result: What to draw.
        ax: Where; an axis of counts is added on the right.

    Returns:
        The same axes.
    """
    ax.plot(
        result.positions,
        result.deviations,
        linestyle="none",
        marker=".",
        markersize=2.5,
        color=COLOURS[0],
    )
    ax.set_yscale("log")
    counts = ax.twinx()
    counts.hist(result.training, bins=_BINS, histtype="step", color=INK, linewidth=1.0)
    counts.set_ylabel("training samples in a bin (steps)", fontsize=LABEL)
    counts.tick_params(labelsize=SMALL)
    counts.spines["top"].set_visible(False)
    for edge in result.visited:
        ax.axvline(edge, **EDGE)
    ax.set_xlabel(f"true {result.coordinate}", fontsize=LABEL)
    ax.set_ylabel("squared error [rad²] (dots)", fontsize=LABEL)
    ax.set_title("Each sample of the rollouts; dotted: training range", fontsize=LABEL)
    return tidy(ax)


def draw_extrapolation(result: Extrapolation, *, figure: Figure) -> Figure:
    """Draw errors over how far rollouts go, and over where they are.

    Args:
        result: What to draw.
        figure: Where; empty, about 9 × 4 inches, best with `layout="constrained"`.

    Returns:
        The same figure.
    """
    left, right = figure.subplots(1, 2)
    plot_extrapolation(result, ax=left)
    plot_positions(result, ax=right)
    note(figure, f"Prediction error of the {result.kind} model, which was told that the angle is a number")
    return figure

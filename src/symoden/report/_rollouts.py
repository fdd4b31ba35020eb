"""Rollouts beside the truth."""

from matplotlib.axes import Axes

from symoden.experiments import RolloutComparison

from ._style import COLOURS, DASHES, EDGE, INK, LABEL, SMALL, TRUTH, tidy


def plot_rollouts(result: RolloutComparison, *, ax: Axes) -> Axes:
    """Draw one coordinate of each trajectory over time: the truth as circles, the rollouts as lines.

    Args:
        result: What to draw.
        ax: Where.

    Returns:
        The same axes.
    """
    pairs = zip(result.labels, result.truth, result.predictions, strict=True)
    for k, (label, truth, prediction) in enumerate(pairs):
        colour, dashes = COLOURS[k % len(COLOURS)], DASHES[k % len(DASHES)]
        ax.plot(truth.ts, truth.q[:, result.index], markeredgecolor=colour, **TRUTH)
        ax.plot(truth.ts, prediction.q[:, result.index], color=colour, linestyle=dashes, linewidth=1.4, label=label)
    ax.plot([], [], markeredgecolor=INK, label="truth", **TRUTH)
    ax.axvline(result.trained, **EDGE)
    ax.annotate(
        "training data are\nthis long",
        (result.trained, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(4, -2),
        textcoords="offset points",
        va="top",
        fontsize=SMALL,
        color=INK,
    )
    ax.set_xlabel("time [s]", fontsize=LABEL)
    ax.set_ylabel(result.coordinate, fontsize=LABEL)
    ax.set_title("Rollouts from unseen initial states (lines)", fontsize=LABEL)
    ax.legend(fontsize=SMALL, frameon=False, ncols=2)
    return tidy(ax)

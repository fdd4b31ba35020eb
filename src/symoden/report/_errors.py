"""Errors beside the paper's."""

import math

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from symoden.experiments import ErrorComparison, PaperErrors, TaskScore

from ._style import COLOURS, INK, LABEL, SMALL, tidy

_NAMES = ("train", "test", "prediction")
_HEIGHT = 0.38


def plot_errors(result: ErrorComparison, *, ax: Axes) -> Axes:
    """Draw the three errors and the paper's as bars on a logarithmic axis, each with its number.

    Args:
        result: What to draw; an error of zero, or one that is not finite, has its number alone.
        ax: Where.

    Returns:
        The same axes.
    """
    sources: list[tuple[str, TaskScore | PaperErrors, str, str]] = [("symoden", result.ours, COLOURS[0], "")]
    if result.paper is not None:
        sources.append(("the paper", result.paper, "0.75", "///"))
    bars = [
        (i + (k - (len(sources) - 1) / 2) * _HEIGHT, getattr(source[1], name).mean, source)
        for k, source in enumerate(sources)
        for i, name in enumerate(_NAMES)
    ]
    shown = [mean for _, mean, _ in bars if _has_bar(mean)] or [1.0]
    for place, mean, (_, _, colour, hatch) in bars:
        if _has_bar(mean):
            ax.barh(place, mean, height=_HEIGHT, color=colour, hatch=hatch, edgecolor="white")
        number, at = (f" {mean:.3g}", mean) if _has_bar(mean) else (f" {mean:g}", min(shown))
        ax.text(at, place, number, va="center", fontsize=SMALL, color=INK)
    ax.set_xscale("log")
    ax.set_xlim(min(shown) / 30, max(shown) * 300)
    ax.set_yticks(range(len(_NAMES)), labels=_NAMES)
    ax.invert_yaxis()
    ax.set_xlabel("squared error of a rollout [SI], mean", fontsize=LABEL)
    ax.set_title(f"Errors on `{result.task}`", fontsize=LABEL)
    handles = [
        Patch(facecolor=colour, hatch=hatch, edgecolor="white", label=label) for label, _, colour, hatch in sources
    ]
    ax.legend(handles=handles, fontsize=SMALL, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2)
    return tidy(ax)


def _has_bar(error: float) -> bool:
    """Whether an error has a place on a logarithmic axis."""
    return math.isfinite(error) and error > 0

"""How training went."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ._style import COLOURS, INK, LABEL, SMALL, tidy

_SIZE: Final = (9.0, 3.2)  # inches
_NAME_AT: Final = 0.98


def draw_training(metrics: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw how training went.

    Args:
        metrics: Lines of a run's `metrics.jsonl`.

    Returns:
        A figure of its own size.
    """
    figure = Figure(figsize=_SIZE, layout="constrained")
    plot_training(metrics, ax=figure.add_subplot())
    return figure


def plot_training(metrics: Sequence[Mapping[str, Any]], *, ax: Axes) -> Axes:
    """Draw training and validation loss over time, and where each stage begins.

    Args:
        metrics: Lines of a run's `metrics.jsonl`.
        ax: Where.

    Returns:
        The same axes.
    """
    for key, name, colour, dashes in (
        ("loss", "training", COLOURS[0], "-"),
        ("validation", "validation", COLOURS[1], "--"),
    ):
        known = [(line["seconds"], line[key]) for line in metrics if line[key]]
        if known:
            ax.plot(*zip(*known, strict=True), color=colour, linestyle=dashes, linewidth=1.4, label=name)
    began = 0.0
    for stage, lines in groupby(metrics, key=lambda line: line["stage"]):
        ax.axvline(began, color="0.8", linewidth=0.8)
        ax.text(
            began,
            _NAME_AT,
            f" {stage}",
            transform=ax.get_xaxis_transform(),
            rotation=90,
            va="top",
            fontsize=SMALL,
            color=INK,
        )
        began = list(lines)[-1]["seconds"]
    ax.set_yscale("log")
    ax.set_xlabel("time [s]", fontsize=LABEL)
    ax.set_ylabel("loss, relative to the motion", fontsize=LABEL)
    ax.legend(fontsize=SMALL, frameon=False, loc="center right")
    return tidy(ax)

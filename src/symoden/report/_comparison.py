"""Errors of all models on all tasks, beside the paper's."""

import math
from collections.abc import Sequence
from typing import Any, Final, Literal, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from symoden.experiments import PAPER_ORDER, Row, SeedErrors, is_own, row_name

from ._style import COLOURS, INK, LABEL, SMALL, tidy

_PRESETS: Final = {"default": ("o", COLOURS[0], 0.14), "paper": ("s", COLOURS[1], -0.14)}
_PUBLISHED: Final[dict[str, Any]] = {
    "marker": "D",
    "markeredgecolor": "0.35",
    "markerfacecolor": "none",
    "markersize": 4.5,
}
_LINE: Final = 0.185


class _Place(NamedTuple):
    """Where a model of a task stands, and its rows, one for each preset."""

    height: float
    rows: tuple[Row, ...]


def plot_comparison(rows: Sequence[Row], error: Literal["train", "test", "prediction"], *, ax: Axes) -> Axes:
    """Draw one error of every model on every task as dots on a logarithmic axis, and the paper's beside them.

    Args:
        rows: Rows of the table; those with other training data than their task's own are left out.
        error: Which error.
        ax: Where.

    Returns:
        The same axes; a bar is the range over seeds, and what diverged is said so at the right edge.
    """
    places, titles = _places(rows)
    for place in places:
        for row in place.rows:
            errors: SeedErrors | None = getattr(row, error)
            if errors is not None:
                _plot_errors(errors, place.height - _PRESETS[row.preset][2] * (len(place.rows) > 1), row.preset, ax)
        published = next((found.paper for row in place.rows if (found := getattr(row, error)) and found.paper), None)
        if published is not None:
            ax.plot(published.mean, place.height, linestyle="none", **_PUBLISHED)
    for title, height in titles.items():
        ax.axhline(height - 0.55, color="0.75", linewidth=0.6)
        ax.annotate(title, (0, height), (4, 0), ("axes fraction", "data"), "offset points", va="center", fontsize=SMALL)
    ax.set_xscale("log")
    ax.set_yticks([place.height for place in places], labels=[place.rows[0].model for place in places])
    ax.set_ylim(max((place.height for place in places), default=0) + 0.7, -0.6)
    ax.set_xlabel(f"{error} error: squared error of a rollout [SI], mean", fontsize=LABEL)
    tidy(ax).grid(visible=False, axis="y")
    return ax


def draw_comparison(rows: Sequence[Row], *, figure: Figure) -> Figure:
    """Draw test and prediction errors side by side.

    Args:
        rows: Rows of the table.
        figure: Where; empty, best with `layout="constrained"`.

    Returns:
        The same figure.
    """
    left, right = figure.subplots(1, 2, sharey=True)
    plot_comparison(rows, "test", ax=left)
    plot_comparison(rows, "prediction", ax=right)
    right.tick_params(labelleft=False)
    presets = sorted({row.preset for row in rows if is_own(row)})
    handles = [Line2D([], [], linestyle="none", label=f"preset {name}", **_marker(name)) for name in presets]
    handles.append(Line2D([], [], linestyle="none", label="as published", **_PUBLISHED))
    figure.legend(handles=handles, fontsize=LABEL, frameon=False, loc="outside lower center", ncols=len(handles))
    return figure


def size_comparison(rows: Sequence[Row]) -> tuple[float, float]:
    """Width and height of the figure [inches].

    Args:
        rows: Rows of the table.

    Returns:
        A size at which labels are legible.
    """
    places, titles = _places(rows)
    return 9.0, 1.1 + _LINE * (len(places) + len(titles))


def _places(rows: Sequence[Row]) -> tuple[list[_Place], dict[str, float]]:
    """Heights of models and of the titles above them."""
    groups: dict[str, list[Row]] = {}
    for row in filter(is_own, rows):
        groups.setdefault(row_name(row), []).append(row)
    places, titles, height = [], {}, 0.0
    for title, members in groups.items():
        titles[title], height = height, height + 1.0
        for kind in PAPER_ORDER:
            if chosen := tuple(row for row in members if row.model == kind):
                places.append(_Place(height, chosen))
                height += 1.0
    return places, titles


def _plot_errors(errors: SeedErrors, at: float, preset: str, ax: Axes) -> None:
    """Draw the median and the range of one row."""
    _, colour, _ = _PRESETS[preset]
    if _shown(errors.least) and _shown(errors.greatest):
        ax.plot([errors.least, errors.greatest], [at, at], color=colour, linewidth=1.2)
    if _shown(errors.median):
        ax.plot(errors.median, at, linestyle="none", **_marker(preset))
    else:
        words = "0" if errors.median == 0 else "diverged"
        ax.annotate(words, (1, at), None, ("axes fraction", "data"), ha="right", va="center", fontsize=7, color=colour)


def _marker(preset: str) -> dict[str, Any]:
    """Marker of a preset."""
    marker, colour, _ = _PRESETS[preset]
    return {"marker": marker, "color": colour, "markersize": 4.5, "markeredgecolor": INK, "markeredgewidth": 0.4}


def _shown(error: float) -> bool:
    """Whether an error has a place on a logarithmic axis."""
    return math.isfinite(error) and error > 0

"""Recordings beside what a model predicts of them."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from symoden.evaluation import RecordedPaths

from ._style import COLOURS, INK, LABEL, SMALL, clock, since, tidy, wrapped

_PANEL: Final = (4.6, 1.7)  # inches
_BAND: Final = 0.25
_GREY: Final = "0.5"
_SHADE: Final = 0.3
_ROOM: Final = 0.15  # Above and below what was measured, relative to its range.


def draw_recorded(
    recordings: Sequence[RecordedPaths], titles: Sequence[str], disturbed: Sequence[Sequence[tuple[float, float]]] = ()
) -> Figure:
    """Draw each coordinate of each recording over time, with rollouts.

    Args:
        recordings: What to draw, a row for each; at least one.
        titles: What to call the coordinates, a column for each.
        disturbed: Of each recording the spans [s] in which it is disturbed; without any, none is marked.

    Returns:
        A figure of its own size.
    """
    width, height = (size * count + 0.8 for size, count in zip(_PANEL, (len(titles), len(recordings)), strict=True))
    figure = Figure(figsize=(width, height), layout="constrained")
    panels = figure.subplots(len(recordings), len(titles), squeeze=False)
    marked = disturbed or [()] * len(recordings)
    for row, recording, spans in zip(panels, recordings, marked, strict=True):
        for index, ax in enumerate(row):
            plot_recorded(recording, index, ax=ax)
            for start, end in np.subtract(spans, since(recording.ts)):
                ax.axvspan(start, end, color=_GREY, alpha=_SHADE, linewidth=0)
        row[0].set_ylabel(wrapped(recording.name), fontsize=SMALL)
    for ax, title in zip(panels[0], titles, strict=True):
        ax.set_title(title, fontsize=LABEL)
    for ax in panels[-1]:
        ax.set_xlabel(clock(recording.ts for recording in recordings), fontsize=LABEL)
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=INK, linewidth=1.6, label="measured"),
        Line2D([], [], color=COLOURS[1], linestyle="--", linewidth=1.2, label="one rollout from the first sample"),
    ]
    if any(recording.windows for recording in recordings):
        label = "rollouts of up to 1 s from measured states, with 90 % bands"
        handles.append(Patch(facecolor=COLOURS[0], alpha=2 * _BAND, label=label))
    if any(map(len, disturbed)):
        handles.append(Patch(facecolor=_GREY, alpha=_SHADE, label="disturbed"))
    figure.legend(handles=handles, fontsize=LABEL, frameon=False, loc="outside lower center")
    return figure


def plot_recorded(recording: RecordedPaths, index: int, *, ax: Axes) -> Axes:
    """Draw one coordinate of a recording and its rollouts.

    Args:
        recording: What to draw.
        index: Which coordinate.
        ax: Where.

    Returns:
        The same axes.
    """
    measured, first = recording.measured[:, index], since(recording.ts)
    ax.plot(recording.ts - first, measured, color=INK, linewidth=1.6)
    for path in recording.windows:
        q, half = path.q[:, index], path.half_width[:, index]
        ax.fill_between(path.ts - first, q - half, q + half, color=COLOURS[0], alpha=_BAND, linewidth=0)
        ax.plot(path.ts - first, q, color=COLOURS[0], linewidth=0.9)
    ax.plot(recording.ts - first, recording.whole[:, index], color=COLOURS[1], linestyle="--", linewidth=1.2)
    whole, way = recording.whole[:, index], float(np.ptp(measured)) or 1.0
    low, high = float(measured.min()), float(measured.max())
    with np.errstate(invalid="ignore", over="ignore"):
        off = float(np.sqrt(np.mean((whole - measured)[recording.scored_from :] ** 2)))
        # What a rollout does is shown as far as the motion itself goes.
        least, most = (float(np.clip(edge, low - way, high + way)) for edge in (np.nanmin(whole), np.nanmax(whole)))
    ax.set_ylim(min(low, least) - _ROOM * way, max(high, most) + _ROOM * way)
    # Beside a long way an error that matters is thinner than a line.
    words = {"ha": "right", "fontsize": SMALL, "color": COLOURS[1]}
    ax.text(1.0, 1.02, f"rollout off by {off:.2g}", transform=ax.transAxes, **words)
    return tidy(ax)

"""Energy along rollouts without input, and whether angles stay on their circles."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from symoden.experiments import CircleDrift, EnergyCurves

from ._looks import LOOKS, legend_below, note
from ._style import EDGE, INK, LABEL, SMALL, TRUTH, tidy

_MARKS = 20
_ROOM = 0.6
# What is drawn where a deviation is exactly zero: less than the spacing of float64 at 1, which is 2e-16.
_FLOOR: Final = 1e-17
_LEAST_TOP: Final = 1e-9


def plot_energy(result: EnergyCurves, *, ax: Axes) -> Axes:
    """Draw the true energy over time: along the true trajectory as circles, along each model's rollout as a line.

    Args:
        result: What to draw.
        ax: Where. It has room for a little more than the true energies; a rollout that gains more leaves it.

    Returns:
        The same axes.
    """
    every = max(1, len(result.ts) // _MARKS)
    for kind, energy in result.learned.items():
        ax.plot(result.ts, energy, label=kind, **LOOKS[kind].line)
    ax.plot(result.ts[::every], result.truth[::every], markeredgecolor=INK, zorder=3, **TRUTH)
    low, high = result.truth.min(), result.truth.max()
    room = _ROOM * (high - low) or 1.0
    ax.set_ylim(low - room, high + room)
    ax.axvline(result.trained, **EDGE)
    ax.set_xlabel("time [s]", fontsize=LABEL)
    ax.set_ylabel("true energy H [J]", fontsize=LABEL)
    ax.set_title(result.label, fontsize=LABEL)
    return tidy(ax)


def draw_energies(results: Sequence[EnergyCurves], *, figure: Figure) -> Figure:
    """Draw one panel for each trajectory.

    Args:
        results: What to draw, at least one.
        figure: Where; empty, best with `layout="constrained"`.

    Returns:
        The same figure.
    """
    for k, result in enumerate(results):
        ax = plot_energy(result, ax=figure.add_subplot(1, len(results), k + 1))
        if k:
            ax.set_ylabel("")
    legend_below(figure, list(results[0].learned), truth=True)
    note(
        figure,
        "No input: friction takes energy, and nothing gives any. Training trajectories end at the dotted line.",
    )
    return figure


def plot_circle(result: CircleDrift, *, ax: Axes) -> Axes:
    """Draw how far embedded angles leave their circles over time, on a logarithmic axis.

    Args:
        result: What to draw.
        ax: Where.

    Returns:
        The same axes; a line ends where a rollout diverges.
    """
    for kind, worst in result.worst.items():
        look = LOOKS[kind]
        shown = np.where(np.isfinite(worst), np.maximum(worst, _FLOOR), np.nan)
        ax.plot(result.ts, shown, label=kind, marker=look.marker, markersize=3.5, markevery=(2, 5), **look.line)
    ax.axvline(result.trained, **EDGE)
    ax.set_yscale("log")
    ax.set_ylim(_FLOOR / 3, max(_LEAST_TOP, 10 * ax.dataLim.y1))
    ax.set_xlabel("time [s]", fontsize=LABEL)
    ax.set_ylabel("largest |cos² + sin² − 1| [1]", fontsize=LABEL)
    ax.set_title(
        f"Worst of {result.trajectories} rollouts without input (training: up to the dotted line)", fontsize=LABEL
    )
    ax.legend(fontsize=SMALL, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=2.8)
    return tidy(ax)

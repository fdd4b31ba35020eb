"""Episodes under control: configuration, inputs and desired energy over time."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from symoden.control import Tracking
from symoden.experiments import ControlResult

from ._style import COLOURS, EDGE, INK, LABEL, tidy, wrapped

_LINES: Final = 30  # episodes that are drawn
_POINTS: Final = 1500
_SIZE: Final = (9.0, 6.5)
_PANEL: Final = 1.6  # Least height of one.
_FLOOR: Final = 1e-8
_REST: Final = 4  # Times the longest settling that are drawn, and
_FEWEST: Final = 20  # so many control periods at least: beside a long rest a short motion is a line upwards.


def draw_control(result: ControlResult, *, positions: Sequence[str], inputs: Sequence[str]) -> Figure:
    """Draw coordinates, inputs and desired energy of up to 30 episodes, the median one dark.

    Args:
        result: How the episodes went.
        positions: What to call the coordinates.
        inputs: What to call the inputs.

    Returns:
        The figure.
    """
    space = result.machine.system.space
    count = len(positions) + len(inputs) + 1
    figure = Figure(figsize=(_SIZE[0], max(_SIZE[1], count * _PANEL)), layout="constrained")
    axes = figure.subplots(count, 1, sharex=True)
    ts = np.asarray(result.episodes.ts[0])
    for i, (ax, title) in enumerate(zip(axes, positions, strict=False)):
        q = np.asarray(result.episodes.q)[:, :, i]
        plot_episodes(ts, _towards(q, result.machine.target[i]) if space.is_angle[i] else q, result, ax=ax)
        if not isinstance(result.controller, Tracking):
            ax.axhline(result.machine.target[i], **EDGE)
        ax.set_ylabel(wrapped(title), fontsize=LABEL)
    for ax, (j, name) in zip(axes[len(positions) :], enumerate(inputs), strict=False):
        plot_episodes(ts, np.asarray(result.episodes.u)[:, :, j], result, ax=ax, held=True)
        for sign in (-1, 1):
            ax.axhline(sign * result.limits[j], **EDGE)
        ax.set_ylabel(wrapped(name), fontsize=LABEL)
    plot_episodes(ts, np.maximum(result.energy, _FLOOR), result, ax=axes[-1])
    axes[-1].set_yscale("log")
    axes[-1].set_ylabel("desired energy", fontsize=LABEL)
    axes[-1].set_xlabel("time [s]", fontsize=LABEL)
    if result.verdict.success.all() and not isinstance(result.controller, Tracking):
        moving = max(_REST * float(result.verdict.settling.max()), _FEWEST * float(ts[1]))
        axes[-1].set_xlim(0.0, min(float(ts[-1]), moving))
    good = int(result.verdict.success.sum())
    figure.suptitle(
        f"{result.method} on {result.tried_on}: {good} of {len(result.verdict.success)} reach the target\n"
        f"under continuous control the desired energy falls at {result.audit.share:.1%} of visited states",
        fontsize=LABEL,
        color=INK,
    )
    return figure


def plot_episodes(
    ts: Float[np.ndarray, " T"],
    values: Float[np.ndarray, "k T"],
    result: ControlResult,
    *,
    ax: Axes,
    held: bool = False,
) -> Axes:
    """Draw one quantity of the episodes over time.

    Args:
        ts: Times [s].
        values: The quantity in each episode.
        result: How the episodes went.
        ax: Where.
        held: Whether each value is held until the next one, as inputs are within a control period.

    Returns:
        The same axes.
    """
    every, style = max(1, len(ts) // _POINTS), "steps-post" if held else "default"
    for k in range(min(_LINES, len(values))):
        colour = COLOURS[0] if result.verdict.success[k] else COLOURS[1]
        ax.plot(ts[::every], values[k, ::every], color=colour, drawstyle=style, linewidth=0.6, alpha=0.35)
    ax.plot(ts[::every], values[result.shown, ::every], color=INK, drawstyle=style, linewidth=1.2)
    return tidy(ax)


def _towards(q: Float[np.ndarray, "k T"], target: float) -> Float[np.ndarray, "k T"]:
    """Angles with whole turns taken off, such that the end is next to the target."""
    turns = np.round((q[:, -1:] - target) / (2 * np.pi))
    return q - 2 * np.pi * np.where(np.isfinite(turns), turns, 0.0)

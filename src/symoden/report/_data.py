"""Recordings as they were logged, with what is wrong marked."""

from typing import Final

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from symoden.data import DatasetCheck, RecordingCheck

from ._style import COLOURS, INK, LABEL, SMALL, clock, since, tidy, wrapped

_PANEL: Final = (2.6, 1.25)  # inches
_ROOM: Final = (0.8, 0.7)
_TINY: Final = 6.5
_MARKS: Final = {
    "refused": (COLOURS[1], 0.35),
    "warning": (COLOURS[1], 0.22),
    "masked": ("0.5", 0.3),
    "note": ("0.5", 0),
}
_LINES: Final = {"positions": COLOURS[0], "rates": COLOURS[2], "inputs": INK}
_WIDEST: Final = 0.004  # of a panel: what is shorter is marked so wide, so that it can be seen


def draw_check(check: DatasetCheck) -> Figure:
    """Draw every column of every recording over time: a row for each recording, a column for each signal.

    What is wrong is shaded where it is known when, and named in the panel of its column; grey is what was left out.

    Args:
        check: What to draw.

    Returns:
        A figure of its own size.

    Raises:
        ValueError: If there is no recording, as where no file can be read.
    """
    if not check.recordings:
        raise ValueError("There must be a recording to draw; no file can be read. `check.unreadable` says why.")
    signals = [(role, i) for role, signal in check.recordings[0].log.signals.items() for i in range(signal.shape[1])]
    size = [
        room + panel * count
        for room, panel, count in zip(_ROOM, _PANEL, (len(signals), len(check.recordings)), strict=True)
    ]
    figure = Figure(figsize=(size[0], size[1]), layout="constrained")
    panels = figure.subplots(len(check.recordings), len(signals), squeeze=False, sharey="col")
    for row, each in zip(panels, check.recordings, strict=True):
        for k, (ax, (role, i)) in enumerate(zip(row, signals, strict=True)):
            plot_channel(each, role, i, held=check.description.hold == "zero", ax=ax)
            if k == 0:
                ax.set_ylabel(f"{wrapped(each.log.name)}\n({each.log.part})", fontsize=_TINY)
    for ax, (role, i) in zip(panels[0], signals, strict=True):
        ax.set_title(check.recordings[0].log.title(role, i), fontsize=LABEL)
    for ax in panels[-1]:
        ax.set_xlabel(clock(each.log.ts for each in check.recordings), fontsize=SMALL)
    return figure


def plot_channel(each: RecordingCheck, role: str, index: int, *, held: bool, ax: Axes) -> Axes:
    """Draw one column of one recording in SI and rad, angles without their wraps, with the findings on it.

    Args:
        each: The recording.
        role: "positions", "rates" or "inputs".
        index: Which of them.
        held: Whether inputs are held until the next row.
        ax: Where.

    Returns:
        The same axes.
    """
    log = each.log
    name = log.names[role][index]
    first = since(log.ts)
    style = "steps-post" if held and role == "inputs" else "default"
    look = {"color": _LINES[role], "drawstyle": style, "linewidth": 0.7, "rasterized": True}
    ax.plot(log.ts - first, _without_wraps(each, role, index), **look)
    known = log.ts[np.isfinite(log.ts)]
    least = _WIDEST * float(np.ptp(known)) if len(known) else 0.0
    kinds: list[str] = []
    for finding in each.findings:
        if finding.channel not in ("", name, *log.names.get("time", ())):
            continue
        colour, opacity = _MARKS[finding.level]
        for start, end in finding.spans if opacity else ():
            middle, half = (start + end) / 2 - first, max(abs(end - start), least) / 2
            ax.axvspan(middle - half, middle + half, color=colour, alpha=opacity, linewidth=0)
        if finding.channel == name or finding.level == "refused":
            kinds.append(finding.kind)
    ax.text(0.02, 0.97, ", ".join(dict.fromkeys(kinds)), transform=ax.transAxes, va="top", fontsize=_TINY, color=INK)
    tidy(ax).tick_params(labelsize=_TINY)
    return ax


def _without_wraps(each: RecordingCheck, role: str, index: int) -> Float[np.ndarray, " T"]:
    """A column; of an angle that was logged wrapped what it is taken for."""
    values, name = each.log.signals[role][:, index].copy(), each.log.names[role][index]
    wraps = any((found.kind, found.level, found.channel) == ("wrap", "note", name) for found in each.findings)
    if wraps and role == "positions":
        known = np.isfinite(values)
        values[known] = np.unwrap(values[known])
    return values

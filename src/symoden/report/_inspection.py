"""What a model learned, with its bands."""

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from symoden.evaluation import Certainty, Inspection
from symoden.units import titled, unit_of

from ._style import COLOURS, DASHES, LABEL, SMALL, tidy

_PANEL: Final = (3.2, 2.4)  # inches
_BAND: Final = 0.22
_SHOWN: Final = 0.9  # Share of a curve whose band sets the panel's height: a peak in one spot would hide the rest.
_ROOM: Final = 0.1  # Above what is drawn from zero on, or a constant lies on the frame.
_WIDE: Final = 2.5  # inches of a panel for the names of curves,
_HIGH: Final = 1.7  # and its height;
_SAMPLE: Final = 0.32  # what the line before a name takes with the space about it,
_LETTER: Final = 0.6  # and each of its letters, of the font's size.
_TINY: Final = 6.5
_MOST_NAMED: Final = 0.6  # Share of the panel's height that names may take.

_Curves = Mapping[str, np.ndarray]


def draw_inspection(
    found: Inspection, certain: Certainty | None, *, positions: Sequence[str], inputs: Sequence[str]
) -> Figure:
    """Draw M, V, g and D along every coordinate, and friction along every velocity.

    Args:
        found: What was learned, at as many points as lines need.
        certain: Half widths of its bands, if they are known.
        positions: Names of the coordinates, a row for each.
        inputs: Names of the inputs.

    Returns:
        A figure of its own size.

    Raises:
        ValueError: If the model has none of these.
    """
    rows = [_panels(found, certain, k, positions, inputs) for k in range(len(positions))]
    columns = max(map(len, rows))
    if not columns:
        raise ValueError("A picture of what was learned needs a model with M, V, g or D; this kind has none.")
    size = _PANEL[0] * columns, _PANEL[1] * len(rows) + 0.4
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(rows), columns, squeeze=False)
    for axes, row in zip(panels, rows, strict=True):
        for ax in axes[len(row) :]:
            ax.set_axis_off()
        for ax, draw in zip(axes, row, strict=False):
            draw(ax=ax)
    words = ["Lines: learned."]
    words += [f"Shaded: {certain.level:.0%} bands."] if certain is not None else []
    words += ["Units: where the data are SI and inputs N or N m."] if found.units else []
    figure.supxlabel(" ".join(words), fontsize=LABEL)
    return figure


def plot_curves(
    xs: np.ndarray, curves: _Curves, widths: _Curves | None, *, coordinate: str, symbol: str, ax: Axes
) -> Axes:
    """Draw curves over one coordinate or velocity with their bands.

    Args:
        xs: Values along the axis.
        curves: Curves by name.
        widths: Half widths of their bands.
        coordinate: What the axis is.
        symbol: What the curves are.
        ax: Where.

    Returns:
        The same axes.
    """
    edges = []
    for k, (name, values) in enumerate(curves.items()):
        colour, dashes = COLOURS[k % len(COLOURS)], DASHES[k % len(DASHES)]
        ax.plot(xs, values, color=colour, linestyle=dashes, linewidth=1.4, label=name)
        if widths is not None:
            ax.fill_between(xs, values - widths[name], values + widths[name], color=colour, alpha=_BAND, linewidth=0)
            shown = np.minimum(widths[name], np.quantile(widths[name], _SHOWN, method="lower"))
            edges += [values - shown, values + shown]
    if edges and 0 < (room := _ROOM * float(np.ptp(edges)) / 2) < np.inf:
        ax.set_ylim(np.min(edges) - room, np.max(edges) + room)
    low, high = ax.get_ylim()
    if 0 < low < high:  # How much something changes is seen beside how large it is.
        ax.set_ylim(0.0, (1 + _ROOM) * high)
    ax.set_xlabel(coordinate, fontsize=LABEL)
    ax.set_title(symbol, fontsize=LABEL)
    if len(curves) > 1:
        _name(list(curves), ax)
    return tidy(ax)


def _name(names: Sequence[str], ax: Axes) -> None:
    """Name the curves above them, within the panel however long their names are."""

    def fits(size: float, columns: int) -> int:
        """Letters of a name for which there is room."""
        return int((_WIDE / columns - _SAMPLE) * 72 / (_LETTER * size))

    longest = max(map(len, names))
    choices = [(float(SMALL), 3), (float(SMALL), 2), (_TINY, 2), (_TINY, 1)]
    size, columns = next((each for each in choices if longest <= fits(*each)), choices[-1])
    rows, most = math.ceil(len(names) / columns), fits(size, columns)
    # Lines of text, less than a third of one between two, and one about all of them.
    share = min(_MOST_NAMED, size * (1.2 * rows + 0.3 * (rows - 1) + 1) / 72 / _HIGH)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + share / (1 - share) * (high - low))
    ax.legend(
        ax.get_lines(),
        [name if len(name) <= most else f"{name[: most // 2 - 1]}…{name[-(most // 2) :]}" for name in names],
        fontsize=size,
        frameon=False,
        loc="upper center",
        ncols=columns,
        handlelength=1.6,
        columnspacing=1.0,
        labelspacing=0.3,
    )


def _panels(
    found: Inspection, certain: Certainty | None, k: int, positions: Sequence[str], inputs: Sequence[str]
) -> list[functools.partial[Axes]]:
    """What to draw in the row of one coordinate."""
    profile, widths = found.profiles[k], certain and certain.profiles[k]
    unit = found.position_units[k]
    curves = profile.energy_curves() | profile.port_curves(positions, inputs, found.given)
    half = widths and widths.energy_curves() | profile.port_curves(positions, inputs, found.given, widths=widths)
    groups = {"M": "M", "V": "V - min V", "g": "g", "D": "D at half of the largest velocities"}
    groups |= {letter: f"{groups[letter]} [{kinds}]" for letter, kinds in found.units.items()}
    title, panels = titled(positions[k], unit), []
    for letter, symbol in groups.items():
        chosen = {name: values for name, values in curves.items() if name.startswith(letter)}
        if chosen:
            draw = functools.partial(plot_curves, profile.values, chosen, half, coordinate=title, symbol=symbol)
            panels.append(draw)
    if found.friction:
        along, band = found.friction[k], certain and certain.friction[k]
        force, bands = {"D v": along.force}, band and {"D v": band.force}
        coordinate = titled(f"velocity of {positions[k]}", unit, "velocity")
        symbol = f"friction [{unit_of('force', unit)}]" if found.units else "friction"
        draw = functools.partial(plot_curves, along.velocities, force, bands, coordinate=coordinate, symbol=symbol)
        panels.append(draw)
    return panels

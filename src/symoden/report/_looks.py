"""How each kind of model looks in every figure: its own colour, dashes and marker, so that no figure needs colour."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D

from ._style import COLOURS, DASHES, INK, LABEL, TRUTH

WIDTH: Final = 1.4


class Look(NamedTuple):
    """Look of one kind of model.

    Attributes:
        colour: Colour.
        dashes: Dashes of lines.
        marker: Marker of points.
    """

    colour: str
    dashes: Any
    marker: str

    @property
    def line(self) -> dict[str, Any]:
        """Arguments of a line without markers."""
        return {"color": self.colour, "linestyle": self.dashes, "linewidth": WIDTH}


_MARKERS = ("o", "s", "^", "D", "v")
_KINDS = ("dissipative", "symoden", "unstructured", "geometric", "naive")

LOOKS: Final[Mapping[str, Look]] = MappingProxyType(
    {kind: Look(*look) for kind, look in zip(_KINDS, zip(COLOURS, DASHES, _MARKERS, strict=True), strict=True)}
)


def legend_below(figure: Figure, kinds: Sequence[str], *, truth: bool) -> Legend:
    """Name the lines of all panels once, below them.

    Args:
        figure: Figure with a constrained layout.
        kinds: Kinds of models that are drawn.
        truth: Whether the truth is drawn, as circles.

    Returns:
        The legend.
    """
    handles = [Line2D([], [], label=kind, **LOOKS[kind].line) for kind in kinds]
    if truth:
        handles.insert(0, Line2D([], [], label="truth", markeredgecolor=INK, **TRUTH))
    return figure.legend(
        handles=handles, fontsize=LABEL, frameon=False, loc="outside lower center", ncols=len(handles), handlelength=2.6
    )


def note(figure: Figure, text: str) -> None:
    """Say above all panels what they show.

    Args:
        figure: The figure.
        text: What they show.
    """
    figure.suptitle(text, fontsize=LABEL, color=INK)

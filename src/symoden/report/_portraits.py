"""Blocks beside the truth along several coordinates."""

from collections.abc import Sequence
from typing import Final

from matplotlib.figure import Figure

from symoden.experiments import Portrait

from ._blocks import plot_block
from ._style import INK, LABEL
from ._summary import caption

_MARKS: Final = 13
# Of a coordinate that goes beyond one turn, so that the circles follow a periodic truth.
_MORE_MARKS: Final = 33


def draw_portraits(results: Sequence[Portrait], *, figure: Figure) -> Figure:
    """Draw a row of blocks for each coordinate.

    Args:
        results: What to draw, at least one; all in the same gauge.
        figure: Where; empty, best with `layout="constrained"`.

    Returns:
        The same figure.
    """
    columns = len(results[0].blocks)
    for row, result in enumerate(results):
        for column, block in enumerate(result.blocks):
            beyond = block.values[0] < block.visited[0]
            ax = figure.add_subplot(len(results), columns, row * columns + column + 1)
            plot_block(block, ax=ax, marks=_MORE_MARKS if beyond else _MARKS)
    figure.supxlabel(caption(results[0]), fontsize=LABEL, color=INK)
    return figure

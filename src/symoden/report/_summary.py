"""One page: rollouts, errors and blocks."""

from dataclasses import dataclass

from matplotlib.figure import Figure

from symoden.experiments import ErrorComparison, Portrait, RolloutComparison

from ._blocks import plot_block
from ._errors import plot_errors
from ._rollouts import plot_rollouts
from ._style import INK, LABEL


@dataclass(frozen=True, kw_only=True, eq=False)
class Summary:
    """What the page shows.

    Attributes:
        rollouts: Rollouts beside the truth.
        errors: Errors beside the paper's.
        portrait: Blocks beside the truth.
    """

    rollouts: RolloutComparison
    errors: ErrorComparison
    portrait: Portrait


def draw_summary(result: Summary, *, figure: Figure) -> Figure:
    """Draw rollouts and errors above M⁻¹, V, g and D.

    Args:
        result: What to draw.
        figure: Where; empty, about 10 × 6 inches, best with `layout="constrained"`.

    Returns:
        The same figure.

    Example:
        >>> from matplotlib.figure import Figure
        >>> Figure(figsize=(10, 6), layout="constrained").get_layout_engine() is not None
        True
    """
    panels = len(result.portrait.blocks)
    grid = figure.add_gridspec(2, 2 * panels, height_ratios=(1.25, 1))
    split = round(1.25 * panels)
    plot_rollouts(result.rollouts, ax=figure.add_subplot(grid[0, :split]))
    plot_errors(result.errors, ax=figure.add_subplot(grid[0, split:]))
    for k, block in enumerate(result.portrait.blocks):
        plot_block(block, ax=figure.add_subplot(grid[1, 2 * k : 2 * k + 2]))
    figure.supxlabel(caption(result.portrait), fontsize=LABEL, color=INK)
    return figure


def caption(portrait: Portrait) -> str:
    """Say what circles and lines are, and what the scale of the blocks rests on.

    Args:
        portrait: The blocks.

    Returns:
        A caption.
    """
    if portrait.anchored:
        return "Circles: truth. Lines: learned. The data fix the scale."
    return (
        "Circles: truth. Lines: learned, up to one common factor that the data cannot tell: "
        f"β = {portrait.gauge:.4g}, found by least squares and taken out."
    )

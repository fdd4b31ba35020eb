"""Vector fields over the phase plane."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from symoden.experiments import PhasePlane

from ._looks import LOOKS, WIDTH, note
from ._style import INK, LABEL, TRUTH, tidy

_STREAM = "0.72"
_COLUMNS = 3
_EVERY = 2
TRUE = "truth"


def plot_phase(result: PhasePlane, kind: str, *, ax: Axes) -> Axes:
    """Draw the vector field of a model or of the truth as streamlines, and trajectories in it.

    Args:
        result: What to draw.
        kind: Which model; "truth" for the true system.
        ax: Where.

    Returns:
        The same axes; true trajectories are circles, rollouts lines.
    """
    field = result.truth if kind == TRUE else result.learned[kind]
    ax.streamplot(
        result.q,
        result.rates,
        field.q_dot,
        field.rate_dot,
        color=_STREAM,
        linewidth=0.6,
        arrowsize=0.6,
        density=1.1,
    )
    for trajectory in result.trajectories:
        ax.plot(trajectory.q[::_EVERY, 0], trajectory.rates[::_EVERY, 0], markeredgecolor=INK, **TRUTH)
    for path in result.predictions.get(kind, ()):
        ax.plot(path.q[:, 0], path.rates[:, 0], color=LOOKS[kind].colour, linewidth=WIDTH)
    ax.set_xlim(result.q[0], result.q[-1])
    ax.set_ylim(result.rates[0], result.rates[-1])
    ax.set_xlabel(result.coordinate, fontsize=LABEL)
    ax.set_ylabel(result.rate, fontsize=LABEL)
    ax.set_title(kind if kind == TRUE else f"{kind}: field error {field.error:.2g}", fontsize=LABEL)
    tidy(ax).grid(visible=False)
    return ax


def draw_phase(result: PhasePlane, *, figure: Figure) -> Figure:
    """Draw a panel for the truth and one for each model.

    Args:
        result: What to draw.
        figure: Where; empty, best with `layout="constrained"`.

    Returns:
        The same figure.
    """
    kinds = (TRUE, *result.learned)
    columns = min(_COLUMNS, len(kinds))
    rows = -(-len(kinds) // columns)
    for k, kind in enumerate(kinds):
        ax = plot_phase(result, kind, ax=figure.add_subplot(rows, columns, k + 1))
        if k % columns:
            ax.set_ylabel("")
    note(
        figure,
        "No input. Grey: the vector field. Circles: true trajectories. Lines: rollouts from the same unseen states.",
    )
    return figure


def size_phase(kinds: Sequence[str]) -> tuple[float, float]:
    """Width and height of the figure [inches].

    Args:
        kinds: The models.

    Returns:
        A size at which labels are legible.
    """
    rows = -(-(len(kinds) + 1) // _COLUMNS)
    return 9.0, 0.4 + 2.6 * rows

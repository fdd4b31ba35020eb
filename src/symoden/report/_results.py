"""Every figure that finished cells allow."""

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final, TypeAlias

from matplotlib.figure import Figure

from symoden.evaluation import Prediction
from symoden.experiments import (
    CellResult,
    Contest,
    circle_drift,
    energy_curves,
    extrapolation,
    free_rollouts,
    is_own,
    phase_plane,
    portrait,
    read_contests,
    sweeps,
    table_rows,
)

from ._comparison import draw_comparison, size_comparison
from ._extrapolation import draw_extrapolation
from ._free import draw_energies, plot_circle
from ._phase import draw_phase, size_phase
from ._portraits import draw_portraits
from ._sweeps import draw_sweeps

_Rollouts: TypeAlias = Mapping[str, Sequence[Prediction]]

_BLOCKS_OF: Final = "dissipative"
_BEYOND: Final = 0.15
_ONLY_PRESET: Final = "default"


def draw_results(folder: Path, results: Sequence[CellResult]) -> dict[str, Figure]:
    """Draw every figure that finished cells allow, from their saved models alone.

    Of several seeds, figures show the one that has most models; the comparison of errors and the sweeps show all.

    Args:
        folder: The folder that the cells were run in; it has their models in `cells/`.
        results: Results of the cells; those that failed are left out.

    Returns:
        Figures by name: `errors`, and for each task `blocks-<task>`, `phase-<task>`, `energy-<task>`, `circle-<task>`,
        `extrapolation-<task>` and `sweep-<task>` where there is something to show. After the task come its space, if
        it is not the task's own, and the preset, if it is not the default.

    Raises:
        StorageError: If the model of a finished cell is missing or damaged.
    """
    rows = table_rows([result for result in results if result.error is None])
    figures = {}
    if own := [row for row in rows if is_own(row)]:
        figures["errors"] = draw_comparison(own, figure=_figure(*size_comparison(own)))
    for contest in read_contests(folder, results):
        suffix, rollouts = _suffix(contest.name, contest.preset), free_rollouts(contest)
        for kind, draw in _FIGURES.items():
            if (figure := draw(contest, rollouts)) is not None:
                figures[f"{kind}-{suffix}"] = figure
    for (name, preset), group in groupby(sweeps(rows), key=lambda sweep: (sweep.name, sweep.preset)):
        found = list(group)
        figures[f"sweep-{_suffix(name, preset)}"] = draw_sweeps(found, figure=_figure(1.8 + 3.6 * len(found), 3.4))
    return figures


def _figure(width: float, height: float) -> Figure:
    """An empty figure of some inches."""
    return Figure(figsize=(width, height), layout="constrained")


def _suffix(name: str, preset: str) -> str:
    """What names of figures end in."""
    return name if preset == _ONLY_PRESET else f"{name}-{preset}"


def _blocks(contest: Contest, rollouts: _Rollouts) -> Figure | None:
    """Blocks beside the truth, over every angle of the mechanism."""
    del rollouts
    if _BLOCKS_OF not in contest.trained:
        return None
    model, space = contest.trained[_BLOCKS_OF].model, contest.task.system.space
    portraits = [portrait(model, contest.source, coordinate=int(i), beyond=_BEYOND) for i in space.angles]
    return draw_portraits(portraits, figure=_figure(10.0, 0.5 + 2.3 * len(portraits)))


def _phase(contest: Contest, rollouts: _Rollouts) -> Figure | None:
    """Vector fields of a mechanism with one coordinate."""
    del rollouts  # Those of the figure start where no model was trained.
    plane = phase_plane(contest)
    return None if plane is None else draw_phase(plane, figure=_figure(*size_phase(list(plane.learned))))


def _energy(contest: Contest, rollouts: _Rollouts) -> Figure:
    """Energy along rollouts."""
    return draw_energies(energy_curves(contest, rollouts), figure=_figure(9.0, 3.0))


def _circle(contest: Contest, rollouts: _Rollouts) -> Figure | None:
    """Whether angles stay on their circles."""
    drift = circle_drift(contest, rollouts)
    if drift is None:
        return None
    figure = _figure(6.5, 3.0)
    plot_circle(drift, ax=figure.add_subplot())
    return figure


def _extrapolation(contest: Contest, rollouts: _Rollouts) -> Figure | None:
    """Where the prediction error comes from."""
    found = extrapolation(contest, rollouts)
    return None if found is None else draw_extrapolation(found, figure=_figure(9.0, 4.0))


_FIGURES: Final[dict[str, Callable[[Contest, _Rollouts], Figure | None]]] = {
    "blocks": _blocks,
    "phase": _phase,
    "energy": _energy,
    "circle": _circle,
    "extrapolation": _extrapolation,
}

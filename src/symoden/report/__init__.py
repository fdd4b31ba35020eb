"""Results as tables and pictures: the only part that draws. Pictures need matplotlib: `pip install "symoden[plot]"`."""

import importlib.util
from typing import TYPE_CHECKING, NoReturn

from ._film import film as film
from ._html import PageSection as PageSection, PageTable as PageTable, write_html as write_html
from ._page import write_page as write_page
from ._table import (
    flat_row as flat_row,
    table_csv as table_csv,
    table_latex as table_latex,
    table_markdown as table_markdown,
    table_title as table_title,
    write_tables as write_tables,
)

if TYPE_CHECKING or importlib.util.find_spec("matplotlib") is not None:
    from ._blocks import plot_block as plot_block
    from ._comparison import draw_comparison as draw_comparison, plot_comparison as plot_comparison
    from ._control import draw_control as draw_control
    from ._data import draw_check as draw_check
    from ._errors import plot_errors as plot_errors
    from ._extrapolation import (
        draw_extrapolation as draw_extrapolation,
        plot_extrapolation as plot_extrapolation,
        plot_positions as plot_positions,
    )
    from ._free import draw_energies as draw_energies, plot_circle as plot_circle, plot_energy as plot_energy
    from ._inspection import draw_inspection as draw_inspection, plot_curves as plot_curves
    from ._phase import draw_phase as draw_phase, plot_phase as plot_phase
    from ._portraits import draw_portraits as draw_portraits
    from ._recorded import draw_recorded as draw_recorded, plot_recorded as plot_recorded
    from ._results import draw_results as draw_results
    from ._rollouts import plot_rollouts as plot_rollouts
    from ._summary import Summary as Summary, draw_summary as draw_summary
    from ._sweeps import draw_sweeps as draw_sweeps, plot_sweep as plot_sweep
    from ._training import draw_training as draw_training, plot_training as plot_training

__all__ = [
    "PageSection",
    "PageTable",
    "Summary",
    "draw_check",
    "draw_comparison",
    "draw_control",
    "draw_energies",
    "draw_extrapolation",
    "draw_inspection",
    "draw_phase",
    "draw_portraits",
    "draw_recorded",
    "draw_results",
    "draw_summary",
    "draw_sweeps",
    "draw_training",
    "film",
    "flat_row",
    "plot_block",
    "plot_circle",
    "plot_comparison",
    "plot_curves",
    "plot_energy",
    "plot_errors",
    "plot_extrapolation",
    "plot_phase",
    "plot_positions",
    "plot_recorded",
    "plot_rollouts",
    "plot_sweep",
    "plot_training",
    "table_csv",
    "table_latex",
    "table_markdown",
    "table_title",
    "write_html",
    "write_page",
    "write_tables",
]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> NoReturn:
        """Say what pictures need where it is not installed."""
        if name in __all__:
            raise ModuleNotFoundError('Pictures need matplotlib. Install "symoden[plot]".')
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

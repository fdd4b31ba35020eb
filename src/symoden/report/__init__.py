"""Pictures of results: the only part that draws. It needs matplotlib: `pip install "symoden[plot]"`."""

import importlib.util

if importlib.util.find_spec("matplotlib") is None:
    raise ModuleNotFoundError('Pictures need matplotlib. Install "symoden[plot]".')

from ._blocks import plot_block as plot_block
from ._errors import plot_errors as plot_errors
from ._rollouts import plot_rollouts as plot_rollouts
from ._summary import Summary as Summary, draw_summary as draw_summary

__all__ = ["Summary", "draw_summary", "plot_block", "plot_errors", "plot_rollouts"]

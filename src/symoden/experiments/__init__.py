"""The paper's experiments: tasks, their data, and the errors it reports; runs in folders."""

from ._block_errors import BlockErrors as BlockErrors, block_errors as block_errors
from ._cells import Cell as Cell, CellResult as CellResult, cells as cells
from ._control import (
    LEARNED as LEARNED,
    ControlConfig as ControlConfig,
    ControlResult as ControlResult,
    learned_machine as learned_machine,
    machine_of as machine_of,
    outside_data as outside_data,
    try_control as try_control,
)
from ._data_summary import DataSummary as DataSummary, summarize as summarize
from ._extrapolation import Extrapolation as Extrapolation, extrapolation as extrapolation
from ._facts import machine_facts as machine_facts
from ._free import (
    CircleDrift as CircleDrift,
    EnergyCurves as EnergyCurves,
    circle_drift as circle_drift,
    energy_curves as energy_curves,
    free_rollouts as free_rollouts,
)
from ._paper import PAPER as PAPER, MeanStd as MeanStd, PaperErrors as PaperErrors
from ._phase import Field as Field, PhasePlane as PhasePlane, phase_plane as phase_plane
from ._portrait import (
    BlockCurves as BlockCurves,
    ErrorComparison as ErrorComparison,
    Portrait as Portrait,
    RolloutComparison as RolloutComparison,
    fit_gauge as fit_gauge,
    portrait as portrait,
    unseen_rollouts as unseen_rollouts,
)
from ._posteriors import read_ensemble as read_ensemble, read_posterior as read_posterior
from ._presets import PRESETS as PRESETS, preset as preset
from ._results import (
    cell_folder as cell_folder,
    read_result as read_result,
    read_results as read_results,
    result_as_json as result_as_json,
    write_result as write_result,
)
from ._run_cell import check_cell as check_cell, run_cell as run_cell
from ._runs import (
    RunConfig as RunConfig,
    TrainingSummary as TrainingSummary,
    evaluation_solver as evaluation_solver,
    holds_run as holds_run,
    read_model as read_model,
    read_run as read_run,
    read_run_source as read_run_source,
    refuse_occupied as refuse_occupied,
    train_run as train_run,
    undisturbed as undisturbed,
    write_run as write_run,
)
from ._score_task import TaskScore as TaskScore, score_task as score_task
from ._simulate import TaskData as TaskData, simulate as simulate
from ._sources import Source as Source, absolute_name as absolute_name, read_source as read_source
from ._starts import Starts as Starts, starts_of as starts_of
from ._sweeps import Sweep as Sweep, SweepCurve as SweepCurve, is_own as is_own, row_name as row_name, sweeps as sweeps
from ._table import PAPER_ORDER as PAPER_ORDER, Row as Row, SeedErrors as SeedErrors, table_rows as table_rows
from ._tasks import TASKS as TASKS, Task as Task, own_trajectories as own_trajectories, task as task
from ._trained import Contest as Contest, Trained as Trained, read_contests as read_contests
from ._variants import simulate_variant as simulate_variant

__all__ = [
    "LEARNED",
    "PAPER",
    "PAPER_ORDER",
    "PRESETS",
    "TASKS",
    "BlockCurves",
    "BlockErrors",
    "Cell",
    "CellResult",
    "CircleDrift",
    "Contest",
    "ControlConfig",
    "ControlResult",
    "DataSummary",
    "EnergyCurves",
    "ErrorComparison",
    "Extrapolation",
    "Field",
    "MeanStd",
    "PaperErrors",
    "PhasePlane",
    "Portrait",
    "RolloutComparison",
    "Row",
    "RunConfig",
    "SeedErrors",
    "Source",
    "Starts",
    "Sweep",
    "SweepCurve",
    "Task",
    "TaskData",
    "TaskScore",
    "Trained",
    "TrainingSummary",
    "absolute_name",
    "block_errors",
    "cell_folder",
    "cells",
    "check_cell",
    "circle_drift",
    "energy_curves",
    "evaluation_solver",
    "extrapolation",
    "fit_gauge",
    "free_rollouts",
    "holds_run",
    "is_own",
    "learned_machine",
    "machine_facts",
    "machine_of",
    "outside_data",
    "own_trajectories",
    "phase_plane",
    "portrait",
    "preset",
    "read_contests",
    "read_ensemble",
    "read_model",
    "read_posterior",
    "read_result",
    "read_results",
    "read_run",
    "read_run_source",
    "read_source",
    "refuse_occupied",
    "result_as_json",
    "row_name",
    "run_cell",
    "score_task",
    "simulate",
    "simulate_variant",
    "starts_of",
    "summarize",
    "sweeps",
    "table_rows",
    "task",
    "train_run",
    "try_control",
    "undisturbed",
    "unseen_rollouts",
    "write_result",
    "write_run",
]

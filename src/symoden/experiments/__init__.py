"""The paper's experiments: tasks, their data, and the errors it reports; runs, and what can be asked of them."""

from ._audit import Audit as Audit, audit as audit
from ._evaluate import (
    Prediction as Prediction,
    RecordingScore as RecordingScore,
    TaskScore as TaskScore,
    WindowScore as WindowScore,
    predict as predict,
    score_recordings as score_recordings,
    score_task as score_task,
)
from ._inspect import (
    FrictionProfile as FrictionProfile,
    Inspection as Inspection,
    Profile as Profile,
    anchor as anchor,
    inspect_model as inspect_model,
)
from ._paper import PAPER as PAPER, MeanStd as MeanStd, PaperErrors as PaperErrors
from ._portrait import (
    BlockCurves as BlockCurves,
    ErrorComparison as ErrorComparison,
    Portrait as Portrait,
    RolloutComparison as RolloutComparison,
    fit_gauge as fit_gauge,
    portrait as portrait,
    unseen_rollouts as unseen_rollouts,
)
from ._presets import PRESETS as PRESETS, preset as preset
from ._ranges import Ranges as Ranges
from ._runs import (
    DataSummary as DataSummary,
    RunConfig as RunConfig,
    evaluation_solver as evaluation_solver,
    holds_run as holds_run,
    read_model as read_model,
    read_run as read_run,
    read_run_source as read_run_source,
    refuse_occupied as refuse_occupied,
    summarize as summarize,
    train_run as train_run,
    write_run as write_run,
)
from ._simulate import TaskData as TaskData, simulate as simulate
from ._sources import Source as Source, absolute_name as absolute_name, read_source as read_source
from ._tasks import TASKS as TASKS, Task as Task, task as task

__all__ = [
    "PAPER",
    "PRESETS",
    "TASKS",
    "Audit",
    "BlockCurves",
    "DataSummary",
    "ErrorComparison",
    "FrictionProfile",
    "Inspection",
    "MeanStd",
    "PaperErrors",
    "Portrait",
    "Prediction",
    "Profile",
    "Ranges",
    "RecordingScore",
    "RolloutComparison",
    "RunConfig",
    "Source",
    "Task",
    "TaskData",
    "TaskScore",
    "WindowScore",
    "absolute_name",
    "anchor",
    "audit",
    "evaluation_solver",
    "fit_gauge",
    "holds_run",
    "inspect_model",
    "portrait",
    "predict",
    "preset",
    "read_model",
    "read_run",
    "read_run_source",
    "read_source",
    "refuse_occupied",
    "score_recordings",
    "score_task",
    "simulate",
    "summarize",
    "task",
    "train_run",
    "unseen_rollouts",
    "write_run",
]

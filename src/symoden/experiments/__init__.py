"""The paper's experiments: tasks, their data, and the errors it reports."""

from ._paper import PAPER as PAPER, MeanStd as MeanStd, PaperErrors as PaperErrors
from ._simulate import TaskData as TaskData, simulate as simulate
from ._tasks import TASKS as TASKS, Task as Task, task as task

__all__ = ["PAPER", "TASKS", "MeanStd", "PaperErrors", "Task", "TaskData", "simulate", "task"]

"""Integrate: solvers, and rollouts under sampled inputs."""

from ._rollout import (
    HOLDS as HOLDS,
    Hold as Hold,
    Rollout as Rollout,
    linear_hold as linear_hold,
    rollout as rollout,
    zero_hold as zero_hold,
)
from ._sensitivity import LinearField as LinearField, sensitivity_step as sensitivity_step
from ._solvers import (
    FEWEST_SUBSTEPS as FEWEST_SUBSTEPS,
    RK4 as RK4,
    AbstractSolver as AbstractSolver,
    DiffraxSolver as DiffraxSolver,
    Stages as Stages,
)

__all__ = [
    "FEWEST_SUBSTEPS",
    "HOLDS",
    "RK4",
    "AbstractSolver",
    "DiffraxSolver",
    "Hold",
    "LinearField",
    "Rollout",
    "Stages",
    "linear_hold",
    "rollout",
    "sensitivity_step",
    "zero_hold",
]

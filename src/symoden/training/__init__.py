"""Training: short rollouts against recordings, by Adam and then Levenberg-Marquardt."""

from ._config import TrainingConfig as TrainingConfig
from ._fit import (
    FitResult as FitResult,
    TrainingError as TrainingError,
    fit as fit,
    hold_out as hold_out,
    ignore as ignore,
)
from ._posterior import Posterior as Posterior, infer_posterior as infer_posterior
from ._run import Progress as Progress
from ._scales import measure_scales as measure_scales, time_scale as time_scale

__all__ = [
    "FitResult",
    "Posterior",
    "Progress",
    "TrainingConfig",
    "TrainingError",
    "fit",
    "hold_out",
    "ignore",
    "infer_posterior",
    "measure_scales",
    "time_scale",
]

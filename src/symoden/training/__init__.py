"""Training: short rollouts against recordings, by Adam and then Levenberg-Marquardt."""

from ._config import TrainingConfig as TrainingConfig
from ._fit import FitResult as FitResult, TrainingError as TrainingError, fit as fit, ignore as ignore
from ._run import Progress as Progress
from ._scales import measure_scales as measure_scales, time_scale as time_scale

__all__ = ["FitResult", "Progress", "TrainingConfig", "TrainingError", "fit", "ignore", "measure_scales", "time_scale"]

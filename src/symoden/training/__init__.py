"""Training: short rollouts against recordings, by Adam and then Levenberg-Marquardt."""

from ._config import Span as Span, TrainingConfig as TrainingConfig
from ._data import hold_out as hold_out
from ._disturbances import find_disturbances as find_disturbances
from ._ensemble import (
    FEWEST_MEMBERS as FEWEST_MEMBERS,
    Ensemble as Ensemble,
    check_members as check_members,
    load_ensemble as load_ensemble,
)
from ._first_state import find_first_state as find_first_state
from ._fit import (
    FitResult as FitResult,
    TrainingError as TrainingError,
    fit as fit,
    ignore as ignore,
)
from ._flatten import cast as cast
from ._journal import (
    CHECKPOINTS as CHECKPOINTS,
    ENSEMBLE as ENSEMBLE,
    MODEL as MODEL,
    POSTERIOR as POSTERIOR,
)
from ._laplace import (
    Laplace as Laplace,
    infer_posterior as infer_posterior,
    load_laplace as load_laplace,
    save_laplace as save_laplace,
)
from ._posterior import AbstractPosterior as AbstractPosterior, AbstractScatter as AbstractScatter
from ._scales import measure_scales as measure_scales, time_scale as time_scale
from ._stopwatch import Progress as Progress

__all__ = [
    "CHECKPOINTS",
    "ENSEMBLE",
    "FEWEST_MEMBERS",
    "MODEL",
    "POSTERIOR",
    "AbstractPosterior",
    "AbstractScatter",
    "Ensemble",
    "FitResult",
    "Laplace",
    "Progress",
    "Span",
    "TrainingConfig",
    "TrainingError",
    "cast",
    "check_members",
    "find_disturbances",
    "find_first_state",
    "fit",
    "hold_out",
    "ignore",
    "infer_posterior",
    "load_ensemble",
    "load_laplace",
    "measure_scales",
    "save_laplace",
    "time_scale",
]

"""Table 1 of the paper."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, NamedTuple


class MeanStd(NamedTuple):
    """Mean and standard deviation over trajectories.

    Attributes:
        mean: Mean.
        std: Standard deviation.
    """

    mean: float
    std: float


@dataclass(frozen=True, kw_only=True)
class PaperErrors:
    """One row of the table: sums of squared errors of rollouts.

    Attributes:
        parameters_millions: Number of parameters, in millions.
        train: Over the training trajectories.
        test: Over the test trajectories.
        prediction: Over long rollouts from the training initial conditions without input.
    """

    parameters_millions: float
    train: MeanStd
    test: MeanStd
    prediction: MeanStd


def _row(millions: float, *errors: float) -> PaperErrors:
    """Row of the table in the order of its columns."""
    train, test, prediction = (MeanStd(*errors[i : i + 2]) for i in (0, 2, 4))
    return PaperErrors(parameters_millions=millions, train=train, test=test, prediction=prediction)


# Task, then model: parameters [millions], then mean and standard deviation of train, test and prediction error.
# Source: Zhong, Dey & Chakraborty (2020), *Dissipative SymODEN*, arXiv:2002.08860, table 1.
_TABLE: Final[dict[str, dict[str, PaperErrors]]] = {
    "pendulum-canonical": {
        "naive": _row(0.36, 26.38, 38.0, 35.03, 49.89, 32.544, 36.203),
        "unstructured": _row(0.22, 34.8, 68.53, 49.44, 81.31, 219.36, 296.86),
        "symoden": _row(0.13, 4.47, 6.4, 7.52, 10.13, 96.5, 99.56),
        "dissipative": _row(0.15, 0.88, 1.41, 1.25, 1.81, 34.03, 47.83),
    },
    "pendulum": {
        "naive": _row(0.65, 2.02, 4.41, 2.01, 4.99, 40.18, 78.1),
        "geometric": _row(0.46, 0.42, 1.16, 0.33, 1.22, 0.81, 0.68),
        "unstructured": _row(0.41, 1.9, 3.85, 1.61, 3.36, 7.04, 13.65),
        "symoden": _row(0.14, 2.37, 2.71, 2.67, 2.83, 72.78, 90.42),
        "dissipative": _row(0.16, 0.15, 0.27, 0.13, 0.25, 1.04, 1.3),
    },
    "cartpole": {
        "naive": _row(1.01, 12.92, 15.58, 20.07, 26.42, 268.24, 204.15),
        "geometric": _row(0.82, 0.48, 0.5, 1.34, 3.19, 60.12, 96.18),
        "unstructured": _row(0.69, 12.09, 18.38, 19.87, 23.16, 366.38, 405.45),
        "symoden": _row(0.51, 3.33, 3.85, 3.8, 3.71, 30.21, 34.33),
        "dissipative": _row(0.53, 0.88, 0.89, 1.37, 1.3, 8.32, 7.81),
    },
    "acrobot": {
        "naive": _row(1.46, 1.76, 2.26, 5.12, 9.14, 36.65, 77.16),
        "geometric": _row(0.97, 1.9, 2.82, 4.87, 7.42, 44.26, 95.7),
        "unstructured": _row(0.8, 77.56, 111.5, 122.7, 190.9, 590.77, 807.88),
        "symoden": _row(0.51, 2.92, 2.58, 5.27, 6.55, 68.26, 103.46),
        "dissipative": _row(0.53, 0.47, 0.64, 0.81, 1.1, 12.72, 32.12),
    },
}

PAPER: Final[Mapping[str, Mapping[str, PaperErrors]]] = MappingProxyType(
    {task: MappingProxyType(models) for task, models in _TABLE.items()}
)
"""The paper's errors, by task and kind of model."""

"""Whether a run's model predicts better with the other `hold`, which no training makes up for."""

import dataclasses
import math
import sys
from typing import Final

import numpy as np

from symoden.data import Dataset, spaced_evenly
from symoden.evaluation import score_recordings
from symoden.integrate import AbstractSolver
from symoden.mechanics import AbstractDynamics

from ._progress import show_work

_RECORDINGS: Final = 4  # That are compared.
_FEWEST: Final = 30  # Windows in them, which overlap by three quarters: nine halved their errors by chance.
_BETTER: Final = 0.85  # Of the errors; 0.81 and 0.75 on two simulated machines, 0.88 by chance on a measured one.


def name_other_hold(model: AbstractDynamics, dataset: Dataset, solver: AbstractSolver) -> None:
    """Say on standard error how well inputs of the other `hold` predict the training recordings.

    The model was fitted to inputs as the description has them: what is better with others, is so for a reason. Few
    windows do not tell.

    Args:
        model: The run's model.
        dataset: What it was trained on.
        solver: What integrates its rollouts.
    """
    other = "linear" if dataset.hold == "zero" else "zero"
    if not any(np.ptp(each.us, axis=0).any() for each in dataset.train):
        return
    chosen = spaced_evenly(len(dataset.train), _RECORDINGS)
    dataset = dataclasses.replace(dataset, train=tuple(dataset.train[i] for i in chosen), validation=(), test=())
    with show_work(f'comparing with `hold = "{other}"`'):
        scores = score_recordings(model, dataset, solver=solver)
        if (windows := sum(each.windows for each in scores)) < _FEWEST:
            print(f"{windows} windows are too few to tell (at least {_FEWEST})", file=sys.stderr)
            return
        others = score_recordings(model, dataclasses.replace(dataset, hold=other), solver=solver)
    errors = [[each.in_motion.error for each in every] for every in (scores, others)]
    pairs = [pair for pair in zip(*errors, strict=True) if all(map(math.isfinite, pair))]
    now, then = (sum(each) for each in zip(*pairs, strict=True)) if pairs else (0.0, 0.0)
    if not now > 0:
        return
    mostly = 2 * sum(after < before for before, after in pairs) > len(pairs)
    said = f'errors over the training recordings are {then / now:.0%} of those with "{dataset.hold}"'
    if mostly and then < _BETTER * now:
        print(
            f'warning: predictions are better with `hold = "{other}"`: {said}, by which the model was trained. Write '
            "it into the description, train again, and compare the errors of test recordings.",
            file=sys.stderr,
        )
    else:
        print(f"{said}: no reason to change it", file=sys.stderr)

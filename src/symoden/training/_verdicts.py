"""Whether a model is better than the one before: losses on validation windows, and what chance makes of them."""

import math
from typing import Final

import numpy as np
import scipy.stats
from jaxtyping import Float

from symoden.mechanics import AbstractDynamics

from ._data import HARDLY_ANY, Data
from ._flatten import cast
from ._objective import AbstractObjective, Batch
from ._residuals import evaluate_loss, evaluate_residuals

LOST: Final = 3.0
"""Validation loss over the best one that is lost: of 50 stages with four such steps in a row none was kept."""

CHANCE: Final = 1.0
"""Standard errors of a difference in validation that may be chance."""

CLEAR: Final = 1.64
"""Once in twenty: for what few machines have, or is asked last: ask often, and chance says yes."""

_FAR = 0.1  # Share of a loss that chance does not take it to, where so many and so large a share of windows say so.
_FEW, _MOSTLY = 3, 0.75
_LEAST_ERROR = 1e-3  # Of a mean difference: windows whose differences are the same by chance know it no better.


def gain(
    data: Data, model: AbstractDynamics, loss: float, before: AbstractDynamics, objective: AbstractObjective
) -> tuple[float, str]:
    """By how many standard errors the validation loss of a model is below that of the one before; and in words.

    Losses of different stages cannot be compared: these count errors otherwise, in other windows.

    Args:
        data: Windows to judge by.
        model: The model.
        loss: Its validation loss.
        before: The one before.
        objective: What errors count.

    Returns:
        Standard errors as `standard_errors` counts them, of the opposite sign, minus infinity where few windows are
        lost: theirs tell little. Both losses and these.
    """
    gained = -compare(data, model, before, objective)
    windows = data.held_out.ts.shape[0]
    few = f" of {windows} window{'' if windows == 1 else 's'}" if windows <= HARDLY_ANY else ""
    size = words_of(gained, few)
    other = evaluate_loss(before, objective, data.held_out)
    if few and loss > LOST * other and math.isfinite(gained):
        gained, size = -math.inf, f"{size}, which hardly tell, but {LOST:g} times as much or more"
    return gained, f"validation loss {loss:.2g}, before {other:.2g}: {size}"


def words_of(gained: float, few: str = "") -> str:
    """What a model has gained.

    Args:
        gained: Standard errors.
        few: Of how many windows, where that is worth a word.

    Returns:
        The words.
    """
    if math.isinf(gained):
        return "a tenth or less" if gained > 0 else "tenfold or more"
    return f"{round(gained, 2) + 0.0:+.2f} standard errors{few}"


def compare(data: Data, model: AbstractDynamics, other: AbstractDynamics, objective: AbstractObjective) -> float:
    """By how many standard errors the validation loss of a model is above that of another; 0 if that is not known.

    Args:
        data: Windows to judge by.
        model: The model.
        other: The other one.
        objective: What errors count.

    Returns:
        Standard errors as `standard_errors` counts them.
    """
    if data.validation is None:
        return 0.0
    here, there = (window_losses(each, objective, data.validation) for each in (model, other))
    return standard_errors(here, there)


def window_losses(model: AbstractDynamics, objective: AbstractObjective, windows: Batch) -> Float[np.ndarray, " W"]:
    """Loss of every window.

    Args:
        model: The model.
        objective: What errors count.
        windows: Any windows.

    Returns:
        Mean of its squared residuals; not finite where a rollout diverges.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return np.mean(np.asarray(evaluate_residuals(model, objective, windows), float) ** 2, axis=(1, 2))


def standard_errors(here: Float[np.ndarray, " W"], there: Float[np.ndarray, " W"]) -> float:
    """By how many standard errors losses are above others, window against window.

    Of two models that the data do not tell apart the simpler one is to be preferred (the rule of one standard error
    of Breiman et al., 1984). But the losses of a few windows differ by more than their mean, so that their standard
    error says little: what is tenfold in the mean, and in three of four windows, of three or more, is no chance.

    Of two windows the standard error itself is hardly known: their differences may be alike by chance. So many
    standard errors are Student's, and are given as the normal deviate that is as unlikely.

    Args:
        here: Losses of windows.
        there: Others.

    Returns:
        Mean of the differences relative to its standard error; infinite if it is tenfold.
    """
    if not np.isfinite(here).all():
        return math.inf
    if not np.isfinite(there).all():
        return -math.inf
    if _is_far_below(here, there) or _is_far_below(there, here):
        return math.copysign(math.inf, np.mean(here) - np.mean(there))
    if len(here) == 1:
        return 0.0
    mean, error = float(np.mean(here - there)), float(np.std(here - there, ddof=1)) / math.sqrt(len(here))
    return _normal_deviate(mean / max(error, _LEAST_ERROR * abs(mean), float(np.finfo(float).tiny)), len(here) - 1)


def fits_better(
    data: Data, model: AbstractDynamics, before: AbstractDynamics, objective: AbstractObjective
) -> tuple[bool, str]:
    """Whether a model of other parts fits what both were trained on better; and in words, to be added to others.

    Args:
        data: Windows that both were trained on.
        model: The model.
        before: The one before.
        objective: What errors count.

    Returns:
        Both.
    """
    ours, theirs = (evaluate_loss(each, objective, data.train) for each in (model, before))
    return ours < theirs, f"; training loss {ours:.2g}, before {theirs:.2g}"


def by_rollouts(data: Data, model: AbstractDynamics, before: AbstractDynamics) -> tuple[bool, str]:
    """Whether rollouts of a model that was found without any are better than those of the one before; and in words.

    Args:
        data: Windows to roll out.
        model: The model.
        before: The one before.

    Returns:
        Both.
    """
    models = (cast(each, data.judged.q.dtype) for each in (model, before))
    after, other = (evaluate_loss(each, data.objective, data.judged) for each in models)
    return after < other, f"a loss of {after:.2g} over rollouts, {other:.2g} without"


def _normal_deviate(student: float, degrees: int) -> float:
    """The normal deviate that is exceeded as seldom as one of Student's."""
    size = abs(student)
    normal = float(scipy.stats.norm.isf(scipy.stats.t.sf(size, degrees)))
    return math.copysign(min(size, normal), student)  # Where neither is ever exceeded: the first.


def _is_far_below(losses: Float[np.ndarray, " W"], others: Float[np.ndarray, " W"]) -> bool:
    """Whether windows' losses are a tenth of others, in the mean and in three of four windows."""
    enough = len(losses) >= _FEW and np.mean(losses < _FAR * others) >= _MOSTLY
    return bool(enough and np.mean(losses) < _FAR * np.mean(others))

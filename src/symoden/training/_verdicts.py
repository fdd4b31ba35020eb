"""Whether a model is better than the one before: losses on validation windows, and what chance makes of them."""

import enum
import math
from typing import Final, NamedTuple

import equinox as eqx
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

DEAR: Final = 1.25
"""Loss over the one before, from which on what was closed is missing."""

FOUND: Final = 0.1
"""Mean squared residual, relative to the motion, below which a model is in the right basin."""

_FAR = 0.1  # Share of a loss that chance does not take it to, where so many and so large a share of windows say so.
_FEW, _MOSTLY = 3, 0.75
_LEAST_ERROR = 1e-3  # Of a mean difference: windows whose differences are the same by chance know it no better.


class Judge(enum.Enum):
    """What tells whether a stage has gained something."""

    VALIDATION = "validation loss"
    TRAINING = "training loss"
    LEFT_OUT = "windows left out in turn"
    ROLLOUTS = "rollouts"


class Verdict(NamedTuple):
    """Whether what came of a stage is kept, and what tells; its string says it in words.

    Attributes:
        by: What judged it.
        loss: Loss of what came of it.
        before: Loss of what it had to improve on.
        windows: Number of windows that judged.
        gained: By how many standard errors it is better, as `standard_errors` counts them.
        wanted: More than so many had to be.
        moved: Whether a step was better than what it had to improve on; else the loss is that of the last one.
        fitted: Training losses of both where the first must be lower, too.
        frees_friction: Whether it has set friction's laws free by the way.
        closes: Whether it has closed something: more data could not tell that there is more to the mechanism.
        cut_short: Whether time ran out before it ended.
    """

    by: Judge
    loss: float
    before: float
    windows: int
    gained: float
    wanted: float
    moved: bool = True
    fitted: tuple[float, float] | None = None
    frees_friction: bool = False
    closes: bool = False
    cut_short: bool = False

    @property
    def kept(self) -> bool:
        """Whether it is."""
        fits = self.fitted is None or self.fitted[0] < self.fitted[1]
        return self.gained > self.wanted and not (self._is_lost or self._is_dear or self._is_vague) and fits

    @property
    def hardly(self) -> bool:
        """Whether it is refused by so few windows that this is hardly a verdict."""
        return not self.kept and not self.closes and self._by_few and math.isfinite(self.gained)

    @property
    def _by_few(self) -> bool:
        """Whether hardly any windows judged."""
        return self.windows <= HARDLY_ANY and self.by is not Judge.ROLLOUTS

    @property
    def _is_lost(self) -> bool:
        """Whether windows are lost whose standard errors tell little: few, or left out, where single ones go astray."""
        tell_little = self._by_few or self.by is Judge.LEFT_OUT
        return self.moved and tell_little and self.loss > (1 if self._alone else LOST) * self.before

    @property
    def _is_dear(self) -> bool:
        """Whether what was closed is missing: in a single window, its standard error would not tell."""
        return self.closes and self.loss > DEAR * self.before

    @property
    def _is_vague(self) -> bool:
        """Whether something was closed and hardly anything is predicted: by such a model it is not missing."""
        return self.closes and not self.loss < FOUND

    @property
    def _alone(self) -> bool:
        """Whether one window is to say that nothing is lost: of differences it knows no standard error."""
        return self.windows == 1 and self._by_few and self.wanted < 0

    def __str__(self) -> str:
        """In words."""
        loss, before, by = f"{self.loss:.2g}", f"{self.before:.2g}", self.by.value
        if not self.moved:
            tells = f"no step lowered the {by}: {before} before, {loss} at the end"
        elif self.by is Judge.ROLLOUTS:
            tells = f"a loss of {loss} over {by}, {before} without"
        elif self.by is Judge.LEFT_OUT:
            tells = f"a loss of {loss} over {self.windows} {by}, before {before}: {self._size}"
        else:
            tells = f"{by} {loss}, before {before}: {self._size}"
        if self.fitted is not None:
            now, then = self.fitted
            tells += f"; training loss {now:.2g}, before {then:.2g}" + ("" if now < then else ", must fall too")
        if self.kept and self.frees_friction:
            tells += "; frees friction's laws too, under learned priors"
        kept = "not kept" if not self.kept else "kept" if self.moved else "kept as it was"
        return f"{'cut short, ' if self.cut_short else ''}{kept} ({tells})"

    @property
    def _size(self) -> str:
        """How much it has gained, in words."""
        if self._is_dear:
            return f"more than {DEAR:g} times as much"
        if self._is_vague:
            return f"what predicts so little, {FOUND:g} of the motion or more, tells nothing of what it lacks"
        if math.isinf(self.gained):
            if not math.isfinite(self.loss + self.before):
                return f"rollouts diverge in {'fewer' if self.gained > 0 else 'no fewer'} windows"
            return "a tenth or less" if self.gained > 0 else "tenfold or more"
        if self._by_few and self.windows == 1:
            return f"one window, {'whose loss must not be larger' if self._alone else 'which has no standard error'}"
        of = f" of {self.windows} windows" if self._by_few else ""
        bound = f"more than {self.wanted:+.3g} wanted"
        if self._is_lost:
            bound = f"which hardly tell, but {LOST:g} times as much or more"
        return f"{round(self.gained, 2) + 0.0:+.2f} standard errors{of}, {bound}"


class Skipped(NamedTuple):
    """That a stage had nothing to do; its string says it in words.

    Attributes:
        why: Why, in words.
    """

    why: str

    @property
    def hardly(self) -> bool:
        """No windows refused it."""
        return False

    def __str__(self) -> str:
        """In words."""
        return f"skipped ({self.why})"


def by_windows(by: Judge, here: Float[np.ndarray, " W"], there: Float[np.ndarray, " W"], *, wanted: float) -> Verdict:
    """The verdict of windows.

    Losses of different stages cannot be compared: these count errors otherwise, in other windows. Those that diverge in
    either model are left out where as many do in both.

    Args:
        by: Which ones they are.
        here: Their losses with what came of a stage.
        there: Those with what it had to improve on.
        wanted: By more than so many standard errors it has to be better.

    Returns:
        The verdict.
    """
    here, there = _comparable(here, there)
    with np.errstate(over="ignore"):
        loss, before = (float(np.mean(each)) for each in (here, there))
    return Verdict(by, loss, before, len(here), -standard_errors(here, there), wanted)


def by_validation(
    data: Data,
    model: AbstractDynamics,
    before: AbstractDynamics,
    objective: AbstractObjective,
    *,
    last: AbstractDynamics,
    wanted: float,
) -> Verdict:
    """The verdict of the windows of validation.

    Args:
        data: The windows.
        model: What came of a stage.
        before: What it had to improve on.
        objective: What errors count.
        last: The model of the last step.
        wanted: By more than so many standard errors it has to be better.

    Returns:
        The verdict.
    """
    assert data.validation is not None
    here, there = (window_losses(each, objective, data.validation) for each in (model, before))
    verdict = by_windows(Judge.VALIDATION, here, there, wanted=wanted)
    if not eqx.tree_equal(model, before):
        return verdict
    by, chosen = (Judge.TRAINING if data.in_turn else Judge.VALIDATION), data.choosing  # By which steps were chosen.
    loss, other = (evaluate_loss(each, objective, chosen) for each in (last, before))
    return verdict._replace(by=by, loss=loss, before=other, windows=chosen.ts.shape[0], moved=False)


def by_price(
    data: Data,
    model: AbstractDynamics,
    before: AbstractDynamics,
    objective: AbstractObjective,
    *,
    wanted: float,
) -> Verdict | None:
    """The verdict on a model of which something was closed that the training windows miss; none if they do not.

    Args:
        data: The windows.
        model: The model.
        before: The one before, with what was closed.
        objective: What errors count.
        wanted: By more than so many standard errors it would have to be better.

    Returns:
        The verdict, that it is not kept.
    """
    loss, other = (evaluate_loss(each, objective, data.train) for each in (model, before))
    verdict = Verdict(Judge.TRAINING, loss, other, data.train.ts.shape[0], -math.inf, wanted, closes=True)
    return None if loss <= DEAR * other else verdict


def by_rollouts(data: Data, model: AbstractDynamics, before: AbstractDynamics) -> Verdict:
    """The verdict on a model that was found without rollouts: these must be better than those of the one before.

    Args:
        data: Windows to roll out.
        model: The model.
        before: The one before.

    Returns:
        The verdict.
    """
    models = (cast(each, data.choosing.q.dtype) for each in (model, before))
    after, other = (evaluate_loss(each, data.objective, data.choosing) for each in models)
    windows = data.choosing.ts.shape[0]
    return Verdict(Judge.ROLLOUTS, after, other, windows, math.inf if after < other else -math.inf, wanted=0.0)


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
        Mean of its squared residuals; infinite where a rollout diverges.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        losses = np.mean(np.asarray(evaluate_residuals(model, objective, windows), float) ** 2, axis=(1, 2))
    return np.where(np.isnan(losses), np.inf, losses)


def standard_errors(here: Float[np.ndarray, " W"], there: Float[np.ndarray, " W"]) -> float:
    """By how many standard errors losses are above others, window against window.

    Of two models that the data do not tell apart the simpler one is to be preferred (the rule of one standard error
    of Breiman et al., 1984). But the losses of a few windows differ by more than their mean, so that their standard
    error says little: what is tenfold in the mean, and in three of four windows, of three or more, is no chance.

    Of two windows the standard error itself is hardly known: their differences may be alike by chance. So many
    standard errors are Student's, and are given as the normal deviate that is as unlikely.

    The model that diverges in fewer windows is better, whatever the others say. A window that diverges in both says
    nothing; nor do as many that diverge in one model alone as in the other.

    Args:
        here: Losses of windows.
        there: Others.

    Returns:
        Mean of the differences relative to its standard error; infinite if it is tenfold, or no fewer windows diverge
        and none are left to compare.
    """
    here, there = _comparable(here, there)
    lost, lost_before = (int(np.sum(~np.isfinite(each))) for each in (here, there))
    if lost or lost_before:
        return math.inf if lost >= lost_before else -math.inf
    if _is_far_below(here, there) or _is_far_below(there, here):
        return math.copysign(math.inf, np.mean(here) - np.mean(there))
    if len(here) == 1:
        return 0.0
    mean, error = float(np.mean(here - there)), float(np.std(here - there, ddof=1)) / math.sqrt(len(here))
    return _normal_deviate(mean / max(error, _LEAST_ERROR * abs(mean), float(np.finfo(float).tiny)), len(here) - 1)


def _comparable(
    here: Float[np.ndarray, " W"], there: Float[np.ndarray, " W"]
) -> tuple[Float[np.ndarray, " K"], Float[np.ndarray, " K"]]:
    """Losses of windows that diverge in neither, where as many do in both and others are left; else of all."""
    ours, theirs = np.isfinite(here), np.isfinite(there)
    both = ours & theirs
    return (here[both], there[both]) if ours.sum() == theirs.sum() and both.any() else (here, there)


def _normal_deviate(student: float, degrees: int) -> float:
    """The normal deviate that is exceeded as seldom as one of Student's."""
    size = abs(student)
    normal = float(scipy.stats.norm.isf(scipy.stats.t.sf(size, degrees)))
    return math.copysign(min(size, normal), student)  # Where neither is ever exceeded: the first.


def _is_far_below(losses: Float[np.ndarray, " W"], others: Float[np.ndarray, " W"]) -> bool:
    """Whether windows' losses are a tenth of others, in the mean and in three of four windows."""
    enough = len(losses) >= _FEW and np.mean(losses < _FAR * others) >= _MOSTLY
    return bool(enough and np.mean(losses) < _FAR * np.mean(others))

"""How certain a model is, and how it does on recordings, in sentences."""

import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Final

from symoden.evaluation import Audit, BandScore, Certainty
from symoden.experiments import RunConfig
from symoden.wording import number, spans_in_words

_NONE: Final = 1e-6  # Relative width of a band that is none.
_MOSTLY: Final = 0.7  # Half of the variance.
_UNKNOWN: Final = 10.0
_MISSED: Final = 0.1  # Share of positions that bands may miss beyond what they say, before it is worth a word.
_UNBALANCED: Final = 0.25  # Residual of the energy balance; 0.02 on arms that are predicted well.
_DIAGONAL: Final = re.compile(r"M\[(\d+), \1\]")


def training_words(config: RunConfig) -> Iterator[str]:
    """How training went, in words.

    Args:
        config: Settings of the run, and what came of them.

    Yields:
        Lines; none of runs from before this was kept.
    """
    if config.trained is None:
        return
    yield f"{config.trained.outcome}, after {config.trained.seconds:.0f} s"
    if config.training.left_out:
        yield f"left out of training, as disturbed: {spans_in_words(config.training.left_out)}"
    yield from (f"{stage}: {verdict}" for stage, verdict in config.trained.verdicts.items())
    if words := hardly_judged(config.trained.hardly_judged):
        yield words


def hardly_judged(stages: Sequence[str]) -> str:
    """What to say where stages were refused by so few windows of validation that these hardly tell.

    Args:
        stages: Their names.

    Returns:
        The words; none where there are no such stages.
    """
    if not stages:
        return ""
    return (
        f"by very few windows of validation, which hardly tell, training refused {', '.join(stages)}: longer or more "
        "recordings, or `[validation]` ones that move, can tell whether the mechanism has more to it"
    )


def size_words(parameters: int, active: int) -> str:
    """How many parameters a model has.

    Args:
        parameters: All of them.
        active: Those that do something.

    Returns:
        The words.
    """
    return str(parameters) if active == parameters else f"{parameters}, {active} of them active"


def name_unfinished(config: RunConfig) -> None:
    """Say on standard error that a run's training has not come to its end, if so.

    Args:
        config: Settings of the run, and what came of them.
    """
    if config.trained is not None and not config.trained.completed:
        print(
            f"warning: not all of training is done: {config.trained.outcome}. Until it is "
            "(`train --resume` goes on), bands may be too narrow.",
            file=sys.stderr,
        )


def certainty_words(certain: Certainty | None, missing: str) -> Iterator[str]:
    """How certain all this is, in words.

    Args:
        certain: The bands.
        missing: Why there are none.

    Yields:
        Lines.
    """
    if certain is None:
        yield f"no bands: {missing}"
        return
    if certain.members is None:
        yield (
            f"± is half of a {certain.level:.0%} band, to first order; {certain.windows} windows determine "
            f"{certain.effective:.0f} of {certain.parameters} free parameters"
        )
    else:
        models = ensemble_words(certain.members, certain.tried or 0)
        yield (
            f"± is half of a {certain.level:.0%} band, from {models}, each trained on {certain.windows} windows drawn "
            "with replacement"
        )
    if typical := [f"{name} ± {_percent(value)}" for name, value in certain.relative.items() if value > _NONE]:
        yield f"typical: {', '.join(typical)}"
    if certain.common_factor is not None and _is_common(certain):
        yield (
            f"mostly a common factor of M, V and D, which inputs tell: ± {_percent(certain.common_factor)}; were it "
            "known, " + ", ".join(f"{name} ± {_percent(value)}" for name, value in certain.apart.items())
        )
    if certain.accelerations:
        yield "accelerations, whose scale is told: " + ", ".join(
            f"by {name} ± {_percent(value)}" for name, value in certain.accelerations.items()
        )
    if certain.undetermined:
        yield f"no larger than their bands, so not told by these data: {', '.join(certain.undetermined)}"
    if "V" in certain.undetermined and "V" not in certain.relative:
        yield (
            "V is zero: training found that nothing asks for one (`no potential`); its band says how large one could "
            "be that these data would not show"
        )
    elif "V" in certain.undetermined:
        yield (
            'of V all is open: where neither gravity nor a spring acts, `[known]` may have `potential_energy = "0"`, '
            "or `cyclic` names the coordinates that nothing depends on; compare by `evaluate`. Where one does, on a "
            "coordinate that no input acts on, its size beside M is what is open: give a mass or a moment of inertia"
        )
    if certain.accelerations and any(_DIAGONAL.fullmatch(entry) for entry in certain.undetermined):
        yield (
            "where no other coordinate acts on one, its row of M, V, g and D has a factor of its own, which no motion "
            "tells: a given `input_matrix` fixes all"
        )


def _percent(share: float) -> str:
    """A relative half width; beyond ten times itself a quantity is not known at all."""
    if share > _UNKNOWN:
        return f"more than {_UNKNOWN:.0%}"
    return f"{100 * share:.2g}%" if share < 1 else f"{share:.0%}"


def _is_common(certain: Certainty) -> bool:
    """Whether most of what is uncertain of M and V is a common factor."""
    widths = {name: certain.relative.get(name, 0.0) for name in ("M", "V")}  # None of what is given.
    return min(widths.values()) > _NONE and all(certain.apart[name] < _MOSTLY * width for name, width in widths.items())


def ensemble_words(members: int, tried: int) -> str:
    """How many models there are of an ensemble.

    Args:
        members: Number of models.
        tried: Number of models that were trained.

    Returns:
        The words.
    """
    astray = f" ({tried - members} more fitted worse than the model)" if tried > members else ""
    return f"{members} models from other initial weights{astray}"


def band_words(score: BandScore) -> str:
    """How well bands cover, in a sentence.

    Args:
        score: The score.

    Returns:
        The sentence.
    """
    narrow = score.coverage < score.level - _MISSED
    each = f" (one by one {', '.join(f'{part:.0%}' for part in score.coverages)})" if len(score.coverages) > 1 else ""
    widths = ", ".join(map(number, score.half_widths))
    calibrated = "training" if score.calibrated_on == "train" else score.calibrated_on
    return (
        f"{score.level:.0%} bands over windows of {score.horizon_s:.3g} s cover {score.coverage:.1%} of the "
        f"positions of the {score.split} recordings{each}; median half width {widths}, "
        f"{score.from_parameters:.0%} of the variance from uncertain parameters; width set by the {calibrated} "
        "recordings"
        + (
            ", which move otherwise: the bands are too narrow here. Train on recordings that move so, or look for what "
            "the model lacks, such as inputs that act late, or a zero that drifts"
            if narrow
            else ""
        )
    )


def audit_words(split: str, result: Audit | None, missing: str) -> Iterator[str]:
    """The power audit in words.

    Args:
        split: Part that was looked at.
        result: The audit.
        missing: Why there is none.

    Yields:
        Lines.
    """
    if result is None:
        yield f"not made, because the run's data cannot be read: {missing}"
        return
    several = "" if result.recordings == 1 else "s"
    yield f"{result.recordings} {split} recording{several}; outside the range of training: {result.outside:.1%}"
    if result.diverged is None:
        yield "the balance of powers does not apply: this kind of model has no energy"
        return
    yield f"rollouts: {result.rollouts}, of which {result.diverged} did not stay finite"
    yield f"largest violation of dH/dt = y'u - v'Dv along rollouts, relative: {number(result.rollout_violation)}"
    yield (
        "residual of the energy balance along recordings, relative: "
        f"median {number(result.log_residual_median)}, largest {number(result.log_residual_max)}"
    )
    if result.log_residual_median is not None and result.log_residual_median > _UNBALANCED:
        yield (
            f"more than {_percent(_UNBALANCED)} of the energy that passes through is not accounted for: what was "
            "learned of M, V, g and D, or the velocities as they were measured, cannot be relied on, whatever bands say"
        )
    yield f"least eigenvalue of inv(M): {number(result.inverse_mass_min)}, of D: {number(result.dissipation_min)}"


def audit_as_json(split: str, result: Audit | None, missing: str) -> dict[str, object]:
    """The same for a program.

    Args:
        split: Part that was looked at.
        result: The audit.
        missing: Why there is none.

    Returns:
        What JSON has.
    """
    return {"unavailable": missing} if result is None else {"split": split, **asdict(result)}

"""Scores as tables and as JSON, shared by `train`, `evaluate` and `report`."""

import math
import statistics
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, astuple
from typing import Final, NamedTuple

from symoden.blocks import count_parameters
from symoden.evaluation import RecordingScore, score_recordings
from symoden.experiments import MeanStd, RunConfig, Source, Task, TaskScore, evaluation_solver, score_task, undisturbed
from symoden.mechanics import AbstractDynamics
from symoden.wording import first_few, number

from ._disturbed import Disturbed, disturbed_tests, disturbed_words
from ._output import TableText, print_table

_ERRORS = ("train", "test", "prediction")
_FEW = 4  # Coordinates that have a column each.
_WORST = 2  # Coordinates that are named where there are more.
_AS_BAD: Final = 0.1  # Share of the largest error.
_POOR: Final = 0.5  # Share of the way that positions go in a second, or of what going on as at first is off by.
_SEVERAL: Final = 4  # Recordings that tell what is usual.
_AWAY: Final = 2.0  # Ranges in which all recordings move: what is off by less is still near.
_TIMES: Final = 5.0  # The usual error, or that of training: then it is no matter of noise, nor of harder motions.
_ASTRAY: Final = (
    "The motion may lie outside of what training has seen (`symoden inspect` says how far), or the model is a poor one."
)
_SLIGHT: Final = 0.2  # Share of that way: noise alone tells what is off by less.


class Scores(NamedTuple):
    """Scores of a model.

    Attributes:
        values: For JSON.
        table: As they are printed.
        warning: What to say of them; mostly nothing.
        share: How far predictions over short windows are off, relative to how far positions move; NaN without any.
        disturbed: Spans of test recordings that spoil them.
    """

    values: dict[str, object]
    table: TableText
    warning: str = ""
    share: float = math.nan
    disturbed: Disturbed = ()

    @property
    def warnings(self) -> list[str]:
        """All that is to be said of them."""
        return [words for words in (self.warning, disturbed_words(self.disturbed)) if words]


def report_scores(
    model: AbstractDynamics, config: RunConfig, source: Source, *, own: Source | None = None, json: bool
) -> Scores:
    """Score a model on a task or on a data set, and print the table unless JSON was asked for.

    Args:
        model: The run's model.
        config: The run's settings.
        source: What to score on.
        own: What the run was trained on, where that has been read.
        json: Whether to leave the table out.

    Returns:
        The scores.
    """
    scores = scores_of(model, config, source, own=own)
    if not json:
        print_table(*scores.table)
    for words in scores.warnings:
        print(f"warning: {words}", file=sys.stderr)
    if source.task is None and not source.dataset.test:
        print(
            "no recording is kept for testing: name some under [test] to see how others are predicted", file=sys.stderr
        )
    return scores


def share_of_motion(recordings: Sequence[RecordingScore]) -> float:
    """How far predictions over short windows are off, relative to how far positions move, in the recordings' mean.

    Args:
        recordings: Scores of recordings.

    Returns:
        The share; NaN where no recording is as long as a window.
    """
    _, error, motion = _windowed(recordings)
    if motion:
        return error / motion
    return math.inf if error else math.nan


def _length(recordings: Sequence[RecordingScore]) -> str:
    """How long the windows are that predictions are scored over."""
    return f"{recordings[0].window_rmse.horizon_s:.3g} s"


def _windowed(recordings: Sequence[RecordingScore]) -> tuple[list[RecordingScore], float, float]:
    """Those that are as long as a window, the sum of their errors, and of what positions move, while they do."""
    long = [each for each in recordings if math.isfinite(each.motion)]
    return long, float(sum(each.in_motion.error for each in long)), float(sum(each.in_motion.motion for each in long))


def _names(some: Sequence[RecordingScore], among: Sequence[RecordingScore]) -> str:
    """Names of some of the recordings, with their parts where several parts have one name, as of one file."""
    count = Counter(name for name, _ in {(each.name, each.split) for each in among})
    return first_few((f"`{each.name}`" + f" ({each.split})" * (count[each.name] > 1) for each in some), _FEW)


def poor(recordings: Sequence[RecordingScore], *, among: Sequence[RecordingScore] = ()) -> str:
    """What to say of predictions that are hardly better than none, or worse.

    Args:
        recordings: Scores of recordings.
        among: Scores of all recordings, from whose names theirs are told apart; these, if absent.

    Returns:
        The words; none where predictions are better, or no recording is as long as a window.
    """
    among = among or recordings
    lost = [each for each in _windowed(recordings)[0] if not math.isfinite(each.in_motion.error)]
    if lost:
        others = poor([each for each in recordings if math.isfinite(each.in_motion.error)], among=among)
        return (
            f"over {_length(lost)} most predictions of {_names(lost, among)} diverge. {_ASTRAY}"
            f"{others and f' Of the others, {others}'}"
        )
    long, error, _ = _windowed(recordings)
    worst = sorted(long, key=lambda each: -each.in_motion.error)
    if error > _POOR * sum(map(_guess, long)):
        least = _AS_BAD * worst[0].in_motion.error  # At rest hardly anything is better than standing still.
        worst = [each for each in worst if each.in_motion.error > max(_POOR * _guess(each), least)]
    else:
        far = math.inf if len(long) < _SEVERAL else _TIMES * statistics.median(each.in_motion.error for each in long)
        tests = _worse_tests(long)
        worst = [each for each in worst if each.in_motion.error > max(_guess(each), 0.0 if each in tests else far)]
    if not worst:
        return ""
    some = len(worst) < len(long)
    error, motion, coasting = (
        sum(each) / len(worst) for each in zip(*(astuple(each.in_motion) for each in worst), strict=True)
    )
    coasts = coasting < motion
    better = "worse than" if error > (coasting if coasts else motion) else "hardly better than"
    of = f" of {_names(worst, among)}" if some else ""
    said = (
        f"over {_length(worst)} predictions{of} are off by {number(error)} where positions move {number(motion)}"
        + (f" and going on at the first velocity is off by {number(coasting)}" if coasts else "")
        + f", in the mean over {'these' if some else 'the'} recordings while they move: {better} "
        + ("that." if coasts else "standing still.")
    )
    if some:
        return (
            f"{said} The others are predicted better. What differs there? Joints that dry friction holds, another "
            "load, faster motion, an input that acts there alone and has the wrong sign or unit, or a region that "
            "training has not seen (`symoden inspect` says which) do that."
        )
    return (
        f"{said} An input that has the wrong sign or unit, is late (`input_delay`), acts slowly (`input_lag`) or was "
        "not logged does that, or a wrong `input_matrix`, or equations or start values under `[known]` that are far "
        "off: `symoden data check` cannot see all of that. So does too little motion to learn from, or to judge by: "
        "record more, name `[validation]` recordings, or leave less to learn, by `cyclic` what nothing depends on."
    )


def _worse_tests(recordings: Sequence[RecordingScore]) -> list[RecordingScore]:
    """The test recordings, if together they are predicted worse than by a guess, by as much as training ones move."""
    tests, others = ([each for each in recordings if (each.split == "test") is tested] for tested in (True, False))
    error, guess = (sum(map(of, tests)) for of in (lambda each: each.in_motion.error, _guess))
    usual = statistics.fmean(map(_guess, others)) if others else 0.0
    return tests if error > guess and error > _SLIGHT * usual * len(tests) else []


def diverging(recordings: Sequence[RecordingScore]) -> str:
    """What to say of rollouts that diverge, over some windows or whole recordings.

    Args:
        recordings: Scores of recordings.

    Returns:
        The words; none where all stay finite.
    """
    lost = [each for each in recordings if math.isinf(each.window_rmse.mean)]
    astray = [each for each in recordings if not math.isfinite(each.rollout_rmse)]
    said = [f"over {_length(lost)} some predictions of {_names(lost, recordings)} diverge"] if lost else []
    said += [f"one rollout over the whole of {_names(astray, recordings)} diverges"] if astray else []
    return f"{', and '.join(said)}. {_ASTRAY}" if said else ""


def running_away(recordings: Sequence[RecordingScore]) -> str:
    """What to say of rollouts over whole recordings that stay finite, but go where no recording has been by far.

    Args:
        recordings: Scores of recordings.

    Returns:
        The words; none where all stay near.
    """
    away = [each for each in recordings if _AWAY < each.astray < math.inf]
    if not away:
        return ""
    return (
        f"rollouts over the whole of {_names(away, recordings)} run away, off by up to "
        f"{max(each.astray for each in away):.2g} times the range in which all recordings move: a model that is good "
        f"over {_length(away)} may be unstable over longer times, as one of a mechanism that feedback balances is by "
        "rights. `[validation]` recordings that go over the whole range, or what you know of V (`[known]`), help."
    )


def by_heart(recordings: Sequence[RecordingScore]) -> str:
    """What to say of a model that predicts what it was trained on, and hardly anything else.

    Args:
        recordings: Scores of recordings.

    Returns:
        The words; none where others are predicted too, or no part has a recording as long as a window.
    """
    parts = [[each for each in recordings if each.split == split] for split in ("train", "test")]
    (seen, learned, _), (others, error, _) = map(_windowed, parts)
    if not seen or not others or not error > _POOR * sum(map(_guess, others)):
        return ""
    learned, error = learned / len(seen), error / len(others)
    if error < _TIMES * learned:
        return ""
    return (
        f"over {_length(others)} predictions of test recordings are off by {number(error)}, of training recordings by "
        f"{number(learned)}: the model knows these by heart. Record longer, or more motions that go where it is to "
        "predict, or tell what you know of the mechanism (`[known]`)."
    )


def _guess(recording: RecordingScore) -> float:
    """How far off the better of two guesses is that know nothing of the mechanism: to stand still, or to coast."""
    _, motion, coasting = astuple(recording.in_motion)
    return motion if math.isnan(coasting) else min(motion, max(coasting, _SLIGHT * motion))


def scores_of(model: AbstractDynamics, config: RunConfig, source: Source, *, own: Source | None = None) -> Scores:
    """Score a model on a task or on a data set.

    Args:
        model: The run's model.
        config: The run's settings.
        source: What to score on.
        own: What the run was trained on, where that has been read.

    Returns:
        The scores.
    """
    solver = evaluation_solver(config)
    if source.task is None:
        recordings = score_recordings(model, undisturbed(config, source.dataset), solver=solver)
        disturbed = disturbed_tests(model, config, source, own=own)
        return Scores(
            {"recordings": [asdict(recording) for recording in recordings], "disturbed": disturbed},
            _recordings(recordings, source.dataset.position_units, config.data.position_names),
            poor(recordings) or by_heart(recordings) or diverging(recordings) or running_away(recordings),
            share_of_motion(recordings),
            disturbed,
        )
    score = score_task(model, source, solver=solver)
    errors = {f"{name}_error": getattr(score, name)._asdict() for name in _ERRORS}
    described = {"task": source.task.name, "model": config.model.kind, "parameters": count_parameters(model)}
    values: dict[str, object] = {**described, **errors, "diverged": score.diverged}
    return Scores(values, _errors(score, source.task, config.model.kind))


def _errors(score: TaskScore, task: Task, kind: str) -> TableText:
    """Errors beside the paper's."""
    paper = task.paper.get(kind)
    return TableText(
        f"{task.name}: squared error of rollouts, mean ± standard deviation over trajectories",
        ("error", "symoden", "the paper"),
        [(name, _spread(getattr(score, name)), _spread(getattr(paper, name)) if paper else "-") for name in _ERRORS],
    )


def _recordings(recordings: Sequence[RecordingScore], units: Sequence[str], names: Sequence[str]) -> TableText:
    """Errors of every recording; of a few coordinates also each one's."""
    lengths = ["lengths in m, or as they were logged without `units`"] if "" in units else ["m"] * ("m" in units)
    measured = ", ".join([*["rad"] * ("rad" in units), *lengths])
    length = _length(recordings) if recordings else ""
    each = [f"{length}, {name}" for name in names] if 1 < len(names) <= _FEW else []
    worst = [f"{length}, worst"] if len(names) > _FEW else []
    apart = bool(each) and len(set(units)) > 1  # Lengths and angles have no common unit.
    whole = [f"whole, {name}" for name in names] if apart else ["whole"]
    short = any(math.isnan(r.motion) for r in recordings)
    return TableText(
        f"position RMSE [{measured}]: over windows of {length}, beside how far positions move in these, and of one "
        "rollout over the whole recording"
        + ("; of each coordinate the median over the windows" if each else "")
        + ("; of the coordinates that are worst the median over the windows" if worst else "")
        + ("; -: the recording is shorter than a window" if short else ""),
        (
            *("recording", "split", "samples", "windows", f"{length} median", f"{length} mean", "moves"),
            *(*each, *worst, *whole),
        ),
        [
            (
                *(r.name, r.split, r.samples, r.windows, r.window_rmse.median, r.window_rmse.mean, r.motion),
                *r.coordinates[: len(each)],
                *([_worst(r.coordinates, names)] if worst else []),
                *(r.rollout_coordinates if apart else [r.rollout_rmse]),
            )
            for r in recordings
        ],
    )


def _worst(errors: Sequence[float], names: Sequence[str]) -> str:
    """The coordinates with the largest errors, with these."""
    if any(map(math.isnan, errors)):
        return "-"
    largest = sorted(zip(errors, names, strict=True), reverse=True)[:_WORST]
    return ", ".join(f"{name} {number(error)}" for error, name in largest)


def _spread(error: MeanStd) -> str:
    """Mean and standard deviation."""
    return f"{number(error.mean)} ± {number(error.std)}"

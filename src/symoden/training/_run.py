"""Going through the stages of training, to the end or until time is over."""

import math
from collections.abc import Sequence

from ._config import Span
from ._disturbances import Screening
from ._journal import Journal
from ._stages import AbstractStage, Clock, OutOfTime, names_of, never
from ._state import Findings, TrainingState
from ._stopwatch import Progress, Stopwatch


def run(
    stages: Sequence[AbstractStage],
    state: TrainingState,
    journal: Journal,
    *,
    resume: bool,
    watch: Stopwatch,
    screening: Screening | None = None,
) -> tuple[TrainingState, Findings, tuple[Span, ...]]:
    """Go through the stages.

    Args:
        stages: What to do, in order.
        state: State before the first of them.
        journal: Where to keep it.
        resume: Start from the journal's checkpoint, if there is one.
        watch: Hears of every stride and tells when the run is to end; learns what was spent before.
        screening: What looks for disturbances by the way, if anything.

    Returns:
        The last state; how it ended and the verdicts on stages, those before a resumption too; and all spans to leave
        out, if the screening has found more of them, at which it ends.
    """
    findings, lines = Findings.none(), []
    if resume:
        state, findings, lines, watch.spent = journal.read(stages, state)
    elif stages:
        state = stages[0].start(state)
    is_over: Clock = never  # The first stride ends, or a stride that takes longer than the limit would never.
    while state.stage < len(stages):
        stage = stages[state.stage]
        try:
            state, report = stage.advance(state, is_over)
            after, disturbed = _gone_on(stages, state, screening, is_over) if report.finished else (state, ())
        except OutOfTime:  # Also while it looked for disturbances: a run that goes on takes the last stride again.
            return *_cut_short(stages, state, findings, watch), ()
        is_over, seconds = watch.is_up, watch.seconds
        done = stage.name, state.step, stage.steps, report.loss, report.validation, seconds
        now = Progress(*done, report.outcome, "" if report.verdict is None else str(report.verdict))
        lines.append({key: _json(value) for key, value in now._asdict().items()})
        findings = findings.told(stage.name, report.verdict)
        if report.finished:
            # Why a stage was skipped says nothing of the training, nor does one that only asks.
            findings = findings._replace(outcome=report.outcome) if state.step and report.outcome else findings
        state = after
        if not disturbed:  # Else a run that goes on finds it again.
            journal.write(stages, state, findings, lines, seconds=seconds)
        if now.step or now.verdict:  # Else the stage had nothing to do, nor to be judged by.
            watch.report(now)
        over = watch.is_over()
        if disturbed:  # Where the time is over, too: a first stride without these spans is what a run goes on with.
            return state, findings, disturbed
        if over and state.stage < len(stages):
            return *_cut_short(stages, state, findings, watch), ()
    return state, findings, ()


def _gone_on(
    stages: Sequence[AbstractStage], state: TrainingState, screening: Screening | None, is_over: Clock
) -> tuple[TrainingState, tuple[Span, ...]]:
    """State after a stage that has ended, and all spans to leave out, if there are more than before."""
    after = _next(stages, state)
    return after, () if screening is None else screening.after(state.stage, after, is_over)


def _cut_short(
    stages: Sequence[AbstractStage], state: TrainingState, findings: Findings, watch: Stopwatch
) -> tuple[TrainingState, Findings]:
    """The state with what came so far of the stage that was cut short, and what is to be said of it."""
    left = stages[state.stage :]
    state, verdict = left[0].settled(state)
    cut_short = None if verdict is None else verdict._replace(cut_short=True)
    outcome = watch.outcome(names_of(left), len(stages) - len(left))
    return state, findings.told(left[0].name, cut_short)._replace(outcome=outcome)


def _next(stages: Sequence[AbstractStage], state: TrainingState) -> TrainingState:
    """State at the start of the next stage that has something to do."""
    for stage in range(state.stage + 1, len(stages)):
        after = state._replace(stage=stage)
        if stages[stage].applies(after):
            return stages[stage].start(after)
    return state._replace(stage=len(stages))


def _json(value: str | int | float | None) -> str | int | float | None:
    """What JSON can express: no NaN, no infinity."""
    return None if isinstance(value, float) and not math.isfinite(value) else value

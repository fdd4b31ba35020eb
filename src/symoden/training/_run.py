"""Going through the stages of training: reports, checkpoints, the time limit."""

import itertools
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NamedTuple

from symoden.storage import StorageError, write_atomically
from symoden.wording import first_few, number

from ._checkpoint import load_checkpoint, read_left_out, read_progress, save_checkpoint
from ._config import Span
from ._disturbances import Screening
from ._stages import AbstractStage, Clock, OutOfTime, never
from ._state import Findings, TrainingState

CHECKPOINTS: Final = "checkpoints"
"""Folder of the checkpoint in the folder of a run."""
MODEL: Final = "model.safetensors"
"""File of the model in the folder of a run."""
ENSEMBLE: Final = "ensemble.safetensors"
"""File of the members in the folder of a run."""
POSTERIOR: Final = "posterior.safetensors"
"""File of what the data leave open, in the folder of a run."""
_NAMED: Final = 3  # Stages to come that are named; there may be twenty.


class Progress(NamedTuple):
    """How far training is; its string says it in a line.

    Attributes:
        stage: Name of the stage.
        step: Steps done in it.
        steps: Its largest number of steps.
        loss: Training loss.
        validation: Validation loss; None without validation data.
        seconds: Time spent [s], earlier runs included.
        outcome: At the end of a stage: why it ended, in words.
        verdict: At the end of a stage that has to gain something: whether it is kept or was skipped, in words.
    """

    stage: str
    step: int
    steps: int
    loss: float
    validation: float | None
    seconds: float
    outcome: str = ""
    verdict: str = ""

    def __str__(self) -> str:
        """In a line."""
        return f"{self.stage} {self.step}/{self.steps}  {self.losses}  {self.seconds:.0f} s"

    @property
    def losses(self) -> str:
        """Losses, and what came of the stage, in words."""
        validation = "" if self.validation is None else f"  validation {number(self.validation)}"
        verdict = f"  {self.verdict}" if self.verdict else ""
        return f"loss {number(self.loss)}{validation}{verdict}"


def ignore(progress: Progress) -> None:
    """Report nothing."""
    del progress


class Stopwatch:
    """Time spent on training, that of earlier runs included, and what ends this run early: a limit, or who follows."""

    def __init__(self, max_minutes: float | None, progress: Callable[[Progress], object] = ignore) -> None:
        """Start it.

        Args:
            max_minutes: Largest time from now on, if any.
            progress: Called with every report; where it raises `StopIteration`, the run ends.

        Raises:
            ValueError: If the time is not positive.
        """
        if max_minutes is not None and not max_minutes > 0:
            raise ValueError(f"`max_minutes` must be positive; got {max_minutes}. None is no limit.")
        self._progress = progress
        self._asked = False
        self.spent = 0.0  # In earlier runs [s].
        self._started = time.monotonic()
        self._limit = math.inf if max_minutes is None else max_minutes
        self._ends = [0.0]  # Of the steps so far [s].

    @property
    def seconds(self) -> float:
        """Time spent [s]."""
        return self.spent + time.monotonic() - self._started

    def report(self, now: Progress) -> None:
        """Say how far training is, and hear whether that will do.

        Args:
            now: How far it is.
        """
        try:
            self._progress(now)
        except StopIteration:  # As SciPy's callbacks do; what is returned may be anything, as of a progress bar.
            self._asked = True

    def is_up(self) -> bool:
        """Whether the run is to end now."""
        return self._asked or time.monotonic() - self._started >= 60 * self._limit

    def is_over(self) -> bool:
        """Whether the run is to end, or the time would be up before another step has ended; to be asked after each one.

        Returns:
            Whether it is so. Of the last two steps the shorter one tells: what compiles first takes long once.
        """
        now = time.monotonic() - self._started
        self._ends = [*self._ends[-2:], now]
        steps = [end - start for start, end in itertools.pairwise(self._ends)]
        return self._asked or now + (min(steps) if len(steps) > 1 else 0.0) >= 60 * self._limit

    def outcome(self, left: Sequence[str], gone: int = 0) -> str:
        """How training ended when it is.

        Args:
            left: Names of the stages that have not ended.
            gone: How many have.

        Returns:
            The outcome in words.
        """
        names = first_few(dict.fromkeys(left), _NAMED)
        limit = f"at the time limit of {self._limit:g} minute{'' if self._limit == 1 else 's'}"
        why = "by `progress`" if self._asked else limit
        how_far = f" after {gone} of {gone + len(left)} stages" if gone else ""
        return f"stopped {why}{how_far}, with {names} still to come"


@dataclass(frozen=True, kw_only=True)
class Journal:
    """The files of a run: metrics, checkpoint and ensemble; none at all without a folder.

    Attributes:
        folder: Folder of the run, if any.
        origin: What tells the run's data and settings from others.
        left_out: Spans of the recordings that nothing is learned from.
        rounds: How often disturbances are to be looked for.
    """

    folder: Path | None
    origin: str
    left_out: tuple[Span, ...] = ()
    rounds: int = 0

    @property
    def checkpoint(self) -> Path | None:
        """The latest checkpoint's file, whether it exists or not."""
        return None if self.folder is None else self.folder / CHECKPOINTS / "latest.safetensors"

    @property
    def ensemble(self) -> Path | None:
        """The file of the models that were trained like the model, whether it exists or not."""
        return None if self.folder is None else self.folder / ENSEMBLE

    def going_on(self, given: tuple[Span, ...] | None) -> "Journal":
        """The same with what the checkpoint's training leaves out, if there is a checkpoint.

        Args:
            given: What settings say of that; None for what training has found.

        Returns:
            The journal.

        Raises:
            StorageError: If the checkpoint is damaged, of another version, or leaves out other than is given.
        """
        if self.checkpoint is None or not self.checkpoint.exists():
            return self
        left_out, rounds = read_left_out(self.checkpoint, self.origin, given)
        return replace(self, left_out=left_out, rounds=rounds)

    @property
    def metrics(self) -> Path | None:
        """The file of one JSON object a stride."""
        return None if self.folder is None else self.folder / "metrics.jsonl"

    def read(
        self, stages: Sequence[AbstractStage], state: TrainingState
    ) -> tuple[TrainingState, Findings, list[dict], float]:
        """Go back to the checkpoint.

        Args:
            stages: All stages.
            state: State before the first of them.

        Returns:
            The saved state, what stages have come to, the metrics up to then and the time spent [s]; the fresh start
            without a checkpoint.

        Raises:
            StorageError: If the checkpoint is damaged, or of other data or settings.
        """
        if self.checkpoint is None or not self.checkpoint.exists():
            return stages[0].start(state), Findings.none(), [], 0.0
        stage, seconds, findings = read_progress(self.checkpoint, _names(stages), self.origin)
        like = stages[min(stage, len(stages) - 1)].start(state)
        return load_checkpoint(self.checkpoint, like), findings, self._lines(seconds), seconds

    def _lines(self, seconds: float) -> list[dict]:
        """The metrics up to a time."""
        if self.metrics is None or not self.metrics.exists():
            return []
        try:
            lines = [json.loads(line) for line in self.metrics.read_text().splitlines()]
            return [line for line in lines if line["seconds"] <= seconds]
        except (ValueError, KeyError, TypeError) as error:
            raise StorageError(
                f"`{self.metrics}` must have one JSON object a line; it is damaged: {error}. Remove it: training goes "
                "on from its checkpoint without it."
            ) from None

    def write(
        self,
        stages: Sequence[AbstractStage],
        state: TrainingState,
        findings: Findings,
        lines: Sequence[dict],
        *,
        seconds: float,
    ) -> None:
        """Save the metrics, then the state that they lead to.

        Args:
            stages: All stages.
            state: State of training.
            findings: What the stages so far have come to.
            lines: All metrics so far.
            seconds: Time spent [s].

        Raises:
            StorageError: If the files cannot be written; those before are then unchanged.
        """
        if self.checkpoint is None or self.metrics is None:
            return
        write_atomically(self.metrics, "".join(json.dumps(line) + "\n" for line in lines).encode())
        save_checkpoint(
            self.checkpoint,
            state,
            findings,
            stages=_names(stages),
            origin=self.origin,
            left_out=(self.left_out, self.rounds),
            seconds=seconds,
        )


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
            # Why a stage was skipped says nothing of the training.
            findings = findings._replace(outcome=report.outcome) if state.step else findings
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
    outcome = watch.outcome(_names(left), len(stages) - len(left))
    return state, findings.told(left[0].name, cut_short)._replace(outcome=outcome)


def _names(stages: Sequence[AbstractStage]) -> list[str]:
    """What reports call them."""
    return [stage.name for stage in stages]


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

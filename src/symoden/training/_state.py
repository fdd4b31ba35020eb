"""What training remembers from step to step, and what it says of each."""

from typing import NamedTuple

from jaxtyping import PyTree

from symoden.mechanics import AbstractDynamics

from ._lateness import Lateness
from ._verdicts import Skipped, Verdict
from ._weighing import Weighing


class Incumbent(NamedTuple):
    """What a stage has to improve on.

    Attributes:
        model: The best model before.
        memory: What was remembered then.
        origin: Index of the stage that it came from.
        weighing: What errors counted in that stage.
        rival: What the stage is compared with: that model, or what it becomes by the recordings of this stage alone.
    """

    model: AbstractDynamics
    memory: PyTree
    origin: int
    weighing: Weighing
    rival: AbstractDynamics


class TrainingState(NamedTuple):
    """All that a resumed training needs; a PyTree.

    Attributes:
        stage: Index of the stage in progress.
        step: Steps done in this stage.
        model: The model now.
        memory: What the stage remembers from step to step: Adam's moments, learned priors, or None.
        damping: Levenberg-Marquardt's damping.
        substeps: RK4 steps in each sampling interval in Levenberg-Marquardt.
        weighing: What errors count.
        best: The best model, by its validation loss.
        best_loss: That loss.
        origin: Index of the stage that the best model came from.
        stale: Steps without a gain; while priors are learned, those that changed nothing.
        incumbent: What this stage has to improve on.
    """

    stage: int
    step: int
    model: AbstractDynamics
    memory: PyTree
    damping: float
    substeps: int
    weighing: Weighing
    best: AbstractDynamics
    best_loss: float
    origin: int
    stale: int
    incumbent: Incumbent


class Report(NamedTuple):
    """What a stride did.

    Attributes:
        loss: Training loss.
        validation: Validation loss; None without validation data.
        finished: Whether the stage is over.
        outcome: Why, in words; empty while it goes on.
        verdict: Whether what came of it is kept, and by what, that it was skipped, or what was found; None while it
            goes on, and where nothing else than the loss was asked.
    """

    loss: float
    validation: float | None
    finished: bool
    outcome: str = ""
    verdict: Verdict | Skipped | Lateness | None = None


class Findings(NamedTuple):
    """What stages have come to.

    Attributes:
        outcome: Why the last one ended that took a step, in words.
        verdicts: For every stage that had to gain something whether it is kept, and by what, in words.
        hardly_judged: Those of them that so few windows refused that these hardly tell.
        advice: What to say to the user of late inputs; empty where there are none.
    """

    outcome: str
    verdicts: dict[str, str]
    hardly_judged: tuple[str, ...]
    advice: str = ""

    @classmethod
    def none(cls) -> "Findings":
        """What is known before the first one."""
        return cls("all steps taken", {}, ())

    def told(self, stage: str, verdict: Verdict | Skipped | Lateness | None) -> "Findings":
        """The same with another verdict, if there is one.

        Args:
            stage: Name of the stage.
            verdict: The verdict on it.

        Returns:
            What is known then.
        """
        if verdict is None:
            return self
        hardly = (*self.hardly_judged, stage) if verdict.hardly else self.hardly_judged
        advice = verdict.advice if isinstance(verdict, Lateness) and verdict.found else self.advice
        return self._replace(verdicts=self.verdicts | {stage: str(verdict)}, hardly_judged=hardly, advice=advice)

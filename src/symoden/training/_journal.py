"""The files of a run: what is kept along training, and read when it goes on."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from symoden.storage import StorageError, write_atomically

from ._checkpoint import load_checkpoint, read_left_out, read_progress, save_checkpoint
from ._config import Span
from ._stages import AbstractStage, names_of
from ._state import Findings, TrainingState

CHECKPOINTS: Final = "checkpoints"
"""Folder of the checkpoint in the folder of a run."""
MODEL: Final = "model.safetensors"
"""File of the model in the folder of a run."""
ENSEMBLE: Final = "ensemble.safetensors"
"""File of the members in the folder of a run."""
POSTERIOR: Final = "posterior.safetensors"
"""File of what the data leave open, in the folder of a run."""


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
        stage, seconds, findings = read_progress(self.checkpoint, names_of(stages), self.origin)
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
            stages=names_of(stages),
            origin=self.origin,
            left_out=(self.left_out, self.rounds),
            seconds=seconds,
        )

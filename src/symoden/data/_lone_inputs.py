"""Single samples of inputs far beyond all others: impulses that the machine was given, or wrong numbers."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from symoden.wording import stamp

from ._answers import law_of, shares_answered
from ._bridges import bridge
from ._description import Description
from ._errors import DataError
from ._examine import stands_still
from ._facts import Facts
from ._findings import SHOWN_SPANS, Finding, Level
from ._logs import Log
from ._masking import Mask
from ._recordings import recordings_of
from ._spikes import lone_samples
from ._trajectory import Trajectory

_BEYOND, _FEW = 1.5, 0.01  # ranges of the others, from their median; share of the samples
_NOTHING: Final = 1e-6  # of a range: errors of floats
_WRONG, _GIVEN = 0.2, 0.5  # Of what a sample would do, that the motion shows at most, or at least.


class Lone(NamedTuple):
    """Single samples of an input that are far beyond all others.

    Attributes:
        column: Which input.
        rows: Their rows of the log.
        ts: Their times [s].
        off: How far each is from what its neighbours say.
        others: Range of the others.
        answered: Share of what each would do that is in the motion; NaN where that cannot be told.
    """

    column: int
    rows: Int[np.ndarray, " k"]
    ts: Float[np.ndarray, " k"]
    off: Float[np.ndarray, " k"]
    others: float
    answered: Float[np.ndarray, " k"]

    @property
    def wrong(self) -> "Lone":
        """Those that the machine was not given."""
        return self._only(self.answered <= _WRONG)

    @property
    def given(self) -> "Lone":
        """Those that it was given."""
        return self._only(self.answered >= _GIVEN)

    @property
    def unknown(self) -> "Lone":
        """The others."""
        return self._only(~((self.answered <= _WRONG) | (self.answered >= _GIVEN)))

    def _only(self, which: Bool[np.ndarray, " k"]) -> "Lone":
        """Some of them."""
        return self._replace(
            rows=self.rows[which], ts=self.ts[which], off=self.off[which], answered=self.answered[which]
        )


def lone_inputs(facts: Facts | None) -> tuple[Lone, ...]:
    """Find single samples of inputs far beyond all others: a command may be an impulse.

    Args:
        facts: What was measured of the rows of a log that are used; None where there are too few.

    Returns:
        Those of each input that has any.
    """
    if facts is None or stands_still(facts.channels):
        return ()
    found = []
    for j, signal in enumerate(facts.us.T):
        alone, off = lone_samples(facts.ts, signal, "inputs")
        others = np.delete(signal, alone)
        alone = alone[np.abs(signal[alone] - np.median(others)) > _BEYOND * np.ptp(others)]
        if 0 < len(alone) <= _FEW * len(signal) and np.ptp(others) > _NOTHING * np.ptp(signal):
            unknown = np.full(len(alone), np.nan)
            found.append(Lone(j, facts.rows[alone], facts.ts[alone], off[alone], float(np.ptp(others)), unknown))
    return tuple(found)


def ask_motion(
    logs: Sequence[Log],
    rows: Sequence[Mask | DataError],
    lone: Sequence[tuple[Lone, ...]],
    description: Description,
    is_angle: Bool[np.ndarray, " n"],
) -> list[tuple[Lone, ...]]:
    """Ask whether the machine moved as single samples of its inputs would move it.

    Accelerations under bumps are regressed over all training recordings without these samples. What that leaves around
    a sample is what the sample did: nothing if it is wrong.

    Args:
        logs: What was logged.
        rows: Their rows that are used, or why none are.
        lone: Single samples of the inputs of each.
        description: What it means.
        is_angle: Whether each coordinate is an angle.

    Returns:
        The same samples with the answers.
    """
    if description.momenta is not None or not any(lone):
        return list(lone)
    held, delays = description.hold == "zero", np.broadcast_to(description.input_delay, logs[0].us.shape[1])
    made = partial(_recordings, description=description, is_angle=is_angle)
    clean = [made(_without(log, each, description), chosen) for log, chosen, each in zip(logs, rows, lone, strict=True)]
    decides = "train" if any(log.part == "train" for log in logs) else "test"
    asked = [
        (recording, np.concatenate([np.zeros(0), *(each.ts + delays[each.column] for each in every)]))
        for log, recordings, every in zip(logs, clean, lone, strict=True)
        for recording in (recordings if log.part == decides else ())
    ]
    law = law_of([each for each, _ in asked], [times for _, times in asked], is_angle, held=held) if asked else None
    if law is None:
        return list(lone)

    def answered(each: Lone, pairs: Sequence[tuple[Trajectory, Trajectory]]) -> Lone:
        times, shares = each.ts + delays[each.column], np.full(len(each.ts), np.nan)
        for without, with_ in pairs:
            if len(without) > law.size and (within := (times >= without.ts[0]) & (times <= without.ts[-1])).any():
                shares[within] = shares_answered(law, without, with_, times[within], is_angle, held=held)
        return each._replace(answered=shares)

    both = [
        list(zip(recordings, made(log, chosen), strict=True)) if every else []
        for log, chosen, recordings, every in zip(logs, rows, clean, lone, strict=True)
    ]
    return [tuple(answered(each, pairs) for each in every) for every, pairs in zip(lone, both, strict=True)]


def without_wrong(log: Log, lone: Sequence[Lone], description: Description) -> Log:
    """Bridge those samples of inputs that the machine was not given.

    Args:
        log: What was logged.
        lone: Its single samples, of which the motion was asked.
        description: What it means.

    Returns:
        The log with other numbers in their place; the same log where none is wrong.
    """
    return _without(log, [each.wrong for each in lone], description)


def find_lone_inputs(log: Log, lone: Sequence[Lone]) -> list[Finding]:
    """Say which single samples of inputs are far beyond all others, and what the motion says of them.

    Args:
        log: What was logged, those that are wrong bridged.
        lone: Its single samples, of which the motion was asked.

    Returns:
        The findings.
    """
    return [finding for each in lone for finding in _findings(log, each)]


def _findings(log: Log, lone: Lone) -> Iterator[Finding]:
    """What to say of those of one input that are wrong, that were given, and of the others."""
    name = log.names["inputs"][lone.column]
    wrong, given, unknown = lone.wrong, lone.given, lone.unknown
    if len(wrong.rows):
        how = next(each.how for each in log.bridges if each.wrong and each.channel == name)
        yield _finding(
            name,
            wrong,
            "masked",
            f"of what such inputs do the motion shows {wrong.answered.max():.0%} at most: wrong numbers, or "
            "commands that the drive did not follow",
            f"The rows are used: this input is {how} there. Look at the sensor or the bus.",
        )
    if len(given.rows):
        yield _finding(
            name,
            given,
            "note",
            f"of what such inputs do the motion shows {given.answered.min():.0%} at least: impulses that the machine "
            "was given",
            "Nothing need be done: they are kept.",
        )
    if len(unknown.rows):
        yield _finding(
            name,
            unknown,
            "warning",
            "the motion does not tell whether they are impulses",
            "Nothing need be done if these are impulses that the machine was given. If they are errors of a sensor or "
            "a bus, empty these cells, which are bridged then: the model may be far off else.",
        )


def _finding(name: str, some: Lone, level: Level, said: str, advice: str) -> Finding:
    """What to say of some single samples of an input."""
    count = f"{len(some.rows)} single samples" if len(some.rows) > 1 else "one sample"
    return Finding(
        kind="spike",
        level=level,
        channel=name,
        text=f"`{name}` has {count} far beyond all others, first at {stamp(float(some.ts[0]))} s, by up to "
        f"{np.abs(some.off).max():.3g} where the others range over {some.others:.3g}; {said}",
        advice=advice,
        spans=tuple((float(time), float(time)) for time in some.ts[:SHOWN_SPANS]),
    )


def _without(log: Log, lone: Sequence[Lone], description: Description) -> Log:
    """A log with other numbers in place of single samples of its inputs."""
    wrong = np.zeros(log.us.shape, bool)
    for each in lone:
        wrong[each.rows, each.column] = True
    return bridge(log, description, wrong)


def _recordings(
    log: Log, chosen: Mask | DataError, *, description: Description, is_angle: Bool[np.ndarray, " n"]
) -> tuple[Trajectory, ...]:
    """The recordings of a log; none where none can be made."""
    if isinstance(chosen, DataError):
        return ()
    try:
        return recordings_of(log, chosen, description, is_angle)
    except DataError:
        return ()

"""Samples of inputs far beyond all others, a few in a row: impulses that the machine was given, or wrong numbers."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from symoden.data._errors import DataError
from symoden.data._findings import SHOWN_SPANS, Finding, Level
from symoden.data._trajectory import Trajectory
from symoden.data.description import Description
from symoden.data.dynamics import law_of, shares_answered
from symoden.data.logs import Facts, Log, Mask, bridge, recordings_of
from symoden.wording import stamp

from ._examine import stands_still

_BEYOND: Final = 1.5  # Ranges of the others, from their median.
_LONGEST, _FEW = 3, 0.01  # Samples in a row; such runs, as a share of all samples.
_NOTHING: Final = 1e-6  # of a range: errors of floats
_WRONG, _GIVEN = 0.2, 0.5  # Of what a sample would do, that the motion shows at most, or at least.


class Lone(NamedTuple):
    """Samples of an input that are far beyond all others, a few in a row.

    Attributes:
        column: Which input.
        rows: Their rows of the log.
        runs: Number of the run that each is of, from 0 on.
        ts: Their times [s].
        off: How far each is beyond the nearest of the others.
        others: Range of the others.
        answered: Share of what the run of each would do that is in the motion; NaN where that cannot be told.
    """

    column: int
    rows: Int[np.ndarray, " k"]
    runs: Int[np.ndarray, " k"]
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
        each = ("rows", "runs", "ts", "off", "answered")
        return self._replace(**{name: getattr(self, name)[which] for name in each})


def lone_inputs(facts: Facts | None) -> tuple[Lone, ...]:
    """Find samples of inputs far beyond all others, up to three in a row: a command may be an impulse.

    Neighbours do not count, so that the ends of a recording and those of gaps are as good a place as any.

    Args:
        facts: What was measured of the rows of a log that are used; None where there are too few.

    Returns:
        Those of each input that has any.
    """
    if facts is None or stands_still(facts.channels):
        return ()
    found = []
    for j, signal in enumerate(facts.us.T):
        off = np.abs(signal - np.median(signal))
        usual = signal[off <= np.quantile(off, 1 - _LONGEST * _FEW)]
        runs = [run for run in _runs(facts, np.flatnonzero(_is_far(signal, usual))) if len(run) <= _LONGEST]
        lone = np.concatenate([np.zeros(0, int), *runs])
        others = np.delete(signal, lone)
        runs = _runs(facts, lone[_is_far(signal[lone], others)])  # Beyond longer pulses, too.
        if 0 < len(runs) <= _FEW * len(signal) and np.ptp(others) > _NOTHING * np.ptp(signal):
            found.append(_lone(facts, j, runs, others))
    return tuple(found)


def _is_far(signal: Float[np.ndarray, " T"], others: Float[np.ndarray, " k"]) -> Bool[np.ndarray, " T"]:
    """Which samples are far beyond others."""
    return np.asarray(np.abs(signal - np.median(others)) > _BEYOND * np.ptp(others))


def _runs(facts: Facts, samples: Int[np.ndarray, " k"]) -> list[Int[np.ndarray, " r"]]:
    """Samples one after another, without a gap."""
    apart = (np.diff(samples) > 1) | (np.diff(facts.ts[samples]) > facts.longest)
    return [run for run in np.split(samples, np.flatnonzero(apart) + 1) if len(run)]


def _lone(facts: Facts, column: int, runs: Sequence[Int[np.ndarray, " r"]], others: Float[np.ndarray, " o"]) -> Lone:
    """Runs of samples of an input as they are, before the motion is asked."""
    lone = np.concatenate(runs)
    signal = facts.us[lone, column]
    return Lone(
        column=column,
        rows=facts.rows[lone],
        runs=np.repeat(np.arange(len(runs)), [len(run) for run in runs]),
        ts=facts.ts[lone],
        off=np.maximum(signal - others.max(), others.min() - signal),
        others=float(np.ptp(others)),
        answered=np.full(len(lone), np.nan),
    )


def ask_motion(
    logs: Sequence[Log],
    rows: Sequence[Mask | DataError],
    lone: Sequence[tuple[Lone, ...]],
    description: Description,
    is_angle: Bool[np.ndarray, " n"],
) -> list[tuple[Lone, ...]]:
    """Ask whether the machine moved as samples of its inputs far beyond all others would move it.

    Accelerations under bumps are regressed over all training recordings without these samples. What that leaves around
    some in a row is what these did: nothing if they are wrong.

    Args:
        logs: What was logged.
        rows: Their rows that are used, or why none are.
        lone: Samples of the inputs of each that are far beyond all others.
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
        firsts = np.unique(each.runs, return_index=True)[1]
        times, shares = each.ts[firsts] + delays[each.column], np.full(len(firsts), np.nan)
        lasts = each.ts[np.append(firsts[1:], len(each.ts)) - 1] + delays[each.column]
        for without, with_ in pairs:
            # Of the first step nothing is under a bump.
            within = (lasts > without.ts[:2].mean()) & (times <= without.ts[-1])
            if len(without) > law.size and within.any():
                shares[within] = shares_answered(law, without, with_, times[within], is_angle, held=held)
                # What would come later than the recording ends was not seen, and is not missing.
                shares[within & (times > without.ts[-1] - law.reach) & (shares < _GIVEN)] = np.nan
        return each._replace(answered=shares[each.runs])

    both = [
        list(zip(recordings, made(log, chosen), strict=True)) if every else []
        for log, chosen, recordings, every in zip(logs, rows, clean, lone, strict=True)
    ]
    return [tuple(answered(each, pairs) for each in every) for every, pairs in zip(lone, both, strict=True)]


def without_wrong(log: Log, lone: Sequence[Lone], description: Description) -> Log:
    """Bridge those samples of inputs that the machine was not given.

    Args:
        log: What was logged.
        lone: Its samples far beyond all others, of which the motion was asked.
        description: What it means.

    Returns:
        The log with other numbers in their place; the same log where none is wrong.
    """
    return _without(log, [each.wrong for each in lone], description)


def find_lone_inputs(log: Log, lone: Sequence[Lone]) -> list[Finding]:
    """Say which samples of inputs are far beyond all others, and what the motion says of them.

    Args:
        log: What was logged, those that are wrong bridged.
        lone: These samples, of which the motion was asked.

    Returns:
        The findings.
    """
    return [finding for each in lone for finding in _findings(log, each)]


def _findings(log: Log, lone: Lone) -> Iterator[Finding]:
    """What to say of those of one input that are wrong, that were given, and of the others."""
    name = log.names["inputs"][lone.column]
    wrong, given, unknown = lone.wrong, lone.given, lone.unknown
    if len(wrong.rows):
        how = " or ".join(dict.fromkeys(each.how for each in log.bridges if each.wrong and each.channel == name))
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
            "a bus, empty these cells, which are bridged or left out then: the model may be far off else.",
        )


def _finding(name: str, some: Lone, level: Level, said: str, advice: str) -> Finding:
    """What to say of some samples of an input."""
    return Finding(
        kind="spike",
        level=level,
        channel=name,
        text=f"`{name}` has {_counted(some)} far beyond all others, first at {stamp(float(some.ts[0]))} s, by up to "
        f"{np.abs(some.off).max():.3g} where the others range over {some.others:.3g}; {said}",
        advice=advice,
        spans=tuple((float(time), float(time)) for time in some.ts[:SHOWN_SPANS]),
    )


def _counted(some: Lone) -> str:
    """How many samples there are, and whether some are in a row."""
    count, longest = len(some.rows), int(np.unique(some.runs, return_counts=True)[1].max())
    if longest == 1:
        return f"{count} single samples" if count > 1 else "one sample"
    return f"{count} samples in a row" if longest == count else f"{count} samples, up to {longest} in a row,"


def _without(log: Log, lone: Sequence[Lone], description: Description) -> Log:
    """A log with other numbers in place of some samples of its inputs."""
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

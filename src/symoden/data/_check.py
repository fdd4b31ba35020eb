"""Checking a data set: what was read, and what is wrong with it."""

import dataclasses
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from ._dataset_check import DatasetCheck, RecordingCheck
from ._errors import DataError
from ._findings import SHOWN_SPANS, Finding, refusal
from ._read_dataset import assemble, with_full_names
from ._trainable import check_trainable
from ._trajectory import ROUNDED, Trajectory
from .checks import (
    Examination,
    find_absent,
    find_fast_sampling,
    find_finer_sampling,
    find_masked,
    find_merged,
    find_short,
    find_slow_sampling,
    find_tied_positions,
    find_unread_inputs,
    find_untold_inputs,
    is_idle,
    stands_still,
    survey,
)
from .description import Description, read_description
from .dynamics import find_doubts
from .files import Table
from .logs import (
    ChannelFacts,
    Log,
    Mask,
    Reading,
    angles,
    find_arrivals,
    find_copies,
    find_counted_zeros,
    find_ended,
    find_other_clocks,
    find_polled,
    find_uneven,
    find_wraps,
    read_all,
    recordings_of,
)
from .signals import AGREES

_ENDS = 2  # First and last rows of a recording, in which inputs are switched on and off.
_FEW_CLOCKS = 8  # Times that one is set back; rows in another order are off more often.
_MANY_LATE = 0.1  # Share of time stamps that do not increase.


def check_dataset(
    description: Path | str | Mapping[str, object],
    *,
    space: str | None = None,
    tables: Mapping[str, Table] | None = None,
) -> DatasetCheck:
    """Read the files of a description, and look for what can be wrong with logs.

    Rows without numbers, gaps, time stamps that do not increase, sensors that stand still, wrong units, signs and
    columns, jumps and wraps of angles, inputs that are cut off, rounding, noise, joints and inputs that do
    nothing, and copied files.

    Args:
        description: The description's file, or a mapping of its keys.
        space: Configuration space to take instead of the description's.
        tables: Tables in memory, by the names that the description gives as `files` (see `read_dataset`).

    Returns:
        What was found; whatever else `read_dataset` refuses is a finding here, and a file that cannot be read is named.

    Raises:
        DataError: If the description is not what it must be.

    Example:
        >>> check = check_dataset("arm.toml")  # doctest: +SKIP
        >>> [finding.text for finding in check.recordings[0].findings]  # doctest: +SKIP
        ['`pos_meas1` does not change at all from 3.2 to 5.1 s while the machine moves: a stuck sensor?']
    """
    said = read_description(description, space=space, tables=tables)
    is_angle = angles(said)
    reading = read_all(said, is_angle)
    used, rows, examinations, replaced = survey(reading.logs, said, is_angle)
    made = [_made(log, chosen, said, is_angle) for log, chosen in zip(used, rows, strict=True)]
    checks = tuple(
        dataclasses.replace(_check(log, recordings, outcome, examination, is_angle), log=logged)
        for logged, log, (recordings, outcome), examination in zip(reading.logs, used, made, examinations, strict=True)
    )
    checks = tuple(_advised(check, checks) for check in checks)
    checks = tuple(
        dataclasses.replace(check, findings=(*clocks, *check.findings))
        for check, clocks in zip(checks, find_other_clocks(reading.logs, said), strict=True)
    )
    cyclic = () if said.known is None else said.known.cyclic
    together = [
        *map(refusal, reading.refusals),
        *([] if reading.refusals else find_ended(said, reading.logs)),
        *([replaced] if replaced else []),
        *_idle_everywhere(checks),
        *find_unread_inputs(reading.logs),
        *find_counted_zeros(reading.logs, [check.channels for check in checks], cyclic=cyclic),
        *_together(said, reading, made, is_angle),
    ]
    return DatasetCheck(description=said, recordings=checks, findings=tuple(together), unreadable=reading.unreadable)


def _made(
    log: Log, chosen: Mask | DataError, description: Description, is_angle: np.ndarray
) -> tuple[tuple[Trajectory, ...], Mask | DataError]:
    """The recordings of a log with what was left out, or why it has none."""
    if isinstance(chosen, DataError):
        return (), chosen
    try:
        return recordings_of(log, chosen, description, is_angle), chosen
    except DataError as error:
        return (), error


def _together(
    description: Description,
    reading: Reading,
    made: Sequence[tuple[tuple[Trajectory, ...], Mask | DataError]],
    is_angle: np.ndarray,
) -> list[Finding]:
    """What keeps the recordings from being a data set, or is worth saying of their lengths, rate and inputs."""
    usable = [(log, each) for log, (each, rows) in zip(reading.logs, made, strict=True) if isinstance(rows, Mask)]
    whole = len(usable) == len(reading.logs) and not reading.unreadable and not reading.refusals
    if not usable:
        return []
    logs, recordings = zip(*usable, strict=True)
    try:
        dataset = assemble(description, logs, recordings)
        check_trainable(dataset)
    except DataError as error:
        return [refusal(error)] if whole else []  # What is true of those that are left need not be of all.
    dataset = with_full_names(dataset, logs)
    doubts = find_doubts(dataset, description, is_angle)
    logged = float(np.median(np.concatenate([np.diff(log.ts[np.isfinite(log.ts)]) for log in logs])))
    slow = find_slow_sampling(dataset, is_angle, resample=description.resample, logged=logged)
    finer = find_finer_sampling(resample=description.resample, logged=logged)
    pace = *finer, *slow, *find_fast_sampling(dataset, is_angle)
    copies = [] if reading.refusals else find_copies(logs)  # Rows in common are no copies, and said already.
    inputs = *doubts.inputs, *find_untold_inputs(dataset), *find_tied_positions(dataset)
    return [*copies, *find_short(dataset, is_angle), *pace, *inputs, *doubts.description, *doubts.files]


def _check(
    log: Log,
    recordings: tuple[Trajectory, ...],
    outcome: Mask | DataError,
    examination: Examination,
    is_angle: np.ndarray,
) -> RecordingCheck:
    """Everything on one log, as far as it is used."""
    known = log.ts[np.isfinite(log.ts)]
    steps = np.diff(known) if len(known) > 1 else np.zeros(1)
    late = _out_of_order(log)
    findings: list[Finding] = list(late)
    if isinstance(outcome, DataError) and not late:
        findings.append(refusal(outcome))
    clocks = [*find_wraps(log), *find_merged(log), *find_polled(log), *find_arrivals(log), *find_uneven(log, is_angle)]
    findings.extend([*clocks, *find_absent(log)])
    if isinstance(outcome, Mask):
        findings.extend(find_masked(log, outcome))
    return RecordingCheck(
        log=log,
        recordings=len(recordings),
        duration=float(np.ptp(known)) if len(known) else 0.0,
        steps=(float(steps.min()), float(np.median(steps)), float(steps.max())),
        missing=int((~log.complete).sum()),
        gaps=outcome.gaps if isinstance(outcome, Mask) else (),
        channels=examination.facts.channels if examination.facts else (),
        # Where rows are of several times in turn, what hardly moves is mixed up with what does, and no rate is right.
        findings=(*findings, *(one for one in examination.findings if not (late and _is_of_rates(one, log)))),
    )


def _out_of_order(log: Log) -> list[Finding]:
    """Time stamps that go back or stand still."""
    rows = np.flatnonzero(np.isfinite(log.ts))
    late = np.flatnonzero(np.diff(log.ts[rows]) <= 0)
    if not late.size:
        return []
    before, after = rows[late], rows[late + 1]
    doubles = int((log.ts[before] == log.ts[after]).sum())
    kinds = ((len(late) - doubles, "go back", "goes back"), (doubles, "stand still", "stands still"))
    what = ", ".join(f"{count} {one if count == 1 else several}" for count, several, one in kinds if count)
    said = "time stamp does" if len(late) == 1 else "time stamps do"
    cuts = [int(row) for row in (log.rows[0], *log.rows[after], log.rows[-1] + 1)]
    pieces = ", ".join(f"[{begin}, {end}]" for begin, end in pairwise(cuts))
    rows = "`rows`" if doubles or len(late) > _FEW_CLOCKS else f"`rows = [{pieces}]`"
    first = f"first at {log.place(int(after[0]))}: {float(log.ts[after[0]])!r} after {float(log.ts[before[0]])!r}"
    return [
        Finding(
            kind="time",
            level="refused",
            channel=log.names["time"][0] if "time" in log.names else "",
            text=f"{len(late)} {said} not increase ({what}), {first}",
            advice="If the file holds several recordings, one after the other, name the column that tells them apart: "
            '`recording = "trial"`. Else sort the rows by time and keep one of each; if a clock was set back, cut the '
            f"file there by {rows}." + (f" {ROUNDED}" if doubles else ""),
            spans=tuple((float(log.ts[b]), float(log.ts[a])) for b, a in zip(before, after, strict=True))[:SHOWN_SPANS],
        )
    ]


def _advised(check: RecordingCheck, every: Sequence[RecordingCheck]) -> RecordingCheck:
    """The same, but `units`, which hold for all files, advised only where no other file is right without them."""
    return dataclasses.replace(
        check,
        findings=tuple(
            dataclasses.replace(finding, advice=f"Other files are right: convert `{check.log.path}`, or leave it out.")
            if finding.kind in {"unit", "sign"}
            and not _agrees(check, finding)
            and any(_agrees(e, finding) for e in every)
            else finding
            for finding in check.findings
        ),
    )


def _agrees(check: RecordingCheck, finding: Finding) -> bool:
    """Whether position and velocity are known to agree in the channel that a finding is about."""
    joints = zip(*(_of_role(check, role) for role in ("position", "velocity")), strict=False)
    return any(
        finding.channel in (q.name, v.name) and v.ratio is not None and abs(v.ratio - 1) < AGREES for q, v in joints
    )


def _of_role(check: RecordingCheck, role: str) -> list[ChannelFacts]:
    """Columns of one role."""
    return [one for one in check.channels if one.role == role]


def _is_of_rates(finding: Finding, log: Log) -> bool:
    """Whether it says of a single joint that it hardly moves, or of its rate where many time stamps are wrong."""
    steps = np.diff(log.ts[np.isfinite(log.ts)])
    idle = finding.kind == "idle" and finding.level == "note"
    return idle or (finding.kind in {"unit", "sign"} and float((steps <= 0).mean()) > _MANY_LATE)


def _idle_everywhere(checks: tuple[RecordingCheck, ...]) -> list[Finding]:
    """Joints and inputs that do nothing in any training recording."""
    seen = [check for check in checks if check.log.part == "train" and check.channels]
    train, logs = [check.channels for check in seen], [check.log for check in seen]
    if all(map(stands_still, train)) or any(_out_of_order(log) for log in logs):
        return []  # Each recording says so; or what moves in one is not known.
    found = []
    for facts in zip(*train, strict=True):
        name = facts[0].name
        if facts[0].role == "position" and all(is_idle(one) for one in facts):
            text, advice = (
                f"`{name}` moves in no training recording: its inertia, friction and energy cannot be learned",
                "Record motions of this joint, or leave it out of the description if it is locked.",
            )
        elif facts[0].role == "input" and (same := _is_constant(name, logs)):
            text, advice = (
                f"`{name}` {same} changes in a training recording: what it does cannot be learned, or told from V",
                "Record motions while this input changes, or leave it out if it is not connected. `input_matrix` alone "
                "does not help: a constant force is part of V, and fixes the scale of nothing.",
            )
        else:
            continue
        found.append(Finding(kind="idle", level="warning", channel=name, text=text, advice=advice))
    return found


def _is_constant(name: str, logs: Sequence[Log]) -> str:
    """Whether an input keeps one value: "never" or, where it has another in some first or last rows, "hardly ever"."""
    inputs = [log.us[log.complete, log.names["inputs"].index(name)] for log in logs]
    if len(np.unique(np.concatenate(inputs))) <= 1:
        return "never"
    within = np.concatenate([each[_ENDS : len(each) - _ENDS] for each in inputs])
    return "hardly ever" if len(np.unique(within)) == 1 else ""

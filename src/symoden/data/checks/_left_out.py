"""What training leaves out of a log, in words: rows that lack numbers, samples that stand out alone, gaps."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np

from symoden.data._findings import SHOWN_SPANS, Finding
from symoden.data.description import key
from symoden.data.files import find_short_lines, is_text, place
from symoden.data.logs import Log, Mask, bridged_rows
from symoden.wording import stamp

_ESTIMATED = " Velocities can be left out: they are then estimated from the positions."


@dataclass(frozen=True, kw_only=True, eq=False)
class _Short:
    """Rows whose lines have too few cells, how many each has, how many there should be, and if the file ends in one."""

    rows: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    cells: Sequence[int] = ()
    named: int = 0
    cut: bool = False


def find_masked(log: Log, mask: Mask) -> list[Finding]:
    """Say which samples stand out alone, lie in a dead spot or are stuck, and where a log is split.

    Args:
        log: What was logged.
        mask: Which of its rows are used.

    Returns:
        The findings.
    """
    return [*_spikes(log, mask), *_blind(log, mask), *_stuck(mask), *_gaps(mask)]


def find_merged(log: Log) -> list[Finding]:
    """Say that a table had several clocks, and what became of its columns, if so.

    Args:
        log: What was logged, brought to one clock.

    Returns:
        The findings, or none.
    """
    if log.merged is None:
        return []
    columns = ", ".join(f"`{name}`" for name in log.merged.columns)
    silences = [
        Finding(
            kind="clocks",
            level="warning",
            channel=each.channel,
            text=f"`{each.channel}` has no number for {each.end - each.start:.3g} s, from {stamp(each.start)} s on, "
            "far longer than usual: it is held meanwhile",
            advice="Nothing need be done if it is sent when it changes; if messages were lost, leave that time out by "
            "`rows`.",
            spans=((each.start, each.end),),
        )
        for each in log.merged.silences
    ]
    return [
        Finding(
            kind="clocks",
            level="note",
            channel=log.merged.columns[0] if len(log.merged.columns) == 1 else "",
            text=f"{columns} and `{log.names['positions'][0]}` have numbers in different rows: {len(log)} of "
            f"{log.merged.rows} are used, those of the latter",
            advice="Nothing need be done: held inputs act as their mean over each step, the others are interpolated. "
            "Where a sensor fails that often, leave its column or the file out.",
        ),
        *silences,
        *(_lone(each.channel, each.samples, each.largest, each.place) for each in log.merged.left),
    ]


def find_absent(log: Log) -> list[Finding]:
    """Name rows that are there twice, columns that lack numbers or have impossible ones, and lines that end too early.

    Args:
        log: What was logged.

    Returns:
        The findings.
    """
    short = _short_lines(log)
    found = [*_repeats(log), *_unfinished(log, short), *_impossible(log)]
    for role, signal in ({"time": log.ts[:, None]} | log.signals).items():
        for i, name in enumerate(log.names.get(role, ())):
            told = [each.rows for each in log.impossible if name in each.columns]
            lacking = np.union1d(np.flatnonzero(np.isnan(signal[:, i])), bridged_rows(log, (name,)))
            rows = np.setdiff1d(lacking, np.concatenate([short.rows, *told]))
            if not len(rows):
                continue
            edges = np.flatnonzero(np.diff(rows) > 1)
            runs = list(zip(rows[np.append(0, edges + 1)], rows[np.append(edges, len(rows) - 1)], strict=True))
            found.append(
                Finding(
                    kind="missing",
                    level="masked",
                    channel=name,
                    text=f"`{name}` lacks {len(rows)} of {len(log)} numbers, in {len(runs)} stretch"
                    f"{'es' if len(runs) > 1 else ''}, first at {log.place(int(rows[0]))}",
                    advice=_done(log, (name,), rows) + (_ESTIMATED if role == "rates" else ""),
                    spans=tuple(_time_of(log, int(first), int(last)) for first, last in runs),
                )
            )
    return found


def _repeats(log: Log) -> list[Finding]:
    """Rows that repeat the one before."""
    if not log.repeats:
        return []
    count = len(log.repeats)
    return [
        Finding(
            kind="time",
            level="masked",
            channel="",
            text=f"{count} row{'s' if count > 1 else ''} repeat{'' if count > 1 else 's'} the one before, time stamp "
            f"and all, first at {place(log.path, log.repeats[0])}",
            advice="These are left out, and nothing need be done: what wrote the file had nothing new, or wrote twice.",
        )
    ]


def _impossible(log: Log) -> list[Finding]:
    """Numbers that no machine has."""
    return [
        Finding(
            kind="impossible",
            level="masked",
            channel=each.channel,
            text=f"`{each.channel}` has {each.counted}, first at {each.place}: {each.first:.10g}",
            advice=f"{'All other numbers are far from it.' if each.placeholder else 'No machine has such numbers.'} "
            f"{_done(log, each.columns, each.rows)} "
            + (
                "If it was measured, convert the file to another unit."
                if each.placeholder
                else "Look for a logger that writes one where it has none, or for a damaged file."
            ),
            spans=tuple(_time_of(log, int(row), int(row)) for row in each.rows[:SHOWN_SPANS]),
        )
        for each in log.impossible
    ]


def _done(log: Log, channels: Collection[str], rows: np.ndarray) -> str:
    """What is done with rows that lack numbers of some columns."""
    count = len(np.intersect1d(rows, bridged_rows(log, channels)))
    how = " or ".join(dict.fromkeys(each.how for each in log.bridges if each.channel in channels and not each.wrong))
    if count == len(rows):
        return f"The rows are used: this input is {how} there."
    split = "left out; where that leaves a gap, the recording is split."
    return (
        f"In {count} of these rows the input is {how}; the others are {split}" if count else f"These rows are {split}"
    )


def _short_lines(log: Log) -> _Short:
    """Rows that lack numbers because their lines have fewer cells than the first line names."""
    incomplete = np.union1d(np.flatnonzero(~log.complete), bridged_rows(log, log.names["inputs"]))
    if not len(incomplete) or not is_text(log.path):
        return _Short()
    named, cells, last = find_short_lines(log.path)
    rows = [int(row) for row in incomplete if log.rows[row] in cells]
    cut = last == int(log.rows[-1])
    return _Short(rows=np.array(rows, int), cells=[cells[int(log.rows[row])] for row in rows], named=named, cut=cut)


def _unfinished(log: Log, short: _Short) -> list[Finding]:
    """Lines that end too early, one finding for all of them, and a file that ends in the middle of one."""
    found = []
    whole = short.rows[:-1] if short.cut else short.rows
    if len(whole):
        first = f"{log.place(int(whole[0]))} has {short.cells[0]} of {short.named} fields"
        others = f", and {len(whole) - 1} more have too few" if len(whole) > 1 else ""
        found.append(
            Finding(
                kind="line",
                level="masked",
                channel="",
                text=first + others,
                advice="What is not there is missing, and so is a last field, which may be cut off, unless many lines "
                f"end in its column. {_done(log, log.names['inputs'], whole)} Look at what wrote the file.",
                spans=tuple(_time_of(log, int(row), int(row)) for row in whole[:SHOWN_SPANS]),
            )
        )
    if short.cut:
        last = len(log) - 1
        found.append(
            Finding(
                kind="missing",
                level="masked",
                channel="",
                text=f"the file ends in the middle of a line, {log.place(last)}",
                advice="The line is left out. If the recording was longer, copy the file again.",
                spans=(_time_of(log, last, last),),
            )
        )
    return found


def _time_of(log: Log, first: int, last: int) -> tuple[float, float]:
    """Times of rows that lack numbers, from the neighbours where the time itself is missing."""
    known = np.flatnonzero(np.isfinite(log.ts))
    if not len(known):
        return 0.0, 0.0
    return float(np.interp(first, known, log.ts[known])), float(np.interp(last, known, log.ts[known]))


def _spikes(log: Log, mask: Mask) -> list[Finding]:
    """Samples that stand out alone."""
    return [
        _lone(
            each.channel,
            len(each.rows),
            each.largest,
            log.place(int(each.rows[0])),
            tuple((float(log.ts[row]), float(log.ts[row])) for row in each.rows[:SHOWN_SPANS]),
        )
        for each in mask.spikes
    ]


def _blind(log: Log, mask: Mask) -> list[Finding]:
    """Rows in dead spots of sensors."""
    found = []
    for spot, rows in mask.blind:
        start, end = spot.interval
        where = f"between {start:.3g} and {end:.3g}"
        if spot.loud is None:
            text = f"`{spot.channel}` is {where} in {len(rows)} of {len(log)} rows, where it is said to be blind"
            advice = "These are left out, as `blind` says."
        else:
            text = (
                f"`{spot.channel}` does not follow the motion {where}: its samples there stand out from their "
                f"neighbours {spot.loud:.2g} times as far as elsewhere, in three of four of {spot.passages} passages "
                f"through all files: a dead spot of the sensor? {len(rows)} of {len(log)} rows"
            )
            advice = (
                "These are left out; potentiometers and magnetic encoders have such spots. If it is the machine, which "
                f"is caught or struck there, `blind = {{ {key(spot.channel)} = [] }}` takes them; else "
                f"`blind = {{ {key(spot.channel)} = [[{start:.6g}, {end:.6g}]] }}` keeps it to these numbers."
            )
        runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
        spans = tuple(_time_of(log, int(run[0]), int(run[-1])) for run in runs[:SHOWN_SPANS])
        found.append(Finding(kind="blind", level="masked", channel=spot.channel, text=text, advice=advice, spans=spans))
    return found


def _stuck(mask: Mask) -> list[Finding]:
    """Positions that stand still while their velocities do not."""
    return [
        Finding(
            kind="stuck",
            level="masked",
            channel=each.channel,
            text=f"{each.describe()}: a stuck sensor, in {len(each.rows)} rows",
            advice="These are left out; where that leaves a gap, the recording is split. Look at the sensor and its "
            "cable.",
            spans=each.spans,
        )
        for each in mask.stuck
    ]


def _lone(channel: str, count: int, largest: float, where: str, spans: tuple[tuple[float, float], ...] = ()) -> Finding:
    """Samples of one column that stand out alone."""
    return Finding(
        kind="spike",
        level="masked",
        channel=channel,
        text=f"`{channel}` has {count} sample{'s' if count > 1 else ''} that {'stand' if count > 1 else 'stands'} out "
        f"alone, by {largest:.3g} at most, first at {where}",
        advice="These are left out. If there are many, look for an encoder that loses counts or a faulty bus.",
        spans=spans,
    )


def _gaps(mask: Mask) -> list[Finding]:
    """Gaps in time at which a log is split."""
    if not mask.gaps:
        return []
    start, end = max(mask.gaps, key=lambda gap: gap[1] - gap[0])
    dropped = (
        f"; pieces of {', '.join(map(str, mask.dropped))} samples are too short and dropped" if mask.dropped else ""
    )
    return [
        Finding(
            kind="gap",
            level="masked",
            channel="",
            text=f"{len(mask.gaps)} gap{'s' if len(mask.gaps) > 1 else ''} in time, the longest {end - start:.3g} s "
            f"from {stamp(start)} to {stamp(end)} s{dropped}",
            advice="Nothing need be done: nothing is made up for a gap, the recording is split there.",
            spans=mask.gaps,
        )
    ]

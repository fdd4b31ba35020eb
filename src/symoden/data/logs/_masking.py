"""Leaving out what is missing: rows without numbers, and gaps in time, at which a recording is split."""

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from symoden.data.description import Impossible
from symoden.data.signals import longest_step
from symoden.wording import stamp

from ._blind import BlindRows
from ._bridges import bridged_rows
from ._logs import Bridge, Log
from ._spikes import Spikes, rows_of
from ._stuck import StuckRows

LEAST_SAMPLES: Final = 25  # of a piece between gaps; the shortest recording bounds the length of training's windows


@dataclass(frozen=True, kw_only=True, eq=False)
class Mask:
    """Which rows of a log are used.

    Attributes:
        pieces: Rows of each piece between gaps, every row of a piece being complete; at least one piece.
        dropped: Samples of each piece that is too short to be used.
        missing: Number of rows left out because a number is missing.
        impossible: Numbers that no machine has, whose rows are left out.
        spikes: Samples that stand out alone, whose rows are left out.
        blind: Dead spots of sensors, and the rows in each, which are left out.
        stuck: Positions that stand still while their velocities do not, whose rows are left out.
        gaps: Start and end of each gap [s].
        bridges: Numbers of inputs that were missing or wrong, and in whose place others were put.
    """

    pieces: tuple[np.ndarray, ...]
    dropped: tuple[int, ...]
    missing: int
    impossible: tuple[Impossible, ...]
    spikes: tuple[Spikes, ...]
    blind: tuple[BlindRows, ...]
    stuck: tuple[StuckRows, ...]
    gaps: tuple[tuple[float, float], ...]
    bridges: tuple[Bridge, ...] = ()

    @property
    def left_out(self) -> np.ndarray:
        """Complete rows that are not used, where they are not in a gap."""
        return rows_of((*self.spikes, *self.blind, *self.stuck))

    def describe(self, name: str) -> str:
        """Say what was masked, or nothing.

        Args:
            name: Name of the log.

        Returns:
            A phrase; empty where everything is used.
        """
        what = [
            f"{len(each.rows)} {'wrong' if each.wrong else 'missing'} number{'s' if len(each.rows) > 1 else ''} of "
            f"`{each.channel}` ({each.how})"
            for each in self.bridges
        ]
        if self.missing:
            what.append(f"{_rows(self.missing)} without all numbers")
        for kind in dict.fromkeys(each.kind for each in self.impossible):
            every = [each for each in self.impossible if each.kind == kind]
            columns = ", ".join(f"`{each.channel}` (first at {each.place})" for each in every)
            what.append(f"{_rows(len(rows_of(every)))} with {kind} in {columns}")
        if spikes := len(rows_of(self.spikes)):
            what.append(f"{_rows(spikes)} with samples that stand out alone")
        for spot, rows in self.blind:
            start, end = spot.interval
            what.append(f"{_rows(len(rows))} in which `{spot.channel}` is between {start:.4g} and {end:.4g}")
        for each in self.stuck:
            what.append(f"{_rows(len(each.rows))} in which {each.describe()}")
        if self.gaps:
            start, end = max(self.gaps, key=lambda gap: gap[1] - gap[0])
            count = f"{len(self.gaps)} gap{'s' if len(self.gaps) > 1 else ''} in time"
            what.append(f"{count} (the longest {end - start:.3g} s, from {stamp(start)} s on)")
            into = f"`{name}#1` to `{name}#{len(self.pieces)}`" if len(self.pieces) > 1 else "one piece"
            what.append(f"kept as {into}" + (f", {sum(self.dropped)} samples too short" if self.dropped else ""))
        return ", ".join(what)


def _rows(count: int) -> str:
    """So many rows, in words."""
    return f"{count} row{'s' if count > 1 else ''}"


def mask(
    log: Log,
    spikes: Sequence[Spikes] = (),
    blind: Sequence[BlindRows] = (),
    stuck: Sequence[StuckRows] = (),
    *,
    resample: float | None,
    delay: float,
) -> Mask:
    """Choose the rows of a log that are used.

    Rows that lack a number, have a sample that stands out alone, lie in a sensor's dead spot, or have a position that
    stands still while its velocity does not, are left out. Where
    the time stamps of the others are then further apart than 5 usual steps (those that 95 % of the steps keep to) and
    than 2 steps of the grid to resample to, nothing is known in between, and the log is split. Pieces of less than 25
    samples, counted after resampling and delay, are dropped.

    Args:
        log: Log whose time stamps increase where they are known.
        spikes: Samples that stand out alone.
        blind: Dead spots of sensors, and the rows in each.
        stuck: Positions that stand still while their velocities do not.
        resample: Step of the grid that its recordings are brought to [s].
        delay: Longest delay of an input and of a position [s]; each piece loses as much.

    Returns:
        The choice. A log without gaps is one piece, however short it is.
    """
    rows = np.flatnonzero(log.complete)
    missing = len(log) - len(np.union1d(rows, rows_of(log.impossible)))
    chosen = partial(
        Mask,
        missing=missing,
        impossible=tuple(_left_out_of(log)),
        bridges=log.bridges,
        spikes=tuple(spikes),
        blind=tuple(blind),
        stuck=tuple(stuck),
    )
    rows = np.setdiff1d(rows, rows_of((*spikes, *blind, *stuck)))
    if len(rows) < 2:
        return chosen(pieces=(rows,), dropped=(), gaps=())
    ts = log.ts[rows]
    steps = np.diff(ts)
    after = np.flatnonzero(steps > longest_step(steps, resample=resample)) + 1
    pieces = np.split(rows, after)
    gaps = tuple((float(ts[k - 1]), float(ts[k])) for k in after)
    step = max(float(np.median(steps)), resample or 0.0)
    long = [
        len(piece) >= LEAST_SAMPLES and log.ts[piece[-1]] - log.ts[piece[0]] - delay >= (LEAST_SAMPLES - 1.5) * step
        for piece in pieces
    ]
    if not gaps or not any(long):
        kept = pieces if not gaps else [max(pieces, key=len)]
        return chosen(pieces=tuple(kept), dropped=_others(pieces, kept), gaps=gaps)
    kept = [piece for piece, fits in zip(pieces, long, strict=True) if fits]
    return chosen(pieces=tuple(kept), dropped=_others(pieces, kept), gaps=gaps)


def _left_out_of(log: Log) -> Iterator[Impossible]:
    """Impossible numbers whose rows are left out, as their places were not bridged."""
    for each in log.impossible:
        bridged = bridged_rows(log, each.columns)
        rows = np.setdiff1d(each.rows, bridged)
        if not len(bridged):
            yield each
        elif len(rows):
            yield dataclasses.replace(each, rows=rows, place=log.place(int(rows[0])))


def _others(pieces: list[np.ndarray], kept: list[np.ndarray]) -> tuple[int, ...]:
    """Lengths of the pieces that are not kept."""
    firsts = {int(piece[0]) for piece in kept}
    return tuple(len(piece) for piece in pieces if int(piece[0]) not in firsts)

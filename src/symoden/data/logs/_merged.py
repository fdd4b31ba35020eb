"""Tables of several clocks: what was logged at other times than the positions is brought to their rows."""

import dataclasses
from collections.abc import Mapping
from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from symoden.data._errors import DataError
from symoden.data.signals import centred_mean, held_mean, longest_step

from ._clock_notes import Left, Merged, Silence
from ._logs import Log
from ._spikes import lone_samples

_OFTEN: Final = 0.2  # Share of the positions' rows that a column of another clock lacks, or has beside them.
_MOSTLY: Final = 0.8  # Share of the latter that lies in no gap between the positions.
_LONE: Final = 3.0  # Such rows in succession that it has; a sensor that fails has had many before.
_FEWEST: Final = 4  # Numbers of a column that has none beside the positions' rows.
_ENOUGH: Final = 25  # Numbers that tell what is usual.
_CLOSER: Final = 0.75  # Of the step between rows: what comes faster is averaged.


def on_one_clock(log: Log, is_angle: np.ndarray, hold: Literal["zero", "linear"]) -> Log:
    """Bring a table whose rows are each of one clock to rows that have all numbers.

    Programs that merge messages of several senders by their time stamps write such tables: a column has numbers in the
    rows of its own sender, and nothing in those of others. The rows that remain are those of the positions; of the
    position with fewest numbers, where they have clocks of their own. Positions and velocities of another clock, and
    inputs with hold "linear", are interpolated (Akima's cubics), or averaged over a step where they come faster, across
    no gap, and single samples that stand out alone are left out. An input with hold "zero" becomes its mean from each
    row to the next, which keeps every impulse ∫u dt; its last number is held for as long as there is no other.

    Args:
        log: What was logged.
        is_angle: Whether each coordinate is an angle.
        hold: What an input is between its samples.

    Returns:
        The log on the positions' rows, with `merged`; the same log where all columns have one clock, or time stamps
        are out of order.

    Raises:
        DataError: If a column has numbers only before, or only after the positions.

    References:
        Akima (1970), *A new method of interpolation and smooth curve fitting based on local procedures*.
    """
    base = rows_of_positions(log)
    known = log.ts[np.isfinite(log.ts)]
    if len(base) < _FEWEST or (np.diff(known) < 0).any() or (np.diff(log.ts[base]) <= 0).any():
        return log
    apart = {role: _is_elsewhere(log.ts, signal, base) for role, signal in log.signals.items()}
    if not any(columns.any() for columns in apart.values()):
        return log
    brought, merged = bring_to(log, base, apart, is_angle, hold)
    return dataclasses.replace(brought, merged=merged)


def bring_to(
    log: Log, base: np.ndarray, apart: Mapping[str, np.ndarray], is_angle: np.ndarray, hold: Literal["zero", "linear"]
) -> tuple[Log, Merged]:
    """Bring a log to some of its rows.

    Args:
        log: What was logged.
        base: The rows, in order; their time stamps increase.
        apart: Which columns are interpolated or averaged, by role; the others are as they are in these rows.
        is_angle: Whether each coordinate is an angle.
        hold: What an input is between its samples.

    Returns:
        The log on these rows, and what became of the columns.

    Raises:
        DataError: If a column has numbers only before, or only after these rows.
    """
    at = log.ts[base]
    signals = {role: signal[base] for role, signal in log.signals.items()}
    named, left, silences = [], [], []
    for role in log.signals:
        for i in np.flatnonzero(apart[role]):
            name = log.names[role][i]
            own = _Clock.of(log, role, int(i), turns=role == "positions" and bool(is_angle[i]))
            own.refuse_apart(log, name, at)
            if role == "inputs" and hold == "zero":
                signals[role][:, i] = own.held(at)
                silences.extend(own.silences(name))
            else:
                own, alone = own.without_lone_samples(log, role, name)
                left.extend(alone)
                signals[role][:, i] = own.between(at)
            named.append(name)
    brought = dataclasses.replace(
        log,
        rows=log.rows[base],
        ts=at,
        q=signals["positions"],
        rates=signals.get("rates"),
        us=signals["inputs"],
        impossible=tuple(  # Of another clock: the row of the positions before.
            dataclasses.replace(each, rows=np.unique(np.maximum(np.searchsorted(base, each.rows, side="right") - 1, 0)))
            for each in log.impossible
        ),
    )
    return brought, Merged(len(log), tuple(named), tuple(left), tuple(silences))


class _Clock(NamedTuple):
    """The numbers of one column at its own times, and their rows of the log."""

    ts: np.ndarray
    signal: np.ndarray
    rows: np.ndarray

    @classmethod
    def of(cls, log: Log, role: str, column: int, *, turns: bool) -> "_Clock":
        """Those that are there, an angle without jumps."""
        signal = log.signals[role][:, column]
        there = np.flatnonzero(np.isfinite(signal) & np.isfinite(log.ts))
        ts, first = np.unique(log.ts[there], return_index=True)
        rows = there[first]
        return cls(ts, np.unwrap(signal[rows]) if turns else signal[rows], rows)

    def refuse_apart(self, log: Log, name: str, at: np.ndarray) -> None:
        """Refuse a column that has numbers only before, or only after the positions."""
        if self.ts[0] > at[-1] or self.ts[-1] < at[0]:
            raise DataError(
                f"{log.time_column} must be of one clock; `{name}` has numbers from {self.ts[0]:.10g} to "
                f"{self.ts[-1]:.10g} s, the positions from {at[0]:.10g} to {at[-1]:.10g} s. Bring the time stamps of "
                "both senders to one clock and unit before they are merged."
            )

    def without_lone_samples(self, log: Log, role: str, name: str) -> tuple["_Clock", list[Left]]:
        """The same without single samples that stand out alone, and what these were; inputs are left alone."""
        if role == "inputs" or len(self.ts) < _ENOUGH:
            return self, []
        alone, off = lone_samples(self.ts, self.signal, role)
        if not len(alone):
            return self, []
        kept = np.setdiff1d(np.arange(len(self.ts)), alone)
        said = Left(name, len(alone), float(np.abs(off[alone]).max()), log.place(int(self.rows[alone[0]])))
        return _Clock(self.ts[kept], self.signal[kept], self.rows[kept]), [said]

    def held(self, at: np.ndarray) -> np.ndarray:
        """Means from each time to the next; NaN before the first number."""
        widths = np.diff(at, append=2 * at[-1] - at[-2])
        known = at >= self.ts[0]
        means = np.full(len(at), np.nan)
        start = self.ts[0]
        signal = self.signal[:, None]
        means[known] = held_mean(self.ts - start, signal, at[known] - start, widths[known, None])[:, 0]
        return means

    def silences(self, name: str) -> list[Silence]:
        """The longest time without a number, if that is unusual."""
        steps = np.diff(self.ts)
        if len(steps) < _ENOUGH or steps.max() <= longest_step(steps):
            return []
        k = int(np.argmax(steps))
        return [Silence(name, float(self.ts[k]), float(self.ts[k + 1]))]

    def between(self, at: np.ndarray) -> np.ndarray:
        """Values at times, means over the step between these where numbers are closer; NaN outside and across gaps."""
        if len(self.ts) < 2:
            return np.full(len(at), np.nan)
        values = np.full(len(at), np.nan)
        steps, width = np.diff(self.ts), float(np.median(np.diff(at)))
        closer = float(np.median(steps)) < _CLOSER * width
        for part in np.split(np.arange(len(self.ts)), np.flatnonzero(steps > longest_step(steps)) + 1):
            inside = (at >= self.ts[part[0]]) & (at <= self.ts[part[-1]])
            start, ts, signal = self.ts[part[0]], self.ts[part] - self.ts[part[0]], self.signal[part]
            if closer and len(part) > 1:
                values[inside] = centred_mean(ts, signal[:, None], at[inside] - start, width)[:, 0]
            elif len(part) > 1:
                values[inside] = Akima1DInterpolator(ts, signal, method="makima")(at[inside] - start)
            else:
                values[inside] = signal
        return values


def rows_of_positions(log: Log) -> np.ndarray:
    """Find the rows that have all positions; or the position with fewest numbers, where few have all.

    Args:
        log: What was logged.

    Returns:
        The rows.
    """
    there = np.isfinite(log.q)
    for each in log.impossible:  # Something was there.
        there[each.rows] |= np.isin(log.names["positions"], each.columns)
    there &= np.isfinite(log.ts)[:, None]
    together = np.flatnonzero(there.all(axis=1))
    fewest = np.flatnonzero(there[:, np.argmin(there.sum(axis=0))])
    return together if len(together) >= (1 - _OFTEN) * len(fewest) else fewest


def _is_elsewhere(ts: np.ndarray, signal: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Which columns have another clock than the rows.

    Such a column has many numbers between the rows, or it lacks many of the rows and has hardly any two of them in
    succession: as where it comes more seldom. A sensor that fails has none in between, and many in succession.

    Returns:
        Whether each is such a one.
    """
    there = np.isfinite(signal[base])
    runs = np.count_nonzero(np.diff(there, axis=0, prepend=False) & there, axis=0)
    seldom = (there.mean(axis=0) < 1 - _OFTEN) & (there.sum(axis=0) <= _LONE * runs)
    others = np.setdiff1d(np.arange(len(ts)), base)
    after = np.searchsorted(ts[base], ts[others])
    steps = np.diff(ts[base], prepend=-np.inf, append=np.inf)
    close = steps[after] <= longest_step(steps[1:-1])
    more = np.isfinite(signal[others])
    between = more[close].sum(axis=0)
    many = (between > _OFTEN * len(base)) & (between >= _MOSTLY * more.sum(axis=0))
    enough = (more.sum(axis=0) > 0) | (np.isfinite(signal).sum(axis=0) >= _FEWEST)
    return enough & (seldom | many)

"""Tables of several clocks: what was logged at other times than the positions is brought to their rows."""

import dataclasses
from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from ._logs import Log, Merged
from ._resample import held_mean
from ._signals import longest_step

_OFTEN: Final = 0.2  # Share of the positions' rows that a column of another clock lacks, or has beside them.
_MOSTLY: Final = 0.8  # Share of the latter that lies in no gap between the positions.
_LONE: Final = 3.0  # Such rows in succession that it has; a sensor that fails has had many before.
_FEWEST: Final = 4  # Numbers that can be interpolated.


def on_one_clock(log: Log, is_angle: np.ndarray, hold: Literal["zero", "linear"]) -> Log:
    """Bring a table whose rows are each of one clock to rows that have all numbers.

    Programs that merge messages of several senders by their time stamps write such tables: a column has numbers in the
    rows of its own sender, and nothing in those of others. The rows that remain are those of the positions; of the
    position with fewest numbers, where they have clocks of their own. Positions and velocities of another clock are
    interpolated (Akima's cubics), across no gap. An input with hold "zero" becomes its mean from each row to the
    next, which keeps every impulse ∫u dt; its last number is held for as long as there is no other.

    Args:
        log: What was logged.
        is_angle: Whether each coordinate is an angle.
        hold: What an input is between its samples.

    Returns:
        The log on the positions' rows, with `merged`; the same log where all columns have one clock, or time stamps
        are out of order.

    References:
        Akima (1970), *A new method of interpolation and smooth curve fitting based on local procedures*.
    """
    base = _rows_of_positions(log)
    known = log.ts[np.isfinite(log.ts)]
    if len(base) < _FEWEST or (np.diff(known) < 0).any() or (np.diff(log.ts[base]) <= 0).any():
        return log
    apart = {role: _is_elsewhere(signal, base) for role, signal in log.signals.items()}
    if hold == "zero":
        apart["inputs"] |= _has_more(log.ts, log.us, base)
    if not any(columns.any() for columns in apart.values()):
        return log
    signals = {role: signal[base] for role, signal in log.signals.items()}
    for role, signal in log.signals.items():
        for i in np.flatnonzero(apart[role]):
            own = _Clock.of(log.ts, signal[:, i], turns=role == "positions" and bool(is_angle[i]))
            held = role == "inputs" and hold == "zero"
            signals[role][:, i] = own.held(log.ts[base]) if held else own.between(log.ts[base])
    named = [name for role, own in apart.items() for name, other in zip(log.names[role], own, strict=True) if other]
    return dataclasses.replace(
        log,
        rows=log.rows[base],
        ts=log.ts[base],
        q=signals["positions"],
        rates=signals.get("rates"),
        us=signals["inputs"],
        impossible=tuple(
            dataclasses.replace(each, rows=rows)
            for each in log.impossible
            if len(rows := np.flatnonzero(np.isin(base, each.rows)))
        ),
        merged=Merged(len(log), tuple(named)),
    )


class _Clock(NamedTuple):
    """The numbers of one column at its own times."""

    ts: np.ndarray
    signal: np.ndarray

    @classmethod
    def of(cls, ts: np.ndarray, signal: np.ndarray, *, turns: bool) -> "_Clock":
        """Those that are there, an angle without jumps."""
        there = np.isfinite(signal) & np.isfinite(ts)
        ts, first = np.unique(ts[there], return_index=True)
        return cls(ts, np.unwrap(signal[there][first]) if turns else signal[there][first])

    def held(self, at: np.ndarray) -> np.ndarray:
        """Means from each time to the next; NaN before the first number."""
        widths = np.diff(at, append=2 * at[-1] - at[-2])
        known = at >= self.ts[0]
        means = np.full(len(at), np.nan)
        start = self.ts[0]
        signal = self.signal[:, None]
        means[known] = held_mean(self.ts - start, signal, at[known] - start, widths[known, None])[:, 0]
        return means

    def between(self, at: np.ndarray) -> np.ndarray:
        """Values at times, NaN outside and across gaps."""
        after = np.searchsorted(self.ts, at)
        inside = (after > 0) & (after < len(self.ts))
        inside[inside] = np.diff(self.ts)[after[inside] - 1] <= longest_step(np.diff(self.ts))
        inside |= np.isin(at, self.ts)
        start = self.ts[0]
        values = Akima1DInterpolator(self.ts - start, self.signal, method="makima")(at - start)
        return np.where(inside, values, np.nan)


def _rows_of_positions(log: Log) -> np.ndarray:
    """Rows that have all positions; or the position with fewest numbers, where few have all."""
    there = np.isfinite(log.q)
    for each in log.impossible:  # Something was there.
        there[each.rows] |= np.array(log.names["positions"]) == each.channel
    there &= np.isfinite(log.ts)[:, None]
    together = np.flatnonzero(there.all(axis=1))
    fewest = np.flatnonzero(there[:, np.argmin(there.sum(axis=0))])
    return together if len(together) > len(fewest) / 2 else fewest


def _is_elsewhere(signal: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Which columns lack numbers in many of the rows, have hardly any two of them in succession, and some elsewhere."""
    there = np.isfinite(signal[base])
    runs = np.count_nonzero(np.diff(there, axis=0, prepend=False) & there, axis=0)
    lone = there.sum(axis=0) <= _LONE * runs
    return (there.mean(axis=0) < 1 - _OFTEN) & lone & (np.isfinite(signal).sum(axis=0) >= _FEWEST)


def _has_more(ts: np.ndarray, signal: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Which columns have many numbers between rows, as far as these are not far apart."""
    longest = longest_step(np.diff(ts[base]))
    after = np.searchsorted(ts[base], ts)
    close = (after > 0) & (after < len(base))
    close[close] = np.diff(ts[base])[after[close] - 1] <= longest
    others = np.setdiff1d(np.arange(len(ts)), base)
    more = np.isfinite(signal[others])
    if not len(others):
        return np.zeros(signal.shape[1], bool)
    return (more.sum(axis=0) > _OFTEN * len(base)) & (more[close[others]].sum(axis=0) >= _MOSTLY * more.sum(axis=0))

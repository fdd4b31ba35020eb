"""Facts of every channel of one log."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias

import numpy as np

from symoden.data.description import Description, of_column, si_of, unit_said
from symoden.data.signals import (
    Accuracy,
    Ratio,
    blocks,
    longest_step,
    noise_level,
    quantum,
    shares_cut_off,
    velocity_ratio,
)

from ._logs import Log
from ._spikes import unwrapped

Role: TypeAlias = Literal["position", "velocity", "momentum", "input"]
_LEAST_ROWS: Final = 10
_MOVES, _ABOVE = 0.02, 3.0  # of the fastest block's way; times the accuracy


@dataclass(frozen=True, kw_only=True)
class ChannelFacts:
    """Facts of one column of a log, in SI and rad.

    Attributes:
        name: Name of the column.
        title: The same with its SI unit, where that is known.
        role: What it is.
        minimum: Smallest value.
        maximum: Largest value.
        rms: Root mean square.
        quantum: Step to whose multiples the values are rounded; 0 if none was found.
        noise: Standard deviation of the noise, at least that of the rounding.
        cut_off: Share of samples at an extreme value at which the signal is cut off.
        limits: These values, from the smallest on.
        ratio: Of a velocity: displacement of the position over ∫v dt, 1 if they agree; None if unknown.
        moving: Of a position: share of the time in which it moves; None of anything else.
    """

    name: str
    title: str
    role: Role
    minimum: float
    maximum: float
    rms: float
    quantum: float
    noise: float
    cut_off: float = 0.0
    limits: tuple[float, ...] = ()
    ratio: float | None = None
    moving: float | None = None

    @property
    def span(self) -> float:
        """Largest value less smallest."""
        return self.maximum - self.minimum

    @property
    def accuracy(self) -> Accuracy:
        """How exactly it is known."""
        return Accuracy(quantum=self.quantum, noise=self.noise)


@dataclass(frozen=True, kw_only=True, eq=False)
class Facts:
    """What was measured of the rows of a log that are used, in the order of their times, each time once.

    Attributes:
        rows: Rows of the log (T,).
        ts: Time stamps [s] (T,).
        q: Positions (T, n), not unwrapped.
        v: Velocities (T, n); None if there are none.
        us: Inputs (T, m).
        is_angle: Whether each coordinate is an angle.
        kinds: Units in SI of each position, those that it may be in where nothing tells: "m", "rad".
        longest: Longest step that is no gap [s].
        positions: Facts of each position.
        rates: Facts of each velocity or momentum.
        inputs: Facts of each input.
        ratios: For each coordinate, its displacements against its integrated velocity; empty without velocities.
        units: Factors that the description gives to columns.
        clock: Name of the column of time stamps; empty where rows are counted.
        below: What a line under the names says of the columns' units.
    """

    rows: np.ndarray
    ts: np.ndarray
    q: np.ndarray
    v: np.ndarray | None
    us: np.ndarray
    is_angle: np.ndarray
    kinds: tuple[tuple[str, ...], ...]
    longest: float
    positions: tuple[ChannelFacts, ...]
    rates: tuple[ChannelFacts, ...]
    inputs: tuple[ChannelFacts, ...]
    ratios: tuple[Ratio, ...]
    units: Mapping[str, float]
    clock: str = ""
    below: Mapping[str, str] = field(default_factory=dict)

    @property
    def way(self) -> np.ndarray:
        """Positions (T, n), angles without jumps by a turn."""
        return unwrapped(self.q, self.is_angle)

    @property
    def channels(self) -> tuple[ChannelFacts, ...]:
        """Facts of every column."""
        return self.positions + self.rates + self.inputs


def measure(log: Log, description: Description, is_angle: np.ndarray, left_out: np.ndarray) -> Facts | None:
    """Measure every channel of a log, apart from rows that are left out.

    Args:
        log: What was logged.
        description: What it means.
        is_angle: Whether each coordinate is an angle.
        left_out: Complete rows that are not used: samples that stand out alone, dead spots, stuck sensors.

    Returns:
        The facts; None where less than 10 rows are left.
    """
    rows = np.setdiff1d(np.flatnonzero(log.complete), left_out)
    rows = rows[np.unique(log.ts[rows], return_index=True)[1]]
    if len(rows) < _LEAST_ROWS:
        return None
    ts, q, us = log.ts[rows], log.q[rows], log.us[rows]
    rates = None if log.rates is None else log.rates[rows]
    v = rates if description.momenta is None else None
    longest = longest_step(np.diff(ts), resample=description.resample)
    ways, below = unwrapped(q, is_angle), log.units_below_names
    names = {role: _titled(log, role, description.units, below) for role in log.signals}
    positions = tuple(
        dataclasses.replace(one, moving=_share_moving(ts, way, one.accuracy, longest))
        for one, way in zip(_channels(ts, q, names["positions"], "position", longest, smooth=ways), ways.T, strict=True)
    )
    role: Role = "velocity" if description.momenta is None else "momentum"
    of_rates = () if rates is None else _channels(ts, rates, names["rates"], role, longest)
    ratios = ()
    if v is not None:
        ratios = tuple(
            velocity_ratio(ts, *signals, longest=longest, accuracy=(one.accuracy, other.accuracy))
            for *signals, one, other in zip(ways.T, v.T, positions, of_rates, strict=True)
        )
        of_rates = tuple(
            dataclasses.replace(one, ratio=ratio.factor if ratio.known else None)
            for one, ratio in zip(of_rates, ratios, strict=True)
        )
    return Facts(
        rows=rows,
        ts=ts,
        q=q,
        v=v,
        us=us,
        is_angle=is_angle,
        kinds=tuple((unit,) if unit else ("m", "rad") for unit in log.units["positions"]),
        longest=longest,
        positions=positions,
        rates=of_rates,
        inputs=_channels(ts, us, names["inputs"], "input", longest),
        ratios=ratios,
        units=description.units,
        clock=log.names["time"][0] if "time" in log.names else "",
        below=below,
    )


def _titled(log: Log, role: str, told: Mapping[str, float], below: Mapping[str, str]) -> list[tuple[str, str]]:
    """Names of the columns of a role, and these for a reader: without the unit of a coordinate that they contradict."""
    columns = []
    for i, (name, unit) in enumerate(zip(log.names[role], log.units[role], strict=True)):
        said = unit_said(name, below)
        is_other = said and si_of(said) != unit and of_column(name, told) is None
        columns.append((name, name if is_other else log.title(role, i)))
    return columns


def _channels(
    ts: np.ndarray,
    signals: np.ndarray,
    names: Sequence[tuple[str, str]],
    role: Role,
    longest: float,
    *,
    smooth: np.ndarray | None = None,
) -> tuple[ChannelFacts, ...]:
    """Facts of each column that need no other one; noise is that of the `smooth` ones, if there are others."""
    quiet = signals if smooth is None else smooth
    return tuple(
        _channel(signal, each, role, noise_level(ts, way, longest=longest))
        for signal, way, each in zip(signals.T, quiet.T, names, strict=True)
    )


def _channel(signal: np.ndarray, names: tuple[str, str], role: Role, noise: float) -> ChannelFacts:
    """Facts of one column."""
    step = quantum(signal)
    shares = shares_cut_off(signal) if role == "input" else {}
    return ChannelFacts(
        name=names[0],
        title=names[1],
        role=role,
        minimum=float(signal.min()),
        maximum=float(signal.max()),
        rms=float(np.sqrt(np.mean(signal**2))),
        quantum=step,
        noise=max(noise, step / np.sqrt(12)),
        cut_off=sum(shares.values(), 0.0),
        limits=tuple(shares),
    )


def _share_moving(ts: np.ndarray, way: np.ndarray, accuracy: Accuracy, longest: float) -> float:
    """Share of the blocks of 0.1 s in which a position changes visibly."""
    moves = np.abs(np.diff(way[blocks(ts, longest=longest)], axis=1)[:, 0])
    if not len(moves):
        return float(np.ptp(way) > 0)
    return float((moves > max(_MOVES * moves.max(), _ABOVE * accuracy.size)).mean())

"""What was found of the clocks of a log, and what became of it."""

from typing import NamedTuple


class Left(NamedTuple):
    """Single samples of a column of another clock that stand out alone, and were left out of it.

    Attributes:
        channel: Name of the column.
        samples: How many.
        largest: Largest deviation from what the neighbours say, in SI or rad.
        place: Where the first one is in the file.
    """

    channel: str
    samples: int
    largest: float
    place: str


class Silence(NamedTuple):
    """Time for which a held input had no number, far longer than it usually has none.

    Attributes:
        channel: Name of the column.
        start: When it began [s].
        end: When it ended [s].
    """

    channel: str
    start: float
    end: float


class Merged(NamedTuple):
    """That a table had several clocks, and was brought to that of the positions.

    Attributes:
        rows: Rows that it had.
        columns: Names of the columns that had numbers in other rows than the positions.
        left: Their samples that were left out.
        silences: The longest of each of the inputs that has one.
    """

    rows: int
    columns: tuple[str, ...]
    left: tuple[Left, ...] = ()
    silences: tuple[Silence, ...] = ()


class Polled(NamedTuple):
    """That positions repeat their last reading between others, and that such rows were left out.

    Attributes:
        rows: Rows that there were.
        columns: Names of these positions.
    """

    rows: int
    columns: tuple[str, ...]


class Arrivals(NamedTuple):
    """That time stamps were found to tell when rows arrived, and rows were put onto an even clock.

    Attributes:
        step: Time between its ticks [s].
        together: How many rows arrived at once with the one before.
    """

    step: float
    together: int


class Wraps(NamedTuple):
    """That a clock counted in so many bits and began anew when these were full, and was counted on.

    Attributes:
        bits: How many.
        tick: What it counted [s].
        place: Where in the file it first began anew.
        spans: Last stamp before and first one after each such row [s].
    """

    bits: int
    tick: float
    place: str
    spans: tuple[tuple[float, float], ...]

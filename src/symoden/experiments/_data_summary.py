"""What a run keeps of its data: enough to inspect its model, and to tell whether data are the same."""

from dataclasses import dataclass
from typing import Literal

from symoden.data import Dataset, median_step
from symoden.evaluation import Ranges
from symoden.spaces import Space
from symoden.units import position_units


@dataclass(frozen=True, kw_only=True)
class DataSummary:
    """What a run keeps of its data, so that its model can be inspected without them.

    Attributes:
        space: Configuration space that the model was told.
        momenta: Whether rates are momenta.
        hold: What an input is between samples.
        recordings: Number of recordings of each part.
        samples: Number of samples of each part.
        position_names: Names of the coordinates.
        input_names: Names of the inputs.
        ranges: Least and largest values in the training part.
        digest: SHA-256 of the recordings of each part and of all that is told of them; resuming with others is refused.
        position_units: What each coordinate is measured in: "rad", "m", or "" where it is as it was logged. Runs from
            before this was kept know what the space tells.
        delay: How late the machine's inputs act on what its sensors tell [s].
        lag: Time constant of the lag by which what acts follows each input [s]; none if empty.
        step: Median time from row to row [s]; 0 of runs from before this was kept.
    """

    space: str
    momenta: bool
    hold: Literal["zero", "linear"]
    recordings: dict[str, int]
    samples: dict[str, int]
    position_names: tuple[str, ...]
    input_names: tuple[str, ...]
    ranges: Ranges
    digest: str
    position_units: tuple[str, ...] = ()
    delay: float = 0.0
    lag: tuple[float, ...] = ()
    step: float = 0.0

    def __post_init__(self) -> None:
        """Complete the units.

        Raises:
            ValueError: If one is none of its coordinate.
        """
        units = position_units(Space.parse(self.space).is_angle, self.position_units)
        object.__setattr__(self, "position_units", units)


def summarize(dataset: Dataset) -> DataSummary:
    """Summarise a data set.

    Args:
        dataset: The data set.

    Returns:
        Its summary.
    """
    cyclic = () if dataset.known is None else dataset.known.cyclic
    told = dataset.train or dataset.recordings
    parts = {"train": dataset.train, "validation": dataset.validation, "test": dataset.test}
    return DataSummary(
        space=dataset.space,
        momenta=dataset.momenta,
        hold=dataset.hold,
        recordings={name: len(part) for name, part in parts.items()},
        samples={name: sum(map(len, part)) for name, part in parts.items()},
        position_names=dataset.position_names,
        input_names=dataset.input_names,
        ranges=Ranges.of(told, Space.parse(dataset.space), cyclic=cyclic),
        digest=dataset.digest,
        position_units=dataset.position_units,
        delay=dataset.delay,
        lag=dataset.lag,
        step=median_step(told),
    )

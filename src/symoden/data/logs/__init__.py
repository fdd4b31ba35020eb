"""What was logged, in SI and rad: what of it is used, and the recordings that it becomes."""

from ._arrivals import find_arrivals as find_arrivals
from ._blind import BlindSpot as BlindSpot, blind_spots as blind_spots
from ._bridges import bridge as bridge, bridged_rows as bridged_rows
from ._clocks import SLOW as SLOW, find_other_clocks as find_other_clocks
from ._copies import find_copies as find_copies
from ._facts import ChannelFacts as ChannelFacts, Facts as Facts, measure as measure
from ._logs import Log as Log, angles as angles
from ._masking import LEAST_SAMPLES as LEAST_SAMPLES, Mask as Mask
from ._overlaps import find_ended as find_ended
from ._polled import find_polled as find_polled
from ._reading import Reading as Reading, read_all as read_all
from ._recordings import recordings_of as recordings_of, rows_to_use as rows_to_use
from ._stuck import StuckRows as StuckRows, find_stuck as find_stuck, find_stuck_rows as find_stuck_rows
from ._uneven import find_uneven as find_uneven
from ._wraps import find_wraps as find_wraps
from ._zeros import find_counted_zeros as find_counted_zeros

__all__ = [
    "LEAST_SAMPLES",
    "SLOW",
    "BlindSpot",
    "ChannelFacts",
    "Facts",
    "Log",
    "Mask",
    "Reading",
    "StuckRows",
    "angles",
    "blind_spots",
    "bridge",
    "bridged_rows",
    "find_arrivals",
    "find_copies",
    "find_counted_zeros",
    "find_ended",
    "find_other_clocks",
    "find_polled",
    "find_stuck",
    "find_stuck_rows",
    "find_uneven",
    "find_wraps",
    "measure",
    "read_all",
    "recordings_of",
    "rows_to_use",
]

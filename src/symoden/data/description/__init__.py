"""What a description says: which numbers of which files mean what, in which units."""

from ._description import (
    ALL_ROWS as ALL_ROWS,
    Description as Description,
    angles_of as angles_of,
    read_description as read_description,
)
from ._impossible import Impossible as Impossible, without_impossible as without_impossible
from ._parts import read_parts as read_parts
from ._units import (
    entry as entry,
    factor_of as factor_of,
    key as key,
    number_of as number_of,
    of_column as of_column,
    si_of as si_of,
    split_unit as split_unit,
    unit_said as unit_said,
    units_of as units_of,
)
from ._unreadable import Unreadable as Unreadable

__all__ = [
    "ALL_ROWS",
    "Description",
    "Impossible",
    "Unreadable",
    "angles_of",
    "entry",
    "factor_of",
    "key",
    "number_of",
    "of_column",
    "read_description",
    "read_parts",
    "si_of",
    "split_unit",
    "unit_said",
    "units_of",
    "without_impossible",
]

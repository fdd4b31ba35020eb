"""Named columns of numbers, whatever the format of a file."""

from ._cells import label as label
from ._joined import join_tables as join_tables, name_joined as name_joined
from ._limits import LARGEST_NUMBER as LARGEST_NUMBER
from ._memory import Table as Table
from ._readers import (
    OddNumbers as OddNumbers,
    Rows as Rows,
    Selector as Selector,
    names_in as names_in,
    read_rows as read_rows,
    stem_of as stem_of,
    suffix_of as suffix_of,
    variable_of as variable_of,
)
from ._tables import (
    find_short_lines as find_short_lines,
    is_text as is_text,
    place as place,
    units_below_names as units_below_names,
)
from ._unread_clock import UnreadClock as UnreadClock

__all__ = [
    "LARGEST_NUMBER",
    "OddNumbers",
    "Rows",
    "Selector",
    "Table",
    "UnreadClock",
    "find_short_lines",
    "is_text",
    "join_tables",
    "label",
    "name_joined",
    "names_in",
    "place",
    "read_rows",
    "stem_of",
    "suffix_of",
    "units_below_names",
    "variable_of",
]

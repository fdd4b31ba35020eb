"""What is wrong with single logs, and what is worth knowing of them."""

from ._examine import Examination as Examination, is_idle as is_idle, stands_still as stands_still
from ._left_out import find_absent as find_absent, find_masked as find_masked, find_merged as find_merged
from ._lengths import find_short as find_short
from ._pace import (
    find_fast_sampling as find_fast_sampling,
    find_finer_sampling as find_finer_sampling,
    find_slow_sampling as find_slow_sampling,
)
from ._survey import survey as survey
from ._together import find_tied_positions as find_tied_positions, find_untold_inputs as find_untold_inputs
from ._unread import find_unread_inputs as find_unread_inputs

__all__ = [
    "Examination",
    "find_absent",
    "find_fast_sampling",
    "find_finer_sampling",
    "find_masked",
    "find_merged",
    "find_short",
    "find_slow_sampling",
    "find_tied_positions",
    "find_unread_inputs",
    "find_untold_inputs",
    "is_idle",
    "stands_still",
    "survey",
]

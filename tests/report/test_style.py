"""What pictures share."""

import numpy as np
import pytest

from symoden.report._style import clock, since, wrapped


@pytest.mark.parametrize(("first", "counted"), [(0.0, 0.0), (12.0, 0.0), (-3.0, 0.0), (1.7e9, 1.7e9), (5e4, 5e4)])
def test_time_counts_from_the_first_row_where_the_clock_started_long_before(first, counted):
    assert since(first + np.array([0.0, 1.0, 30.0])) == counted
    assert since(first + np.array([np.nan, 0.0, 30.0])) == counted
    assert since(np.array([np.nan])) == 0
    headings = [clock([np.arange(3.0), first + np.array([0.0, 1.0, 30.0])]), clock([np.arange(3.0)])]
    assert headings == ["time since the first row [s]" if counted else "time [s]", "time [s]"]


def test_names_are_as_wide_as_there_is_room():
    name = "step_response_of_the_trolley with a load"
    assert max(map(len, wrapped(name).splitlines())) <= 20
    assert wrapped(name).replace("\n", "").replace(" ", "") == name.replace(" ", "")
    assert wrapped("run") == "run"

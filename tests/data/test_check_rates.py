"""What `check_dataset` says of rates where time stamps are wrong, or there are more rows than were logged."""

import numpy as np
import pytest

from symoden.data import check_dataset


def swing(ts, velocity=1.0, *, stamps=None, **said):
    """Findings on a swing that was logged at given times, its velocity times a factor, with stamps of their own."""
    said = {"space": "T1", "time": "t", "positions": ["q"], "train": {"files": ["run"]}} | said
    q, v = np.sin(3 * ts), 3 * velocity * np.cos(3 * ts)
    check = check_dataset(said, tables={"run": {"t": ts if stamps is None else stamps, "q": q, "v": v}})
    return [*check.recordings[0].findings, *check.findings]


@pytest.mark.parametrize(("pairs", "told"), [([400], True), (range(0, 800, 4), False)])
def test_no_direction_is_told_by_stamps_of_which_many_are_wrong(pairs, told):
    ts = np.linspace(0, 8, 801)
    stamps, first = ts.copy(), np.array(pairs)
    stamps[first], stamps[first + 1] = ts[first + 1], ts[first]
    findings = swing(ts, -1.0, stamps=stamps, velocities=["v"])
    assert ("time", "refused") in {(one.kind, one.level) for one in findings}
    assert any(one.kind == "sign" for one in findings) == told


@pytest.mark.parametrize(("resample", "told"), [(0.01, True), (0.1, False)])
def test_rows_that_were_never_logged_are_named(resample, told):
    findings = swing(np.linspace(0, 20, 401), resample=resample)
    assert any("`resample = 0.01` makes 5 rows of each one of the logs" in one.text for one in findings) == told

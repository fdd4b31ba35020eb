"""Predictions are drawn beside what was measured, as far as the motion goes, and say how far off they are."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from symoden.evaluation import RecordedPaths
from symoden.report import plot_recorded

TS = np.linspace(0.0, 2.0, 41)
MEASURED = np.sin(TS)[:, None]  # From 0 to 1.


def drawn(whole):
    recording = RecordedPaths(name="run", ts=TS, measured=MEASURED, whole=whole, windows=())
    return plot_recorded(recording, 0, ax=Figure().subplots())


@pytest.mark.parametrize(("shift", "said", "most"), [(0.002, "0.002", 1.152), (0.4, "0.4", 1.55), (30.0, "30", 2.15)])
def test_a_rollout_is_seen_as_far_as_the_motion_itself_goes_and_its_error_is_said(shift, said, most):
    ax = drawn(MEASURED + shift)
    (text,) = ax.texts
    assert text.get_text() == f"rollout off by {said}"
    assert ax.get_ylim() == pytest.approx((-0.15, most), abs=2e-3)


def test_rows_that_found_the_start_are_not_scored():
    whole = np.where(np.arange(41)[:, None] < 10, MEASURED + 7, MEASURED + 0.25)
    recording = RecordedPaths(name="run", ts=TS, measured=MEASURED, whole=whole, windows=(), scored_from=10)
    assert plot_recorded(recording, 0, ax=Figure().subplots()).texts[0].get_text() == "rollout off by 0.25"


@pytest.mark.parametrize("lost", [np.nan, np.inf, 1e300])
def test_what_diverges_is_drawn_too(lost):
    ax = drawn(np.where(np.arange(41)[:, None] < 20, MEASURED, lost))
    assert ax.texts[0].get_text() in ("rollout off by nan", "rollout off by inf")
    assert np.isfinite(ax.get_ylim()).all()

"""Figures of what was learned: curves and their names."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from symoden.report import plot_curves

XS = np.linspace(-1.0, 1.0, 21)


@pytest.mark.parametrize(
    "names",
    [
        ["M[1, 1]", "M[1, 2]", "M[2, 2]"],
        [f"g[{q}, {u}]" for q in ("YAW", "PITCH") for u in ("E_YAW", "E_PITCH")],
        [f"g[{q}, torque of the {u} motor]" for q in ("shoulder", "elbow") for u in ("left", "right")],
        [f"g[{side} wheel's angle in the body, current of its {k} motor]" for side in "ab" for k in (1, 2)],
    ],
    ids=lambda names: f"{len(names[0])} letters",
)
def test_names_of_curves_stay_in_their_panel_and_above_the_curves(names):
    figure = Figure(figsize=(4 * 3.2, 2.8), layout="constrained")
    _, ax, *_ = figure.subplots(1, 4)
    curves = {name: np.full_like(XS, k) * XS for k, name in enumerate(names)}
    plot_curves(XS, curves, None, coordinate="q [rad]", symbol="g", ax=ax)
    figure.draw_without_rendering()
    panel, legend = ax.get_window_extent(), ax.get_legend().get_window_extent()
    assert panel.x0 <= legend.x0 < legend.x1 <= panel.x1
    assert ax.transData.transform((0, max(values.max() for values in curves.values())))[1] < legend.y0
    assert len(ax.get_legend().get_texts()) == len(names)


@pytest.mark.parametrize("width", [0.0, np.inf, np.nan])
def test_what_has_no_height_or_no_end_is_drawn_too(width):
    ax = plot_curves(XS, {"V": 0 * XS}, {"V": XS * 0 + width}, coordinate="q", symbol="V", ax=Figure().subplots())
    assert np.isfinite(ax.get_ylim()).all()


@pytest.mark.parametrize(("peak", "highest"), [(100.0, 1.3), (0.2, 1.3)])
def test_a_band_that_peaks_in_a_spot_does_not_hide_the_curve(peak, highest):
    width = np.where(np.arange(21) == 10, peak, 0.2)
    curves = {"M[1, 1]": np.where(np.arange(21) == 3, 1.0, 0.5)}
    ax = plot_curves(XS, curves, {"M[1, 1]": width}, coordinate="q [rad]", symbol="M", ax=Figure().subplots())
    low, high = ax.get_ylim()
    assert low == 0.0
    assert 1.2 < high <= 1.1 * highest

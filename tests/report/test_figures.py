"""Figures of all models: axes with units, one look for each kind, and the numbers that were computed."""

import dataclasses

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.figure import Figure

from symoden.experiments import (
    PAPER_ORDER,
    Cell,
    CellResult,
    MeanStd,
    circle_drift,
    energy_curves,
    extrapolation,
    free_rollouts,
    phase_plane,
    portrait,
    sweeps,
    table_rows,
)
from symoden.report import (
    draw_comparison,
    draw_energies,
    draw_extrapolation,
    draw_phase,
    draw_portraits,
    draw_sweeps,
    plot_circle,
    plot_comparison,
    plot_energy,
    plot_extrapolation,
    plot_phase,
    plot_positions,
    plot_sweep,
)
from symoden.report._looks import LOOKS


@pytest.fixture
def figure():
    return Figure(figsize=(9, 6), layout="constrained")


@pytest.fixture
def ax(figure):
    return figure.add_subplot()


@pytest.fixture(autouse=True)
def nothing_global():
    before = dict(rcParams)
    yield
    assert dict(rcParams) == before


def rendered(figure):
    """Draw, so that what matplotlib refuses is found."""
    figure.canvas.draw()
    return figure


def result(kind="dissipative", error=1.0, **cell):
    cell = Cell(**({"task": "pendulum", "model": kind, "preset": "default", "seed": 0} | cell))
    errors = MeanStd(error, 0.0)
    return CellResult(cell=cell, parameters=1, train=errors, test=errors, prediction=errors, seconds=1.0)


def test_no_two_kinds_look_alike_in_any_way():
    assert set(LOOKS) == set(PAPER_ORDER)
    for column in zip(*LOOKS.values(), strict=True):
        assert len(set(column)) == len(LOOKS)


def test_the_phase_plane_has_a_panel_for_the_truth_and_for_each_model(contest, figure):
    plane = phase_plane(contest("pendulum-canonical"), points=9)
    assert plane is not None
    panels = rendered(draw_phase(plane, figure=figure)).axes
    titles = [panel.get_title().partition(":")[0] for panel in panels]
    assert titles == ["truth", "naive", "unstructured", "symoden", "dissipative"]
    assert all(panel.get_xlabel() == "q [rad]" for panel in panels)
    assert panels[0].get_ylabel() == "p [kg m²/s]"


def test_trajectories_are_circles_and_rollouts_lines(contest, ax):
    plane = phase_plane(contest("pendulum-canonical"), points=9)
    assert plane is not None
    assert plot_phase(plane, "symoden", ax=ax) is ax
    circles = [line for line in ax.get_lines() if line.get_marker() == "o"]
    lines = [line for line in ax.get_lines() if line.get_marker() == "None"]
    assert len(circles) == len(lines) == len(plane.trajectories)
    np.testing.assert_array_equal(lines[2].get_xdata(), plane.predictions["symoden"][2].q[:, 0])
    np.testing.assert_array_equal(lines[2].get_ydata(), plane.predictions["symoden"][2].rates[:, 0])
    np.testing.assert_array_equal(circles[2].get_xdata(), plane.trajectories[2].q[::2, 0])


def test_energies_are_drawn_over_time(contest, figure):
    models = contest("pendulum")
    curves = energy_curves(models, free_rollouts(models))
    ax = plot_energy(curves[0], ax=figure.add_subplot())
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [s]", "true energy H [J]")
    drawn = {line.get_label(): line for line in ax.get_lines()}
    np.testing.assert_array_equal(drawn["naive"].get_ydata(), curves[0].learned["naive"])
    figure.clear()
    rendered(draw_energies(curves, figure=figure))
    assert len(figure.axes) == len(curves)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["truth", *PAPER_ORDER]


def test_circles_are_drawn_on_a_logarithmic_axis_whatever_happens(contest, ax):
    models = contest("cartpole")
    drift = circle_drift(models, free_rollouts(models))
    assert drift is not None
    drift.worst["naive"][-1] = np.inf
    drift.worst["symoden"][:] = 0.0
    assert plot_circle(drift, ax=ax) is ax
    rendered(ax.figure)
    assert ax.get_yscale() == "log"
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [s]", "largest |cos² + sin² − 1| [1]")
    drawn = {line.get_label(): np.asarray(line.get_ydata()) for line in ax.get_lines()}
    np.testing.assert_array_equal(drawn["naive"][1:-1], drift.worst["naive"][1:-1])
    assert np.isnan(drawn["naive"][-1])
    assert np.all(drawn["symoden"] > 0)


def test_extrapolation_is_drawn_with_its_share_in_numbers(contest, figure):
    models = contest("pendulum-canonical", kinds=("dissipative", "symoden"))
    found = extrapolation(models, free_rollouts(models), kind="symoden")
    assert found is not None
    found = dataclasses.replace(found, beyond=np.array([-2.0, -1.0, 3.0]), outside_share=0.9876)
    rendered(draw_extrapolation(found, figure=figure))
    left, right, counts = figure.axes
    assert "98.76 %" in left.get_title()
    assert "[rad]" in left.get_xlabel()
    assert "[SI]" in left.get_ylabel()
    points = {line.get_label(): line for line in left.get_lines()}
    np.testing.assert_array_equal(points["inside: 2 trajectories"].get_ydata(), found.errors[:2])
    np.testing.assert_array_equal(points["outside: 1 trajectories"].get_xdata(), [3.0])
    assert "[rad²]" in right.get_ylabel()
    assert "samples" in counts.get_ylabel()


def test_extrapolation_without_any_outside_is_drawn(contest, figure):
    models = contest("pendulum-canonical", kinds=("dissipative",))
    found = extrapolation(models, free_rollouts(models))
    assert found is not None
    inside = dataclasses.replace(found, beyond=-np.ones(3), outside_median=np.nan, outside_share=0.0)
    left, right = figure.subplots(1, 2)
    plot_extrapolation(inside, ax=left)
    plot_positions(inside, ax=right)
    rendered(figure)
    assert not any("outside" in str(line.get_label()) for line in left.get_lines())


def test_portraits_have_a_row_for_each_coordinate(contest, figure):
    models = contest("acrobot", kinds=("dissipative",))
    both = [portrait(models.trained["dissipative"].model, models.source, coordinate=i, points=9) for i in (0, 1)]
    rendered(draw_portraits(both, figure=figure))
    assert [ax.get_xlabel() for ax in figure.axes] == ["theta1 [rad]"] * 4 + ["theta2 [rad]"] * 4
    assert "β = 1," in figure.get_supxlabel()


def test_the_range_of_the_training_data_is_marked_where_curves_go_beyond_it(contest, figure):
    models = contest("pendulum-canonical", kinds=("symoden",))
    found = portrait(models.trained["symoden"].model, models.source, points=21, beyond=0.2)
    low, high = found.blocks[0].visited
    q = np.concatenate([recording.q for recording in models.source.dataset.train])
    assert (low, high) == pytest.approx((q.min(), q.max()))
    assert found.blocks[0].values[0] == pytest.approx(low - 0.2 * (high - low))
    rendered(draw_portraits([found], figure=figure))
    dotted = [line for line in figure.axes[0].get_lines() if line.get_linestyle() == ":"]
    assert sorted(np.asarray(line.get_xdata())[0] for line in dotted) == pytest.approx([low, high])


def test_errors_of_all_models_are_dots_beside_the_paper_s(figure):
    results = [result(error=1e-9), result(error=1e-8, seed=1), result("naive", error=np.inf), result(preset="paper")]
    rows = table_rows([*results, result(error=5.0, noise=0.1), result(task="cartpole-full")])
    rendered(draw_comparison(rows, figure=figure))
    left, right = figure.axes
    assert "test error" in left.get_xlabel()
    assert "[SI]" in right.get_xlabel()
    assert [label.get_text() for label in left.get_yticklabels()] == ["naive", "dissipative", "dissipative"]
    values = {float(x) for line in left.get_lines() if line.get_marker() not in {"", "None"} for x in line.get_xdata()}
    assert values == {1e-9, 1.0, 2.01, 0.13}
    assert {"pendulum", "cartpole-full", "diverged"} <= {text.get_text() for text in left.texts}
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "preset default",
        "preset paper",
        "as published",
    ]


def test_one_error_of_nothing_is_an_empty_panel(ax):
    plot_comparison([], "prediction", ax=ax)
    rendered(ax.figure)
    assert not ax.get_lines()


def test_sweeps_are_lines_with_markers_and_zero_stands_at_the_left(figure):
    results = [
        result(error=4.0, trajectories=16),
        result("naive", error=np.inf, trajectories=16),
        *(result(error=error, seed=seed) for seed, error in enumerate((1.0, 2.0, 3.0))),
        result("naive", error=7.0),
        result(error=5.0, noise=0.05),
    ]
    both = sweeps(table_rows(results))
    rendered(draw_sweeps(both, figure=figure))
    counts, noises = figure.axes
    assert counts.get_xlabel() == "training trajectories [1]"
    assert counts.get_ylabel() == "prediction error [SI], mean"
    assert (counts.get_xscale(), counts.get_yscale()) == ("log", "log")
    lines = {line.get_label(): line for line in counts.get_lines()}
    np.testing.assert_array_equal(lines["dissipative"].get_ydata(), [4.0, 2.0])
    np.testing.assert_array_equal(lines["naive"].get_ydata(), [np.nan, 7.0])
    assert lines["naive"].get_marker() == LOOKS["naive"].marker
    assert all(panel.get_position().width > 0.25 for panel in (counts, noises))  # Marks take no room from the panels.
    crosses = [line for line in counts.get_lines() if line.get_marker() == "x" and len(line.get_xdata())]
    assert [(line.get_color(), list(line.get_ydata())) for line in crosses] == [(LOOKS["naive"].colour, [1.0])]
    assert [label.get_text() for label in counts.get_xticklabels()] == ["16", "320"]
    assert [label.get_text() for label in noises.get_xticklabels()] == ["0", "0.05"]
    (left, right) = {line.get_label(): line for line in noises.get_lines()}["dissipative"].get_xdata()
    assert 0 < left < right == pytest.approx(0.05, rel=0.1)
    assert {text.get_text() for text in figure.legends[0].get_texts()} == {"naive", "dissipative"}


def test_one_sweep_has_the_axes_it_is_given(ax):
    (sweep,) = sweeps(table_rows([result(), result(trajectories=16)]))
    assert plot_sweep(sweep, ax=ax) is ax

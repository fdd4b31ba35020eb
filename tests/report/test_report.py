"""Pictures: every one returns its axes, with labels and units, and shows what it was given."""

import dataclasses
import functools
import subprocess
import sys

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.figure import Figure

from symoden.experiments import (
    ErrorComparison,
    MeanStd,
    Source,
    TaskScore,
    portrait,
    simulate,
    task,
    unseen_rollouts,
)
from symoden.integrate import RK4
from symoden.report import Summary, draw_summary, plot_block, plot_errors, plot_rollouts

SCORE = TaskScore(train=MeanStd(1e-9, 2e-9), test=MeanStd(2e-9, 1e-9), prediction=MeanStd(3e-8, 1e-8))


@functools.cache
def summary(name):
    chosen, data = task(name), simulate(task(name), train_initials=2, test_initials=1)
    source = Source(name=name, dataset=data.dataset, task=chosen, prediction=data.prediction)
    return Summary(
        rollouts=unseen_rollouts(chosen.system, source, solver=RK4(4), count=3),
        errors=ErrorComparison(task=name, ours=SCORE, paper=chosen.paper.get("dissipative")),
        portrait=portrait(chosen.system, source, points=21),
    )


@pytest.fixture
def ax():
    return Figure().add_subplot()


def rendered(ax):
    """Draw, so that what matplotlib refuses is found."""
    ax.figure.canvas.draw()
    return ax


def test_rollouts_are_drawn_over_time_with_units(ax):
    result = summary("pendulum").rollouts
    assert rendered(plot_rollouts(result, ax=ax)) is ax
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [s]", "theta [rad]")
    lines = {line.get_label(): line for line in ax.get_lines()}
    np.testing.assert_array_equal(lines["torque -2"].get_ydata(), result.predictions[0].q[:, 0])
    assert "truth" in [text.get_text() for text in ax.get_legend().get_texts()]


@pytest.mark.parametrize(("name", "units"), [("pendulum", ("1/(kg m²)", "J", "1", "N m s")), ("cartpole", ("SI",))])
def test_blocks_are_drawn_over_the_coordinate_with_units(ax, name, units):
    for block, unit in zip(summary(name).portrait.blocks, units, strict=False):
        ax.clear()
        assert rendered(plot_block(block, ax=ax)) is ax
        assert ax.get_xlabel() == block.coordinate
        assert ax.get_ylabel() == f"{block.symbol} [{unit}]"
        assert "relative error" in ax.get_title()
        drawn = [line.get_ydata() for line in ax.get_lines() if len(line.get_xdata()) == len(block.values)]
        assert any(np.array_equal(line, block.learned[:, 0]) for line in drawn)


def test_a_constant_fills_its_panel_with_room_and_not_with_rounding(ax):
    block = summary("pendulum").portrait.blocks[0]
    plot_block(dataclasses.replace(block, learned=block.learned + 1e-12), ax=ax)
    low, high = ax.get_ylim()
    assert high - low > 1


def test_a_block_that_is_not_finite_or_zero_is_drawn_all_the_same(ax):
    block = summary("pendulum").portrait.blocks[3]
    for value in (np.nan, 0.0):
        rendered(plot_block(dataclasses.replace(block, learned=np.full_like(block.learned, value)), ax=ax))
    zero = np.zeros_like(block.truth)
    rendered(plot_block(dataclasses.replace(block, truth=zero, learned=zero), ax=ax))


def test_errors_are_bars_beside_the_paper_s(ax):
    assert rendered(plot_errors(summary("pendulum").errors, ax=ax)) is ax
    assert ax.get_xscale() == "log"
    assert "[SI]" in ax.get_xlabel()
    assert sorted(bar.get_width() for bar in ax.patches) == pytest.approx([1e-9, 2e-9, 3e-8, 0.13, 0.15, 1.04])
    assert " 1.04" in [text.get_text() for text in ax.texts]


def test_errors_that_the_paper_does_not_have_or_that_are_not_finite_are_left_out(ax):
    bad = dataclasses.replace(SCORE, prediction=MeanStd(np.inf, np.nan))
    rendered(plot_errors(ErrorComparison(task="cartpole-full", ours=bad, paper=None), ax=ax))
    assert " inf" in [text.get_text() for text in ax.texts]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["symoden"]


@pytest.mark.parametrize("name", ["pendulum", "acrobot", "pendulum-canonical"])
def test_the_page_holds_every_panel_and_says_what_fixes_the_scale(name):
    result = summary(name)
    before = dict(rcParams)
    figure = draw_summary(result, figure=Figure(figsize=(10, 6), layout="constrained"))
    figure.canvas.draw()
    assert len(figure.axes) == 6
    assert all(ax.get_xlabel() for ax in figure.axes)
    assert ("β = " in figure.get_supxlabel()) == (not result.portrait.anchored)
    assert dict(rcParams) == before


def test_without_matplotlib_the_extra_is_named():
    program = "import importlib.util as i; i.find_spec = lambda name: None; from symoden.report import {}"

    def answer(name):
        words = [sys.executable, "-c", program.format(name)]
        return subprocess.run(words, capture_output=True, check=False, text=True).stderr.splitlines()[-1:]

    assert answer("table_markdown") == []
    assert answer("plot_block") == ['ModuleNotFoundError: Pictures need matplotlib. Install "symoden[plot]".']
    assert "cannot import name 'plot_blocks'" in answer("plot_blocks")[0]

"""Every figure that finished cells allow, from their saved models; and the page that shows them."""

import dataclasses
import re

import jax
import numpy as np
import pytest

from symoden.experiments import (
    BlockErrors,
    Cell,
    CellResult,
    MeanStd,
    RunConfig,
    read_source,
    summarize,
    table_rows,
    write_run,
)
from symoden.models import BlockConfig, ModelConfig, build, save
from symoden.report import draw_results, write_page
from symoden.spaces import Space
from symoden.training import TrainingConfig

BLOCKS = BlockErrors(
    gauge=0.5, inverse_mass=1e-3, potential=2e-3, actuation=3e-3, dissipation=0.4, dissipation_median=0.05
)


def result(kind="dissipative", scale=1.0, **cell):
    cell = Cell(**({"task": "pendulum", "model": kind, "preset": "default", "seed": 0} | cell))
    train, test, prediction = (MeanStd(scale * mean, scale) for mean in (1e-3, 2e-3, 4e-3))
    return CellResult(
        cell=cell, parameters=9, train=train, test=test, prediction=prediction, seconds=60.0, blocks=BLOCKS
    )


@pytest.fixture(scope="module")
def data():
    sources = {"pendulum": "T1", "pendulum-canonical": "R1"}
    return {name: summarize(read_source(name, space=space).dataset) for name, space in sources.items()}


@pytest.fixture
def saved(tmp_path, data):
    """Save an untrained model as a cell, and return its result."""

    def save_cell(kind, **cell):
        done = result(kind, **cell)
        small, told = BlockConfig(hidden=(3,)), data[done.cell.task]
        config = ModelConfig(kind=kind, flow=(3,), energy=(3,), inverse_mass=small, potential=small)
        folder = tmp_path / "cells" / done.cell.name
        run = RunConfig(source=done.cell.task, model=config, training=TrainingConfig(), data=told)
        write_run(folder, dataclasses.replace(run, preset=done.cell.preset))
        space = Space.parse(told.space)
        save(folder / "model.safetensors", build(config, space, 1, momenta=told.momenta, key=jax.random.key(0)))
        return done

    return save_cell


def test_finished_cells_have_every_figure(tmp_path, saved):
    results = [
        saved("dissipative", task="pendulum-canonical"),
        saved("naive"),
        saved("dissipative", preset="paper"),
        result("naive", trajectories=16),
        CellResult(cell=Cell(task="acrobot", model="naive", preset="default", seed=0), error="diverged"),
    ]
    figures = draw_results(tmp_path, results)
    assert set(figures) == {
        "errors",
        "blocks-pendulum-canonical",
        "phase-pendulum-canonical",
        "energy-pendulum-canonical",
        "extrapolation-pendulum-canonical",
        "phase-pendulum",
        "energy-pendulum",
        "circle-pendulum",
        "blocks-pendulum-paper",
        "phase-pendulum-paper",
        "energy-pendulum-paper",
        "circle-pendulum-paper",
        "sweep-pendulum",
    }
    for figure in figures.values():
        figure.canvas.draw()
        assert all(ax.get_xlabel() or ax.get_ylabel() for ax in figure.axes)
    assert len(figures["phase-pendulum"].axes) == 2


def test_no_cells_have_no_figures(tmp_path):
    assert draw_results(tmp_path, []) == {}
    assert draw_results(tmp_path, [CellResult(cell=result().cell, error="diverged")]) == {}


@pytest.fixture
def page(tmp_path):
    names = ("errors", "blocks-pendulum", "circle-pendulum", "sweep-pendulum")
    figures = {name: tmp_path / "figures" / f"{name}.png" for name in names}
    figures["energy-pendulum"] = tmp_path / "figures" / "energy-pendulum.pdf"
    for name, path in figures.items():
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(name.encode())
    failed = CellResult(cell=Cell(task="acrobot", model="naive", preset="default", seed=0), error="diverged")
    results = [
        result(),
        dataclasses.replace(result(scale=3.0, seed=1), blocks=dataclasses.replace(BLOCKS, potential=0.5)),
        result(trajectories=16, scale=np.inf),
        result("naive", noise=0.05),
        failed,
    ]
    path = tmp_path / "docs" / "results.md"
    write_page(path, results, table_rows(results), figures, {"command": "`symoden reproduce`", "cores": "2"})
    return path


def test_the_figures_of_a_page_lie_beside_it(page):
    links = re.findall(r"!\[[^]]+\]\(([^)]+)\)", page.read_text(encoding="utf-8"))
    assert links == [
        f"images/results/{name}.png" for name in ("errors", "blocks-pendulum", "circle-pendulum", "sweep-pendulum")
    ]
    for link in links:
        assert (page.parent / link).read_bytes().decode() == (page.parent / link).stem


def test_a_page_says_what_was_run(page):
    text = page.read_text(encoding="utf-8")
    assert "- trained models: 4\n" in text
    assert "- failed: `acrobot-naive-default-0`\n" in text
    assert "- command: `symoden reproduce`\n- cores: 2\n" in text
    assert text.startswith("# Results\n")


def test_a_page_has_its_tables(page):
    text = page.read_text(encoding="utf-8")
    assert "2.0e-3 ± 1" in text
    assert "| pendulum | T1 | dissipative | default | 2 | 1.0e-3 (1.0e-3) | 2.0e-3 (0.5) |" in text
    assert "**pendulum, preset default: training trajectories [1]**\n\n| model | 16 | 320 |\n" in text
    assert "| dissipative | diverged | 4.0e-3 (4.0e-3 to 0.012) |" in text
    assert "| naive | - | 4.0e-3 |" in text


def test_a_page_without_figures_or_results_is_one(tmp_path):
    write_page(tmp_path / "empty.md", [], (), {}, {})
    assert (tmp_path / "empty.md").read_text(encoding="utf-8").startswith("# Results\n")
    assert not (tmp_path / "images").exists()

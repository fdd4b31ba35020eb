"""`symoden evaluate`."""

from dataclasses import asdict
from pathlib import Path

from symoden.data import Dataset
from symoden.experiments import (
    Bands,
    RunConfig,
    calibrate_bands,
    evaluation_solver,
    read_model,
    read_run,
    read_run_source,
    recorded_paths,
    score_bands,
)
from symoden.mechanics import AbstractDynamics
from symoden.training import hold_out, infer_posterior

from ._arguments import Evaluate
from ._figure import check_figure, save_figure
from ._learned import band_words, unseen
from ._output import print_json
from ._scores import report_scores

MOST_DRAWN = 8


def run(command: Evaluate) -> None:
    """Score the model of a run.

    Args:
        command: What to do.
    """
    check_figure(command.figure)
    config = read_run(command.run)
    model = read_model(command.run)
    source = read_run_source(config, command.source)
    scores = report_scores(model, config, source, json=command.general.json)
    bands = score = None
    if command.bands:
        own = source if command.source is None else read_run_source(config)
        bands = _bands(model, config, own.dataset)
        score = score_bands(bands, source.dataset.test)
    if command.figure is not None:
        _draw(model, config, source.dataset, bands, command.figure)
    if command.general.json:
        print_json(scores if score is None else scores | {"bands": asdict(score)})
        return
    if score is not None:
        print(f"\n{band_words(score)}")
    if command.figure is not None:
        print(f"\nrecordings and rollouts are drawn in {command.figure}")


def _bands(model: AbstractDynamics, config: RunConfig, own: Dataset) -> Bands:
    """Bands from the run's own data."""
    posterior = infer_posterior(model, own, config.training)
    return calibrate_bands(posterior, hold_out(own, config.training), solver=evaluation_solver(config))


def _draw(model: AbstractDynamics, config: RunConfig, dataset: Dataset, bands: Bands | None, path: Path) -> None:
    """Draw the first recordings that were not trained on."""
    from symoden.report import draw_recorded

    chosen = unseen(dataset)[1][:MOST_DRAWN]
    solver = evaluation_solver(config)
    paths = recorded_paths(model, chosen, hold=dataset.hold, solver=solver, bands=bands)
    save_figure(draw_recorded(paths, config.data.position_names), path)

"""`symoden evaluate`."""

import dataclasses
from dataclasses import asdict

from symoden.data import Dataset, Trajectory
from symoden.experiments import (
    BandScore,
    RunConfig,
    evaluation_solver,
    read_model,
    read_run,
    read_run_source,
    score_bands,
)
from symoden.mechanics import AbstractDynamics
from symoden.training import hold_out, infer_posterior

from ._arguments import Evaluate
from ._output import number, print_json
from ._scores import report_scores


def run(command: Evaluate) -> None:
    """Score the model of a run.

    Args:
        command: What to do.
    """
    config = read_run(command.run)
    model = read_model(command.run)
    source = read_run_source(config, command.source)
    scores = report_scores(model, config, source, json=command.general.json)
    bands = None
    if command.bands:
        own = source if command.source is None else read_run_source(config)
        bands = _bands(model, config, own.dataset, source.dataset.test)
    if command.general.json:
        print_json(scores if bands is None else scores | {"bands": asdict(bands)})
    elif bands is not None:
        print(
            f"\n{bands.level:.0%} bands over windows of 1 s cover {bands.coverage:.1%} of the positions of the "
            f"{bands.split} recordings; median half width {number(bands.half_width)}, {bands.from_parameters:.0%} of "
            f"the variance from uncertain parameters; width set by the {bands.calibrated_on} recordings"
        )


def _bands(model: AbstractDynamics, config: RunConfig, own: Dataset, test: tuple[Trajectory, ...]) -> BandScore:
    """Bands from the run's own data, judged on recordings that were not trained on."""
    posterior = infer_posterior(model, own, config.training)
    judged = dataclasses.replace(hold_out(own, config.training), test=test)
    return score_bands(posterior, judged, solver=evaluation_solver(config))

"""`symoden evaluate`."""

from dataclasses import asdict

from symoden.experiments import read_model, read_posterior, read_run, read_run_source, score_bands

from ._arguments import Evaluate
from ._figure import check_figure, save_figure
from ._learned import band_words, bands_of, draw_unseen
from ._output import print_json
from ._scores import report_scores


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
        bands = bands_of(read_posterior(command.run, model, config, own.dataset), config, own.dataset)
        score = score_bands(bands, source.dataset.test)
    if command.figure is not None:
        save_figure(draw_unseen(model, config, source.dataset, bands), command.figure)
    if command.general.json:
        print_json(scores if score is None else scores | {"bands": asdict(score)})
        return
    if score is not None:
        print(f"\n{band_words(score)}")
    if command.figure is not None:
        print(f"\nrecordings and rollouts are drawn in {command.figure}")

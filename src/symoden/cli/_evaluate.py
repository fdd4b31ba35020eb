"""`symoden evaluate`."""

from dataclasses import asdict
from pathlib import Path

from symoden.evaluation import Bands, BandScore, score_bands
from symoden.experiments import RunConfig, Source, read_model, read_run, read_run_source
from symoden.mechanics import AbstractDynamics
from symoden.storage import StorageError

from ._arguments import Evaluate
from ._figure import check_figure, save_figure
from ._learned import bands_of, draw_unseen, name_untold_inputs, own_source, posterior_of
from ._other_data import name_other_data
from ._output import print_json
from ._scores import report_scores
from ._words import band_words, name_unfinished


def run(command: Evaluate) -> None:
    """Score the model of a run.

    Args:
        command: What to do.
    """
    check_figure(command.figure)
    config = read_run(command.run)
    model = read_model(command.run)
    name_unfinished(config)
    if command.source is None:
        source = own = own_source(config)
    else:
        source = read_run_source(config, command.source)
        name_other_data(config, source)
        own = own_source(config) if command.bands else None
    scores = report_scores(model, config, source, own=own, json=command.general.json)
    bands, score, missing = None, None, ""
    if command.bands and own is not None:
        bands, score, missing = _bands(command.run, config, model, own, source)
    if bands is not None:
        name_untold_inputs(command.run, model, config, bands.posterior)
    if command.figure is not None:
        save_figure(draw_unseen(model, config, source.dataset, bands, scores.disturbed), command.figure)
    if command.general.json:
        found = {"unavailable": missing} if score is None else asdict(score)
        print_json(scores.values | ({"bands": found} if command.bands else {}))
        return
    if command.bands:
        print(f"\n{f'no bands: {missing}' if score is None else band_words(score)}")
    if command.figure is not None:
        print(f"\nrecordings and rollouts are drawn in {command.figure}")


def _bands(
    run: Path, config: RunConfig, model: AbstractDynamics, own: Source, source: Source
) -> tuple[Bands | None, BandScore | None, str]:
    """Bands of the run's rollouts, what they cover of the test recordings, and why one of both is missing."""
    bands = None
    try:
        bands = bands_of(posterior_of(run, model, config, own.dataset), config, own.dataset)
        return bands, score_bands(bands, source.dataset.test), ""
    except StorageError:
        raise
    except ValueError as error:  # Too few windows, too many parameters, or no test: other scores are worth having.
        return bands, None, str(error)

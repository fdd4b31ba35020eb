"""`symoden evaluate`."""

from symoden.experiments import read_model, read_run, read_run_source

from ._arguments import Evaluate
from ._output import print_json
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
    if command.general.json:
        print_json(scores)

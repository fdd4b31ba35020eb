"""Moments of test recordings that a run's model does not explain, though it does what comes before and after."""

import contextlib
from typing import TypeAlias

from symoden.data import Dataset
from symoden.experiments import RunConfig, Source, read_run_source
from symoden.mechanics import AbstractDynamics
from symoden.training import Span, find_disturbances
from symoden.wording import spans_in_words

from ._warnings import said_before

Disturbed: TypeAlias = tuple[Span, ...]


def disturbed_tests(
    model: AbstractDynamics, config: RunConfig, source: Source, *, own: Source | None = None
) -> Disturbed:
    """Find moments of test recordings that spoil errors without telling much of the model.

    Args:
        model: The run's model.
        config: Settings of the run.
        source: What it is scored on: its own data, or others.
        own: The run's own data, where they have been read.

    Returns:
        Spans by the recordings' names; none of a task, which is simulated, nor of a run whose training has not ended or
        whose data are gone.
    """
    tests = source.dataset.test
    if config.trained is None or source.task is not None or not tests:
        return ()
    dataset = _trained_on(config, source, own)
    if dataset is None:
        return ()
    found = find_disturbances(model, tests, dataset, config.training, hold=source.dataset.hold)
    return tuple((each.name, *span) for each, spans in zip(tests, found, strict=True) for span in spans)


def _trained_on(config: RunConfig, source: Source, own: Source | None) -> Dataset | None:
    """The run's data, if they are still there, and as they were."""
    if own is None and source.dataset.digest != config.data.digest:
        with said_before(), contextlib.suppress(ValueError):
            own = read_run_source(config)
    same = (each.dataset for each in (source, own) if each is not None and each.dataset.digest == config.data.digest)
    return next(same, None)


def disturbed_words(disturbed: Disturbed) -> str:
    """What to say of such moments.

    Args:
        disturbed: Spans of test recordings.

    Returns:
        The words; none without any.
    """
    if not disturbed:
        return ""
    return (
        f"{spans_in_words(disturbed)}, of test recordings: something moves the machine there that neither its inputs "
        "nor the model explains, as a push, a stop, a wrong sample or what training has not seen does. Errors count it."
    )

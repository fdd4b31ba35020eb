"""`symoden report`."""

import importlib.util
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from symoden.evaluation import score_bands
from symoden.experiments import RunConfig
from symoden.storage import StorageError
from symoden.wording import number

from ._arguments import Report
from ._learned import MOST_DRAWN, Learned, changed_words, draw_unseen, unseen
from ._output import TableText, print_json
from ._scores import scores_of
from ._tables import facts, tables
from ._words import audit_words, band_words, certainty_words, name_unfinished, training_words

if TYPE_CHECKING:
    from symoden.report import PageSection, PageTable


def run(command: Report) -> None:
    """Write the page of a run.

    Args:
        command: What to do.

    Raises:
        ValueError: If the page could not be written, for its name or for what is not installed.
    """
    if command.out.suffix.lower() != ".html":
        raise ValueError(f"`--out` must end in .html; got `{command.out}`.")
    for module, name in (("jinja2", "Jinja2"), ("matplotlib", "matplotlib")):
        if importlib.util.find_spec(module) is None:
            raise ValueError(f'HTML reports need {name}; it is not installed. Install "symoden[report]".')
    from symoden.report import write_html

    learned = Learned.of(command.run)
    config = learned.config
    name_unfinished(config)
    if learned.source is None:
        print(f"warning: the page has no predictions: {learned.missing}", file=sys.stderr)
    sections = [
        *_predictions(learned),
        _blocks(learned),
        _audit(learned),
        _training(command.run, config),
        _settings(config),
    ]
    lead = f"{config.model.kind.capitalize()} model of {config.source}, configuration space {config.data.space}."
    write_html(command.out, title=f"symoden: {command.run.resolve().name}", lead=lead, sections=sections)
    if command.general.json:
        print_json({"run": str(command.run), "out": str(command.out)})
    else:
        print(f"the page is {command.out}")


def _predictions(learned: Learned) -> Iterator["PageSection"]:
    """How well recordings are predicted; nothing where the data cannot be read."""
    from symoden.report import PageSection

    if learned.source is None:
        return
    model, config, dataset = learned.model, learned.config, learned.source.dataset
    split, recordings = unseen(dataset)
    bands, words = None, []
    try:
        bands = learned.bands()
        if bands is not None:
            words.append(f"{band_words(score_bands(bands, recordings, split=split))}.")
    except ValueError as error:
        bands, words = None, [str(error)]
    drawn = min(MOST_DRAWN, len(recordings))
    scores = scores_of(model, config, learned.source)
    changed = changed_words(config, learned.source)
    words[:0] = [f"Warning: {each}" for each in ([changed] if changed else []) + scores.warnings]
    yield PageSection(
        heading="Predictions",
        words=words,
        figure=draw_unseen(model, config, dataset, bands, scores.disturbed),
        caption=f"The first {drawn} of {len(recordings)} {split} recordings, and rollouts along them.",
        tables=[_text(scores.table)],
    )


def _blocks(learned: Learned) -> "PageSection":
    """What was learned."""
    from symoden.report import PageSection

    found, certain = learned.inspect()
    figure = None if found.velocities is None else learned.draw()
    return PageSection(
        heading="What was learned",
        words=list(map(_sentence, certainty_words(certain, learned.uncertain))),
        figure=figure,
        caption="Along each coordinate the others are in the middle of the data.",
        tables=[
            _text(TableText("", ("", ""), list(facts(found)))),
            *map(_text, tables(found, certain, learned.config)),
        ],
        folded=True,
    )


def _audit(learned: Learned) -> "PageSection":
    """The power audit."""
    from symoden.report import PageSection

    words = list(map(_sentence, audit_words(*learned.audit(), learned.missing)))
    return PageSection(heading="Power audit", words=words)


def _training(run: Path, config: RunConfig) -> "PageSection":
    """How training went."""
    from symoden.report import PageSection, draw_training

    words = list(map(_sentence, training_words(config)))
    path = run / "metrics.jsonl"
    try:
        metrics = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        figure = draw_training(metrics)
    except FileNotFoundError:
        return PageSection(heading="Training", words=[*words, "No `metrics.jsonl` was kept."])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StorageError(f"`{path}` is damaged: {error}. Restore it, or remove it.") from None
    return PageSection(heading="Training", words=words, figure=figure, caption="Losses of every stage of training.")


def _settings(config: RunConfig) -> "PageSection":
    """Everything that the run was told."""
    from symoden.report import PageSection

    def flat(value: object, name: str) -> Iterator[tuple[str, str]]:
        if isinstance(value, dict) and value:
            for key, item in value.items():
                yield from flat(item, f"{name}.{key}" if name else str(key))
        else:
            yield name, str(value)

    rows = list(flat(asdict(config), ""))
    table = TableText("config.json", ("setting", "value"), rows)
    return PageSection(heading="Settings and versions", tables=[_text(table)], folded=True)


def _sentence(line: str) -> str:
    """A line of the terminal as a sentence."""
    return f"{line[0].upper()}{line[1:].rstrip('.')}."


def _text(table: TableText) -> "PageTable":
    """A table with its numbers in words."""
    from symoden.report import PageTable

    rows = [[number(cell) if isinstance(cell, float) else str(cell) for cell in row] for row in table.rows]
    return PageTable(title=table.title, columns=table.columns, rows=rows)

"""A run that left spans of its recordings out says so, and is not judged by these."""

import dataclasses
import json

import pytest

from symoden.cli import main
from symoden.experiments import TrainingSummary, read_run, read_run_source, undisturbed, write_run

from .conftest import write_untrained_run

SPAN = ("a", 0.98, 1.22)


@pytest.fixture
def run(described, tmp_path):
    folder = write_untrained_run(tmp_path / "run", described)
    config = read_run(folder)
    training = dataclasses.replace(config.training, left_out=(SPAN,))
    trained = TrainingSummary(outcome="converged", completed=True, seconds=1.0, verdicts={})
    write_run(folder, dataclasses.replace(config, training=training, trained=trained))
    return folder


def test_settings_keep_what_was_left_out(run):
    assert read_run(run).training.left_out == (SPAN,)


def test_scores_are_of_what_is_left(run, capsys):
    assert main(["evaluate", str(run), "--json"]) == 0
    scores = json.loads(capsys.readouterr().out.splitlines()[-1])["recordings"]
    assert [(each["name"], each["split"], each["samples"]) for each in scores] == [
        ("a#1", "train", 55),
        ("b", "test", 60),
    ]


def test_other_data_are_scored_as_they_are(run):
    config = read_run(run)
    dataset = read_run_source(config).dataset
    assert [each.name for each in undisturbed(config, dataset).train] == ["a#1"]
    other = dataclasses.replace(dataset, test=())
    assert undisturbed(config, other) is other


def test_inspect_names_it(run, capsys):
    assert main(["inspect", str(run)]) == 0
    assert "left out of training, as disturbed: `a` from 0.98 to 1.22 s" in capsys.readouterr().out

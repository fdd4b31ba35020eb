"""A run that left spans of its recordings out says so, and is not judged by these."""

import dataclasses
import json

import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from symoden.cli import _disturbed, _learned, main
from symoden.experiments import TrainingSummary, read_model, read_run, read_run_source, undisturbed, write_run

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


@pytest.fixture
def pushed(monkeypatch):
    """What is found of any test recordings: the first one is pushed."""
    asked = []

    def found(model, recordings, dataset, config, *, hold):
        asked.append((dataset, config.left_out, hold))
        return ((SPAN[1:],), *[()] * (len(recordings) - 1))

    monkeypatch.setattr(_disturbed, "find_disturbances", found)
    return asked


def test_disturbances_of_test_recordings_are_named_and_marked(run, described, pushed, tmp_path, capsys):
    assert main(["evaluate", str(run), "--json"]) == 0
    printed = capsys.readouterr()
    answer = json.loads(printed.out.splitlines()[-1])
    assert answer["disturbed"] == [["b", *SPAN[1:]]]
    assert answer["recordings"][-1]["samples"] == 60  # Nothing is left out.
    assert "warning: `b` from 0.98 to 1.22 s, of test recordings: something moves the machine" in printed.err
    assert main(["report", str(run), "--out", str(tmp_path / "page.html")]) == 0
    assert "Warning: `b` from 0.98 to 1.22 s, of test recordings" in (tmp_path / "page.html").read_text()
    capsys.readouterr()
    other = described.with_name("other.toml")
    other.write_text(described.read_text().replace("space", 'hold = "linear"\nspace'))
    assert main(["evaluate", str(run), str(other)]) == 0
    assert "`b` from 0.98" in capsys.readouterr().err
    own = read_run_source(read_run(run)).dataset
    assert [(dataset.digest, spans, hold) for dataset, spans, hold in pushed] == [
        (own.digest, (SPAN,), hold) for hold in ("zero", "zero", "linear")
    ]


def test_a_run_whose_data_are_gone_has_no_bands_and_says_so_before_its_scores(run, described, pushed, capsys):
    other = described.with_name("other.toml")
    other.write_text(described.read_text())
    described.unlink()
    assert main(["evaluate", str(run), str(other), "--bands"]) == 2
    printed = capsys.readouterr()
    assert "there is no such file" in printed.err
    assert printed.out == ""
    assert main(["evaluate", str(run), str(other)]) == 0


def test_what_has_been_read_is_not_read_again(run, described, pushed, monkeypatch):
    config, model = read_run(run), read_model(run)
    own = read_run_source(config)
    monkeypatch.setattr(_disturbed, "read_run_source", lambda *_: pytest.fail("It was handed over."))
    other = dataclasses.replace(own, dataset=dataclasses.replace(own.dataset, hold="linear"))
    assert other.dataset.digest != own.dataset.digest
    assert _disturbed.disturbed_tests(model, config, other, own=own) == (("b", *SPAN[1:]),)
    assert _disturbed.disturbed_tests(model, config, other, own=other) == ()


def test_nothing_is_looked_for_without_the_runs_data_or_in_a_task(run, described, pushed, task_run):
    config, model = read_run(run), read_model(run)
    source = read_run_source(config)
    changed = dataclasses.replace(config, data=dataclasses.replace(config.data, digest="other"))
    gone = dataclasses.replace(changed, source=str(described.with_name("gone.toml")))
    unfinished = dataclasses.replace(config, trained=None)
    untested = dataclasses.replace(source, dataset=dataclasses.replace(source.dataset, test=()))
    for each in (changed, gone, unfinished):
        assert _disturbed.disturbed_tests(model, each, source) == ()
    assert _disturbed.disturbed_tests(model, config, untested) == ()
    task = dataclasses.replace(read_run(task_run), trained=config.trained)
    assert _disturbed.disturbed_tests(model, task, read_run_source(task)) == ()
    assert pushed == []
    assert _disturbed.disturbed_tests(model, config, source) == (("b", *SPAN[1:]),)


def marked(model, config, dataset, disturbed=()):
    """Begin and end of what is grey in every panel, and what the legend has."""
    drawn = _learned.draw_unseen(model, config, dataset, None, disturbed)
    edges = [
        [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in ax.patches if isinstance(patch, Rectangle)]
        for ax in drawn.axes
    ]
    return edges, [text.get_text() for text in drawn.legends[0].get_texts()]


@pytest.mark.parametrize("begun", [0.0, 1.7e9])
def test_figures_mark_spans_of_their_recordings(run, begun):
    config, model = read_run(run), read_model(run)
    dataset = read_run_source(config).dataset
    (test,) = dataset.test
    dataset = dataclasses.replace(dataset, test=(dataclasses.replace(test, ts=test.ts + begun),))
    known = ("b", 0.1, 0.3), ("b", 0.5, 0.6), ("c", 1.0, 2.0)
    spans = tuple((name, begun + start, begun + end) for name, start, end in known)
    (edges,), words = marked(model, config, dataset, spans)
    assert edges == [pytest.approx((0.1, 0.3), abs=1e-6), pytest.approx((0.5, 0.6), abs=1e-6)]
    assert words[-1] == "disturbed"
    (edges,), words = marked(model, config, dataset)
    assert edges == []
    assert "disturbed" not in words


def test_figures_of_training_alone_mark_what_was_left_out(run):
    config, model = read_run(run), read_model(run)
    untested = dataclasses.replace(read_run_source(config).dataset, test=())
    known = dataclasses.replace(config, data=dataclasses.replace(config.data, digest=untested.digest))
    assert marked(model, known, untested)[0] == [[pytest.approx(SPAN[1:])]]
    assert marked(model, config, untested)[0] == [[]]  # Other data, of the same name.


@pytest.mark.parametrize("command", ["evaluate", "report"])
def test_commands_mark_what_they_name(command, run, pushed, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("symoden.report.draw_recorded", lambda paths, titles, spans: drawn.append(spans) or Figure())
    option = {"evaluate": ["--figure", "a.png"], "report": ["--out", "a.html"]}[command]
    assert main([command, str(run), option[0], str(tmp_path / option[1])]) == 0
    assert drawn == [[[SPAN[1:]]]]

"""The page of a run, and the figures of `inspect` and `evaluate`."""

import dataclasses
import importlib.util
import json
import re
import shutil
from html.parser import HTMLParser

import pytest

from symoden.cli import main

from .conftest import SMALL, write_recording, write_untrained_run

VOID = {"meta", "link", "br", "img", "hr", "input"}


class Page(HTMLParser):
    """Headings and texts of cells; every element that is opened must be closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.texts = [], {}
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            assert name not in {"src", "onload"}, value
            if name in {"href", "xlink:href"}:
                assert (value or "").startswith("#"), "the page must need no other file"
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and data.strip():
            self.texts.setdefault(self.open[-1], []).append(data.strip())


@pytest.fixture
def trained(arm_run, tmp_path):
    """A run with metrics."""
    folder = tmp_path / "run"
    shutil.copytree(arm_run, folder)
    lines = [
        {"stage": stage, "step": k, "steps": 2, "loss": loss, "validation": None, "seconds": seconds}
        for stage, k, loss, seconds in (("adam", 1, 0.5, 1.0), ("adam", 2, None, 2.0), ("growth", 1, 0.1, 3.0))
    ]
    (folder / "metrics.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    return folder


def test_the_page_needs_no_other_file_and_has_what_inspect_and_evaluate_print(trained, tmp_path, capsys):
    path = tmp_path / "report.html"
    assert main(["report", str(trained), "--out", str(path)]) == 0
    assert str(path) in capsys.readouterr().out
    page = Page(path.read_text())
    assert page.texts["h2"] == ["Predictions", "What was learned", "Power audit", "Training", "Settings and versions"]
    assert len(re.findall("<svg", path.read_text())) == 3
    assert main(["inspect", str(trained)]) == 0
    printed = capsys.readouterr().out
    shown = " ".join(page.texts["td"])
    for number in re.findall(r"\S+ ± \S+", printed.partition("certainty")[0]):
        assert number in shown
    assert main(["evaluate", str(trained), "--bands"]) == 0
    sentence = capsys.readouterr().out.splitlines()[-1]
    assert any(sentence in text for text in page.texts["p"])


def test_equal_runs_have_equal_pages(trained, tmp_path):
    paths = [tmp_path / f"{k}.html" for k in range(2)]
    for path in paths:
        assert main(["report", str(trained), "--out", str(path)]) == 0
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_run_without_its_data_or_metrics_has_a_page_all_the_same(arm_run, tmp_path, capsys):
    folder, path = tmp_path / "run", tmp_path / "report.html"
    shutil.copytree(arm_run, folder)
    config = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps(config | {"source": "/nowhere/<arm>.toml", "beside": ""}))
    assert main(["report", str(folder), "--out", str(path)]) == 0
    page = Page(path.read_text())
    assert "Predictions" not in page.texts["h2"]
    assert any("cannot be read" in text for text in page.texts["p"])
    assert not any(".." in text for text in page.texts["p"])
    assert "warning: the page has no predictions: `/nowhere/<arm>.toml` must be" in capsys.readouterr().err


def test_the_page_says_that_the_data_have_changed(described, tmp_path):
    folder, path = write_untrained_run(tmp_path / "run", described), tmp_path / "report.html"
    write_recording(described.with_name("a.csv"), samples=70)
    assert main(["report", str(folder), "--out", str(path)]) == 0
    assert any("the data are no longer those" in text for text in Page(path.read_text()).texts["p"])


def test_tasks_have_a_page(task_run, tmp_path):
    path = tmp_path / "report.html"
    assert main(["report", str(task_run), "--out", str(path)]) == 0
    assert any("1.04 ± 1.3" in text for text in Page(path.read_text()).texts["td"])  # the paper's, beside ours


@pytest.mark.parametrize("kind", ["naive", "unstructured"])
def test_models_without_blocks_of_their_own_can_be_looked_at(kind, tmp_path, arm, capsys):
    model = dataclasses.replace(SMALL, kind=kind)
    folder, path = write_untrained_run(tmp_path / kind, arm, model), tmp_path / "report.html"
    assert main(["report", str(folder), "--out", str(path)]) == 0
    page = Page(path.read_text())
    assert "Predictions" in page.texts["h2"]
    assert any("no M, V, g and D of its own" in text for text in page.texts["p"])
    assert main(["inspect", str(folder)]) == 0
    capsys.readouterr()
    assert main(["evaluate", str(folder), "--bands"]) == 0
    assert "bands" in capsys.readouterr().out


def test_inspect_and_evaluate_draw(arm_run, tmp_path, capsys):
    for k, words in enumerate((["inspect"], ["evaluate"], ["evaluate", "--bands"])):
        path = tmp_path / f"{k}.png"
        assert main([words[0], str(arm_run), *words[1:], "--figure", str(path)]) == 0
        assert str(path) in capsys.readouterr().out
        assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("report", "{run}", "--out", "report.pdf"), "`--out` must end in .html; got `report.pdf`"),
        (("inspect", "{run}", "--figure", "a.gif"), "`--figure` must end in one of .png, .pdf, .svg; got `a.gif`"),
        (("evaluate", "{run}", "--figure", "a.gif"), "`--figure` must end in one of .png, .pdf, .svg; got `a.gif`"),
    ],
)
def test_refusals(arm_run, capsys, words, message):
    assert main([word.format(run=arm_run) for word in words]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("module", ["jinja2", "matplotlib"])
def test_what_is_not_installed_is_named(arm_run, tmp_path, capsys, monkeypatch, module):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == module else find(name, *rest))
    assert main(["report", str(arm_run), "--out", str(tmp_path / "a.html")]) == 2
    assert 'Install "symoden[report]"' in capsys.readouterr().err

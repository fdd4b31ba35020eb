"""The tutorial does what it says, on the measured arm and on a small budget."""

import os
import re
import subprocess
import sys
from pathlib import Path

import jax
import pytest

import symoden
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.training import TrainingConfig, hold_out
from symoden.training._line_up import line_up

ROOT = Path(__file__).parents[1]
TUTORIAL = ROOT / "docs" / "tutorial.md"
TRAIN = "symoden train arm.toml --out runs/arm"
LEFT_OUT = ("143704", "143747", "143906", "144115", "144003", "154548")


def on_a_budget(code):
    """The same with a third of the recordings, half of the samples and little time."""
    lines = [line for line in code.splitlines() if not any(f"-{name}.csv" in line for name in LEFT_OUT)]
    return "\n".join(lines).replace(TRAIN, f"{TRAIN} --max-minutes 0.2").replace("resample = 0.01", "resample = 0.02")


@pytest.fixture(scope="module")
def data():
    """Folder of the measured data."""
    folder = Path(os.environ.get("SYMODEN_DATA") or ROOT.parent / "shared" / "data")
    if not (folder / "dfki-double-pendulum").is_dir():
        pytest.skip(f"no data of the DFKI's arm in {folder}; name their folder by SYMODEN_DATA")
    return folder.resolve()


def test_every_line_of_the_tutorial_runs(tmp_path, data):
    blocks = re.findall(r"^```(sh|python)\n(.*?)^```$", TUTORIAL.read_text(), flags=re.MULTILINE | re.DOTALL)
    assert sum(TRAIN in text for _, text in blocks) == 1
    shells = {"sh": ["bash", "-euo", "pipefail", "-c"], "python": [sys.executable, "-c"]}
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    said = []
    for language, text in blocks:
        code = on_a_budget(text)
        done = subprocess.run(
            [*shells[language], code],
            cwd=tmp_path,
            env=os.environ | {"PATH": path, "SYMODEN_DATA": str(data)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{code}\n{done.stderr}"
        said.append(done.stdout)
    for name in ("check.png", "predictions.png", "learned.png", "report.html", "paths.npz"):
        assert (tmp_path / name).stat().st_size > 0
    assert "friction, joint 1 [N m]" in said[-2]


def test_every_stage_of_the_arm_s_training_is_explained(data, monkeypatch):
    monkeypatch.setenv("SYMODEN_DATA", str(data))
    dataset = symoden.read_dataset(ROOT / "examples" / "dfki-c1.toml")
    config = TrainingConfig()
    model = build(
        ModelConfig(),
        Space.parse(dataset.space),
        dataset.inputs,
        input_matrix=dataset.input_matrix,
        key=jax.random.key(0),
    )
    stages = {stage.name for stage in line_up(hold_out(dataset, config), model, [model], config)}
    told = re.findall(r"`([^`\n]+)`", TUTORIAL.read_text())
    assert len(stages) > 10
    assert {re.sub(": .*| [0-9]+ of [0-9]+$", "", name) for name in stages} - {"longer windows 4x", *told} == set()


def test_the_pictures_of_the_tutorial_are_there():
    shown = re.findall(r"!\[[^\]]*\]\(([^)]*)\)", TUTORIAL.read_text())
    assert shown
    assert [name for name in shown if not (TUTORIAL.parent / name).is_file()] == []

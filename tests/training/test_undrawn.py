"""Where no weights are drawn: a motor whose place tells nothing, from our guess or from a user's."""

import numpy as np
import pytest

from symoden.data import read_dataset
from symoden.models import ModelConfig
from symoden.training import TrainingConfig
from symoden.training._adam_stage import AdamStage
from symoden.training._prepare import prepare


def motor(known):
    """Four steps of a motor from rest, to learn from."""
    ts = np.linspace(0, 1, 120)
    tables = {
        f"m{level}": {
            "t": ts,
            "q": 0.1 * level * (ts - 0.1 * (1 - np.exp(-10 * ts))),
            "u": np.full(120, 1.0 * level),
        }
        for level in (100, 60, -100, -40)
    }
    said = {"space": "R1", "time": "t", "positions": ["q"], "inputs": ["u"], "train": {"files": list(tables)}}
    return read_dataset(said | {"known": known}, tables=tables)


@pytest.mark.parametrize(
    ("known", "first", "adams"),
    [
        ({"cyclic": ["q1"]}, ["regression", "regression: friction", "regression: directions"], 1),
        ({"potential_energy": "0"}, ["regression", "regression: friction", "regression: directions"], 1),
        (
            {"mass_matrix": [["m"]], "potential_energy": "0", "parameters": {"m": 1.0}},
            ["regression", "levenberg-marquardt", "friction"],
            0,
        ),
        ({}, ["adam 1 of 3", "adam 2 of 3", "adam 3 of 3"], 3),
    ],
)
def test_a_regression_comes_first_and_adam_once_where_it_finds_nothing(known, first, adams):
    prepared = prepare(motor(known), ModelConfig(), TrainingConfig())
    names = [stage.name for stage in prepared.stages]
    assert names[:3] == first
    assert sum(name.startswith("adam") for name in names) == adams
    assert all(stage.yields for stage in prepared.stages if isinstance(stage, AdamStage) and stage.name == "adam")

"""What the default preset learns of the four tasks, at looser bounds than it reaches (docs/results.md)."""

import pytest

from symoden.experiments import TASKS, Cell, run_cell

CASES = [("pendulum-canonical", "T1"), ("pendulum", None), ("cartpole", None), ("acrobot", None)]


@pytest.mark.slow
@pytest.mark.parametrize(("task", "space"), CASES)
def test_the_default_preset_recovers_the_physics_and_predicts(task, space, tmp_path):
    result = run_cell(tmp_path, Cell(task=task, model="dissipative", preset="default", seed=11, space=space))
    assert result.blocks is not None
    assert result.prediction is not None
    assert result.test is not None
    assert result.parameters is not None
    blocks, paper = result.blocks, TASKS[task].paper["dissipative"]
    assert max(blocks.inverse_mass, blocks.potential, blocks.actuation) < 0.02
    assert blocks.dissipation < 0.05
    assert result.prediction.mean < paper.prediction.mean / 10_000
    assert result.test.mean < paper.test.mean / 3_000
    assert result.parameters < 5_000

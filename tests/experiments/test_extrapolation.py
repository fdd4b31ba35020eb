"""Prediction error over how far rollouts leave the training data."""

import dataclasses

import numpy as np
import pytest

from symoden.experiments import extrapolation, free_rollouts, score_task
from symoden.integrate import RK4


@pytest.fixture(scope="module")
def found(contest):
    models = contest("pendulum-canonical", kinds=("naive", "dissipative"))
    result = extrapolation(models, free_rollouts(models), kind="naive")
    assert result is not None
    return result


def test_errors_are_those_that_the_prediction_error_is_the_mean_of(contest, found):
    models = contest("pendulum-canonical", kinds=("naive", "dissipative"))
    score = score_task(models.trained["naive"].model, models.source, solver=RK4(8))
    assert np.mean(found.errors) == pytest.approx(score.prediction.mean)


def test_a_trajectory_is_outside_if_its_truth_leaves_the_range_of_training(contest, found):
    models = contest("pendulum-canonical", kinds=("naive", "dissipative"))
    low, high = found.visited
    assert (low, high) == (found.training.min(), found.training.max())
    for truth, beyond, outside in zip(models.source.prediction, found.beyond, found.outside, strict=True):
        q = truth.q[:, 0]
        assert outside == (q.max() > high or q.min() < low)
        assert beyond == pytest.approx(max(q.max() - high, low - q.min()))
    assert len(found.positions) == len(found.deviations) == 3 * 39


def test_the_share_of_the_error_from_outside(contest):
    models = contest("pendulum-canonical", kinds=("naive", "dissipative"))
    dataset = models.source.dataset
    # One recording alone, so that some rollouts leave its range and its own does not.
    for recording in dataset.train:
        source = dataclasses.replace(models.source, dataset=dataclasses.replace(dataset, train=(recording,)))
        few = dataclasses.replace(models, source=source)
        part = extrapolation(few, free_rollouts(few), kind="naive")
        assert part is not None
        outside = part.outside
        assert part.outside_share == pytest.approx(part.errors[outside].sum() / part.errors.sum())
        medians = (part.inside_median, part.outside_median)
        for chosen, median in zip((~outside, outside), medians, strict=True):
            assert np.isnan(median) if not chosen.any() else median == np.median(part.errors[chosen])


def test_nothing_is_found_where_every_angle_is_one_or_the_model_is_missing(contest):
    told = contest("pendulum-canonical", "T1", kinds=("dissipative",))
    assert extrapolation(told, free_rollouts(told)) is None
    cartpole = contest("cartpole", kinds=("dissipative",))
    assert extrapolation(cartpole, free_rollouts(cartpole)) is None
    naive = contest("pendulum-canonical", kinds=("naive",))
    assert extrapolation(naive, free_rollouts(naive)) is None

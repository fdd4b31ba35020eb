"""Energy and circles along rollouts: of the truth, energy falls and angles stay angles."""

import dataclasses

import numpy as np
import pytest

from symoden.experiments import circle_drift, energy_curves, free_rollouts


@pytest.mark.parametrize("name", ["pendulum-canonical", "pendulum", "acrobot"])
def test_rollouts_of_the_truth_have_the_true_energy_which_falls(contest, name):
    models = contest(name, kinds=("naive", "dissipative"))
    curves = energy_curves(models, free_rollouts(models))
    assert len(curves) == 3
    assert all(set(curve.learned) == {"naive", "dissipative"} for curve in curves)
    for curve in curves:
        np.testing.assert_allclose(curve.learned["dissipative"], curve.truth, atol=1e-5)
        assert np.all(np.diff(curve.truth) <= 1e-9)
        assert len(curve.ts) == 40
        assert curve.trained == pytest.approx(curve.ts[19])


def test_energies_are_in_joules_of_the_true_system(contest):
    models = contest("pendulum", kinds=("dissipative",))
    (first,) = energy_curves(models, free_rollouts(models), count=1)
    assert first.label == "initial energy: rank 2 of 3"
    starts = [(path.q[0, 0], path.rates[0, 0]) for path in models.source.prediction]
    energies = sorted(v**2 / 6 + 5 * (1 + np.cos(q)) for q, v in starts)
    assert first.truth[0] == pytest.approx(energies[1])


def test_only_the_naive_model_leaves_the_circle(contest):
    models = contest("cartpole")
    drift = circle_drift(models, free_rollouts(models))
    assert drift is not None
    assert drift.trajectories == 3
    assert list(drift.worst) == ["naive", "geometric", "unstructured", "symoden", "dissipative"]
    assert drift.worst["naive"].max() > 1e-3
    assert all(drift.worst[kind].max() < 1e-15 for kind in drift.worst if kind != "naive")


def test_the_worst_deviation_is_that_of_any_angle_of_any_trajectory(contest):
    models = contest("acrobot", kinds=("naive",))
    rollouts = free_rollouts(models)
    observations = rollouts["naive"][2].observations.copy()
    observations[7, 1] = 3.0
    observations[9, 3] = np.nan
    rollouts["naive"][2] = dataclasses.replace(rollouts["naive"][2], observations=observations)
    drift = circle_drift(models, rollouts)
    assert drift is not None
    assert drift.worst["naive"][7] == pytest.approx(9 + observations[7, 3] ** 2 - 1)
    assert drift.worst["naive"][9] == np.inf


def test_numbers_have_no_circle(contest):
    models = contest("pendulum-canonical", kinds=("dissipative",))
    assert circle_drift(models, free_rollouts(models)) is None
    told = contest("pendulum-canonical", "T1", kinds=("dissipative",))
    assert circle_drift(told, free_rollouts(told)) is not None

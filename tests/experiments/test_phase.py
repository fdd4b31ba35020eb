"""Vector fields over the phase plane."""

import numpy as np
import pytest

from symoden.experiments import phase_plane


def test_the_field_is_that_of_the_equations_of_motion(contest):
    plane = phase_plane(contest("pendulum-canonical", kinds=("naive", "dissipative")), points=7)
    assert plane is not None
    assert (plane.coordinate, plane.rate) == ("q [rad]", "p [kg m²/s]")
    q, p = np.meshgrid(plane.q, plane.rates)
    np.testing.assert_allclose(plane.truth.q_dot, 3 * p, atol=1e-9)
    np.testing.assert_allclose(plane.truth.rate_dot, -5 * np.sin(q) - 0.1 * 3 * p, atol=1e-9)
    np.testing.assert_array_equal(plane.learned["dissipative"].q_dot, plane.truth.q_dot)
    assert plane.learned["dissipative"].error == 0.0
    assert plane.learned["naive"].error > 0.1


def test_velocities_are_shown_where_they_are_observed(contest):
    plane = phase_plane(contest("pendulum"), points=5)
    assert plane is not None
    assert plane.rate == "velocity [rad/s]"
    q, v = np.meshgrid(plane.q, plane.rates)
    np.testing.assert_allclose(plane.truth.q_dot, v, atol=1e-9)
    np.testing.assert_allclose(plane.truth.rate_dot, 15 * np.sin(q) - 0.3 * v, atol=1e-9)
    assert list(plane.learned) == ["naive", "geometric", "unstructured", "symoden", "dissipative"]
    assert all(np.all(np.isfinite(field.rate_dot)) for field in plane.learned.values())


def test_rollouts_start_where_no_model_was_trained_and_go_on_beyond_training(contest):
    models = contest("pendulum", kinds=("dissipative",))
    plane = phase_plane(models, count=4, points=3)
    assert plane is not None
    assert len(plane.trajectories) == len(plane.predictions["dissipative"]) == 4
    seen = {tuple(recording.q[0]) for recording in models.source.dataset.train}
    for truth, path in zip(plane.trajectories, plane.predictions["dissipative"], strict=True):
        assert len(truth) == 40
        assert not np.any(truth.us)
        assert tuple(truth.q[0]) not in seen
        np.testing.assert_allclose(path.q, truth.q, atol=1e-5)


def test_the_error_of_a_field_is_relative_in_each_part(contest):
    plane = phase_plane(contest("pendulum", kinds=("symoden",)), points=9)
    assert plane is not None
    learned, truth = plane.learned["symoden"], plane.truth
    parts = [
        np.mean((a - b) ** 2) / np.mean(b**2)
        for a, b in ((learned.q_dot, truth.q_dot), (learned.rate_dot, truth.rate_dot))
    ]
    assert learned.error == pytest.approx(np.sqrt(np.mean(parts)))


def test_two_coordinates_have_no_plane(contest):
    assert phase_plane(contest("cartpole", kinds=("dissipative",))) is None

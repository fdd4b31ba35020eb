"""Scores: against loops written out, exact on the true system, finite whatever a model does."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.data import Dataset, Trajectory
from symoden.evaluation import _predict, _scores, predict, score_recordings
from symoden.evaluation._bands import calibrate_bands
from symoden.evaluation._batches import Stretch
from symoden.evaluation._windows import horizon_of, short_windows
from symoden.integrate import RK4, rollout
from symoden.known import KnownParts
from symoden.models import BlockConfig, ModelConfig, build
from symoden.spaces import Space
from symoden.systems import CartPole, Pendulum
from symoden.training import TrainingConfig, infer_posterior

TRUTH = Pendulum(damping=0.2)
PLAIN = BlockConfig(constant=True)
SMALL = {"inverse_mass": PLAIN, "potential": BlockConfig(hidden=(4,)), "flow": (8,), "energy": (8,)}


def small(kind, space, inputs=1, *, momenta=False):
    config = ModelConfig(kind=kind, actuation=PLAIN, friction=PLAIN, knees=(), **SMALL)
    return build(config, Space.parse(space), inputs, momenta=momenta, key=jax.random.key(1))


def recorded(ts, *, name="swing", initial_samples=1):
    """Oscillation that no pendulum makes, under an input that changes at every sample."""
    ts = np.asarray(ts)
    us = np.sign(np.sin(7 * ts))[:, None]
    q, rates = np.sin(3 * ts)[:, None], 3 * np.cos(3 * ts)[:, None]
    return Trajectory(name=name, ts=ts, q=q, rates=rates, us=us, initial_samples=initial_samples)


@eqx.filter_jit
def roll_out(system, q0, rates0, ts, us):
    return rollout(system, q0, rates0, ts, us, solver=RK4(4))


def written_out(system, recording, start, stop):
    """Errors of the positions of one rollout."""
    part = slice(start, stop)
    columns = (recording.q[start], recording.rates[start], recording.ts[part], recording.us[part])
    path = roll_out(system, *map(jnp.asarray, columns))
    return np.asarray(path.q) - recording.q[part]


@pytest.mark.parametrize("initial_samples", [1, 6])
def test_far_from_zero_motion_has_its_digits_whatever_the_user_s_precision(initial_samples):
    near = recorded(0.05 * np.arange(21), initial_samples=initial_samples)
    far = dataclasses.replace(near, q=near.q + 2e5 * np.pi)
    with jax.enable_x64(False):
        paths = predict(TRUTH, [near, far])
    np.testing.assert_allclose(paths[1].q - 2e5 * np.pi, paths[0].q, atol=1e-8)


def test_bands_begin_where_predictions_do():
    known = KnownParts(
        mass_matrix=[[1]],
        potential_energy="k * q1**2",
        input_matrix=[[0]],
        dissipation_matrix=[[0]],
        parameters={"k": 4.5},
    )
    model = build(ModelConfig(), Space.parse("R1"), 1, known=known, key=jax.random.key(0))
    train = tuple(recorded(0.05 * np.arange(k)) for k in (61, 71))
    data = Dataset(name="d", space="R1", train=train, known=known)
    posterior = infer_posterior(model, data, TrainingConfig(lm_steps=1, growth_steps=0, relevance_steps=0))
    bands = calibrate_bands(posterior, data, solver=RK4(4))
    several, noise = recorded(0.05 * np.arange(121), initial_samples=20), np.random.default_rng(0).normal(size=(121, 2))
    several = dataclasses.replace(several, q=several.q + 0.05 * noise[:, :1], rates=several.rates + 0.1 * noise[:, 1:])
    (path,), (banded,) = predict(model, [several], solver=RK4(4)), bands.predict([several])
    np.testing.assert_allclose(banded.q, path.q, atol=1e-9)
    assert abs(path.q[0] - several.q[0]).item() > 1e-3
    assert bands.predict([Stretch.whole(several)])[0].q[0] == several.q[0]  # Of stretches it is the measured one.


def test_steps_of_less_than_a_microsecond_are_steps():
    recording = recorded(1e-7 * np.arange(601))
    assert {stop - start for start, stop in short_windows(recording, 2e-5)} == {201}


def test_windows_last_a_second_and_start_every_quarter_of_one():
    recording = recorded(0.05 * np.arange(41))
    (score,) = score_recordings(Pendulum(), Dataset(name="d", space="T1", train=(recording,)), solver=RK4(4))
    starts = range(0, 21, 5)
    errors = [np.sqrt(np.mean(written_out(Pendulum(), recording, k, k + 21)[1:] ** 2)) for k in starts]
    assert score.window_rmse.horizon_s == 1.0
    assert score.window_rmse.median == pytest.approx(np.median(errors), rel=1e-9)
    assert score.window_rmse.mean == pytest.approx(np.mean(errors), rel=1e-9)
    whole = written_out(Pendulum(), recording, 0, 41)[1:]
    assert score.rollout_rmse == pytest.approx(np.sqrt(np.mean(whole**2)), rel=1e-9)
    assert score.rollout_coordinates == pytest.approx((score.rollout_rmse,), rel=1e-12)
    assert (score.name, score.split, score.samples) == ("swing", "train", 41)


def test_windows_of_irregular_samples_never_exceed_a_second():
    steps = np.random.default_rng(0).uniform(0.02, 0.09, 60)
    recording = recorded(np.concatenate([[0.0], np.cumsum(steps)]))
    (score,) = score_recordings(Pendulum(), Dataset(name="d", space="T1", test=(recording,), train=()), solver=RK4(4))
    errors = []
    for start in np.arange(0.0, recording.duration - 1, 0.25):
        k = int(np.argmax(recording.ts >= start))
        if recording.ts[k] + 1 <= recording.ts[-1]:
            stop = k + int(np.sum((recording.ts[k:] - recording.ts[k]) <= 1))
            errors.append(np.sqrt(np.mean(written_out(Pendulum(), recording, k, stop)[1:] ** 2)))
    assert len(errors) > 3
    assert score.window_rmse.median == pytest.approx(np.median(errors), rel=1e-9)


def test_scoring_starts_after_the_initial_samples():
    recording = recorded(0.05 * np.arange(31), initial_samples=6)
    (score,) = score_recordings(Pendulum(), Dataset(name="d", space="T1", train=(recording,)), solver=RK4(4))
    errors = [np.sqrt(np.mean(written_out(Pendulum(), recording, k, k + 21)[1:] ** 2)) for k in (5, 10)]
    assert score.window_rmse.mean == pytest.approx(np.mean(errors), rel=1e-9)
    whole = written_out(Pendulum(), recording, 0, 31)[6:]
    assert score.rollout_rmse == pytest.approx(np.sqrt(np.mean(whole**2)), rel=1e-9)


def test_every_window_is_compared_with_its_own_motion():
    """Rows at two rates: rollouts are made in groups of like lengths, which is not the order of the windows."""
    slow, fast = 0.05 * np.arange(1, 41), 0.01 * np.arange(1, 201)
    ts = np.concatenate([[0.0], slow, 2.0 + fast, 4.0 + slow])
    q, rates = (np.exp(-ts / 3) * np.sin(3 * ts))[:, None], np.zeros((len(ts), 1))
    recording = Trajectory(name="uneven", ts=ts, q=q, rates=rates, us=np.zeros((len(ts), 1)))
    (score,) = score_recordings(Pendulum(), Dataset(name="d", space="T1", train=(recording,)), solver=RK4(4))
    edges = list(short_windows(recording, horizon_of(Dataset(name="d", space="T1", train=(recording,)))))
    ways = [recording.q[start + 1 : stop] - recording.q[start] for start, stop in edges]
    moved = np.array([np.sqrt(np.mean(way**2)) for way in ways])
    errors = np.array([np.sqrt(np.mean(written_out(Pendulum(), recording, *each)[1:] ** 2)) for each in edges])
    weights = np.maximum(moved, np.minimum(errors, moved.max()))
    middle = [float(np.quantile(each, 0.5, weights=weights, method="inverted_cdf")) for each in (errors, moved)]
    assert [score.in_motion.error, score.in_motion.motion] == pytest.approx(middle, rel=1e-9)


def test_windows_at_rest_do_not_hide_what_motion_is_predicted_like():
    ts = 0.05 * np.arange(201)
    late = np.maximum(ts - 7.9, 0.0)
    q, rates = 0.3 * (1 - np.cos(4 * late))[:, None], 1.2 * np.sin(4 * late)[:, None]
    recording = Trajectory(name="kicked", ts=ts, q=q, rates=rates, us=np.zeros((201, 1)))
    (score,) = score_recordings(Pendulum(), Dataset(name="d", space="T1", train=(recording,)), solver=RK4(4))
    assert score.window_rmse.median < 1e-9
    assert 0.2 < score.in_motion.motion < 0.6
    assert 0.05 < score.in_motion.error < 1.0
    assert 0.2 < score.in_motion.coasting < 1.5


@pytest.mark.parametrize("momenta", [False, True])
def test_what_goes_on_as_at_first_coasts_exactly(momenta):
    ts = 0.05 * np.arange(41)
    wheel = Trajectory(name="wheel", ts=ts, q=3.0 * ts[:, None], rates=np.full((41, 1), 3.0), us=np.zeros((41, 1)))
    system = Pendulum(momenta=momenta)
    (score,) = score_recordings(system, Dataset(name="d", space="T1", train=(wheel,), momenta=momenta), solver=RK4(4))
    assert score.in_motion.motion > 1
    assert np.isnan(score.in_motion.coasting) if momenta else score.in_motion.coasting < 1e-9


def test_a_rest_that_is_predicted_to_end_counts():
    """Dry friction holds a pendulum aside; the model has none."""
    ts = 0.05 * np.arange(201)
    q, rates = np.where(ts < 8, 0.4, 0.4 * np.cos(3 * (ts - 8)))[:, None], np.zeros((201, 1))
    recording = Trajectory(name="held", ts=ts, q=q, rates=rates, us=np.zeros((201, 1)))
    (score,) = score_recordings(Pendulum(), Dataset(name="d", space="T1", train=(recording,)), solver=RK4(4))
    assert score.in_motion.error > 0.3


def test_lengths_and_angles_are_scored_each_by_itself_too():
    ts = 0.05 * np.arange(31)
    q = np.stack([0.3 * np.sin(3 * ts), 0.1 * np.cos(2 * ts)], axis=1)
    rates = np.stack([0.9 * np.cos(3 * ts), -0.2 * np.sin(2 * ts)], axis=1)
    recording = Trajectory(name="swing", ts=ts, q=q, rates=rates, us=np.zeros((31, 1)))
    (score,) = score_recordings(CartPole(), Dataset(name="d", space="R1 T1", train=(recording,)), solver=RK4(4))
    errors = [written_out(CartPole(), recording, k, k + 21)[1:] for k in (0, 5, 10)]
    each = np.sqrt(np.mean(np.square(errors), axis=1))
    assert score.coordinates == pytest.approx(np.median(each, axis=0), rel=1e-9)
    moved = [q[k + 1 : k + 21] - q[k] for k in (0, 5, 10)]
    assert score.motion == pytest.approx(np.sqrt(np.mean(np.square(moved))), rel=1e-9)
    both = np.sqrt(np.mean(np.square(errors), axis=(1, 2)))
    assert (score.window_rmse.median, score.window_rmse.mean) == pytest.approx((np.median(both), both.mean()), rel=1e-9)


@pytest.mark.parametrize("turns", [0, 3])
@pytest.mark.parametrize("width", [1.0, 0.02])
def test_rollouts_are_compared_with_the_range_of_all_recordings(turns, width):
    ts = 0.05 * np.arange(101)
    q = np.stack([width * np.sin(3 * ts) / 2, 0.1 * np.cos(2 * ts)], axis=1)
    rates = np.stack([np.full_like(ts, 3.0), np.full_like(ts, 9.0)], axis=1)  # Both go where no recording does.
    train = Trajectory(name="a", ts=ts, q=q, rates=rates, us=np.zeros((101, 1)))
    other = dataclasses.replace(train, name="b", q=q * [0.0, 1.0] + [1.0 - width / 2, 2 * np.pi * turns])
    third = dataclasses.replace(train, name="c", q=-q * [0.0, 1.0])
    dataset = Dataset(name="d", space="R1 T1", train=(train, third), test=(other,))
    errors = [
        np.sqrt(np.mean(written_out(CartPole(), each, 0, 101)[1:] ** 2, axis=0)) for each in (train, third, other)
    ]
    reach = np.ptp([*q[:, 0], 1.0 - width / 2, 0.0])  # The cart starts up to a metre apart.
    expected = [np.max(each / [reach, 2 * np.pi]) for each in errors]
    assert [score.astray for score in score_recordings(CartPole(), dataset, solver=RK4(4))] == pytest.approx(expected)


def test_a_length_that_hardly_moves_is_compared_with_a_tenth_of_another():
    q = np.linspace(0.0, 1.0, 41)[:, None] * [1.0, 1e-3, 0.3]
    every = Trajectory(name="a", ts=0.1 * np.arange(41), q=q, rates=0 * q, us=q[:, :0])
    ranges = _scores._ranges(Dataset(name="d", space="R3", train=(every,)))
    np.testing.assert_allclose(ranges, [1.0, 0.1, 0.3])


def in_noise(k, *, noise=0.4, initial_samples=10):
    """Swing of a pendulum, measured with noisy velocities."""
    ts, generator = 0.05 * np.arange(61), np.random.default_rng(k)
    us = np.repeat(generator.normal(size=(7, 1)), 10, axis=0)[:61]
    path = roll_out(TRUTH, *map(jnp.asarray, (generator.normal(size=1), np.zeros(1), ts, us)))
    rates = np.asarray(path.rates) + noise * generator.normal(size=(61, 1))
    return Trajectory(name=f"{k}", ts=ts, q=np.asarray(path.q), rates=rates, us=us, initial_samples=initial_samples)


def test_whole_recordings_are_predicted_from_the_state_that_their_initial_samples_tell():
    noisy = tuple(in_noise(k) for k in range(4))
    one = tuple(dataclasses.replace(each, initial_samples=1) for each in noisy)
    found, raw = (
        [score.rollout_rmse for score in score_recordings(TRUTH, Dataset(name="d", space="T1", train=t), solver=RK4(4))]
        for t in (noisy, one)
    )
    assert np.mean(found) < 0.1 * np.mean(raw)
    exact, from_one = (in_noise(0, noise=0.0, initial_samples=k) for k in (10, 1))
    paths = predict(TRUTH, [exact, from_one], hold="zero", solver=RK4(4))
    np.testing.assert_array_equal(paths[0].q, paths[1].q)
    np.testing.assert_array_equal(predict(TRUTH, one[:1], hold="zero", solver=RK4(4))[0].q[0], one[0].q[0])


def test_where_the_rollout_from_the_found_state_diverges_the_measured_one_is_taken(monkeypatch):
    far = np.array([1.7e308])
    monkeypatch.setattr(_predict, "find_first_state", lambda *_, **__: (far, far))
    several = in_noise(0)
    one = dataclasses.replace(several, initial_samples=1)
    found, raw = predict(TRUTH, [several, one], hold="zero", solver=RK4(4))
    np.testing.assert_array_equal(found.q, raw.q)


def test_other_recordings_and_their_padding_change_nothing():
    recordings = [recorded(0.05 * np.arange(k), name=str(k)) for k in (25, 33, 47, 64, 65)]
    together = predict(Pendulum(), recordings, hold="zero", solver=RK4(2))
    for recording, path in zip(recordings, together, strict=True):
        (alone,) = predict(Pendulum(), [recording], hold="zero", solver=RK4(2))
        np.testing.assert_allclose(path.q, alone.q, rtol=1e-12)
        assert path.q.shape == recording.q.shape


def test_recordings_to_predict_may_come_one_by_one():
    recordings = {each.name: each for each in (recorded(0.05 * np.arange(25), name=name) for name in "ab")}
    for given in (recordings.values(), (each for each in recordings.values())):
        assert len(predict(Pendulum(), given, solver=RK4(2))) == 2


def test_inputs_are_held_as_the_data_say():
    recording = recorded(0.1 * np.arange(20))
    held, joined = (predict(Pendulum(), [recording], hold=hold, solver=RK4(2))[0].q for hold in ("zero", "linear"))
    assert np.abs(held - joined).max() > 1e-3


@pytest.mark.parametrize(
    ("seconds", "others", "horizon"),
    [(0.95, 3.0, 0.5), (0.5, 3.0, 0.5), (0.45, 0.35, 0.2), (0.1, 0.75, 0.1), (0.06, 0.3, 0.05), (1.0, 3.0, 1.0)],
)
def test_windows_are_as_short_as_a_part_whose_recordings_all_are_asks_for(seconds, others, horizon):
    trained, tested = (recorded(np.linspace(0.0, each, 97)) for each in (others, seconds))
    tiny = recorded(np.linspace(0.0, 0.02, 9))
    dataset = Dataset(name="d", space="T1", train=(tiny, trained, trained), test=(tested,))
    tiny, _, *scores = score_recordings(Pendulum(), dataset, solver=RK4(1))
    assert np.isnan([tiny.window_rmse.median, tiny.motion]).all()
    assert (tiny.windows, tiny.diverged) == (0, 0)
    assert np.isfinite(tiny.rollout_rmse)
    for score, recording in zip(scores, (trained, tested), strict=True):
        assert score.window_rmse.horizon_s == pytest.approx(horizon)
        stop = int(np.searchsorted(recording.ts, horizon + 1e-9))
        starts = np.searchsorted(recording.ts, np.arange(0.0, recording.duration - horizon + 1e-9, horizon / 4) - 1e-9)
        starts = starts[recording.ts[starts] + horizon <= recording.ts[-1] + 1e-9]
        errors = [np.sqrt(np.mean(written_out(Pendulum(), recording, k, k + stop)[1:] ** 2)) for k in starts]
        assert score.window_rmse.median == pytest.approx(np.median(errors), rel=0.05)


@pytest.mark.parametrize(("samples", "horizon"), [(2, 1.0), (10, 1.0), (12, 0.1), (60, 0.5)])
def test_a_part_of_hardly_any_samples_makes_no_windows_of_hardly_any(samples, horizon):
    train, test = (recorded(0.01 * np.arange(each)) for each in (500, samples))
    scores = score_recordings(Pendulum(), Dataset(name="d", space="T1", train=(train,), test=(test,)), solver=RK4(1))
    assert [score.window_rmse.horizon_s for score in scores] == [horizon] * 2
    assert np.isfinite(scores[0].window_rmse.median)


@pytest.mark.parametrize(
    ("step", "horizon"), [(0.25, 1.0), (0.3, 2.0), (0.5, 2.0), (0.6, 5.0), (2.0, 10.0), (5.0, 20.0)]
)
def test_windows_are_as_long_as_rare_samples_ask_for(step, horizon):
    dataset = Dataset(name="d", space="T1", train=(recorded(step * np.arange(100)),))
    (score,) = score_recordings(Pendulum(), dataset, solver=RK4(1))
    assert score.window_rmse.horizon_s == pytest.approx(horizon)
    assert not np.isnan(score.window_rmse.median)


@pytest.mark.parametrize("start", [0.0, 1.7e9, 1.7e9 + 0.1234567])
@pytest.mark.parametrize("seconds", [0.2, 1.0, 3.0])
def test_stamps_since_1970_make_the_same_windows(start, seconds):
    ts = np.round(np.arange(0.0, seconds + 1e-9, 0.005), 3)
    plain, late = recorded(ts), recorded(start + ts)
    horizon = horizon_of(Dataset(name="d", space="T1", train=(plain,)))
    assert horizon_of(Dataset(name="d", space="T1", train=(late,))) == horizon
    assert short_windows(late, horizon) == short_windows(plain, horizon)


def test_no_window_of_few_samples_counts_twice():
    found = short_windows(recorded(np.array([0.0, 0.3, 0.31, 0.9])), 0.5)
    assert len(found) == len(set(found))


def test_a_diverging_model_has_infinite_errors():
    recording = recorded(0.05 * np.arange(41))
    model = eqx.tree_at(lambda m: m.scale.array, small("naive", "T1"), replace_fn=lambda x: 1e150 * x)
    (score,) = score_recordings(model, Dataset(name="d", space="T1", train=(recording,)), solver=RK4(1))
    assert score.window_rmse.median == score.window_rmse.mean == score.rollout_rmse == score.astray == np.inf
    assert score.diverged == score.windows == 5


def test_a_naive_models_angles_go_on_from_the_measured_ones():
    turned = dataclasses.replace(recording := recorded(0.05 * np.arange(41)), q=recording.q + 20 * np.pi)
    paths = predict(small("naive", "T1"), [recording, turned], hold="zero", solver=RK4(2))
    np.testing.assert_allclose(paths[1].q, paths[0].q + 20 * np.pi, atol=1e-9)
    assert abs(paths[1].q[0, 0] - turned.q[0, 0]) < 1e-9
    assert np.abs(np.diff(paths[1].q[:, 0])).max() < np.pi

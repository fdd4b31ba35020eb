"""Velocities that come late are estimated from the positions, where that is better for all of them."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.data import DataError, DataWarning, check_dataset, read_dataset

TEXT = """
space = "T2"
time = "t"
positions = ["q1", "q2"]
velocities = ["v1", "v2"]
{more}
[train]
files = ["train*.csv"]
[test]
files = ["test*.csv"]
"""
STEP = 0.005
PACES = 4.0, 7.0


def motion(samples=800, *, delay=(0.0, 0.0), noise=0.0, phase=0.0, factor=1.0):
    """Time stamps, two sines, and their velocities, late and in another unit."""
    ts = STEP * np.arange(samples)
    rng = np.random.default_rng(0)
    angles = [pace * ts + phase + k for k, pace in enumerate(PACES)]
    q = np.stack([np.sin(angle) for angle in angles], axis=1)
    v = np.stack(
        [pace * np.cos(angle - pace * late) for pace, angle, late in zip(PACES, angles, delay, strict=True)], axis=1
    )
    return ts, q + noise * rng.normal(size=q.shape), factor * v


def write(folder, recordings, *, more="", test=None):
    """A description of three recordings for training and one for testing."""
    for name, (ts, q, v) in {**recordings, "test": test or motion(phase=2.0)}.items():
        columns = np.concatenate([ts[:, None], q, v], axis=1)
        np.savetxt(folder / f"{name}.csv", columns, delimiter=",", header="t,q1,q2,v1,v2", comments="", fmt="%.17g")
    (folder / "log.toml").write_text(TEXT.format(more=more))
    return folder / "log.toml"


def trains(*delays, **others):
    return {f"train{k}": motion(delay=delay, phase=0.7 * k, **others) for k, delay in enumerate(delays)}


def quietly(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        return read_dataset(path)


@given(delay=st.floats(0.002, 0.02))
@settings(max_examples=10)
def test_late_velocities_give_way_to_the_slope_of_the_positions(tmp_path_factory, delay):
    path = write(tmp_path_factory.mktemp("late"), trains(*[(delay, delay)] * 3))
    with pytest.warns(DataWarning, match=r"velocities are estimated from the positions, .* `v1` comes .* ms late"):
        dataset = read_dataset(path)
    for k, recording in enumerate(dataset.train):
        np.testing.assert_allclose(recording.rates, motion(phase=0.7 * k)[2], atol=5e-3)
        assert recording.noise_gain is not None


def test_the_training_recordings_decide_for_the_test(tmp_path):
    (recording,) = quietly(write(tmp_path, trains(*[(0.01, 0.01)] * 3))).test
    assert recording.noise_gain is not None
    (recording,) = quietly(write(tmp_path, trains(*[(0.0, 0.0)] * 3), test=motion(delay=(0.01, 0.01)))).test
    np.testing.assert_array_equal(recording.rates, motion(delay=(0.01, 0.01))[2])


@pytest.mark.parametrize(("late", "replaced"), [(1, False), (2, True)])
def test_most_recordings_must_be_late(tmp_path, late, replaced):
    delays = [(0.01, 0.01)] * late + [(0.0, 0.0)] * (3 - late)
    dataset = quietly(write(tmp_path, trains(*delays)))
    assert all((recording.noise_gain is not None) == replaced for recording in dataset.train)


def test_one_late_joint_is_enough_where_the_other_is_told_well_too(tmp_path):
    with pytest.warns(DataWarning, match="; `v2` with it, which the slopes tell as well"):
        dataset = read_dataset(write(tmp_path, trains(*[(0.01, 0.0)] * 3)))
    np.testing.assert_allclose(dataset.train[0].rates, motion()[2], atol=5e-3)


def test_logs_that_rest_most_of_the_time_are_asked_while_they_move(tmp_path):
    recordings = trains(*[(0.01, 0.01)] * 3)
    for name, (ts, q, v) in recordings.items():
        rest = np.zeros((1200, 2))
        stamps = ts[-1] + STEP * np.arange(1, 1201)
        recordings[name] = (
            np.concatenate([ts, stamps]),
            np.concatenate([q, q[-1] + rest]) + 1e-6 * np.random.default_rng(0).normal(size=(2000, 2)),
            np.concatenate([v, rest]) + 1e-4 * np.random.default_rng(1).normal(size=(2000, 2)),
        )
    dataset = quietly(write(tmp_path, recordings))
    assert all(recording.noise_gain is not None for recording in dataset.train)


def test_good_velocities_beside_noisy_positions_stay_though_another_is_late(tmp_path):
    recordings = trains(*[(0.05, 0.0)] * 3)
    rng = np.random.default_rng(1)
    for _, q, _ in recordings.values():
        q[:, 1] += 0.2 * rng.normal(size=len(q))
    dataset = quietly(write(tmp_path, recordings))
    np.testing.assert_array_equal(dataset.train[0].rates, motion(delay=(0.05, 0.0))[2])


def test_good_velocities_beside_a_stuck_position_stay_though_another_is_late(tmp_path):
    recordings = trains(*[(0.01, 0.0)] * 3)
    for _, q, _ in recordings.values():
        q[300:350, 1] = q[300, 1]  # Too short to be left out.
    dataset = quietly(write(tmp_path, recordings))
    np.testing.assert_array_equal(dataset.train[0].rates, motion(delay=(0.01, 0.0))[2])


def test_what_late_velocities_lack_costs_no_rows(tmp_path):
    recordings = trains(*[(0.01, 0.01)] * 3)
    for _, _, v in recordings.values():
        v[100:110, 0] = np.nan
        v[500, 1] = 1e3
        v[600, 1] = 1e30
    path = write(tmp_path, recordings)
    with pytest.warns(DataWarning) as said:
        dataset = read_dataset(path)
    assert [(each.name, len(each)) for each in dataset.train] == [(f"train{k}", 800) for k in range(3)]
    assert not [one for one in said if "left out" in str(one.message)]
    check = check_dataset(path)
    assert not [one for each in check.recordings for one in each.findings if one.level == "masked"]
    assert [each.recordings for each in check.recordings] == [1] * 4
    assert all(each.log.rates is not None for each in check.recordings)


def test_a_recording_without_any_velocity_is_as_good_as_others_that_come_late(tmp_path):
    recordings = trains(*[(0.01, 0.01)] * 3)
    recordings["train1"][2][:, 0] = np.nan
    path = write(tmp_path, recordings)
    assert [len(each) for each in quietly(path).train] == [800] * 3
    assert not check_dataset(path).refused
    path.write_text(path.read_text() + "\n")  # As the positions tell nothing better where velocities are trusted.
    path.write_text("trust_velocities = true\n" + path.read_text())
    with pytest.raises(DataError, match="Column `v1` lacks 800"):
        quietly(path)


def test_velocities_that_are_trusted_stay_without_a_warning(tmp_path):
    path = write(tmp_path, trains(*[(0.01, 0.01)] * 3), more="trust_velocities = true")
    np.testing.assert_array_equal(read_dataset(path).train[0].rates, motion(delay=(0.01, 0.01))[2])


def test_a_wrong_unit_is_the_users_to_mend_first(tmp_path):
    late = motion(delay=(0.01, 0.01), factor=180 / np.pi)
    path = write(tmp_path, {"train0": late})
    with pytest.warns(DataWarning, match="velocities in degrees per second"):
        dataset = read_dataset(path)
    np.testing.assert_array_equal(dataset.train[0].rates, late[2])


@pytest.mark.parametrize("factor", [-1.0, 180 / np.pi])
def test_a_wrong_sign_or_unit_beside_a_late_velocity_is_mended_first(tmp_path, factor):
    recordings = trains(*[(0.01, 0.0)] * 3)
    for _, _, v in recordings.values():
        v[:, 1] *= factor
    dataset = quietly(write(tmp_path, recordings))
    np.testing.assert_array_equal(dataset.train[0].rates, recordings["train0"][2])


def test_where_nothing_is_trained_on_the_test_decides(tmp_path):
    path = write(tmp_path, {}, test=motion(delay=(0.01, 0.01)))
    text = path.read_text()
    path.write_text(text[: text.index("[train]")] + text[text.index("[test]") :])
    (recording,) = quietly(path).test
    assert recording.noise_gain is not None


def test_the_check_says_once_what_training_does(tmp_path):
    check = check_dataset(write(tmp_path, trains(*[(0.01, 0.01)] * 3)))
    (finding,) = (one for one in check.findings if one.kind == "slope")
    assert (finding.level, finding.channel) == ("note", "")
    assert "`v1` comes 10 ms late" in finding.text
    assert not [one for each in check.recordings for one in each.findings if one.kind == "slope"]


def test_trust_is_about_velocities_that_are_given(tmp_path):
    path = write(tmp_path, trains((0.0, 0.0)), more="trust_velocities = true")
    path.write_text(path.read_text().replace('velocities = ["v1", "v2"]\n', "", 1))
    with pytest.raises(DataError, match="`trust_velocities` is about `velocities`, which are not given"):
        read_dataset(path)
    path.write_text(TEXT.format(more="trust_velocities = 1"))
    with pytest.raises(DataError, match="`trust_velocities` must be true or false; got 1"):
        read_dataset(path)

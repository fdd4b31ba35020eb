"""Fewer, more or noisy training trajectories; test and prediction stay as they are."""

import itertools

import numpy as np
import pytest

from symoden.experiments import RunConfig, read_run_source, read_source, summarize, task
from symoden.experiments._variants import simulate_variant
from symoden.models import ModelConfig
from symoden.training import TrainingConfig

NAME = "pendulum"


@pytest.fixture(scope="module")
def own():
    return simulate_variant(task(NAME), seed=3)


def same(one, other):
    """Whether two trajectories are the same, up to how many are simulated at once."""
    return one.name == other.name and np.allclose(one.q, other.q, atol=1e-9) and np.array_equal(one.us, other.us)


def test_the_smaller_is_a_part_of_the_larger(own):
    sets = [simulate_variant(task(NAME), seed=3, trajectories=count).dataset.train for count in (1, 16, 64, 320, 502)]
    for count, found in zip((1, 16, 64, 320, 502), sets, strict=True):
        assert len({path.name for path in found}) == count
    for smaller, larger in itertools.pairwise(sets):
        known = {path.name: path for path in larger}
        assert all(same(path, known[path.name]) for path in smaller)
    assert [path.name for path in sets[3]] == [path.name for path in own.dataset.train]
    assert all(np.array_equal(one.q, other.q) for one, other in zip(sets[3], own.dataset.train, strict=True))


def test_the_choice_is_random_and_the_seeds(own):
    chosen = [path.name for path in simulate_variant(task(NAME), seed=3, trajectories=64).dataset.train]
    assert len({name.partition("-u")[2] for name in chosen}) == 5
    assert len({name.partition("-u")[0] for name in chosen}) > 30
    other = [path.name for path in simulate_variant(task(NAME), seed=4, trajectories=64).dataset.train]
    assert chosen != other


@pytest.mark.parametrize("options", [{"trajectories": 16}, {"trajectories": 400}, {"noise": 0.1}], ids=str)
def test_what_scores_are_made_on_stays(own, options):
    found = simulate_variant(task(NAME), seed=3, **options)
    assert len(found.prediction) == 64
    for kept, known in ((found.dataset.test, own.dataset.test), (found.prediction, own.prediction)):
        assert all(same(one, other) for one, other in zip(kept, known, strict=True))


def test_noise_is_gaussian_on_every_channel_of_training(own):
    noisy = simulate_variant(task("acrobot"), seed=3, noise=0.05).dataset.train
    clean = simulate_variant(task("acrobot"), seed=3).dataset.train
    away = np.stack([np.hstack([a.q - b.q, a.rates - b.rates]) for a, b in zip(noisy, clean, strict=True)])
    samples = away.reshape(-1, 4)
    assert np.abs(samples.mean(axis=0)).max() < 5 * 0.05 / np.sqrt(len(samples))
    np.testing.assert_allclose(samples.std(axis=0), 0.05, rtol=0.05)
    inside = np.mean(np.abs(samples) < 0.05, axis=0)
    np.testing.assert_allclose(inside, 0.6827, atol=0.03)
    correlations = np.corrcoef(away.reshape(len(away), -1)) - np.eye(len(away))
    assert np.abs(correlations).max() < 0.6
    assert all(np.array_equal(a.us, b.us) and np.array_equal(a.ts, b.ts) for a, b in zip(noisy, clean, strict=True))


def test_the_noise_of_a_trajectory_is_its_own(own):
    clean = {path.name: path for path in own.dataset.train}
    whole = {path.name: path for path in simulate_variant(task(NAME), seed=3, noise=0.1).dataset.train}
    for count, noise in ((16, 0.1), (400, 0.1), (16, 0.01)):
        for path in simulate_variant(task(NAME), seed=3, trajectories=count, noise=noise).dataset.train:
            if path.name in clean:
                expected = clean[path.name].q + noise / 0.1 * (whole[path.name].q - clean[path.name].q)
                np.testing.assert_allclose(path.q, expected, atol=1e-9)


def test_a_run_reads_its_data_again():
    source = read_source(NAME, seed=3, trajectories=8, noise=0.1)
    config = RunConfig(
        source=NAME,
        seed=3,
        trajectories=8,
        noise=0.1,
        model=ModelConfig(),
        training=TrainingConfig(),
        data=summarize(source.dataset),
    )
    assert summarize(read_run_source(config).dataset) == config.data
    assert config.data.recordings["train"] == 8


def test_numbers_out_of_range_and_variants_of_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match="at least 1; got 0"):
        simulate_variant(task(NAME), trajectories=0)
    with pytest.raises(ValueError, match="at least 0 and finite; got -1"):
        simulate_variant(task(NAME), noise=-1.0)
    path = tmp_path / "arm.toml"
    path.write_text("")
    for count, noise in ((4, 0.0), (None, 0.1)):
        with pytest.raises(ValueError, match=r"for tasks only; got the data set `.*arm\.toml`"):
            read_source(str(path), trajectories=count, noise=noise)

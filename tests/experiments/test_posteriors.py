"""What the data of a run leave open is computed as its training was."""

import dataclasses

import jax
import numpy as np
import pytest

from symoden.data import Dataset, Trajectory
from symoden.experiments import RunConfig, read_posterior, summarize
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.training import TrainingConfig


def test_bands_take_the_steps_that_training_settled_on(tmp_path, monkeypatch):
    taken = []

    def inferred(model, dataset, config):
        taken.append(config.lm_substeps)
        raise ValueError("seen")

    monkeypatch.setattr("symoden.experiments._posteriors.infer_posterior", inferred)
    ts = 0.1 * np.arange(30)
    swing = Trajectory(name="swing", ts=ts, q=np.cos(ts)[:, None], rates=-np.sin(ts)[:, None], us=np.ones((30, 1)))
    dataset = Dataset(name="swing", space="T1", train=(swing,))
    model = build(ModelConfig(), Space.parse("T1"), 1, key=jax.random.key(0))
    plain = RunConfig(source="pendulum", model=ModelConfig(), training=TrainingConfig(), data=summarize(dataset))
    finer = dataclasses.replace(plain, training=TrainingConfig(lm_substeps=8))
    for config in (plain, dataclasses.replace(plain, substeps=2), finer):
        with pytest.raises(ValueError, match="seen"):
            read_posterior(tmp_path, model, config, dataset)
    assert taken == [1, 2, 8]

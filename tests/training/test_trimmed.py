"""A force that holds on for long bends the model that has to explain it: it is found by least trimmed squares."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataWarning
from symoden.training import TrainingConfig, _disturbances, fit, hold_out
from symoden.training._data import regression_data
from symoden.training._disturbances import Screening, disturbed_spans
from symoden.training._left_out import Contender, without
from symoden.training._objective import Batch
from symoden.training._prepare import prepare
from symoden.training._stages import never

from .swings import MODEL, SYSTEM, swings

CONFIG = TrainingConfig(restarts=1, adam_steps=200, batch_size=32, lm_steps=10, growth_steps=10, relevance_steps=10)
BRIEF = dataclasses.replace(CONFIG, lm_steps=3, growth_steps=1, relevance_steps=2, lm_substeps=1)
UNBENT = Screening._unbent
HELD = {1: [(150, 225, 8.0)], 2: [(400, 440, -8.0)]}


OTHER = {3: [(200, 240, 6.0)], 7: [(20, 260, 6.0)]}


def windows_of(dataset):
    """Windows of the weak form."""
    with jax.enable_x64(True):
        data = regression_data(hold_out(dataset, CONFIG), SYSTEM, CONFIG)
    assert data is not None
    return data


def gain(model):
    """Acceleration for each unit of the input, where the pendulum hangs."""
    return float((model.inverse_mass_matrix(jnp.zeros(1)) @ model.input_matrix(jnp.zeros(1)))[0, 0])


@pytest.mark.slow
def test_forces_that_hold_on_are_found_where_they_are_though_they_bend_the_model(monkeypatch):
    bent = []

    def unbent(self, state, is_over):
        bent.append(state.best)
        return UNBENT(self, state, is_over)

    monkeypatch.setattr(Screening, "_unbent", unbent)
    dataset = swings(0, HELD)
    with pytest.warns(DataWarning, match="left out of training is `run1` from 10.* `run2` from 10"):
        result = fit(dataset, model=MODEL, config=CONFIG)
    assert result.config.left_out is not None
    first, second = result.config.left_out
    assert first == ("run1", pytest.approx(103.0, abs=0.4), pytest.approx(104.5, abs=0.4))
    assert second == ("run2", pytest.approx(108.0, abs=0.4), pytest.approx(108.8, abs=0.4))
    errors = [abs(gain(model) / gain(SYSTEM) - 1) for model in (bent[0], result.model)]
    assert errors[0] > 0.01
    assert errors[1] < 0.2 * errors[0]
    data = windows_of(dataset)
    with jax.enable_x64(True):
        assert disturbed_spans(bent[0], data, dataset.train) == []


def test_of_another_load_nothing_is_left_out_but_the_moment_in_another_recording_is():
    """A whole recording, or most of one, is no moment."""
    dataset = swings(0, OTHER, count=12)
    data = windows_of(dataset)
    with jax.enable_x64(True):
        assert {name for name, *_ in disturbed_spans(SYSTEM, data, dataset.train, bent=True)} == {"run3"}


@given(st.integers(2, 40), st.data())
def test_of_windows_without_some_there_are_as_many_and_none_of_these(count, draw):
    left_out = draw.draw(st.lists(st.integers(0, count - 1), min_size=1, max_size=count - 1, unique=True))
    every = jnp.arange(count, dtype=float)
    batch = Batch(
        *(jnp.tile(every[:, None], 2) if k in {0, 4} else jnp.tile(every[:, None, None], 2) for k in range(5))
    )
    others = np.asarray(without(batch, np.array(left_out)).ts[:, 0]).astype(int).tolist()
    assert len(others) == count
    assert others == sorted(others)
    assert set(others).isdisjoint(left_out)
    assert max(np.bincount(others)) <= -(-len(left_out) // (count - len(left_out))) + 1


@pytest.mark.parametrize(
    "config",
    [BRIEF, pytest.param(dataclasses.replace(BRIEF, growth_steps=0), marks=pytest.mark.slow)],
    ids=["more follows", "the last"],
)
def test_a_run_whose_time_ends_while_it_looks_looks_again(tmp_path, monkeypatch, config):
    dataset = swings(0, HELD)
    with pytest.warns(DataWarning, match="left out of training"):
        whole = fit(dataset, model=MODEL, config=config)
    looked, fits, refitted = [], [], Contender.refitted

    def counted(self, windows, is_over=never):
        fits.extend([self.steps] * len(looked))  # Windows left out in turn are fitted before it looks.
        return refitted(self, windows, is_over)

    def late(self, state, is_over):
        """The time ends in the first fit."""
        looked.append(state.stage)
        calls = iter([False] * 3)
        return UNBENT(self, state, lambda: next(calls, True))

    with monkeypatch.context() as patch:
        patch.setattr(Screening, "_unbent", late)
        patch.setattr(Contender, "refitted", counted)
        stopped = fit(dataset, model=MODEL, config=config, folder=tmp_path / "run")
    assert (len(looked), len(fits)) == (1, 1)
    assert not stopped.completed
    assert stopped.config.left_out is None
    with pytest.warns(DataWarning, match="left out of training"):
        resumed = fit(dataset, model=MODEL, config=config, folder=tmp_path / "run", resume=True)
    assert resumed.completed
    assert resumed.config == whole.config
    assert eqx.tree_equal(resumed.model, whole.model)


def test_a_model_that_explains_all_is_not_fitted_again(monkeypatch):
    monkeypatch.setattr(_disturbances, "Contender", lambda *_: pytest.fail("There is nothing to gain."))
    dataset = swings(0, {}, noise=0.0)
    with jax.enable_x64(True):
        prepared = prepare(dataset, MODEL, CONFIG, screened=True)
        assert prepared.screening is not None
        state = prepared.state._replace(best=SYSTEM)
        assert prepared.screening._unbent(state, lambda: False) is None

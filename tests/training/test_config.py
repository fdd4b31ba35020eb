"""Settings that would ruin training are refused, in words; those at the edge of what can be meant are not."""

import math
from typing import Any

import pytest
from hypothesis import given, strategies as st

from symoden.training import TrainingConfig, fit

POSITIVE = st.floats(min_value=0, exclude_min=True, allow_infinity=False)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"seed": -1}, "`seed` must be a whole number of at least 0; got -1"),
        ({"batch_size": 0}, "`batch_size` must be a whole number of at least 1; got 0"),
        ({"adam_steps": 0, "lm_steps": 0}, "Training must have steps"),
        ({"lm_horizon": 0}, "`lm_horizon` must be a whole number of at least 1, or None"),
        ({"validation": math.nan}, "`validation` must be at least 0 and below 1; got nan"),
        *[({"clip": value}, f"`clip` must be positive, or None for no limit; got {value}") for value in (0.0, -1.0)],
        ({"clip": math.nan}, "`clip` must be positive, or None for no limit; got nan"),
        *[
            ({name: value}, f"`{name}` must be positive and finite; got {value}")
            for name in ("learning_rate", "damping")
            for value in (0.0, -1.0, math.nan, math.inf)
        ],
        *[
            ({name: value}, f"`{name}` must be at least 0 and finite; got {value}")
            for name in ("weight_decay", "prior")
            for value in (-1.0, math.nan, math.inf)
        ],
    ],
    ids=str,
)
def test_settings_that_cannot_train_are_refused(setting: dict[str, Any], message):
    with pytest.raises(ValueError, match=message):
        TrainingConfig(**setting)


@given(positive=POSITIVE, seed=st.integers(0, 2**31))
def test_settings_at_the_edge_are_kept_as_they_are(positive, seed):
    numbers: dict[str, Any] = dict.fromkeys(("clip", "learning_rate", "damping", "weight_decay", "prior"), positive)
    config = TrainingConfig(seed=seed, **numbers)
    assert {name: getattr(config, name) for name in numbers} == numbers
    assert config.seed == seed


def test_adam_learns_without_limits_decay_or_validation(pendulum, small):
    config = TrainingConfig(
        adam_steps=300, restarts=1, batch_size=1, horizon=1, lm_steps=0, clip=None, weight_decay=0.0, validation=0.0
    )
    losses: list[float] = []
    fit(pendulum(), model=small, config=config, progress=lambda at: losses.append(at.loss))
    assert losses[-1] < 0.5 * losses[0]

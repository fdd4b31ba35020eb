"""Chance is called clear as often by few windows as by many."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.training._verdicts import CLEAR, _normal_deviate


@pytest.mark.parametrize("windows", [2, 3, 6, 40])
def test_chance_is_clear_once_in_twenty_however_few_windows_there_are(windows):
    differences = np.random.default_rng(windows).normal(size=(20_000, windows))
    ratios = differences.mean(axis=1) / (differences.std(axis=1, ddof=1) / np.sqrt(windows))
    clear = np.mean([_normal_deviate(ratio, windows - 1) > CLEAR for ratio in ratios])
    assert clear == pytest.approx(0.05, abs=0.006)  # Four standard errors of the share.


@given(ratio=st.floats(0.0, 1e300), degrees=st.integers(1, 1000))
def test_few_windows_never_say_more_than_many(ratio, degrees):
    deviate = _normal_deviate(ratio, degrees)
    assert 0 <= deviate <= _normal_deviate(ratio, degrees + 1) * (1 + 1e-9) <= ratio * (1 + 1e-9) or ratio < 1e-9
    assert _normal_deviate(-ratio, degrees) == -deviate

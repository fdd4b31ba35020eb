"""Slopes as weighted sums are those of the cubics that are fitted."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data.signals._cubics import Cells, SlopeFilter, cell_starts, fit_cubics


@given(seed=st.integers(0, 2**32 - 1), window=st.sampled_from([5, 9, 17]), size=st.integers(1, 4))
def test_weights_make_the_slopes_of_cubics_at_the_ends_and_beside_gaps_too(seed, window, size):
    generator = np.random.default_rng(seed)
    ts = np.cumsum(generator.uniform(0.5, 1.5, 160) + 20 * (generator.random(160) < 0.02))
    signals = generator.normal(size=(160, 2))
    cells = Cells.of(ts, signals, cell_starts(len(ts), size))
    cubics = fit_cubics(cells, window)
    at = cells.ts + generator.uniform(-0.5, 0.5, len(cells.ts))
    which = np.clip(np.arange(len(at)) - window // 2, 0, len(cubics.ts) - 1)
    found = SlopeFilter.of(cells, window, at, which)
    slopes = cubics.slopes(at, which)
    assert np.abs(found.slopes(cells.means) - slopes).max() <= 1e-7 * np.abs(slopes).max()
    assert found.variances == pytest.approx(cubics.variances(at, which), rel=1e-9)

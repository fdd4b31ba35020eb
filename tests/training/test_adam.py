"""Adam's windows: all of them come, in turn or at random, by the number of the step alone."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from hypothesis import given, strategies as st

from symoden.training._adam import Sampler
from symoden.training._objective import Batch


def numbered(total):
    """Windows that hold their number."""
    each = jnp.zeros((total, 1, 1))
    return Batch(jnp.arange(float(total))[:, None], each, each, each, jnp.zeros((total, 2)))


def drawn(total, size, steps, *, shuffle=False):
    sampler = Sampler(numbered(total), jnp.asarray(3), size, shuffle)
    return [np.asarray(sampler.draw(jnp.asarray(step)).ts)[:, 0].astype(int).tolist() for step in steps]


@given(total=st.integers(1, 40), data=st.data())
def test_blocks_in_turn_go_round_all_windows(total, data: Any):
    size = data.draw(st.integers(1, total))
    steps = -(-total // size)
    first = drawn(total, size, range(steps))
    assert np.ravel(first)[:total].tolist() == list(range(total))
    if total % size == 0:
        assert drawn(total, size, range(steps, 2 * steps)) == first
    counts = np.bincount(np.ravel(drawn(total, size, range(total))), minlength=total)
    assert np.array_equal(counts, np.full(total, size))


def test_windows_at_random_depend_on_the_step_alone():
    one, other = (drawn(40, 8, steps, shuffle=True) for steps in (range(4), (3, 2)))
    assert other == [one[3], one[2]]
    assert len({tuple(each) for each in one}) == 4

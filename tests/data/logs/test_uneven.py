"""Stamps that scatter where positions do not are named; uneven samples, and noise, are not."""

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset
from tests.data.conftest import arm, found, written

CLOCKS = ("clocks", "warning", "t")


def late(log, scatter, *, seed=0):
    """The log with stamps that are late by a share of the step."""
    step = np.diff(log[:, 0]).mean()
    log[:, 0] += scatter * step * np.random.default_rng(seed).uniform(0, 1, len(log))
    return log


@pytest.mark.parametrize("scatter", [0.4, 0.9])
def test_stamps_that_scatter_about_an_even_clock_are_named(tmp_path, scatter):
    path = written(tmp_path, late(arm(jitter=0.0, step=0.01), scatter))
    assert CLOCKS in found(path)
    (check,) = check_dataset(path).recordings
    (one,) = [each for each in check.findings if each.kind == "clocks"]
    assert "positions go on as if all were 10 ms" in one.text
    assert "write `dt = 0.01` beside `time`, as" in one.advice
    with pytest.warns(DataWarning, match=r"go on as if all were .* Stamps of arrival\? `symoden"):
        read_dataset(path)
    path.write_text(path.read_text().replace('time = "t"', 'time = "t"\ndt = 0.01'))
    assert CLOCKS not in found(path)


@pytest.mark.parametrize("jitter", [0.1, 0.3, 0.8])
def test_samples_that_are_taken_unevenly_are_not(tmp_path, jitter):
    assert CLOCKS not in found(written(tmp_path, arm(jitter=jitter, step=0.01)))


def test_noise_tells_nothing(tmp_path):
    assert CLOCKS not in found(written(tmp_path, late(arm(jitter=0.0, step=0.01, noise=0.05), 0.4)))


def test_lost_rows_of_an_even_clock_are_no_scatter(tmp_path):
    log = np.delete(arm(jitter=0.0, step=0.01), np.arange(5, 2000, 7), axis=0)
    assert CLOCKS not in found(written(tmp_path, log))

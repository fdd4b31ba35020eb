"""Velocities that know less than the positions do are named."""

import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import check_dataset

TEXT = """
space = "T1"
time = "t"
positions = "q"
velocities = "v"
trust_velocities = true
[train]
files = ["log.csv"]
"""


def notes(*, w=4.0, hertz=200.0, delay=0.0, noise=(0.0, 0.0), gap=0.0, seed=0):
    """What `data check` says of the velocities of a motion of angular frequencies w and 2.3 w."""
    rng = np.random.default_rng(seed)
    ts = np.arange(1000) / hertz
    ts[500:] += gap
    (a, b), (c, d) = rng.uniform(0.5, 1.0, 2), rng.uniform(0, 6, 2)
    q = a * np.sin(w * ts + c) + 0.2 * b * np.sin(2.3 * w * ts + d)
    late = ts - delay
    v = a * w * np.cos(w * late + c) + 0.2 * b * 2.3 * w * np.cos(2.3 * w * late + d)
    q, v = (x + size * rng.normal(size=len(ts)) for x, size in zip((q, v), noise, strict=True))
    with tempfile.TemporaryDirectory() as folder:
        rows = np.stack([ts, q, v], axis=1)
        np.savetxt(Path(folder, "log.csv"), rows, delimiter=",", header="t,q,v", comments="", fmt="%.15g")
        Path(folder, "log.toml").write_text(TEXT)
        found = check_dataset(Path(folder, "log.toml")).recordings[0].findings
    return [one for one in found if one.kind == "slope"]


@given(samples=st.floats(8, 200), seed=st.integers(0, 1000))
def test_exact_velocities_are_as_good_as_can_be_however_coarse_the_samples(samples, seed):
    """`samples` in a period of the faster part."""
    assert not notes(w=2 * np.pi * 200 / (2.3 * samples), seed=seed)


@given(noise=st.floats(1e-5, 1e-2), share=st.floats(0.0, 1.0), seed=st.integers(0, 1000))
def test_velocities_that_are_better_than_noisy_positions_are_not_named(noise, share, seed):
    assert not notes(noise=(noise, share * noise), seed=seed)


@given(delay=st.floats(0.002, 0.09), phase=st.floats(0.0, 1.2), noise=st.floats(0.0, 1e-4), seed=st.integers(0, 1000))
def test_late_velocities_are_named_with_their_delay(delay, phase, noise, seed):
    """`phase` [rad] is how far the slower part goes meanwhile; the faster part goes nearly half a turn."""
    (note,) = notes(w=float(np.clip(phase / delay, 3.0, 12.0)), delay=delay, noise=(noise, 0.0), seed=seed)
    assert note.level == "note"
    said = re.search(r"came ([0-9.e+-]+) ms late", note.text)
    assert said
    assert float(said[1]) == pytest.approx(1000 * delay, rel=0.1)


@given(seed=st.integers(0, 1000))
def test_noisy_velocities_beside_good_positions_are_named_with_the_size_of_their_noise(seed):
    (note,) = notes(noise=(1e-5, 0.2), seed=seed)
    assert note.level == "note"
    assert "late" not in note.text
    said = re.search(r"differs from the slope of `q` by ([0-9.e+-]+);", note.text)
    assert said
    assert float(said[1]) == pytest.approx(0.2, rel=0.15)


def test_a_gap_is_no_motion():
    assert not notes(gap=3.0)
    assert notes(gap=3.0, delay=0.01)


def test_velocities_of_another_unit_are_named_for_that_alone(tmp_path):
    ts = np.arange(1000) / 200
    rows = np.stack([ts, np.rad2deg(np.sin(4 * ts)), 4 * np.cos(4 * ts - 0.1)], axis=1)
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t,q,v", comments="")
    (tmp_path / "log.toml").write_text(TEXT)
    kinds = [one.kind for one in check_dataset(tmp_path / "log.toml").recordings[0].findings]
    assert "unit" in kinds
    assert "slope" not in kinds


def test_a_joint_that_turns_evenly_has_no_delay(tmp_path):
    ts = np.arange(256) / 256
    rows = np.stack([ts, ts, 1 + 0.1 * (-1.0) ** np.arange(256)], axis=1)
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t,q,v", comments="", fmt="%.17g")
    (tmp_path / "log.toml").write_text(TEXT)
    texts = [one.text for one in check_dataset(tmp_path / "log.toml").recordings[0].findings if one.kind == "slope"]
    assert len(texts) == 1
    assert "late" not in texts[0]

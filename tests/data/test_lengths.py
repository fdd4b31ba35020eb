"""What training refuses as too short, or leaves out, `check_dataset` names."""

import re

import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from symoden.data import DataError, Dataset, Trajectory, check_dataset
from symoden.data._lengths import find_short
from symoden.training import TrainingConfig
from symoden.training._data import hold_out


def dataset(*lengths):
    rng = np.random.default_rng(0)
    signals = [rng.normal(size=(samples, 1)) for samples in lengths]
    train = tuple(
        Trajectory(name=f"run{k}", ts=0.01 * np.arange(len(q)), q=q, rates=q, us=q) for k, q in enumerate(signals)
    )
    return Dataset(name="arm", space="R1", train=train)


@given(lengths=st.lists(st.integers(2, 60), min_size=1, max_size=12))
@example([34])
@example([35])
def test_it_is_refused_if_training_refuses_it(lengths):
    data = dataset(*lengths)
    refused = [finding.text for finding in find_short(data) if finding.level == "refused"]
    if refused:
        with pytest.raises(DataError, match=re.escape(refused[0])):
            hold_out(data, TrainingConfig())
    else:
        hold_out(data, TrainingConfig())


def test_few_samples_among_many_are_named():
    (finding,) = find_short(dataset(500, 5, 400, 24, 25))
    assert finding.level == "masked"
    assert finding.text == "few samples in 2 of 5 recordings of [train]: `run1` (5), `run3` (24)"
    (finding,) = find_short(dataset(500, *[5] * 6))
    assert finding.text.endswith("`run5` (5), …")


@pytest.mark.parametrize("lengths", [(100,), (25, 500), (6,) * 20], ids=str)
def test_long_ones_and_short_ones_alike_have_nothing_wrong(lengths):
    assert find_short(dataset(*lengths)) == []


def test_a_data_set_of_five_rows_is_not_passed(tmp_path):
    (tmp_path / "run.csv").write_text("t,q\n" + "".join(f"{0.1 * k},{k * k}\n" for k in range(5)))
    path = tmp_path / "arm.toml"
    path.write_text('space = "R1"\ntime = "t"\npositions = ["q"]\n[train]\nfiles = ["run.csv"]\n')
    check = check_dataset(path)
    assert check.refused
    assert "40 samples or more" in check.findings[0].text
    assert "got 1 recording of 5 samples" in check.findings[0].text

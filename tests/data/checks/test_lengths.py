"""What training refuses as too short, or leaves out, `check_dataset` names."""

import re
import warnings

import jax
import numpy as np
import pytest
from hypothesis import example, given, strategies as st

from symoden.data import DataError, Dataset, Trajectory, check_dataset
from symoden.data.checks._lengths import find_short
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.training import TrainingConfig
from symoden.training._data import hold_out, levenberg_data, name_short

ANGLES = np.array([False])

MODEL = build(ModelConfig(), Space.parse("R1"), 1, key=jax.random.key(0))


def dataset(*lengths, slow=1):
    """Recordings of noise, each sample of which lasts for some rows."""
    rng = np.random.default_rng(0)
    signals = [np.repeat(rng.normal(size=(samples, 1)), slow, axis=0)[:samples] for samples in lengths]
    train = tuple(
        Trajectory(name=f"run{k}", ts=0.01 * np.arange(len(q)), q=q, rates=q, us=q) for k, q in enumerate(signals)
    )
    return Dataset(name="arm", space="R1", train=train)


@given(lengths=st.lists(st.integers(2, 60), min_size=1, max_size=12))
@example([34])
@example([35])
def test_it_is_refused_if_training_refuses_it(lengths):
    data = dataset(*lengths)
    refused = [finding.text for finding in find_short(data, ANGLES) if finding.level == "refused"]
    if refused:
        with pytest.raises(DataError, match=re.escape(refused[0])):
            hold_out(data, TrainingConfig())
    else:
        hold_out(data, TrainingConfig())


def test_few_samples_among_many_are_named():
    (finding,) = find_short(dataset(500, 5, 400, 6, 24), ANGLES)
    assert finding.level == "masked"
    assert finding.text == "few samples in 2 of 5 recordings of [train]: `run1` (5), `run3` (6)"
    assert "its windows: of 4 samples at first, of 8 later." in finding.advice
    (finding,) = find_short(dataset(500, *[5] * 6), ANGLES)
    assert finding.text.endswith("`run5` (5), …")


@pytest.mark.parametrize("lengths", [(100,), (24, 500), (6,) * 20], ids=str)
def test_long_ones_and_short_ones_alike_have_nothing_wrong(lengths):
    assert find_short(dataset(*lengths), ANGLES) == []


@pytest.mark.parametrize("slow", [1, 30])
@pytest.mark.parametrize("lengths", [(500, 5, 400, 20, 24), (300, 30), (300, 20, 60), (900, 70, 900)], ids=str)
def test_what_training_leaves_out_is_named_and_nothing_else(lengths, slow):
    data = dataset(*lengths, slow=slow)
    named = [name for finding in find_short(data, ANGLES) for name in re.findall("`(.*?)`", finding.text)]
    held = hold_out(data, TrainingConfig())
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        name_short(held, levenberg_data(held, MODEL, TrainingConfig()))
    said = [name for each in caught for name in re.findall("`(.*?)`", str(each.message))]
    assert named == [name for name in said if "#" not in name]  # Ends that validate are no files of [train].


def test_a_data_set_of_five_rows_is_not_passed(tmp_path):
    (tmp_path / "run.csv").write_text("t,q\n" + "".join(f"{0.1 * k},{k * k}\n" for k in range(5)))
    path = tmp_path / "arm.toml"
    path.write_text('space = "R1"\ntime = "t"\npositions = ["q"]\n[train]\nfiles = ["run.csv"]\n')
    check = check_dataset(path)
    assert check.refused
    assert "40 samples or more" in check.findings[0].text
    assert "got 1 recording of 5 samples" in check.findings[0].text

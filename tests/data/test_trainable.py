"""What training refuses of recordings that can be read, `check_dataset` refuses with the same words."""

import re

import pytest

from symoden.data import DataError, DataWarning, check_dataset, read_dataset
from symoden.training import fit

from .conftest import arm, scale, written


def refusals(path):
    check = check_dataset(path)
    texts = [one.text for one in check.findings if one.level == "refused"]
    assert check.refused == bool(texts)
    return texts


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        (("q1", "q2", "v1", "v2"), "no position ever changes there. Record motions, name other columns."),
        (("v1", "v2"), "no velocity ever changes there. Record motions, name other columns, or leave `velocities` out"),
    ],
)
def test_what_training_refuses_for_nothing_moves_is_refused(tmp_path, columns, said):
    path = written(tmp_path, scale(arm(), **dict.fromkeys(columns, 0.0)))
    (text,) = refusals(path)
    assert said in text
    with pytest.warns(DataWarning), pytest.raises(DataError, match=re.escape(text)):
        fit(read_dataset(path))


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ('mass_matrix = [["-1", 0], [0, 1]]', "must be positive definite at every state in the data"),
        ('mass_matrix = [["1"]]', "`mass_matrix` must be 2 × 2; got 1 × 1"),
        ('potential_energy = "cos(q3)"', "the space T2 has the coordinates q1 to q2; got `q3`"),
    ],
)
def test_given_parts_that_training_refuses_are_refused(tmp_path, known, said):
    path = written(tmp_path, arm(), more="")
    path.write_text(path.read_text() + f"[known]\n{known}\n")
    (text,) = refusals(path)
    assert said in text
    with pytest.raises(DataError, match=re.escape(text)):
        fit(read_dataset(path))


def test_one_joint_that_rests_is_not_refused(tmp_path):
    assert refusals(written(tmp_path, scale(arm(), q1=0.0, v1=0.0))) == []

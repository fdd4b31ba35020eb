"""A file's copy in another part is noticed, whatever its name and its rows."""

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset
from tests.data.conftest import arm, found, written


def parted(folder, *logs, rows=("", "")):
    """A description that learns from the first log and tests on the others."""
    path = written(folder, *logs)
    head = path.read_text().split("[train]")[0]
    tests = ", ".join(f'"run{k}.csv"' for k in range(1, len(logs)))
    path.write_text(f'{head}[train]\nfiles = ["run0.csv"]\n{rows[0]}\n[test]\nfiles = [{tests}]\n{rows[1]}\n')
    return path


@pytest.mark.parametrize("rows", [("rows = [0, 900]", "rows = [300, 1000]"), ("", "rows = [[0, 100], [200, 300]]")])
def test_a_copy_of_which_other_rows_are_read_is_named_with_both_files(tmp_path, rows):
    path = parted(tmp_path, arm(), arm(), rows=rows)
    assert found(path) == [("copy", "warning", "")]
    (finding,) = [each for each in check_dataset(path).findings if each.kind != "few"]
    assert str(tmp_path / "run0.csv") in finding.text
    assert str(tmp_path / "run1.csv") in finding.text
    with pytest.warns(DataWarning, match=r"\[test\] has rows of \[train\], equal number by number: .*run1.csv` from"):
        read_dataset(path)


def test_a_copy_with_another_clock_and_other_rows_around_it_is_found(tmp_path):
    log, copied = arm(), arm(1)
    copied[700:800, 1:] = log[333:433, 1:]
    assert ("copy", "warning", "") in found(parted(tmp_path, log, copied))


def test_recordings_that_begin_alike_or_have_a_few_equal_rows_are_no_copies(tmp_path):
    logs = [arm(seed, quantum=0.002) for seed in range(3)]
    for log in logs:
        log[:, 1:5] -= log[0, 1:5]
    rest = np.zeros((400, 7))
    rest[:, 5:] = np.random.default_rng(5).normal(size=(400, 2))  # Noise of inputs that move nothing.
    for k, log in enumerate(logs):
        rest[:, 0] = log[0, 0] + 0.005 * np.arange(-400, 0)
        logs[k] = np.concatenate([rest, log])
    logs[1][900:915, 1:] = logs[0][800:815, 1:]
    assert "copy" not in [kind for kind, *_ in found(parted(tmp_path, *logs))]

"""That inputs are not looked at for too few rows is said, with how much more motion it takes."""

import numpy as np
import pytest

from symoden.data import Dataset, Trajectory, check_dataset
from symoden.data.description import read_description
from symoden.data.dynamics import find_doubts
from symoden.data.dynamics._bumps import bumps_of, lacking_seconds

STEP, IS_ANGLE = 0.02, np.array([False, True])


def log(rows, *, step=STEP, size=2, inputs=2, name="run"):
    """A motion under inputs that change."""
    rng = np.random.default_rng(rows)
    ts = step * np.arange(rows)
    q = np.cumsum(rng.normal(0, 0.1, (rows, size)), axis=0) * step
    return Trajectory(name=name, ts=ts, q=q, rates=np.gradient(q, ts, axis=0), us=rng.normal(0, 1, (rows, inputs)))


SAID = {"space": "R1 T1", "time": "t", "positions": ["x", "q"], "inputs": ["u", "w"], "train": {"files": ["run"]}}


def notes(*train, **more):
    """What is said of too few rows."""
    one = {"t": np.zeros(9), **{name: np.zeros(9) for name in "xquw"}}
    description = read_description(SAID, tables={"run": one})
    dataset = Dataset(name="d", space="R1 T1", train=train, **more)
    return [each for each in find_doubts(dataset, description, IS_ANGLE).description if each.kind == "few"]


def seconds(finding):
    """How much more motion it asks for."""
    return float(finding.text.split("about ")[1].split(" s")[0])


@pytest.mark.parametrize("rows", [12, 226, 300, 340])
@pytest.mark.parametrize("step", [0.02, 0.1])
def test_as_much_more_motion_as_is_named_is_enough(rows, step):
    (finding,) = notes(log(rows, step=step))
    assert (finding.kind, finding.level) == ("few", "note")
    more = round(seconds(finding) / step)
    assert notes(log(rows + more, step=step)) == []
    assert notes(log(rows + int(0.7 * more), step=step))
    assert finding.text.startswith("signs, delays and `hold` of inputs are not looked at: [train] has too few rows")


def test_where_delays_alone_are_not_looked_at_they_are_named_alone():
    rows = next(rows for rows in range(300, 600) if not lacking_seconds([log(rows)], IS_ANGLE))
    (finding,) = notes(log(rows))
    assert finding.text.startswith("delays of inputs are not looked at: [train] has too few rows, by about ")


def test_without_inputs_or_where_none_changes_nothing_is_said():
    assert notes(log(226, inputs=0)) == []
    still = log(226)
    assert notes(Trajectory(name="a", ts=still.ts, q=still.q, rates=still.rates, us=0 * still.us)) == []
    assert notes(log(226), momenta=True) == []
    assert notes(log(50, step=2.0)) == []  # The clock is doubted rather.
    assert notes(test=(log(226),)) == []


@pytest.mark.parametrize("rows", [10, 100, *range(250, 300, 4), 500])
@pytest.mark.parametrize("margins", [(0.0, 0.0), (0.25, 0.05)])
def test_nothing_is_lacking_where_bumps_are_laid(rows, margins):
    first, last = margins
    recordings = [log(rows), log(rows // 3 + 2)]
    laid = bumps_of(recordings, IS_ANGLE, first=first, last=last, held=True)
    assert bool(laid) == (lacking_seconds(recordings, IS_ANGLE, first=first, last=last) == 0)


@pytest.mark.parametrize("joints", [6, 10])
def test_bumps_are_enough_for_arms_of_many_joints(joints):
    arm = [log(10000, step=0.01, size=joints, inputs=joints)]
    parts = bumps_of(arm, np.ones(joints, bool), held=True)
    numbers = parts[0].motion.shape[1] + parts[0].pushed(0.0).shape[1]
    assert sum(len(each.samples) for each in parts) >= 4 * numbers


def test_the_check_says_it():
    table = log(226)
    columns = {"t": table.ts, "x": table.q[:, 0], "q": table.q[:, 1], "u": table.us[:, 0], "w": table.us[:, 1]}
    findings = check_dataset(SAID, tables={"run": columns}).findings
    assert [each.level for each in findings if each.kind == "few"] == ["note"]

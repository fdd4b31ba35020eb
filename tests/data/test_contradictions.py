"""A file in which an input does something else than in the others is named; files that agree are not."""

import dataclasses
import itertools

import numpy as np
import pytest

from symoden.data import Dataset, DataWarning, Trajectory, _contradictions, check_dataset, read_dataset
from symoden.data._bumps import bumps_of
from symoden.data._contradictions import _Answer, _File, find_contradictions

STEP, IS_ANGLE = 0.01, np.array([False, True])
INVERSE = np.linalg.inv([[1.0, 0.3], [0.3, 0.5]])


def cart(name, seed, *, samples=1200, size=2.0, noise=1e-3):
    """Two coupled joints, one under gravity, with steps of their inputs."""
    rng = np.random.default_rng(seed)
    us = np.repeat(rng.uniform(-size, size, (samples // 40 + 1, 2)), 40, axis=0)[:samples]
    states = np.zeros((samples, 2, 2))
    for k in range(samples - 1):
        q, v = states[k]
        for _ in range(10):
            force = us[k] * [2, 1] - [0, 3 * np.sin(q[1])] - 0.5 * v - 2 * q * [1, 0]
            v = v + STEP / 10 * INVERSE @ force
            q = q + STEP / 10 * v
        states[k + 1] = q, v
    measured = states + rng.normal(0, noise, states.shape) * [[[1], [3]]]
    return Trajectory(name=name, ts=STEP * np.arange(samples), q=measured[:, 0], rates=measured[:, 1], us=us)


def turned(recording, factor, column):
    us = recording.us.copy()
    us[:, column] *= factor
    return dataclasses.replace(recording, us=us)


def stretched(recording, factor):
    return dataclasses.replace(recording, q=recording.q * factor, rates=recording.rates * factor)


def found(*train, test=(), **more):
    dataset = Dataset(name="d", space="R1 T1", train=train, test=test, input_names=("u", "w"), **more)
    return find_contradictions(dataset, IS_ANGLE)


FILES = [cart(name, seed) for seed, name in enumerate("abcd")]
MANY = FILES + [cart(name, 50 + seed, samples=600) for seed, name in enumerate("efghijklmnopqrstuvwxyzABCDEFGHIJKLMN")]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("count", [2, 3])
def test_files_that_agree_are_not_named(seed, count):
    # Of other size, and with hardly any motion in one of them.
    files = [cart(f"run {k}", 10 * seed + k, size=[2.0, 0.5, 0.05][k], noise=1e-3) for k in range(count)]
    assert found(*files) == []


@pytest.mark.parametrize("k", range(4))
@pytest.mark.parametrize("column", [0, 1])
def test_an_input_that_is_turned_in_one_file_is_named(k, column):
    files = [turned(each, -1, column) if i == k else each for i, each in enumerate(FILES)]
    (finding,) = found(*files[:3], test=tuple(files[3:]))
    part = "train" if k < 3 else "test"
    assert (finding.kind, finding.level, finding.channel) == ("sign", "warning", "uw"[column])
    assert f"in `{'abcd'[k]}` ({part}) the other way round than in the other recordings" in finding.text


@pytest.mark.parametrize("k", range(4))
@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_an_input_in_another_unit_in_one_file_is_named(k, factor):
    files = [turned(each, factor, 0) if i == k else each for i, each in enumerate(FILES)]
    (finding,) = found(*files)
    assert (finding.kind, finding.channel) == ("unit", "u")
    words = finding.text.split()
    assert float(words[words.index("times") - 1]) == pytest.approx(1 / factor, rel=0.2)
    assert f"`{'abcd'[k]}` (train)" in finding.text


def test_what_is_wrong_in_other_ways_is_said_apart():
    wrong = {2: 1e-3, 5: -1e3}
    texts = [finding.text for finding in found(*(turned(each, wrong.get(i, 1), 0) for i, each in enumerate(MANY[:12])))]
    assert [text.split(" in ")[1].split(" as much")[0] for text in texts] == [
        "`c` (train) 1000 times",
        "`f` (train) -0.001 times",
    ]


@pytest.mark.parametrize("odd", [(5,), (2, 11, 30)])
def test_of_many_files_each_tells_enough(odd):
    files = [turned(each, -1, 1) if i in odd else each for i, each in enumerate(MANY)]
    (finding,) = found(*files)
    assert finding.kind == "sign"
    assert all(f"`{MANY[i].name}` (train)" in finding.text for i in odd)


def test_positions_in_another_unit_make_every_input_seem_so():
    carts = [dataclasses.replace(each, q=each.q[:, :1], rates=each.rates[:, :1], us=each.us[:, :1]) for each in FILES]
    dataset = Dataset(name="d", space="R1", train=(*carts[:3], stretched(carts[3], 1e3)), input_names=("u",))
    (finding,) = find_contradictions(dataset, IS_ANGLE[:1])
    assert (finding.kind, "`d` (train)" in finding.text) == ("unit", True)


def test_of_two_files_either_may_be_wrong():
    (finding,) = found(FILES[0], turned(FILES[1], -1, 1))
    assert "`a` (train) the other way round than in `b` (train)" in finding.text


def test_pieces_of_a_file_are_one():
    pieces = [FILES[3].cut(k * 400, (k + 1) * 400, name=f"d#{k + 1}") for k in range(3)]
    (finding,) = found(*FILES[:3], *(turned(each, -1, 0) for each in pieces))
    assert "in `d` (train) the other way round" in finding.text


def test_nothing_is_said_where_nothing_tells():
    short = [each.cut(0, 100, name=each.name) for each in FILES]
    assert found(*(turned(each, -1, 0) if k else each for k, each in enumerate(short))) == []
    still = dataclasses.replace(FILES[1], us=0 * FILES[1].us)
    assert found(FILES[0], still) == []
    assert find_contradictions(Dataset(name="d", space="R1 T1", train=(cart("a", 0, samples=50),)), IS_ANGLE) == []
    momenta = Dataset(name="d", space="R1 T1", train=(FILES[0], turned(FILES[1], -1, 0)), momenta=True)
    assert find_contradictions(momenta, IS_ANGLE) == []


def test_the_check_and_training_say_it(tmp_path):
    for k, each in enumerate(FILES[:3]):
        recording = turned(each, -1, 0) if k == 1 else each
        rows = np.column_stack([recording.ts, recording.q, recording.rates, recording.us])
        np.savetxt(tmp_path / f"{each.name}.csv", rows, delimiter=",", header="t,x,q,vx,vq,u,w", comments="")
    path = tmp_path / "cart.toml"
    path.write_text(
        'space = "R1 T1"\ntime = "t"\npositions = ["x", "q"]\nvelocities = ["vx", "vq"]\ninputs = ["u", "w"]\n'
        '[train]\nfiles = ["*.csv"]\n'
    )
    (finding,) = [each for each in check_dataset(path).findings if each.kind == "sign"]
    assert "`u` accelerates the mechanism in `b` (train) the other way round" in finding.text
    with pytest.warns(DataWarning, match="the other way round than in the other recordings"):
        read_dataset(path)


@pytest.mark.parametrize(
    ("there", "back", "named"),
    [(-1.0, -1.0, True), (1e-3, 1e3, True), (1e-3, 300.0, True), (-0.0039, -0.6, False), (-0.033, -2.3, False)],
)
def test_what_a_file_says_of_the_others_must_be_the_inverse(monkeypatch, there, back, named):
    """Where files have been in different places each may misjudge the other, but not by one factor."""
    answers = itertools.cycle([there, back])

    def answer(*_args):
        return _Answer(np.array([next(answers)]), np.array([20.0]), np.array([0.9]))

    monkeypatch.setattr(_contradictions, "_answer", answer)
    carts = tuple(dataclasses.replace(each, us=each.us[:, :1]) for each in FILES[:2])
    dataset = Dataset(name="d", space="R1 T1", train=carts, input_names=("u",))
    assert bool(find_contradictions(dataset, IS_ANGLE)) == named


def test_a_file_that_tells_little_but_turns_all_others_against_the_mean_is_the_odd_one(monkeypatch):
    """Numbers a thousand times as large are all that a regression sees, whatever they tell by themselves."""
    contradicting = _Answer(np.array([1e3]), np.array([20.0]), np.array([0.9]))
    monkeypatch.setattr(
        _contradictions, "_contradicting", lambda files: dict.fromkeys("ab", contradicting) if "c" in files else {}
    )
    file = _File.of(bumps_of(FILES[:1], IS_ANGLE, held=True))
    odd, pair = _contradictions._odd_ones(dict.fromkeys("abcd", file))
    assert (list(odd), odd["c"].factor.tolist(), pair) == (["c"], [1e-3], ())

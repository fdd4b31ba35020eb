"""A file that agrees with the others only after a change is named, and the change; files that agree are not."""

import dataclasses

import numpy as np
import pytest

from symoden.data import Dataset, DataWarning, Trajectory, check_dataset, read_dataset
from symoden.data.dynamics._contradictions import find_contradictions

STEP, IS_ANGLE = 0.01, np.array([False, True])
INVERSE = np.linalg.inv([[1.0, 0.3], [0.3, 0.5]])


def cart(name, seed, *, samples=1200, size=2.0, noise=1e-3, load=1.0, start=0.0):
    """Two coupled joints, one under gravity, with steps of their inputs."""
    rng = np.random.default_rng(seed)
    us = np.repeat(rng.uniform(-size, size, (samples // 40 + 1, 2)), 40, axis=0)[:samples]
    states = np.zeros((samples, 2, 2))
    states[0] = [[start, start], [0.0, 0.0]]
    for k in range(samples - 1):
        q, v = states[k]
        for _ in range(10):
            force = us[k] * [2, 1] - [0, 3 * np.sin(q[1])] - 0.5 * v - 2 * q * [1, 0]
            v = v + STEP / 10 * INVERSE @ force / load
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
    dataset = Dataset(name="d", space="R1 T1", train=train, test=test, **more)
    return find_contradictions(dataset, IS_ANGLE)


def moved(recording, way):
    return dataclasses.replace(recording, q=recording.q + way)


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
    name = "u1" if column == 0 else "u2"
    assert (finding.kind, finding.level, finding.channel) == ("sign", "warning", name)
    only = f"`{'abcd'[k]}` ({part}) moves as the other recordings do only if the sign of `{name}` is turned: then"
    assert finding.text.startswith(only)


@pytest.mark.parametrize("k", range(4))
@pytest.mark.parametrize(("units", "what"), [([1e3, 1], "`u1` is"), ([1e-3, 1e-3], "all inputs are")])
def test_inputs_in_another_unit_in_one_file_are_named(k, units, what):
    files = [dataclasses.replace(each, us=each.us * units) if i == k else each for i, each in enumerate(FILES)]
    (finding,) = found(*files)
    assert (finding.kind, finding.channel) == ("unit", "u1")
    assert finding.text.startswith(f"`{'abcd'[k]}` (train)")
    assert f"only if {what} taken times {1 / units[0]:g}" in finding.text


@pytest.mark.parametrize(
    ("change", "kind", "words"),
    [
        (lambda each: stretched(each, [1, 180 / np.pi]), "unit", "and its velocity are taken to be in degrees"),
        (lambda each: stretched(each, [1, np.pi / 180]), "unit", "and its velocity are taken to be in radians"),
        (lambda each: stretched(each, [1, -1]), "sign", "the sign of `q2` and its velocity is turned"),
        (lambda each: dataclasses.replace(each, us=each.us[:, ::-1]), "order", "`u1` and `u2` are exchanged"),
        (lambda each: dataclasses.replace(each, us=-each.us), "sign", "the sign of all inputs is turned"),
    ],
)
@pytest.mark.parametrize("k", range(2))
def test_what_is_wrong_with_a_file_is_said(change, kind, words, k):
    (finding,) = found(*(change(each) if i == k else each for i, each in enumerate(FILES)))
    assert (finding.kind, finding.level) == (kind, "warning")
    assert finding.text.startswith(f"`{'abcd'[k]}` (train) ")
    assert words in finding.text


@pytest.mark.parametrize("k", range(1, 4))
@pytest.mark.parametrize(("rows", "when"), [(10, "sooner"), (-10, "later")])
def test_inputs_that_are_late_in_one_file_are_named_with_the_delay(k, rows, when):
    files = [
        dataclasses.replace(each, us=np.roll(each.us, rows, axis=0)) if i == k else each for i, each in enumerate(FILES)
    ]
    (finding,) = found(*files)
    assert (finding.kind, finding.level) == ("delay", "warning")
    assert f"`{'abcd'[k]}` (train) moves as the other recordings do only if inputs act 0.1 s {when}" in finding.text
    assert finding.text.count("inputs act") == 1


def drive(name, seed, frequency, *, samples=800):
    """A slow drive with a dead zone under one sine, whose phase is another at another frequency."""
    rng = np.random.default_rng(seed)
    us = 3 * np.sin(2 * np.pi * frequency * STEP * np.arange(samples) + rng.uniform(0, 6))
    states = np.zeros((samples, 2))
    q = v = push = 0.0
    for k in range(samples):
        states[k] = q, v
        for _ in range(10):
            push += STEP / 10 * (us[k] - push) / 0.03
            v += STEP / 10 * (60 * np.sign(push) * max(abs(push) - 0.5, 0.0) - 10 * v)
            q += STEP / 10 * v
    states += rng.normal(0, 1e-3, states.shape) * [1, 3]
    return Trajectory(name=name, ts=STEP * np.arange(samples), q=states[:, :1], rates=states[:, 1:], us=us[:, None])


@pytest.mark.parametrize(("seed", "first", "then"), [(0, 1, 5), (3, 2, 7)])
def test_the_phase_of_another_sine_by_a_slow_drive_is_no_delay(seed, first, then):
    files = tuple(drive(f"{frequency} Hz", 9 * seed + frequency, frequency) for frequency in (first, then))
    dataset = Dataset(name="d", space="R1", train=files)
    assert find_contradictions(dataset, IS_ANGLE[:1]) == []


def test_coordinates_of_a_kind_that_are_exchanged_are_named():
    def swapped(each):
        return dataclasses.replace(each, q=each.q[:, ::-1], rates=each.rates[:, ::-1])

    dataset = Dataset(name="d", space="R2", train=(*FILES[:2], swapped(FILES[2])), position_names=("x", "y"))
    (finding,) = find_contradictions(dataset, np.array([False, False]))
    assert (finding.kind, finding.channel) == ("order", "x")
    assert "only if `x` and `y` are exchanged" in finding.text


def test_files_that_are_wrong_in_other_ways_are_named_apart():
    wrong = {2: 1e-3, 5: -1}
    texts = [finding.text for finding in found(*(turned(each, wrong.get(i, 1), 0) for i, each in enumerate(MANY[:12])))]
    assert [text.split("` (train)")[0] for text in texts] == ["`c", "`f"]
    assert "only if `u1` is taken times 1000" in texts[0]
    assert "only if the sign of `u1` is turned" in texts[1]


@pytest.mark.parametrize("odd", [(5,), (2, 11, 30)])
def test_of_many_files_each_tells_enough(odd):
    findings = found(*(turned(each, -1, 1) if i in odd else each for i, each in enumerate(MANY)))
    assert [finding.text.split(" moves")[0] for finding in findings] == [f"`{MANY[i].name}` (train)" for i in odd]
    assert {finding.kind for finding in findings} == {"sign"}


def test_one_file_that_outweighs_the_others_is_the_odd_one():
    """Numbers a thousand times as large are most of what a regression of all others sees."""
    carts = [dataclasses.replace(each, q=each.q[:, :1], rates=each.rates[:, :1], us=each.us[:, :1]) for each in FILES]
    dataset = Dataset(name="d", space="R1", train=(*carts[:3], stretched(carts[3], [1e3])), input_names=("u",))
    (finding,) = find_contradictions(dataset, IS_ANGLE[:1])
    assert (finding.kind, finding.text.split(" moves")[0]) == ("unit", "`d` (train)")


def test_of_two_files_either_may_be_wrong():
    (finding,) = found(FILES[0], turned(FILES[1], -1, 1))
    first, then = finding.text.split("` (train)")[0][1:], finding.text.split("moves as `")[1][0]
    assert {first, then} == {"a", "b"}
    assert "does only if the sign of `u2` is turned" in finding.text


def test_pieces_of_a_file_are_one():
    pieces = [FILES[3].cut(k * 400, (k + 1) * 400, name=f"d#{k + 1}") for k in range(3)]
    (finding,) = found(*FILES[:3], *(turned(each, -1, 0) for each in pieces))
    assert finding.text.startswith("`d` (train) moves as the other recordings do only if the sign of `u1`")


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
    assert "`b` (train) moves as the other recordings do only if the sign of `u` is turned" in finding.text
    with pytest.warns(DataWarning, match="moves as the other recordings do only if the sign of `u` is turned"):
        read_dataset(path)


@pytest.mark.parametrize("way", [0.0, 30.0, 1e4])
def test_lengths_are_as_well_far_from_zero(way):
    files = [moved(each, [way, 0.0]) for each in [turned(FILES[0], -1, 0), *FILES[1:]]]
    (one,) = found(*files)
    assert "`a` (train)" in one.text
    assert "the sign of" in one.text
    assert found(*(moved(each, [way, 0.0]) for each in FILES)) == []


@pytest.mark.parametrize("k", range(4))
def test_a_file_that_is_like_the_others_in_nothing_is_named(k):
    payload = cart(FILES[k].name, k, load=2.5)
    (one,) = found(*(payload if i == k else each for i, each in enumerate(FILES)))
    assert (one.kind, one.level) == ("unlike", "warning")
    assert one.text.startswith(f"`{FILES[k].name}` (train) moves otherwise than the other recordings")


def test_of_two_files_that_are_unlike_one_or_both_are_named():
    findings = found(FILES[0], cart("b", 1, load=2.5))
    assert {one.kind for one in findings} == {"unlike"}
    assert all("otherwise than the other recording:" in one.text for one in findings)


@pytest.mark.parametrize("count", [2, 4])
def test_without_inputs_files_are_compared_as_well(count):
    free = [dataclasses.replace(cart(f"{k}", k, size=0.0, start=1.5), us=np.zeros((1200, 0))) for k in range(count)]
    other = dataclasses.replace(cart("other", 9, size=0.0, start=1.5, load=2.5), us=np.zeros((1200, 0)))
    assert found(*free) == []
    assert {one.kind for one in found(*free, other)} == {"unlike"}

"""Dead spots of sensors, told from motion, noise, stops and time stamps that are off."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, DataWarning, check_dataset, read_dataset
from symoden.data.logs._blind import BlindSpot, blind_spots
from symoden.data.logs._logs import Log

STEP, SIZE, TURN = 0.02, 1500, 2 * np.pi
NAMES = {"time": ("t",), "positions": ("q",), "inputs": ("u",)}


def log(q, ts=None):
    ts = STEP * np.arange(len(q)) if ts is None else ts
    return Log(
        part="train", name="r", path=Path("r.csv"), rows=np.arange(len(ts)),
        ts=ts, q=np.array(q)[:, None], rates=None, us=np.zeros((len(q), 1)), names=NAMES,
    )  # fmt: skip


def swing(seed, *, size=2.5, noise=0.002, rate=4.0):
    """Swings of a size that wanders, and the pauses between them."""
    generator = np.random.default_rng(seed)
    ts = STEP * np.arange(SIZE)
    slow = generator.uniform(0.1, 0.3, 3)
    amplitude = size * (0.7 + 0.3 * np.sin(slow[0] * ts + seed))
    return ts, amplitude * np.sin(rate * ts + np.sin(slow[1] * ts)) + noise * generator.normal(size=SIZE)


def wrapped(q):
    return np.mod(q + np.pi, TURN) - np.pi


def deadened(q, start, width):
    """What a potentiometer shows that has no track there: one end or the other."""
    inside = np.mod(q - start, TURN) < width
    return np.where(inside, np.where(np.mod(q - start, TURN) < width / 2, start, start + width), q)


def spots(q, ts=None, *, is_angle=True, described=()):
    return blind_spots([log(q, ts)], np.array([is_angle]), dict(described))


@given(seed=st.integers(0, 200), start=st.floats(-1.5, 1.2), width=st.floats(0.25, 0.5), shift=st.floats(-3, 3))
def test_a_dead_spot_is_found_wherever_the_angle_is_counted_from(seed, start, width, shift):
    _, q = swing(seed)
    (found,) = spots(wrapped(deadened(q, start, width) + shift))
    assert found.covers(wrapped(np.array([start, start + width / 2, start + width]) + shift), is_angle=True).all()
    assert not found.covers(wrapped(np.array([start - 0.6, start + width + 0.6]) + shift), is_angle=True).any()
    assert found.channel == "q"
    assert (found.loud or 0) > 4.0
    assert found.passages >= 5


def test_an_angle_that_is_called_a_length_has_none_where_it_is_wrapped():
    _, q = swing(3)
    assert spots(np.mod(q, TURN), is_angle=False) == ()


def test_a_dead_spot_of_a_length_is_found():
    _, q = swing(3)
    (found,) = spots(np.where((q > 0.5) & (q < 0.8), 0.5, q), is_angle=False)
    start, stop = found.interval
    assert 0.0 < start < 0.5
    assert 0.8 < stop < 1.3


@given(
    seed=st.integers(0, 500),
    noise=st.sampled_from([0.0, 1e-5, 0.002, 0.05]),
    rate=st.floats(1.0, 16.0),
    size=st.floats(0.3, 9.0),
    is_angle=st.booleans(),
    late=st.floats(0.0, 0.3),
)
def test_motion_and_noise_have_none(seed, noise, rate, size, is_angle, late):
    ts, q = swing(seed, noise=noise, rate=rate, size=size)
    generator = np.random.default_rng(seed)
    stamps = ts + late * STEP * generator.uniform(-0.5, 0.5, SIZE)
    assert spots(wrapped(q) if is_angle else q, stamps, is_angle=is_angle) == ()


@given(seed=st.integers(0, 500), stop=st.floats(0.3, 1.5), back=st.floats(0.2, 1.0))
def test_a_stop_is_none(seed, stop, back):
    _, q = swing(seed)
    assert spots(np.where(q > stop, stop - back * (q - stop), q)) == ()


@pytest.mark.parametrize("counts", [100, 256, 1024, 4096])
@pytest.mark.parametrize("step", [0.002, 0.01])
def test_a_coarse_encoder_has_none(counts, step):
    ts, count = step * np.arange(8000), TURN / counts
    assert spots(wrapped(np.round((2.5 * np.sin(3 * ts) + 0.2 * np.sin(0.7 * ts)) / count) * count), ts) == ()


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_backlash_and_pauses_at_one_place_are_none(noise):
    ts = 0.002 * np.arange(16_000)
    noisy = noise * np.random.default_rng(0).normal(size=len(ts))
    drive = 1.2 * np.sin(3 * ts) + 0.3 * np.sin(1.1 * ts)
    driven = np.zeros(len(ts))
    for k in range(1, len(ts)):
        driven[k] = np.clip(driven[k - 1], drive[k] - 0.03, drive[k] + 0.03)
    assert spots(driven + noisy, ts, is_angle=False) == ()
    pulses = np.where(ts % 4 < 2, 0.5, 0.5 + np.sin(3 * (ts % 4 - 2)) ** 2)
    assert spots(pulses + noisy, ts, is_angle=False) == ()


@given(seed=st.integers(0, 200))
def test_one_fast_stretch_with_a_clock_that_stumbles_is_none(seed):
    generator = np.random.default_rng(seed)
    ts, q = swing(seed, rate=1.0)
    fast = slice(700, 760)
    q[fast] = 2.2 * np.sin(12.0 * ts[fast])
    assert spots(q, ts + 0.2 * STEP * generator.uniform(-0.5, 0.5, SIZE)) == ()


def test_what_the_description_says_of_a_column_goes_before_what_is_found():
    _, q = swing(1)
    q = deadened(q, 0.5, 0.3)
    assert len(spots(q)) == 1
    assert spots(q, described={"q": ()}) == ()
    told = spots(q, described={"q": ((0.4, 0.9),)})
    assert [(each.interval, each.loud) for each in told] == [((0.4, 0.9), None)]


def test_an_interval_past_half_a_turn_covers_both_ends_of_the_circle():
    spot = BlindSpot(channel="q", interval=(3.0, 3.5))
    assert spot.covers(np.array([2.9, 3.1, -3.1, -2.7, 3.1 + TURN]), is_angle=True).tolist() == [0, 1, 1, 0, 1]
    assert spot.covers(np.array([2.9, 3.1, -3.1]), is_angle=False).tolist() == [0, 1, 0]


def test_a_glitch_is_no_end_of_a_length_and_a_sensor_in_its_spot_is_not_stuck(tmp_path):
    _, q = swing(3)
    q = np.where((q > 0.5) & (q < 0.8), 0.5, q)
    q[700] = 60.0
    assert len(spots(q, is_angle=False)) == 1
    ts, q = swing(1)
    q[500:600] = 0.6
    rows = np.stack([ts, wrapped(deadened(q, 0.5, 0.3)), np.gradient(q, ts), np.sin(ts)], axis=1)
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,q,v,u", comments="")
    (tmp_path / "pot.toml").write_text(
        'space = "T1"\ntime = "t"\npositions = ["q"]\nvelocities = ["v"]\ninputs = ["u"]\n'
        '[train]\nfiles = ["run.csv"]\n'
    )
    (check,) = check_dataset(tmp_path / "pot.toml").recordings
    kinds = {each.kind for each in check.findings}
    assert "blind" in kinds
    assert "stuck" not in kinds


def test_too_little_says_nothing():
    _, q = swing(1)
    assert spots(q[:40]) == ()
    assert spots(np.zeros(SIZE)) == ()
    assert spots(np.zeros(SIZE), is_angle=False) == ()
    assert spots(deadened(q, 0.5, 0.3), np.sort(STEP * np.arange(SIZE))[::-1]) == ()


def written(folder, *, more="", dead=True):
    for number in (1, 2):
        ts, q = swing(number)
        u = np.sin(3 * ts)
        rows = np.stack([ts, wrapped(deadened(q, 0.5, 0.3) if dead else q), u], axis=1)
        np.savetxt(folder / f"run{number}.csv", rows, delimiter=",", header="t,q,u", comments="")
    path = folder / "pot.toml"
    path.write_text(
        f'space = "T1"\ntime = "t"\npositions = ["q"]\ninputs = ["u"]\n{more}\n[train]\nfiles = ["run*.csv"]\n'
    )
    return path


def test_rows_in_it_are_left_out_and_said(tmp_path):
    path = written(tmp_path)
    with pytest.warns(DataWarning, match="rows in which `q` is between"):
        dataset = read_dataset(path)
    found = [each for check in check_dataset(path).recordings for each in check.findings if each.kind == "blind"]
    assert len(found) == 2
    assert all(each.level == "masked" and each.channel == "q" and each.spans for each in found)
    assert "a dead spot of the sensor?" in found[0].text
    assert "`blind = { q = [] }`" in found[0].advice
    q = np.concatenate([recording.q[:, 0] for recording in dataset.train])
    assert not ((wrapped(q) > 0.5) & (wrapped(q) < 0.8)).any()
    assert len(q) > 0.6 * 2 * SIZE


def test_a_description_may_take_them_or_name_others(tmp_path):
    with pytest.warns(DataWarning, match="stand out alone"):
        kept = read_dataset(written(tmp_path, more="blind = { q = [] }"))
    assert sum(map(len, kept.train)) > 0.98 * 2 * SIZE
    path = written(tmp_path, more="blind = { q = [[-1.0, -0.5], [0.4, 0.9]] }", dead=False)
    with pytest.warns(DataWarning, match=r"between -1 and -0\.5, .* between 0\.4 and 0\.9"):
        named = read_dataset(path)
    q = wrapped(np.concatenate([recording.q[:, 0] for recording in named.train]))
    assert not (((q >= -1.0) & (q <= -0.5)) | ((q >= 0.4) & (q <= 0.9))).any()
    said = {each.text for check in check_dataset(path).recordings for each in check.findings if each.kind == "blind"}
    assert any("where it is said to be blind" in text for text in said)


@pytest.mark.parametrize(
    ("more", "wanted"),
    [
        ("blind = 3", "must be a table of columns"),
        ("blind = { q = [0.4, 0.9] }", "lists of intervals"),
        ("blind = { q = [[0.9, 0.4]] }", "from less to more"),
        ("blind = { q = [[0.4, nan]] }", "lists of intervals"),
        ("blind = { q = [[50, 480]] }", "must be shorter than a turn"),
        ("blind = { u = [[0.4, 0.9]] }", "`blind` must name columns that are read, which are `q`; got `u`"),
    ],
)
def test_what_is_no_interval_of_a_position_is_refused(tmp_path, more, wanted):
    with pytest.raises(DataError, match=wanted):
        read_dataset(written(tmp_path, more=more))


def test_a_held_input_is_its_mean_over_rows_that_are_left_out(tmp_path):
    ts = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
    q, u = ["0", "1", "", "2", "", "4", "5", "6"], [1, 2, 6, 3, "", 5, 6, 7]
    rows = [f"{x},{y},{z}" for x, y, z in zip(ts, q, u, strict=True)]
    (tmp_path / "run.csv").write_text("t,q,u\n" + "\n".join(rows) + "\n")
    path = tmp_path / "run.toml"
    text = 'space = "R1"\ntime = "t"\npositions = ["q"]\ninputs = ["u"]\n[train]\nfiles = ["run.csv"]\n'
    path.write_text(text)
    with pytest.warns(DataWarning):
        (recording,) = read_dataset(path).train
    assert recording.ts.tolist() == [0.1, 0.2, 0.4, 0.6, 0.7, 0.8]
    assert recording.us[:, 0] == pytest.approx([1, 4, 3, 5, 6, 7])  # (2 + 6) / 2; what acts at 0.5 s is not known.
    path.write_text('hold = "linear"\n' + text)
    with pytest.warns(DataWarning):
        (recording,) = read_dataset(path).train
    assert recording.us[:, 0].tolist() == [1, 2, 3, 5, 6, 7]

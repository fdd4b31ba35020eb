"""Tables that hold messages of several clocks are brought to the rows of the positions, and nothing else is."""

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings, strategies as st

from symoden.data import DataError, DataWarning, check_dataset, read_dataset
from symoden.data.description._description import read_description
from symoden.data.logs._logs import Log, angles, read_logs
from symoden.data.logs._merged import on_one_clock

EPOCH = 1.7e9
TEXT = """
space = "T2"
time = "t"
positions = ["q1", "q2"]
velocities = ["v1", "v2"]
inputs = ["u"]
hold = "{hold}"
[train]
files = ["run.csv"]
"""


def angle(t):
    return np.stack([2 * np.sin(1.3 * t) + 4 * t, np.cos(2.1 * t)], axis=-1)


def velocity(t):
    return np.stack([2.6 * np.cos(1.3 * t) + 4, -2.1 * np.sin(2.1 * t)], axis=-1)


def clock(generator, step, end=12.0):
    t = np.cumsum(step * generator.uniform(0.8, 1.2, int(end / step) + 1)) + step * generator.uniform()
    return t[t < end]


def merged(folder, *messages, hold="zero"):
    """Write tables joined by their time stamps, as programs that record messages do."""
    table = messages[0]
    for other in messages[1:]:
        table = table.join(other, on="t", how="full", coalesce=True)
    table.sort("t").with_columns(pl.col("t") + EPOCH).write_csv(folder / "run.csv")
    path = folder / "run.toml"
    path.write_text(TEXT.format(hold=hold))
    return path


def states(t, *, turns=False):
    q, v = angle(t), velocity(t)
    q = (q + np.pi) % (2 * np.pi) - np.pi if turns else q
    return pl.DataFrame({"t": t, "q1": q[:, 0], "q2": q[:, 1], "v1": v[:, 0], "v2": v[:, 1]})


def brought(path):
    description = read_description(path)
    is_angle = angles(description)
    (log,) = read_logs(description).found
    assert isinstance(log, Log)
    return log, on_one_clock(log, is_angle, description.hold)


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 1000), rate=st.sampled_from([0.003, 0.01, 0.031, 0.4]))
def test_held_inputs_keep_their_impulse_over_every_step(tmp_path_factory, seed, rate):
    generator = np.random.default_rng(seed)
    t, tu = clock(generator, 0.008), clock(generator, rate)
    u = generator.normal(size=len(tu))
    path = merged(tmp_path_factory.mktemp("log"), states(t), pl.DataFrame({"t": tu, "u": u}))
    log, one = brought(path)
    assert one.merged is not None
    assert (one.merged.rows, one.merged.columns) == (len(log), ("u",))
    np.testing.assert_allclose(one.ts - EPOCH, t, atol=1e-6)
    np.testing.assert_array_equal(one.q, angle(t))
    fine = np.arange(0, 12, 1e-4)
    held = np.where(fine < tu[0], np.nan, u[np.searchsorted(tu, fine, side="right") - 1])
    for k in generator.integers(0, len(t) - 1, 20):
        expected = np.mean(held[(fine >= t[k]) & (fine < t[k + 1])])
        assert np.isnan(one.us[k, 0]) == (t[k] < tu[0])
        if not np.isnan(expected):
            assert one.us[k, 0] == pytest.approx(expected, abs=0.1)  # The fine grid misses edges by a hundredth.


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 1000), turns=st.booleans())
def test_positions_and_velocities_of_other_clocks_are_those_of_the_same_motion(tmp_path_factory, seed, turns):
    generator = np.random.default_rng(seed)
    first, second, third = clock(generator, 0.01), clock(generator, 0.007), clock(generator, 0.012)
    one_joint = states(first, turns=turns).select("t", "q1")
    other_joint = states(second, turns=turns).select("t", "q2")
    speeds = states(third).select("t", "v1", "v2").with_columns(u=1.0)
    one = brought(merged(tmp_path_factory.mktemp("log"), one_joint, other_joint, speeds))[1]
    assert one.merged is not None
    assert set(one.merged.columns) == {"q2", "v1", "v2", "u"}
    np.testing.assert_allclose(one.ts - EPOCH, first, atol=1e-6)
    assert one.rates is not None
    known = np.isfinite(one.q).all(axis=1) & np.isfinite(one.rates).all(axis=1)
    assert known.mean() > 0.99
    t = first[known]
    turn = np.exp(1j * (one.q[known] - angle(t)))
    assert np.abs(turn - 1).max() < 1e-4
    assert np.abs(one.rates[known] - velocity(t)).max() < 1e-3


def test_smooth_inputs_are_interpolated(tmp_path):
    generator = np.random.default_rng(0)
    t, tu = clock(generator, 0.008), clock(generator, 0.01)
    _, one = brought(merged(tmp_path, states(t), pl.DataFrame({"t": tu, "u": np.sin(3 * tu)}), hold="linear"))
    known = np.isfinite(one.us[:, 0])
    assert known.mean() > 0.99
    np.testing.assert_allclose(one.us[known, 0], np.sin(3 * t[known]), atol=1e-3)


def test_nothing_is_interpolated_across_a_gap(tmp_path):
    generator = np.random.default_rng(0)
    t, tv = clock(generator, 0.008), clock(generator, 0.01)
    tv = tv[(tv < 4) | (tv > 5)]
    speeds = states(tv).select("t", "v1", "v2")
    path = merged(tmp_path, states(t).select("t", "q1", "q2").with_columns(u=0.5), speeds)
    _, one = brought(path)
    within = (t > tv[tv < 4].max()) & (t < tv[tv > 5].min())
    assert one.rates is not None
    assert np.isnan(one.rates[within]).all()
    (check,) = check_dataset(path).recordings
    assert check.recordings == 2
    assert check.missing >= within.sum()


@pytest.mark.parametrize("share", [0.0, 0.05])
@pytest.mark.parametrize("column", ["q1", "v2", "u"])
def test_a_log_of_one_clock_stays_as_it_is_though_a_sensor_fails(tmp_path, share, column):
    generator = np.random.default_rng(0)
    t = clock(generator, 0.008)
    table = states(t).with_columns(u=pl.Series(np.sin(t)))
    fails = generator.uniform(size=len(t)) < share
    fails[500:1100] = True  # And once for long.
    path = merged(tmp_path, table.with_columns(pl.when(pl.Series(~fails)).then(pl.col(column))))
    log, one = brought(path)
    assert one is log
    (check,) = check_dataset(path).recordings
    assert {finding.kind for finding in check.findings} >= {"missing", "gap"}


def test_time_stamps_out_of_order_are_left_for_their_own_refusal(tmp_path):
    generator = np.random.default_rng(0)
    t, tu = clock(generator, 0.008), clock(generator, 0.01)
    path = merged(tmp_path, states(t), pl.DataFrame({"t": tu, "u": tu}))
    lines = (tmp_path / "run.csv").read_text().splitlines()
    lines[70:90] = reversed(lines[70:90])
    (tmp_path / "run.csv").write_text("\n".join(lines) + "\n")
    log, one = brought(path)
    assert one is log
    assert "time" in {finding.kind for finding in check_dataset(path).recordings[0].findings}


def test_such_a_table_is_named_and_read_and_places_are_those_of_the_file(tmp_path):
    generator = np.random.default_rng(0)
    t, tu = clock(generator, 0.008), clock(generator, 0.01)
    table = states(t)
    table[700, "q2"] = 1e30
    path = merged(tmp_path, table, pl.DataFrame({"t": tu, "u": np.sin(tu)}))
    line = 2 + int(np.searchsorted(np.sort(np.concatenate([t, tu])), t[700]))
    (check,) = check_dataset(path).recordings
    assert [one.kind for one in check.findings if one.kind in {"clocks", "impossible"}] == ["clocks", "impossible"]
    said = f"`u` and `q1` have numbers in different rows: {len(t)} of {len(t) + len(tu)} are used"
    assert said in check.findings[0].text
    assert any(f"line {line} (row {line - 2})" in finding.text for finding in check.findings)
    with pytest.warns(DataWarning) as warned:
        dataset = read_dataset(path)
    assert ["brought to the rows of the positions" in str(each.message) for each in warned] == [True, False]
    assert "beyond 1e+20" in str(warned[1].message)
    assert sum(map(len, dataset.train)) >= len(t) - 5


@pytest.mark.parametrize("wrong", [1e30, 30.0])
@pytest.mark.parametrize("column", ["v1", "q2"])
def test_wrong_samples_of_another_clock_are_named_and_left_out(tmp_path, column, wrong):
    generator = np.random.default_rng(0)
    first, second = clock(generator, 0.008), clock(generator, 0.006)
    other = states(second).select("t", column)
    other[500, column] = other[500, column] + wrong
    rest = [name for name in ("q1", "q2", "v1", "v2") if name != column]
    path = merged(tmp_path, states(first).select("t", *rest).with_columns(u=pl.Series(np.sin(first))), other)
    line = 2 + int(np.searchsorted(np.sort(np.concatenate([first, second])), second[500]))
    (check,) = check_dataset(path).recordings
    (finding,) = [one for one in check.findings if one.kind in {"spike", "impossible"}]
    assert finding.channel == column
    assert f"line {line} (row {line - 2})" in finding.text
    _, one = brought(path)
    assert one.rates is not None
    values = one.rates[:, 0] if column == "v1" else one.q[:, 1]
    truth = velocity(one.ts - EPOCH)[:, 0] if column == "v1" else angle(one.ts - EPOCH)[:, 1]
    assert np.nanmax(np.abs(values - truth)) < 0.01


def test_faster_columns_are_averaged_over_a_step_not_thinned(tmp_path):
    generator = np.random.default_rng(0)
    t, fast = clock(generator, 0.01), clock(generator, 0.001)
    ripple = states(fast).select("t", pl.col("v1") + pl.Series(np.sin(2 * np.pi * 493 * fast)), "v2")
    path = merged(tmp_path, states(t).select("t", "q1", "q2").with_columns(u=1.0), ripple)
    _, one = brought(path)
    assert one.rates is not None
    off = one.rates[:, 0] - velocity(t)[:, 0]
    assert np.sqrt(np.nanmean(off**2)) < 0.15  # Of 0.7.


@pytest.mark.parametrize("count", [1, 3])
def test_few_commands_are_held(tmp_path, count):
    generator = np.random.default_rng(0)
    t = clock(generator, 0.008)
    path = merged(tmp_path, states(t), pl.DataFrame({"t": [0.5, 3.0, 7.0][:count], "u": [1.0, 2.0, -1.0][:count]}))
    _, one = brought(path)
    assert one.merged is not None
    assert set(one.us[(t > 7.1), 0]) == {[1.0, 2.0, -1.0][count - 1]}


def test_clocks_that_stamp_alike_for_a_while_are_two_all_the_same(tmp_path):
    t = np.round(np.arange(0, 12, 0.01), 3)
    drifting = np.round(np.arange(0, 12, 0.010002), 3)
    path = merged(
        tmp_path, states(t).select("t", "q1", "q2").with_columns(u=1.0), states(drifting).select("t", "v1", "v2")
    )
    _, one = brought(path)
    assert one.merged is not None
    assert one.rates is not None
    assert np.isfinite(one.rates).all(axis=1).mean() > 0.99
    assert np.nanmax(np.abs(one.rates - velocity(t))) < 0.02


@pytest.mark.parametrize("shift", [1e6, -1e6])
def test_clocks_that_have_no_time_in_common_are_refused(tmp_path, shift):
    generator = np.random.default_rng(0)
    t, tu = clock(generator, 0.008), clock(generator, 0.01)
    path = merged(tmp_path, states(t), pl.DataFrame({"t": tu + shift, "u": tu}))
    with pytest.raises(
        DataError, match=r"column `t` must be of one clock; `u` has numbers from .* Bring the time"
    ) as caught:
        read_dataset(path)
    (unreadable,) = check_dataset(path).unreadable
    assert unreadable.finding.text == str(caught.value)


def test_an_input_that_is_silent_for_long_is_named(tmp_path):
    generator = np.random.default_rng(0)
    t, tu = clock(generator, 0.008), clock(generator, 0.01)
    tu = tu[(tu < 5) | (tu > 7)]
    (check,) = check_dataset(merged(tmp_path, states(t), pl.DataFrame({"t": tu, "u": np.sin(tu)}))).recordings
    (finding,) = [one for one in check.findings if one.kind == "clocks" and one.level == "warning"]
    assert finding.text.startswith("`u` has no number for 2")

"""A recording in milliseconds among others in seconds is named; logs of different rates are not."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.data import DataWarning, check_dataset, read_dataset

TEXT = """
space = "T1"
time = "t [x]"
positions = ["q"]
inputs = ["u"]
[train]
files = ["run*.csv"]
"""


def written(folder, *clocks):
    """Recordings of 300 samples, a step and a factor of the time stamps each."""
    for k, (step, factor) in enumerate(clocks):
        t = step * (np.arange(300) + np.random.default_rng(k).uniform(-0.3, 0.3, 300))
        columns = np.stack([factor * t, np.sin(2 * t + k), np.sin(5 * t)], axis=1)
        np.savetxt(folder / f"run{k}.csv", columns, delimiter=",", header="t [x],q,u", comments="", fmt="%.15g")
    path = folder / "arm.toml"
    path.write_text(TEXT)
    return path


@pytest.mark.parametrize(
    ("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds"), (1.4e4, "another unit")]
)
def test_another_clock_is_named_with_its_unit(tmp_path, factor, unit):
    path = written(tmp_path, (0.005, 1), (0.005, 1), (0.00504, factor))
    check = check_dataset(path)
    assert [len(each.findings) for each in check.recordings] == [0, 0, 1]
    (finding,) = check.recordings[2].findings
    assert (finding.kind, finding.level, finding.channel) == ("unit", "warning", "t [x]")
    assert f"is `t [x]` in {unit}?" in finding.text
    with pytest.warns(DataWarning, match="perhaps wrong in `run2`: the usual step of"):
        read_dataset(path)


def test_one_in_seconds_among_milliseconds_is_named_with_the_key(tmp_path):
    path = written(tmp_path, (0.005, 1e3), (0.005, 1), (0.005, 1e3))
    (finding,) = check_dataset(path).recordings[1].findings
    assert "are the others in milliseconds?" in finding.text
    assert finding.advice.endswith('write `units = {"t [x]" = "ms"}` into the description.')
    path.write_text('units = {"t [x]" = "ms"}\n' + path.read_text())
    with pytest.warns(DataWarning, match="perhaps wrong in `run1`.* in most others: is `t .x.` in another unit"):
        read_dataset(path)


@pytest.mark.parametrize(("said", "factor", "unit"), [("ms", 1e6, "us"), ("us", 1e9, "ns")])
def test_a_clock_that_is_said_to_be_in_too_large_a_unit_is_named_with_the_right_one(tmp_path, said, factor, unit):
    path = written(tmp_path, (0.005, factor), (0.004, factor))
    path.write_text(f'units = {{"t [x]" = "{said}"}}\n' + path.read_text())
    findings = [one for each in check_dataset(path).recordings for one in each.findings if one.kind == "unit"]
    assert [f'"t [x]" = "{unit}"' in one.advice for one in findings] == [True, True]


def test_no_unit_is_offered_that_the_description_has_already(tmp_path):
    path = written(tmp_path, (1.0, 1e9))
    path.write_text('units = {"t [x]" = "ns"}\n' + path.read_text())
    assert "unit" not in {one.kind for each in check_dataset(path).recordings for one in each.findings}


def test_minutes_are_the_users_word(tmp_path):
    path = written(tmp_path, (0.1, 1))
    path.write_text('units = {"t [x]" = 60}\n' + path.read_text())
    assert "unit" not in {one.kind for each in check_dataset(path).recordings for one in each.findings}


def test_numbers_of_rows_are_no_time(tmp_path):
    path = written(tmp_path, (0.005, 1))
    log = np.loadtxt(tmp_path / "run0.csv", delimiter=",", skiprows=1)
    log[:, 0] = np.arange(len(log))
    np.savetxt(tmp_path / "run0.csv", log, delimiter=",", header="t [x],q,u", comments="")
    (finding,) = (one for one in check_dataset(path).recordings[0].findings if one.kind == "unit")
    assert finding.advice.startswith("If it counts rows, leave `time` out and write `dt`")


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_a_clock_that_is_far_too_slow_for_a_mechanism_is_named_with_its_unit(tmp_path, factor, unit):
    path = written(tmp_path, (0.005, factor), (0.004, factor))
    for each in check_dataset(path).recordings:
        (finding,) = each.findings
        assert (finding.kind, finding.level) == ("unit", "warning")
        assert f'`units = {{"t [x]" = "{unit}"}}`' in finding.advice
    path.write_text(f'units = {{"t [x]" = "{unit}"}}\n' + path.read_text())
    assert not any(each.findings for each in check_dataset(path).recordings)


@pytest.mark.parametrize(("step", "unit", "named"), [(0.005, "ms", True), (0.02, "us", True), (20.0, "us", False)])
def test_a_clock_of_seconds_that_is_said_to_have_another_unit_is_named(tmp_path, step, unit, named):
    path = written(tmp_path, (step, 1.0), (step, 1.0))  # 20 us are a drive's, of which seconds would make nothing.
    path.write_text(f'units = {{"t [x]" = "{unit}"}}\n' + path.read_text())
    for each in check_dataset(path).recordings:
        clocks = [one for one in each.findings if "short for a mechanism" in one.text]
        assert len(clocks) == named
        assert all(one.advice == "Remove `t [x]` from `units`." for one in clocks)


@settings(max_examples=20)
@given(steps=st.lists(st.floats(0.001, 0.05), min_size=1, max_size=4))
def test_logs_of_different_rates_have_nothing_wrong(tmp_path_factory, steps):
    path = written(tmp_path_factory.mktemp("rates"), *((step, 1) for step in steps))
    assert not any(each.kind == "unit" for one in check_dataset(path).recordings for each in one.findings)


@pytest.mark.parametrize(("dt", "right", "unit"), [(10, 0.01, "milli"), (2000, 0.002, "micro"), (5e6, 0.005, "nano")])
def test_rows_that_are_far_apart_are_named_with_what_dt_should_be(tmp_path, dt, right, unit):
    path = written(tmp_path, (right, 1), (right, 1))
    path.write_text(TEXT.replace('time = "t [x]"', f"dt = {dt}"))
    for each in check_dataset(path).recordings:
        (finding,) = each.findings
        assert (finding.kind, finding.level) == ("unit", "warning")
        assert f"is it in {unit}seconds?" in finding.text
        assert finding.advice.startswith(f"Write `dt = {right:g}`")
    path.write_text(TEXT.replace('time = "t [x]"', f"dt = {right}"))
    assert not any(each.findings for each in check_dataset(path).recordings)


@pytest.mark.parametrize(
    ("header", "factor"), [("t", 1), ("Time [ms]", 1e3), ("stamp_ns", 1e9), ("log/timestamp", 1e6)]
)
@pytest.mark.parametrize("dt", [0.005, 0.01, 0.02])
def test_a_dt_that_is_not_what_the_column_of_time_says_is_named(tmp_path, header, factor, dt):
    path = written(tmp_path, (0.005, factor))
    log = tmp_path / "run0.csv"
    log.write_text(log.read_text().replace("t [x]", header))
    path.write_text(TEXT.replace('time = "t [x]"', f"dt = {dt}"))
    (check,) = check_dataset(path).recordings
    said = [one for one in check.findings if one.channel == header]
    assert [(one.kind, one.level) for one in said] == [("time", "warning")] * (dt != 0.005)
    for one in said:
        assert f"but `dt` is {dt:g} s" in one.text
        assert f'Write `time = "{header}"` in place of `dt`' in one.advice
        with pytest.warns(DataWarning, match="which is not read, goes on by"):
            read_dataset(path)


ROWS = np.arange(300)
SILENT = {
    "rows": ("t", ROWS),
    "episodes": ("t", ROWS % 100),
    "rows with a gap": ("step/t", ROWS + 3 * (ROWS > 150)),
    "every tenth row": ("t", 10 * ROWS),
    "ticks": ("clock", 80_000 * ROWS),
    "recordings": ("t", 0.005 * (ROWS % 100)),
    "rounded": ("t", np.floor(0.5 * ROWS) / 100),
    "minutes": ("time [min]", 0.005 / 60 * ROWS),
    "a torque": ("T", 0.02 * ROWS),
    "a temperature": ("t", 20 + np.sin(ROWS)),
    "a motor that warms": ("t", np.round(20 + 9 * (1 - np.exp(-ROWS / 100)), 1)),
    "words": ("t", np.full(300, "on")),
    "a second clock": ("t", 0.0075 * ROWS),
}


@pytest.mark.parametrize("case", SILENT)
def test_what_may_be_another_count_or_agrees_with_dt_is_not_named(tmp_path, case):
    name, values = SILENT[case]
    path = written(tmp_path, (0.005, 1))
    path.write_text(TEXT.replace('time = "t [x]"', "dt = 0.005"))
    log = tmp_path / "run0.csv"
    _, *rows = log.read_text().splitlines()
    lines = [f"{value},{row}" for value, row in zip(values, rows, strict=True)]
    clock = "seconds" if case == "a second clock" else "x"
    log.write_text("\n".join([f"{name},{clock},q,u", *lines]))
    assert not any("not read" in one.text for one in check_dataset(path).recordings[0].findings)


def test_a_column_that_is_read_is_no_clock(tmp_path):
    path = written(tmp_path, (0.005, 1))
    path.write_text(TEXT.replace('time = "t [x]"', "dt = 0.02").replace('["u"]', '["t [x]"]'))
    assert not any("not read" in one.text for one in check_dataset(path).recordings[0].findings)

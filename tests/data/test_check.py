"""Each way in which a log can be wrong is named, and a good log has nothing wrong."""

import re

import numpy as np
import pytest
from hypothesis import assume, example, given, settings, strategies as st

from symoden.data import DataError, DataWarning, check_dataset, read_dataset

from .conftest import NAMES, arm, found, scale, written


def stick(log, column, start, stop):
    log[start:stop, NAMES.index(column)] = log[start, NAMES.index(column)]
    return log


@settings(max_examples=25)
@given(
    seed=st.integers(0, 1000),
    samples=st.integers(500, 1500),
    step=st.floats(0.002, 0.03),
    quantum=st.sampled_from([0.0, 1e-4, 0.02]),
    noise=st.sampled_from([0.0, 1e-3, 0.05]),
    amplitude=st.floats(0.3, 3.0),
)
@example(seed=0, samples=501, step=0.002, quantum=0.02, noise=0.0, amplitude=0.375)  # 23 changes in 500 samples
@example(seed=234, samples=954, step=0.0078125, quantum=0.02, noise=0.0, amplitude=0.375)  # q2 turns in 0.7 s
@example(seed=500, samples=500, step=0.002, quantum=0.0, noise=1e-3, amplitude=0.5)  # Noise beside slow velocities
def test_nothing_is_wrong_with_a_good_log(tmp_path_factory, seed, samples, step, quantum, noise, amplitude):
    log = arm(seed, samples=samples, step=step, quantum=quantum, noise=noise, amplitude=amplitude)
    assume(np.ptp(log[:, 1:3], axis=0).min() > 10 * quantum)
    path = written(tmp_path_factory.mktemp("good"), log)
    assert found(path) == []
    assert len(read_dataset(path).train) == 1  # without a warning, which would be an error here


def test_facts_of_a_good_log(tmp_path):
    log = arm(quantum=0.001)
    (check,) = check_dataset(written(tmp_path, log)).recordings
    assert (check.recordings, check.missing, check.gaps) == (1, 0, ())
    assert check.duration == pytest.approx(np.ptp(log[:, 0]))
    assert check.steps == pytest.approx([f(np.diff(log[:, 0])) for f in (np.min, np.median, np.max)])
    q1, _, v1, _, u1, _ = check.channels
    assert [(one.name, one.role) for one in (q1, v1, u1)] == [("q1", "position"), ("v1", "velocity"), ("u1", "input")]
    assert (q1.minimum, q1.maximum) == pytest.approx((log[:, 1].min(), log[:, 1].max()))
    assert (q1.quantum, v1.ratio) == (pytest.approx(0.001), pytest.approx(1.0, abs=0.01))
    assert q1.moving is not None
    assert q1.moving > 0.9


@settings(max_examples=10)
@given(seed=st.integers(0, 1000), column=st.sampled_from(NAMES[1:5]), start=st.integers(100, 1000))
def test_a_stuck_sensor_is_named_with_its_time(tmp_path_factory, seed, column, start):
    log = stick(arm(seed, quantum=1e-3, noise=1e-3), column, start, start + 600)
    path = written(tmp_path_factory.mktemp("stuck"), log)
    left_out = column.startswith("q")
    masked = [("stuck", "masked", column), ("gap", "masked", "")]
    assert found(path) == (masked if left_out else [("stuck", "warning", column)])
    (finding,) = [one for one in check_dataset(path).recordings[0].findings if one.kind == "stuck"]
    assert finding.spans[0] == pytest.approx((log[start, 0], log[start + 599, 0]), abs=0.05)
    said = "left out in `run0`: 600 rows in which" if left_out else "perhaps wrong in `run0`:"
    with pytest.warns(DataWarning, match=f"{said} `{column}` does not change at all from"):
        assert len(read_dataset(path).train) == 1 + left_out


def test_a_sensor_without_velocities_is_stuck_if_the_others_move(tmp_path):
    path = written(tmp_path, stick(arm(), "q2", 300, 700))
    path.write_text(path.read_text().replace('velocities = ["v1", "v2"]\n', ""))
    assert found(path) == [("stuck", "warning", "q2")]


def test_a_machine_at_rest_is_not_stuck(tmp_path):
    log = arm()
    rest = np.repeat(log[:1], 500, axis=0)
    rest[:, 0] = log[0, 0] + 0.005 * np.arange(-500, 0)
    rest[:, 3:] = 0
    assert found(written(tmp_path, np.concatenate([rest, log]))) == []


UNITS = [
    ({"q1": 180 / np.pi}, "q1", r'`units = \{q1 = "deg"\}` into the description.$'),
    ({"v2": 180 / np.pi}, "q2", r'units = \{v2 = "deg/s"\}'),
    ({"v1": 30 / np.pi}, "q1", r'units = \{v1 = "rpm"\}'),
    ({"q2": -180 / np.pi}, "q2", r'units = \{q2 = "deg"\}'),
    ({"v1": 10.0}, "v1", r"write `units = \{v1 = (0\.1|0\.09\d*|0\.10\d*)\}` into"),  # Nearly 2π/60.
    ({"v1": 0.1}, "v1", r"write `units = \{v1 = (10|9\.9\d*|10\.0\d)\}` into"),
]


@pytest.mark.parametrize(("factors", "channel", "advice"), UNITS, ids=[advice for *_, advice in UNITS])
def test_a_wrong_unit_is_named_with_the_right_one(tmp_path, factors, channel, advice):
    path = written(tmp_path, scale(arm(), **factors), scale(arm(1), **factors))
    assert found(path) == [("unit", "warning", channel)] * 2
    said = check_dataset(path).recordings[0].findings[0].advice
    assert re.search(advice, said)
    with pytest.warns(DataWarning, match="the derivative of"):
        read_dataset(path)


def test_the_advised_unit_repairs_the_log(tmp_path):
    log = scale(arm(), q1=180 / np.pi)
    log[:, 1] = np.mod(log[:, 1], 360)
    assert found(written(tmp_path, log)) == [("unit", "warning", "q1")]
    assert found(written(tmp_path, log, more='units = {q1 = "deg"}')) == []


def test_the_advised_unit_joins_those_that_are_given(tmp_path):
    log = scale(arm(), q1=180 / np.pi, v2=2.0)
    path = written(tmp_path, log, more="units = {v2 = -1.0}")
    first, second = (one.advice for one in check_dataset(path).recordings[0].findings if one.level == "warning")
    assert first == 'Write `q1 = "deg"` into `units`.'
    assert re.match(r"If `q2` is right, write `v2 = (0\.5|0\.50\d*|0\.49\d*)` into .*of `v2` now\); otherwise", second)


@pytest.mark.parametrize(
    ("more", "advice"),
    [
        (
            'units = {q1 = "deg"}',
            r"If `v1` is right, write `q1 = 1` into `units` \(for what it says of `q1` now\); "
            r'otherwise write `v1 = "deg/s"` into `units`\.$',
        ),
        (
            "units = {q1 = 3.0}",
            r"If `v1` is right, write `q1 = (1|1\.0\d*|0\.99\d*)` into `units` \(.*`q1` now\); otherwise, if `q1` is, "
            r"write `v1 = (3|2\.9|3\.0)",
        ),
    ],
)
def test_a_unit_of_the_position_that_is_given_may_be_the_wrong_one(tmp_path, more, advice):
    (finding,) = (one for one in check_dataset(written(tmp_path, arm(), more=more)).recordings[0].findings)
    assert re.search(advice, finding.advice)


def test_one_file_in_degrees_is_told_to_be_converted(tmp_path):
    check = check_dataset(written(tmp_path, arm(), scale(arm(1), q1=180 / np.pi)))
    (finding,) = [one for one in check.recordings[1].findings if one.level == "warning"]
    assert finding.advice.startswith("Other files are right: convert `")


def test_degrees_in_both_are_suspected_from_the_range(tmp_path):
    degrees = 180 / np.pi
    path = written(tmp_path, scale(arm(), q1=degrees, v1=degrees))
    assert found(path) == [("unit", "warning", "q1")]


def test_a_wheel_that_keeps_turning_is_not_in_degrees(tmp_path):
    log = arm()
    log[:, 1] += 30 * log[:, 0]
    log[:, 3] += 30
    assert found(written(tmp_path, log)) == []


def test_a_turned_sign_and_exchanged_columns_are_named(tmp_path):
    assert found(written(tmp_path, scale(arm(), v2=-1))) == [("sign", "warning", "v2")]
    log = arm()
    path = written(tmp_path, log[:, [0, 1, 2, 4, 3, 5, 6]])
    assert found(path) == [("velocity", "warning", "v1"), ("velocity", "warning", "v2")]
    assert "Put `velocities` into the order" in check_dataset(path).recordings[0].findings[0].advice


@settings(max_examples=10)
@given(seed=st.integers(0, 1000))
def test_wraps_are_facts_and_other_jumps_are_wrong(tmp_path_factory, seed):
    folder, log = tmp_path_factory.mktemp("wraps"), arm(seed, amplitude=3.0)
    log[:, 1] = np.mod(log[:, 1], 2 * np.pi)
    path = written(folder, log)
    assert found(path) == []
    assert any(one.kind == "wrap" for one in check_dataset(path).recordings[0].findings)
    log[1000:, 2] += 4.5
    path = written(folder, log)
    assert found(path) == [("jump", "warning", "q2")]
    (jump,) = (one for one in check_dataset(path).recordings[0].findings if one.kind == "jump")
    assert "but not a whole one, once, first at" in jump.text


@pytest.mark.parametrize("samples", [100, 200])
def test_a_turned_velocity_of_a_recording_shorter_than_a_second_is_named(tmp_path, samples):
    assert found(written(tmp_path, scale(arm(samples=samples, jitter=0.0), v2=-1)))[-1] == ("sign", "warning", "v2")


def test_of_times_out_of_order_it_is_not_said_what_rests(tmp_path):
    """Rows of two recordings, one after the other with times that begin anew, are no motion in the order of these."""
    log = scale(arm(samples=400), q1=0, v1=0, u1=0)
    twice = np.concatenate([log, arm(1, samples=400)])
    both = written(tmp_path, twice)
    every = [one for each in check_dataset(both).recordings for one in each.findings]
    assert "idle" not in {one.kind for one in (*check_dataset(both).findings, *every)}
    assert found(written(tmp_path, log)) == [("idle", "warning", "q1"), ("idle", "warning", "u1")]
    still = arm(samples=400)
    still[:, 1:5] = still[0, 1:5]
    still[200, 0] = still[199, 0]
    (check,) = check_dataset(written(tmp_path, still)).recordings
    assert "idle" in {one.kind for one in check.findings}  # In any order.


def test_times_out_of_order_are_refused_and_still_examined(tmp_path):
    log = scale(arm(), v2=-1)
    log[[500, 501], 0] = log[[501, 500], 0]
    log[900, 0] = log[899, 0]
    path = written(tmp_path, log)
    assert found(path) == [("time", "refused", "t"), ("sign", "warning", "v2")]
    check = check_dataset(path)
    assert check.refused
    assert (
        "2 time stamps do not increase (1 goes back, 1 stands still), first at line 503 (row 501)"
        in check.recordings[0].findings[0].text
    )
    with pytest.raises(DataError, match=r"line 503 \(row 501\): times must increase; .* \(2 such rows\)"):
        read_dataset(path)


@pytest.mark.parametrize("change", ["twice", "back"])
def test_stamps_that_stand_still_ask_for_the_step_and_those_that_go_back_do_not(tmp_path, change):
    log = arm(samples=1500)
    log[:, 0] = 0.001 * np.arange(1500)
    log[700:, 0] -= 0.001 if change == "twice" else 0.2
    path = written(tmp_path, log)
    (finding,) = (one for one in check_dataset(path).recordings[0].findings if one.kind == "time")
    assert ("as `dt` beside `time`" in finding.advice) == (change == "twice")
    with pytest.raises(DataError, match="times must increase"):
        read_dataset(path)


@pytest.mark.parametrize("first", [0, 100])
def test_the_advised_rows_cut_a_clock_that_was_set_back(tmp_path, first):
    log = arm(samples=900)
    log[400:, 0] -= 3.0
    log[700:, 0] -= 2.0
    path = written(tmp_path, log)
    described = path.read_text()
    cut = f"rows = [[{first}, 400], [400, 700], [700, 900]]"
    path.write_text(described.replace('files = ["', f'rows = [{first}]\nfiles = ["'))
    (finding,) = (one for one in check_dataset(path).recordings[0].findings if one.kind == "time")
    assert f"`{cut}`" in finding.advice
    path.write_text(described.replace('files = ["', f'{cut}\nfiles = ["'))
    assert [len(recording) for recording in read_dataset(path).train] == [400 - first, 300, 200]


def test_missing_numbers_and_gaps_are_masked(tmp_path):
    log = arm()
    log[500:600, 4] = np.nan
    log[700, 1] = np.nan
    path = written(tmp_path, np.delete(log, np.s_[1000:1100], axis=0))
    assert sorted(found(path)) == [("gap", "masked", ""), ("missing", "masked", "q1"), ("missing", "masked", "v2")]
    (check,) = check_dataset(path).recordings
    assert (check.missing, len(check.gaps), check.recordings) == (101, 2, 3)
    assert check.gaps[0] == pytest.approx((log[499, 0], log[600, 0]))


@pytest.mark.parametrize("turns", [1, 3])
def test_a_spike_of_a_length_is_no_wrap_of_an_angle(tmp_path, turns):
    log = arm(samples=500)
    log[300, 1] += 2 * np.pi * turns
    path = written(tmp_path, log)
    path.write_text(path.read_text().replace('"T2"', '"R2"'))
    assert found(path) == [("spike", "masked", "q1")]


def test_a_large_pulse_of_an_input_is_named_and_kept(tmp_path):
    log = arm(samples=500)
    log[300, 5] = 1e6
    path = written(tmp_path, log)
    assert found(path) == [("spike", "warning", "u1")]
    with pytest.warns(DataWarning, match="far beyond all others"):
        assert read_dataset(path).train[0].us.max() == 1e6


def test_a_file_that_ends_in_the_middle_of_a_line_has_one_finding(tmp_path):
    log = arm(samples=500)
    log[300, 4] = np.nan
    path = written(tmp_path, log)
    text = (tmp_path / "run0.csv").read_text()
    (tmp_path / "run0.csv").write_text(text[: text.rindex("\n", 0, -1) + 5])
    assert found(path) == [("missing", "masked", ""), ("missing", "masked", "v2")]
    unfinished, other = check_dataset(path).recordings[0].findings[:2]
    assert unfinished.text == "the file ends in the middle of a line, line 501 (row 499)"
    assert "`v2` lacks 1 of 500 numbers, in 1 stretch, first at line 302 (row 300)" in other.text


@pytest.mark.parametrize(("lines", "more"), [((200,), ""), ((200, 300, 400), ", and 2 more have too few")])
def test_lines_that_end_too_early_have_one_finding(tmp_path, lines, more):
    path = written(tmp_path, arm(samples=500))
    text = (tmp_path / "run0.csv").read_text().splitlines()
    for line in lines:
        text[line] = ",".join(text[line].split(",")[:2])
    (tmp_path / "run0.csv").write_text("\n".join(text) + "\n")
    assert found(path) == [("line", "masked", "")]
    (check,) = check_dataset(path).recordings
    assert check.findings[0].text == f"line 201 (row 199) has 2 of 7 fields{more}"
    assert check.missing == len(lines)


def test_a_cut_off_input_and_a_rounded_difference_are_facts(tmp_path):
    log = arm(quantum=1e-3, jitter=0.0)
    log[:, 5] = np.clip(log[:, 5], -0.6, 0.6)
    log[1:, 3:5] = np.diff(log[:, 1:3], axis=0) / 0.005
    check = check_dataset(written(tmp_path, log))
    notes = [(one.kind, one.channel) for one in check.recordings[0].findings]
    assert notes == [("saturation", "u1"), ("rounding", "v1"), ("rounding", "v2")]


@pytest.mark.parametrize(("least", "said"), [(-0.6, "(-0.6 or 0.6)"), (-9.0, "(0.6)")])
def test_an_extreme_value_that_hardly_occurs_is_no_limit(tmp_path, least, said):
    log = arm()
    log[:, 5] = np.clip(log[:, 5], least, 0.6)
    log[0, 5] = min(least, log[0, 5])
    # Alone and far beyond all others, it may be said to be wrong as well.
    findings = check_dataset(written(tmp_path, log)).recordings[0].findings
    (limit,) = (finding for finding in findings if finding.kind == "saturation")
    assert limit.text.startswith(f"`u1` is at its extreme value {said} for ")


def test_what_never_moves_cannot_be_learned(tmp_path):
    log = scale(arm(), q2=0, v2=0, u1=0)
    assert found(written(tmp_path, log)) == [("idle", "warning", "q2"), ("idle", "warning", "u1")]
    assert found(written(tmp_path, log, arm(1))) == []


def test_an_input_that_was_switched_on_before_anything_moved_tells_nothing(tmp_path):
    log = arm()
    log[:, 5] = np.where(np.arange(len(log)) < 2, 0.0, 0.5)
    assert found(written(tmp_path, log)) == [("idle", "warning", "u1")]
    (said,) = [finding for finding in check_dataset(tmp_path / "arm.toml").findings if finding.kind == "idle"]
    assert "hardly ever changes" in said.text
    log[300, 5] = 0.0  # A blow tells.
    assert found(written(tmp_path, log)) == []


@pytest.mark.parametrize("rate", [0.0, 0.5])
def test_a_log_of_constants_is_refused_and_why_is_said_once(tmp_path, rate):
    log = np.repeat(arm(samples=500, jitter=0.0)[:1], 500, axis=0)
    log[:, 0], log[:, 3:5] = 0.01 * np.arange(500), rate
    path = written(tmp_path, log)
    assert found(path) == [("refused", "refused", ""), ("idle", "warning", "")]
    assert len(check_dataset(path).recordings[0].findings) == 1
    with pytest.warns(DataWarning, match="perhaps wrong in `run0`: nothing moves"):
        read_dataset(path)


def test_parts_of_one_file_are_told_apart_in_warnings(tmp_path):
    path = written(tmp_path, scale(arm(), v1=-1))
    path.write_text(path.read_text() + 'rows = [0, 1000]\n[test]\nfiles = ["run0.csv"]\nrows = [1000]\n')
    with pytest.warns(DataWarning, match=r"wrong in `run0` \(train\): .* `q1` is -.*; `run0` \(test\): .* `q1` is -"):
        read_dataset(path)


def test_what_does_not_fit_together_is_a_finding(tmp_path):
    path = written(tmp_path, arm(), more="input_matrix = [[1, 0]]")
    assert found(path) == [("refused", "refused", "")]


@pytest.mark.parametrize(
    ("name", "kinds"),
    [("dfki-c1", set()), ("dfki-c0", {"spike"}), ("multiarm-double", set()), ("multiarm-single", set())],
)
def test_nothing_is_wrong_with_the_measured_examples_but_glitches(shared_data, monkeypatch, request, name, kinds):
    monkeypatch.setenv("SYMODEN_DATA", str(shared_data))
    every = found(request.config.rootpath / "examples" / f"{name}.toml")
    assert {kind for kind, _, _ in every} == kinds
    assert {level for _, level, _ in every} <= {"masked"}


@pytest.mark.parametrize(("size", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_a_clock_in_another_unit_is_blamed_and_not_the_velocities(tmp_path, size, unit):
    check = check_dataset(written(tmp_path, arm() * [size, 1, 1, 1, 1, 1, 1]))
    (finding,) = (one for one in check.recordings[0].findings if one.kind == "unit")
    assert (finding.level, finding.channel) == ("warning", "")
    assert f"time stamps in {unit}, not in s?" in finding.text
    assert f'units = {{t = "{unit}"}}' in finding.advice


@pytest.mark.parametrize(("factor", "known"), [(0.16, True), (0.03, False), (2.5, False)])
def test_where_all_coordinates_disagree_by_the_same_factor_the_step_of_time_is_asked_for_first(tmp_path, factor, known):
    path = written(tmp_path, arm(jitter=0.0), arm(1, jitter=0.0))
    path.write_text(path.read_text().replace('time = "t"', f"dt = {0.005 / factor}"))
    for file in tmp_path.glob("*.csv"):
        file.write_text(file.read_text().replace("t,", "row,", 1))  # Else it is said of the clock already.
    assert found(path) == [("unit", "warning", "")] * 2
    for check in check_dataset(path).recordings:
        (finding,) = (one for one in check.findings if one.kind == "unit")
        assert "as far as their velocities say: is `dt` right?" in finding.text
        (step,) = re.findall(r"write `dt = ([\d.]+)`", finding.advice)
        assert float(step) == pytest.approx(0.005, rel=0.05)
        assert ("as for positions in turns, velocities in rad/s" in finding.advice) == known


def test_where_all_coordinates_disagree_as_by_degrees_no_clock_is_blamed(tmp_path):
    every = found(written(tmp_path, scale(arm(), q1=180 / np.pi, q2=180 / np.pi)))
    assert every == [("unit", "warning", "q1"), ("unit", "warning", "q2")]


def test_time_stamps_that_are_off_by_a_factor_are_asked_for_first(tmp_path):
    path = written(tmp_path, scale(arm(), t=3.0))
    assert found(path) == [("unit", "warning", "")]
    (finding,) = (one for one in check_dataset(path).recordings[0].findings if one.level == "warning")
    assert re.match(r"If not, write `units = \{t = 0\.33\d*\}` into the description, or", finding.advice)

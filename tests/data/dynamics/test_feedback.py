"""Inputs that follow the state are named, and those that the state follows; others are not."""

import re

import numpy as np
import pytest

from symoden.data import DataWarning, check_dataset, read_dataset
from tests.data.conftest import arm, written


def driven(share, *, samples=2000):
    """A log whose first input is feedback but for a share of its variance that is its own."""
    log = arm(samples=samples)
    feedback = -3 * np.sin(log[:, 1]) - 0.5 * log[:, 3] + 0.2 * log[:, 2]
    own = np.random.default_rng(1).normal(size=samples)
    log[:, 5] = np.sqrt(1 - share) * feedback / feedback.std() + np.sqrt(share) * own / own.std()
    return log


@pytest.mark.parametrize(("share", "named"), [(0.0, True), (0.05, True), (0.3, False), (1.0, False)])
def test_an_input_that_follows_the_state_is_named(tmp_path, share, named):
    path = written(tmp_path, driven(share))
    every = [one for one in check_dataset(path).findings if one.kind == "feedback"]
    assert len(every) == named
    if named:
        (one,) = every
        assert (one.channel, one.level) == ("u1", "warning")
        told = float(one.text.partition("tell `u1` to ")[2].partition("%")[0]) / 100
        assert 0.9 - share <= told <= 1.0


def test_a_constant_input_follows_nothing(tmp_path):
    log = arm()
    log[:, 5:] = 2.0
    assert "feedback" not in {one.kind for one in check_dataset(written(tmp_path, log)).findings}


@pytest.mark.parametrize(
    ("more", "advice"),
    [
        ("", "finds g larger than its band. .*: `input_matrix`, V under"),
        ("input_matrix = [[1, 0], [0, 1]]", "finds V and D larger than their bands. .*: V or D under"),
        (
            'input_matrix = [[1, 0], [0, 1]]\n[known]\npotential_energy = "cos(q1) + cos(q2)"',
            "finds D larger than its band. .*: D under",
        ),
        (
            '[known]\ndissipation_matrix = [["0.1", 0], [0, "0.1"]]',
            "finds g larger than its band. .*: `input_matrix`, V under",
        ),
    ],
)
def test_what_to_do_about_it_depends_on_what_is_known(tmp_path, more, advice):
    path = written(tmp_path, driven(0.0), more=more)
    (one,) = [one for one in check_dataset(path).findings if one.kind == "feedback"]
    assert re.search(advice, one.advice)


@pytest.mark.parametrize(
    ("known", "named"),
    [
        ('potential_energy = "cos(q1)"\ndissipation_matrix = [["0.1", 0], [0, "0.1"]]', False),
        ('potential_energy = "k*cos(q1)"\ndissipation_matrix = [["0.1", 0], [0, "0.1"]]\nparameters = {k = 1}', True),
        ('potential_energy = "k*cos(q1)"\ndissipation_matrix = [["0.1", 0], [0, "0.1"]]\nconstants = {k = 1}', False),
        (
            'potential_energy = "cos(q1)"\ndissipation_matrix = [["0.1", 0], [0, "0.1"]]\n'
            'correct = ["dissipation_matrix"]',
            True,
        ),
    ],
)
def test_nothing_is_confused_with_an_input_where_potential_and_friction_are_known(tmp_path, known, named):
    findings = check_dataset(written(tmp_path, driven(0.0), more=f"[known]\n{known}")).findings
    assert ("feedback" in {one.kind for one in findings}) == named


def test_a_single_late_file_does_not_hide_that_inputs_are_fed_back(tmp_path):
    for k, name in enumerate("abc"):
        rows = fed_back(k)
        if name == "b":
            rows[:-10, 5:] = rows[10:, 5:]
        np.savetxt(tmp_path / f"{name}.csv", rows[:-10], delimiter=",", header="t,x,q,vx,vq,u,w", comments="")
    path = tmp_path / "cart.toml"
    path.write_text(
        'space = "R1 T1"\ntime = "t"\npositions = ["x", "q"]\nvelocities = ["vx", "vq"]\ninputs = ["u", "w"]\n'
        '[train]\nfiles = ["*.csv"]\n'
    )
    findings = {one.kind: one for one in check_dataset(path).findings}
    assert findings.keys() == {"delay", "feedback"}
    assert findings["delay"].text.startswith("`b` (train)")


def fed_back(seed, *, samples=800, step=0.01):
    """Two coupled joints under steps, the second held by a controller."""
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.uniform(-6, 6, (samples // 40, 2)), 40, axis=0)
    q, v, rows = np.zeros(2), np.zeros(2), []
    for k in range(samples):
        u = np.array([steps[k, 0], -6 * q[1] - v[1] + 0.2 * steps[k, 1]])
        rows.append([k * step, *q, *v, *u])
        for _ in range(10):
            force = u * [2, 1] - [0, 3 * np.sin(q[1])] - 0.5 * v - 2 * q * [1, 0]
            v = v + step / 10 * np.linalg.solve([[1.0, 0.3], [0.3, 0.5]], force)
            q = q + step / 10 * v
    return np.array(rows) + rng.normal(0, 1e-3, (samples, 7)) * [0, 1, 1, 1, 1, 0, 0]


def servo(path, space, more="", *, units="", gain=1.0, lag=0.05, logged=1.0, zero=7.0):
    """A pendulum beside a joint that goes where its target was a moment ago, rounded as encoders do."""
    ts = 0.02 * np.arange(600)

    def target(t):
        return 0.7 * np.sin(2.1 * t) + 0.3 * np.sin(4.7 * t) + 0.4

    log = arm(samples=600)
    positions = np.column_stack([log[:, 1], logged * np.round(target(ts - lag), 3)])
    inputs = np.column_stack([np.random.default_rng(1).normal(size=600), gain * (target(ts) + zero)])
    rows = np.column_stack([ts, positions, inputs])
    np.savetxt(path / "run.csv", rows, delimiter=",", header="t,swing,wrist,u,goal", comments="")
    file = path / "servo.toml"
    file.write_text(
        f'space = "{space}"\ntime = "t"\npositions = ["swing", "wrist"]\ninputs = ["u", "goal"]\n'
        f'{units}[train]\nfiles = ["run.csv"]\n{more}'
    )
    return {one.kind: one for one in check_dataset(file).findings if one.kind in {"feedback", "target"}}


def test_the_target_of_a_servo_is_named_and_the_space_that_has_its_spring(tmp_path):
    found = servo(tmp_path, "T2")
    assert found.keys() == {"target"}
    assert (found["target"].channel, found["target"].level) == ("goal", "warning")
    assert "`wrist` goes where `goal` says" in found["target"].text
    assert '`space = "T1 R1"`, `units = {wrist = "rad"}`' in found["target"].advice
    with pytest.warns(DataWarning, match="`wrist` goes where `goal` says"):
        read_dataset(tmp_path / "servo.toml")
    assert servo(tmp_path, "T1 R1") == {}


def test_where_v_is_given_the_motor_s_torque_is_asked_for_or_the_spring(tmp_path):
    advice = servo(tmp_path, "T2", '[known]\npotential_energy = "cos(q1)"\n')["target"].advice
    assert "current or torque" in advice
    assert advice.endswith("add the spring to V under [known].")


@pytest.mark.parametrize(("gain", "units"), [(57.3, {}), (57.3, {"wrist": "deg"}), (650.0, {"wrist": 1 / 650})])
def test_targets_may_be_in_degrees_or_in_what_the_position_was_logged_in(tmp_path, gain, units):
    """Counted from another zero, and the position converted or not."""
    said = "".join(f"{name} = {unit if isinstance(unit, float) else repr(unit)}" for name, unit in units.items())
    found = servo(
        tmp_path, "T2", units=f"units = {{{said}}}\n" if said else "", gain=gain, logged=gain if said else 1.0
    )
    assert found.keys() == {"target"}
    assert ("units" in found["target"].advice) == (not said)
    assert '`space = "T1 R1"`' in found["target"].advice


def test_a_slow_servo_is_named_too(tmp_path):
    assert servo(tmp_path, "T2", lag=0.2).keys() == {"target"}


def test_a_target_may_be_in_radians_beside_positions_that_were_logged_in_another_unit(tmp_path):
    assert "target" in servo(tmp_path, "T2", units='units = {wrist = "deg"}\n', logged=180 / np.pi)


@pytest.mark.parametrize(("gain", "lag"), [(3.0, 0.05), (-1.0, 0.05), (1.0, 1.0), (1.0, -0.2)])
def test_an_input_in_another_unit_or_far_from_the_position_is_no_target(tmp_path, gain, lag):
    assert "target" not in servo(tmp_path, "T2", gain=gain, lag=lag)


@pytest.mark.parametrize("scale", [0.0, 1e200])
def test_inputs_that_never_change_or_are_huge_are_no_targets(tmp_path, scale):
    assert "target" not in servo(tmp_path, "T2", gain=scale)

"""Columns that are formulas of others."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, read_dataset

T = 0.05 * np.arange(60)
Q = np.sin(2 * T)
PWM = 20 + 15 * np.cos(3 * T)


def described(path, formulas, *, inputs='["thrust"]', more="", names="pwm"):
    """A joint with a propeller, logged with its duty; where this has several names, each is a column, all alike."""
    columns = np.stack([T, Q, 2 * np.cos(2 * T), *[PWM] * len(names.split(","))], axis=1)
    np.savetxt(path / "a.csv", columns, delimiter=",", header=f"t,q,v,{names}", comments="", fmt="%.17g")
    file = path / "d.toml"
    file.write_text(
        f'space = "T1"\ntime = "t"\npositions = ["q"]\nvelocities = ["v"]\ninputs = {inputs}\n{more}\n'
        f'formulas = {{ {formulas} }}\n[train]\nfiles = ["a.csv"]\n'
    )
    return file


@given(zero=st.floats(0, 50), gain=st.floats(-3, 3).filter(lambda gain: abs(gain) > 0.01))
def test_a_formula_is_of_the_numbers_in_the_file_and_has_its_own_unit(tmp_path_factory, zero, gain):
    path = tmp_path_factory.mktemp("formula")
    more = f"units = {{ thrust = {gain!r} }}\nzeros = {{ thrust = 2.0 }}"
    run = read_dataset(described(path, f'thrust = "(pwm - {zero} + abs(pwm - {zero}))/2"', more=more)).train[0]
    np.testing.assert_allclose(run.us[:, 0], gain * (np.maximum(PWM - zero, 0.0) - 2.0), atol=1e-9)


def test_a_column_may_be_read_and_be_part_of_a_formula(tmp_path):
    data = read_dataset(described(tmp_path, 'square = "pwm**2", turned = "-pwm"', inputs='["square", "pwm", "turned"]'))
    np.testing.assert_allclose(data.train[0].us, np.stack([PWM**2, PWM, -PWM], axis=1))
    assert data.input_names == ("square", "pwm", "turned")


ODD = "Present Current [mA],/joint_states/effort.0,u-cmd,2,θ (°),q[0],sin"


@pytest.mark.parametrize("name", ODD.split(","))
def test_a_column_of_any_name_is_part_of_a_formula_in_backticks(tmp_path, name):
    run = read_dataset(described(tmp_path, f'thrust = "`{name}` * 0.001 - q"', names=ODD)).train[0]
    np.testing.assert_allclose(run.us[:, 0], 0.001 * PWM - Q, atol=1e-12)


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("u-cmd*2", r"no column `cmd`; .* names it: 'u-cmd\*2'\. Write `u-cmd` in backticks there, if it is meant\.$"),
        ("stick-left + 1", "no column `left`; .* Write `stick - left` in backticks there"),
        ("2*group / effort", "no column `effort`; .* Write `group/effort` in backticks there"),
        ("`u-cmd` - cmd", r"no column `cmd`; .* names it: '`u-cmd` - cmd'\.$"),
        ("cm + cmd2", r"no column `cm`; .* names it: 'cm \+ cmd2'\.$"),
        ("`Current`", r"no column `Current`; .*Did you mean `Current \[mA\]`\?"),
    ],
)
def test_a_name_of_the_file_that_lacks_its_backticks_is_told(tmp_path, formula, message):
    description = described(
        tmp_path, f'thrust = "{formula}"', names="u-cmd,group/effort,Current [mA],cmd2,stick - left"
    )
    with pytest.raises(DataError, match=message):
        read_dataset(description)


def test_another_column_that_a_file_lacks_is_no_formula_s(tmp_path):
    description = described(tmp_path, 'thrust = "pwm"', inputs='["thrust", "duty"]')
    with pytest.raises(DataError, match=r"no column `duty`; .* as the file has them\.$"):
        read_dataset(description)


@pytest.mark.parametrize("name", ["group/u[0]", "`group/u`[1]*2", "`group/u[1]`*2", "`data.u`[0]", "`data.u[0]`"])
def test_variables_of_any_path_are_part_of_formulas_in_backticks(tmp_path, name):
    us = np.stack([PWM, PWM / 2], axis=1)
    variable = "data.u" if "data" in name else "group/u"
    np.savez(tmp_path / "a.npz", allow_pickle=False, t=T, q=Q, **{variable: us})
    file = tmp_path / "d.toml"
    formula = name if "`" in name else f"`{name}`"
    file.write_text(
        f'space = "T1"\ntime = "t"\npositions = "q"\ninputs = "u"\nformulas = {{ u = "{formula}" }}\n'
        '[train]\nfiles = ["a.npz"]\n'
    )
    np.testing.assert_allclose(read_dataset(file).train[0].us[:, 0], PWM, atol=1e-12)


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("u*2", r"`u` in a list or a formula must be one column; got 2\. Write `u\[0\]`"),
        ("w[0]*2", r"no variable `w`; found `q, t, u`\. .* `formulas` of `f` names it: 'w\[0\]\*2'\.$"),
    ],
)
def test_what_is_no_column_of_a_variable_is_no_part_of_a_formula(tmp_path, formula, message):
    np.savez(tmp_path / "a.npz", t=T, q=Q, u=np.stack([PWM, PWM], axis=1))
    file = tmp_path / "d.toml"
    file.write_text(
        f'space = "T1"\ntime = "t"\npositions = "q"\ninputs = "f"\nformulas = {{ f = "{formula}" }}\n'
        '[train]\nfiles = ["a.npz"]\n'
    )
    with pytest.raises(DataError, match=message):
        read_dataset(file)


def test_columns_of_variables_are_named_with_brackets(tmp_path):
    np.savez(tmp_path / "a.npz", t=T, q=np.stack([Q, Q + 0.1 * T], axis=1))
    file = tmp_path / "d.toml"
    file.write_text(
        'space = "T2"\ntime = "t"\npositions = ["q[0]", "elbow"]\nformulas = { elbow = "q[1] - q[0]" }\n'
        '[train]\nfiles = ["a.npz"]\n'
    )
    np.testing.assert_allclose(read_dataset(file).train[0].q, np.stack([Q, 0.1 * T], axis=1), atol=1e-12)


def test_one_name_may_be_a_formula(tmp_path):
    run = read_dataset(described(tmp_path, 'thrust = "pwm**2"', inputs='"thrust"')).train[0]
    np.testing.assert_allclose(run.us[:, 0], PWM**2)


def test_rows_in_which_a_formula_has_no_value_lack_a_number(tmp_path):
    with pytest.warns(UserWarning, match="left out"):
        data = read_dataset(described(tmp_path, 'thrust = "sqrt(pwm - 6)"'))
    thrusts = np.concatenate([run.us[:, 0] for run in data.train])
    assert np.isfinite(thrusts).all()
    assert 0 < len(thrusts) <= np.sum(PWM >= 6) < len(T)


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("sign(v)*pwm**2", np.sign(2 * np.cos(2 * T)) * PWM**2),
        ("sign(q)", np.sign(Q)),
        ("min(pwm, 20)", np.minimum(PWM, 20)),
        ("max(20, pwm) - min(pwm, q)", np.maximum(PWM, 20) - np.minimum(PWM, Q)),
        ("clip(pwm, 10, 20)", np.clip(PWM, 10, 20)),
        ("clip(pwm, -q, 20 + q)", np.clip(PWM, -Q, 20 + Q)),
        ("pwm - clip(pwm, 15, 25)", np.where(PWM < 15, PWM - 15, np.where(PWM > 25, PWM - 25, 0))),
    ],
)
def test_formulas_of_columns_have_functions_that_cannot_be_differentiated(tmp_path, formula, expected):
    np.testing.assert_allclose(
        read_dataset(described(tmp_path, f'thrust = "{formula}"')).train[0].us[:, 0], expected, atol=1e-12
    )


def test_where_limits_cross_each_other_a_clipped_number_is_missing(tmp_path):
    with pytest.warns(UserWarning, match="left out"):
        data = read_dataset(described(tmp_path, 'thrust = "clip(pwm, 20, pwm)"'))
    thrusts = np.concatenate([run.us[:, 0] for run in data.train])
    assert thrusts.min() >= 20
    assert 0 < len(thrusts) <= np.sum(PWM >= 20) < len(T)


@pytest.mark.parametrize(
    ("formulas", "message"),
    [
        (
            'thrust = "max(pwm)"',
            r"`formulas` of `thrust` must be a formula of columns; .* with 1 argument .* takes 2, as in `max\(a, b\)`",
        ),
        ('thrust = "sgn(pwm)"', r"sign\(x\), min\(a, b\), max\(a, b\) and clip\(x, .*Did you mean `sign\(x\)`\?$"),
        ('thrust = "2*clip(pwm, 5, -5)"', r"`thrust` must clip between a lower .* got '2\*clip.* Exchange them\.$"),
        ('thrust = "clip(pwm + clip(q, 2, 1), q, -5)"', "must clip between a lower number and a higher one"),
        ("thrust = 3", "`formulas` of `thrust` must be a formula of columns; got 3"),
        ('thrust = "3"', "`formulas` of `thrust` must name a column at least; got '3'"),
        ('thrust = "pwm", t2 = "thrust"', "`formulas` of `t2` must name columns of the files"),
        ('thrust = "pwm", other = "q"', "`formulas` must make columns that other keys name, .*; got `other`"),
        ('thrust = "duty"', r"no column `duty`; found `t, q, v, pwm`\..* of `thrust` names it: 'duty'\.$"),
        ('thrust = "`3`*`"', 'got a backtick that no other one closes in "`3`\\*`"'),
        (f'thrust = "{"+".join(["pwm"] * 999)}"', r"got 'pwm\+pwm[pwm+]{72}…'\. .* more than 100 levels"),
        ('thrust = "3"', 'has a number for its name stands in backticks, such as "`2`"'),
        ('thrust = "2*thrust"', r"files, not what formulas make; .* Call what is made otherwise than `thrust`\.$"),
        ('thrust = "thrust-cmd"', r"otherwise than `thrust`; a name with signs in it stands in backticks, such as"),
    ],
)
def test_what_is_no_formula_of_columns_is_refused(tmp_path, formulas, message):
    with pytest.raises(DataError, match=message):
        read_dataset(described(tmp_path, formulas))

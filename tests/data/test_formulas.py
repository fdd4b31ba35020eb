"""Columns that are formulas of others."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, read_dataset

T = 0.05 * np.arange(60)
Q = np.sin(2 * T)
PWM = 20 + 15 * np.cos(3 * T)


def described(path, formulas, *, inputs='["thrust"]', more=""):
    """A joint with a propeller, logged with its duty."""
    columns = np.stack([T, Q, 2 * np.cos(2 * T), PWM], axis=1)
    np.savetxt(path / "a.csv", columns, delimiter=",", header="t,q,v,pwm", comments="", fmt="%.17g")
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
    ("formulas", "message"),
    [
        ('thrust = "max(pwm, 3)"', r"`formulas` of `thrust` must be a formula of columns; .*got `,`"),
        ("thrust = 3", "`formulas` of `thrust` must be a formula of columns; got 3"),
        ('thrust = "3"', "`formulas` of `thrust` must name a column at least; got '3'"),
        ('thrust = "pwm", t2 = "thrust"', "`formulas` of `t2` must name columns of the files"),
        ('thrust = "pwm", other = "q"', "`formulas` must make columns that other keys name, .*; got `other`"),
        ('thrust = "duty"', "no column `duty`; found `t, q, v, pwm`"),
    ],
)
def test_what_is_no_formula_of_columns_is_refused(tmp_path, formulas, message):
    with pytest.raises(DataError, match=message):
        read_dataset(described(tmp_path, formulas))

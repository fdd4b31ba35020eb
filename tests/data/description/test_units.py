"""What is read arrives in SI and rad, column by column."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, check_dataset, read_dataset
from symoden.data.description._description import read_description
from symoden.data.description._units import UNITS, factor_of

TEXT = """
space = "T2"
{units}
time = "t"
positions = {positions}
velocities = "v"
inputs = ["u"]
[train]
files = ["a.npz"]
"""


def described(tmp_path, units, positions='"q"'):
    path = tmp_path / "arm.toml"
    path.write_text(TEXT.format(units=f"units = {{{units}}}", positions=positions), encoding="utf-8")
    return path


def write_run(tmp_path, factors=(1.0, 1.0, 1.0, 1.0)):
    t = np.linspace(0.0, 4.0, 401)
    q = np.stack([np.sin(2 * t), np.cos(3 * t)], axis=1)
    v = np.stack([2 * np.cos(2 * t), -3 * np.sin(3 * t)], axis=1)
    f = factors
    np.savez(tmp_path / "a.npz", t=t / f[0], q=q / f[1], v=v / f[2], u=np.sin(t) / f[3])
    return t, q, v, np.sin(t)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("deg", math.pi / 180),
        ("rpm", math.pi / 30),
        ("rev/s", 2 * math.pi),
        ("mm", 1e-3),
        ("m N m", 1e-3),
        ("N·m", 1.0),
    ],
)
def test_names_stand_for_factors(unit, factor):
    assert factor_of(unit) == pytest.approx(factor, rel=1e-15)


@given(factors=st.tuples(*[st.floats(1e-3, 1e3)] * 3), sign=st.sampled_from([-1, 1]))
def test_what_was_divided_on_the_way_out_is_multiplied_on_the_way_in(tmp_path_factory, factors, sign):
    folder = tmp_path_factory.mktemp("units")
    time, rate, force = factors
    t, q, v, u = write_run(folder, (time, math.pi / 180, rate, sign * force))
    units = f't = {time!r}, q = "deg", v = {rate!r}, u = {sign * force!r}'
    run = read_dataset(described(folder, units)).train[0]
    np.testing.assert_allclose(run.ts, t, rtol=1e-12)
    np.testing.assert_allclose(run.q, q, atol=1e-12)
    np.testing.assert_allclose(run.rates, v, atol=1e-12)
    np.testing.assert_allclose(run.us[:, 0], u, atol=1e-12)


def test_a_column_of_a_variable_has_its_own_unit(tmp_path):
    _, q, v, _ = write_run(tmp_path)
    file = dict(np.load(tmp_path / "a.npz"))
    file["q"] = file["q"] / [math.pi / 180, 1.0]
    file["v"] = file["v"] / [math.pi / 180, -2.0]
    np.savez(tmp_path / "a.npz", **file)
    for positions in ('"q"', '["q[0]", "q[1]"]'):
        path = described(tmp_path, '"q[0]" = "deg", v = "deg/s", "v[1]" = -2', positions)
        run = read_dataset(path).train[0]
        np.testing.assert_allclose(run.q, q, atol=1e-12)
        np.testing.assert_allclose(run.rates, v, atol=1e-12)


def test_a_column_is_one_that_its_variable_has(tmp_path):
    np.savez(tmp_path / "a.npz", t=np.arange(9) / 10, q=np.sin(np.arange(9) / 10))
    text = 'space = "T1"\ntime = "t"\npositions = "q"\nunits = {{ "{}" = 0.1 }}\n[train]\nfiles = ["a.npz"]\n'
    path = tmp_path / "d.toml"
    path.write_text(text.format("q[0]"))
    np.testing.assert_allclose(read_dataset(path).train[0].q[:, 0], 0.1 * np.sin(np.arange(9) / 10))
    path.write_text(text.format("q[1]"))
    with pytest.raises(DataError, match=r"`units` must name columns that are read, `t, q`; got `q\[1\]`"):
        read_dataset(path)


def test_degrees_are_unwrapped_as_angles(tmp_path):
    t = np.linspace(0.0, 2.0, 201)
    q = np.stack([10 * t, -7 * t], axis=1)
    shown = np.mod(np.degrees(q), 360)
    np.savez(tmp_path / "a.npz", t=t, q=shown, v=np.full((201, 2), [10.0, -7.0]), u=t)
    run = read_dataset(described(tmp_path, 'q = "deg"')).train[0]
    np.testing.assert_allclose(run.q - run.q[0], q, atol=1e-9)


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ('w = "deg"', r"`units` must name columns that are read, which are `t, q, v, u`; got `w`\."),
        (
            'q = "degree"',
            r"`units` of `q` must be a factor or one of the units `rad, .* ns`; got 'degree'\. Did you mean `deg`\?",
        ),
        ('u = "bar"', r"; got 'bar'\. For another unit write the factor to SI, such as 0\.0254 for inches\."),
        ("q = 0", "`units` of `q` must be the name of a unit, or a factor: a finite number other than 0"),
        ('q.position = "deg"', 'a table of columns; a name with dots stands in quotes, such as "q.position"'),
        ("q = true", "`units` of `q` must be the name of a unit"),
        ("q = [1, 2]", "`units` of `q` must be the name of a unit"),
        ('q = "ms"', "say of `q`, which is of `positions`, how its numbers become rad; got a unit of s"),
        ('"q[1]" = "rpm"', "got a unit of rad/s. Write `rad, deg, rev`, or a factor; angles have the letter T"),
        ('v = "deg"', "say of `v`, which is of `velocities`, how its numbers become rad/s; got a unit of rad"),
        ('q = "mA"', "how its numbers become rad; got a unit of A"),
        ('q = "mm"', "how its numbers become rad; got a unit of m"),
        ('v = "mm/s"', "how its numbers become rad/s; got a unit of m/s"),
        ('u = "rpm"', "of `inputs`, how its numbers become N or N m or A or V; got a unit of rad/s"),
        ('u = "deg"', "got a unit of rad. Write `N, kN, Nm, Ncm, mNm, A, mA, V, mV`, or a factor\\."),
        ('t = "mm"', "say of `t`, which is of `time`, how its numbers become s; got a unit of m"),
    ],
)
def test_what_is_no_unit_is_refused(tmp_path, units, message):
    with pytest.raises(DataError, match=message):
        read_description(described(tmp_path, units))


@pytest.mark.parametrize(
    ("space", "units", "titles"),
    [
        ("T1", "", ["q [rad]", "v [rad/s]", "u"]),
        ("T1", 'q = "deg", v = "rpm", u = "N cm"', ["q [rad]", "v [rad/s]", "u [N m]"]),
        ("R1", "", ["q", "v", "u"]),
        ("R1", 'q = "mm"', ["q [m]", "v [m/s]", "u"]),
        ("R1", 'v = "mm/s", u = 2.0', ["q [m]", "v [m/s]", "u"]),
        ("R1", 'q = "rev"', ["q [rad]", "v [rad/s]", "u"]),
        ("R1", 'v = "rpm"', ["q [rad]", "v [rad/s]", "u"]),
    ],
)
@pytest.mark.filterwarnings("ignore::symoden.data.DataWarning")  # The numbers themselves are in SI.
def test_columns_are_called_with_their_si_units_where_these_are_known(tmp_path, space, units, titles):
    t = 0.01 * np.arange(200)
    np.savez(tmp_path / "a.npz", t=t, q=np.sin(t), v=np.cos(t), u=t)
    path = described(tmp_path, units)
    path.write_text(path.read_text().replace('"T2"', f'"{space}"'), encoding="utf-8")
    assert [one.title for one in check_dataset(path).recordings[0].channels] == titles
    unit = next((unit for unit in ("rad", "m") if f"[{unit}]" in titles[0]), "")
    assert read_dataset(path).position_units == (unit,)


@pytest.mark.parametrize(
    ("units", "wrong"),
    [
        ('"q[0]" = "mm", "q[1]" = "deg"', None),
        ('q = "deg", "q[0]" = 0.001', None),
        ('q = "mm"', "q"),
        ('"q[1]" = "mm"', r"q\[1\]"),
        ('v = "mm/s"', "v"),
        ('"v[0]" = "mm/s"', None),
        ('q = "deg"', None),  # An angle that does not repeat after a turn.
        ('v = "rpm"', None),
        ('q = "deg", "v[0]" = "mm/s"', r"v\[0\]"),
        ('"q[0]" = "mm", v = "rpm"', "v"),
    ],
)
def test_lengths_and_angles_have_units_of_their_own_kind(tmp_path, units, wrong):
    path = described(tmp_path, units)
    path.write_text(path.read_text().replace('"T2"', '"R1 T1"'), encoding="utf-8")
    if wrong is None:
        assert read_description(path).si_units
        return
    with pytest.raises(DataError, match=f"`units` must say of `{wrong}`"):
        read_description(path)


def test_an_angle_that_shall_count_as_a_number_keeps_its_unit(tmp_path):
    path = described(tmp_path, 'q = "deg"')
    assert read_description(path, space="R2").si_units == {"q": "rad"}
    with pytest.raises(DataError, match="how its numbers become rad; got a unit of m"):
        read_description(described(tmp_path, 'q = "mm"'), space="T2")


def test_an_angle_on_a_space_of_lengths_becomes_rad_and_does_not_wrap(tmp_path):
    t = 0.01 * np.arange(1500)
    turns = 1.5 * np.sin(t)
    np.savez(tmp_path / "a.npz", t=t, q=turns, v=1.5 * 60 * np.cos(t), u=np.cos(t))
    path = described(tmp_path, 'q = "rev", v = "rpm"')
    path.write_text(path.read_text().replace('"T2"', '"R1"'), encoding="utf-8")
    run = read_dataset(path).train[0]
    np.testing.assert_allclose(run.q[:, 0], 2 * np.pi * turns, atol=1e-12)
    np.testing.assert_allclose(run.rates[:, 0], 2 * np.pi * 1.5 * np.cos(t), atol=1e-12)
    path.write_text(path.read_text().replace(', v = "rpm"', ""), encoding="utf-8")
    (found,) = (each for each in check_dataset(path).recordings[0].findings if each.kind == "unit")
    assert "positions in rad, velocities in turns per minute" in found.text


def test_units_are_a_table(tmp_path):
    path = described(tmp_path, "q = 1")
    path.write_text(path.read_text().replace("units = {q = 1}", 'units = "deg"'))
    with pytest.raises(DataError, match="`units` must be a table of columns"):
        read_description(path)


def test_every_unit_is_a_positive_factor():
    assert all(factor > 0 for factor in UNITS.values())


def with_zeros(tmp_path, units, zeros):
    path = described(tmp_path, units)
    path.write_text(path.read_text().replace("time =", f"zeros = {zeros}\ntime =", 1), encoding="utf-8")
    return path


def test_what_columns_show_at_zero_is_subtracted_in_their_own_unit(tmp_path):
    t, q, _, u = write_run(tmp_path, (1.0, math.pi / 180, 1.0, 1.0))
    file = dict(np.load(tmp_path / "a.npz"))
    file |= {"q": file["q"] + [30.0, -5.0], "t": t + 100, "u": u + 0.2}
    np.savez(tmp_path / "a.npz", **file)
    path = with_zeros(tmp_path, 'q = "deg"', '{q = 30.0, "q[1]" = -5, u = 0.2, t = 100}')
    run = read_dataset(path).train[0]
    np.testing.assert_allclose(run.ts, t, atol=1e-12)
    np.testing.assert_allclose(run.q, q, atol=1e-12)
    np.testing.assert_allclose(run.us[:, 0], u, atol=1e-12)
    np.testing.assert_allclose(run.rates[:, 0], 2 * np.cos(2 * t), atol=1e-12)  # Of which nothing is said.


@pytest.mark.parametrize(
    ("zeros", "message"),
    [
        ("{w = 1.0}", r"`zeros` must name columns that are read, .*; got `w`\."),
        ('{q = "30 deg"}', "`zeros` must be a table of columns and finite numbers"),
        ("{q = nan}", "`zeros` must be a table of columns and finite numbers"),
        ("0.5", "`zeros` must be a table of columns and finite numbers"),
    ],
)
def test_zeros_are_numbers_of_columns_that_are_read(tmp_path, zeros, message):
    with pytest.raises(DataError, match=message):
        read_description(with_zeros(tmp_path, "q = 1", zeros))

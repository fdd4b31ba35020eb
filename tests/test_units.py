"""Units follow from those of the coordinates."""

import pytest

from symoden.units import position_units, titled, unit_of, units_of_entries

# Powers of kg, m and s: those of energy over those of the coordinates, and times those of time.
_POWERS = {
    "kg": (1, 0, 0), "kg m": (1, 1, 0), "kg m²": (1, 2, 0), "N": (1, 1, -2), "N m": (1, 2, -2), "m/s": (0, 1, -1),
    "rad/s": (0, 0, -1), "kg m/s": (1, 1, -1), "kg m²/s": (1, 2, -1), "N s/m": (1, 0, -1), "N s": (1, 1, -1),
    "N m s": (1, 2, -1), "m": (0, 1, 0), "rad": (0, 0, 0),
}  # fmt: skip


@pytest.mark.parametrize("first", ["m", "rad"])
@pytest.mark.parametrize("second", ["m", "rad"])
def test_energy_is_in_joules_whatever_the_coordinates(first, second):
    a, b = (unit == "m" for unit in (first, second))
    assert _POWERS[unit_of("velocity", first)] == (0, a, -1)
    assert _POWERS[unit_of("force", first)] == (1, 2 - a, -2)
    assert _POWERS[unit_of("momentum", first)] == (1, 2 - a, -1)
    assert _POWERS[unit_of("inertia", first, second)] == (1, 2 - a - b, 0)
    assert _POWERS[unit_of("friction", first, second)] == (1, 2 - a - b, -1)


@pytest.mark.parametrize(
    ("coordinates", "inertia"),
    [
        (("rad", "m", "rad"), ("kg", "kg m", "kg m²")),
        (("m", "rad"), ("kg", "kg m", "kg m²")),
        (("rad",), ("kg m²",)),
        (("", "m"), ("kg",)),
    ],
)
def test_entries_have_each_unit_once_from_lengths_to_angles(coordinates, inertia):
    assert units_of_entries("inertia", coordinates) == inertia


def test_what_is_not_known_has_no_unit():
    assert titled("x", "") == titled("x", "", "velocity") == "x"
    assert titled("p", "rad", "momentum") == "p [kg m²/s]"


@pytest.mark.parametrize("told", [("m", "m"), ("rad",), ("", "", ""), ("deg", "rad"), "rad"])
def test_what_is_no_unit_of_each_coordinate_is_refused(told):
    with pytest.raises(ValueError, match=r'must be "rad", "m" or "" \(not known\) for each of 2 coordinates, .*; got '):
        position_units((False, True), told)

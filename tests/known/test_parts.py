"""Known parts: numbers and formulas in one form, and every name with a meaning."""

from typing import Any

import numpy as np
import pytest

from symoden.known import KnownParts


def known(**changes: Any):
    least: dict[str, Any] = {"mass_matrix": [["m*l**2"]], "constants": {"l": 0.5}, "parameters": {"m": 1.0}}
    return KnownParts(**least | changes)


def test_numbers_arrays_and_formulas_come_into_one_form():
    parts = KnownParts(
        mass_matrix=np.array([[2, 0], [0, 3]]), potential_energy=0, input_matrix=[[1, "2*pi"]], correct=("mass_matrix",)
    )
    assert parts.formulas("mass_matrix") == ("2.0", "0.0", "0.0", "3.0")
    assert parts.formulas("potential_energy") == ("0.0",)
    assert parts.formulas("input_matrix") == ("1.0", "2*pi")
    assert parts.formulas("dissipation_matrix") is None
    assert parts.given == ("mass_matrix", "potential_energy", "input_matrix")
    assert KnownParts(mass_matrix=lambda q: q).formulas("mass_matrix") is None


def test_what_runs_are_told_apart_by_stays_what_it_was_without_cyclic_coordinates():
    assert "cyclic" not in known().fingerprint
    assert len({known(cyclic=cyclic).fingerprint for cyclic in ((), ("q2",), ("q3",))}) == 3


BAD = [
    ({"mass_matrix": []}, r"`mass_matrix` must be a list of rows"),
    ({"mass_matrix": [["m", "l"], ["l"]]}, r"rows of equal length; got \[2, 1\]"),
    ({"mass_matrix": [["m*l^2"]]}, r"`mass_matrix`: A formula may contain .* A power is written"),
    ({"mass_matrix": [[float("inf")]]}, "an entry must be a formula .* got inf"),
    ({"potential_energy": float("nan")}, "`potential_energy`: an entry must be .* finite number; got nan"),
    ({"potential_energy": "k*q1"}, r"`potential_energy`: every name must be .* got `k`: give its value"),
    ({"potential_energy": "v1"}, r"got `v1`: velocities stand in the dissipation matrix alone"),
    ({"parameters": {"m": 1.0, "k": 2.0}}, "`k` must stand in a formula; it stands in none"),
    ({"constants": {"l": 0.5, "m": 2.0}}, "`m` must be a constant or a parameter; got both"),
    ({"parameters": {"m": float("inf")}}, "`parameters`: `m` must be a finite number; got inf"),
    ({"constants": {"l": 0.5, "sin": 1.0}}, "`sin` must be a name .* that means nothing else"),
    ({"constants": {"l": 0.5, "q1": 1.0}}, "`q1` must be a name"),
    ({"constants": {"l": 0.5, "a b": 1.0}}, "`a b` must be a name"),
    (
        {"cyclic": ("yaw",)},
        r"`cyclic` must name coordinates by their number, q1, q2, …, or in a description by their column; got `yaw`",
    ),
    ({"cyclic": ("q1",), "potential_energy": "cos(q1)"}, "`q1` stands in `potential_energy`"),
    ({"correct": ("potential_energy",)}, "`correct` must name parts that are given, of mass_matrix; got `pot"),
]


@pytest.mark.parametrize(("changes", "message"), BAD, ids=[message for _, message in BAD])
def test_what_cannot_be_meant_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        known(**changes)


def test_velocities_stand_in_the_dissipation_matrix():
    assert known(dissipation_matrix=[["1/(1 + abs(v1))"]]).given == ("mass_matrix", "dissipation_matrix")

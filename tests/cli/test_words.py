"""What is said of bands, where no command's own test sees it."""

import dataclasses
import math

import numpy as np
import pytest

from symoden.cli._tables import facts
from symoden.cli._words import audit_words, band_words, certainty_words, hardly_judged
from symoden.evaluation import Audit, BandScore, Certainty, Inspection


@pytest.mark.parametrize(("apart", "said"), [({"M": 0.01, "V": 0.02, "D": 0.2}, True), ({"M": 0.08, "V": 0.02}, False)])
def test_a_common_factor_is_named_where_most_of_m_and_v_is_uncertain_by_it(apart, said):
    certain = Certainty(
        level=0.9,
        profiles=(),
        friction=(),
        identified={},
        relative={"M": 0.1, "V": 0.1, "D": 0.3},
        common_factor=0.099,
        apart=apart,
        accelerations={},
        undetermined=(),
        parameters=9,
        windows=20,
        effective=7.0,
    )
    words = [line for line in certainty_words(certain, "") if "common factor" in line]
    assert bool(words) == said
    if said:
        assert words == [
            "mostly a common factor of M, V and D, which inputs tell: ± 9.9%; were it known, M ± 1%, V ± 2%, D ± 20%"
        ]


@pytest.mark.parametrize(
    ("undetermined", "told", "is_flat"),
    [
        (("M[1, 2]", "g[2, 1]"), False, False),
        (("M[2, 2]", "D[2, 2]"), True, False),
        (("V", "M[1, 2]"), False, True),
    ],
)
def test_where_coordinates_have_factors_of_their_own_accelerations_tell_what_is_known(undetermined, told, is_flat):
    certain = Certainty(
        level=0.9,
        profiles=(),
        friction=(),
        identified={},
        relative={"M": 1.3, "V": 0.1, "D": 70.0},
        common_factor=None,
        apart={},
        accelerations={"inputs": 0.02, "potential": 0.004, "friction": 0.07},
        undetermined=undetermined,
        parameters=9,
        windows=20,
        effective=7.0,
    )
    words = list(certainty_words(certain, ""))
    assert "accelerations, whose scale is told: by inputs ± 2%, by potential ± 0.4%, by friction ± 7%" in words
    assert "typical: M ± 130%, V ± 10%, D ± more than 1000%" in words
    assert any("has a factor of its own" in line for line in words) == told
    assert any("of V all is open" in line for line in words) == is_flat


@pytest.mark.parametrize("closed", [False, True])
def test_a_potential_that_training_has_closed_is_said_to_be_zero(closed):
    sizes = {"M": 0.1, "D": 0.2} if closed else {"M": 0.1, "V": 1.2, "D": 0.2}
    certain = Certainty(
        level=0.9,
        profiles=(),
        friction=(),
        identified={},
        relative=sizes,
        common_factor=None,
        apart={},
        accelerations={},
        undetermined=("V",),
        parameters=9,
        windows=20,
        effective=7.0,
    )
    words = list(certainty_words(certain, ""))
    assert any(line.startswith("V is zero: training found") for line in words) == closed
    assert any("of V all is open" in line for line in words) != closed


@pytest.mark.parametrize(("coverage", "narrow"), [(0.79, True), (0.81, False), (0.99, False)])
def test_bands_that_miss_many_positions_are_called_too_narrow(coverage, narrow):
    score = BandScore(
        level=0.9,
        calibrated_on="validation",
        split="test",
        horizon_s=0.97,
        coverage=coverage,
        half_width=0.1,
        coverages=(coverage,) * 2,
        half_widths=(0.002, 0.3),
        from_parameters=0.2,
    )
    words = band_words(score)
    assert f"recordings (one by one {coverage:.0%}, {coverage:.0%}); median half width 0.002, 0.3," in words
    alone = band_words(dataclasses.replace(score, coverages=(coverage,), half_widths=(0.1,)))
    assert "recordings; median half width 0.1," in alone
    assert words.startswith("90% bands over windows of 0.97 s cover")
    assert f"cover {coverage:.1%} of the positions of the test recordings" in words
    assert ("the bands are too narrow here" in words) == narrow


def test_what_few_windows_refused_is_named():
    words = hardly_judged(("potential", "growth"))
    assert "which hardly tell, training refused potential, growth: longer or more recordings" in words
    assert not hardly_judged(())


@pytest.mark.parametrize(("residual", "said"), [(0.02, False), (0.24, False), (0.3, True)])
def test_energy_that_is_not_accounted_for_is_named(residual, said):
    audit = Audit(
        recordings=2,
        rollouts=2,
        diverged=0,
        rollout_violation=1e-6,
        log_residual_median=residual,
        log_residual_max=0.7,
        inverse_mass_min=1.0,
        dissipation_min=0.0,
        outside=0.0,
    )
    assert any("more than 25% of the energy" in line for line in audit_words("test", audit, "")) == said


@pytest.mark.parametrize(
    ("inertia", "coordinates", "given", "said"),
    [
        ((0.05, 0.28), 1, {}, True),
        ((0.05, 0.09), 1, {}, False),
        ((0.05, 0.28), 1, {"mass_matrix": "given"}, False),
        ((0.05, 0.28), 2, {}, False),  # Of an arm it changes so.
        (None, 1, {}, False),
        ((0.0, 0.28), 1, {}, False),
        ((math.nan, math.nan), 1, {}, False),
    ],
)
def test_an_inertia_that_no_rigid_body_has_is_named(inertia, coordinates, given, said):
    found = Inspection(
        space=f"T{coordinates}",
        position_units=("rad",) * coordinates,
        parameters=10,
        active=10,
        anchor="",
        units={},
        given=given,
        identified={},
        mass_matrix_eigenvalues=inertia,
        dissipation_eigenvalues=None,
        profiles=(),
        friction=(),
        velocities=None,
        middle=np.zeros(coordinates),
    )
    words = dict(facts(found)).get("what bends M so", "")
    assert bool(words) == said
    assert not said or "5.6-fold" in words

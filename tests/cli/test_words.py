"""What is said of bands, where no command's own test sees it."""

import pytest

from symoden.cli._words import certainty_words
from symoden.experiments import Certainty


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

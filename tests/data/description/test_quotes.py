"""Names that TOML reads otherwise than they look, and lines of descriptions to paste."""

import re
import tomllib

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.data import DataError, check_dataset
from symoden.data.description._units import key
from symoden.wording import quoted

ODD = st.one_of(st.text(), st.text("\\\"'$\t\n\x7f aθ-_1"))


@given(name=ODD)
def test_what_is_pasted_into_toml_is_the_name(name):
    assert tomllib.loads(f"names = [{quoted(name)}]\n[units]\n{key(name)} = 1") == {"names": [name], "units": {name: 1}}


@pytest.mark.parametrize(
    ("name", "pasted"),
    [("q_1", "q_1"), ("q [1]", '"q [1]"'), (r"$\theta$", r"'$\theta$'"), ('3" pipe', "'3\" pipe'"), ("d'", '"d\'"')],
)
def test_quotes_are_those_that_need_no_escapes(name, pasted):
    assert key(name) == pasted


def described(folder, name, more=""):
    """A joint in degrees, and its description by a name that stands there as it is given."""
    t = 0.01 * np.arange(400)
    rows = np.stack([t, 4000 * np.sin(2 * t), np.sin(t)], axis=1)
    np.savetxt(folder / "a.csv", rows, delimiter=",", header=r"t,$\theta$,\tau (Nm)", comments="")
    path = folder / "arm.toml"
    text = f'space = "T1"\ntime = "t"\npositions = [{name}]\n{more}\n[train]\nfiles = ["a.csv"]\n'
    path.write_text(text, encoding="utf-8")
    return path


def warned(path):
    check = check_dataset(path)
    return [each for each in (*check.findings, *check.recordings[0].findings) if each.level == "warning"]


def test_what_is_advised_of_names_with_backslashes_can_be_pasted(tmp_path):
    path = described(tmp_path, r"'$\theta$'")
    (units,) = (each.advice for each in warned(path) if each.kind == "unit")
    (inputs,) = (each.advice for each in warned(path) if each.kind == "idle")
    lines = [line for advice in (units, inputs) for line in re.findall("`([a-z]+ = [^`]*)`", advice)]
    assert lines == [r"""units = {'$\theta$' = "deg"}""", r"inputs = ['\tau (Nm)']"]
    kinds = [each.kind for each in warned(described(tmp_path, r"'$\theta$'", "\n".join(lines)))]
    assert not {"unit", "idle"} & set(kinds)


def test_a_name_in_which_toml_read_a_tab_is_told_single_quotes(tmp_path):
    hint = r"Names with backslashes stand in single quotes in TOML: '\$\\theta\$'\."
    (found,) = check_dataset(described(tmp_path, r'"$\theta$"')).unreadable
    assert re.search(rf"no column `\$\theta\$`; found .*\. Did you mean `\$\\theta\$`\? {hint}", str(found.error))
    units = r'units = {"$\theta$" = "deg"}'
    with pytest.raises(DataError, match=hint):
        check_dataset(described(tmp_path, r"'$\theta$'", units))
    with pytest.raises(DataError, match="stand in quotation marks, with backslashes in single ones"):
        check_dataset(described(tmp_path, r'"$\phi$"'))

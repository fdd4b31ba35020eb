"""The name that was probably meant is asked for."""

import pytest

from symoden.data._errors import nearest


@pytest.mark.parametrize(
    ("wrong", "known", "meant"),
    [
        ("log.x", ["log.t", "log.v", "log.x_mm"], "log.x_mm"),
        ("log.x_mm", ["log.v_mm", "log.x"], "log.x"),
        ("Current", ["Currant", "current [mA]"], "current [mA]"),
        ("u", ["v", "u_cmd"], "u_cmd"),
        ("input", ["input_matrix", "input_delay", "inputs"], "inputs"),
        ("inputs_delay", ["inputs", "input_delay"], "input_delay"),
        ("torqe", ["torque", "time"], "torque"),
        ("X", ["x_mm", "x"], "x"),
        ("t", ["theta", "torque"], None),
        ("q", ["", "u"], None),
    ],
)
def test_a_name_that_goes_on_is_meant_before_one_that_looks_alike(wrong, known, meant):
    assert nearest(wrong, known) == (f" Did you mean `{meant}`?" if meant else "")

"""Formulas: what may be written has its meaning, and whatever else is refused before anything runs."""

import math

import pytest
from hypothesis import given, strategies as st

from symoden.known import FUNCTIONS, Expression, Grammar

VALUES = {"q1": 0.3, "m_2": 1.7}


def value(text):
    functions = {name: getattr(math, name, abs) for name in FUNCTIONS}
    return Expression(text).evaluate(VALUES, number=float, functions=functions)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 + 2*3 - 4/8", 6.5),
        ("2 - 3 - 4", -5.0),
        ("(1 + 2)*3", 9.0),
        ("-q1**2", -0.09),
        ("+2**-1", 0.5),
        ("4**0.5", 2.0),
        ("1.5e-1*pi", 0.15 * math.pi),
        ("m_2*cos(q1)\n + q1", 1.7 * math.cos(0.3) + 0.3),
        (" abs(-2) ", 2.0),
    ],
)
def test_a_formula_has_the_value_that_it_has_on_paper(text, expected):
    assert value(text) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_is_the_one_of_its_name(name):
    assert value(f"{name}(0.6)") == pytest.approx(getattr(math, name, abs)(0.6), rel=1e-15)


def test_the_names_that_need_a_value_are_known():
    assert Expression("2*pi*m_2*sin(q1) + m_2").names == {"q1", "m_2"}


@given(
    st.recursive(
        st.floats(0, 10).map(lambda x: (repr(x), x)),
        lambda inner: st.tuples(inner, st.sampled_from("+-*"), inner).map(
            lambda s: (
                (f"({s[0][0]} {s[1]} {s[2][0]})", {"+": 1, "-": -1}.get(s[1], 0) * s[2][1] + s[0][1])
                if s[1] != "*"
                else (f"({s[0][0]}*{s[2][0]})", s[0][1] * s[2][1])
            )
        ),
        max_leaves=12,
    )
)
def test_nested_arithmetic_is_that_of_numbers(pair):
    text, expected = pair
    assert value(text) == pytest.approx(expected, rel=1e-12, abs=1e-12)


SOME = Grammar(more=("least(a, b)", "between(x, low, high)"))


@pytest.mark.parametrize(("text", "expected"), [("least(3, q1)*2", 0.6), ("-between(q1, m_2, 4) + sin(0)", -1.7)])
def test_a_grammar_may_have_further_functions_of_one_argument_or_more(text, expected):
    functions = {"sin": math.sin, "least": min, "between": lambda x, low, high: min(max(x, low), high)}
    formula = Expression(text, SOME)
    assert formula.evaluate(VALUES, number=float, functions=functions) == pytest.approx(expected)
    with pytest.raises(ValueError, match="abs of one argument; got"):
        Expression(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("least(q1)", r"got `least\(q1\)` with 1 argument in .* `least` takes 2, as in `least\(a, b\)`\.$"),
        ("between(1, 2, 3, 4)", r"with 4 arguments in .* `between` takes 3, as in `between\(x, low, high\)`\.$"),
        ("lest(1, 2)", r"Did you mean `least\(a, b\)`\?$"),
        ("sign(q1)", r"abs of one argument, least\(a, b\) and between\(x, low, high\); got `sign\(q1\)`"),
    ],
)
def test_functions_take_their_number_of_arguments(text, message):
    with pytest.raises(ValueError, match=message):
        Expression(text, SOME)


def test_formulas_of_one_text_are_equal_and_frozen():
    assert Expression("sin(q1)") == Expression("sin(q1)", SOME) != Expression("sin( q1)")
    assert len({Expression("sin(q1)"), Expression("sin(q1)", SOME)}) == 1
    assert repr(Expression("q1", SOME)) == "Expression(text='q1')"
    with pytest.raises(AttributeError):
        Expression("q1").text = "q2"  # pyright: ignore[reportAttributeAccessIssue]


BAD = [
    ("", "got an empty text"),
    ("sign(v1)", r"got `sign\(v1\)` .* dry friction F is D = `F/sqrt\(v1\*\*2 \+ 1e-4\)`"),
    ("q1^2", r"got `\^` in `q1\^2`.*A power is written `\*\*`"),
    ("2a(1-cos(q2))", r"got what cannot be read in .*A product is written `\*`, as in"),
    ("m_2 q1", r"A product is written `\*`"),
    ("(1 - q1) q1", r"A product is written `\*`"),
    ("2 cos(q1)", r"A product is written `\*`"),
    ("2*a(1-cos(q2))", r"got `a\(1-cos\(q2\)\)`.*A product is written `\*`"),
    ("2(1-q1)", r"got `2\(1-q1\)`.*A product is written `\*`"),
    ("m_2·q1", r"got `·`.*A product is written `\*`"),
    ("1e-4 +", r"Write only these\.$"),
    ("q1.real", r"got `q1\.real`"),
    ("__import__('os')", "got `'`"),
    ("open(q1)", r"got `open\(q1\)`"),
    ("sin(q1, q1)", r"got `sin\(q1, q1\)` with 2 arguments in .* `sin` takes 1, as in `sin\(x\)`\.$"),
    ("sin()", r"got `sin\(\)` with 0 arguments in"),
    ("sin(q1,)", r"got `,\)` in"),
    ("0,5*q1", r"got `0,5\*q1` .* A decimal mark is a point"),
    ("sqr(q1)", r"got `sqr\(q1\)` .* Did you mean `sqrt\(x\)`\?$"),
    ("min(q1, 0)", r"got `min\(q1, 0\)` .* These are differentiated.* min\(a, b\) has the root with a minus\.$"),
    ("max(q1, 0)", r"got `max\(q1, 0\)` .* A smooth max\(a, b\) is `\(a \+ b \+ sqrt\("),
    ("clip(q1, 0, 1)", r"got `clip\(q1, 0, 1\)` .* clip have corners"),
    ("q1 − 2", "got `−` .* A minus is written `-`"),
    ("`q1`", "got ```"),
    ("sin(x=1)", "got `=`"),
    ("q1(2)", r"got `q1\(2\)`"),
    ("q1 if q1 else 2", "got `q1 if q1 else 2`"),
    ("q1 and q1", "got `q1 and q1`"),
    ("not q1", "got `not q1`"),
    ("7 // 2", "got `7 // 2`"),
    ("lambda", "got what cannot be read"),
    ("1 +", "got what cannot be read"),
    ("1j", "got `1j`"),
    ("True", "got `True`"),
    ("1e999", "got `1e999`"),
    ("1" * 3999, "got a number too large"),
    ("9**9**9", r"got a power other than a plain number of at most 16"),
    ("q1**17", "got a power other than"),
    ("q1**q1", "got a power other than"),
    ("+".join(["q1"] * 200), r"got more than 100 levels"),
    ("(" * 1500 + "1" + ")" * 1500, "got what cannot be read"),
    ("-" * 3999 + "1", "A formula may contain"),
    ("1" * 5000, "at most 4000 characters; got 5000"),
]


@pytest.mark.parametrize(("text", "message"), BAD, ids=[text[:12] for text, _ in BAD])
def test_whatever_else_is_refused(text, message):
    with pytest.raises(ValueError, match=message) as caught:
        Expression(text)
    assert len(str(caught.value)) < 400

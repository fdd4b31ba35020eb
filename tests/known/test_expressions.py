"""Formulas: what may be written has its meaning, and whatever else is refused before anything runs."""

import contextlib
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


QUOTED = Grammar(more=("least(a, b)",), quotes=True)
COLUMNS = {"Motor Current [mA]": 2.0, "/joints/effort.0": 3.0, "u-cmd": 5.0, "2": 7.0, "sin": 0.1, "pi": 11.0}
COLUMNS |= {"group/u[1]": 13.0, "u": 17.0, "θ  (°)": 19.0, "u[0]": 23.0, "λ0": 29.0}


@pytest.mark.parametrize(
    ("text", "expected", "names"),
    [
        ("`Motor Current [mA]` * 0.5", 1.0, ["Motor Current [mA]"]),
        ("`/joints/effort.0`-`u-cmd`", -2.0, ["/joints/effort.0", "u-cmd"]),
        ("2*`2`", 14.0, ["2"]),
        ("sin(`sin`) + `pi`", math.sin(0.1) + 11, ["pi", "sin"]),
        ("`group/u`[1]/`group/u[1]`", 1.0, ["group/u[1]"]),
        ("u + u[0] - `u`", 23.0, ["u", "u[0]"]),
        ("`θ  (°)`\n\t+ 1", 20.0, ["θ  (°)"]),
        ("least(`λ0`, `u`) + `u`**2", 306.0, ["u", "λ0"]),
    ],
)
def test_names_in_backticks_have_any_characters(text, expected, names):
    functions = {"sin": math.sin, "least": min}
    formula = Expression(text, QUOTED)
    assert formula.evaluate(COLUMNS, number=float, functions=functions) == pytest.approx(expected)
    assert sorted(formula.names) == names


IN_BACKTICKS = r"stands in backticks, as in \"`Motor Current \[mA\]` \* 0.001\"\.$"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("`u", 'got a backtick that no other one closes in "`u"'),
        ("`u`*`v` - `", "got a backtick that no other one closes"),
        ("``", "got two backticks without a name between them"),
        ("2*`  `", "got two backticks without a name between them"),
        ("``u``", "got two backticks without a name between them"),
        ("`" * 4000, "got two backticks without a name between them"),
        (f"`{'u' * 201}`", "got a name of 201 characters, more than 200 in"),
        ("`u`" * 2000, "A formula must have at most 4000 characters; got 6000"),
        ("+".join(["`u`"] * 200), "got more than 100 levels"),
        ("`u``v`", "got what cannot be read in"),
        ("`u`v", "got what cannot be read in"),
        ("a`u`", "got what cannot be read in"),
        ("`u`2", "got what cannot be read in"),
        ("`u`.real", 'got "`u`.real" in'),
        ("`sin`(2)", r'got "`sin`\(2\)" in'),
        ("`os`[`u`]", r'got "`os`\[`u`\]" in'),
        ("2*least(`u v`)", r'got "least\(`u v`\)" with 1 argument in "2\*least\(`u v`\)"'),
        ("`u`**`v`", "got a power other than"),
        ("λ0 + `u`", "got `λ` in"),
        ("`u` ; v", "got `;` in"),
        ("u > 3", "got `>` in .* There are no conditions: beyond ±3 alone is `u - clip"),
        ("u^2", r"A power is written `\*\*`\.$"),
        ("u +", r"Write only these\.$"),
    ],
)
def test_backticks_without_a_name_and_what_is_no_arithmetic_of_names_are_refused(text, message):
    with pytest.raises(ValueError, match=message) as caught:
        Expression(text, QUOTED)
    assert len(str(caught.value)) < 600
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "Motor Current [mA] * 0.001",
        "/joints/effort.0 * 2",
        "2*/joints/effort",
        "data/demo_*/u",
        "effort.0",
        "log.q",
        "effort[Nm]",
        "slip[-] * 2",
        "i (A)",
        "duty %",
        "θ * 2",
        "'Motor Current'",
        "1st_motor",
        "lambda*2",
        "torque:0",
    ],
)
def test_backticks_are_named_where_a_name_without_them_seems_to_need_them(text):
    with pytest.raises(ValueError, match=IN_BACKTICKS):
        Expression(text, QUOTED)
    with pytest.raises(ValueError, match="A formula may contain") as caught:
        Expression(text)
    assert "backticks" not in str(caught.value)


@given(st.text(st.characters(codec="utf-8", exclude_characters="`"), min_size=1, max_size=20))
def test_no_name_in_backticks_runs_or_crashes(name):
    if name.strip():
        assert Expression(f"2*`{name}` + `{name}`[0]", QUOTED).names == {name, f"{name}[0]"}


@given(st.text(st.sampled_from("`u1.[]()*/+-, λ'\nsin"), max_size=30))
def test_whatever_is_written_is_read_or_refused(text):
    with contextlib.suppress(ValueError):
        assert all(Expression(text, QUOTED).names)


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
    ("`q1`", 'got "`" in "`q1`"'),
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

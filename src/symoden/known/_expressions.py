"""Formulas as text, read without running code: arithmetic, some functions, numbers and names."""

import ast
import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NoReturn, TypeAlias, TypeVar

T = TypeVar("T")
Tree: TypeAlias = tuple[Any, ...]

FUNCTIONS: Final = (
    *("sin", "cos", "tan", "asin", "acos", "atan"),
    *("sinh", "cosh", "tanh", "exp", "log", "sqrt", "abs"),
)
"""Functions that formulas may use."""

_SMOOTH_SIGN: Final = (
    " A smooth sign of x is `x/sqrt(x**2 + 1e-4)`. As friction is −D v, a dry friction F is D = `F/sqrt(v1**2 + 1e-4)`."
)
_PRODUCT: Final = " A product is written `*`, as in `2*a*(1 - cos(q1))`."
_NO_SIGN: Final = re.compile(  # A number, a name or a parenthesis right before another one; 1e-4 is a number.
    r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?+\s*[A-Za-z_(]|\)\s*[\w(]|\w\s+\w|\w\s+\("
)
_LONGEST: Final = 4000
_DEEPEST: Final = 100
_LARGEST_POWER: Final = 16
_CHARACTERS: Final = re.compile(r"[A-Za-z0-9_.+\-*/()[\]\s]*")
_OPERATORS: Final[dict[type, str]] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_INSTEAD: Final = {"^": " A power is written `**`.", "·": _PRODUCT, "×": _PRODUCT}
_APPLY: Final[dict[str, Callable[[Any, Any], Any]]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}


@dataclass(frozen=True)
class Expression:
    """A formula: + - * / **, parentheses, numbers, `pi`, the `FUNCTIONS` of one argument, and names, `u` or `u[0]`.

    The text is parsed, never run: whatever is not in this list is refused, as are texts that are very long or deeply
    nested, and powers that are no plain number of moderate size.

    Attributes:
        text: The formula.
        tree: What was read: nested tuples of an operation and its arguments.

    Raises:
        ValueError: If the text is no such formula.

    Example:
        >>> sorted(Expression("m*9.81*l*sin(q1) - b1").names)
        ['b1', 'l', 'm', 'q1']
    """

    text: str
    tree: Tree = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Read the text."""
        object.__setattr__(self, "tree", _parse(self.text))

    @property
    def names(self) -> frozenset[str]:
        """Names that need a value."""
        return frozenset(_names(self.tree))

    def evaluate(
        self, values: Mapping[str, T], *, number: Callable[[float], T], functions: Mapping[str, Callable[[T], T]]
    ) -> T:
        """Value of the formula in any arithmetic.

        Args:
            values: Value of every name.
            number: Makes a value of a plain number.
            functions: The `FUNCTIONS` by name.

        Returns:
            The value.

        Example:
            >>> Expression("2*x**2").evaluate({"x": 3.0}, number=float, functions={})
            18.0
        """

        def at(tree: Tree) -> Any:  # noqa: ANN401 - any arithmetic
            kind, *arguments = tree
            if kind == "number":
                return number(arguments[0])
            if kind == "name":
                return values[arguments[0]]
            if kind == "call":
                return functions[arguments[0]](at(arguments[1]))
            if kind == "**":
                return at(arguments[0]) ** arguments[1]
            return _APPLY[kind](at(arguments[0]), at(arguments[1]))

        return at(self.tree)


def _parse(text: str) -> Tree:
    """Tree of a formula."""
    if not text.strip():
        raise ValueError("A formula must have a value; got an empty text. Write 0 for nothing.")
    if len(text) > _LONGEST:
        raise ValueError(
            f"A formula must have at most {_LONGEST} characters; got {len(text)}: `{text[:40]}…`. Shorten it."
        )
    if not _CHARACTERS.fullmatch(text):
        odd = next(character for character in text if not _CHARACTERS.fullmatch(character))
        _refuse(text, f"`{odd}`", hint=_INSTEAD.get(odd, ""))
    text = " ".join(text.split())
    try:
        return _tree(ast.parse(text, mode="eval").body, text, depth=0)
    except (SyntaxError, RecursionError, MemoryError):
        _refuse(text, "what cannot be read", hint=_PRODUCT if _NO_SIGN.search(text) else "")
    except OverflowError:
        _refuse(text, "a number too large")


def _refuse(text: str, got: str, *, hint: str = "") -> NoReturn:
    """Say what a formula may contain."""
    shown = text if len(text) <= 80 else f"{text[:79]}…"
    raise ValueError(
        f"A formula may contain numbers, names, + - * / ** and {', '.join(FUNCTIONS)} of one argument; got {got} in "
        f"`{shown}`. Write only these.{hint}"
    ) from None


def _tree(node: ast.expr, text: str, *, depth: int) -> Tree:
    """Tree of a node, if it is one of the few that a formula may have."""
    if depth > _DEEPEST:
        _refuse(text, f"more than {_DEEPEST} levels (each term of a sum is one)")

    def inner(node: ast.expr) -> Tree:
        return _tree(node, text, depth=depth + 1)

    match node:
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return inner(operand)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return ("-", ("number", 0.0), inner(operand))
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return ("**", inner(left), _power(right, text))
        case ast.BinOp(left=left, op=kind, right=right) if type(kind) in _OPERATORS:
            return (_OPERATORS[type(kind)], inner(left), inner(right))
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
            return ("call", name, inner(argument))
    return _leaf(node, text)


def _leaf(node: ast.expr, text: str) -> Tree:
    """A number or a name."""
    match node:
        case ast.Name(id=name):
            return ("number", math.pi) if name == "pi" else ("name", name)
        case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=int(column))) if type(column) is int:
            return ("name", f"{name}[{column}]")  # A column of a variable.
    number = _number(node)
    if number is not None:
        return ("number", number)
    _refuse(text, f"`{(ast.get_source_segment(text, node) or text)[:40]}`", hint=_hint(node))


def _hint(node: ast.expr) -> str:
    """What is perhaps meant by parentheses after something that is no function."""
    if not isinstance(node, ast.Call):
        return ""
    if isinstance(node.func, ast.Name) and node.func.id in ("sign", "sgn"):
        return _SMOOTH_SIGN
    return _PRODUCT


def _number(node: ast.expr) -> float | None:
    """Value of a node that is a finite number."""
    value = node.value if isinstance(node, ast.Constant) else None
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        return None
    return float(value)


def _power(node: ast.expr, text: str) -> int | float:
    """Exponent: a plain number, whole where it can be, which keeps derivatives at zero finite."""
    sign = 1
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        sign, node = -1, node.operand
    number = _number(node)
    if number is None or number > _LARGEST_POWER:
        _refuse(text, f"a power other than a plain number of at most {_LARGEST_POWER}")
    return sign * (int(number) if number.is_integer() else number)


def _names(tree: Tree) -> Iterator[str]:
    """Names in a tree."""
    kind, *arguments = tree
    if kind == "name":
        yield arguments[0]
    for argument in arguments:
        if isinstance(argument, tuple):
            yield from _names(argument)

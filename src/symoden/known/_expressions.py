"""Formulas as text, read without running code: arithmetic, some functions, numbers and names."""

import ast
import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NoReturn, TypeAlias, TypeVar

from ._grammar import KNOWN, Grammar
from ._hints import BACKTICKS, hint_at, hint_of_character, hint_of_text

T = TypeVar("T")
Tree: TypeAlias = tuple[Any, ...]

_LONGEST: Final = 4000
_LONGEST_NAME: Final = 200
_DEEPEST: Final = 100
_LARGEST_POWER: Final = 16
_SHOWN, _SHOWN_PART = 80, 40  # Characters of a text, and of what is wrong in it, in a message.
_CHARACTERS: Final = re.compile(r"[A-Za-z0-9_.,+\-*/()[\]\s]")
_LAST_COMMA: Final = re.compile(r",\s*[)\]]")
_QUOTE: Final = "`"
_MARK: Final = "λ"  # With a number it stands for a quoted name while a text is read: no plain text may have it.
_MARKED: Final = re.compile(rf"{_MARK}(\d+)")
_OPERATORS: Final[dict[type, str]] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_APPLY: Final[dict[str, Callable[[Any, Any], Any]]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}


@dataclass(frozen=True)
class Expression:
    """A formula: + - * / **, parentheses, numbers, `pi`, the functions of its grammar, and names, `u` or `u[0]`.

    Where its grammar has quotes, a name in backticks may have any other characters.

    The text is parsed, never run: whatever is not in this list is refused, as are texts that are very long or deeply
    nested, and powers that are no plain number of moderate size.

    Attributes:
        text: The formula. Two of one text are equal: whatever grammars read it, they read the same.
        grammar: What it may contain; by default what the parts of a mechanism may.
        tree: What was read: nested tuples of an operation and its arguments.

    Raises:
        ValueError: If the text is no such formula.

    Example:
        >>> sorted(Expression("m*9.81*l*sin(q1) - b1").names)
        ['b1', 'l', 'm', 'q1']
    """

    text: str
    grammar: Grammar = field(default=KNOWN, repr=False, compare=False)
    tree: Tree = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Read the text."""
        object.__setattr__(self, "tree", _parse(self.text, self.grammar))

    @property
    def names(self) -> frozenset[str]:
        """Names that need a value."""
        return frozenset(_names(self.tree))

    def evaluate(
        self, values: Mapping[str, T], *, number: Callable[[float], T], functions: Mapping[str, Callable[..., T]]
    ) -> T:
        """Value of the formula in any arithmetic.

        Args:
            values: Value of every name.
            number: Makes a value of a plain number.
            functions: The functions of the grammar by name.

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
                return functions[arguments[0]](*map(at, arguments[1:]))
            if kind == "**":
                return at(arguments[0]) ** arguments[1]
            return _APPLY[kind](at(arguments[0]), at(arguments[1]))

        return at(self.tree)


@dataclass(frozen=True)
class _Text:
    """A formula that is being read.

    Attributes:
        written: It as it arrived.
        plain: It on one line, with marks for the names that stand in quotes.
        quoted: These names.
        grammar: What it may contain.
    """

    written: str
    plain: str
    quoted: tuple[str, ...]
    grammar: Grammar

    def name(self, identifier: str) -> str:
        """The name that an identifier stands for."""
        marked = _MARKED.fullmatch(identifier)
        return self.quoted[int(marked[1])] if marked else identifier

    def source(self, node: ast.expr) -> str:
        """What a node was read from."""
        segment = ast.get_source_segment(self.plain, node) or self.plain
        return _shown(_MARKED.sub(lambda mark: f"{_QUOTE}{self.name(mark[0])}{_QUOTE}", segment), _SHOWN_PART)


def _refuse(text: _Text, got: str, *, hint: str = "") -> NoReturn:
    """Say what a formula may contain."""
    shown = _shown(" ".join(text.written.split()), _SHOWN)
    raise ValueError(
        f"A formula may contain {text.grammar.words}; got {got} in {shown}. Write only these.{hint}"
    ) from None


def _shown(text: str, longest: int) -> str:
    """A text in a message: in quotes of another kind than it has, and no longer than it may be there."""
    cut = text if len(text) <= longest else f"{text[: longest - 1]}…"
    return f'"{cut}"' if _QUOTE in text else f"`{cut}`"


def _parse(written: str, grammar: Grammar) -> Tree:
    """Tree of a formula."""
    if not written.strip():
        raise ValueError("A formula must have a value; got an empty text. Write 0 for nothing.")
    if len(written) > _LONGEST:
        raise ValueError(
            f"A formula must have at most {_LONGEST} characters; got {len(written)}: {_shown(written, 41)}. Shorten it."
        )
    text = _outside_quotes(written, grammar)
    if (comma := _LAST_COMMA.search(text.plain)) is not None:
        _refuse(text, f"`{comma[0]}`")
    try:
        return _tree(ast.parse(text.plain, mode="eval").body, text, depth=0)
    except (SyntaxError, RecursionError, MemoryError):
        _refuse(text, "what cannot be read", hint=hint_of_text(text.plain, grammar))
    except OverflowError:
        _refuse(text, "a number too large")


def _outside_quotes(written: str, grammar: Grammar) -> _Text:
    """A text whose quoted names are marks, if these are names and the rest has no odd characters."""
    pieces = written.split(_QUOTE) if grammar.quotes else [written]
    outside, quoted = pieces[::2], tuple(pieces[1::2])
    marked = outside[0]
    for i, piece in enumerate(outside[1:]):  # No name grows together with what stands beside its quotes.
        marked += " " * _is_of_word(marked[-1:]) + f"{_MARK}{i}" + " " * _is_of_word(piece[:1]) + piece
    text = _Text(written, " ".join(marked.split()), quoted, grammar)
    if len(pieces) % 2 == 0:
        _refuse(text, "a backtick that no other one closes", hint=BACKTICKS)
    if not all(name.strip() for name in quoted):
        _refuse(text, "two backticks without a name between them", hint=BACKTICKS)
    if (longest := max(map(len, quoted), default=0)) > _LONGEST_NAME:
        _refuse(text, f"a name of {longest} characters, more than {_LONGEST_NAME}")
    odd = next((character for character in "".join(outside) if not _CHARACTERS.fullmatch(character)), None)
    if odd is not None:
        _refuse(text, _shown(odd, 1), hint=hint_of_character(odd, grammar))
    return text


def _is_of_word(character: str) -> bool:
    """Whether a character is one of names and numbers."""
    return character.isalnum() or character == "_"


def _tree(node: ast.expr, text: _Text, *, depth: int) -> Tree:
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
        case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name in text.grammar.arguments:
            _refuse_other_number(node, name, len(given), text)
            return ("call", name, *map(inner, given))
    return _leaf(node, text)


def _refuse_other_number(node: ast.expr, name: str, given: int, text: _Text) -> None:
    """Refuse more or fewer arguments than a function takes."""
    taken = text.grammar.arguments[name]
    if given != taken:
        _refuse(
            text,
            f"{text.source(node)} with {given} argument{'s' * (given != 1)}",
            hint=f" `{name}` takes {taken}, as in `{text.grammar.example(name)}`.",
        )


def _leaf(node: ast.expr, text: _Text) -> Tree:
    """A number or a name."""
    match node:
        case ast.Name(id=name):
            return ("number", math.pi) if name == "pi" else ("name", text.name(name))
        case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=int(column))) if type(column) is int:
            return ("name", f"{text.name(name)}[{column}]")  # A column of a variable.
    number = _number(node)
    if number is not None:
        return ("number", number)
    _refuse(text, text.source(node), hint=hint_at(node, text.grammar))


def _number(node: ast.expr) -> float | None:
    """Value of a node that is a finite number."""
    value = node.value if isinstance(node, ast.Constant) else None
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        return None
    return float(value)


def _power(node: ast.expr, text: _Text) -> int | float:
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

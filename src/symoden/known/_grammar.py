"""What formulas of one use may contain: those of a mechanism's parts are differentiated, those of columns are not."""

from dataclasses import dataclass
from typing import Final

FUNCTIONS: Final = (
    *("sin", "cos", "tan", "asin", "acos", "atan"),
    *("sinh", "cosh", "tanh", "exp", "log", "sqrt", "abs"),
)
"""Functions that all formulas may use."""


@dataclass(frozen=True)
class Grammar:
    """What formulas may contain beside numbers, `pi`, names, parentheses, + - * / ** and the `FUNCTIONS`.

    Attributes:
        more: Further functions with names of their arguments, such as "min(a, b)".
        quotes: Whether names may stand in backticks, in which they have any characters.

    Example:
        >>> Grammar(more=("min(a, b)",)).arguments["min"]
        2
    """

    more: tuple[str, ...] = ()
    quotes: bool = False

    @property
    def arguments(self) -> dict[str, int]:
        """Number of arguments of each function."""
        more = {text.partition("(")[0]: text.count(",") + 1 for text in self.more}
        return dict.fromkeys(FUNCTIONS, 1) | more

    @property
    def words(self) -> str:
        """What formulas may contain, in words."""
        names = "names (odd ones in backticks)" if self.quotes else "names"
        every = ["numbers", names, "+ - * / **", f"{', '.join(FUNCTIONS)} of one argument", *self.more]
        return f"{', '.join(every[:-1])} and {every[-1]}"

    def example(self, name: str) -> str:
        """How a function is written.

        Args:
            name: Its name.

        Returns:
            It, with names of its arguments.

        Example:
            >>> Grammar(more=("min(a, b)",)).example("min"), Grammar().example("sin")
            ('min(a, b)', 'sin(x)')
        """
        return next((text for text in self.more if text.startswith(f"{name}(")), f"{name}(x)")


KNOWN: Final = Grammar()
"""Of formulas of a mechanism's parts, which are differentiated: no further functions."""

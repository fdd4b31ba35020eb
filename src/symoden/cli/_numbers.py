"""How numbers of the command line are read, so that what is none is refused in plain words."""

from typing import Any, Final

from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

_LARGEST: Final = 2**32 - 1
"""Integer of which every generator of random numbers can be made."""


def number_rules() -> ConstructorRegistry:
    """Make tyro's rules for options that are a number, or one or none.

    Returns:
        The rules.
    """
    rules = ConstructorRegistry()
    rules.primitive_rule(_rule)
    return rules


def _rule(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    """How to read one type; nothing for those that are no numbers."""
    kinds = {int: (int, "an integer"), float: (float, "a number")}
    found = [kind for plain, kind in kinds.items() if info.type in (plain, plain | None)]
    if not found:
        return None
    ((kind, words),) = found

    def read(texts: list[str]) -> int | float:
        try:
            found = kind(texts[0])
        except ValueError:
            raise ValueError(f"must be {words}; got {texts[0]!r}") from None
        if isinstance(found, int) and abs(found) > _LARGEST:
            raise ValueError(f"must be at most {_LARGEST}; got {texts[0]}")
        return found

    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=kind.__name__.upper(),
        instance_from_str=read,
        is_instance=lambda value: value is None or isinstance(value, kind),
        str_from_instance=lambda value: [str(value)],
    )

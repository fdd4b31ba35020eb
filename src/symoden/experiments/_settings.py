"""Settings as JSON and back: dataclasses whose fields are checked one by one, so that a misspelt key fails."""

import dataclasses
import types
from typing import Any, Literal, NoReturn, TypeVar, Union, get_args, get_origin, get_type_hints

from symoden.storage import StorageError

T = TypeVar("T")


def decode(kind: type[T], value: object, where: str) -> T:
    """Make a dataclass from what JSON holds of it.

    Fields may be dataclasses, tuples, dictionaries with text as keys, literals, plain values, and each of them or None.

    Args:
        kind: The dataclass.
        value: What was read.
        where: Start of messages: the file, later the key as well.

    Returns:
        The settings, checked by the dataclass itself as well.

    Raises:
        StorageError: If a key is unknown or missing, or a value is unfit.

    Example:
        >>> @dataclasses.dataclass(frozen=True)
        ... class Settings:
        ...     widths: tuple[int, ...]
        >>> decode(Settings, {"widths": [8, 8]}, "`config.json`")
        Settings(widths=(8, 8))
    """
    if not isinstance(value, dict):
        raise StorageError(f"{where} must be an object; got {value!r}. Restore the file.")
    hints = get_type_hints(kind)
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}  # pyright: ignore[reportArgumentType]
    for name in value:
        if name not in fields:
            raise StorageError(
                f"{where} has no key `{name}`; the keys are `{', '.join(fields)}`. Correct or remove it."
            )
    for name, field in fields.items():
        required = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        if required and name not in value:
            raise StorageError(f"{where} must have the key `{name}`; found `{', '.join(value)}`. Restore the file.")
    values = {name: _value(hints[name], item, f"{where}, `{name}`") for name, item in value.items()}
    try:
        return kind(**values)
    except ValueError as error:
        raise StorageError(f"{where}: {error}") from error


def _value(hint: Any, value: object, where: str) -> Any:  # noqa: ANN401 - any annotation
    """A value fit for its annotation."""
    if get_origin(hint) in (Union, types.UnionType):
        if value is None:
            return None
        hint = next(argument for argument in get_args(hint) if argument is not types.NoneType)
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return decode(hint, value, where)
    if get_origin(hint) in (tuple, dict):
        return _container(hint, value, where)
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    fits = value in get_args(hint) if get_origin(hint) is Literal else type(value) is hint
    return value if fits else _refuse(hint, value, where)


def _container(hint: Any, value: object, where: str) -> Any:  # noqa: ANN401 - any annotation
    """A tuple or a dictionary whose values are fit for its annotation."""
    arguments = get_args(hint)
    if get_origin(hint) is dict and isinstance(value, dict):
        return {key: _value(arguments[1], item, where) for key, item in value.items()}
    if get_origin(hint) is tuple and isinstance(value, list):
        hints = arguments[:1] * len(value) if arguments[1:] == (...,) else arguments
        if len(hints) == len(value):
            return tuple(_value(item, each, where) for item, each in zip(hints, value, strict=True))
    return _refuse(hint, value, where)


def _refuse(hint: object, value: object, where: str) -> NoReturn:
    """Say what was expected."""
    expected = hint.__name__ if isinstance(hint, type) else str(hint)
    raise StorageError(f"{where} must be {expected}; got {value!r}. Restore the file.")

"""Reading TOML files, with words on what is none."""

import itertools
import re
import tomllib
from pathlib import Path
from typing import Any, Final

from symoden.data._errors import DataError

_SHOWN_CHARACTERS: Final = 80  # Of a line that is no TOML.


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Args:
        path: The file.

    Returns:
        What it says.

    Raises:
        DataError: If it cannot be read, or is none.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise DataError(f"`{path}`: cannot be read: {error.strerror or error}. Give a description's path.") from error
    except UnicodeDecodeError as error:
        raise DataError(f"`{path}`: must be a TOML file, in UTF-8; reading stopped at: {error}.") from error
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise DataError(
            f"`{path}`: must be a TOML file; reading stopped at: {error}{_line_of(error, text)}."
        ) from error


def _line_of(error: Exception, text: str) -> str:
    """The line at which a parser stopped, if it tells which; names without quotation marks are the usual mistake."""
    told = re.search(r"at line (\d+)", str(error))
    line = next(itertools.islice(text.split("\n"), int(told[1]) - 1, None), "").strip() if told else ""
    if not line:
        return ""
    single = ", with backslashes in single ones" if "\\" in line else ""
    return f", in `{line[:_SHOWN_CHARACTERS]}`. Names of columns and files stand in quotation marks{single}"

"""How large data may be: a broken or hostile file must not fill the memory, nor one number ruin a fit."""

from pathlib import Path
from typing import Final

from symoden.data._errors import DataError

LARGEST: Final = 2 << 30  # bytes of a file's contents or of one variable
LARGEST_NUMBER: Final = 1e20  # in SI or rad; beyond what any counter of 64 bits counts to, so no number of a machine


def refuse_large(path: Path, size: int, what: str) -> None:
    """Refuse contents larger than can be meant.

    Args:
        path: File, for the message.
        size: Size that the file has or claims [bytes].
        what: What has this size.

    Raises:
        DataError: If the size is beyond the limit.
    """
    if size > LARGEST:
        raise DataError(f"`{path}`: {what} must have at most {LARGEST >> 20} MiB; got {size >> 20} MiB. Split it.")

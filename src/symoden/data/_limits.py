"""How large data may be: a broken or hostile file must not fill the memory."""

from pathlib import Path
from typing import Final

from ._errors import DataError

LARGEST: Final = 2 << 30  # bytes of a file's contents or of one variable


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

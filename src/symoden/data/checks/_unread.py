"""Inputs that a description forgot."""

from collections.abc import Sequence
from typing import Final

from symoden.data._findings import Finding
from symoden.data.logs import Log
from symoden.wording import first_few, quoted

_NAMED: Final = 4


def find_unread_inputs(logs: Sequence[Log]) -> list[Finding]:
    """Say that no input is read where columns of the training files are called as forces, torques or commands are.

    Args:
        logs: What was logged.

    Returns:
        One finding, or none.
    """
    drives = list(dict.fromkeys(name for log in logs if log.part == "train" for name in log.drives))
    if not drives:
        return []
    names = first_few((f"`{name}`" for name in drives), _NAMED)
    return [
        Finding(
            kind="idle",
            level="warning",
            channel=drives[0] if len(drives) == 1 else "",
            text=f"the description has no `inputs`, and the files have {names}: what drives a machine and is not read "
            "is taken for weight, springs and friction",
            advice=f"If these drive it, name them: `inputs = [{quoted(drives[0])}]`. Else nothing need be done.",
        )
    ]

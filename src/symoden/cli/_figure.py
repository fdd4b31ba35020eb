"""Figures in files."""

import importlib.util
import io
from pathlib import Path
from typing import Any, Final

from symoden.storage import write_atomically

_FORMATS: Final = (".png", ".pdf", ".svg")
_DPI: Final = 150


def check_figure(path: Path | None) -> None:
    """Refuse a figure that could not be written, before anything takes time.

    Args:
        path: Its file, if one was asked for.

    Raises:
        ValueError: If the format is unknown, or matplotlib is not installed.
    """
    if path is None:
        return
    if path.suffix.lower() not in _FORMATS:
        raise ValueError(f"`--figure` must end in one of {', '.join(_FORMATS)}; got `{path}`.")
    if importlib.util.find_spec("matplotlib") is None:
        raise ValueError('`--figure` needs matplotlib; it is not installed. Install "symoden[plot]".')


def save_figure(figure: Any, path: Path, *, dpi: int = _DPI) -> None:  # noqa: ANN401 - only `report` knows matplotlib
    """Write a figure whole or not at all.

    Args:
        figure: Figure of matplotlib.
        path: Its file; the ending says the format.
        dpi: Resolution of what is not drawn in lines.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, format=path.suffix[1:].lower(), dpi=dpi)
    write_atomically(path, buffer.getvalue())

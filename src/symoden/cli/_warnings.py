"""Warnings of the data as lines on standard error."""

import contextlib
import sys
import warnings
from collections.abc import Iterator
from typing import TextIO

from symoden.data import DataWarning


@contextlib.contextmanager
def warnings_as_lines() -> Iterator[None]:
    """Print each `DataWarning` as one line while the context lasts; others are shown as ever.

    Yields:
        Nothing.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("always", DataWarning)
        others = warnings.showwarning

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if issubclass(category, DataWarning):
                print(f"warning: {' '.join(str(message).split())}", file=file or sys.stderr, flush=True)
            else:
                others(message, category, filename, lineno, file, line)

        warnings.showwarning = show
        yield


@contextlib.contextmanager
def said_before() -> Iterator[None]:
    """Print no `DataWarning` while the context lasts: of a run's own data `train` and `data check` say everything.

    Yields:
        Nothing.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        yield

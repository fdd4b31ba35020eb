"""The command line: parses, shows progress, prints results; the computing is done by the library."""

from ._main import main as main

__all__ = ["main"]

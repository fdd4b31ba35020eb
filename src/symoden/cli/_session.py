"""Settings of JAX for the process."""

import contextlib
import os
import warnings
from importlib.metadata import version
from pathlib import Path
from typing import Final

import jax

from symoden._jaxlib import avoid_waits, set_flag

_HALF_WRITTEN: Final = "Error reading persistent compilation cache entry"
_EMITTERS: Final = (
    "xla_cpu_use_fusion_emitters"  # Off, programs compile in half the time and run as fast (`benchmarks/`).
)
_NO_LIMIT: Final = -1  # JAX's own word for it: the user asks for none.
_LARGEST: Final = 2**30  # Of the cache [bytes].
_AFTER: Final = 0.75  # Of that, once it was exceeded: most commands then have nothing to remove.
_TRIED: Final = "0.10."  # Of jaxlib, which ends the process where it does not know a flag.


def configure(*, trains: bool = True) -> None:
    """Compute in double precision, compile fast, and keep programs in the user's cache for the next command.

    Args:
        trains: Whether the command trains, which has use for more than one thread.
    """
    if version("jaxlib").startswith(_TRIED):
        set_flag(_EMITTERS, "false")
    if not trains:
        avoid_waits()
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's signature
    if jax.config.values["jax_compilation_cache_dir"] is not None:
        return
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "symoden" / "jax"
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            jax.config.update("jax_compilation_cache_dir", str(folder))
            jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)  # Small ones are many.
            # Of one that another command is writing, or did not live to write: it is compiled, then.
            warnings.filterwarnings("ignore", _HALF_WRITTEN)
            if jax.config.values["jax_compilation_cache_max_size"] == _NO_LIMIT:
                _shrink(folder)


def _shrink(folder: Path) -> None:
    """Remove the programs that were not used for longest, if all together are too large.

    JAX's own limit needs another package, reads a file of every entry whenever it writes one (0.1 s with 6000, hundreds
    of times in a training), and fails from then on where an entry was written without it.
    """
    found: list[tuple[str, os.stat_result]] = []
    with os.scandir(folder) as entries:
        for entry in filter(os.DirEntry.is_file, entries):
            with contextlib.suppress(FileNotFoundError):  # Another command has removed it by now.
                found.append((entry.path, entry.stat()))
    size = sum(about.st_size for _, about in found)
    if size <= _LARGEST:
        return
    # Many systems tell a reading only once a day, or not at all.
    for path, about in sorted(found, key=lambda each: max(each[1].st_atime, each[1].st_mtime)):
        if size <= _AFTER * _LARGEST:
            return
        with contextlib.suppress(FileNotFoundError):
            Path(path).unlink()
        size -= about.st_size

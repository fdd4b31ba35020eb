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

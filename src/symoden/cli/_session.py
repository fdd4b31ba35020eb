"""Settings of JAX for the process."""

import contextlib
import os
from pathlib import Path

import jax

_LEAST_SECONDS = 0.5


def configure() -> None:
    """Compute in double precision, and keep compiled programs in the user's cache for the next command."""
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's signature
    if jax.config.values["jax_compilation_cache_dir"] is not None:
        return
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "symoden" / "jax"
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            jax.config.update("jax_compilation_cache_dir", str(folder))
            jax.config.update("jax_persistent_cache_min_compile_time_secs", _LEAST_SECONDS)

"""Settings of JAX and hypothesis under which every test runs, and where recorded data lie.

It is here rather than in `tests/`, so that the examples in docstrings under `src/` run under the same settings.
"""

import os
from pathlib import Path

import hypothesis
import jax
import pytest

ROOT = Path(__file__).resolve().parent


def _compilation_cache() -> Path | None:
    """Folder of the user's cache for compiled programs; `None` where it cannot be written."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "symoden" / "tests"
    try:
        cache.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return cache if os.access(cache, os.W_OK) else None


jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_debug_key_reuse", True)

if (_cache := _compilation_cache()) is not None:
    jax.config.update("jax_compilation_cache_dir", str(_cache))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)

# The same examples on every machine; no deadline, because the first call of a test compiles.
hypothesis.settings.register_profile("symoden", derandomize=True, deadline=None, max_examples=50, print_blob=True)
hypothesis.settings.load_profile("symoden")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the recorded data sets; tests that need one are skipped where it is absent."""
    named = os.environ.get("SYMODEN_DATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"recorded data: no folder {folder}; name it by the environment variable SYMODEN_DATA")
    return folder

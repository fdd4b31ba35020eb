"""Settings of JAX and hypothesis under which every test runs, what it may leave behind, and where recorded data lie.

It is here rather than in `tests/`, so that the examples in docstrings under `src/` run under the same settings.
"""

import gc
import importlib.metadata
import os
from pathlib import Path
from typing import Any

import hypothesis
import jax
import jaxtyping
import pytest

ROOT = Path(__file__).resolve().parent
_MOST_MAPS = 8_000  # A file of tests adds up to 8 000; Linux ends a process's maps at 65 530.


def _compilation_cache() -> Path | None:
    """Folder of the user's cache for compiled programs; `None` where it cannot be written."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    # Each worker has its own: JAX does not write entries atomically, and another process may read half of one.
    cache = home / "symoden" / "tests" / os.environ.get("PYTEST_XDIST_WORKER", "main")
    try:
        cache.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return cache if os.access(cache, os.W_OK) else None


# Most programs here run once: compiling them takes most of the time, and so a third of it. JAX reads it when it begins.
if "XLA_FLAGS" not in os.environ and importlib.metadata.version("jaxlib").startswith("0.10."):
    flags = {
        "xla_cpu_use_fusion_emitters": "false",
        "xla_backend_optimization_level": "0",
        "xla_cpu_parallel_codegen_split_count": "1",
    }
    os.environ["XLA_FLAGS"] = " ".join(f"--{name}={value}" for name, value in flags.items())

# The import hook would decorate functions within functions at every call: in some files a third of the time.
_jaxtyped = jaxtyping.jaxtyped


def _jaxtyped_by_modules(*functions: Any, **settings: Any) -> Any:
    """Check annotations of functions and classes of modules, not of those within functions."""
    decorated = _jaxtyped(*functions, **settings)
    return decorated if functions else lambda each: each if "<locals>" in each.__qualname__ else decorated(each)


jaxtyping.jaxtyped = _jaxtyped_by_modules

# Traced programs are millions of objects that live on: to look for garbage among them takes a tenth of the time.
gc.set_threshold(50_000, 20, 50)

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")

if (_cache := _compilation_cache()) is not None:
    jax.config.update("jax_compilation_cache_dir", str(_cache))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)

# The same examples on every machine; no deadline, because the first call of a test compiles.
hypothesis.settings.register_profile("symoden", derandomize=True, deadline=None, max_examples=30, print_blob=True)
hypothesis.settings.load_profile("symoden")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the one that takes minutes, so that no worker waits for it at the end."""
    items.sort(key=lambda item: item.path.name != "test_tutorial.py")


@pytest.fixture(scope="module", autouse=True)
def _few_memory_maps():
    """Forget compiled programs before the process has as many memory maps as Linux allows, where LLVM crashes."""
    yield
    try:
        maps = Path("/proc/self/maps").read_bytes().count(b"\n")
    except OSError:  # Other systems have no such file, nor the limit.
        return
    if maps > _MOST_MAPS:
        jax.clear_caches()
        gc.collect()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the recorded data sets; tests that need one are skipped where it is absent."""
    named = os.environ.get("SYMODEN_DATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"recorded data: no folder {folder}; name it by the environment variable SYMODEN_DATA")
    return folder

"""What a result was computed on."""

import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Final

_CPUINFO: Final = Path("/proc/cpuinfo")
_MEMINFO: Final = Path("/proc/meminfo")
_PACKAGES: Final = ("symoden", "jax", "numpy")


def machine_facts() -> dict[str, str]:
    """Name the processor, its cores, the memory, and the versions of Python and of the packages that matter.

    Returns:
        Facts by name, as text; what the operating system does not tell is left out.

    Example:
        >>> machine_facts()["symoden"] == version("symoden")
        True
    """
    processor = _field(_CPUINFO, "model name") or platform.processor() or platform.machine()
    memory = _field(_MEMINFO, "MemTotal")
    gibibytes = {"memory": f"{int(memory.split()[0]) / 2**20:.0f} GiB"} if memory else {}
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "processor": processor,
        "cores": str(cores),
        **gibibytes,
        "Python": platform.python_version(),
        **{name: version(name) for name in _PACKAGES},
    }


def _field(path: Path, name: str) -> str | None:
    """First value of a field in one of Linux's tables; None where there is none."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    values = (line.partition(":")[2].strip() for line in lines if line.startswith(name))
    return next(values, None)

"""What must be said to faulty versions of jaxlib before they start."""

import os
from importlib.metadata import PackageNotFoundError, version
from typing import Final

_FAULTY: Final = ("0.10.2", "0.11.0")
_FEW: Final = 8  # Cores.
_FUSIONS: Final = "xla_cpu_experimental_ynn_fusion_type"


def avoid_faults() -> None:
    """Keep reductions from a library that ends the process on some processors.

    These versions hand sums of single-precision arrays of many axes to YNNPACK, which reads beyond its arrays where one
    axis has a single entry (jax-ml/jax#39257, #40412): Jacobians of robots do. What the user says of it holds. JAX
    reads the variable when it first computes; other versions may not know the flag, which would end the process.
    """
    try:
        faulty = version("jaxlib") in _FAULTY
    except PackageNotFoundError:
        return
    if faulty:
        set_flag(_FUSIONS, "-reduce")


def avoid_waits() -> None:
    """Give XLA one thread where there are few, unless the user says how many.

    A batch of triangular systems waits for parts that it leaves to the threads that run it (`lapack_dtrsm_ffi` of
    0.10.2). Two at once, on two cores, waited for each other without end in the report of a robot; as many must be
    under way as there are threads. The models' own inverses need none (`symoden.blocks.inverse_of_positive`), and so
    training none at once; determinants and general systems do. XLA reads the variable when it first computes.
    """
    if (os.cpu_count() or 1) <= _FEW:
        os.environ.setdefault("NPROC", "1")


def set_flag(name: str, value: str) -> None:
    """Set a flag of XLA's in the environment, unless the user says something of it.

    Args:
        name: Name of the flag.
        value: Its value.
    """
    flags = os.environ.get("XLA_FLAGS", "")
    if name not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} --{name}={value}".strip()

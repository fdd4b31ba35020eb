"""Learn the inertia, potential energy, actuation and friction of a mechanism from its logs.

The everyday names are offered here and imported when they are first used (PEP 562), so that
`import symoden` and `symoden --help` load no JAX. Type checkers read `__init__.pyi`.

Example:
    >>> import symoden
    >>> "Pendulum" in dir(symoden)
    True
"""

import importlib
from typing import Final

from ._jaxlib import avoid_faults

avoid_faults()

_PACKAGES: Final = (
    "blocks", "control", "data", "drawing", "envs", "evaluation", "experiments", "integrate", "known", "mechanics",
    "models", "report", "shapes", "spaces", "storage", "systems", "testing", "training", "units", "wording",
)  # fmt: skip
_EXPORTS: Final[dict[str, str]] = {
    "Acrobot": "symoden.systems",
    "CartPole": "symoden.systems",
    "Dataset": "symoden.data",
    "KnownParts": "symoden.known",
    "ModelConfig": "symoden.models",
    "Pendulum": "symoden.systems",
    "Space": "symoden.spaces",
    "TrainingConfig": "symoden.training",
    "Trajectory": "symoden.data",
    "build": "symoden.models",
    "check_dataset": "symoden.data",
    "design": "symoden.control",
    "fit": "symoden.training",
    "infer_bands": "symoden.evaluation",
    "load": "symoden.models",
    "predict": "symoden.evaluation",
    "read_dataset": "symoden.data",
    "read_urdf": "symoden.known",
    "rescale": "symoden.models",
    "rollout": "symoden.integrate",
    "run_episodes": "symoden.control",
    "save": "symoden.models",
    "write_dataset": "symoden.data",
    "write_urdf": "symoden.evaluation",
}


def __getattr__(name: str) -> object:
    """Import an everyday name or a package, or read the version, at its first use.

    Args:
        name: Attribute that the module does not have yet.

    Returns:
        The object that the name stands for; it is kept, so that the next use is a plain look-up.

    Raises:
        AttributeError: If `symoden` offers no such name.
    """
    if name == "__version__":
        value: object = importlib.import_module("importlib.metadata").version("symoden")
    elif name in _PACKAGES:
        try:
            value = importlib.import_module(f"symoden.{name}")
        except ImportError as error:  # Of what is optional: `hasattr` and `help` go on.
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}: {error}") from error
    elif name in _EXPORTS:
        value = getattr(importlib.import_module(_EXPORTS[name]), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """All names, imported already or not."""
    return sorted({*globals(), *_EXPORTS, *_PACKAGES, "__version__"})

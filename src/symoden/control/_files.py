"""Controller files: what was tried is what runs on the machine."""

from pathlib import Path
from typing import Final

import equinox as eqx
import jax
import jax.numpy as jnp

from symoden.models import MODULES, FileFormat

from ._controller import AbstractController
from ._expansion import Expansion
from ._follower import Follower
from ._handover import Handover
from ._ida_pbc import IdaPbc
from ._lagrangian import ControlledLagrangian
from ._pumps import CollocatedPump, EnergyPump
from ._regulator import Regulator
from ._shaping import EnergyShaping
from ._tracking import Tracking

_FORMAT: Final = FileFormat(
    "symoden-controller-1",
    "controller",
    (
        *MODULES,
        Regulator,
        EnergyShaping,
        Handover,
        EnergyPump,
        CollocatedPump,
        Follower,
        Tracking,
        IdaPbc,
        ControlledLagrangian,
        Expansion,
    ),
    "Make it anew where it runs: `symoden.design(model, target, …)`.",
)


def save_controller(path: Path | str, controller: AbstractController) -> None:
    """Save a controller: its gains, its plan, its limits and the model that it was made from.

    Args:
        path: The file, by custom `….safetensors`.
        controller: A controller of a learned model.

    Raises:
        StorageError: If the file cannot be written, or the controller contains code: a system's equations in Python, or
            the reference of a tracking controller.

    Example:
        >>> import tempfile
        >>> from symoden.models import ModelConfig, build
        >>> from symoden.spaces import Space
        >>> model = build(ModelConfig(), Space.parse("T1"), 1, key=jax.random.key(0))
        >>> controller = EnergyShaping.of(model, [0.5], limits=20.0)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     save_controller(f"{folder}/controller.safetensors", controller)
        ...     copy = load_controller(f"{folder}/controller.safetensors")
        >>> bool(eqx.tree_equal(controller, copy))
        True
    """
    _FORMAT.write(path, controller)


def load_controller(path: Path | str) -> AbstractController:
    """Load a controller that `save_controller`, or `symoden control --out`, wrote.

    Args:
        path: The file.

    Returns:
        The controller. `Compiled` makes of it what a machine calls.

    Raises:
        StorageError: If the file is absent, damaged, or describes no controller.
    """
    return _FORMAT.read(path, _try_out)


def _try_out(controller: object) -> None:
    """Trace one call, which fails where shapes do not fit together."""
    if not isinstance(controller, AbstractController):
        raise TypeError(f"the structure is a {type(controller).__name__}, not a controller")
    state = jax.ShapeDtypeStruct((controller.space.size,), jnp.asarray(controller.limits).dtype)
    eqx.filter_eval_shape(controller, state, state)

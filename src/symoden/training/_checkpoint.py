"""Checkpoints: the state of training as a file that is whole or absent."""

from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from symoden.storage import StorageError, load_arrays, save_arrays

from ._state import TrainingState


def save_checkpoint(path: Path, state: TrainingState, *, seconds: float) -> None:
    """Write the state of training.

    Args:
        path: The file.
        state: What a resumed run needs.
        seconds: Time spent so far [s].

    Raises:
        StorageError: If it cannot be written; the checkpoint before is then unchanged.
    """
    leaves = [leaf for leaf in jax.tree.leaves(state) if eqx.is_array(leaf)]
    plain = {
        "stage": state.stage,
        "step": state.step,
        "damping": state.damping,
        "substeps": state.substeps,
        "level": repr(state.level),
        "best_loss": repr(state.best_loss),
        "origin": state.origin,
        "incumbent": state.incumbent.origin,
        "incumbent_level": repr(state.incumbent.level),
        "stale": state.stale,
        "seconds": seconds,
    }
    save_arrays(path, {f"{i:04d}": np.asarray(leaf) for i, leaf in enumerate(leaves)}, plain)


def read_progress(path: Path) -> tuple[int, float]:
    """Stage in progress and time spent, without the arrays' meaning.

    Args:
        path: The checkpoint.

    Returns:
        Index of the stage, and seconds.

    Raises:
        StorageError: If the file is absent or damaged.
    """
    _, plain = load_arrays(path)
    return int(plain["stage"]), float(plain["seconds"])


def load_checkpoint(path: Path, like: TrainingState) -> TrainingState:
    """Read the state of training.

    Args:
        path: The file.
        like: A state at the start of the same stage, which has the structure.

    Returns:
        The saved state.

    Raises:
        StorageError: If the file is absent or damaged, or comes from other settings.
    """
    arrays, plain = load_arrays(path)
    leaves, structure = jax.tree.flatten(like)
    shapes = [(leaf.shape, str(leaf.dtype)) for leaf in leaves if eqx.is_array(leaf)]
    saved = [arrays[name] for name in sorted(arrays)]
    if "level" not in plain or shapes != [(array.shape, str(array.dtype)) for array in saved]:
        raise StorageError(
            f"`{path}` must be a checkpoint of the same settings and version; its contents differ. Start a new run."
        )
    restored = iter(saved)
    state = structure.unflatten([jnp.asarray(next(restored)) if eqx.is_array(leaf) else leaf for leaf in leaves])
    return state._replace(
        stage=int(plain["stage"]),
        step=int(plain["step"]),
        damping=float(plain["damping"]),
        substeps=int(plain["substeps"]),
        level=float(plain["level"]),
        best_loss=float(plain["best_loss"]),
        origin=int(plain["origin"]),
        incumbent=state.incumbent._replace(origin=int(plain["incumbent"]), level=float(plain["incumbent_level"])),
        stale=int(plain["stale"]),
    )

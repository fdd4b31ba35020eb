"""Checkpoints: the state of training as a file that is whole or absent."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from symoden.storage import StorageError, load_arrays, save_arrays

from ._config import Span
from ._state import Findings, TrainingState

_NUMBERS = {
    "stage": int,
    "step": int,
    "damping": float,
    "substeps": int,
    "best_loss": float,
    "origin": int,
    "stale": int,
}


def save_checkpoint(
    path: Path,
    state: TrainingState,
    findings: Findings,
    *,
    stages: Sequence[str],
    origin: str,
    left_out: tuple[Sequence[Span], int],
    seconds: float,
) -> None:
    """Write the state of training.

    Args:
        path: The file.
        state: What a resumed run needs.
        findings: What the stages so far have come to.
        stages: Names of all stages.
        origin: What tells the data and settings from others.
        left_out: Spans of the recordings that nothing is learned from, and how often it looks for more.
        seconds: Time spent so far [s].

    Raises:
        StorageError: If it cannot be written; the checkpoint before is then unchanged.
    """
    leaves = [leaf for leaf in jax.tree.leaves(state) if eqx.is_array(leaf)]
    plain = {name: repr(getattr(state, name)) for name in _NUMBERS}
    plain |= {"incumbent_origin": repr(state.incumbent.origin), "seconds": repr(seconds)}
    plain |= {"stages": ", ".join(stages), "data and settings": origin, "findings": json.dumps(findings)}
    plain |= {"left out": json.dumps(left_out)}
    save_arrays(path, {f"{i:04d}": np.asarray(leaf) for i, leaf in enumerate(leaves)}, plain)


def read_left_out(path: Path, origin: str, given: tuple[Span, ...] | None) -> tuple[tuple[Span, ...], int]:
    """Spans of the recordings that a checkpoint's training learns nothing from, and how often it looks for more.

    Args:
        path: The checkpoint.
        origin: What tells the data and settings from others.
        given: What settings say of the spans; None for what training has found.

    Returns:
        Both.

    Raises:
        StorageError: If the file is absent or damaged, or comes from other data or settings, or another version.
    """
    _, plain = load_arrays(path)
    found, rounds = _parsed(path, plain, {"left out": _left_out})["left out"]
    if plain.get("data and settings") != origin or given not in {None, found}:
        raise StorageError(_foreign(path))
    return found, rounds


def read_progress(path: Path, stages: Sequence[str], origin: str) -> tuple[int, float, Findings]:
    """Stage in progress, time spent and what the stages before have come to, without the arrays' meaning.

    Args:
        path: The checkpoint.
        stages: Names of all stages.
        origin: What tells the data and settings from others.

    Returns:
        Index of the stage, seconds, and what is said of the stages before.

    Raises:
        StorageError: If the file is absent or damaged, or comes from other data or settings, or another version.
    """
    _, plain = load_arrays(path)
    # Of another version's stages the same number is another one.
    if (plain.get("stages"), plain.get("data and settings")) != (", ".join(stages), origin):
        raise StorageError(_foreign(path))
    found = _parsed(path, plain, {"stage": int, "seconds": float, "findings": _findings})
    return found["stage"], found["seconds"], found["findings"]


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
    if shapes != [(array.shape, str(array.dtype)) for array in saved]:
        raise StorageError(_foreign(path))
    restored = iter(saved)
    state = structure.unflatten([jnp.asarray(next(restored)) if eqx.is_array(leaf) else leaf for leaf in leaves])
    origin = _parsed(path, plain, {"incumbent_origin": int})["incumbent_origin"]
    return state._replace(**_parsed(path, plain, _NUMBERS), incumbent=state.incumbent._replace(origin=origin))


def _left_out(text: str) -> tuple[tuple[Span, ...], int]:
    """Spans of recordings, and rounds, as they were written."""
    spans, rounds = json.loads(text)
    return tuple((str(name), float(start), float(end)) for name, start, end in spans), int(rounds)


def _findings(text: str) -> Findings:
    """What the stages have come to, as it was written."""
    outcome, verdicts, hardly, advice = json.loads(text)
    return Findings(outcome, dict(verdicts), tuple(hardly), str(advice))


def _parsed(path: Path, plain: dict, kinds: dict[str, Callable]) -> dict:
    """Numbers and the like of a checkpoint by name."""
    try:
        return {name: kind(plain[name]) for name, kind in kinds.items()}
    except (KeyError, TypeError, ValueError) as error:
        raise StorageError(_foreign(path)) from error


def _foreign(path: Path) -> str:
    """What to say of a checkpoint that something else wrote."""
    return (
        f"`{path}` must be a checkpoint of the same data, settings and version; it is one of others. Go on with those, "
        "or start anew in another folder."
    )

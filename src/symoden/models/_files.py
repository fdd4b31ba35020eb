"""Model files: safetensors whose metadata hold the structure, so that loading rebuilds a model without running code."""

import dataclasses
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from symoden import blocks
from symoden.mechanics import AbstractDynamics
from symoden.spaces import Space
from symoden.storage import StorageError, load_arrays, save_arrays

from ._baselines import GeometricModel, NaiveModel
from ._structured import StructuredModel
from ._unstructured import UnstructuredModel

_FORMAT = "symoden-model-1"
_MODULES: dict[str, type[eqx.Module]] = {
    module.__name__: module
    for module in (
        Space,
        StructuredModel,
        UnstructuredModel,
        NaiveModel,
        GeometricModel,
        blocks.Known,
        blocks.Perceptron,
        blocks.Network,
        blocks.Harmonics,
        blocks.Polynomial,
        blocks.FourierSeries,
        blocks.Constant,
        blocks.Correction,
        blocks.Sum,
        blocks.Reduced,
        blocks.KnownValue,
        blocks.ScalarBlock,
        blocks.MatrixBlock,
        blocks.CholeskyBlock,
        blocks.GramBlock,
        blocks.ViscousFriction,
        blocks.JointFriction,
        blocks.NoFriction,
        blocks.Formula,
        blocks.FormulaBlock,
        blocks.FormulaFriction,
        blocks.Parameters,
        blocks.Links,
        blocks.LinksBlock,
        blocks.InverseBlock,
        blocks.CorrectedBlock,
        blocks.CorrectedMatrix,
        blocks.CorrectedFriction,
        blocks.Congruence,
    )
}

_LADDER = {1: blocks.FRICTION, 2: blocks.DIRECTIONS}  # Rungs that corrections but networks had in older files.


def save(path: Path | str, model: AbstractDynamics) -> None:
    """Save a model: its weights, its scaling and its structure.

    Args:
        path: The file, by custom `model.safetensors`.
        model: A model composed of this library's blocks.

    Raises:
        StorageError: If the file cannot be written, or the model contains code (a given Python function) or foreign
            classes.

    Example:
        >>> import tempfile
        >>> from symoden.models import ModelConfig, build
        >>> model = build(ModelConfig(), Space.parse("T1"), 1, key=jax.random.key(0))
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     save(f"{folder}/model.safetensors", model)
        ...     copy = load(f"{folder}/model.safetensors")
        >>> bool(eqx.tree_equal(model, copy))
        True
    """
    arrays: dict[str, np.ndarray] = {}
    structure = _describe(model, "model", arrays)
    save_arrays(path, arrays, {"format": _FORMAT, "structure": structure})


def check_savable(model: AbstractDynamics) -> None:
    """Refuse a model that `save` would refuse, before training makes it worth saving.

    Args:
        model: Any model.

    Raises:
        StorageError: If it contains code or foreign classes.
    """
    _describe(model, "model", {})


def load(path: Path | str) -> AbstractDynamics:
    """Load a model that `save` wrote.

    Args:
        path: The file.

    Returns:
        The model; its arrays have the precision that they were saved with, as far as JAX's settings allow it.

    Raises:
        StorageError: If the file is absent, damaged, or describes no model.
    """
    arrays, metadata = load_arrays(path)
    if metadata.get("format") != _FORMAT:
        raise StorageError(f"`{path}` must be a model file of format {_FORMAT}; got {metadata.get('format')!r}.")
    if not all(np.isfinite(array).all() for array in arrays.values()):
        raise StorageError(f"`{path}` must have finite weights; some are NaN or infinite. Retrain the model.")
    try:
        model = _restore(metadata["structure"], arrays)
        if not isinstance(model, AbstractDynamics):
            raise StorageError(f"the structure is a {type(model).__name__}, not a model")
        _try_out(model)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise StorageError(
            f"`{path}` must describe a model of this version; {error}. Retrain or convert it."
        ) from error
    return model


def _describe(node: object, path: str, arrays: dict[str, np.ndarray]) -> Any:  # noqa: ANN401 - JSON
    """Structure of a tree as JSON, its arrays being collected by their path."""
    if isinstance(node, eqx.Module) and _MODULES.get(type(node).__name__) is type(node):
        fields = {
            f.name: _describe(getattr(node, f.name), f"{path}.{f.name}", arrays)
            for f in dataclasses.fields(node)
            if f.init  # The others follow from these: a formula's text is kept, and read again.
        }
        return {"module": type(node).__name__, "fields": fields}
    if isinstance(node, tuple):
        return [_describe(item, f"{path}.{i}", arrays) for i, item in enumerate(node)]
    if eqx.is_array(node):
        arrays[path] = np.asarray(node)
        return {"array": path}
    if node is None or isinstance(node, bool | int | float | str):
        return node
    raise StorageError(
        f"`{path}` must be data to be saved; got {type(node).__name__}, which is code. "
        "Give known parts as formulas, or save the weights of the learned blocks and compose the model after loading."
    )


def _restore(description: Any, arrays: dict[str, np.ndarray]) -> Any:  # noqa: ANN401 - JSON
    """Tree of a structure; only the classes of this library are ever built."""
    if isinstance(description, list):
        return tuple(_restore(item, arrays) for item in description)
    if not isinstance(description, dict):
        return description
    if "array" in description:
        return jnp.asarray(arrays[description["array"]])
    module = _MODULES[description["module"]]
    fields = {name: _restore(value, arrays) for name, value in description["fields"].items()}
    if "rung" in fields:
        rung = fields.pop("rung")
        fields["kind"] = blocks.NETWORKS if isinstance(fields["function"], blocks.Network) else _LADDER[rung]
    return module(**fields)


def _try_out(model: AbstractDynamics) -> None:
    """Trace one derivative, which fails where shapes do not fit together."""
    n, m = model.space.size, model.inputs
    dtype = jnp.result_type(*jax.tree.leaves(eqx.filter(model, eqx.is_inexact_array)))
    rates, u = jax.ShapeDtypeStruct((n,), dtype), jax.ShapeDtypeStruct((m,), dtype)

    def once(q: jax.Array, rates: jax.Array, u: jax.Array) -> jax.Array:
        state = model.encode(q, rates)
        return model.derivative(jnp.zeros((), q.dtype), state, u)

    eqx.filter_eval_shape(once, rates, rates, u)

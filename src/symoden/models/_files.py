"""Model files."""

from pathlib import Path
from typing import Final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from symoden import blocks
from symoden.mechanics import AbstractDynamics
from symoden.spaces import Space
from symoden.storage import StorageError

from ._baselines import GeometricModel, NaiveModel
from ._structured import StructuredModel
from ._trees import FileFormat
from ._unstructured import UnstructuredModel

MODULES: Final[tuple[type[eqx.Module], ...]] = (
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
"""Classes that a model file may be made of."""

_FORMAT: Final = FileFormat(
    "symoden-model-1",
    "model",
    MODULES,
    "Give known parts as formulas, or save the weights of the learned blocks and compose the model after loading.",
)


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
    _FORMAT.write(path, model)


def check_savable(model: AbstractDynamics) -> None:
    """Refuse a model that `save` would refuse, before training makes it worth saving.

    Args:
        model: Any model.

    Raises:
        StorageError: If it contains code or foreign classes.
    """
    _FORMAT.check(model)


def load(path: Path | str) -> AbstractDynamics:
    """Load a model that `save` wrote.

    Args:
        path: The file.

    Returns:
        The model; its arrays have the precision that they were saved with, as far as JAX's settings allow it.

    Raises:
        StorageError: If the file is absent, damaged, or describes no model.
    """
    model = _FORMAT.read(path, _try_out)
    if not all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(eqx.filter(model, eqx.is_array))):
        raise StorageError(f"`{path}` must have finite weights; some are NaN or infinite. Retrain the model.")
    return model


def _try_out(model: object) -> None:
    """Trace one derivative, which fails where shapes do not fit together."""
    if not isinstance(model, AbstractDynamics):
        raise TypeError(f"the structure is a {type(model).__name__}, not a model")
    n, m = model.space.size, model.inputs
    dtype = jnp.result_type(*jax.tree.leaves(eqx.filter(model, eqx.is_inexact_array)))
    rates, u = jax.ShapeDtypeStruct((n,), dtype), jax.ShapeDtypeStruct((m,), dtype)

    def once(q: jax.Array, rates: jax.Array, u: jax.Array) -> jax.Array:
        state = model.encode(q, rates)
        return model.derivative(jnp.zeros((), q.dtype), state, u)

    eqx.filter_eval_shape(once, rates, rates, u)

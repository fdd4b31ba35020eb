"""Model files: what is saved comes back, and what is no model is refused."""

import errno
import json
import os

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import DIRECTIONS, FRICTION, NETWORKS, KnownFunction
from symoden.models import load, save
from symoden.storage import StorageError, load_arrays, save_arrays
from symoden.systems import Pendulum

NAMES = ["joint", "viscous", "full", "paper", "frictionless", "unstructured", "geometric", "naive"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("dtype", [jnp.float64, jnp.float32])
def test_a_model_comes_back_bit_for_bit(name, dtype, small_model, scrambled, tmp_path):
    model = jax.tree.map(lambda x: x.astype(dtype), scrambled(small_model(name), 4))
    save(tmp_path / "model.safetensors", model)
    assert eqx.tree_equal(load(tmp_path / "model.safetensors"), model)


def test_a_double_model_loads_in_single_precision(small_model, tmp_path):
    path = tmp_path / "model.safetensors"
    save(path, small_model("joint"))
    with jax.enable_x64(False):
        assert {leaf.dtype for leaf in jax.tree.leaves(load(path))} == {np.dtype(np.float32)}


def test_an_overwritten_model_is_the_new_one(small_model, scrambled, tmp_path):
    path = tmp_path / "model.safetensors"
    for seed in (1, 2):
        save(path, scrambled(small_model("joint"), seed))
    assert eqx.tree_equal(load(path), scrambled(small_model("joint"), 2))
    assert [found.name for found in tmp_path.iterdir()] == ["model.safetensors"]


def other_class(structure, arrays):
    structure["fields"]["potential"]["module"] = "os.system"


def known_class_elsewhere(structure, arrays):
    structure["fields"]["friction"] = structure["fields"]["space"]


def missing_field(structure, arrays):
    del structure["fields"]["potential"]


def foreign_field(structure, arrays):
    structure["fields"]["command"] = "rm"


def wrong_shape(structure, arrays):
    name = next(name for name in arrays if "weights" in name)
    arrays[name] = arrays[name][:-1]


def missing_array(structure, arrays):
    arrays.pop(next(iter(arrays)))


def no_model(structure, arrays):
    inner = structure["fields"]["space"]
    structure.clear()
    structure.update(inner)


def other_activation(structure, arrays):
    structure["fields"]["potential"]["fields"]["function"]["fields"]["perceptron"]["fields"]["activation"] = "eval"


CHANGES = [
    other_class,
    known_class_elsewhere,
    missing_field,
    foreign_field,
    wrong_shape,
    missing_array,
    no_model,
    other_activation,
]


@pytest.mark.parametrize("change", CHANGES)
def test_a_structure_that_is_no_model_is_refused(change, small_model, tmp_path):
    path = tmp_path / "model.safetensors"
    save(path, small_model("viscous"))
    arrays, metadata = load_arrays(path)
    change(metadata["structure"], arrays)
    save_arrays(path, arrays, metadata)
    with pytest.raises(StorageError, match="must describe a model of this version"):
        load(path)


def test_friction_of_older_files_has_no_direction(small_model, scrambled, tmp_path):
    path, model = tmp_path / "model.safetensors", scrambled(small_model("joint"), 1)
    silent = eqx.tree_at(lambda model: model.friction.directions, model, None)
    save(path, silent)
    arrays, metadata = load_arrays(path)
    assert metadata["structure"]["fields"]["friction"]["fields"].pop("directions", "absent") is None
    save_arrays(path, arrays, metadata)
    assert eqx.tree_equal(load(path), silent)


@pytest.mark.parametrize("networks", [2, 3])
def test_corrections_of_older_files_stand_on_rungs(small_model, scrambled, tmp_path, networks):
    path, model = tmp_path / "model.safetensors", scrambled(small_model("joint"), 1)
    save(path, model)
    arrays, metadata = load_arrays(path)
    text = json.dumps(metadata["structure"])
    for rung, kind in ((1, FRICTION), (2, DIRECTIONS), (networks, NETWORKS)):
        assert f'"kind": {kind}' in text
        text = text.replace(f'"kind": {kind}', f'"rung": {rung}')
    save_arrays(path, arrays, metadata | {"structure": json.loads(text)})
    assert eqx.tree_equal(load(path), model)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_weights_that_are_no_numbers_are_refused(value, small_model, tmp_path):
    path = tmp_path / "model.safetensors"
    save(path, small_model("viscous"))
    arrays, metadata = load_arrays(path)
    next(iter(arrays.values())).flat[0] = value
    save_arrays(path, arrays, metadata)
    with pytest.raises(StorageError, match="finite weights"):
        load(path)


def test_another_format_is_refused(tmp_path):
    save_arrays(tmp_path / "other", {}, {"format": "symoden-model-0"})
    with pytest.raises(StorageError, match="must be a model file of format"):
        load(tmp_path / "other")


def test_code_is_not_saved(small_model, tmp_path):
    model = eqx.tree_at(lambda model: model.potential, small_model("joint"), KnownFunction(jnp.sum))
    with pytest.raises(StorageError, match=r"`model\.potential` must be data"):
        save(tmp_path / "model", model)
    with pytest.raises(StorageError, match="Pendulum"):
        save(tmp_path / "model", Pendulum())
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_the_old_model(small_model, scrambled, tmp_path, monkeypatch):
    path, model = tmp_path / "model.safetensors", small_model("joint")
    save(path, model)

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(StorageError, match="No space left"):
            save(path, scrambled(model, 1))
    assert eqx.tree_equal(load(path), model)
    assert [found.name for found in tmp_path.iterdir()] == ["model.safetensors"]

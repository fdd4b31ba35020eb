"""Trees of modules as safetensors whose metadata hold the structure: loading rebuilds them without running code."""

import dataclasses
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from symoden import blocks
from symoden.storage import StorageError, load_arrays, save_arrays

_LADDER = {1: blocks.FRICTION, 2: blocks.DIRECTIONS}  # Rungs that corrections but networks had in older files.


@final
@dataclass(frozen=True)
class FileFormat:
    """A kind of file that holds one module of this library.

    Attributes:
        name: What the file calls it.
        holds: What it holds, in a word.
        modules: Classes that it may be made of; no others are ever built.
        instead: What to do with what cannot be saved.
    """

    name: str
    holds: str
    modules: tuple[type[eqx.Module], ...]
    instead: str

    @functools.cached_property
    def _by_name(self) -> Mapping[str, type[eqx.Module]]:
        """The classes by the names that files have them by."""
        return {module.__name__: module for module in self.modules}

    def write(self, path: Path | str, module: eqx.Module) -> None:
        """Write a file.

        Args:
            path: The file.
            module: What to write.

        Raises:
            StorageError: If it cannot be written, or the module contains code or foreign classes.
        """
        arrays: dict[str, np.ndarray] = {}
        structure = self._describe(module, self.holds, arrays)
        save_arrays(path, arrays, {"format": self.name, "structure": structure})

    def check(self, module: eqx.Module) -> None:
        """Refuse what `write` would refuse.

        Args:
            module: What is to be written.

        Raises:
            StorageError: If it contains code or foreign classes.
        """
        self._describe(module, self.holds, {})

    def read(self, path: Path | str, try_out: Callable[[Any], None]) -> Any:  # noqa: ANN401 - `try_out` knows its class
        """Read what `write` wrote.

        Args:
            path: The file.
            try_out: Raises an error where what was read does not work.

        Returns:
            The module; its arrays have the precision that they were saved with, as far as JAX's settings allow it.

        Raises:
            StorageError: If the file is absent, damaged, of another format, or not made of this version's classes.
        """
        arrays, metadata = load_arrays(path)
        if metadata.get("format") != self.name:
            raise StorageError(
                f"`{path}` must be a {self.holds} file of format {self.name}; got {metadata.get('format')!r}."
            )
        try:
            module = self._restore(metadata["structure"], arrays)
            try_out(module)
        except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
            raise StorageError(
                f"`{path}` must describe a {self.holds} of this version; {error}. Make it anew or convert it."
            ) from error
        return module

    def _describe(self, node: object, path: str, arrays: dict[str, np.ndarray]) -> Any:  # noqa: ANN401 - JSON
        """Structure of a tree as JSON, its arrays being collected by their path."""
        if isinstance(node, eqx.Module) and type(node) in self.modules:
            fields = {
                f.name: self._describe(getattr(node, f.name), f"{path}.{f.name}", arrays)
                for f in dataclasses.fields(node)
                if f.init  # The others follow from these: a formula's text is kept, and read again.
            }
            return {"module": type(node).__name__, "fields": fields}
        if isinstance(node, tuple):
            return [self._describe(item, f"{path}.{i}", arrays) for i, item in enumerate(node)]
        if eqx.is_array(node):
            arrays[path] = np.asarray(node)
            return {"array": path}
        if node is None or isinstance(node, bool | int | float | str):
            return node
        raise StorageError(
            f"`{path}` must be data to be saved; got {type(node).__name__}, which is code. {self.instead}"
        )

    def _restore(self, description: Any, arrays: dict[str, np.ndarray]) -> Any:  # noqa: ANN401 - JSON
        """Tree of a structure; only the classes of the format are ever built."""
        if isinstance(description, list):
            return tuple(self._restore(item, arrays) for item in description)
        if not isinstance(description, dict):
            return description
        if "array" in description:
            return jnp.asarray(arrays[description["array"]])
        module = self._by_name[description["module"]]
        fields = {name: self._restore(value, arrays) for name, value in description["fields"].items()}
        if "rung" in fields:
            rung = fields.pop("rung")
            fields["kind"] = blocks.NETWORKS if isinstance(fields["function"], blocks.Network) else _LADDER[rung]
        return module(**fields)

"""Rules of the code itself: layers, classes, sizes of files, what is imported where."""

import ast
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import get_origin

import equinox as eqx
import pytest

import symoden

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "symoden"
MODULES = {path.relative_to(ROOT).as_posix(): path for path in sorted(SOURCE.rglob("*.py"))}
CODE = MODULES | {path.relative_to(ROOT).as_posix(): path for path in sorted((ROOT / "tests").rglob("*.py"))}
LARGEST_FILE = 400
PARTS_WITHOUT_A_NAME = {"utils", "util", "helpers", "helper", "misc", "common", "tools"}


@pytest.fixture(scope="module")
def module_classes() -> list[type[eqx.Module]]:
    """Every class of the package that is an `eqx.Module`."""
    packages = pkgutil.walk_packages(symoden.__path__, "symoden.")
    modules = [importlib.import_module(found.name) for found in packages if not found.name.endswith("__main__")]
    members = {member for module in modules for _, member in inspect.getmembers(module, inspect.isclass)}
    ours = [member for member in members if member.__module__.startswith("symoden.")]
    return sorted((member for member in ours if issubclass(member, eqx.Module)), key=lambda c: c.__qualname__)


def _ancestors(cls: type) -> list[type]:
    """The class and those it inherits from, nearest first, down to but without `eqx.Module`."""
    return [base for base in cls.__mro__ if issubclass(base, eqx.Module) and base is not eqx.Module]


def _is_abstract(cls: type) -> bool:
    return cls.__name__.lstrip("_").startswith("Abstract")


def _members(cls: type) -> dict[str, object]:
    """What the class itself defines for use: methods and properties, not what Python or Equinox add to it."""
    wanted = (staticmethod, classmethod, property)
    mine = {name: value for name, value in vars(cls).items() if name == "__call__" or not name.startswith("__")}
    return {name: value for name, value in mine.items() if callable(value) or isinstance(value, wanted)}


def _fields(cls: type) -> set[str]:
    """Names of the fields that the class itself declares, abstract ones left out."""
    abstract = (eqx.AbstractVar, eqx.AbstractClassVar)
    declared = inspect.get_annotations(cls).items()
    return {name for name, kind in declared if get_origin(kind) not in abstract and "ClassVar" not in str(kind)}


def _calls(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and dotted name of every call."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield node.lineno, ast.unparse(node.func)


def _tracked_files() -> list[Path]:
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    answer = subprocess.run(listing, cwd=ROOT, capture_output=True, check=False, text=True)
    if answer.returncode != 0:
        pytest.skip("the sources are no git checkout")
    return [path for name in answer.stdout.split("\0") if name and (path := ROOT / name).is_file()]


# The layers


def test_imports_point_downwards_and_only_the_edges_import_plotting_and_terminal():
    program = "from importlinter.cli import lint_imports_command; lint_imports_command(['--no-logo', '--no-cache'])"
    linter = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, check=False, text=True)
    assert linter.returncode == 0, linter.stdout + linter.stderr


@pytest.mark.parametrize("module", ["symoden", "symoden.cli", "symoden.data"])
def test_importing_the_front_imports_no_jax(module):
    program = f"import sys, {module}; print([name for name in ('jax', 'jaxlib', 'equinox') if name in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False, text=True)
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.strip() == "[]"


def test_every_everyday_name_is_importable_and_in_the_stub():
    stub = ast.parse((SOURCE / "__init__.pyi").read_text())
    offered = {
        (alias.asname, node.module) for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    packages = {(name, "symoden") for name in symoden._PACKAGES}
    assert offered == set(symoden._EXPORTS.items()) | packages
    assert [name for name, _ in packages if not hasattr(symoden, name)] == []
    assert [name for name in symoden._EXPORTS if getattr(symoden, name, None) is None] == []
    assert re.match(r"\d+\.\d+\.\d+", symoden.__version__)


def test_an_unknown_name_of_the_package_is_an_attribute_error():
    misspelt = "pendulum_"
    with pytest.raises(AttributeError, match="no attribute 'pendulum_'"):
        getattr(symoden, misspelt)


# The classes


def test_modules_are_abstract_or_final(module_classes):
    assert module_classes
    neither = [cls for cls in module_classes if _is_abstract(cls) == getattr(cls, "__final__", False)]
    assert neither == []


def test_concrete_methods_are_not_overridden(module_classes):
    overridden = [
        f"{cls.__qualname__}.{name} overrides {base.__qualname__}.{name}"
        for cls in module_classes
        for name in _members(cls)
        for base in _ancestors(cls)[1:]
        if name in _members(base) and not getattr(_members(base)[name], "__isabstractmethod__", False)
    ]
    assert overridden == []


def test_fields_and_initialiser_sit_in_one_class(module_classes):
    owners = {
        cls: [base for base in _ancestors(cls) if _fields(base) or "def __init__(" in inspect.getsource(base)]
        for cls in module_classes
    }
    assert {cls: bases for cls, bases in owners.items() if len(bases) > 1} == {}


# The files


@pytest.mark.parametrize("name", CODE)
def test_a_file_is_small_and_has_a_telling_name(name):
    assert CODE[name].read_text().count("\n") <= LARGEST_FILE
    parts = {part.removesuffix(".py").strip("_") for part in Path(name).parts}
    assert not parts & PARTS_WITHOUT_A_NAME


@pytest.mark.parametrize("name", CODE)
def test_shape_checks_are_never_switched_off(name):
    futures = [n for n in ast.walk(ast.parse(CODE[name].read_text())) if isinstance(n, ast.ImportFrom)]
    assert [n.lineno for n in futures if n.module == "__future__"] == []


@pytest.mark.parametrize("name", MODULES)
def test_inheritance_stays_flat(name):
    calls = _calls(ast.parse(MODULES[name].read_text()))
    assert [line for line, function in calls if function == "super"] == []


@pytest.mark.parametrize("name", [name for name in MODULES if not name.startswith("src/symoden/cli/")])
def test_the_library_leaves_the_configuration_of_jax_alone(name):
    calls = _calls(ast.parse(MODULES[name].read_text()))
    assert [line for line, function in calls if re.search(r"(^|\.)config\.update$", function)] == []


def test_no_file_names_a_package_index_or_a_path_of_one_machine():
    # Brackets keep the patterns from finding themselves.
    index = r"pypi\.or[g]/simple|pythonhoste[d]|index-ur[l]|find-link[s]|file:/[/]"
    machine = r"(?<![\w.~)}>/-])/(?:wor[k]|roo[t]|home/\w+|User[s]/\w+|tmp/bas[h]\w*|opt/[p]y\w*)(?=/)"
    forbidden = re.compile(f"{index}|{machine}")
    found = [
        f"{path.relative_to(ROOT)}: {match.group()}"
        for path in _tracked_files()
        if b"\0" not in (content := path.read_bytes())
        for match in forbidden.finditer(content.decode(errors="replace"))
    ]
    assert found == []

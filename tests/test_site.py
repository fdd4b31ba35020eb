"""The documentation shows every public name, and its pages are those that its contents list.

`make docs` builds it, and refuses broken links; here are the rules that a build cannot know.
"""

import ast
import importlib
import inspect
import re
from pathlib import Path

import equinox as eqx
import pytest

import symoden

griffe = pytest.importorskip("griffe", reason='the documentation needs `pip install "symoden[docs]"`')
yaml = pytest.importorskip("yaml", reason='the documentation needs `pip install "symoden[docs]"`')

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "symoden"
DOCS = ROOT / "docs"
SITE = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
PAGES = {page.relative_to(DOCS).as_posix(): page.read_text() for page in sorted(DOCS.rglob("*.md"))}
PUBLIC = sorted(path.stem for path in SOURCE.iterdir() if re.fullmatch(r"[a-z]+(\.py)?", path.name))


@pytest.fixture(scope="module")
def package():
    """The package as the documentation reads it, without importing it."""
    extensions = griffe.load_extensions(*(ROOT / path for path in handler()["options"]["extensions"]))
    return griffe.load("symoden", search_paths=[SOURCE.parent], extensions=extensions)


def entries(contents):
    """Every page that the contents name, in their order."""
    for entry in contents:
        values = entry.values() if isinstance(entry, dict) else [entry]
        for value in values:
            yield from [value] if isinstance(value, str) else entries(value)


def handler():
    (settings,) = [plugin["mkdocstrings"] for plugin in SITE["plugins"] if plugin != "search"]
    return settings["handlers"]["python"]


def test_the_contents_list_every_page_once_and_no_other():
    assert sorted(entries(SITE["nav"])) == sorted(PAGES)


def test_every_public_package_has_a_page_of_the_reference():
    assert {"spaces", "models", "training", "testing"} <= set(PUBLIC)
    shown = {page: re.findall(r"^::: (\S+)$", text, re.MULTILINE) for page, text in PAGES.items()}
    assert {page: names for page, names in shown.items() if names} == {
        f"api/{name}.md": [f"symoden.{name}"] for name in PUBLIC
    }


@pytest.mark.parametrize("name", PUBLIC)
def test_a_page_of_the_reference_shows_every_public_name(name, package):
    module = package[name]
    assert module.has_docstring
    public = module.exports if module.exports is not None else defined(module)
    assert public
    rejected = re.compile("|".join(pattern.removeprefix("!") for pattern in handler()["options"]["filters"]))
    assert [each for each in public if rejected.search(each)] == []
    bare = [each for each in public if not module[each].has_docstring]
    if "show_if_no_docstring: true" not in PAGES[f"api/{name}.md"]:
        assert bare == [], "the reference leaves out what has no docstring; a constant has it on the next line"


@pytest.mark.parametrize("name", [name for name in PUBLIC if (SOURCE / name).is_dir()])
def test_a_package_lists_what_it_offers(name, package):
    imports = ast.walk(ast.parse((SOURCE / name / "__init__.py").read_text()))
    aliases = [alias for node in imports if isinstance(node, ast.ImportFrom) and node.level for alias in node.names]
    assert sorted(alias.asname for alias in aliases if alias.asname) == sorted(package[name].exports)


def defined(module):
    return [each for each, member in module.members.items() if not member.is_alias and not each.startswith("_")]


def test_the_reference_says_how_classes_are_made(package):
    shown, made = {}, {}
    for name in PUBLIC:
        for each, cls in inspect.getmembers(importlib.import_module(f"symoden.{name}"), inspect.isclass):
            member = package[name].members.get(each)
            if member is not None and issubclass(cls, eqx.Module | tuple) and not inspect.isabstract(cls):
                shown[f"{name}.{each}"] = [(field.name, field.default is None) for field in member.parameters][1:]
                signature = inspect.signature(cls).parameters.values()
                made[f"{name}.{each}"] = [(field.name, field.default is field.empty) for field in signature]
    assert len(made) > 50
    assert shown == made


def test_examples_are_shown_as_code(package):
    sections = package["spaces.Space"].docstring.parse("google")
    assert griffe.DocstringSectionKind.examples in [section.kind for section in sections]


def test_the_reference_begins_with_every_everyday_name_and_no_other():
    linked = re.findall(r"^\| \[`(\w+)`\]\[([\w.]+)\.(\w+)\] \|", PAGES["api/index.md"], re.MULTILINE)
    assert [name for name, _, target in linked if name != target] == []
    assert {name: module for name, module, _ in linked} == symoden._EXPORTS


def test_the_reference_lists_every_package():
    listed = re.findall(r"^\| \[`symoden\.(\w+)`\]\(\1\.md\) \|", PAGES["api/index.md"], re.MULTILINE)
    assert sorted(listed) == PUBLIC
    assert sorted([*symoden._PACKAGES, "cli"]) == PUBLIC


def test_the_start_page_uses_everyday_names():
    code = "\n".join(re.findall(r"^```python\n(.*?)^```$", PAGES["index.md"], re.MULTILINE | re.DOTALL))
    used = {
        node.attr
        for node in ast.walk(ast.parse(code))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "symoden"
    }
    assert used
    assert used <= set(symoden._EXPORTS)


def test_nothing_comes_from_elsewhere():
    assert SITE["theme"]["font"] is False
    assert not {"extra_javascript", "inventories"} & {*SITE, *handler()}
    assert "://" not in (ROOT / "mkdocs.yml").read_text()

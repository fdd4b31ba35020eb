"""How the API reference reads the source: two things that griffe, which does it for mkdocstrings, does not know."""

import re

import griffe

_MADE_FROM_FIELDS = {"equinox.Module", "typing.NamedTuple"}
_POSITIONAL = griffe.ParameterKind.positional_or_keyword


class Examples(griffe.Extension):
    """Docstrings have a section `Example`; the section of code to be tried is called `Examples` by griffe."""

    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        """Rename the section."""
        if obj.docstring is not None:
            obj.docstring.value = re.sub(r"^Example:$", "Examples:", obj.docstring.value, flags=re.MULTILINE)


class Constructors(griffe.Extension):
    """An `eqx.Module` or `NamedTuple` is made from its fields, as a dataclass is, without a decorator that says so."""

    def on_package(self, *, pkg: griffe.Module, **_: object) -> None:
        """Give every such class the signature of its initialiser."""
        for cls in _classes(pkg):
            if "__init__" not in cls.members and _is_made_from_fields(cls):
                own = griffe.Parameter("self", kind=_POSITIONAL)
                fields = [field for member in cls.attributes.values() if (field := _field(member)) is not None]
                fields.sort(key=lambda field: field.kind is not _POSITIONAL)
                cls.set_member("__init__", griffe.Function("__init__", parameters=griffe.Parameters(own, *fields)))


def _classes(module: griffe.Module) -> list[griffe.Class]:
    """All classes of a package."""
    mine = [cls for cls in module.classes.values() if isinstance(cls, griffe.Class)]
    inner = [part for part in module.modules.values() if isinstance(part, griffe.Module)]
    return mine + [cls for part in inner for cls in _classes(part)]


def _is_made_from_fields(cls: griffe.Class) -> bool:
    """Whether the class can be made, and from its fields."""
    bases = [base for each in (cls, *cls.mro()) for base in each.bases]
    paths = {base.canonical_path for base in bases if isinstance(base, griffe.Expr)}
    return not cls.name.startswith("Abstract") and not paths.isdisjoint(_MADE_FROM_FIELDS)


def _field(member: griffe.Attribute | griffe.Alias) -> griffe.Parameter | None:
    """The parameter that a field is of the initialiser, if it is one."""
    value = member.value
    if member.annotation is None or not member.has_labels("instance-attribute"):
        return None
    settings = {}
    if isinstance(value, griffe.ExprCall) and value.canonical_path == "equinox.field":
        settings = {part.name: part.value for part in value.arguments if isinstance(part, griffe.ExprKeyword)}
        value = settings.get("default")
    if settings.get("init") == "False":
        return None
    kind = griffe.ParameterKind.keyword_only if settings.get("kw_only") == "True" else _POSITIONAL
    return griffe.Parameter(member.name, annotation=member.annotation, kind=kind, default=value)

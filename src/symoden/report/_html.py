"""One HTML page that needs no other file: sentences, tables and figures."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from symoden.storage import write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TEMPLATE: Final = Path(__file__).parent / "page.html"


@dataclass(frozen=True, kw_only=True)
class PageTable:
    """A table of texts.

    Attributes:
        title: What it shows.
        columns: Heads of the columns.
        rows: Cells, the first of a row being its name.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True, kw_only=True, eq=False)
class PageSection:
    """A part of the page.

    Attributes:
        heading: Its heading.
        words: Paragraphs.
        figure: Its figure, if any.
        caption: What the figure shows.
        tables: Tables below it.
        folded: Whether the tables are hidden until they are asked for.
    """

    heading: str
    words: Sequence[str] = ()
    figure: "Figure | None" = None
    caption: str = ""
    tables: Sequence[PageTable] = ()
    folded: bool = False

    @property
    def drawing(self) -> str:
        """The figure as an SVG element."""
        if self.figure is None:
            return ""
        import matplotlib as mpl

        buffer = io.StringIO()
        # Equal pages from equal runs: no date, and names of elements that are not random.
        with mpl.rc_context({"svg.hashsalt": self.heading}):
            self.figure.savefig(buffer, format="svg", metadata={"Date": None})
        text = buffer.getvalue()
        return text[text.index("<svg") :]


def write_html(path: Path, *, title: str, lead: str, sections: Sequence[PageSection]) -> None:
    """Write a page.

    Args:
        path: Its file.
        title: Its title.
        lead: What it is about, in a sentence.
        sections: Its parts.

    Raises:
        ModuleNotFoundError: If Jinja2 is not installed.
        StorageError: If the file cannot be written.
    """
    try:
        import jinja2
    except ModuleNotFoundError:
        raise ModuleNotFoundError('HTML reports need Jinja2. Install "symoden[report]".') from None
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))
    text = template.render(title=title, lead=lead, sections=sections)
    write_atomically(path, text.encode())

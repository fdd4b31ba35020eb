"""Numbers as people and office programs write them: decimal commas, as in much of Europe, and the sign of minus."""

from typing import Final

import polars as pl

_COMMA: Final = r"^[+-]?\d*,\d+([eE][+-]?\d+)?$"
_POINT: Final = r"^\s*[+-]?\d*\.\d+([eE][+-]?\d+)?\s*$"
_NUMBER: Final = r"^\s*[+−-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+−-]?\d+)?\s*$"
_THOUSANDS: Final = r"^[+-]?[1-9]\d{0,2},\d{3}$"


def with_hyphens(frame: pl.DataFrame) -> pl.DataFrame:
    """Write the sign of minus (U+2212), where numbers have it, as the hyphen that computers take for it.

    Args:
        frame: Columns of text.

    Returns:
        The columns; words in them as they are.
    """
    signed = pl.all().str.replace_all("−", "-", literal=True)
    return frame.with_columns(pl.when(pl.all().str.contains(_NUMBER)).then(signed).otherwise(pl.all()))


def with_points(frame: pl.DataFrame) -> pl.DataFrame:
    """Write decimal commas as points, where a table has them throughout.

    No number of it may have a point, and one at least a comma that cannot stand for thousands.

    Args:
        frame: Columns of text, which no commas separate.

    Returns:
        The columns; the same where commas may mean something else.
    """
    commas = {name: _having_commas(frame[name]) for name in frame.columns}
    chosen = [name for name, cells in commas.items() if len(cells) and cells.str.contains(_COMMA).all()]
    certain = any(not commas[name].str.contains(_THOUSANDS).all() for name in chosen)
    if not certain or any(frame[name].str.contains(_POINT).any() for name in frame.columns):
        return frame
    return frame.with_columns(pl.col(chosen).str.replace(",", ".", literal=True))


def _having_commas(column: pl.Series) -> pl.Series:
    """Cells of a column that have a comma, without blanks around them."""
    return column.filter(column.str.contains(",", literal=True)).str.strip_chars()

"""Words that messages share."""

from collections.abc import Iterable


def first_few(names: Iterable[str], most: int) -> str:
    """Names with commas between them, an ellipsis in place of those after the first ones.

    Args:
        names: What to name.
        most: How many to name at most.

    Returns:
        The words.

    Example:
        >>> first_few("abc", 2), first_few("ab", 2)
        ('a, b, …', 'a, b')
    """
    every = list(names)
    return ", ".join(every[:most] + ["…"] * (len(every) > most))

"""Files that move otherwise than the others, whatever the reason."""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float

from ._bumps import Rows
from ._regression import held_near_zero, unseen_residuals, usual_sizes

_MANY: Final = 2  # Bumps for each number of a regression, in either half of a file and in all others.
_FEWEST: Final = 20  # Bumps that are predicted: of fewer, most is told by chance.
_FAMILIAR: Final = 5.0  # Leverage, of the mean: what is farther off cannot be told.
_MOSTLY: Final = 0.2  # Share of bumps that must be familiar, either way: below, measured files as they are fail.
_FAR: Final = 8.0  # Times the mean square of their own errors that the others' law leaves of a file,
_FARTHER: Final = 15.0  # and the file's law of the others: measured files as they are have less of one of both.
_MUCH: Final = 0.1  # Share of the accelerations' mean square that either leaves then,
_OWN: Final = 5.0  # and times what a file leaves of itself.


class Stranger(NamedTuple):
    """A file that moves otherwise than the others.

    Attributes:
        left: Share of its accelerations that these leave.
        own: Share that its own halves leave of each other.
        far: Mean square of what they leave, beside what they leave of themselves.
    """

    left: float
    own: float
    far: float


class _Moved(NamedTuple):
    """Accelerations under bumps, and what may cause them.

    Attributes:
        causes: Of motion and inputs, in units of their usual sizes.
        gained: Accelerations, likewise.
    """

    causes: Float[np.ndarray, "B k"]
    gained: Float[np.ndarray, "B n"]

    @classmethod
    def of(cls, rows: Rows) -> "_Moved":
        """Those of rows, in their own units."""
        return cls(np.concatenate([rows.motion, rows.pushed], axis=1), rows.gained)

    @classmethod
    def joined(cls, parts: "Sequence[_Moved]") -> "_Moved":
        """All of them together."""
        return cls(*map(np.concatenate, zip(*parts, strict=True)))

    def beside(self, other: "_Moved") -> "_Moved":
        """The same in units of another's usual sizes."""
        return _Moved(*(mine / usual_sizes(theirs, len(theirs)) for mine, theirs in zip(self, other, strict=True)))


class _Law:
    """What moves cause, by a regression.

    Attributes:
        numbers: How many numbers it has.
        noise: Mean square of what it leaves of what it was fitted to.
    """

    def __init__(self, moved: _Moved) -> None:
        causes, gained = moved
        count, self.numbers = causes.shape
        self._effects, self._products = held_near_zero(causes, gained, count)
        self.noise = float(np.mean((gained - causes @ self._effects) ** 2))

    def elsewhere(self, moved: _Moved) -> tuple[float, float] | None:
        """How far off it is where it is familiar, beside its noise, and relative; nothing where that is hardly so."""
        causes, gained = moved
        leverage = np.einsum("bk,bk->b", causes, np.linalg.solve(self._products, causes.T).T) / self.numbers
        familiar = leverage <= _FAMILIAR
        if familiar.mean() < _MOSTLY or familiar.sum() < _FEWEST or not self.noise > 0:
            return None
        error = float(np.mean((gained - causes @ self._effects)[familiar] ** 2))
        return error / self.noise, error / max(float(np.mean(gained[familiar] ** 2)), np.finfo(float).tiny)


def find_strangers(files: Mapping[str, Rows]) -> dict[str, Stranger]:
    """Find files whose accelerations the others tell far worse than their own and than the file's are told by itself.

    Another payload, supply, motor or temperature changes more than a sign or a unit. Each file is predicted by a
    regression of all others, and these by one of the file, where either has been: a law is no worse for what lies
    beyond. A file is a stranger if both fail, though its own halves tell each other well.

    Args:
        files: Accelerations under bumps, of every file.

    Returns:
        The strangers, the farthest first; the others agree without them. Of two files, one or both.
    """
    moved = {name: _Moved.of(rows) for name, rows in files.items()}
    found: dict[str, Stranger] = {}
    while len(moved) > 1:
        every = _Moved.joined(list(moved.values()))
        scaled = {name: each.beside(every) for name, each in moved.items()}
        odd = {
            name: stranger
            for name, each in scaled.items()
            if (stranger := _beside(each, _Moved.joined([rest for other, rest in scaled.items() if other != name])))
        }
        if not odd:
            break
        if len(moved) == 2:  # Two cannot outvote each other.
            return found | odd
        name = max(odd, key=lambda each: odd[each].far)
        found[name] = odd[name]
        del moved[name]
    return found


def _beside(file: _Moved, others: _Moved) -> Stranger | None:
    """A file beside all others; nothing where it is like them, or too little is known."""
    numbers = file.causes.shape[1]
    if len(others.causes) < _MANY * numbers or len(file.causes) < 2 * _MANY * numbers:
        return None
    told, back = _Law(others).elsewhere(file), _Law(file).elsewhere(others)
    if told is None or back is None or told[0] < _FAR or back[0] < _FARTHER or min(told[1], back[1]) < _MUCH:
        return None
    own = float(np.sum(unseen_residuals(*file) ** 2) / max(np.sum(file.gained**2), np.finfo(float).tiny))
    return Stranger(told[1], own, told[0]) if told[1] >= _OWN * own else None

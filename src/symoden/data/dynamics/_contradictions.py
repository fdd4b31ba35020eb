"""Files that agree with the others only once something is changed."""

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding

from ._bumps import MOST, Bumps, Rows, bumps_of, stacked, under_bumps
from ._changes import Change, changes_of
from ._other_zeros import Zero, best_offset, zeros_of
from ._regression import held_near_zero, usual_sizes
from ._strangers import Stranger, find_strangers

_WELL: Final = 0.1  # Share of the accelerations' mean square that is left: the others tell the file well as it is.
_MOST: Final = 0.5  # The same: they tell most of it.
_LATE: Final = 0.2  # The same, of other delays: of inputs that are fed back one in ten tells most of it by chance.
_OFFSET: Final = 0.2  # The same, of another zero, which is no round number: it must tell more to be named.
_NOTHING: Final = 1.0  # The same: they tell nothing.
_LESS: Final = 0.33  # Of what is left as it is, and without some input: or it is this that the others misjudge.
_ALIKE: Final = 1.5  # Times the least that is left; a change that leaves no more may be what is wrong as well.
_MANY: Final = 2  # Bumps for each number of a regression.
_FEWEST: Final = 20  # Bumps of a file: of fewer, most is told by chance.
_EACH, _ALL = 300, 6000  # Bumps of a file, for the 140 numbers of six joints; of all files, for a second of time.
_CHANGED: Final = 60  # Bumps of a file that are laid anew for each of up to a hundred changes.
_TRIED: Final = 12  # Files that may be the one without which the others agree.
_NAMED: Final = 3  # Changes.


class _Told(NamedTuple):
    """What bumps tell, in as few rows as there are columns: a triangular factor has the same regressions.

    Attributes:
        rows: The factor.
        bumps: How many bumps it stands for.
    """

    rows: Rows
    bumps: int

    @classmethod
    def of(cls, rows: Rows) -> "_Told":
        """Of one row for each bump."""
        return cls(_triangular([rows]), len(rows.motion))

    def joined(self, other: "_Told") -> "_Told":
        """Both together."""
        return _Told(_triangular([self.rows, other.rows]), self.bumps + other.bumps)

    @property
    def numbers(self) -> int:
        """How many numbers a regression has."""
        return self.rows.motion.shape[1] + self.rows.pushed.shape[1]


def _triangular(parts: Sequence[Rows]) -> Rows:
    """Factor of rows below each other."""
    columns = np.concatenate([np.concatenate(part, axis=1) for part in parts])
    widths = [column.shape[1] for column in parts[0]]
    return Rows(*np.split(np.linalg.qr(columns, mode="r"), np.cumsum(widths)[:-1], axis=1))


class _Law(NamedTuple):
    """How files accelerate.

    Attributes:
        effects: Of what moves and pushes; accelerations count beside their usual size.
        scale: Their usual size.
    """

    effects: Float[np.ndarray, "k n"]
    scale: Float[np.ndarray, " n"]

    @classmethod
    def of(cls, told: _Told) -> "_Law":
        """By a regression that holds near zero what hardly anything tells."""
        causes = np.concatenate([told.rows.motion, told.rows.pushed], axis=1)
        size, scale = (usual_sizes(columns, told.bumps) for columns in (causes, told.rows.gained))
        effects, _ = held_near_zero(causes / size, told.rows.gained / scale, told.bumps)
        return cls(effects / size[:, None], scale)

    def least_without(self, told: _Told, inputs: int) -> float:
        """The least share that it leaves without one of the inputs, or all of them."""
        shape = told.rows.pushed.shape
        pushed = told.rows.pushed.reshape(len(told.rows.pushed), inputs, -1)
        every = [(pushed * kept[:, None]).reshape(shape) for kept in (*(1 - np.eye(inputs)), np.zeros(inputs))]
        return min(self.left(told._replace(rows=told.rows._replace(pushed=each))) for each in every)

    def left(self, told: _Told) -> float:
        """Share of a file's accelerations, in their mean square, that it leaves."""
        return self._share(self.residuals(told), told)

    def left_beside_constants(self, told: _Told) -> float:
        """The same beside a constant acceleration of its own: by another zero or payload, or where it leans."""
        one, residuals = told.rows.motion[:, :1], self.residuals(told)
        constants = one.T @ residuals / max(np.sum(one**2), np.finfo(float).tiny)
        return self._share(residuals - one * constants, told)

    def residuals(self, told: _Told) -> Float[np.ndarray, "r n"]:
        """What it leaves of a file's accelerations, beside their usual size."""
        causes = np.concatenate([told.rows.motion, told.rows.pushed], axis=1)
        return told.rows.gained / self.scale - causes @ self.effects

    def _share(self, residuals: Float[np.ndarray, "r n"], told: _Told) -> float:
        """What residuals are of a file's accelerations, in their mean square."""
        return float(np.sum(residuals**2) / max(np.sum((told.rows.gained / self.scale) ** 2), np.finfo(float).tiny))


class _File:
    """A file of recordings under bumps, as it is and as it would be if something was changed.

    Attributes:
        told: What it tells as it is.
        inputs: How many inputs there are.
    """

    def __init__(self, recordings: Sequence[Bumps], is_angle: Bool[np.ndarray, " n"], *, held: bool) -> None:
        self.told = _Told.of(stacked(recordings))
        self.inputs = recordings[0].given.shape[1]
        self._recordings, self._is_angle, self._held = recordings, is_angle, held
        self._mended: dict[Change, _Told] = {}

    def mended(self, change: Change) -> _Told:
        """What it tells with a change."""
        if change not in self._mended:
            self._mended[change] = self.told_with(change)
        return self._mended[change]

    def told_with(self, change: Change) -> _Told:
        """The same, computed anew."""
        stride = max(1, self.told.bumps // _CHANGED)
        parts = [
            under_bumps(
                change.mend(each.recording), each.samples[::stride], self._is_angle, each.middle, held=self._held
            )
            for each in self._recordings
        ]
        rows = stacked(parts, change.delay)
        return _Told(rows, len(rows.motion))


class _Suspects(NamedTuple):
    """What may be wrong with a file.

    Attributes:
        changes: Signs, units, orders and delays.
        zeros: Positions that may have another zero.
    """

    changes: Sequence[Change]
    zeros: Sequence[Zero]


class _Answer(NamedTuple):
    """What would mend a file.

    Attributes:
        changes: Any one of these; the best first.
        left: Share of its accelerations that the others leave then.
        as_it_is: Share that they leave without.
    """

    changes: tuple[Change, ...]
    left: float
    as_it_is: float


_Files = Mapping[str, _File]


def find_contradictions(dataset: Dataset, is_angle: np.ndarray, *, late: bool = False) -> list[Finding]:
    """Say which files agree with the others only after a change of sign, unit, columns, delay or zero, or not at all.

    A column is turned, written in another unit, exchanged with another one, or late from one day to the next. A model
    learns the mean of both, and no single file looks wrong. Accelerations under bumps are explained by functions of
    single positions, friction, products of velocities and the inputs, which may turn with angles. A file is named if
    what the others tell explains most of its accelerations with one such change, and leaves three times as much
    without; of a delay it must tell as much by itself. Where another zero of a position tells it about as well, this
    is named, and where a constant force does, nothing. Of the rest, files are named that are nothing like the others
    whatever is changed (`find_strangers`).

    Args:
        dataset: Recordings as training sees them.
        is_angle: Whether each coordinate is an angle.
        late: Whether all inputs are known to act at another time: then no file's delay is looked for.

    Returns:
        One finding for each file.
    """
    if dataset.momenta:
        return []
    parts = {id(each): part for part in ("train", "validation", "test") for each in getattr(dataset, part)}
    names = {id(each): f"`{each.name.split('#')[0]}` ({parts[id(each)]})" for each in dataset.recordings}
    most = max(MOST, min(_EACH * len(set(names.values())), _ALL))
    files: dict[str, list[Bumps]] = {}
    held = dataset.hold == "zero"
    for bumps in bumps_of(dataset.recordings, is_angle, held=held, most=most):
        files.setdefault(names[id(bumps.recording)], []).append(bumps)
    odd, pair = {}, ()
    if dataset.inputs:
        every = {name: _File(recordings, is_angle, held=held) for name, recordings in files.items()}
        telling = {name: each for name, each in every.items() if each.told.bumps >= _FEWEST}
        changes = [each for each in changes_of(dataset, is_angle) if not (late and each.delay)]
        odd, pair = _odd_ones(telling, _Suspects(changes, zeros_of(dataset, is_angle)))
    rest = {name: stacked(recordings) for name, recordings in files.items() if name not in odd and name not in pair}
    strangers = find_strangers(rest)
    return [
        *(_finding(name, odd[name], pair) for name in files if name in odd),
        *(_stranger(name, strangers[name], pair=len(rest) == 2) for name in files if name in strangers),
    ]


def _odd_ones(files: _Files, suspects: _Suspects) -> tuple[dict[str, _Answer], tuple[str, ...]]:
    """Files without which the others agree, and the last two where these do not, so that either may be wrong."""
    agree, odd = dict(files), {}
    while len(agree) > 1 and (unlike := _unlike(agree, _WELL)):
        found = _most_at_odds(agree, unlike, suspects)
        if found is None:
            break
        name, odd[name] = found
        if len(agree) == 2:  # Two cannot outvote each other.
            return odd, tuple(agree)
        del agree[name]
    return odd, ()


def _unlike(files: _Files, most: float) -> list[str]:
    """Files of whose accelerations the others leave a larger share than that."""
    others = _all_but_one([file.told for file in files.values()])
    return [
        name
        for (name, file), rest in zip(files.items(), others, strict=True)
        if rest.bumps >= _MANY * rest.numbers and _Law.of(rest).left(file.told) > most
    ]


def _most_at_odds(files: _Files, unlike: Sequence[str], suspects: _Suspects) -> tuple[str, _Answer] | None:
    """The file that a change would mend, without which the fewest others are unlike; none where there is none."""

    def unlikely(name: str) -> tuple[bool, float]:
        """What is unlike the others comes first, then what may outweigh all others."""
        return name not in unlike, -float(np.linalg.norm(files[name].told.rows.pushed))

    found: list[tuple[int, str, _Answer]] = []
    others = dict(zip(files, _all_but_one([file.told for file in files.values()]), strict=True))
    for name in sorted(files, key=unlikely)[:_TRIED]:
        answer = _mended(others[name], files[name], suspects)
        if answer is None:
            continue
        rest = {other: file for other, file in files.items() if other != name}
        left = len(_unlike(rest, _NOTHING)) if len(rest) > 1 else 0
        if 2 * left <= len(rest):  # Else these do not even agree among themselves.
            found.append((left, name, answer))
    if not found:
        return None
    _, name, answer = min(found, key=lambda each: (each[0], each[2].left))
    return name, answer


def _mended(others: _Told, file: _File, suspects: _Suspects) -> _Answer | None:
    """What has to be changed for the others to tell most of a file, of which they leave three times as much now."""
    law = _Law.of(others)
    as_it_is = law.left(file.told)
    if as_it_is <= _WELL:
        return None
    left = np.array([law.left(file.mended(change)) for change in suspects.changes])
    for i, change in enumerate(suspects.changes):
        if change.delay and not (left[i] <= _LATE and _tells(file, change)):
            left[i] = np.inf
    least = float(left.min())
    less = _LESS * min(as_it_is, law.least_without(file.told, file.inputs))
    most = min(_MOST, less)
    moved, of_moved = _moved(law, file, suspects.zeros)
    found = least <= most
    # Where inputs hardly change a turned sign, or another unit, adds a constant force, as another zero does.
    if moved and as_it_is > _MOST and of_moved <= min(_OFFSET, less) and not (found and of_moved > _ALIKE * least):
        return _Answer((moved,), of_moved, as_it_is)
    if not found or min(of_moved, law.left_beside_constants(file.told)) <= _ALIKE * least:
        return None
    alike = [suspects.changes[i] for i in np.argsort(left) if left[i] <= min(_ALIKE * least, most)]
    delay = next((change for change in alike if change.delay), None)  # Those beside it are much alike.
    return _Answer(tuple(change for change in alike if not change.delay or change is delay), least, as_it_is)


def _moved(law: _Law, file: _File, zeros: Sequence[Zero]) -> tuple[Change | None, float]:
    """The other zero of one position by which the others tell most of a file, and the share that they leave then."""

    def residuals(change: Change) -> Float[np.ndarray, " k"]:
        return law.residuals(file.told_with(change)).ravel()

    every = [change for change in (best_offset(zero, residuals) for zero in zeros) if change]
    left = [law.left(file.told_with(change)) for change in every]
    return (every[int(np.argmin(left))], min(left)) if every else (None, np.inf)


def _tells(file: _File, change: Change) -> bool:
    """Whether a file tells a delay by itself: the phase of another sine, by a slow drive, is none."""
    now, then = (_Law.of(told).left(told) for told in map(file.mended, (change._replace(delay=0.0), change)))
    return now > _WELL and then <= _LESS * now


def _all_but_one(every: Sequence[_Told]) -> list[_Told]:
    """What all others tell, of each: those before it and those after it."""
    before = list(accumulate(every[:-1], _Told.joined))
    after = list(accumulate(every[:0:-1], _Told.joined))[::-1]
    return [after[0], *(each.joined(then) for each, then in zip(before[:-1], after[1:], strict=True)), before[-1]]


def _finding(name: str, answer: _Answer, pair: tuple[str, ...]) -> Finding:
    """What to say of a file."""
    like = f"{next(file for file in pair if file != name)} does" if name in pair else "the other recordings do"
    words = ", or ".join(change.words for change in answer.changes[:_NAMED])
    mend = "Mend the file (`units` are those of all files)"
    if answer.changes[0].kind == "zero":
        mend = (
            "Its sensor seems to have another zero there, or a constant force acts: home it, shift the file (`zeros` "
            "are those of all files)"
        )
    return Finding(
        kind=answer.changes[0].kind,
        level="warning",
        channel=answer.changes[0].column,
        text=f"{name} moves as {like} only if {words}: then these tell {1 - answer.left:.0%} of its accelerations, and "
        f"{f'{1 - answer.as_it_is:.0%}' if answer.as_it_is < 1 else 'nothing'} as it is",
        advice=f"A model would learn the mean of both. {mend}, or leave it out.",
    )


def _stranger(name: str, found: Stranger, *, pair: bool) -> Finding:
    """What to say of a file that is like the others in nothing."""
    others = "the other recording" if pair else "the other recordings"
    return Finding(
        kind="unlike",
        level="warning",
        channel="",
        text=f"{name} moves otherwise than {others}: of its accelerations {'it tells' if pair else 'these tell'} "
        f"{max(0.0, 1 - found.left):.0%}, and its own halves each other {1 - found.own:.0%}",
        advice="A model would learn the mean of both. If it had another payload, supply, motor or friction, or a "
        "sensor another zero, leave it out, or train a model of it alone.",
    )

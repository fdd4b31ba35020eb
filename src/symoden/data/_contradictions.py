"""Files in which an input does something else than in the others: a sign or a unit that changed between them."""

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symoden.wording import first_few

from ._bumps import MOST, Bumps, Rows, bumps_of, stacked
from ._dataset import Dataset
from ._findings import Finding
from ._regression import RANK, least_squares, sizes

_CLEAR: Final = 8.0  # Standard errors: measured arms have 8 to 34 where an input is told.
_SHARE: Final = 0.3  # Of what is left without it that an input must explain: -5 times on a measured arm has 0.28.
_TOLD: Final = 4.0  # The same where the others are explained by a file of another unit.
_TURNED: Final = 3.0  # Between this factor and its inverse, negative, an input is turned round; 0.3 to 2.8 are alike.
_OTHER_UNIT: Final = 30.0  # Times as much, or as little, comes of no motion: a degree is 57, a centimetre 100.
_INVERSE: Final = 10.0  # Between this and its inverse a factor there and back is one: noise makes both too small.
_MANY: Final = 2  # Bumps for each number of a regression.
_TRIED: Final = 12  # Files that may be the one without which the others agree.
_EACH, _ALL = 300, 6000  # Bumps of a file, for the 140 numbers of six joints; of all files, for a second of time.
_NAMED: Final = 3


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


def _triangular(parts: Sequence[Rows]) -> Rows:
    """Factor of rows below each other."""
    columns = np.concatenate([np.concatenate(part, axis=1) for part in parts])
    widths = [column.shape[1] for column in parts[0]]
    return Rows(*np.split(np.linalg.qr(columns, mode="r"), np.cumsum(widths)[:-1], axis=1))


class _File(NamedTuple):
    """What tells of a file what inputs do in it.

    Attributes:
        told: Its regression of accelerations.
        spreads: Standard deviation of the accelerations of each of its recordings.
        inputs: How many inputs there are.
    """

    told: _Told
    spreads: Float[np.ndarray, "r n"]
    inputs: int

    @classmethod
    def of(cls, recordings: Sequence[Bumps]) -> "_File":
        """Of the recordings of a file."""
        spreads = np.stack([np.std(each.gained, axis=0) for each in recordings])
        return cls(_Told.of(stacked(recordings)), spreads, recordings[0].given.shape[1])

    @property
    def tells(self) -> bool:
        """Whether it is long enough."""
        return self.told.bumps >= _MANY * (self.told.rows.motion.shape[1] + self.inputs)


_Files = Mapping[str, _File]


class _Answer(NamedTuple):
    """How accelerations answer inputs in a file, beside how they do in others.

    Attributes:
        factor: Times as much, of each input.
        clear: Its standard errors.
        share: Share that it explains of what is left without this input.
    """

    factor: Float[np.ndarray, " m"]
    clear: Float[np.ndarray, " m"]
    share: Float[np.ndarray, " m"]

    @property
    def differs(self) -> Bool[np.ndarray, " m"]:
        """Which inputs do something else, if these figures are true."""
        with np.errstate(divide="ignore"):
            size = np.abs(np.log(np.abs(self.factor)))
        return ((self.factor < 0) & (size < np.log(_TURNED))) | (size > np.log(_OTHER_UNIT))

    @property
    def contradicts(self) -> Bool[np.ndarray, " m"]:
        """Which inputs do."""
        return self.differs & (self.clear > _CLEAR) & (self.share > _SHARE)


def find_contradictions(dataset: Dataset, is_angle: np.ndarray) -> list[Finding]:
    """Say in which files an input accelerates the mechanism otherwise than in the others.

    A column is turned, or written in another unit, from one day to the next. A model learns the mean of both, and no
    single file looks wrong. Accelerations under bumps are explained by functions of single positions, friction,
    products of velocities and the inputs, which may turn with angles; what the inputs do by the other files is
    compared with what they do in this one, beside whatever else moves it there.

    Args:
        dataset: Recordings as training sees them.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding for each input and each way in which it contradicts.
    """
    if not dataset.inputs or dataset.momenta:
        return []
    files: dict[str, list[Bumps]] = {}
    parts = {id(each): part for part in ("train", "validation", "test") for each in getattr(dataset, part)}
    names = {id(each): f"`{each.name.split('#')[0]}` ({parts[id(each)]})" for each in dataset.recordings}
    most = max(MOST, min(_EACH * len(set(names.values())), _ALL))
    for bumps in bumps_of(dataset.recordings, is_angle, held=dataset.hold == "zero", most=most):
        files.setdefault(names[id(bumps.recording)], []).append(bumps)
    every = {name: _File.of(recordings) for name, recordings in files.items()}
    odd, pair = _odd_ones({name: file for name, file in every.items() if file.tells})
    words: dict[tuple[int, float, bool], list[tuple[str, float]]] = {}
    for name, answer in ((name, odd[name]) for name in every if name in odd):
        for j in np.flatnonzero(answer.contradicts):
            factor = float(answer.factor[j])
            unit = np.sign(np.log(abs(factor))) * (abs(np.log(abs(factor))) > np.log(_OTHER_UNIT))
            words.setdefault((int(j), float(unit), factor < 0), []).append((name, factor))
    return [_finding(dataset.input_names[j], found, pair) for (j, *_), found in words.items()]


def _odd_ones(files: _Files) -> tuple[dict[str, _Answer], tuple[str, ...]]:
    """Files without which the others agree, and the last two where these do not, so that either may be wrong."""
    agree, odd = dict(files), {}
    said = _contradicting(agree)
    while said:
        if len(agree) == 2:  # Two cannot outvote each other.
            first = next(iter(said))
            return odd | {first: said[first]}, tuple(agree)
        name, left = _most_at_odds(agree, said)
        odd[name] = said.get(name) or _seen_from(list(said.values()))
        del agree[name]
        said = left
    return odd, ()


def _most_at_odds(files: _Files, said: Mapping[str, _Answer]) -> tuple[str, dict[str, _Answer]]:
    """The file without which the fewest others contradict, and these."""

    def unlikely(name: str) -> tuple[bool, float]:
        """What contradicts comes first, then that whose inputs may outweigh those of all others."""
        return name not in said, -float(np.linalg.norm(files[name].told.rows.pushed))

    found: list[tuple[str, dict[str, _Answer]]] = []
    for name in sorted(files, key=unlikely)[:_TRIED]:
        left = _contradicting({other: file for other, file in files.items() if other != name})
        found.append((name, left))
        if not left:
            break
    return min(found, key=lambda each: len(each[1]))


def _seen_from(answers: Sequence[_Answer]) -> _Answer:
    """How a file answers that tells little by itself, and yet all others contradict what is the mean with it."""
    clearest = max(answers, key=lambda each: float(np.max(np.where(each.contradicts, each.clear, 0.0))))
    with np.errstate(divide="ignore"):
        return clearest._replace(factor=1 / clearest.factor)


def _contradicting(files: _Files) -> dict[str, _Answer]:
    """Files that contradict all others together."""
    if len(files) <= 1:
        return {}
    scale = np.median(np.concatenate([file.spreads for file in files.values()]), axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    found = {}
    for (name, file), others in zip(files.items(), _all_but_one([file.told for file in files.values()]), strict=True):
        answer = _answer(others, file.told, file.inputs, scale)
        if answer.contradicts.any():  # By what inputs do there, the others must contradict it, too.
            back = _answer(file.told, others, file.inputs, scale)
            told = np.where(answer.factor < 0, back.contradicts, back.differs & (back.clear > _TOLD))
            there_and_back = answer.factor * back.factor
            alike = told & (there_and_back > 1 / _INVERSE) & (there_and_back < _INVERSE)
            answer = answer._replace(clear=np.where(alike, answer.clear, 0.0))
        found[name] = answer
    return {name: answer for name, answer in found.items() if answer.contradicts.any()}


def _all_but_one(every: Sequence[_Told]) -> list[_Told]:
    """What all others tell, of each: those before it and those after it."""
    before = list(accumulate(every[:-1], _Told.joined))
    after = list(accumulate(every[:0:-1], _Told.joined))[::-1]
    return [after[0], *(each.joined(then) for each, then in zip(before[:-1], after[1:], strict=True)), before[-1]]


def _answer(others: _Told, file: _Told, m: int, scale: Float[np.ndarray, " n"]) -> _Answer:
    """Compare what inputs do in a file with what they do by others; accelerations count beside their usual size."""
    motion, pushed, gained = others.rows
    effects = least_squares(np.concatenate([motion, pushed], axis=1), gained / scale)[-pushed.shape[1] :]
    motion, pushed, gained = file.rows
    pushes = np.einsum("bja,jan->jbn", pushed.reshape(len(pushed), m, -1), effects.reshape(m, -1, len(scale)))
    rest = _Rest(motion)
    target = rest(gained / scale).ravel()
    pushes = np.stack([rest(each).ravel() for each in pushes], axis=1)
    factor = least_squares(pushes, target[:, None])[:, 0]
    left = float(np.sum((target - pushes @ factor) ** 2))
    share, clear = np.zeros(m), np.zeros(m)
    freedom = max(1, (file.bumps - rest.rank) * len(scale) - m)
    for j in range(m):
        others_alone = np.delete(pushes, j, axis=1)
        own = pushes[:, j] - others_alone @ least_squares(others_alone, pushes[:, [j]])[:, 0]
        explained = factor[j] ** 2 * float(own @ own)
        if explained > 0:
            share[j] = explained / (explained + left)
            clear[j] = np.sqrt(explained * freedom / max(left, np.finfo(float).tiny))
    return _Answer(factor, clear, share)


class _Rest:
    """What is left of signals without what a file's motion explains.

    Attributes:
        rank: Number of directions that are taken out.
    """

    def __init__(self, motion: Float[np.ndarray, "B k"]) -> None:
        U, s, _ = np.linalg.svd(motion / sizes(motion), full_matrices=False)
        self._explained = U[:, s > RANK * s[0]]
        self.rank = self._explained.shape[1]

    def __call__(self, signals: Float[np.ndarray, "B n"]) -> Float[np.ndarray, "B n"]:
        return signals - self._explained @ (self._explained.T @ signals)


def _finding(name: str, found: Sequence[tuple[str, float]], pair: tuple[str, ...]) -> Finding:
    """What to say of an input that does the same in these files."""
    both = len(found) == 1 and found[0][0] in pair
    where = first_few((file for file, _ in found), _NAMED)
    than = next(file for file in pair if file != found[0][0]) if both else "the other recordings"
    size = float(np.median([factor for _, factor in found]))
    if abs(np.log(abs(size))) < np.log(_OTHER_UNIT):
        return Finding(
            kind="sign",
            level="warning",
            channel=name,
            text=f"`{name}` accelerates the mechanism in {where} the other way round than in {than}",
            advice="A model would learn the mean of both. Turn its column there, or those of positions and velocities, "
            "or leave these recordings out.",
        )
    return Finding(
        kind="unit",
        level="warning",
        channel=name,
        text=f"`{name}` accelerates the mechanism in {where} {float(f'{size:.2g}'):g} times as much as in {than}",
        advice="`units` are those of all files: bring the input, or positions and velocities, to the same unit there, "
        "or leave these recordings out.",
    )

"""Files in which an input does something else than in the others: a sign or a unit that changed between them."""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symoden.wording import first_few

from ._bumps import Bumps, bumps_of
from ._dataset import Dataset
from ._findings import Finding
from ._regression import RANK

_CLEAR: Final = 8.0  # Standard errors: measured arms have 8 to 34 where an input is told.
_SHARE: Final = (
    0.3  # Of what is left without the input that it must explain: a factor of -5 on a measured arm has 0.28.
)
_TOLD: Final = 4.0  # The same where the others are explained by a file of another unit.
_TURNED: Final = 3.0  # Between this factor and its inverse, negative, an input is turned round; 0.3 to 2.8 are alike.
_OTHER_UNIT: Final = 30.0  # Times as much, or as little, comes of no motion: a degree is 57, a centimetre 100.
_INVERSE: Final = 10.0  # Between this and its inverse a factor there and back is one: noise makes both too small.
_MANY: Final = 2  # Bumps for each number of a regression.
_NAMED: Final = 3

_Files = Mapping[str, Sequence[Bumps]]


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
    for bumps in bumps_of(dataset.recordings, is_angle, held=dataset.hold == "zero"):
        name = f"`{bumps.recording.name.split('#')[0]}` ({parts[id(bumps.recording)]})"
        files.setdefault(name, []).append(bumps)
    told = {name: parts for name, parts in files.items() if _tells(parts)}
    words: dict[tuple[int, str], list[tuple[str, float]]] = {}
    odd, pair = _odd_ones(told)
    for name, answer in odd.items():
        for j in np.flatnonzero(answer.contradicts):
            factor = float(answer.factor[j])
            kind = "sign" if abs(np.log(abs(factor))) < np.log(_TURNED) else "unit"
            words.setdefault((int(j), kind), []).append((name, factor))
    return [_finding(dataset.input_names[j], kind, found, pair) for (j, kind), found in words.items()]


def _tells(parts: Sequence[Bumps]) -> bool:
    """Whether a file is long enough to tell what inputs do in it."""
    rows = sum(len(part.samples) for part in parts)
    return rows >= _MANY * (parts[0].motion.shape[1] + parts[0].given.shape[1])


def _odd_ones(files: _Files) -> tuple[dict[str, _Answer], tuple[str, ...]]:
    """Files without which the others agree, and the last two where these do not, so that either may be wrong."""
    agree, odd = dict(files), {}
    while said := _contradicting(agree):
        if len(agree) == 2:  # Two cannot outvote each other.
            first = next(iter(said))
            return odd | {first: said[first]}, tuple(agree)
        left = {name: len(_contradicting({k: v for k, v in agree.items() if k != name})) for name in agree}
        name = min(agree, key=lambda each: (left[each], each not in said))
        odd[name] = said.get(name) or _seen_from(list(said.values()))
        del agree[name]
    return odd, ()


def _seen_from(answers: Sequence[_Answer]) -> _Answer:
    """How a file answers that tells little by itself, and yet all others contradict what is the mean with it."""
    clearest = max(answers, key=lambda each: float(np.max(np.where(each.contradicts, each.clear, 0.0))))
    with np.errstate(divide="ignore"):
        return clearest._replace(factor=1 / clearest.factor)


def _contradicting(files: _Files) -> dict[str, _Answer]:
    """Files that contradict all others together."""
    if len(files) <= 1:
        return {}
    every = [part for parts in files.values() for part in parts]
    scale = np.median([np.std(part.gained, axis=0) for part in every], axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    found = {}
    for name, parts in files.items():
        others = [part for other, rest in files.items() if other != name for part in rest]
        answer = _answer(others, parts, scale)
        if answer.contradicts.any():  # By what inputs do there, the others must contradict it, too.
            back = _answer(parts, others, scale)
            told = np.where(answer.factor < 0, back.contradicts, back.differs & (back.clear > _TOLD))
            there_and_back = answer.factor * back.factor
            alike = told & (there_and_back > 1 / _INVERSE) & (there_and_back < _INVERSE)
            answer = answer._replace(clear=np.where(alike, answer.clear, 0.0))
        found[name] = answer
    return {name: answer for name, answer in found.items() if answer.contradicts.any()}


def _answer(others: Sequence[Bumps], parts: Sequence[Bumps], scale: Float[np.ndarray, " n"]) -> _Answer:
    """Compare what inputs do in a file with what they do by others; accelerations count beside their usual size."""
    m = parts[0].given.shape[1]
    motion, pushed, gained = _stacked(others)
    effects = _solved(np.concatenate([motion, pushed], axis=1), gained / scale)[-pushed.shape[1] :]
    motion, pushed, gained = _stacked(parts)
    pushes = np.einsum("bja,jan->jbn", pushed.reshape(len(pushed), m, -1), effects.reshape(m, -1, len(scale)))
    rest = _Rest(motion)
    target = rest(gained / scale).ravel()
    pushes = np.stack([rest(each).ravel() for each in pushes], axis=1)
    factor = _solved(pushes, target[:, None])[:, 0]
    left = float(np.sum((target - pushes @ factor) ** 2))
    share, clear = np.zeros(m), np.zeros(m)
    freedom = max(1, len(target) - rest.rank * len(scale) - m)
    for j in range(m):
        others_alone = np.delete(pushes, j, axis=1)
        own = pushes[:, j] - others_alone @ _solved(others_alone, pushes[:, [j]])[:, 0]
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
        scaled = motion / np.maximum(np.abs(motion).max(axis=0), np.finfo(float).tiny)
        U, s, _ = np.linalg.svd(scaled, full_matrices=False)
        self._explained = U[:, s > RANK * s[0]]
        self.rank = self._explained.shape[1]

    def __call__(self, signals: Float[np.ndarray, "B n"]) -> Float[np.ndarray, "B n"]:
        return signals - self._explained @ (self._explained.T @ signals)


def _stacked(parts: Sequence[Bumps]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Motion, pushes and gained velocities of recordings, one below another."""
    motion, gained = (np.concatenate([getattr(part, name) for part in parts]) for name in ("motion", "gained"))
    return motion, np.concatenate([part.pushed(0.0) for part in parts]), gained


def _solved(regressors: Float[np.ndarray, "B k"], targets: Float[np.ndarray, "B n"]) -> Float[np.ndarray, "k n"]:
    """Least squares, whatever the units; zero along what nothing tells."""
    size = np.maximum(np.abs(regressors).max(axis=0, initial=0.0), np.finfo(float).tiny)
    return np.linalg.lstsq(regressors / size, targets, rcond=RANK)[0] / size[:, None]


def _finding(name: str, kind: str, found: Sequence[tuple[str, float]], pair: tuple[str, ...]) -> Finding:
    """What to say of an input."""
    both = len(found) == 1 and found[0][0] in pair
    where = first_few((file for file, _ in found), _NAMED)
    than = next(file for file in pair if file != found[0][0]) if both else "the other recordings"
    if kind == "sign":
        return Finding(
            kind="sign",
            level="warning",
            channel=name,
            text=f"`{name}` accelerates the mechanism in {where} the other way round than in {than}",
            advice="A model would learn the mean of both. Turn its column there, or those of positions and velocities, "
            "or leave these recordings out.",
        )
    size = float(f"{np.median([abs(factor) for _, factor in found]):.2g}")
    return Finding(
        kind="unit",
        level="warning",
        channel=name,
        text=f"`{name}` accelerates the mechanism in {where} {size:g} times as much as in {than}",
        advice="`units` are those of all files: bring the input, or positions and velocities, to the same unit there, "
        "or leave these recordings out.",
    )

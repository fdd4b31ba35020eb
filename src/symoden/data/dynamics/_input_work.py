"""Inputs that take out of a mechanism what friction would have to give: their work says that a sign is wrong."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data._trajectory import Trajectory
from symoden.data.description import Description
from symoden.data.signals import time_scales

from ._input_signs import sign_patterns, wrong_signs
from ._regression import interleaved, inverse

_SHARE: Final = 0.1  # Of the time scale of the motion that a stretch takes: whole swings tell hardly anything of each.
_APART: Final = 10  # As many in a row, a time scale, belong to one half: joints take turns to move.
_CLEAR: Final = 4.0  # Standard errors of all recordings,
_HALF: Final = 1.5  # and of either half.
_RIGHT: Final = 3.0  # In either half: so is the kinetic energy where an input is late, whose friction is negative.
_FEWEST: Final = 4  # Stretches in either half for each number of the regression.


def find_input_work(dataset: Dataset, description: Description, is_angle: np.ndarray) -> list[Finding]:
    """Say of which inputs `input_matrix` has the wrong sign, where work tells.

    What inputs do, ∫ uᵀ gᵀ q̇ dt, is what the energy keeps and what friction takes. Over short stretches it is fitted by
    changes of the positions' functions and of products of velocities, and by ∫ |q̇| dt and ∫ q̇² dt of each coordinate.
    With the right signs no coordinate has a kinetic energy or a friction below zero; geared arms, whose accelerations
    tell hardly anything of their inputs, show the latter at every turn. Inputs that are late leave a friction below
    zero, too, but a kinetic energy far above it.

    Args:
        dataset: Recordings as training sees them.
        description: What it means.
        is_angle: Whether each coordinate is an angle.

    Returns:
        One finding, or none.
    """
    if dataset.input_matrix is None or not dataset.inputs or dataset.momenta or not dataset.train:
        return []
    work = _Work.of(dataset, dataset.input_matrix, is_angle)
    if len(work.done) < 2 * _FEWEST * (work.kept.shape[1] + work.gone.shape[1]):
        return []
    as_it_is, *turned = sign_patterns(dataset.inputs)
    told = work.told(as_it_is)
    if not told.is_backwards:
        return []
    right = max(turned, key=lambda signs: work.told(signs).least)
    if work.told(right).least < -_HALF:
        return []
    names = [name for name, sign in zip(dataset.input_names, right, strict=True) if sign < 0]
    joint = dataset.position_names[int(np.argmin(told.whole.min(axis=0)))]
    text = (
        f"{'do' if len(names) > 1 else 'does'} work as if the friction or the kinetic energy of `{joint}` were "
        f"negative, by {-told.least:.3g} standard errors, and the other way round as if none were"
    )
    unless = " An input that was filtered or logged late, or a push that was not logged, may look like it."
    return [wrong_signs(names, text, description, unless=unless)]


class _Told(NamedTuple):
    """What work says of every coordinate's kinetic energy and friction, in standard errors.

    Attributes:
        whole: Of all recordings.
        halves: Of either half.
    """

    whole: Float[np.ndarray, "2 n"]
    halves: Float[np.ndarray, "2 2 n"]

    @property
    def is_backwards(self) -> bool:
        """Whether one is clearly negative where the coordinate's other one is not clearly positive."""
        negative = (self.whole < -_CLEAR) & np.all(self.halves < -_HALF, axis=0)
        positive = np.all(self.halves > _RIGHT, axis=0)
        return bool(np.any(negative & ~positive[::-1]))

    @property
    def least(self) -> float:
        """The most negative one, or least positive."""
        return float(self.whole.min())


@dataclass(frozen=True, eq=False)
class _Work:
    """Stretches of recordings.

    Attributes:
        done: ∫ u gᵀ q̇ dt of each input.
        kept: Changes of what an energy is made of: kinetic energies of single coordinates first.
        gone: What friction takes by: the way of each coordinate, ∫ |q̇| dt, and ∫ q̇² dt of each.
    """

    done: Float[np.ndarray, "S m"]
    kept: Float[np.ndarray, "S k"]
    gone: Float[np.ndarray, "S d"]

    @classmethod
    def of(cls, dataset: Dataset, g: Float[np.ndarray, "n m"], is_angle: np.ndarray) -> "_Work":
        """Cut recordings."""
        scale = float(np.median(time_scales(dataset.train, is_angle)))
        # Squares of lengths that are far from zero would tell nothing.
        middle = np.where(is_angle, 0.0, np.mean([each.q.mean(axis=0) for each in dataset.train], axis=0))
        parts = [
            _stretches(each, each.q - middle, g, is_angle, _SHARE * scale, held=dataset.hold == "zero")
            for each in dataset.train
        ]
        return cls(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    @functools.cached_property
    def answers(self) -> tuple["_Answer", ...]:
        """What all of it says, and either half."""
        count = self.gone.shape[1] // 2
        columns = np.concatenate([self.kept, self.gone], axis=1)
        # A kinetic energy is told by its number, a friction by all that it takes on the way, whatever its law.
        asked = np.zeros((2, count, columns.shape[1]))
        for j in range(count):
            asked[0, j, j] = 1.0
            for column in (j - 2 * count, j - count):
                asked[1, j, column] = self.gone[:, column].sum()
        rows = [np.ones(len(columns), bool), *interleaved(len(columns), len(columns) // _APART)]
        return tuple(_Answer.of(columns[chosen], self.done[chosen], asked) for chosen in rows)

    def told(self, signs: Sequence[int]) -> _Told:
        """What it says with other signs of the inputs."""
        whole, *halves = (answer.in_errors(signs) for answer in self.answers)
        return _Told(whole, np.stack(halves))


class _Answer(NamedTuple):
    """What some stretches say of kinetic energies and frictions, input by input: with signs it is their sum.

    Attributes:
        values: The numbers that are asked for.
        errors: What each time scale puts into them that is left over.
    """

    values: Float[np.ndarray, "2 n m"]
    errors: Float[np.ndarray, "2 n B m"]

    @classmethod
    def of(
        cls,
        columns: Float[np.ndarray, "S k"],
        done: Float[np.ndarray, "S m"],
        asked: Float[np.ndarray, "2 n k"],
    ) -> "_Answer":
        """By least squares; zero where nothing tells."""
        makes = inverse(columns)
        values = makes @ done
        # What is left follows itself: a time scale in a row counts as one error.
        each = (asked @ makes)[..., None] * (done - columns @ values)
        return cls(asked @ values, np.add.reduceat(each, np.arange(0, len(done), _APART), axis=2))

    def in_errors(self, signs: Sequence[int]) -> Float[np.ndarray, "2 n"]:
        """Values beside their standard errors."""
        values, errors = self.values @ signs, np.linalg.norm(self.errors @ signs, axis=-1)
        return np.where(errors > 0, values / np.where(errors > 0, errors, 1.0), 0.0)


def _stretches(
    recording: Trajectory,
    q: Float[np.ndarray, "T n"],
    g: Float[np.ndarray, "n m"],
    is_angle: np.ndarray,
    seconds: float,
    *,
    held: bool,
) -> tuple[Float[np.ndarray, "S m"], Float[np.ndarray, "S k"], Float[np.ndarray, "S 2*n"]]:
    """Work, energies and what friction takes by, of the stretches of one recording with its positions q."""
    ts, v, u = recording.ts, recording.rates, recording.us
    steps, between = np.diff(ts)[:, None], u[:-1] if held else (u[:-1] + u[1:]) / 2
    speeds = np.abs(v[:-1] + v[1:]) / 2
    ends = np.arange(0, len(ts), max(2, round(seconds / np.median(steps))))

    def over(rates: Float[np.ndarray, "T k"]) -> Float[np.ndarray, "S k"]:
        return np.diff(np.concatenate([0 * rates[:1], np.cumsum(rates, axis=0)])[ends], axis=0)

    pairs = combinations_with_replacement(range(q.shape[1]), 2)
    kinetic = [v**2, *(v[:, [i]] * v[:, [j]] for i, j in pairs if i != j)]
    # The work of a sensor's offset goes with the place, of angles too.
    places = [q, np.cos(q[:, is_angle]), np.sin(q[:, is_angle]), q[:, ~is_angle] ** 2]
    kept = np.diff(np.concatenate([*kinetic, *places], axis=1)[ends], axis=0)
    work = between * (np.diff(q, axis=0) @ g)
    return over(work), kept, over(np.concatenate([speeds, speeds**2], axis=1) * steps)

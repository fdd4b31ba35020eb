"""Inputs that take out of a mechanism what friction would have to give: their work says that a sign is wrong."""

from collections.abc import Sequence
from itertools import combinations_with_replacement
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data._trajectory import Trajectory
from symoden.data.description import Description, entry
from symoden.data.signals import time_scales

from ._input_signs import sign_patterns
from ._regression import interleaved, inverse

_SHARE: Final = 0.1  # Of the time scale of the motion that a stretch takes: whole swings tell hardly anything of each.
_APART: Final = 10  # As many in a row, a time scale, belong to one half: joints take turns to move.
_CLEAR: Final = 4.0  # Standard errors of all recordings,
_HALF: Final = 2.0  # and of either half.
_FEWEST: Final = 4  # Stretches in either half for each number of the regression.


def find_input_work(dataset: Dataset, description: Description, is_angle: np.ndarray) -> list[Finding]:
    """Say of which inputs `input_matrix` has the wrong sign, where work tells.

    What inputs do, ∫ uᵀ gᵀ q̇ dt, is what the energy keeps and what friction takes. Over short stretches it is fitted by
    changes of the positions' functions and of products of velocities, and by the ways that each coordinate goes. With
    the right signs no coordinate has a kinetic energy or a friction below zero; geared arms, whose accelerations tell
    hardly anything of their inputs, show the latter at every turn. Inputs that are late leave a friction below zero,
    too, but with a kinetic energy far above it, which turned signs would make negative.

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
    if len(work.done) < 2 * _FEWEST * (work.kept.shape[1] + dataset.size):
        return []
    as_it_is, *turned = sign_patterns(dataset.inputs)
    told = work.told(as_it_is)
    backwards = told.backwards
    if not backwards.any():
        return []
    right = next((signs for signs in turned if work.told(signs).is_right), None)
    if right is None:
        return []
    names = [name for name, sign in zip(dataset.input_names, right, strict=True) if sign < 0]
    several, named = len(names) > 1, ", ".join(f"`{name}`" for name in names)
    joint = dataset.position_names[int(np.argmax(backwards))]
    return [
        Finding(
            kind="sign",
            level="warning",
            channel="" if several else names[0],
            text=f"in [train] {named} {'do' if several else 'does'} work as if the friction or the kinetic energy of "
            f"`{joint}` were negative, by {told.errors:.2g} standard errors, and the other way round as if none were",
            advice=f"Write {entry(dict.fromkeys(names, -1.0), description.units)}, or turn the signs in "
            "`input_matrix`; or else those of positions and velocities.",
        )
    ]


class _Told(NamedTuple):
    """What work says of every coordinate's kinetic energy and friction, in standard errors.

    Attributes:
        whole: Of all recordings.
        halves: Of either half.
    """

    whole: Float[np.ndarray, "2 n"]
    halves: Float[np.ndarray, "2 2 n"]

    @property
    def backwards(self) -> Bool[np.ndarray, " n"]:
        """Of which coordinates one of them is clearly negative."""
        return np.any((self.whole < -_CLEAR) & np.all(self.halves < -_HALF, axis=0), axis=0)

    @property
    def is_right(self) -> bool:
        """Whether none is negative."""
        return bool((self.whole > -_HALF).all())

    @property
    def errors(self) -> float:
        """How negative the most negative one is."""
        return -float(self.whole[:, self.backwards].min())


class _Work(NamedTuple):
    """Stretches of recordings.

    Attributes:
        done: ∫ u gᵀ q̇ dt of each input.
        kept: Changes of what an energy is made of: kinetic energies of single coordinates first.
        gone: The way of each coordinate, ∫ |q̇| dt.
    """

    done: Float[np.ndarray, "S m"]
    kept: Float[np.ndarray, "S k"]
    gone: Float[np.ndarray, "S n"]

    @classmethod
    def of(cls, dataset: Dataset, g: Float[np.ndarray, "n m"], is_angle: np.ndarray) -> "_Work":
        """Cut recordings."""
        scale = float(np.median(time_scales(dataset.train, is_angle)))
        parts = [_stretches(each, g, is_angle, _SHARE * scale, held=dataset.hold == "zero") for each in dataset.train]
        return cls(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def told(self, signs: Sequence[int]) -> _Told:
        """What it says with other signs of the inputs."""
        done, count = self.done @ np.asarray(signs, float), self.gone.shape[1]
        columns = np.concatenate([self.kept, self.gone], axis=1)
        rows = [np.ones(len(done), bool), *interleaved(len(done), len(done) // _APART)]
        values = [_in_errors(columns[chosen], done[chosen]) for chosen in rows]
        whole, *halves = (np.stack([each[:count], each[-count:]]) for each in values)
        return _Told(whole, np.stack(halves))


def _in_errors(columns: Float[np.ndarray, "S k"], done: Float[np.ndarray, " S"]) -> Float[np.ndarray, " k"]:
    """Numbers of a regression beside their standard errors; zero where nothing tells."""
    makes = inverse(columns)
    values = makes @ done
    left = done - columns @ values
    free = max(1.0, len(done) - float(np.sum(makes.T * columns)))
    errors = np.sqrt(left @ left / free * np.sum(makes**2, axis=1))
    return np.where(errors > 0, values / np.where(errors > 0, errors, 1.0), 0.0)


def _stretches(
    recording: Trajectory, g: Float[np.ndarray, "n m"], is_angle: np.ndarray, seconds: float, *, held: bool
) -> tuple[Float[np.ndarray, "S m"], Float[np.ndarray, "S k"], Float[np.ndarray, "S n"]]:
    """Work, energies and ways of the stretches of one recording."""
    ts, q, v, u = recording.ts, recording.q, recording.rates, recording.us
    steps, between = np.diff(ts), u[:-1] if held else (u[:-1] + u[1:]) / 2
    done = between * (np.diff(q, axis=0) @ g)
    gone = np.abs(v[:-1] + v[1:]) / 2 * steps[:, None]
    pairs = combinations_with_replacement(range(q.shape[1]), 2)
    kinetic = [v**2, *(v[:, [i]] * v[:, [j]] for i, j in pairs if i != j)]
    places = [np.cos(q[:, is_angle]), np.sin(q[:, is_angle]), q[:, ~is_angle], q[:, ~is_angle] ** 2]
    ends = np.arange(0, len(ts), max(2, round(seconds / np.median(steps))))
    kept = np.diff(np.concatenate([*kinetic, *places], axis=1)[ends], axis=0)
    sums = (np.concatenate([np.zeros((1, each.shape[1])), np.cumsum(each, axis=0)])[ends] for each in (done, gone))
    done, gone = (np.diff(each, axis=0) for each in sums)
    return done, kept, gone

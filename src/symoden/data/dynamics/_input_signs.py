"""Inputs that push otherwise than the given g says: the other way round, or as another one."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, product
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data.description import Description, entry

from ._bumps import Bumps, stacked
from ._regression import interleaved, inverse

_CLEAR: Final = 5.0  # Standard errors, in either half of the recordings: arms and drives have 10 to 40.
_FAR: Final = 0.3  # Below zero, of the largest that it can be: means over configurations are no one configuration's.
_MENDED: Final = 0.5  # Share of how far it is from what an inertia makes, that a change may leave,
_NEAR: Final = 0.2  # and of its size: of three joints more is left of the right g, whose effects turn with the joints.
_MOST: Final = 6  # Inputs of which all patterns of signs are tried.


def find_input_signs(dataset: Dataset, description: Description, bumps: Sequence[Bumps]) -> list[Finding]:
    """Say which inputs accelerate the mechanism otherwise than `input_matrix` has it.

    Whatever the inertia, gᵀ M⁻¹ g is symmetric and positive semidefinite: pushed along g x, a mechanism that rests
    moves along. The effects M⁻¹ g of the inputs are told by a regression of accelerations on functions of single
    positions, friction, products of velocities and inputs, as they are alike on the whole. With one input of the other
    sign, or two exchanged, some x is answered backwards. A model would bend V and D around the wrong g, and predict not
    much worse. What acts later than it was logged may seem to act the other way round: look for delays first.

    Args:
        dataset: Recordings as training sees them.
        description: What it means.
        bumps: Recordings to learn from, under bumps.

    Returns:
        One finding, or none.
    """
    g, told = _told(dataset)
    if not told.any():
        return []
    motion, pushed, gained = stacked(bumps)
    pushed = pushed.reshape(len(motion), dataset.inputs, -1)[:, :, 0]
    both = [_Answers.of(motion[half], pushed[half], gained[half], g) for half in interleaved(len(motion))]
    alone = np.max([[one.beside_error(x) for x in np.eye(dataset.inputs)] for one in both], axis=0)
    backwards = np.flatnonzero(told & (alone < -_CLEAR))
    if dataset.input_matrix is None:  # Of inputs up to a factor the signs are told, one by one.
        turned = _Change.of_signs([-1 if j in backwards else 1 for j in range(dataset.inputs)])
        return _findings(dataset, description, turned, -alone[backwards].max(initial=-np.inf))
    together = max(one.beside_error(other.worst) for one, other in (both, both[::-1]))
    if not len(backwards) and (together > -_CLEAR or max(one.least for one in both) > -_FAR):
        return []
    change = _mended(both)
    if change is None:
        change = _Change.of_signs([-1 if j in backwards else 1 for j in range(dataset.inputs)])
    return _findings(dataset, description, change, -min(together, *alone.tolist()))


def _told(dataset: Dataset) -> tuple[Float[np.ndarray, "n m"], Bool[np.ndarray, " m"]]:
    """What is told of g, and of which inputs: of a column with one entry that is none, its sign is enough."""
    g = np.zeros((dataset.size, dataset.inputs))
    if dataset.input_matrix is not None:
        return np.asarray(dataset.input_matrix), np.ones(dataset.inputs, bool)
    known = dataset.known
    if known is None or known.input_matrix is None or callable(known.input_matrix):
        return g, np.zeros(dataset.inputs, bool)
    values = {**known.constants, **known.parameters}  # These keep the sign that they start with, but for zero.
    g = np.array([[_value(entry, values) for entry in row] for row in known.input_matrix])
    return np.nan_to_num(g), np.isfinite(g).all(axis=0) & (np.count_nonzero(g, axis=0) == 1)


def _value(entry: object, values: Mapping[str, float | int]) -> float:
    """A number, or one that has a name, with its sign; NaN for what is neither, or a parameter of any sign."""
    text = str(entry).strip()
    name = text.removeprefix("-").strip()
    with contextlib.suppress(ValueError):
        return float(text)
    return (-1 if text.startswith("-") else 1) * float(values.get(name, 0) or np.nan)


class _Change(NamedTuple):
    """Another g: its columns in another order, and with other signs.

    Attributes:
        order: Which column each input has.
        signs: Factor of each.
    """

    order: tuple[int, ...]
    signs: tuple[int, ...]

    @classmethod
    def of_signs(cls, signs: Sequence[int]) -> "_Change":
        """Of signs alone."""
        return cls(tuple(range(len(signs))), tuple(signs))

    @classmethod
    def every(cls, inputs: int) -> "Iterator[_Change]":
        """None, signs of one input and more, and two inputs exchanged."""
        yield from map(cls.of_signs, sign_patterns(inputs))
        for pair in combinations(range(inputs), 2):
            order = list(range(inputs))
            order[pair[0]], order[pair[1]] = pair[::-1]
            yield cls(tuple(order), (1,) * inputs)

    @property
    def exchanged(self) -> tuple[int, ...]:
        """Which inputs have another's column."""
        return tuple(j for j, other in enumerate(self.order) if j != other)


def sign_patterns(inputs: int) -> list[tuple[int, ...]]:
    """Signs that inputs may have.

    Args:
        inputs: Number of inputs.

    Returns:
        Every pattern, of many inputs those of one sign turned; fewer turned signs go before more, none first.
    """
    if inputs <= _MOST:
        return sorted(product((1, -1), repeat=inputs), key=lambda signs: signs.count(-1))
    return [tuple(-1 if j == turned else 1 for j in range(inputs)) for turned in range(-1, inputs)]


class _Answers(NamedTuple):
    """How a mechanism accelerates, by input, with a g that is told.

    Attributes:
        g: What is told.
        effects: What each input does to each coordinate.
        inputs: Covariance of the effects among inputs, up to the residuals of each coordinate.
        left: Variance of these residuals.
    """

    g: Float[np.ndarray, "n m"]
    effects: Float[np.ndarray, "n m"]
    inputs: Float[np.ndarray, "m m"]
    left: Float[np.ndarray, " n"]

    @classmethod
    def of(
        cls,
        motion: Float[np.ndarray, "B k"],
        pushed: Float[np.ndarray, "B m"],
        gained: Float[np.ndarray, "B n"],
        g: Float[np.ndarray, "n m"],
    ) -> "_Answers":
        """By least squares; nothing where nothing tells."""
        regressors = np.concatenate([motion, pushed], axis=1)
        makes = inverse(regressors)
        effects, of_inputs = makes @ gained, makes[-g.shape[1] :]
        told = float(np.sum(makes.T * regressors))  # The rank.
        left = np.sum((gained - regressors @ effects) ** 2, axis=0) / max(1.0, len(gained) - told)
        return cls(g, effects[-g.shape[1] :].T, of_inputs @ of_inputs.T, left)

    def beside_error(self, x: Float[np.ndarray, " m"]) -> float:
        """What it does along the push of inputs x, beside its standard error; zero where nothing tells."""
        push = self.g @ x
        error = np.sqrt(np.sum(push**2 * self.left) * (x @ self.inputs @ x))
        return float(push @ self.effects @ x / error) if error > 0 else 0.0

    @property
    def least(self) -> float:
        """Least eigenvalue of gᵀ M⁻¹ g, whose diagonal is one at most, in its symmetric part."""
        return float(self._eigen()[0][0])

    @property
    def worst(self) -> Float[np.ndarray, " m"]:
        """Inputs that are answered backwards most."""
        return self._eigen()[1][:, 0] * _normalising(self.g, self.effects)

    def _eigen(self) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m m"]]:
        """Eigenvalues and vectors of that."""
        matrix = self._matrix(_Change.of_signs([1] * self.g.shape[1]))
        return np.linalg.eigh((matrix + matrix.T) / 2)

    def _matrix(self, change: _Change) -> Float[np.ndarray, "m m"]:
        """It, with a change of g."""
        g = self.g[:, change.order] * change.signs
        scale = _normalising(g, self.effects)
        return scale[:, None] * (g.T @ self.effects) * scale

    def distance(self, change: _Change) -> float:
        """How far it is, with a change, from what an inertia can make, relative to its size."""
        matrix = self._matrix(change)
        values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
        far = np.linalg.norm(matrix - (vectors * np.maximum(values, 0)) @ vectors.T)
        return float(far / max(np.linalg.norm(matrix), np.finfo(float).tiny))


def _normalising(g: Float[np.ndarray, "n m"], effects: Float[np.ndarray, "n m"]) -> Float[np.ndarray, " m"]:
    """Factors of inputs that leave a diagonal of one at most, whatever their units."""
    norms = np.linalg.norm(g, axis=0) * np.linalg.norm(effects, axis=0)
    return 1 / np.sqrt(np.where(norms > 0, norms, 1.0))


def _mended(both: Sequence[_Answers]) -> _Change | None:
    """The change of g by which both halves are nearest to what an inertia makes; none where none is near."""
    as_it_is, *every = _Change.every(both[0].g.shape[1])
    far, *distances = (max(one.distance(change) for one in both) for change in (as_it_is, *every))
    best = int(np.argmin(distances))
    return every[best] if distances[best] <= min(_NEAR, _MENDED * far) else None


def _findings(dataset: Dataset, description: Description, change: _Change, errors: float) -> list[Finding]:
    """What to say of a g that has to be changed; nothing where it is not known how."""
    if change.exchanged:
        first, second = (dataset.input_names[j] for j in change.exchanged)
        return [
            Finding(
                kind="order",
                level="warning",
                channel=first,
                text=f"in [train] `{first}` accelerates the mechanism as `input_matrix` says of `{second}`, and the "
                f"other way round, by {errors:.2g} standard errors or more",
                advice="Exchange them in `inputs`, or their columns in `input_matrix`; or else positions in "
                "`positions`, with their velocities.",
            )
        ]
    names = [name for name, sign in zip(dataset.input_names, change.signs, strict=True) if sign < 0]
    accelerate = "accelerate" if len(names) > 1 else "accelerates"
    text = f"{accelerate} the other way round than `input_matrix` says, by {errors:.2g} standard errors or more"
    return [wrong_signs(names, text, description)] if names else []


def wrong_signs(names: Sequence[str], text: str, description: Description, *, unless: str = "") -> Finding:
    """Say that inputs have the wrong signs.

    Args:
        names: The inputs, one at least.
        text: What they do.
        description: What it says.
        unless: What else may look like it.

    Returns:
        The finding.
    """
    return Finding(
        kind="sign",
        level="warning",
        channel=names[0] if len(names) == 1 else "",
        text=f"in [train] {', '.join(f'`{name}`' for name in names)} {text}",
        advice=f"Write {entry(dict.fromkeys(names, -1.0), description.units)}, or turn the signs in `input_matrix`; or "
        f"else those of positions and velocities.{unless}",
    )

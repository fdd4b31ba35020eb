"""Applying a function to recordings of any lengths: batches of padded recordings share one compiled program."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from symoden.data import Trajectory
from symoden.integrate import AbstractSolver, Hold, Rollout, rollout
from symoden.mechanics import AbstractDynamics
from symoden.models import NaiveModel
from symoden.training import cast

Model = TypeVar("Model", bound=AbstractDynamics)
Batched: TypeAlias = Callable[["Segment"], PyTree]


@dataclass(frozen=True, kw_only=True, eq=False)
class Stretch:
    """Samples [start, stop) of a recording.

    Attributes:
        trajectory: The recording.
        start: First sample.
        stop: Sample after the last one.
    """

    trajectory: Trajectory
    start: int
    stop: int

    @classmethod
    def whole(cls, recording: Trajectory) -> "Stretch":
        """A recording from beginning to end."""
        return cls(trajectory=recording, start=0, stop=len(recording))

    def __len__(self) -> int:
        """Number of samples."""
        return self.stop - self.start

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return float(self.trajectory.ts[self.stop - 1] - self.trajectory.ts[self.start])

    @property
    def q(self) -> Float[np.ndarray, "T n"]:
        """Measured coordinates."""
        return self.trajectory.q[self.start : self.stop]

    def padded(self, length: int) -> tuple[np.ndarray, ...]:
        """Times since the start, coordinates, rates and inputs, the last sample repeated."""
        recording, missing = self.trajectory, length - len(self)
        columns = (recording.ts - recording.ts[self.start], recording.q, recording.rates, recording.us)
        parts = (column[self.start : self.stop] for column in columns)
        return tuple(np.concatenate([part, np.repeat(part[-1:], missing, axis=0)]) for part in parts)


class Segment(NamedTuple):
    """Stretches on the device; in a batch, every array has the batch as its first axis.

    Attributes:
        ts: Times since the start [s].
        q: Measured coordinates.
        rates: Measured velocities or momenta.
        us: Inputs.
    """

    ts: Float[Array, "*B T"]
    q: Float[Array, "*B T n"]
    rates: Float[Array, "*B T n"]
    us: Float[Array, "*B T m"]


@contextlib.contextmanager
def double() -> Iterator[None]:
    """Compute in double precision, whatever the user's setting."""
    with jax.enable_x64(True), jax.numpy_dtype_promotion("standard"):  # noqa: FBT003 - JAX's signature
        yield


def in_double(model: Model) -> Model:
    """The same in double precision.

    Args:
        model: Learned model or analytic system.

    Returns:
        The model.
    """
    with double():
        return cast(model, float)


def roll_out(model: AbstractDynamics, segment: Segment, *, solver: AbstractSolver, hold: Hold) -> Rollout:
    """Roll out a model along a segment from its first state.

    Args:
        model: Learned model or analytic system.
        segment: One segment.
        solver: What advances the rollout.
        hold: How inputs act between samples.

    Returns:
        The rollout. Angles of a model that knows them only modulo 2π go on along time from the measured one.
    """
    path = rollout(model, segment.q[0], segment.rates[0], segment.ts, segment.us, solver=solver, hold=hold)
    if not isinstance(model, NaiveModel):
        return path
    angles = model.space.angles
    turned = jnp.unwrap(path.q[:, angles], axis=0)
    whole = 2 * jnp.pi * jnp.round((segment.q[0, angles] - turned[0]) / (2 * jnp.pi))
    return path._replace(q=path.q.at[:, angles].set(turned + whole[None]))


def entire(trajectories: Sequence[Trajectory]) -> list[Stretch]:
    """Each recording from its first to its last sample.

    Args:
        trajectories: Recordings.

    Returns:
        One stretch for each.
    """
    return list(map(Stretch.whole, trajectories))


def pieces(trajectories: Sequence[Trajectory], steps: int) -> list[Stretch]:
    """Consecutive stretches, the last sample of one being the first of the next.

    Args:
        trajectories: Recordings.
        steps: Largest number of sampling intervals in a stretch.

    Returns:
        The stretches.
    """
    return [
        Stretch(trajectory=trajectory, start=start, stop=min(start + steps + 1, len(trajectory)))
        for trajectory in trajectories
        for start in range(0, len(trajectory) - 1, steps)
    ]


def in_batches(
    function: Batched, stretches: Sequence[Stretch], *, samples: int = 65536, size: int | None = None
) -> Iterator[tuple[int, PyTree]]:
    """Apply a batched function to stretches, in bounded memory and in double precision.

    Far from zero, as of a wheel that has gone round a thousand times, single precision has no digits left for motion.
    Stretches of similar length are padded by repeating the last sample, in which no time passes, so that results
    along time agree with those without padding on the samples that there are.

    Args:
        function: Batched function.
        stretches: Stretches of any lengths.
        samples: Largest number of samples in a batch.
        size: Number of stretches in a batch, if they are short enough, so that calls with more or fewer share a
            program; by default enough for all of one length.

    Yields:
        The index of a stretch, and its result as NumPy arrays, still padded. The order is not that of the stretches.
    """
    groups: dict[int, list[int]] = {}
    for i, stretch in enumerate(stretches):
        groups.setdefault((len(stretch) - 1).bit_length(), []).append(i)
    for group in groups.values():
        length = _rounded(max(len(stretches[i]) for i in group))
        count = min(size or _power_of_two(len(group)), max(1, samples // length))
        for start in range(0, len(group), count):
            chosen = group[start : start + count]
            # The last batch is filled up, so that it needs no program of its own.
            filled = chosen + chosen[-1:] * (count - len(chosen))
            columns = zip(*(stretches[i].padded(length) for i in filled), strict=True)
            with double():
                result = jax.tree.map(np.asarray, function(Segment(*(jnp.asarray(np.stack(c)) for c in columns))))
            for k, i in enumerate(chosen):
                yield i, jax.tree.map(lambda leaf, k=k: leaf[k], result)


def _power_of_two(count: int) -> int:
    """Least power of two that is at least `count`."""
    return 1 << (count - 1).bit_length()


def _rounded(length: int) -> int:
    """Length up to an eighth longer, so that windows of 97 to 104 samples share a program."""
    step = 1 << max(0, (length - 1).bit_length() - 4)
    return -(-length // step) * step

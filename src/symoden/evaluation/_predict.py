"""Rollouts along recordings."""

import dataclasses
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from types import UnionType
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from symoden.blocks import without_silent
from symoden.data import Dataset, Trajectory, first_samples
from symoden.integrate import FEWEST_SUBSTEPS, HOLDS, RK4, AbstractSolver, Hold, Rollout
from symoden.mechanics import AbstractDynamics, refuse_no_system
from symoden.training import find_first_state

from ._batches import Segment, Stretch, double, entire, in_batches, in_double, roll_out


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Rollout from the first state of a recording, as measured or as found.

    Attributes:
        q: Coordinates; angles without jumps of 2π, whatever the model.
        rates: Velocities or momenta.
        observations: Embedded coordinates as the model has them, then the rates.
    """

    q: Float[np.ndarray, "T n"]
    rates: Float[np.ndarray, "T n"]
    observations: Float[np.ndarray, "T o"]

    def __repr__(self) -> str:
        """What it is, in a line."""
        return f"Prediction({self.q.shape[0]} samples, n = {self.q.shape[1]})"


def predict(
    model: AbstractDynamics,
    trajectories: Iterable[Trajectory],
    *,
    hold: str = "zero",
    solver: AbstractSolver | None = None,
) -> list[Prediction]:
    """Roll out recordings from their first states under their inputs.

    The first state is the measured one; where more `first_samples` tell it, it is found from these
    (`find_first_state`), unless the rollout from there diverges.

    Args:
        model: Learned model or analytic system.
        trajectories: Recordings of any lengths.
        hold: What an input is between samples, a key of `HOLDS`, as the data set says.
        solver: What advances rollouts; four RK4 steps in a sampling interval if absent.

    Returns:
        One prediction for each recording.

    Raises:
        TypeError: If something else than a model and recordings is given.
        ValueError: If `hold` is no key of `HOLDS`.

    Example:
        >>> from symoden.systems import Pendulum
        >>> ts = np.linspace(0.0, 1.0, 21)
        >>> rest = Trajectory(name="rest", ts=ts, q=np.zeros((21, 1)), rates=np.zeros((21, 1)), us=np.zeros((21, 1)))
        >>> (path,) = predict(Pendulum(), [rest])
        >>> float(abs(path.q - rest.q).max())
        0.0
    """
    if hold not in HOLDS:
        raise ValueError(f"`hold` must be {' or '.join(map(repr, HOLDS))}; got {hold!r}.")
    refuse_no_system(model)
    recordings = listed(trajectories)
    return from_first_states(
        model, recordings, hold=HOLDS[hold], solver=RK4(FEWEST_SUBSTEPS) if solver is None else solver
    )


def from_first_states(
    model: AbstractDynamics, recordings: Sequence[Trajectory], *, hold: Hold, solver: AbstractSolver
) -> list[Prediction]:
    """Roll out recordings from their first states, as `predict` does.

    Args:
        model: Learned model or analytic system.
        recordings: Recordings of any lengths.
        hold: How inputs act between samples.
        solver: What advances rollouts.

    Returns:
        One prediction for each recording.
    """
    begun = [_begun(model, recording, hold, solver) for recording in recordings]
    found = dict(paths(model, entire(begun), hold=hold, solver=solver))
    astray = [
        i
        for i, recording in enumerate(recordings)
        if begun[i] is not recording and not np.isfinite(found[i].observations).all()
    ]
    for k, path in paths(model, entire([recordings[i] for i in astray]), hold=hold, solver=solver):
        found[astray[k]] = path
    return [found[i] for i in range(len(recordings))]


def listed(trajectories: object, *, kinds: type | UnionType = Trajectory) -> list[Any]:
    """The recordings, however many are given.

    Args:
        trajectories: What was given.
        kinds: What each may be.

    Returns:
        A list of them.

    Raises:
        TypeError: If something else is given.
    """
    each = list(trajectories) if isinstance(trajectories, Iterable) else []
    odd = [one for one in each if not isinstance(one, kinds)]
    if isinstance(trajectories, Iterable) and not odd:
        return each
    hints = {Trajectory: "Write [recording] for one.", Dataset: "Write `dataset.test` for those of a part."}
    hints |= {dict: "Write `.values()` for those that it names.", str: "`read_dataset` reads them from files."}
    got = type(trajectories).__name__
    named = f"{got} with {type(odd[0]).__name__} in it" if odd and not isinstance(trajectories, dict | str) else got
    hint = hints.get(type(trajectories), "`Trajectory(…)` makes one of arrays.")
    raise TypeError(f"`trajectories` must be a list of recordings; got {named}. {hint}")


def with_first_state(recording: Trajectory, q: Float[np.ndarray, " n"], rates: Float[np.ndarray, " n"]) -> Trajectory:
    """Let a recording begin in another state than the measured one.

    Args:
        recording: The recording.
        q: Coordinates of its first sample.
        rates: Velocities or momenta there.

    Returns:
        Such a recording.
    """
    columns = ((q, recording.q), (rates, recording.rates))
    q, rates = (np.concatenate([first[None], measured[1:]]) for first, measured in columns)
    return dataclasses.replace(recording, q=q, rates=rates)


def _begun(model: AbstractDynamics, recording: Trajectory, hold: Hold, solver: AbstractSolver) -> Trajectory:
    """A recording that begins in the state that its initial samples tell; the same one where it has one such sample."""
    if first_samples(recording) == 1:
        return recording
    with double():
        first = map(np.asarray, find_first_state(in_double(model), recording, hold=hold, solver=solver))
    return with_first_state(recording, *first)


def paths(
    model: AbstractDynamics, stretches: Sequence[Stretch], *, hold: Hold, solver: AbstractSolver
) -> Iterator[tuple[int, Prediction]]:
    """Roll out stretches of recordings, each from its first state.

    Args:
        model: Learned model or analytic system.
        stretches: Stretches of any lengths.
        hold: How inputs act between samples.
        solver: What advances rollouts.

    Yields:
        The index of a stretch, and its rollout; not in order.
    """
    lean = in_double(without_silent(model))
    for i, path in in_batches(lambda batch: _rollouts(lean, batch, solver, hold), stretches):
        samples = len(stretches[i])
        yield i, Prediction(q=path.q[:samples], rates=path.rates[:samples], observations=path.observations[:samples])


@eqx.filter_jit
def _rollouts(model: AbstractDynamics, batch: Segment, solver: AbstractSolver, hold: Hold) -> Rollout:
    """Roll out a batch of segments."""
    return jax.vmap(lambda segment: roll_out(model, segment, solver=solver, hold=hold))(batch)

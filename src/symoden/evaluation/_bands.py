"""Predictions with bands, as wide as validation recordings ask for."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float

from symoden.data import Dataset, Trajectory, first_samples, spaced_evenly
from symoden.integrate import HOLDS, AbstractSolver, Hold
from symoden.mechanics import AbstractDynamics
from symoden.training import AbstractPosterior, AbstractScatter, FitResult, hold_out
from symoden.wording import number

from ._batches import Segment, Stretch, double, in_batches, roll_out
from ._certainty import LEVEL
from ._predict import from_first_states, listed, paths, with_first_state
from ._windows import HORIZON, OVERLAP, horizon_of, short_windows

_BINS = 20
_BATCH: Final = 8192  # Samples that are linearised at once at most.
_TOGETHER: Final = 16  # Windows: a program takes longer to make than to run on more.
_MOST_WINDOWS = 2000  # Eight minutes, at four windows in a second; hours of logs tell no more.
_TINY = 1e-12
_ENOUGH: Final = 9  # Validation windows that do not overlap: of fewer, chance leaves none outside where one should be.

Variances: TypeAlias = Callable[[Float[np.ndarray, " N"]], Float[np.ndarray, "N n"]]


@dataclass(frozen=True, kw_only=True)
class BandScore:
    """How well the bands of predicted positions cover recordings that were not trained on.

    Attributes:
        level: Probability that a band is meant to cover.
        calibrated_on: Part that set the width of the bands: validation recordings, or training without them.
        split: Part that was looked at.
        horizon_s: How long the windows are that were looked at, in the median [s]: 1, or less where recordings are
            shorter, or more where samples are rare (`horizon_of`).
        coverage: Share of its positions that lie in their bands.
        half_width: Median half width, in the data's units.
        coverages: Of each coordinate by itself the share of `coverage`,
        half_widths: and the median half width; lengths and angles have no common unit.
        from_parameters: Median share of the band, squared, that comes from uncertain parameters; the rest is noise and
            what the model leaves out.
    """

    level: float
    calibrated_on: str
    split: str
    horizon_s: float
    coverage: float
    half_width: float
    coverages: tuple[float, ...]
    half_widths: tuple[float, ...]
    from_parameters: float


@dataclass(frozen=True, kw_only=True, eq=False)
class BandedPath:
    """Predicted positions and their band.

    Attributes:
        ts: Time stamps of the recording [s].
        q: Predicted coordinates; not finite where the rollout diverges.
        half_width: Half of the band.
        from_parameters: Share of the band, squared, that comes from uncertain parameters.
    """

    ts: Float[np.ndarray, " T"]
    q: Float[np.ndarray, "T n"]
    half_width: Float[np.ndarray, "T n"]
    from_parameters: Float[np.ndarray, "T n"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Bands:
    """What the bands of rollouts are made of; `infer_bands` makes it.

    Half of a band, squared, is that of the uncertain parameters and that of the errors on the training recordings so
    long after the start. These have no normal distribution (what a swing-up's last window has is many times what is
    usual), so that theirs goes by a quantile of their own. A common factor makes the bands cover as much of the
    validation recordings as they should (split conformal prediction), what diverges among them counting as outside, if
    these have many windows. Few may cover more by chance, or because they rest: they can widen bands, but not narrow
    them.

    Attributes:
        posterior: What the data say of the model's parameters.
        hold: How inputs act between samples.
        solver: What advances rollouts.
        noise: Mean squared error of each coordinate so long after the start.
        tail: Quantile of errors over the root of that.
        factor: What half a band is multiplied with.
        calibrated_on: Part that set the factor.
        horizon: Length of the windows that bands are judged and drawn over, if recordings are as long [s].
    """

    posterior: AbstractPosterior
    hold: Hold
    solver: AbstractSolver
    noise: Variances
    tail: float
    factor: float
    calibrated_on: str
    horizon: float

    def __repr__(self) -> str:
        """What they are, in a line."""
        return f"Bands({LEVEL:.0%}, as wide as {self.calibrated_on} recordings ask for, {number(self.horizon)} s ahead)"

    def predict(self, trajectories: Iterable[Trajectory | Stretch]) -> list[BandedPath]:
        """Roll out recordings, each from its first state as `predict` does, or stretches of them as they were measured.

        Args:
            trajectories: Recordings, or stretches, of about a second: longer after the start than training tells the
                band stays as wide.

        Returns:
            A path for each.

        Raises:
            TypeError: If something else is given.
        """
        every = listed(trajectories, kinds=Trajectory | Stretch)
        told = {i: each for i, each in enumerate(every) if isinstance(each, Trajectory) and first_samples(each) > 1}
        model, recordings = self.posterior.model, list(told.values())
        begun = from_first_states(model, recordings, hold=self.hold, solver=self.solver)
        for (i, recording), path in zip(told.items(), begun, strict=True):
            every[i] = with_first_state(recording, path.q[0], path.rates[0])
        stretches = [Stretch.whole(each) if isinstance(each, Trajectory) else each for each in every]
        found: dict[int, BandedPath] = {}
        quantile = self.posterior.quantile(LEVEL)
        for i, path in _paths(self.posterior, stretches, self.hold, self.solver):
            uncertain = quantile**2 * path.variance
            both = uncertain + self.tail**2 * self.noise(path.elapsed)
            with np.errstate(invalid="ignore"):  # Of a rollout that diverges.
                share = uncertain / both
            found[i] = BandedPath(
                ts=path.elapsed + stretches[i].trajectory.ts[stretches[i].start],
                q=path.q,
                half_width=self.factor * np.sqrt(both),
                from_parameters=share,
            )
        return [found[i] for i in range(len(stretches))]

    def along(self, recordings: Sequence[Trajectory]) -> tuple[tuple[Float[np.ndarray, "N n"], ...], int]:
        """Roll out windows and compare them with what was measured, sample after sample.

        Args:
            recordings: Recordings.

        Returns:
            Absolute errors, half widths, and the share that comes from uncertain parameters, those that are not finite
            left out; and of how many samples these are.
        """
        stretches = _windows_of(recordings, self.horizon)
        columns = []
        for stretch, path in zip(stretches, self.predict(stretches), strict=True):
            error = np.abs(path.q - stretch.q)[1:]
            finite = np.isfinite(error).all(axis=1) & np.isfinite(path.half_width[1:]).all(axis=1)
            columns.append([part[finite] for part in (error, path.half_width[1:], path.from_parameters[1:])])
        found = tuple(np.concatenate(column) for column in zip(*columns, strict=True))
        return found, sum(len(stretch) - 1 for stretch in stretches) - len(found[0])


def infer_bands(result: FitResult, dataset: Dataset) -> Bands:
    """Infer how certain a trained model is, and make bands of its predictions.

    Args:
        result: What `fit` found.
        dataset: What it was fitted to.

    Returns:
        Bands of predictions; its `posterior.half_width` makes those of anything computed from the model.

    Raises:
        TypeError: If something else is given.
        ValueError: If there are too few windows of training data, or too many parameters, or no rollout stays finite.

    Example:
        >>> import numpy as np
        >>> from symoden import Dataset, TrainingConfig, fit
        >>> ts = np.linspace(0.0, 8.0, 161)
        >>> q, v = np.cos(ts)[:, None], -np.sin(ts)[:, None]
        >>> swing = Trajectory(name="swing", ts=ts, q=q, rates=v, us=np.zeros((161, 0)))
        >>> data = Dataset(name="spring", space="R1", train=(swing,))
        >>> quick = TrainingConfig(adam_steps=50, lm_steps=2, growth_steps=0, relevance_steps=0)
        >>> bands = infer_bands(fit(data, config=quick), data)
        >>> (path,) = bands.predict(data.train)
        >>> path.q.shape, path.half_width.shape
        ((161, 1), (161, 1))
    """
    for given, kind in ((result, FitResult), (dataset, Dataset)):
        if not isinstance(given, kind):
            raise TypeError(
                "Bands are made of what `fit` found and of its data set; got "
                f"{type(given).__name__} for a {kind.__name__}."
            )
    return calibrate_bands(result.posterior(dataset), hold_out(dataset, result.config), solver=result.solver)


def calibrate_bands(posterior: AbstractPosterior, dataset: Dataset, *, solver: AbstractSolver) -> Bands:
    """Find how wide bands must be.

    Args:
        posterior: What the data say of the model's parameters.
        dataset: Recordings, with the validation part that training held out.
        solver: What advances rollouts.

    Returns:
        The bands.

    Raises:
        ValueError: If there are no recordings to train on, or no rollout stays finite.
    """
    if not dataset.train:
        raise ValueError("Bands need the recordings that the model was trained on; there are none.")
    hold, horizon = HOLDS[dataset.hold], max(HORIZON, horizon_of(dataset))
    elapsed, errors = _errors(posterior.model, _windows_of(dataset.train, horizon), hold, solver)
    noise = _by_elapsed(elapsed, errors)
    bands = Bands(
        posterior=posterior,
        hold=hold,
        solver=solver,
        noise=noise,
        tail=float(np.quantile(np.abs(errors) / np.sqrt(noise(elapsed)), LEVEL)),
        factor=1.0,
        calibrated_on="train",
        horizon=horizon,
    )
    if not dataset.validation:
        return bands
    (error, half, _), lost = bands.along(dataset.validation)
    if not error.size:
        raise ValueError("Bands need rollouts that stay finite; all of those along the validation recordings diverge.")
    apart = sum(math.ceil(len(judged_windows(each, horizon)) / OVERLAP) for each in dataset.validation)
    # What diverges lies outside, however wide bands are: of the others more must lie inside.
    level = min(1.0, LEVEL * (len(error) + lost) / len(error))
    factor = float(np.quantile(error / half, level))
    if factor <= 1 and apart < _ENOUGH:
        return bands
    return dataclasses.replace(bands, factor=factor, calibrated_on="validation")


def score_bands(bands: Bands, recordings: Sequence[Trajectory], *, split: str = "test") -> BandScore:
    """See how many measured positions bands cover.

    Args:
        bands: The bands.
        recordings: Recordings that were not trained on.
        split: What they are called.

    Returns:
        The score.

    Raises:
        ValueError: If there are no recordings.
    """
    if not recordings:
        raise ValueError(f"Bands need recordings in the part `{split}` to be judged by; there are none.")
    (error, half, share), lost = bands.along(recordings)
    if not error.size:
        raise ValueError(f"Bands need rollouts that stay finite; all of those along the {split} recordings diverge.")
    horizon, finite = bands.horizon, len(error) / (len(error) + lost)  # No band holds what diverges.
    return BandScore(
        level=LEVEL,
        calibrated_on=bands.calibrated_on,
        split=split,
        horizon_s=float(np.median([min(horizon, each.duration) for each in _windows_of(recordings, horizon)])),
        coverage=float(np.mean(error <= half)) * finite,
        half_width=float(np.median(half)),
        coverages=tuple((np.mean(error <= half, axis=0) * finite).tolist()),
        half_widths=tuple(np.median(half, axis=0).tolist()),
        from_parameters=float(np.median(share)),
    )


class _Path(NamedTuple):
    """A rollout, and the variance that uncertain parameters explain."""

    elapsed: Float[np.ndarray, " T"]
    q: Float[np.ndarray, "T n"]
    variance: Float[np.ndarray, "T n"]


def judged_windows(recording: Trajectory, horizon: float) -> list[tuple[int, int]]:
    """Find the windows that bands are judged and drawn over; a recording that is shorter is one as a whole.

    Args:
        recording: Any recording.
        horizon: Their length [s].

    Returns:
        Samples [start, stop) of each.
    """
    return short_windows(recording, horizon) or [(0, len(recording))]


def _windows_of(recordings: Sequence[Trajectory], horizon: float) -> list[Stretch]:
    """Windows, of many some; a recording that is shorter, such as a held-out end, is one window."""
    found = [
        Stretch(trajectory=recording, start=start, stop=stop)
        for recording in recordings
        for start, stop in judged_windows(recording, horizon)
    ]
    return [found[i] for i in spaced_evenly(len(found), _MOST_WINDOWS)]


def _paths(
    posterior: AbstractPosterior, stretches: Sequence[Stretch], hold: Hold, solver: AbstractSolver
) -> Iterator[tuple[int, _Path]]:
    """Rollouts of stretches, each with its index."""
    with double():
        function = eqx.Partial(_predicted, posterior.scatter(), solver, hold)
    for i, (q, variance) in in_batches(function, stretches, samples=_BATCH, size=_TOGETHER):
        stretch = stretches[i]
        ts = stretch.trajectory.ts[stretch.start : stretch.stop]
        yield i, _Path(ts - ts[0], q[: len(stretch)], variance[: len(stretch)])


def _errors(
    model: AbstractDynamics, stretches: Sequence[Stretch], hold: Hold, solver: AbstractSolver
) -> tuple[Float[np.ndarray, " N"], Float[np.ndarray, "N n"]]:
    """Times since the start, and errors of predicted positions, those that are not finite left out."""
    elapsed, errors = [], []
    for i, path in paths(model, stretches, hold=hold, solver=solver):
        error = (path.q - stretches[i].q)[1:]
        finite = np.isfinite(error).all(axis=1)
        ts = stretches[i].trajectory.ts[stretches[i].start : stretches[i].stop]
        elapsed.append((ts - ts[0])[1:][finite])
        errors.append(error[finite])
    return np.concatenate(elapsed), np.concatenate(errors)


@eqx.filter_jit
def _predicted(
    scatter: AbstractScatter, solver: AbstractSolver, hold: Hold, batch: Segment
) -> tuple[Float[Array, "B T n"], Float[Array, "B T n"]]:
    """Positions, and the variance that uncertain parameters give them."""

    def one(segment: Segment) -> tuple[Array, Array]:
        def positions(model: AbstractDynamics) -> Float[Array, "T n"]:
            return roll_out(model, segment, solver=solver, hold=hold).q

        return scatter.moments(positions)

    return jax.vmap(one)(batch)


def _by_elapsed(elapsed: Float[np.ndarray, " N"], errors: Float[np.ndarray, "N n"]) -> Variances:
    """Mean squared error of each coordinate as a function of the time since the start."""
    if not len(elapsed):
        raise ValueError("Bands need rollouts that stay finite; all of those along the training recordings diverge.")
    last = float(elapsed.max())
    edges = np.linspace(0.0, last, _BINS + 1)
    which = np.clip(np.digitize(elapsed, edges) - 1, 0, _BINS - 1)
    filled = [k for k in range(_BINS) if np.any(which == k)]
    means = np.array([np.mean(errors[which == k] ** 2, axis=0) for k in filled])
    centres = (edges[:-1] + edges[1:])[filled] / 2

    def at(elapsed: Float[np.ndarray, " N"]) -> Float[np.ndarray, "N n"]:
        return np.stack([np.interp(elapsed, centres, column) for column in means.T], axis=1) + _TINY**2

    return at

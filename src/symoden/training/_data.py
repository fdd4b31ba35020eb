"""What each stage trains on: windows of the recordings, how long they are, and how rollouts are compared with them."""

import dataclasses
import warnings
from collections.abc import Sequence
from typing import Final, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Float

from symoden.blocks import count_parameters
from symoden.data import (
    ADAM_WINDOWS,
    LEVENBERG_WINDOWS,
    VALIDATION_SHARE,
    Dataset,
    DataWarning,
    Trajectory,
    WindowLength,
    halves,
    least_motion,
    measure_noise,
    spaced_evenly,
    split_validation,
    usual_steps,
    validates_by_ends,
    window_steps,
    windows,
    with_few_rests,
    without_poor_ends,
    without_spans,
)
from symoden.integrate import HOLDS, RK4
from symoden.known import PARTS
from symoden.mechanics import AbstractDynamics
from symoden.models import energies_are_given
from symoden.spaces import Space
from symoden.wording import first_few

from ._config import Span, TrainingConfig
from ._level import LEAST_WINDOWS
from ._objective import AbstractObjective, Batch, Objective, channel_order, channel_weights
from ._residuals import evaluate_loss
from ._weak_form import WeakForm

LONGER: Final = (2, 4)
"""Times as long as Levenberg-Marquardt's windows, the longer ones are."""
HARDLY_ANY: Final = 4
"""Windows of validation whose verdict is hardly one."""
_FEW_NUMBERS: Final = 100  # That a model of one coordinate learns; networks in place of its blocks have thousands.
_FEW_VALIDATE: Final = 12  # Windows of validation; where few numbers are learned, windows left out in turn tell more.
_FEWEST_IN_TURN: Final = 6  # Windows that can be left out in turn: what fewer say is chance as well.
_FEWEST_LONGER: Final = 20  # Longer windows that a recording must have room for; `_FEWEST_IN_TURN` for few numbers.
_BUMPS: Final = WindowLength(1.0, 8)  # Under bumps of fewer steps the trapezoidal rule errs too much.
_MOST_SAMPLES: Final = 2**22  # In all windows of Adam's, each sample counted in every window that has it.
_NAMED: Final = 3


class Data(NamedTuple):
    """Windows of one stage and how rollouts are compared with them.

    Attributes:
        train: Windows to fit.
        validation: Windows to choose by; None to go by the training windows.
        objective: Weights, solver and hold.
        in_turn: Whether steps are chosen by the training windows, and models judged by those that are left out in turn.
        parted: Whether some recordings are fitted, and others judge.
    """

    train: Batch
    validation: Batch | None
    objective: AbstractObjective
    in_turn: bool = False
    parted: bool = False

    @property
    def choosing(self) -> Batch:
        """Windows that steps are chosen by."""
        return self.train if self.in_turn else self.held_out

    @property
    def held_out(self) -> Batch:
        """Windows of validation; of training where there are none."""
        return self.train if self.validation is None else self.validation

    @property
    def hardly_validated(self) -> bool:
        """Whether there are hardly any windows of validation."""
        return self.validation is not None and self.validation.ts.shape[0] <= HARDLY_ANY

    def left_out_in_turn(self, dynamics: AbstractDynamics, few: int) -> "Data":
        """The same, judged by windows left out in turn where few numbers are learned, and few windows validate.

        Ends of recordings mostly rest. Four windows of them refused all that 25 numbers of a robot description learned,
        and these took the loss in training from 0.05 to 0.004. Seven kept masses that were a hundred times too small,
        for a training loss of 18000 (`benchmarks/`). More numbers keep what windows taught them that are left out.

        Args:
            dynamics: Untrained model.
            few: How many are few.

        Returns:
            The windows.
        """
        if self.validation is None or self.train.ts.shape[0] < _FEWEST_IN_TURN:
            return self
        alone = dynamics.space.size == 1 and count_parameters(dynamics, corrections=0) <= _FEW_NUMBERS
        return self._replace(in_turn=(alone or energies_are_given(dynamics)) and len(self.validation.ts) <= few)

    def validation_loss(self, model: AbstractDynamics, objective: AbstractObjective) -> float | None:
        """Loss on the validation windows, if there are any."""
        return None if self.validation is None else evaluate_loss(model, objective, self.validation)


def hold_out(dataset: Dataset, config: TrainingConfig) -> Dataset:
    """Split validation recordings off, leave spans and ends of poor velocities out, the same as `fit` does.

    Args:
        dataset: Recordings.
        config: Settings of training.

    Returns:
        The data set with its validation part.

    Raises:
        DataError: If nothing can be held out, or `left_out` has spans of other recordings or leaves nothing.
    """
    if config.validation:
        longest = max(config.horizon or ADAM_WINDOWS.least, config.lm_horizon or ADAM_WINDOWS.least)
        dataset = split_validation(dataset, config.validation, min_samples=longest + 1)
    dataset = dataclasses.replace(dataset, train=tuple(map(without_poor_ends, dataset.train)))
    return _without(dataset, config.left_out, config) if config.left_out else dataset


def _without(dataset: Dataset, spans: Sequence[Span], config: TrainingConfig) -> Dataset:
    """The same without spans that are left out; what judges stays as it was, as far as can be.

    A piece of a validation recording that is shorter than windows would make all of them shorter. Where nothing else
    is left to judge by, other recordings are held out.

    Returns:
        The data set.
    """
    steps = config.lm_horizon or _horizon(dataset, LEVENBERG_WINDOWS)
    cut = without_spans(dataset, spans)
    whole = {each.name for each in dataset.validation}
    judges = tuple(each for each in cut.validation if each.name in whole or len(each) > steps)
    cut = dataclasses.replace(cut, validation=judges)
    if judges or not dataset.validation:
        return cut
    return split_validation(cut, config.validation or VALIDATION_SHARE, min_samples=steps + 1)


def adam_data(dataset: Dataset, dynamics: AbstractDynamics, config: TrainingConfig) -> Data:
    """Cut windows at every start point, or at as many as memory is well spent on, in single precision.

    Args:
        dataset: Recordings.
        dynamics: Model, for its space.
        config: Settings of training.

    Returns:
        The windows.
    """
    horizon = config.horizon or _horizon(dataset, ADAM_WINDOWS)
    stride = max(1, sum(map(len, dataset.train)) * (horizon + 1) // _MOST_SAMPLES)
    return _data(dataset, dynamics, config, horizon=horizon, stride=stride, dtype=jnp.float32)


def levenberg_data(dataset: Dataset, dynamics: AbstractDynamics, config: TrainingConfig) -> Data:
    """Cut longer windows end to end, no sample being predicted twice, in double precision.

    Args:
        dataset: Recordings.
        dynamics: Model, for its space.
        config: Settings of training.

    Returns:
        The windows, and the sensors' noise at their starts.
    """
    horizon = config.lm_horizon or _horizon(dataset, LEVENBERG_WINDOWS)
    data = _data(dataset, dynamics, config, horizon=horizon, stride=horizon, dtype=jnp.float64)
    return _free_starts(_thinned(data, config.lm_samples), dataset).left_out_in_turn(dynamics, _FEW_VALIDATE)


def regression_data(dataset: Dataset, dynamics: AbstractDynamics, config: TrainingConfig) -> Data | None:
    """Cut windows that overlap by half, for the weak form of the equations of motion.

    They are as long as the training recordings are good for: a validation part that is too short for them judges the
    rollouts that follow, and not what they begin with.

    Args:
        dataset: Recordings.
        dynamics: Model, for its space.
        config: Settings of training.

    Returns:
        The windows, in double precision; None where momenta were recorded, or too few samples in a row.
    """
    horizon = _horizon(dataclasses.replace(dataset, validation=()), _BUMPS)
    if dataset.momenta or horizon < _BUMPS.least:
        return None
    judged = tuple(recording for recording in dataset.validation if len(recording) > horizon)
    data = _data(
        dataclasses.replace(dataset, validation=judged),
        dynamics,
        config,
        horizon=horizon,
        stride=horizon // 2,
        dtype=jnp.float64,
    )
    weights = jnp.asarray(channel_weights(data.train, dynamics)[-dynamics.space.size :], float)
    return _thinned(data._replace(objective=WeakForm(weights, HOLDS[dataset.hold])), config.lm_samples)


def _thinned(data: Data, most: int) -> Data:
    """Of more samples than that, windows that are spaced evenly."""

    def thin(batch: Batch) -> Batch:
        count, samples = batch.ts.shape
        return batch.take(spaced_evenly(count, max(1, most // samples)))

    return data._replace(train=thin(data.train), validation=None if data.validation is None else thin(data.validation))


def _free_starts(data: Data, dataset: Dataset) -> Data:
    """Let windows start from estimated states where the sensors are noisy."""
    noise = measure_noise(dataset.train)
    if not noise.is_seen:
        return data
    sensors = np.concatenate([noise.q, noise.rates])
    channels = jnp.asarray(sensors[channel_order(Space.parse(dataset.space))], float)
    return data._replace(
        objective=eqx.tree_at(lambda o: o.noise, data.objective, channels, is_leaf=lambda x: x is None)
    )


def _data(
    dataset: Dataset, dynamics: AbstractDynamics, config: TrainingConfig, *, horizon: int, stride: int, dtype: DTypeLike
) -> Data:
    """Windows on the device, and the objective on them."""
    least = least_motion(dataset.train)
    train = _cut(dataset.train, horizon, stride=stride, dtype=dtype, least=least)
    validation = None
    if dataset.validation:
        validation = _cut(dataset.validation, horizon, stride=stride, dtype=dtype, least=least)
    channels = dynamics.space.embedded_size + dynamics.space.size
    weights = channel_weights(train, dynamics) if config.scaled_loss else np.ones(channels)
    solver = RK4(config.substeps, unroll=config.unroll)
    objective = Objective(
        jnp.asarray(weights, dtype),
        solver,
        HOLDS[dataset.hold],
        unroll=config.unroll,
        measured=_measured(dataset.train, dynamics.space, dtype),
    )
    return Data(train, validation, objective)


def _measured(recordings: Sequence[Trajectory], space: Space, dtype: DTypeLike) -> Float[Array, " o"] | None:
    """1 for every channel that was measured, 0 for rates that were estimated from positions; None without such."""
    if any(each.noise_gain is None for each in recordings):
        return None
    return jnp.asarray(channel_order(space) < space.size, dtype)


def _horizon(dataset: Dataset, length: WindowLength) -> int:
    """Steps of windows."""
    return window_steps(dataset, length, Space.parse(dataset.space).is_angle)


def name_short(dataset: Dataset, data: Data) -> None:
    """Warn of recordings that no window fits into.

    Args:
        dataset: Recordings.
        data: Windows of them.

    Warns:
        DataWarning: If there are such.
    """
    samples = data.train.ts.shape[1]
    short = [recording.name for recording in dataset.train + dataset.validation if len(recording) < samples]
    if short:
        names = first_few((f"`{name}`" for name in short), _NAMED)
        message = f"{len(short)} of the recordings ({names}) are shorter than a window of {samples} samples: left out"
        warnings.warn(message, DataWarning, stacklevel=2)


def name_held(dataset: Dataset) -> None:
    """Warn of arrays in known functions, as of a network, which are not learned.

    Args:
        dataset: Recordings, and what is known.

    Warns:
        DataWarning: If there are such.
    """
    parts = {} if dataset.known is None else {name: getattr(dataset.known, name) for name in PARTS}
    held = [name for name, part in parts.items() if callable(part) and any(map(eqx.is_array, jax.tree.leaves(part)))]
    if held:
        message = (
            f"the arrays in the known {', '.join(f'`{name}`' for name in held)} stay as they are: what is learned of a "
            "known part are the `parameters` of its formulas, and what `correct` adds"
        )
        warnings.warn(message, DataWarning, stacklevel=2)


def name_thinned(dataset: Dataset, data: Data, config: TrainingConfig) -> None:
    """Warn of long logs of which Levenberg-Marquardt predicts a part.

    Args:
        dataset: Recordings.
        data: Windows of them.
        config: Settings of training.

    Warns:
        DataWarning: If these are such.
    """
    samples = sum(map(len, dataset.train))
    if samples > config.lm_samples:
        message = (
            f"Levenberg-Marquardt predicts {data.train.ts.size} of the {samples} training samples, in windows that are "
            "spaced evenly (`TrainingConfig.lm_samples` says how many)"
        )
        warnings.warn(message, DataWarning, stacklevel=2)


def _cut(
    recordings: Sequence[Trajectory], horizon: int, *, stride: int, dtype: DTypeLike, least: Float[np.ndarray, " n"]
) -> Batch:
    """Windows of the recordings that are long enough, few of them at rest."""
    long = [recording for recording in recordings if len(recording) > horizon]
    return Batch.of(with_few_rests(windows(long or recordings, horizon, stride=stride), least), dtype)


def longer_data(dataset: Dataset, dynamics: AbstractDynamics, data: Data, config: TrainingConfig) -> list[Data]:
    """Cut longer windows still, as far as there are enough; those of validation are as long as can be.

    What friction and gravity do to a swing adds up over its periods, while the error of the first state does not: the
    longer a rollout, the more it tells of the mechanism, once a model is good enough to follow it.

    Args:
        dataset: Recordings.
        dynamics: Model, for its space.
        data: The windows so far.
        config: Settings of training.

    Returns:
        Windows twice and four times as long.
    """
    fewest = _FEWEST_IN_TURN if data.in_turn or energies_are_given(dynamics) else _FEWEST_LONGER
    found = []
    for factor in LONGER if config.lm_horizon is None else ():
        horizon = factor * (data.train.ts.shape[1] - 1)
        if 2 * horizon > usual_steps(dataset.train, 2 * horizon):  # As of shorter ones, two or more fill a recording.
            break
        blind = dataclasses.replace(dataset, validation=())
        long = _data(blind, dynamics, config, horizon=horizon, stride=horizon, dtype=jnp.float64)
        if dataset.validation:
            steps = min(horizon, usual_steps(dataset.validation, horizon))
            least = least_motion(dataset.train)
            validation = _cut(dataset.validation, steps, stride=steps, dtype=jnp.float64, least=least)
            long = long._replace(validation=validation)
        long = _thinned(long, config.lm_samples).left_out_in_turn(dynamics, HARDLY_ANY)
        alone = long.validation is not None and long.validation.ts.shape[0] == 1 and not long.in_turn
        if long.train.ts.shape[0] < fewest or alone:  # A single window hardly speaks against them.
            break
        found.append(_free_starts(long, dataset))
    return found


def across_recordings(dataset: Dataset, dynamics: AbstractDynamics, data: Data, config: TrainingConfig) -> Data | None:
    """Windows of half of the recordings to fit, and of the others to choose by, where ends of recordings do else.

    A thousand numbers of networks learn what is peculiar to every recording, as the zeros of encoders are. Its end has
    the same peculiarity, so that its loss falls too, and other recordings are predicted worse (`benchmarks/`).

    Args:
        dataset: Recordings, with their validation part.
        dynamics: Model, for its space.
        data: Windows of all of them.
        config: Settings of training.

    Returns:
        The windows, as long as these and compared as they are; None where validation recordings are others already, or
        windows of either half are too few to tell how much they vary.
    """
    horizon = data.train.ts.shape[1] - 1
    sides = halves([each for each in dataset.train if len(each) > horizon])
    fewest = min(sum((len(recording) - 1) // horizon for recording in side) for side in sides)
    if fewest < LEAST_WINDOWS or not validates_by_ends(dataset):
        return None
    parted = dataclasses.replace(dataset, train=sides[0], validation=sides[1])
    cut = _data(parted, dynamics, config, horizon=horizon, stride=horizon, dtype=jnp.float64)
    return _thinned(cut._replace(objective=data.objective, parted=True), config.lm_samples)

"""What training begins with: the recordings held out, untrained models, and the stages."""

import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from symoden.blocks import count_parameters, kinds_in_use, trainable
from symoden.data import DataError, Dataset, check_trainable
from symoden.mechanics import AbstractDynamics
from symoden.models import ModelConfig, StructuredModel, awaken, build, check_savable
from symoden.spaces import Space
from symoden.storage import StorageError

from ._config import TrainingConfig
from ._data import hold_out, name_held, regression_data
from ._disturbances import Screening, screening_of
from ._first_guess import begin_with, can_be_guessed, guess, silent
from ._flatten import cast
from ._gauss_newton import MOST_SOLVED
from ._line_up import can_regress, line_up
from ._scales import measure_scales
from ._stages import AbstractStage
from ._state import Incumbent, TrainingState
from ._weighing import Weighing


class Prepared(NamedTuple):
    """What training begins with.

    Attributes:
        stages: What it goes through.
        state: Before the first of them.
        fresh: Makes untrained models from the number of a draw.
        screening: What looks for disturbances by the way, if anything.
    """

    stages: list[AbstractStage]
    state: TrainingState
    fresh: Callable[..., AbstractDynamics]
    screening: Screening | None


def prepare(
    dataset: Dataset,
    model: ModelConfig,
    config: TrainingConfig,
    guessing: Callable[[int, int, float], None] = silent,
    *,
    saved: bool = False,
    screened: bool = False,
) -> Prepared:
    """Split the recordings, make untrained models, and line up the stages.

    Args:
        dataset: Recordings.
        model: Settings of the model.
        config: Settings of training.
        guessing: Told how a first guess comes along.
        saved: Whether the model is to be saved.
        screened: Whether disturbances are to be looked for.

    Returns:
        What training begins with.

    Raises:
        DataError: If the recordings cannot be trained on.
        ValueError: If there is nothing to learn, or too much.
        StorageError: If the model could not be saved after training.
    """
    if not dataset.train:
        raise DataError(f"`{dataset.name}`: training must have recordings in `train`; got none.")
    check_trainable(dataset)
    name_held(dataset)
    whole, dataset = dataset, hold_out(dataset, config)
    if saved and dataset.known is not None:
        _check_savable(_drawing(dataset, model, config)(0))  # Before guesses and training take their time.
    fresh = _builder(dataset, model, config, guessing)
    dynamics = fresh(0)
    restarts = config.restarts if config.adam_steps else 0
    candidates = [fresh(number, awake=number > 0) for number in range(restarts)]  # First a V that is a polynomial.
    awake = (fresh(number, awake=True) for number in range(2))
    undrawn = bool(eqx.tree_equal(*(eqx.filter(one, trainable(one, corrections=kinds_in_use(one))) for one in awake)))
    guessed = _is_guessed(dataset)
    if config.lm_steps and undrawn:  # From a guess that a user gave, Levenberg-Marquardt finds the bottom alone.
        candidates = candidates[: 0 if guessed else 1]
    size = count_parameters(dynamics)
    if not size:
        raise ValueError("Training must have something to learn; every part is given. Leave a number or a part open.")
    if config.lm_steps and size > MOST_SOLVED:
        raise ValueError(
            f"Levenberg-Marquardt must have at most {MOST_SOLVED} numbers to learn, as its matrices hold the squares; "
            f"the model has {size}. Take smaller networks, or Adam alone: `lm_steps=0`."
        )
    stages = line_up(dataset, dynamics, candidates, config, regress_first=undrawn and not guessed)
    if not stages:
        raise ValueError(
            "Training must have something to learn; every part is given, and corrections of these need `lm_steps` and "
            f"`growth_steps`; got {config.lm_steps} and {config.growth_steps}. Take the preset `default`."
        )
    weighing = Weighing.alike(dynamics.space)
    state = TrainingState(
        stage=0,
        step=0,
        model=dynamics,
        memory=None,
        damping=config.damping,
        substeps=(config.lm_substeps or 1) if config.lm_steps else config.substeps,
        weighing=weighing,
        best=dynamics,
        best_loss=math.inf,
        origin=0,
        stale=0,
        incumbent=Incumbent(dynamics, None, 0, weighing, rival=dynamics),
    )
    screened = screened and can_regress(dynamics, config)
    screening = screening_of(whole, dataset, dynamics, stages, config) if screened else None
    return Prepared(stages, state, fresh, screening)


def _is_guessed(dataset: Dataset) -> bool:
    """Whether known parts have parameters, of which a user gave a guess."""
    return dataset.known is not None and bool(dataset.known.parameters or dataset.known.robot)


def _check_savable(dynamics: AbstractDynamics) -> None:
    """Refuse a model that could not be saved after training."""
    try:
        check_savable(dynamics)
    except StorageError as error:
        raise StorageError(f"{error} To train without files, leave `folder` out.") from None


def _builder(
    dataset: Dataset, model: ModelConfig, config: TrainingConfig, guessing: Callable[[int, int, float], None]
) -> Callable[..., AbstractDynamics]:
    """What makes untrained models from the number of a draw, networks of V awake or not (see `awaken`)."""
    draw = _drawing(dataset, model, config)
    untouched = draw(0)
    if not isinstance(untouched, StructuredModel) or not can_regress(untouched, config):
        return draw
    windows = regression_data(dataset, untouched, config) if can_be_guessed(untouched) else None
    if windows is None:
        return draw
    first = guess(cast(untouched, jnp.float64), windows, guessing)
    known = dataset.known
    if first.drives is not None and known is not None and known.robot is not None:
        # Natural units follow: those of a wrist whose drive outweighs it are not those of its weight.
        driven = dataclasses.replace(known, robot=known.robot.with_drives(first.drives.tolist()))
        draw = _drawing(dataclasses.replace(dataset, known=driven), model, config)

    def begun(number: int, *, awake: bool = False) -> AbstractDynamics:
        drawn = draw(number, awake=awake)
        return begin_with(drawn, first) if isinstance(drawn, StructuredModel) else drawn

    return begun


def _drawing(dataset: Dataset, model: ModelConfig, config: TrainingConfig) -> Callable[..., AbstractDynamics]:
    """What makes models from the number of a draw, whatever the recordings say of inputs and friction."""
    space = Space.parse(dataset.space)
    scales = None
    if model.scaled:
        scales = measure_scales(
            dataset.train, space, momenta=dataset.momenta, input_matrix=dataset.input_matrix, known=dataset.known
        )

    def drawn(number: int, *, awake: bool = False) -> AbstractDynamics:
        key = jax.random.fold_in(jax.random.key(config.seed), number)
        made = build(
            model,
            space,
            dataset.inputs,
            momenta=dataset.momenta,
            scales=scales,
            input_matrix=dataset.input_matrix,
            known=dataset.known,
            key=key,
        )
        return awaken(made, key=jax.random.fold_in(key, 1)) if awake else made

    return drawn

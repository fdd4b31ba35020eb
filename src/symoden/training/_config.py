"""Settings of training."""

import math
import numbers
from dataclasses import dataclass
from typing import TypeAlias

from symoden.data import VALIDATION_SHARE

Span: TypeAlias = tuple[str, float, float]
"""A recording's name, and where a span of it begins and ends in its own time [s]."""


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """Settings of training; the defaults were chosen by measurement (see `benchmarks/`).

    Attributes:
        seed: Source of the initial weights and of the batches.
        validation: Share of the training recordings to hold out for validation; 0 holds none out.
        horizon: Steps that Adam predicts from each start point; chosen from the data's time scale if None.
        substeps: RK4 steps in each sampling interval while Adam runs.
        unroll: Write Adam's rollouts out instead of looping over steps: slower to compile, faster for networks of the
            paper's size over few steps.
        restarts: Number of initial weights that Adam starts from; the one with the least validation loss goes on (the
            least training loss without validation).
        adam_steps: Number of Adam's steps from each of them; none where a regression has found the basin, which comes
            first on three coordinates and more.
        batch_size: Windows in one of Adam's steps.
        shuffle: Draw windows at random; otherwise take consecutive blocks in turn, as the paper does.
        learning_rate: Adam's first learning rate.
        cosine: Let the learning rate fall to zero along a cosine.
        clip: Largest norm of the gradient; None for no limit.
        weight_decay: Factor of the L2 term in the gradient.
        keep_best: Keep the model with the least validation loss; otherwise Adam's last one, as in the paper.
        scaled_loss: Weigh each channel by the spread of its change over a window; the paper weighs all alike.
        lm_steps: Largest number of Levenberg-Marquardt steps; 0 leaves the phase out.
        lm_horizon: Steps that Levenberg-Marquardt predicts; chosen from the data's time scale if None, and at the end
            doubled twice, unless validation speaks clearly against it.
        lm_substeps: RK4 steps in each sampling interval then; chosen by their error if None.
        lm_samples: Most samples that it predicts in a step; of long logs, windows that are spaced evenly hold so many.
        damping: First Levenberg-Marquardt damping, relative to the diagonal of JᵀJ.
        prior: Precision λ of the Gaussian prior on every (dimensionless) parameter in Levenberg-Marquardt: its standard
            deviation is 1/√λ, whatever the noise; where priors are learned, the first one.
        patience: Steps without a gain on the validation data after which Levenberg-Marquardt stops; where something is
            set free, without a clear one on the training data either.
        growth_steps: Largest number of steps of each stage that sets something free (lengths in the inertia, a g that
            depends on the configuration, a V of other shapes, friction's laws, both together, what depends on the
            direction, and at the end networks), and of the refit after priors are learned. What is set free stays so
            if validation gains clearly (by what chance does once in twenty), friction's laws if by a standard error.
            Networks stay closed where more than 4000 numbers would be free with them, as on arms of four joints and
            more. 0 leaves all of these stages out, and longer windows.
        relevance_steps: Steps after friction, and half as many in longer windows, in which every group of parameters
            learns a prior of its own, so that noisy data use no more parameters than they determine; kept unless
            validation speaks against it.
        left_out: Spans of training and validation recordings that nothing is learned from. If None, training looks for
            those in which something moves the machine that neither its inputs nor a good model explains, as a push, a
            stop or a wrong sample does, and begins anew without them, with a warning; `FitResult.config` has them.
    """

    seed: int = 0
    validation: float = VALIDATION_SHARE
    horizon: int | None = None
    substeps: int = 1
    unroll: bool = False
    restarts: int = 3
    adam_steps: int = 600
    batch_size: int = 256
    shuffle: bool = True
    learning_rate: float = 1e-2
    cosine: bool = True
    clip: float | None = 1.0
    weight_decay: float = 0.0
    keep_best: bool = True
    scaled_loss: bool = True
    lm_steps: int = 20
    lm_horizon: int | None = None
    lm_substeps: int | None = None
    lm_samples: int = 2**15
    damping: float = 1e-4
    prior: float = 1.0
    patience: int = 4
    growth_steps: int = 40
    relevance_steps: int = 60
    left_out: tuple[Span, ...] | None = None

    def __post_init__(self) -> None:
        """Refuse settings that cannot train.

        Raises:
            ValueError: If a count is below its least value, or a share or a number is out of range.
        """
        least = {
            "seed": 0,
            "substeps": 1,
            "restarts": 1,
            "adam_steps": 0,
            "batch_size": 1,
            "lm_steps": 0,
            "lm_samples": 1,
            "patience": 1,
            "growth_steps": 0,
            "relevance_steps": 0,
        }
        for name, bound in least.items():
            if not _is_count(getattr(self, name), bound):
                raise ValueError(f"`{name}` must be a whole number of at least {bound}; got {getattr(self, name)}.")
        if not (self.adam_steps or self.lm_steps):
            raise ValueError(
                "Training must have steps; `adam_steps` and `lm_steps` are both 0. Leave one at its default."
            )
        for name in ("horizon", "lm_horizon", "lm_substeps"):
            value = getattr(self, name)
            if value is not None and not _is_count(value, 1):
                raise ValueError(
                    f"`{name}` must be a whole number of at least 1, or None to choose it from the data; got {value}."
                )
        _refuse_numbers(self)
        if self.left_out is not None:
            object.__setattr__(self, "left_out", _spans(self.left_out))


def _is_count(value: object, least: int) -> bool:
    """Whether a setting is a whole number, and large enough."""
    return isinstance(value, numbers.Integral) and int(value) >= least


def _spans(given: object) -> tuple[Span, ...]:
    """Spans of recordings, in order, each once."""
    message = "`left_out` must have spans as (name of a recording, begin, end) [s], that end after they begin"
    try:
        spans = sorted({(str(name), float(start), float(end)) for name, start, end in given})  # pyright: ignore[reportGeneralTypeIssues]
    except (TypeError, ValueError):
        raise ValueError(f"{message}; got {given!r}.") from None
    for name, start, end in spans:
        if not -math.inf < start < end < math.inf:
            raise ValueError(f"{message}; got {start} to {end} of `{name}`.")
    return tuple(spans)


def _refuse_numbers(config: TrainingConfig) -> None:
    """Refuse numbers that are no counts and out of range, NaN included."""
    if not 0 <= config.validation < 1:
        raise ValueError(f"`validation` must be at least 0 and below 1; got {config.validation}.")
    if config.clip is not None and not config.clip > 0:
        raise ValueError(f"`clip` must be positive, or None for no limit; got {config.clip}.")
    for name in ("learning_rate", "damping"):
        if not 0 < getattr(config, name) < math.inf:
            raise ValueError(f"`{name}` must be positive and finite; got {getattr(config, name)}.")
    for name in ("weight_decay", "prior"):
        if not 0 <= getattr(config, name) < math.inf:
            raise ValueError(f"`{name}` must be at least 0 and finite; got {getattr(config, name)}.")

"""Which samples of a recording tell its first state, and how far rates are off there that were estimated."""

from typing import Final

import numpy as np
from jaxtyping import Float64

from symoden.data._trajectory import Trajectory

from ._velocities import one_sided_errors

_POOR: Final = 0.03  # Of the largest usual rate, by which an estimate at an end may be off.
_MOST_SAMPLES: Final = 8_192  # From the middle of a recording: many begin and end at rest.


def first_samples(recording: Trajectory) -> int:
    """How many samples of a recording tell its first state.

    Args:
        recording: The recording.

    Returns:
        Its `initial_samples`; where that is one, and rates were estimated that are far off at the ends, as many as an
        estimate took.
    """
    if recording.noise_gain is None or recording.initial_samples > 1:
        return recording.initial_samples
    # Of a joint that rests, rates are noise: it is the one that moves most whose rates are usual.
    is_poor = rate_errors_at_ends(recording).max() > _POOR * _usual_rates(recording).max()
    return min(_span(recording), len(recording) - 1) if is_poor else 1


def rate_errors_at_ends(recording: Trajectory) -> Float64[np.ndarray, " n"]:
    """How far estimated rates are off at the ends of a recording, where their samples are on one side alone.

    Args:
        recording: One whose rates were estimated.

    Returns:
        Root mean square for each coordinate; where it is too short to tell, as far as its rates go.
    """
    start = max(0, (len(recording) - _MOST_SAMPLES) // 2)
    part = slice(start, start + _MOST_SAMPLES)
    errors = one_sided_errors(recording.ts[part], recording.q[part], span=_span(recording))
    return np.where(np.isfinite(errors), errors, _usual_rates(recording))


def _usual_rates(recording: Trajectory) -> Float64[np.ndarray, " n"]:
    """Root mean square of the rates."""
    return np.sqrt(np.mean(recording.rates**2, axis=0))


def _span(recording: Trajectory) -> int:
    """Number of samples that an estimate of the rates took."""
    return 1 + 2 * round(recording.one_sided / float(np.median(np.diff(recording.ts))))

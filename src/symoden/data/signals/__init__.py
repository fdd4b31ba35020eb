"""What single signals tell: noise, slopes, time scales, delays; and the same signals at other times."""

from ._delay import advance_positions as advance_positions, delay_inputs as delay_inputs
from ._first_samples import first_samples as first_samples, rate_errors_at_ends as rate_errors_at_ends
from ._kinematics import (
    AGREES as AGREES,
    TURN as TURN,
    UNRELATED as UNRELATED,
    Accuracy as Accuracy,
    Ratio as Ratio,
    blocks as blocks,
    delays as delays,
    displacement as displacement,
    jumps as jumps,
    velocity_ratio as velocity_ratio,
)
from ._lag import lag_inputs as lag_inputs, settling as settling
from ._noise import SensorNoise as SensorNoise, measure_noise as measure_noise
from ._resample import centred_mean as centred_mean, held_mean as held_mean, resample as resample
from ._signals import (
    deviation as deviation,
    least_change as least_change,
    longest_step as longest_step,
    noise_level as noise_level,
    quantum as quantum,
    shares_cut_off as shares_cut_off,
    standstills as standstills,
    usual_step as usual_step,
    whole_steps as whole_steps,
)
from ._spans import choose_spans as choose_spans
from ._time_scale import least_lively as least_lively, time_scales as time_scales
from ._velocities import estimate_velocities as estimate_velocities, velocity_noise_gain as velocity_noise_gain

__all__ = [
    "AGREES",
    "TURN",
    "UNRELATED",
    "Accuracy",
    "Ratio",
    "SensorNoise",
    "advance_positions",
    "blocks",
    "centred_mean",
    "choose_spans",
    "delay_inputs",
    "delays",
    "deviation",
    "displacement",
    "estimate_velocities",
    "first_samples",
    "held_mean",
    "jumps",
    "lag_inputs",
    "least_change",
    "least_lively",
    "longest_step",
    "measure_noise",
    "noise_level",
    "quantum",
    "rate_errors_at_ends",
    "resample",
    "settling",
    "shares_cut_off",
    "standstills",
    "time_scales",
    "usual_step",
    "velocity_noise_gain",
    "velocity_ratio",
    "whole_steps",
]

"""Recorded motion: trajectories, data sets of trajectories of any length, windows; files of them."""

from ._check import check_dataset as check_dataset
from ._dataset import Dataset as Dataset
from ._dataset_check import DatasetCheck as DatasetCheck, RecordingCheck as RecordingCheck
from ._errors import DataError as DataError, DataWarning as DataWarning
from ._findings import Finding as Finding
from ._horizons import (
    ADAM_WINDOWS as ADAM_WINDOWS,
    LEVENBERG_WINDOWS as LEVENBERG_WINDOWS,
    WindowLength as WindowLength,
    usual_steps as usual_steps,
    window_steps as window_steps,
    without_poor_ends as without_poor_ends,
)
from ._read_dataset import read_dataset as read_dataset
from ._split import (
    VALIDATION_SHARE as VALIDATION_SHARE,
    halves as halves,
    segments as segments,
    split_validation as split_validation,
    validates_by_ends as validates_by_ends,
    whole_name as whole_name,
)
from ._trainable import check_trainable as check_trainable, states as states
from ._trajectory import Trajectory as Trajectory, median_step as median_step
from ._windows import (
    FEWEST_LOGS as FEWEST_LOGS,
    Windows as Windows,
    least_motion as least_motion,
    spaced_evenly as spaced_evenly,
    windows as windows,
    with_few_rests as with_few_rests,
)
from ._without_spans import without_spans as without_spans
from ._write_dataset import write_dataset as write_dataset
from .description import Unreadable as Unreadable
from .files import Table as Table
from .logs import ChannelFacts as ChannelFacts, Log as Log
from .signals import (
    SensorNoise as SensorNoise,
    choose_spans as choose_spans,
    estimate_velocities as estimate_velocities,
    first_samples as first_samples,
    least_lively as least_lively,
    measure_noise as measure_noise,
    rate_errors_at_ends as rate_errors_at_ends,
    resample as resample,
    time_scales as time_scales,
    usual_step as usual_step,
    velocity_noise_gain as velocity_noise_gain,
)

__all__ = [
    "ADAM_WINDOWS",
    "FEWEST_LOGS",
    "LEVENBERG_WINDOWS",
    "VALIDATION_SHARE",
    "ChannelFacts",
    "DataError",
    "DataWarning",
    "Dataset",
    "DatasetCheck",
    "Finding",
    "Log",
    "RecordingCheck",
    "SensorNoise",
    "Table",
    "Trajectory",
    "Unreadable",
    "WindowLength",
    "Windows",
    "check_dataset",
    "check_trainable",
    "choose_spans",
    "estimate_velocities",
    "first_samples",
    "halves",
    "least_lively",
    "least_motion",
    "measure_noise",
    "median_step",
    "rate_errors_at_ends",
    "read_dataset",
    "resample",
    "segments",
    "spaced_evenly",
    "split_validation",
    "states",
    "time_scales",
    "usual_step",
    "usual_steps",
    "validates_by_ends",
    "velocity_noise_gain",
    "whole_name",
    "window_steps",
    "windows",
    "with_few_rests",
    "without_poor_ends",
    "without_spans",
    "write_dataset",
]

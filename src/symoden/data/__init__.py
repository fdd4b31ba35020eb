"""Recorded motion: trajectories, data sets of trajectories of any length, windows, and reading them from files."""

from ._dataset import Dataset as Dataset
from ._errors import DataError as DataError
from ._read_dataset import read_dataset as read_dataset
from ._resample import resample as resample
from ._split import segments as segments, split_validation as split_validation
from ._trajectory import Trajectory as Trajectory
from ._velocities import estimate_velocities as estimate_velocities
from ._windows import Windows as Windows, windows as windows

__all__ = [
    "DataError",
    "Dataset",
    "Trajectory",
    "Windows",
    "estimate_velocities",
    "read_dataset",
    "resample",
    "segments",
    "split_validation",
    "windows",
]

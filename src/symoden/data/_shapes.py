"""Shapes of recorded signals: T samples of n coordinates and m inputs, B windows of h + 1 samples."""

from typing import TypeAlias

import numpy as np
from jaxtyping import Float64

Times: TypeAlias = Float64[np.ndarray, " T"]
Positions: TypeAlias = Float64[np.ndarray, "T n"]
Rates: TypeAlias = Float64[np.ndarray, "T n"]  # velocities or momenta, as the data state it
Inputs: TypeAlias = Float64[np.ndarray, "T m"]
Signals: TypeAlias = Float64[np.ndarray, "T k"]

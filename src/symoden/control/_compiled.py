"""A controller as a plain function of arrays, fast enough for a control loop."""

from typing import Literal, final

import jax
import numpy as np
from jaxtyping import Float

from symoden.shapes import Coordinates, Inputs, Scalar, Velocities

from ._controller import AbstractController

OnNan = Literal["error", "safe"]


@final
class Compiled:
    """Controller compiled ahead of its first call, from arrays to an array.

    Attributes:
        controller: What was compiled.
        on_nan: What happens if a measurement is not finite: "error" raises, "safe" gives the safe input.
        safe: The safe input.

    Example:
        >>> from symoden.control import EnergyShaping
        >>> from symoden.systems import Pendulum
        >>> control = Compiled(EnergyShaping.of(Pendulum(), [3.14], limits=15.0), on_nan="safe")
        >>> control(np.array([np.nan]), np.array([0.0])).tolist()
        [0.0]
    """

    def __init__(
        self, controller: AbstractController, *, on_nan: OnNan = "error", safe: Float[np.ndarray, " m"] | None = None
    ) -> None:
        """Compile for single states.

        Args:
            controller: What to compile.
            on_nan: What to do if a measurement is not finite.
            safe: The safe input; zero if absent.

        Raises:
            ValueError: If the safe input is not within the limits.
        """
        limits = np.asarray(controller.limits)
        self.controller, self.on_nan = controller, on_nan
        self.safe = np.zeros(limits.shape, limits.dtype) if safe is None else np.asarray(safe, limits.dtype)
        if self.safe.shape != limits.shape or not np.all(np.abs(self.safe) <= limits):
            raise ValueError(f"The safe input must be within the limits {limits.tolist()}; got {self.safe.tolist()}.")
        self._shape = (controller.space.size,)
        self._dtype = limits.dtype
        state = jax.ShapeDtypeStruct(self._shape, self._dtype)
        time = jax.ShapeDtypeStruct((), self._dtype)

        def call(q: Coordinates, v: Velocities, t: Scalar) -> Inputs:
            return controller(q, v, t)

        self._call = jax.jit(call).lower(state, state, time).compile()

    def __call__(
        self, q: Float[np.ndarray, " n"], v: Float[np.ndarray, " n"], t: float = 0.0
    ) -> Float[np.ndarray, " m"]:
        """Input for a measured state.

        Args:
            q: Coordinates.
            v: Velocities.
            t: Time [s], for controllers that follow a reference.

        Returns:
            The input.

        Raises:
            ValueError: If a number is not finite and `on_nan` is "error", or sizes are wrong.
        """
        q, v = np.asarray(q, self._dtype), np.asarray(v, self._dtype)
        if q.shape != self._shape or v.shape != self._shape:
            raise ValueError(f"A measurement must have {self._shape[0]} coordinates; got {q.shape} and {v.shape}.")
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            if self.on_nan == "safe":
                return self.safe.copy()
            raise ValueError(
                f"Measurements must be finite; got q = {q.tolist()}, v = {v.tolist()}. Handle the lost sample, or "
                'compile the controller with on_nan="safe".'
            )
        return np.asarray(self._call(q, v, np.asarray(t, self._dtype)))

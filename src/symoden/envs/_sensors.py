"""How the positions and velocities of a mechanism are read off an environment."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import gymnasium
import numpy as np
from gymnasium.envs.classic_control import PendulumEnv

from ._mechanism import MechanismEnv

if TYPE_CHECKING:
    from gymnasium.envs.mujoco import MujocoEnv

Reading: TypeAlias = tuple[np.ndarray, np.ndarray]
Read: TypeAlias = Callable[[gymnasium.Env, Any, Mapping[str, Any]], Reading | None]

_SLIDE, _HINGE = 2, 3  # MuJoCo's `mjtJoint`


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """How a mechanism's motion is read off an environment.

    Attributes:
        space: Configuration space, such as "R1 T1": one factor per position.
        dt: Time between two actions [s].
        read: From the environment, what it shows and its `info` to positions and velocities; nothing where the motion
            is no longer that of the mechanism alone (an end stop is reached), which ends the recording.
        momenta: Whether momenta are read rather than velocities.
        staggered: Whether the environment takes one step of semi-implicit Euler between two actions, so that velocities
            are those of half a step before the positions, and inputs act from half a step before their sample to half a
            step after it. Each velocity is then averaged with the next, and inputs are joined by straight lines (hold
            "linear"): what remains is of the order dt² instead of dt.

    Example:
        >>> Sensors.columns("R1 T1", dt=0.02, positions=[0, 2], velocities=[1, 3]).space
        'R1 T1'
    """

    space: str
    dt: float
    read: Read
    momenta: bool = False
    staggered: bool = False

    @classmethod
    def columns(cls, space: str, *, dt: float, positions: Sequence[int], velocities: Sequence[int]) -> "Sensors":
        """Take entries of the observation, for environments that show positions and velocities themselves.

        Args:
            space: Configuration space, such as "R1 T1".
            dt: Time between two actions [s].
            positions: Indices of the positions, angles in rad.
            velocities: Indices of the velocities.

        Returns:
            The sensors.
        """

        def read(env: gymnasium.Env, observation: Any, info: Mapping[str, Any]) -> Reading:  # noqa: ANN401
            del env, info
            seen = np.asarray(observation, np.float64)
            return seen[list(positions)], seen[list(velocities)]

        return cls(space=space, dt=dt, read=read)


def sensors_of(env: gymnasium.Env) -> Sensors:
    """Sensors of an environment whose motion is known to be readable.

    These are a `MechanismEnv`; Gymnasium's `Pendulum-v1`, which counts its angle from the upward vertical, is
    `staggered`, and is recorded until its limit on the velocity acts; and MuJoCo's mechanisms of slides and hinges,
    which are recorded until a contact or an end stop acts.

    Args:
        env: The environment.

    Returns:
        Its sensors.

    Raises:
        ValueError: If the environment is another one, or has joints that are neither slides nor hinges.
    """
    inner = env.unwrapped
    if isinstance(inner, MechanismEnv):
        name = "p" if inner.dynamics.momenta else "v"
        return Sensors(
            space=str(inner.dynamics.space),
            dt=inner.dt,
            read=lambda env, observation, info: (info["q"], info[name]),
            momenta=inner.dynamics.momenta,
        )
    if isinstance(inner, PendulumEnv):
        return Sensors(space="T1", dt=inner.dt, read=_read_pendulum, staggered=True)
    if any(cls.__name__ == "MujocoEnv" for cls in type(inner).__mro__):
        return _mujoco_sensors(cast("MujocoEnv", inner))
    raise ValueError(
        f"The motion of {env} cannot be read without `sensors`. Give `Sensors.columns(...)` or `Sensors(read=...)`."
    )


def _read_pendulum(env: gymnasium.Env, observation: Any, info: Mapping[str, Any]) -> Reading | None:  # noqa: ANN401
    """Angle and velocity, unless the velocity is at its limit."""
    del observation, info
    inner = cast("PendulumEnv", env.unwrapped)
    q, v = np.split(np.array(inner.state, np.float64), 2)
    return None if abs(v.item()) >= inner.max_speed else (q, v)


def _mujoco_sensors(inner: "MujocoEnv") -> Sensors:
    """Joints as MuJoCo has them."""
    kinds = inner.model.jnt_type
    if not np.isin(kinds, (_SLIDE, _HINGE)).all():
        raise ValueError(f"The joints of {inner} must be slides and hinges; it has free joints or balls as well.")
    space = " ".join("T1" if kind == _HINGE else "R1" for kind in kinds)
    return Sensors(space=space, dt=inner.dt, read=_read_mujoco)


def _read_mujoco(env: gymnasium.Env, observation: Any, info: Mapping[str, Any]) -> Reading | None:  # noqa: ANN401
    """Positions and velocities, unless something touches or a joint would be at its end one period on."""
    del observation, info
    inner = cast("MujocoEnv", env.unwrapped)
    q, v = np.array(inner.data.qpos), np.array(inner.data.qvel)
    limited, (low, high) = inner.model.jnt_limited.astype(bool), inner.model.jnt_range.T
    ahead = np.stack([q, q + inner.dt * v])
    stopped = limited & ((ahead.min(axis=0) <= low) | (ahead.max(axis=0) >= high))
    return None if inner.data.ncon or stopped.any() else (q, v)

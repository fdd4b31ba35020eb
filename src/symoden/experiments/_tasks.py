"""The paper's tasks: a system, how it is observed, and where its trajectories start."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from types import MappingProxyType
from typing import Final, TypeAlias

from symoden.mechanics import AbstractMechanical
from symoden.systems import MACHINES, Pendulum

from ._paper import PAPER, PaperErrors

Bounds: TypeAlias = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """A system to be learned from its simulated trajectories.

    Every initial condition is simulated under every input, which is constant along a trajectory.

    Attributes:
        name: Name on the command line and in results.
        system: The true system; `system.momenta` says whether momenta or velocities are observed.
        space: Configuration space that models are told, as `Space.parse` reads it. Task 1 calls its angle a number.
        dt: Sampling interval [s].
        position_bounds: Lowest and highest initial value of each coordinate [m or rad], drawn uniformly.
        rate_bounds: The same of each velocity or momentum.
        input_values: Inputs [N or N m], one vector for each trajectory from an initial condition.
        position_names: Names of the coordinates.
        input_names: Names of the inputs.
        points: Samples of a trajectory, the first one included.
        prediction_points: Samples of the longer trajectories without input that measure prediction.
        n_train: Number of training initial conditions.
        n_test: Number of test initial conditions.
    """

    name: str
    system: AbstractMechanical
    space: str
    dt: float
    position_bounds: Bounds
    rate_bounds: Bounds
    input_values: tuple[tuple[float, ...], ...]
    position_names: tuple[str, ...]
    input_names: tuple[str, ...]
    points: int = 20
    prediction_points: int = 40
    n_train: int = 64
    n_test: int = 64

    @property
    def paper(self) -> Mapping[str, PaperErrors]:
        """The paper's errors by model; empty for a task that the paper does not have."""
        return PAPER.get(self.name, MappingProxyType({}))


_CONSTANT_INPUTS = ((-2.0,), (-1.0,), (0.0,), (1.0,), (2.0,))
_INPUT_PAIRS = tuple(product((-2.0, 0.0, 2.0), repeat=2))

TASKS: Final[Mapping[str, Task]] = MappingProxyType(
    {
        "pendulum-canonical": Task(
            name="pendulum-canonical",
            system=Pendulum(gravity=10.0, damping=0.1, momenta=True),
            space="R1",
            dt=0.05,
            position_bounds=((-math.pi, 2 * math.pi),),
            rate_bounds=((-math.pi, 2 * math.pi),),
            input_values=_CONSTANT_INPUTS,
            position_names=("q",),
            input_names=("torque",),
        ),
        "pendulum": Task(
            name="pendulum",
            system=MACHINES["symoden/DampedPendulum-v0"].system,
            space="T1",
            dt=0.05,
            position_bounds=((-math.pi, math.pi),),
            rate_bounds=((-1.0, 1.0),),
            input_values=_CONSTANT_INPUTS,
            position_names=("theta",),
            input_names=("torque",),
        ),
        "cartpole": Task(
            name="cartpole",
            system=MACHINES["symoden/DampedCartPole-v0"].system,
            space="R1 T1",
            dt=0.02,
            position_bounds=((-0.5, 0.5), (-3.14, 3.14)),
            rate_bounds=((-0.05, 0.05), (-3.0, 3.0)),
            input_values=_CONSTANT_INPUTS,
            position_names=("x", "theta"),
            input_names=("force",),
        ),
        "acrobot": Task(
            name="acrobot",
            system=MACHINES["symoden/DampedAcrobot-v0"].system,
            space="T2",
            dt=0.05,
            position_bounds=((-3.14, 3.14), (-3.14, 3.14)),
            rate_bounds=((-3.14, 3.14), (-3.14, 3.14)),
            input_values=_CONSTANT_INPUTS,
            position_names=("theta1", "theta2"),
            input_names=("torque2",),
        ),
        "cartpole-full": Task(
            name="cartpole-full",
            system=MACHINES["symoden/FullyActuatedCartPole-v0"].system,
            space="R1 T1",
            dt=0.02,
            position_bounds=((-0.5, 0.5), (-3.14, 3.14)),
            rate_bounds=((-0.05, 0.05), (-3.0, 3.0)),
            input_values=_INPUT_PAIRS,
            position_names=("x", "theta"),
            input_names=("force", "torque"),
        ),
        "acrobot-full": Task(
            name="acrobot-full",
            system=MACHINES["symoden/FullyActuatedAcrobot-v0"].system,
            space="T2",
            dt=0.05,
            position_bounds=((-3.14, 3.14), (-3.14, 3.14)),
            rate_bounds=((-3.14, 3.14), (-3.14, 3.14)),
            input_values=_INPUT_PAIRS,
            position_names=("theta1", "theta2"),
            input_names=("torque1", "torque2"),
        ),
    }
)
"""The paper's tasks 1 to 4, then those with an input on each joint, by name."""


def task(name: str) -> Task:
    """Find a task by its name.

    Args:
        name: One of `TASKS`.

    Returns:
        The task.

    Raises:
        ValueError: If there is no such task.

    Example:
        >>> task("cartpole").dt
        0.02
    """
    if name not in TASKS:
        raise ValueError(f"A task must be one of {', '.join(TASKS)}; got {name!r}.")
    return TASKS[name]


def own_trajectories(name: str) -> int:
    """Number of training trajectories of a task.

    Args:
        name: Name of the task.

    Returns:
        One for each initial condition and input.
    """
    chosen = task(name)
    return chosen.n_train * len(chosen.input_values)

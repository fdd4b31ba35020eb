"""The registered environments: the paper's systems with the paper's parameters, to be brought upright and held."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from symoden.mechanics import AbstractDynamics
from symoden.systems import Acrobot, CartPole, Pendulum

from ._mechanism import MechanismEnv


@dataclass(eq=False, repr=False)
class DampedPendulum(MechanismEnv):
    """Pendulum of task 2: q = 0 is upright. Its torque holds it up to 24° from the vertical, so it must swing up."""

    dynamics: AbstractDynamics = field(default_factory=lambda: Pendulum(gravity=10.0, damping=0.1, upright=True))


@dataclass(eq=False, repr=False)
class DampedCartPole(MechanismEnv):
    """Cart-pole of task 3 with a force on the cart [N]: q = (x, θ), and θ = 0 is upright."""

    dynamics: AbstractDynamics = field(default_factory=lambda: CartPole(pole_damping=0.05))
    dt: float = 0.02
    max_input: float | Sequence[float] = 10.0
    size: tuple[int, int] = (720, 360)


@dataclass(eq=False, repr=False)
class DampedAcrobot(MechanismEnv):
    """Acrobot of task 4 with a torque at the elbow [N m]: q = (θ₁, θ₂), and (π, 0) is upright."""

    dynamics: AbstractDynamics = field(default_factory=lambda: Acrobot(dampings=(0.2, 0.2)))
    max_input: float | Sequence[float] = 10.0
    target: Sequence[float] | None = (math.pi, 0.0)


@dataclass(eq=False, repr=False)
class FullyActuatedCartPole(MechanismEnv):
    """The cart-pole with a torque at the hinge [N m] beside the force; it can hold the pole at any angle."""

    dynamics: AbstractDynamics = field(default_factory=lambda: CartPole(pole_damping=0.05, fully_actuated=True))
    dt: float = 0.02
    max_input: float | Sequence[float] = (10.0, 5.0)
    size: tuple[int, int] = (720, 360)


@dataclass(eq=False, repr=False)
class FullyActuatedAcrobot(MechanismEnv):
    """The acrobot with a torque at the shoulder [N m] before the one at the elbow; it can hold the links anywhere."""

    dynamics: AbstractDynamics = field(default_factory=lambda: Acrobot(dampings=(0.2, 0.2), fully_actuated=True))
    max_input: float | Sequence[float] = (25.0, 10.0)
    target: Sequence[float] | None = (math.pi, 0.0)

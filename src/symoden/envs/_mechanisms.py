"""The registered environments: the paper's systems with the paper's parameters, to be brought upright and held."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from symoden.mechanics import AbstractDynamics
from symoden.systems import MACHINES

from ._mechanism import MechanismEnv


@dataclass(eq=False, repr=False)
class DampedPendulum(MechanismEnv):
    """Pendulum of task 2: q = 0 is upright. Its torque holds it up to 24° from the vertical, so it must swing up."""

    dynamics: AbstractDynamics = field(default_factory=lambda: MACHINES["symoden/DampedPendulum-v0"].system)


@dataclass(eq=False, repr=False)
class DampedCartPole(MechanismEnv):
    """Cart-pole of task 3 with a force on the cart [N]: q = (x, θ), and θ = 0 is upright."""

    dynamics: AbstractDynamics = field(default_factory=lambda: MACHINES["symoden/DampedCartPole-v0"].system)
    dt: float = 0.02
    max_input: float | Sequence[float] = 10.0
    size: tuple[int, int] = (720, 360)


@dataclass(eq=False, repr=False)
class DampedAcrobot(MechanismEnv):
    """Acrobot of task 4 with a torque at the elbow [N m]: q = (θ₁, θ₂), and (π, 0) is upright."""

    dynamics: AbstractDynamics = field(default_factory=lambda: MACHINES["symoden/DampedAcrobot-v0"].system)
    max_input: float | Sequence[float] = 10.0
    target: Sequence[float] | None = MACHINES["symoden/DampedAcrobot-v0"].target


@dataclass(eq=False, repr=False)
class FullyActuatedCartPole(MechanismEnv):
    """The cart-pole with a torque at the hinge [N m] beside the force; it can hold the pole at any angle."""

    dynamics: AbstractDynamics = field(default_factory=lambda: MACHINES["symoden/FullyActuatedCartPole-v0"].system)
    dt: float = 0.02
    max_input: float | Sequence[float] = (10.0, 5.0)
    size: tuple[int, int] = (720, 360)


@dataclass(eq=False, repr=False)
class FullyActuatedAcrobot(MechanismEnv):
    """The acrobot with a torque at the shoulder [N m] before the one at the elbow; it can hold the links anywhere."""

    dynamics: AbstractDynamics = field(default_factory=lambda: MACHINES["symoden/FullyActuatedAcrobot-v0"].system)
    max_input: float | Sequence[float] = (25.0, 10.0)
    target: Sequence[float] | None = MACHINES["symoden/DampedAcrobot-v0"].target

"""Machines to control, by the names of their Gymnasium environments: a system, and where to bring it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Generic, TypeVar

from symoden.mechanics import AbstractDynamics

from ._acrobot import Acrobot
from ._cart_pole import CartPole
from ._pendulum import Pendulum
from ._planar import AbstractPlanarMechanism

System = TypeVar("System", bound=AbstractDynamics, covariant=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class Machine(Generic[System]):
    """A system to control.

    Attributes:
        name: Identity of its environment.
        system: The true system, or the model.
        target: Configuration to bring it to; of the paper's machines the one of the highest potential energy, lengths
            being zero; NaN along coordinates that need not come to rest anywhere.
        max_input: Largest magnitude of each input that its motors give [N or N m].
        seen: Least and largest of each coordinate that a learned model in the machine's place knows, infinite of what
            nothing depends on; None for a simulated machine.
    """

    name: str
    system: System
    target: tuple[float, ...]
    max_input: tuple[float, ...]
    seen: tuple[tuple[float, float], ...] | None = None

    @property
    def learned(self) -> bool:
        """Whether the system is a learned model, in place of a simulated machine."""
        return self.seen is not None


_POLE_DAMPING: Final = 0.05
_DAMPINGS: Final = (0.2, 0.2)

MACHINES: Final[Mapping[str, Machine[AbstractPlanarMechanism]]] = MappingProxyType(
    {
        machine.name: machine
        for machine in (
            Machine(
                name="symoden/DampedPendulum-v0",
                system=Pendulum(gravity=10.0, damping=0.1, upright=True),
                target=(0.0,),
                max_input=(15.0,),
            ),
            Machine(
                name="symoden/DampedCartPole-v0",
                system=CartPole(pole_damping=_POLE_DAMPING),
                target=(0.0, 0.0),
                max_input=(15.0,),
            ),
            Machine(
                name="symoden/DampedAcrobot-v0",
                system=Acrobot(dampings=_DAMPINGS),
                target=(math.pi, 0.0),
                max_input=(15.0,),
            ),
            Machine(
                name="symoden/FullyActuatedCartPole-v0",
                system=CartPole(pole_damping=_POLE_DAMPING, fully_actuated=True),
                target=(0.0, 0.0),
                max_input=(15.0, 15.0),
            ),
            Machine(
                name="symoden/FullyActuatedAcrobot-v0",
                system=Acrobot(dampings=_DAMPINGS, fully_actuated=True),
                target=(math.pi, 0.0),
                max_input=(40.0, 40.0),
            ),
        )
    }
)
"""The machines by the names of their environments."""

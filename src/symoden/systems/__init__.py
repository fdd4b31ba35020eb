"""Analytic mechanisms in SI units, as port-Hamiltonian systems: the truth that models are measured against."""

from ._acrobot import Acrobot as Acrobot
from ._cart_pole import CartPole as CartPole
from ._link_chain import LinkChain as LinkChain
from ._machines import MACHINES as MACHINES, Machine as Machine
from ._pendulum import Pendulum as Pendulum
from ._planar import AbstractPlanarMechanism as AbstractPlanarMechanism

__all__ = ["MACHINES", "AbstractPlanarMechanism", "Acrobot", "CartPole", "LinkChain", "Machine", "Pendulum"]

"""Mechanisms and trained models as Gymnasium environments, and episodes of any environment as a data set.

Importing this makes `gymnasium.make` know `symoden/DampedPendulum-v0`, `symoden/DampedCartPole-v0`,
`symoden/DampedAcrobot-v0`, `symoden/FullyActuatedCartPole-v0` and `symoden/FullyActuatedAcrobot-v0`. Without it,
`gymnasium.make("symoden.envs:symoden/DampedPendulum-v0")` makes the first of them. Needs the extra `symoden[gym]`.
"""

from ._gymnasium import register
from ._mechanism import MechanismEnv as MechanismEnv
from ._policies import random_levels as random_levels
from ._record import record as record
from ._sensors import Sensors as Sensors, sensors_of as sensors_of

__all__ = ["MechanismEnv", "Sensors", "random_levels", "record", "sensors_of"]

register()

"""Gymnasium, or what to do where it is not installed; and the names by which it makes our environments."""

from typing import Final

try:
    from gymnasium.envs import registration
except ModuleNotFoundError as error:
    raise ModuleNotFoundError('Environments need Gymnasium. Install "symoden[gym]".') from error

# Identifier, class in `_mechanisms`, control periods until an episode is cut off: 10 s, and 20 s for two coordinates.
_IDS: Final = (
    ("symoden/DampedPendulum-v0", "DampedPendulum", 200),
    ("symoden/DampedCartPole-v0", "DampedCartPole", 1000),
    ("symoden/DampedAcrobot-v0", "DampedAcrobot", 400),
    ("symoden/FullyActuatedCartPole-v0", "FullyActuatedCartPole", 1000),
    ("symoden/FullyActuatedAcrobot-v0", "FullyActuatedAcrobot", 400),
)


def register() -> None:
    """Tell Gymnasium of the environments, once."""
    for name, cls, steps in _IDS:
        if name not in registration.registry:
            registration.register(name, f"symoden.envs._mechanisms:{cls}", max_episode_steps=steps)

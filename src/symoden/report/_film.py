"""An episode under control as an animation."""

import io
from typing import Final

import jax
import jax.numpy as jnp
import numpy as np

from symoden.drawing import draw_chain
from symoden.experiments import ControlResult
from symoden.systems import AbstractPlanarMechanism, CartPole

_RATE: Final = 20  # frames a second
_AFTER: Final = 2.0  # seconds shown after the target is reached
_SIZE: Final = (320, 320)


def film(result: ControlResult) -> bytes:
    """Draw the episode of median settling time as a GIF in real time, until shortly after it reached its target.

    Args:
        result: How the episodes went.

    Returns:
        Content of the file.

    Raises:
        ModuleNotFoundError: If Pillow is not installed.
        TypeError: If nobody knows how the machine looks.
    """
    try:
        from PIL import Image
    except ModuleNotFoundError:
        raise ModuleNotFoundError('Animations need Pillow. Install "symoden[plot]".') from None
    system, k = result.machine.system, result.shown
    if not isinstance(system, AbstractPlanarMechanism):
        raise TypeError(f"An animation needs a mechanism whose joints have places; got {type(system).__name__}.")
    ts, q = np.asarray(result.episodes.ts[k]), np.asarray(result.episodes.q[k])
    settled = result.verdict.settling[k]
    end = ts[-1] if np.isnan(settled) else min(ts[-1], settled + _AFTER)
    at = np.searchsorted(ts, np.arange(0.0, end, 1 / _RATE)).clip(max=len(ts) - 1)
    cart = isinstance(system, CartPole)
    points = np.asarray(jax.vmap(system.points)(jnp.asarray(q[at])))
    pictures = [Image.fromarray(draw_chain(each, cart=cart, size=_SIZE)).quantize(32) for each in points]
    buffer = io.BytesIO()
    pictures[0].save(
        buffer, format="GIF", save_all=True, append_images=pictures[1:], duration=1000 // _RATE, loop=0, optimize=True
    )
    return buffer.getvalue()

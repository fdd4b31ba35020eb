"""Pictures of mechanisms as arrays of pixels, smooth at the edges, by NumPy alone: for windows, films and notebooks."""

import itertools
from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np
from jaxtyping import Float, UInt8

Picture: TypeAlias = UInt8[np.ndarray, "h w 3"]
Canvas: TypeAlias = Float[np.ndarray, "h w 3"]

# Okabe & Ito (2008), *Color Universal Design*.
_LINK: Final = (0x00, 0x72, 0xB2)
_CART: Final = (0xD5, 0x5E, 0x00)
_INK: Final = (0x22, 0x22, 0x22)
_PALE: Final = (0xDD, 0xDD, 0xDD)
_WHITE: Final = (0xFF, 0xFF, 0xFF)
_MARGIN: Final = 1.15
_RAIL: Final = 1.5  # pixels


def draw_chain(
    points: Float[np.ndarray, "k 2"],
    *,
    cart: bool = False,
    track: float | None = None,
    size: tuple[int, int] = (480, 480),
) -> Picture:
    """Draw links from joint to joint, the first one hinged to the world or to a cart on a rail.

    The scale follows from the links' lengths alone, so that the pictures of one mechanism make a film. A cart that goes
    far is followed; the marks on the rail, half the links' length apart, show that it moves.

    Args:
        points: Places (horizontal, upward) of the first hinge, the joints after it and the tip, at least two [m].
        cart: Whether the first hinge rides on a cart, on a rail at height 0.
        track: Where the rail ends on either side [m]; it has no end if absent.
        size: Width and height [pixels].

    Returns:
        The picture, rows from the top.

    Example:
        >>> draw_chain(np.array([[0.0, 0.0], [0.6, 0.8]]), size=(64, 48)).shape
        (48, 64, 3)
    """
    reach = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    scale = min(size) / (2 * _MARGIN * reach)
    half = size[0] / (2 * scale)
    place = float(points[0, 0])
    room = max(half - reach, 0.0)  # how far a cart may go until the picture follows it
    middle = place - np.clip(place, -room, room) if cart else 0.0
    joints = scale * (points - [middle, 0.0]) * [1, -1] + np.array(size) / 2
    canvas, thick = _blank(size), 0.05 * scale * reach
    if cart:
        _draw_rail(canvas, scale, (middle - half, middle + half), mark=reach / 2, track=track)
        aside = np.array([2 * thick, 0.0])
        _stroke(canvas, joints[0] - aside, joints[0] + aside, 1.5 * thick, _CART)
    for start, end in itertools.pairwise(joints):
        _stroke(canvas, start, end, thick, _LINK)
    for joint in joints[:-1]:
        _stroke(canvas, joint, joint, thick / 2, _INK)
    return np.rint(canvas).astype(np.uint8)


def draw_coordinates(
    q: Float[np.ndarray, " n"], is_angle: Sequence[bool], *, span: float = 2.0, size: tuple[int, int] = (480, 480)
) -> Picture:
    """Draw a mechanism of unknown shape: a dial for each angle, a slider for each length, from left to right.

    A dial's hand points up at 0 and turns clockwise. A slider stops at its ends.

    Args:
        q: Coordinates; angles [rad].
        is_angle: For each of them, whether it is an angle.
        span: Length at the end of a slider, in the unit of the lengths.
        size: Width and height [pixels].

    Returns:
        The picture, rows from the top.

    Example:
        >>> draw_coordinates(np.array([0.5, 3.0]), (False, True), size=(64, 48)).shape
        (48, 64, 3)
    """
    canvas, cell = _blank(size), size[0] / len(q)
    radius = 0.4 * min(cell, size[1])
    for i, (value, angle) in enumerate(zip(q, is_angle, strict=True)):
        centre = np.array([(i + 0.5) * cell, size[1] / 2])
        if angle:
            _stroke(canvas, centre, centre, radius, _PALE)
            _stroke(canvas, centre, centre, 0.92 * radius, _WHITE)
            hand = centre + 0.8 * radius * np.array([np.sin(value), -np.cos(value)])
            _stroke(canvas, centre, hand, 0.06 * radius, _LINK)
        else:
            along, across = radius * np.eye(2)
            place = centre + np.clip(value / span, -1, 1) * along
            _stroke(canvas, centre - along, centre + along, 0.03 * radius, _INK)
            _stroke(canvas, centre - 0.1 * across, centre + 0.1 * across, 0.02 * radius, _INK)
            _stroke(canvas, place, place, 0.12 * radius, _CART)
    return np.rint(canvas).astype(np.uint8)


def _draw_rail(canvas: Canvas, scale: float, view: tuple[float, float], *, mark: float, track: float | None) -> None:
    """Draw the part of a rail that is in view, from place to place [m], with marks at equal distances."""
    level, end = canvas.shape[0] / 2, np.inf if track is None else track
    left, right = max(view[0], -end), min(view[1], end)
    across = [scale * (place - view[0]) for place in (left, right)]
    _stroke(canvas, (across[0], level), (across[1], level), _RAIL, _INK)
    for k in range(int(np.ceil(left / mark)), int(np.floor(right / mark)) + 1):
        place = scale * (k * mark - view[0])
        _stroke(canvas, (place, level), (place, level + 10 * _RAIL), _RAIL, _INK)


def _blank(size: tuple[int, int]) -> Canvas:
    """White canvas of a width and height."""
    return np.full((size[1], size[0], 3), 255.0)


def _stroke(
    canvas: Canvas,
    start: Sequence[float] | Float[np.ndarray, " 2"],
    end: Sequence[float] | Float[np.ndarray, " 2"],
    radius: float,
    colour: tuple[int, int, int],
) -> None:
    """Paint every pixel that is nearer to a line than a radius, its edge by the share that is; all in pixels."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    low = np.clip(np.floor(np.minimum(a, b) - radius - 1), 0, canvas.shape[1::-1]).astype(int)
    high = np.clip(np.ceil(np.maximum(a, b) + radius + 1), 0, canvas.shape[1::-1]).astype(int)
    x, y = np.arange(low[0], high[0]) + 0.5 - a[0], np.arange(low[1], high[1])[:, None] + 0.5 - a[1]
    along = b - a
    share = np.clip((x * along[0] + y * along[1]) / max(along @ along, 1e-12), 0, 1)
    distance = np.hypot(x - share * along[0], y - share * along[1])
    cover = np.clip(radius + 0.5 - distance, 0, 1)[..., None]
    patch = canvas[low[1] : high[1], low[0] : high[0]]
    patch += cover * (np.array(colour) - patch)

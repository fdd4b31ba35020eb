"""Pictures: of the size that was asked for, the right way up, and different where the mechanism is."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.drawing import draw_chain, draw_coordinates

SIZE = (90, 60)
places = st.lists(st.tuples(*[st.floats(-3.0, 3.0)] * 2), min_size=2, max_size=4, unique=True)


def ink(picture):
    """How much each pixel differs from white."""
    return (255.0 - picture).sum(axis=2)


def link(x, y, start=0.0):
    return np.array([[start, 0.0], [start + x, y]])


@given(points=places, cart=st.booleans(), track=st.none() | st.floats(0.5, 4.0))
def test_every_chain_has_a_picture_of_the_size_asked_for(points, cart, track):
    picture = draw_chain(np.array(points), cart=cart, track=track, size=SIZE)
    assert picture.shape == (60, 90, 3)
    assert picture.dtype == np.uint8


@given(angle=st.floats(-3.0, 3.0))
def test_a_link_is_drawn_where_it_is(angle):
    axis = np.array([np.sin(angle), np.cos(angle)])
    weight = ink(draw_chain(np.stack([0 * axis, axis]), size=SIZE))
    rows, columns = np.indices(weight.shape) + 0.5
    centre = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum() - [45, 30]
    assert centre / (30 / 1.15) == pytest.approx([axis[0] / 2, -axis[1] / 2], abs=0.03)


def test_the_hinge_of_a_pendulum_is_in_the_middle():
    weight = ink(draw_chain(link(0.0, -1.0), size=SIZE))
    assert weight[:26].sum() == 0
    assert weight[30:50, 45].all()


def test_a_cart_is_followed_so_that_its_pole_stays_in_the_picture():
    pictures = [draw_chain(link(0.0, 1.0, start), cart=True, size=SIZE) for start in (0.0, 0.3, 5.0, 5.25, 5.5)]
    poles = [ink(picture)[:20].sum() for picture in pictures]
    assert poles == pytest.approx([poles[0]] * 5, rel=0.02)
    assert len({picture.tobytes() for picture in pictures[:4]}) == 4
    assert pictures[4].tobytes() == pictures[2].tobytes()  # one mark further on


def test_a_rail_ends_where_the_track_does():
    endless, short = (ink(draw_chain(link(0.0, 1.0), cart=True, track=track, size=SIZE)) for track in (None, 1.0))
    assert endless[30, 2] > 0
    assert endless[30, -3] > 0
    assert not short[:, :10].any()
    assert not short[:, -10:].any()


@given(q=st.lists(st.floats(-9.0, 9.0), min_size=1, max_size=5), angles=st.lists(st.booleans(), min_size=5, max_size=5))
def test_coordinates_of_every_space_have_a_picture(q, angles):
    picture = draw_coordinates(np.array(q), angles[: len(q)], size=SIZE)
    assert picture.shape == (60, 90, 3)
    assert picture.dtype == np.uint8


@pytest.mark.parametrize("angle", [False, True])
def test_dials_and_sliders_move(angle):
    first, second = (draw_coordinates(np.array([value]), (angle,), size=SIZE) for value in (0.1, 0.5))
    assert (first != second).any()


def test_a_dial_points_up_at_zero_and_a_slider_stops_at_its_end():
    dial = draw_coordinates(np.array([0.0]), (True,), size=SIZE)
    assert ink(dial)[15, 45] > ink(dial)[45, 45]
    ends = [draw_coordinates(np.array([value]), (False,), size=SIZE).tobytes() for value in (2.0, 7.0)]
    assert ends[0] == ends[1]

"""Units and windows from recordings of every ordinary kind: uneven clocks, resting joints, short pieces."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from symoden.data import Dataset, Trajectory, WindowLength, usual_steps, windows
from symoden.models import ModelConfig, build
from symoden.spaces import Space
from symoden.training._data import _horizon
from symoden.training._objective import Batch, channel_weights
from symoden.training._scales import measure_scales, time_scale


def swing(ts, *, omega=3.0, mean=0.0, resting=False, name="swing"):
    """A sine of velocity about a mean; beside it, a joint that stands still."""
    q, v = mean * ts - np.cos(omega * ts) / omega, mean + np.sin(omega * ts)
    others = [np.full_like(ts, 0.4)] if resting else []
    rests = [np.zeros_like(ts)] if resting else []
    return Trajectory(
        name=name, ts=ts, q=np.stack([q, *others], 1), rates=np.stack([v, *rests], 1), us=np.zeros((len(ts), 0))
    )


def bursts(steps, until):
    ts = np.cumsum(np.tile(steps, int(until / sum(steps)) + 1))
    return ts[ts < until]


@given(omega=st.floats(1.0, 8.0), mean=st.sampled_from([0.0, 10.0, -100.0]), resting=st.booleans())
@settings(max_examples=20, deadline=None)
def test_the_time_scale_of_a_sine_is_one_over_its_frequency(omega, mean, resting):
    recording = swing(np.arange(0, 60, 0.01), omega=omega, mean=mean, resting=resting)
    assert time_scale([recording], Space.parse(f"R{recording.q.shape[1]}")) == pytest.approx(1 / omega, rel=0.05)


@pytest.mark.parametrize(
    "clocks",
    [
        [bursts([0.001, 0.001, 0.028], 30.0)],
        [np.arange(0, 30, 0.001), np.arange(0, 30, 0.01)],
        [np.sort(np.random.default_rng(0).uniform(0, 30, 3000))],
    ],
    ids=["bursts", "two rates", "at random"],
)
def test_the_time_scale_is_in_seconds_whatever_the_clock(clocks):
    assert time_scale([swing(ts) for ts in clocks], Space.parse("R1")) == pytest.approx(1 / 3, rel=0.1)


def test_the_time_scale_of_rest_is_the_length_of_the_recording():
    ts = np.arange(0, 1, 0.01)
    still = Trajectory(name="still", ts=ts, q=np.ones((100, 1)), rates=np.zeros((100, 1)), us=np.zeros((100, 0)))
    assert time_scale([still], Space.parse("R1")) == pytest.approx(2 * 0.99)


def test_the_flicker_of_an_encoder_is_no_scale():
    recording = swing(np.arange(0, 10, 0.01), resting=True)
    flicker = recording.rates.copy()
    flicker[::200, 1] = 1e-4
    moved = Trajectory(name="flicker", ts=recording.ts, q=recording.q, rates=flicker, us=recording.us)
    velocity = measure_scales([moved], Space.parse("R2"), momenta=False).velocity
    assert velocity[1] == pytest.approx(1e-3 * velocity[0])


@pytest.mark.parametrize("unit", [1.0, 1e3, 1e6, 1e-6])
def test_the_unit_of_lengths_beside_angles_is_no_matter(unit):
    """A cart and its pole: in micrometres the cart moves a million times as far, and the pole does not rest."""
    space, ts = Space.parse("R1 T1"), np.arange(0, 10, 0.01)
    q = np.stack([unit * np.sin(ts), 0.05 * np.sin(4 * ts)], 1)
    v = np.stack([unit * np.cos(ts), 0.2 * np.cos(4 * ts)], 1)
    cart = Trajectory(name="cart", ts=ts, q=q, rates=v, us=np.zeros((len(ts), 0)))
    scales = measure_scales([cart], space, momenta=False)
    velocity = scales.velocity
    farthest = np.abs(q[:, 0] - q[:, 0].mean()).max() / q[:, 0].std()
    assert scales.reach == pytest.approx([farthest, 1, 1])
    assert velocity == pytest.approx([unit / np.sqrt(2), 0.2 / np.sqrt(2)], rel=0.05)
    assert time_scale([cart], space) == pytest.approx((1 + 1 / 4) / 2, rel=0.05)  # The median of both.
    batch, built = Batch.of(windows([cart], 100, stride=10)), build(ModelConfig(), space, 0, key=jax.random.key(0))
    weights = channel_weights(batch, built)
    units = jnp.asarray([[[unit, 1.0]]])
    plain = channel_weights(batch._replace(q=batch.q / units, rates=batch.rates / units), built)
    assert weights * [unit, 1, 1, unit, 1] == pytest.approx(plain)


@pytest.mark.parametrize("piece", [25, 40, 100])
@pytest.mark.parametrize(("share", "least"), [(0.3, 3), (2.0, 6)])
def test_a_short_recording_does_not_shorten_the_windows_of_all(piece, share, least):
    long = tuple(swing(np.arange(0, 10, 0.01), name=f"{i}") for i in range(3))
    short = swing(np.arange(piece) * 0.01, name="short")
    tail = swing(np.arange(piece) * 0.01 + 1, name="tail")
    held = tuple(swing(np.arange(0, 10, 0.01), mean=float(i), name=f"held {i}") for i in range(1, 4))
    alone = _horizon(Dataset(name="d", space="R1", train=long), WindowLength(share, least))
    beside = Dataset(name="d", space="R1", train=(*long, short), validation=(tail, *held))
    # Windows are stretched to fill a piece that holds two, never cut to fit one that does not.
    assert alone <= _horizon(beside, WindowLength(share, least)) <= 1.5 * alone


@given(samples=st.integers(2, 400), omega=st.floats(1.0, 100.0), share=st.floats(0.3, 2.0), least=st.integers(2, 8))
def test_windows_are_not_cut_shorter_than_they_must_be(samples, omega, share, least):
    recording = swing(np.arange(samples) * 0.01, omega=omega)
    horizon = _horizon(Dataset(name="d", space="R1", train=(recording,)), WindowLength(share, least))
    assert min(least, samples - 1) <= horizon < samples


@given(lengths=st.lists(st.integers(2, 500), min_size=1, max_size=20), enough=st.integers(1, 600))
@settings(deadline=None)
def test_what_is_left_out_is_little_and_short(lengths, enough):
    recordings = [swing(np.arange(length) * 0.01) for length in lengths]
    steps = usual_steps(recordings, enough)
    left = [length - 1 for length in lengths if length - 1 < steps]
    assert sum(left) <= 0.1 * sum(length - 1 for length in lengths) + 1e-9
    assert all(each < enough for each in left)
    assert any(length - 1 == steps for length in lengths)

"""Link chain: the pendulum and the acrobot as its shortest cases, inputs, refusals."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.systems import Acrobot, LinkChain, Pendulum

pairs = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
sizes = st.tuples(st.floats(0.3, 3.0), st.floats(0.3, 3.0))


@given(masses=sizes, lengths=sizes, centres=sizes, inertias=sizes, q=pairs, p=pairs)
def test_two_links_are_the_acrobot(masses, lengths, centres, inertias, q, p):
    parameters = {"masses": masses, "lengths": lengths, "centres": centres, "inertias": inertias}
    chain = LinkChain(**parameters, dampings=(0.3, 0.2), gravity=9.8, actuated=(False, True))
    acrobot = Acrobot(**parameters, dampings=(0.3, 0.2), gravity=9.8)
    q, p = jnp.array(q), jnp.array(p)
    assert chain.inputs == acrobot.inputs
    for name in ("mass_matrix", "inverse_mass_matrix", "potential_energy", "input_matrix"):
        ours, theirs = (np.asarray(getattr(system, name)(q)) for system in (chain, acrobot))
        assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-9), name
    assert chain.dissipation_matrix(q, p).tolist() == acrobot.dissipation_matrix(q, p).tolist()


def test_one_rod_is_the_pendulum():
    chain = LinkChain.of_rods(1, mass=2.0, length=0.7, damping=0.3)
    pendulum = Pendulum(mass=2.0, length=0.7, damping=0.3)
    q, p, u = jnp.array([0.4]), jnp.array([0.3]), jnp.array([1.0])
    for ours, theirs in zip(chain.vector_field(q, p, u), pendulum.vector_field(q, p, u), strict=True):
        assert ours == pytest.approx(np.asarray(theirs))


def test_a_chain_has_an_input_for_each_actuated_joint():
    chain = dataclasses.replace(LinkChain.of_rods(3), actuated=(True, False, True))
    assert chain.inputs == 2
    assert chain.input_matrix(jnp.zeros(3)).tolist() == [[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]]
    passive = dataclasses.replace(LinkChain.of_rods(2), actuated=(False, False))
    assert passive.input_matrix(jnp.zeros(2)).shape == (2, 0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"masses": ()}, "must have 1 to 64 coordinates; got 0"),
        ({"lengths": (1.0,)}, "`lengths` must have one entry for each of the 2 links; got 1"),
        ({"actuated": (True, True, True)}, "`actuated` must have one entry for each of the 2 links; got 3"),
        ({"masses": (1.0, -1.0)}, r"`masses\[1\]` must be positive; got -1.0"),
        ({"centres": (0.0, 1.0)}, r"`centres\[0\]` must be positive; got 0.0"),
        ({"dampings": (0.0, -0.5)}, r"`dampings\[1\]` must be at least 0; got -0.5"),
        ({"gravity": -1.0}, "`gravity` must be at least 0"),
    ],
)
def test_unphysical_parameters_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(LinkChain.of_rods(2), **changes)

"""Laws that every analytic system obeys, over states and parameters, against point masses on the same links.

Each body is replaced by two half masses on its axis at √(I/m) from its centre: the same mass, centre and inertia.
Energy, mass matrix and equations of motion then follow from the places of points alone, by differentiation.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from symoden.systems import Acrobot, CartPole, LinkChain, Pendulum

LARGEST_CHAIN = 3


def pendulum(sizes, dampings, gravity):
    return Pendulum(mass=sizes[0], length=sizes[1], damping=dampings[0], gravity=gravity)


def upright_pendulum(sizes, dampings, gravity):
    return Pendulum(mass=sizes[0], length=sizes[1], damping=dampings[0], gravity=gravity, upright=True)


def cart_pole(sizes, dampings, gravity):
    masses = {"cart_mass": sizes[0], "pole_mass": sizes[1]}
    friction = {"cart_damping": dampings[0], "pole_damping": dampings[1]}
    return CartPole(**masses, **friction, half_length=sizes[2], gravity=gravity, fully_actuated=True)


def acrobot(sizes, dampings, gravity):
    return Acrobot(
        masses=sizes[0:2],
        lengths=sizes[2:4],
        centres=sizes[4:6],
        inertias=sizes[6:8],
        dampings=dampings[:2],
        gravity=gravity,
        fully_actuated=True,
    )


def link_chain(sizes, dampings, gravity):
    return LinkChain(
        masses=sizes[0:3],
        lengths=sizes[3:6],
        centres=sizes[6:9],
        inertias=sizes[9:12],
        dampings=dampings,
        gravity=gravity,
        actuated=(True, False, True),
    )


def dumbbell(mass, inertia, hinge, centre, axis):
    """Two half masses with the mass, centre and inertia of a link."""
    radius = jnp.sqrt(inertia / mass)
    return [(mass / 2, hinge + (centre + sign * radius) * axis) for sign in (-1, 1)]


def down(angle):
    """Unit vector at an angle from the downward vertical."""
    return jnp.array([jnp.sin(angle), -jnp.cos(angle)])


def points(system, q):
    """Masses, and their places in the plane."""
    origin = jnp.zeros(2)
    if isinstance(system, Pendulum):
        m, l = system.mass, system.length
        axis = -down(q[0]) if system.upright else down(q[0])
        parts = dumbbell(m, m * l**2 / 12, origin, l / 2, axis)
    elif isinstance(system, CartPole):
        m, l = system.pole_mass, system.half_length
        cart = jnp.array([q[0], 0.0])
        up = jnp.array([jnp.sin(q[1]), jnp.cos(q[1])])
        parts = [(system.cart_mass, cart), *dumbbell(m, m * l**2 / 3, cart, l, up)]
    else:
        parts, hinge, angle = [], origin, 0.0
        links = zip(system.masses, system.lengths, system.centres, system.inertias, q, strict=True)
        for mass, length, centre, inertia, joint in links:
            angle = angle + joint
            parts += dumbbell(mass, inertia, hinge, centre, down(angle))
            hinge = hinge + length * down(angle)
    masses, places = zip(*parts, strict=True)
    return jnp.array(masses), jnp.stack(places)


def lagrangian(system, q, v):
    """Kinetic less potential energy of the points."""
    masses, places = points(system, q)
    velocities = jax.jvp(lambda q: points(system, q)[1], (q,), (v,))[1]
    return 0.5 * masses @ jnp.sum(velocities**2, axis=1) - system.gravity * masses @ places[:, 1]


@jax.jit
def facts(system, q, v, u):
    """What the system says, and what the points say."""
    M, inverse = system.mass_matrix(q), system.inverse_mass_matrix(q)
    p = M @ v
    q_dot, p_dot = system.vector_field(q, p, u)
    mass = jax.hessian(lagrangian, argnums=2)(system, q, v)
    D = system.dissipation_matrix(q, v)
    force = system.input_matrix(q) @ u - D @ v
    momentum = jax.grad(lagrangian, argnums=2)
    drift = jax.jvp(lambda q: momentum(system, q, v), (q,), (v,))[1]
    acceleration = jnp.linalg.solve(mass, force + jax.grad(lagrangian, argnums=1)(system, q, v) - drift)
    M_dot = jax.jvp(system.mass_matrix, (q,), (q_dot,))[1]
    return {
        "mass": (M, mass),
        "inverse": (M @ inverse, jnp.eye(q.size)),
        "velocity": (q_dot, v),
        "acceleration": (jnp.linalg.solve(M, p_dot - M_dot @ q_dot), acceleration),
        "energy": (
            system.hamiltonian(q, p) - system.hamiltonian(0 * q, 0 * p),
            v @ mass @ v - lagrangian(system, q, v) + lagrangian(system, 0 * q, 0 * v),
        ),
        "balance": system.power_balance(q, p, u),
        "friction": D,
    }


MAKERS = [pendulum, upright_pendulum, cart_pole, acrobot, link_chain]
sizes = st.tuples(*[st.floats(0.3, 3.0)] * 12)
dampings = st.tuples(*[st.floats(0.0, 2.0)] * LARGEST_CHAIN)
vectors = st.tuples(*[st.floats(-5.0, 5.0)] * LARGEST_CHAIN)


@pytest.mark.parametrize("make", MAKERS)
@given(sizes=sizes, dampings=dampings, gravity=st.floats(0.0, 20.0), q=vectors, v=vectors, u=vectors)
def test_a_system_is_the_mechanics_of_its_point_masses(make, sizes, dampings, gravity, q, v, u):
    system = make(sizes, dampings, gravity)
    n = system.space.size
    found = facts(system, jnp.array(q[:n]), jnp.array(v[:n]), jnp.array(u[: system.inputs]))
    for name in ("mass", "inverse", "velocity", "acceleration", "energy"):
        ours, theirs = (np.asarray(side) for side in found[name])
        scale = 1 + np.abs(theirs).max()
        assert ours / scale == pytest.approx(theirs / scale, abs=1e-9), name
    assert np.linalg.eigvalsh(found["mass"][0]).min() > 0
    assert np.diag(found["friction"]) == pytest.approx(dampings[:n], abs=0)
    stored, supplied, dissipated = (float(power) for power in found["balance"])
    assert stored == pytest.approx(supplied - dissipated, rel=1e-9, abs=1e-9 * (1 + abs(supplied) + abs(dissipated)))
    assert dissipated >= 0


@pytest.mark.parametrize("make", MAKERS)
@given(sizes=sizes, q=vectors)
def test_joints_are_where_the_energy_says(make, sizes, q):
    system, q = make(sizes, (0.0,) * 3, 9.81), jnp.array(q)
    q = q[: system.space.size]
    places = np.asarray(system.points(q))
    if isinstance(system, Acrobot | LinkChain):
        lengths, masses, centres = (jnp.asarray(each) for each in (system.lengths, system.masses, system.centres))
    elif isinstance(system, CartPole):
        lengths, masses = jnp.asarray([2 * system.half_length]), jnp.asarray([system.pole_mass])
        centres = lengths / 2
    else:
        lengths, masses = jnp.asarray([system.length]), jnp.asarray([system.mass])
        centres = lengths / 2
    links = np.diff(places, axis=0)
    assert np.linalg.norm(links, axis=1) == pytest.approx(np.asarray(lengths))
    heights = places[:-1, 1] + centres / lengths * links[:, 1]
    lowest = lengths - jnp.cumsum(lengths) - centres
    energy = 9.81 * masses @ (heights - lowest)
    assert float(system.potential_energy(q)) == pytest.approx(float(energy), abs=1e-9)


def test_links_turn_the_way_that_the_systems_say():
    q = jnp.array([0.3, 0.0])
    assert Pendulum().points(q[:1])[1].tolist() == pytest.approx([np.sin(0.3), -np.cos(0.3)])
    assert Pendulum(upright=True).points(q[:1] + jnp.pi)[1].tolist() == pytest.approx([np.sin(0.3), -np.cos(0.3)])
    assert CartPole().points(q)[0].tolist() == [0.3, 0.0]
    assert CartPole().points(q[::-1])[1].tolist() == pytest.approx([np.sin(0.3), np.cos(0.3)])
    assert Acrobot().points(q)[2].tolist() == pytest.approx([2 * np.sin(0.3), -2 * np.cos(0.3)])


@pytest.mark.parametrize("make", MAKERS)
def test_energy_is_zero_where_the_mechanism_hangs_and_nowhere_less(make):
    system = make((1.0,) * 12, (0.0,) * 3, 9.81)
    angles = jnp.linspace(-jnp.pi, jnp.pi, 13)
    grid = jnp.stack(jnp.meshgrid(*[angles] * system.space.size), axis=-1).reshape(-1, system.space.size)
    energies = jax.vmap(system.potential_energy)(grid)
    assert energies.min() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("make", MAKERS)
def test_parameters_can_be_differentiated_and_batched(make):
    system = make((1.0, 1.5) * 6, (0.1,) * 3, 9.81)
    q = jnp.full(system.space.size, 0.5)
    slopes = jax.grad(lambda system: system.hamiltonian(q, q))(system)
    assert all(np.isfinite(slope) for slope in jax.tree.leaves(slopes))
    assert slopes.gravity == pytest.approx(float(system.potential_energy(q)) / 9.81)
    heavier = jax.tree.map(lambda leaf: jnp.array([leaf, 2 * leaf]), system)
    masses = jax.vmap(lambda system: system.mass_matrix(q))(heavier)
    assert masses[0] == pytest.approx(np.asarray(system.mass_matrix(q)))
    assert masses.shape == (2, system.space.size, system.space.size)


@pytest.mark.parametrize("make", MAKERS)
def test_single_precision_stays_single_precision(make):
    system = make((1.0,) * 12, (0.1,) * 3, 9.81)
    q, u = jnp.ones(system.space.size, jnp.float32), jnp.ones(system.inputs, jnp.float32)
    for result in (*system.vector_field(q, q, u), system.hamiltonian(q, q), system.encode(q, q), system.points(q)):
        assert result.dtype == jnp.float32

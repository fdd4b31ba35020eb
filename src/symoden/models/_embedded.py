"""The paper's right-hand side, in the coordinates that it integrates: lengths, cosines, sines, velocities."""

import jax
import jax.numpy as jnp

from symoden.mechanics import AbstractPortHamiltonian
from symoden.shapes import Embedding, Inputs, Momenta, Observation, Scalar, SquareMatrix, vector


def embedded_vector_field(system: AbstractPortHamiltonian, state: Observation, u: Inputs) -> Observation:
    """Differentiate an embedded state (r, cos φ, sin φ, q̇) by the paper's equations.

    With p = M q̇, all functions of q read the embedding z = (r, cos φ, sin φ), whence by the chain rule

        ∂H/∂φ = cos φ ∘ ∂H/∂(sin φ) − sin φ ∘ ∂H/∂(cos φ),
        d/dt cos φ = −sin φ ∘ φ̇,  d/dt sin φ = cos φ ∘ φ̇,  d/dt q̇ = d/dt(M⁻¹) p + M⁻¹ ṗ,

    (q̇, ṗ) on the right being the port-Hamiltonian equations. On the circles this is the motion of
    `AbstractPortHamiltonian.derivative`, observed; a rollout of it leaves the circles by the integrator's error.

    Args:
        system: Analytic system or learned model whose rates are velocities.
        state: Embedded coordinates, then velocities in the order of q.
        u: Inputs.

    Returns:
        Time derivative of `state`.

    Raises:
        ValueError: If the rates of `system` are momenta, or a shape is wrong.

    References:
        Zhong, Dey & Chakraborty (2020), *Dissipative SymODEN*, section 3; (2020) *Symplectic ODE-Net*, section 3, where
        the equations without D are derived.

    Example:
        >>> from symoden.systems import Pendulum
        >>> level = jnp.array([0.0, 1.0, 2.0])
        >>> embedded_vector_field(Pendulum(), level, jnp.zeros(1))[:2].tolist()
        [-2.0, 0.0]
    """
    if system.momenta:
        raise ValueError("The embedded state holds velocities; got a system whose rates are momenta.")
    space = system.space
    name = "`embedded_vector_field`"
    state = vector(
        state, space.embedded_size + space.size, f"{name}: `state`", f"entry of (r, cos φ, sin φ, q̇) on {space}"
    )
    u = vector(u, system.inputs, f"{name}: `u`", "input")
    z, v = jnp.split(state, [space.embedded_size])
    cosines, sines = jnp.split(z[len(space.lengths) :], 2)

    def energy(z: Embedding, p: Momenta) -> Scalar:
        return system.hamiltonian(space.project(z), p)

    def inverse_mass(z: Embedding) -> SquareMatrix:
        return system.inverse_mass_matrix(space.project(z))

    q = space.project(z)
    p = system.mass_matrix(q) @ v
    dH_dz, dH_dp = jax.grad(energy, argnums=(0, 1))(z, p)
    dH_dr, dH_dcos, dH_dsin = jnp.split(dH_dz, [len(space.lengths), space.size])
    dH_dq = jnp.zeros_like(q).at[space.lengths].set(dH_dr).at[space.angles].set(cosines * dH_dsin - sines * dH_dcos)
    D = system.dissipation_matrix(q, dH_dp)
    on_momenta = D.shape[0] == space.size
    effort = dH_dp if on_momenta else jnp.concatenate([dH_dq, dH_dp])
    loss_q, loss_p = (jnp.zeros_like(q), D @ effort) if on_momenta else jnp.split(D @ effort, 2)
    q_dot = dH_dp - loss_q
    p_dot = system.input_matrix(q) @ u - dH_dq - loss_p
    z_dot = jnp.concatenate([q_dot[space.lengths], -sines * q_dot[space.angles], cosines * q_dot[space.angles]])
    inverse, inverse_dot = jax.jvp(inverse_mass, (z,), (z_dot,))
    return jnp.concatenate([z_dot, inverse_dot @ p + inverse @ p_dot])

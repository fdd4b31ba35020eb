"""Conformance checks for systems and models, your own included: the laws that everything here relies on.

Every check takes a system and a seed, and raises an `AssertionError` that says which law is broken, where and by how
much. States are drawn at random, reproducibly; the first is at rest at the origin, where square roots and norms like to
break. Tolerances follow the precision of the system: 1e-9 in float64 and 1e-4 in float32, relative to what is compared.

Example:
    >>> from symoden.systems import Pendulum
    >>> check_all(Pendulum(damping=0.1))
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian
from symoden.shapes import Coordinates, Inputs, Observation, Rates, State

__all__ = [
    "Samples",
    "check_all",
    "check_batching",
    "check_compilation",
    "check_dissipation_matrix",
    "check_gradients",
    "check_inverse_mass_matrix",
    "check_mass_matrix",
    "check_periodicity",
    "check_power_balance",
    "check_round_trip",
    "check_shapes",
    "draw_samples",
]


class Samples(NamedTuple):
    """Random configurations, rates and inputs of one system, a batch of each.

    Attributes:
        q: Coordinates; angles within one turn to either side.
        rates: Velocities or momenta, as the system's data have them.
        u: Inputs.
    """

    q: Float[Array, "k n"]
    rates: Float[Array, "k n"]
    u: Float[Array, "k m"]


def draw_samples(system: AbstractDynamics, *, seed: int = 0, count: int = 16, scale: float = 2.0) -> Samples:
    """Draw states and inputs in the precision of the system.

    Args:
        system: System or model.
        seed: Seed of the draw.
        count: Number of samples; the first is zero.
        scale: Standard deviation of lengths, rates and inputs; the default is their size in the paper's tasks.

    Returns:
        The samples.
    """
    generator = np.random.default_rng(seed)
    n = system.space.size
    draw = scale * generator.standard_normal((count, 2 * n + system.inputs))
    draw[:, :n] = np.where(system.space.is_angle, generator.uniform(-2 * np.pi, 2 * np.pi, (count, n)), draw[:, :n])
    draw[0] = 0.0
    leaves = jax.tree.leaves(eqx.filter(system, eqx.is_inexact_array))
    dtype = jnp.result_type(*leaves) if leaves else jnp.result_type(float)
    return Samples(*(jnp.asarray(part, dtype) for part in np.split(draw, [n, 2 * n], axis=1)))


def check_shapes(system: AbstractDynamics, *, seed: int = 0) -> None:
    """Raise unless every function keeps to the sizes of the system and to the precision of its arguments."""
    q, rates, u = (batch[0] for batch in draw_samples(system, seed=seed, count=1))
    n, m, e = system.space.size, system.inputs, system.space.embedded_size
    if isinstance(system, AbstractPortHamiltonian):
        _shaped("hamiltonian", system.hamiltonian, (q, rates), [()])
        _shaped("mass_matrix", system.mass_matrix, (q,), [(n, n)])
        _shaped("inverse_mass_matrix", system.inverse_mass_matrix, (q,), [(n, n)])
        _shaped("input_matrix", system.input_matrix, (q,), [(n, m)])
        _shaped("dissipation_matrix", system.dissipation_matrix, (q, rates), [(n, n), (2 * n, 2 * n)])
    state = eqx.filter_eval_shape(system.encode, q, rates)
    _shaped("derivative", lambda state, u: _derivative(system, state, u), (state, u), [state.shape])
    _shaped("decode", lambda state: system.decode(state)[0], (state,), [(n,)])
    _shaped("decode", lambda state: system.decode(state)[1], (state,), [(n,)])
    _shaped("observe", system.observe, (state,), [(e + n,)])


def check_round_trip(system: AbstractDynamics, *, seed: int = 0) -> None:
    """Raise unless decoding undoes encoding, angles up to whole turns, and `observe` tells the same."""
    samples = draw_samples(system, seed=seed)
    error, rates, observed, expected = _on_each(_round_trip, system, samples.q, samples.rates)
    _equal("`decode` must be the inverse of `encode` (q)", error, np.zeros_like(error), samples)
    _equal("`decode` must be the inverse of `encode` (rates)", rates, samples.rates, samples)
    _equal("`observe` must give (embed(q), rates)", observed, expected, samples)


def check_periodicity(system: AbstractDynamics, *, seed: int = 0) -> None:
    """Raise unless motion and energy stay the same when any angle turns once round."""
    samples = draw_samples(system, seed=seed)
    for angle in system.space.angles:
        law = f"must be 2π-periodic in q[{angle}]"
        turned = samples._replace(q=samples.q.at[:, angle].add(2 * np.pi))
        here, there = (_on_each(_motion, system, *batch) for batch in (samples, turned))
        _equal(f"The motion {law}", there, here, samples)
        if isinstance(system, AbstractPortHamiltonian):
            here, there = (_on_each(_energy, system, batch.q, batch.rates) for batch in (samples, turned))
            _equal(f"`hamiltonian` {law}", there, here, samples)


def check_gradients(system: AbstractDynamics, *, seed: int = 0) -> None:
    """Raise unless the motion has finite derivatives by parameters, state and input, at rest too."""
    samples = draw_samples(system, seed=seed)
    parameters, static = eqx.partition(system, eqx.is_inexact_array_like)
    parameters = jax.tree.map(lambda leaf: jnp.asarray(leaf, samples.q.dtype), parameters)

    def loss(parameters: PyTree, q: Coordinates, rates: Rates, u: Inputs) -> Float[Array, ""]:
        return jnp.sum(_motion(eqx.combine(parameters, static), q, rates, u) ** 2)

    slopes = jax.jit(jax.vmap(jax.value_and_grad(loss, argnums=(0, 1, 2, 3)), in_axes=(None, 0, 0, 0)))
    leaves, _ = jax.tree_util.tree_flatten_with_path(slopes(parameters, *samples))
    for path, leaf in leaves:
        finite = np.isfinite(leaf).reshape(len(samples.q), -1).all(axis=1)
        _require(
            bool(finite.all()),
            "The motion must have finite derivatives by (parameters, q, rates, u); "
            f"not so {jax.tree_util.keystr(path)} at {_where(samples, int(finite.argmin()))}",
        )


def check_compilation(system: AbstractDynamics, *, seed: int = 0) -> None:
    """Raise unless compiled functions give what they give uncompiled."""
    samples = draw_samples(system, seed=seed, count=3)
    plain = np.stack([_flow(system, *sample) for sample in zip(*samples, strict=True)])
    _equal("The flow must be the same compiled and not", _on_each(_flow, system, *samples), plain, samples)


def check_batching(system: AbstractDynamics, *, seed: int = 0) -> None:
    """Raise unless a batch by `jax.vmap` gives what its samples give one by one."""
    samples, single = draw_samples(system, seed=seed), eqx.filter_jit(_motion)
    alone = np.stack([single(system, *sample) for sample in zip(*samples, strict=True)])
    _equal("The motion must be the same in a batch and alone", _on_each(_motion, system, *samples), alone, samples)


def check_mass_matrix(system: AbstractPortHamiltonian, *, seed: int = 0) -> None:
    """Raise unless M(q) is symmetric positive definite."""
    samples = draw_samples(system, seed=seed)
    M = _on_each(lambda system, q: system.mass_matrix(q), system, samples.q)
    _definite("mass_matrix", M, samples, strictly=True)


def check_inverse_mass_matrix(system: AbstractPortHamiltonian, *, seed: int = 0) -> None:
    """Raise unless M⁻¹(q) is symmetric positive definite and the inverse of M(q)."""
    samples = draw_samples(system, seed=seed)
    M, inverse = _on_each(lambda system, q: (system.mass_matrix(q), system.inverse_mass_matrix(q)), system, samples.q)
    _definite("inverse_mass_matrix", inverse, samples, strictly=True)
    condition = np.linalg.cond(M)[:, None, None]
    unity = np.broadcast_to(np.eye(system.space.size), M.shape)
    law = "`inverse_mass_matrix` must be the inverse of `mass_matrix`"
    _equal(law, M @ inverse / condition, unity / condition, samples)


def check_dissipation_matrix(system: AbstractPortHamiltonian, *, seed: int = 0) -> None:
    """Raise unless D(q, v) is symmetric positive semidefinite: friction takes energy and never gives it."""
    samples = draw_samples(system, seed=seed)
    D = _on_each(lambda system, q, v: system.dissipation_matrix(q, v), system, samples.q, samples.rates)
    _definite("dissipation_matrix", D, samples, strictly=False)


def check_power_balance(system: AbstractPortHamiltonian, *, seed: int = 0) -> None:
    """Raise unless Ḣ = yᵀu − vᵀDv along the flow, each term computed on its own, with vᵀDv ≥ 0."""
    samples = draw_samples(system, seed=seed)
    stored, supplied, dissipated, size = _on_each(_powers, system, *samples)
    law = "Stored power must be supplied less dissipated power"
    _equal(law, stored / size, (supplied - dissipated) / size, samples)
    _equal("Dissipated power must not be negative", np.minimum(dissipated, 0.0), np.zeros_like(stored), samples)


def check_all(system: AbstractDynamics, *, seed: int = 0) -> None:
    """Run every check that applies to the kind of system.

    Args:
        system: System or model. Only port-Hamiltonian ones have matrices and a power balance to check.
        seed: Seed of the samples.
    """
    check_shapes(system, seed=seed)
    check_round_trip(system, seed=seed)
    check_periodicity(system, seed=seed)
    check_gradients(system, seed=seed)
    check_compilation(system, seed=seed)
    check_batching(system, seed=seed)
    if isinstance(system, AbstractPortHamiltonian):
        check_mass_matrix(system, seed=seed)
        check_inverse_mass_matrix(system, seed=seed)
        check_dissipation_matrix(system, seed=seed)
        check_power_balance(system, seed=seed)


def _derivative(system: AbstractDynamics, state: State, u: Inputs) -> State:
    """Derivative of the state at time zero."""
    return system.derivative(jnp.zeros((), state.dtype), state, u)


def _flow(system: AbstractDynamics, q: Coordinates, rates: Rates, u: Inputs) -> Float[Array, " k"]:
    """Derivative of the state, and the observation."""
    state = system.encode(q, rates)
    return jnp.concatenate([_derivative(system, state, u), system.observe(state)])


def _motion(system: AbstractDynamics, q: Coordinates, rates: Rates, u: Inputs) -> Observation:
    """Rate of the observation: it exists for every kind of state and does not depend on the chart."""
    state = system.encode(q, rates)
    return jax.jvp(system.observe, (state,), (_derivative(system, state, u),))[1]


def _round_trip(system: AbstractDynamics, q: Coordinates, rates: Rates) -> tuple[Array, ...]:
    """Error in q, rates, the observation, and what it should be."""
    state = system.encode(q, rates)
    decoded, decoded_rates = system.decode(state)
    expected = jnp.concatenate([system.space.embed(q), rates])
    return system.space.difference(decoded, q), decoded_rates, system.observe(state), expected


def _energy(system: AbstractPortHamiltonian, q: Coordinates, p: Rates) -> Float[Array, ""]:
    """Energy, with the system as an argument."""
    return system.hamiltonian(q, p)


def _powers(system: AbstractPortHamiltonian, q: Coordinates, p: Rates, u: Inputs) -> tuple[Array, ...]:
    """Power balance, and the size of the powers that cancel in it, to which rounding is relative."""
    dH_dq, dH_dp = jax.grad(system.hamiltonian, argnums=(0, 1))(q, p)
    q_dot, p_dot = system.vector_field(q, p, u)
    return *system.power_balance(q, p, u), 1 + jnp.abs(dH_dq) @ jnp.abs(q_dot) + jnp.abs(dH_dp) @ jnp.abs(p_dot)


@eqx.filter_jit
def _compiled(function: Callable[..., PyTree], system: AbstractDynamics, *batches: Array) -> PyTree:
    """Compile a function of one sample for a batch; the weights are arguments, not constants."""
    return jax.vmap(lambda *sample: function(system, *sample))(*batches)


def _on_each(function: Callable[..., PyTree], system: AbstractDynamics, *batches: Array) -> PyTree:
    """Evaluate a function of one sample on a batch, as NumPy arrays."""
    return jax.tree.map(np.asarray, _compiled(function, system, *batches))


def _shaped(name: str, function: Callable[..., Array], arguments: tuple, shapes: list[tuple[int, ...]]) -> None:
    """Require a result to have one of the shapes, and the precision of the first argument."""
    result, dtype = eqx.filter_eval_shape(function, *arguments), arguments[0].dtype
    _require(
        result.shape in shapes and result.dtype == dtype,
        f"`{name}` must have shape {' or '.join(map(str, shapes))} and dtype {dtype}; got {result.shape} and "
        f"{result.dtype}. Let shapes follow `space` and `inputs`, and dtypes the arguments",
    )


def _definite(name: str, matrices: np.ndarray, samples: Samples, *, strictly: bool) -> None:
    """Require symmetric matrices with positive, or not negative, eigenvalues."""
    _equal(f"`{name}` must be symmetric", matrices, np.swapaxes(matrices, 1, 2), samples)
    smallest = np.linalg.eigvalsh(matrices)[:, 0]
    size = 1 + np.abs(matrices).max(axis=(1, 2))
    worst = int(np.argmin(smallest / size))
    _require(
        bool((smallest > 0).all() if strictly else (smallest >= -_tolerance(samples) * size).all()),
        f"`{name}` must be positive {'definite' if strictly else 'semidefinite'}; "
        f"its smallest eigenvalue is {smallest[worst]:.3g} at {_where(samples, worst)}",
    )


def _equal(law: str, left: np.ndarray, right: np.ndarray | Array, samples: Samples) -> None:
    """Require results, a row for each sample, to be finite and equal up to rounding."""
    left, right = (np.asarray(side).reshape(len(samples.q), -1) for side in (left, right))
    error = np.abs(left - right).max(axis=1) / (1 + np.abs(right).max(axis=1))
    worst = int(np.argmax(np.where(np.isnan(error), np.inf, error)))
    _require(
        bool(error[worst] <= _tolerance(samples)), f"{law}; it is off by {error[worst]:.3g} at {_where(samples, worst)}"
    )


def _tolerance(samples: Samples) -> float:
    """Relative error that is still rounding: 1e-9 in float64, 1e-4 in float32."""
    return float(jnp.finfo(samples.q.dtype).eps) ** 0.575


def _where(samples: Samples, index: int) -> str:
    """Name one sample."""
    return ", ".join(f"{name} = {np.asarray(batch[index])}" for name, batch in samples._asdict().items())


def _require(holds: bool, message: str) -> None:  # noqa: FBT001 (the condition is the subject)
    """Raise the message unless the law holds."""
    if not holds:
        raise AssertionError(f"{message}.")

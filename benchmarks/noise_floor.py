"""How still any controller could hold a system whose measurements are noisy: the best regulator on the best filter.

    python benchmarks/noise_floor.py

The truth is linearised at the top, the input costs next to nothing, and the filter is Kalman's with no doubt of the
model. What is left is the noise's: standard deviations of (q, v) at the samples, by what is weighed.
"""

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg

from symoden.control import linearize
from symoden.systems import MACHINES

NOISE = 0.01
CHEAP = 1e-6 / 15**2
EXACT = 1e-14


def floor(A: np.ndarray, B: np.ndarray, weights: np.ndarray, period: float) -> np.ndarray:
    """Standard deviations of the sampled state under linear-quadratic-Gaussian control."""
    s, m = B.shape
    both = scipy.linalg.expm(np.block([[A, B], [np.zeros((m, s + m))]]) * period)
    A, B, one = both[:s, :s], both[:s, s:], np.eye(s)
    P = scipy.linalg.solve_discrete_are(A, B, np.diag(weights), CHEAP * np.eye(m))
    K = np.linalg.solve(CHEAP * np.eye(m) + B.T @ P @ B, B.T @ P @ A)
    S = scipy.linalg.solve_discrete_are(A.T, one, EXACT * one, NOISE**2 * one)
    L = S @ np.linalg.inv(S + NOISE**2 * one)
    closed = A - B @ K
    # State x and prediction x̂: the estimate is x̂ + L (x + noise − x̂), and u = −K times it.
    whole = np.block([[A - B @ K @ L, -B @ K @ (one - L)], [closed @ L, closed @ (one - L)]])
    entry = np.vstack([-B @ K @ L, closed @ L])
    covariance = scipy.linalg.solve_discrete_lyapunov(whole, NOISE**2 * entry @ entry.T)
    return np.sqrt(np.diag(covariance)[:s])


def main() -> None:
    """Print a table for the two systems with one input and two coordinates."""
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's signature
    print("| system | period [ms] | weighed | q₁ | q₂ | v₁ | v₂ |\n|---|---:|---|---:|---:|---:|---:|")
    weighed = {
        "all, by their tolerances": [400.0, 400.0, 100.0, 100.0],
        "q₂ alone": [1e-9, 1.0, 1e-9, 1e-9],
        "v₂ alone": [1e-9, 1e-9, 1e-9, 1.0],
    }
    for name in ("symoden/DampedCartPole-v0", "symoden/DampedAcrobot-v0"):
        machine = MACHINES[name]
        A, B, _ = linearize(machine.system, jnp.asarray(machine.target))
        for period in (0.005, 0.02):
            for what, weights in weighed.items():
                deviations = floor(A, B, np.array(weights), period)
                cells = " | ".join(f"{x:.3f}" for x in deviations)
                print(f"| {name} | {1e3 * period:g} | {what} | {cells} |")


if __name__ == "__main__":
    main()

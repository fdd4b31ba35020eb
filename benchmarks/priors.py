"""How fast learned priors settle: MacKay's fixed point beside expectation maximisation.

    python benchmarks/priors.py

The naive model of task 2 is trained on data with noise of 0.01 to where its priors would be learned, and linearised
there. Printed are by how much the logarithm of the evidence has risen, and how many parameters the data determine,
after so many passes; each costs a Cholesky factor and the inverse of a triangle.
"""

import dataclasses
import time

import jax
import numpy as np
from threadpoolctl import threadpool_limits

from symoden.experiments import preset
from symoden.experiments._sources import read_source
from symoden.training import fit
from symoden.training._data import hold_out, levenberg_data
from symoden.training._flatten import Flattening, cast
from symoden.training._gauss_newton import Linearization, NormalEquations
from symoden.training._level import independent_variance
from symoden.training._relevance import _posterior, parameter_groups

PASSES = (1, 2, 4, 8, 16, 32, 64)
BOUNDS = (1e-6, 1e8)


def naive_model() -> tuple[NormalEquations, np.ndarray, np.ndarray]:
    """Its equations, its parameters and the groups that share a prior."""
    data = read_source("pendulum", seed=0, noise=0.01).dataset
    model, training = preset("default", task="pendulum", kind="naive")
    config = dataclasses.replace(training, restarts=1, growth_steps=0, relevance_steps=0)
    trained = fit(data, model=model, config=config).model
    with jax.enable_x64(True), jax.numpy_dtype_promotion("standard"):  # noqa: FBT003 - JAX's signature
        windows = levenberg_data(hold_out(data, config), trained, config)
        restore, theta = Flattening.of(cast(trained, float), corrections=0)
        equations = Linearization.at(restore, theta, windows.objective, windows.train).normal_equations()
        return equations, np.asarray(theta), parameter_groups(restore.shapes)


def main() -> None:
    """Print a table."""
    equations, theta, groups = naive_model()
    count = equations.residuals.size / independent_variance(equations)
    squares = equations.matrix * count
    pull = squares @ theta - equations.gradient * count
    sizes = np.bincount(groups)
    rounding = float(np.finfo(float).eps * np.trace(squares))
    print(f"{theta.size} parameters in {sizes.size} groups\n")
    print("| pass | expectation maximisation | | fixed point | |\n|---:|---:|---:|---:|---:|")
    table: dict[int, list[str]] = {number: [] for number in PASSES}
    seconds = 0.0
    for fixed_point in (False, True):
        precision, first = np.ones(sizes.size), 0.0
        for number in range(max(PASSES) + 1):
            started = time.perf_counter()
            with threadpool_limits(1, user_api="blas"):
                best, variances, logdet = _posterior(squares + np.diag(precision[groups] + rounding), pull)
            seconds = time.perf_counter() - started
            evidence = (sizes @ np.log(precision) - logdet + pull @ best) / 2
            first = first or evidence
            spread, square = np.bincount(groups, variances), np.bincount(groups, best**2)
            determined = sizes - (precision + rounding) * spread
            if number in table:
                table[number] += [f"{evidence - first:.1f}", f"{determined.sum():.1f}"]
            wanted = determined / square if fixed_point else sizes / (square + spread)
            precision = np.clip(wanted, *BOUNDS)
    for number, cells in table.items():
        print(f"| {number} | {' | '.join(cells)} |")
    print(f"\na pass takes {seconds:.2f} s")


if __name__ == "__main__":
    main()

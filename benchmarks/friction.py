"""How much of the friction energy shaping should make up for, tried on the models of a run's ensemble.

    python benchmarks/friction.py RUN --target 3.1416 0 --max-input 4

The limits must exceed the weight anywhere; the ensemble comes from `symoden train … --members 8`.
"""

import argparse
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from symoden.control import EnergyShaping, Loop, judge, run_in_turn
from symoden.experiments import learned_machine, read_ensemble, read_model, read_run, starts_of
from symoden.mechanics import AbstractPortHamiltonian

SHARES = (0.0, 0.5, 0.65, 0.8)
EPISODES = 24
LOOP = Loop(duration=15.0, step=0.001)


def main() -> None:
    """Print a line for each share."""
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's signature
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    parser.add_argument("--target", type=float, nargs="+", required=True)
    parser.add_argument("--max-input", type=float, required=True)
    words = parser.parse_args()
    config, model = read_run(words.run), read_model(words.run)
    ensemble = read_ensemble(words.run, model, config)
    if ensemble is None or not isinstance(model, AbstractPortHamiltonian):
        parser.error("the run must have an ensemble of models with energy: train it with `--resume --members 8`")
    machine = learned_machine(model, words.target, config.data.ranges)
    plants = list(ensemble.models())
    q0, v0 = starts_of(machine, "energy-shaping").draw(EPISODES, 0)
    for share in SHARES:
        controller = EnergyShaping.of(model, jnp.asarray(words.target), limits=words.max_input, compensation=share)
        tried = run_in_turn(plants, controller, q0, v0, LOOP)
        verdicts = [judge(records, model.space, np.asarray(words.target)) for _, records in tried]
        settling = np.concatenate([each.settling[each.success] for each in verdicts])
        speed = np.median(np.concatenate([each.velocity_error for each in verdicts]))
        median = np.median(settling) if settling.size else np.nan
        print(
            f"{share:.2f} made up for: {settling.size} of {EPISODES}, {median:.2f} s, last speed {speed:.1e}",
            flush=True,
        )


if __name__ == "__main__":
    main()

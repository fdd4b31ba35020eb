"""The learned arm C1 beside what its laboratory identified: inertia, gravity and friction, in per cent off.

    symoden train examples/dfki-c1.toml --out runs/c1
    python benchmarks/laboratory.py runs/c1 dfki-double-pendulum/C1/identified_model_2.0.yml

The laboratory's file comes with the recordings.
"""

import argparse
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from symoden import load
from symoden.mechanics import AbstractMechanical

POSITIONS = (0.5, 0.3), (1.2, -0.8), (-0.8, 1.0)  # [rad]
SPEEDS = 0.5, 3.0  # [rad/s]
SLOPE = 100.0  # Of the laboratory's dry friction, cf 2/π arctan(100 v).


def parameters(path: Path) -> dict[str, float]:
    """Numbers of the laboratory's file, one a line."""
    pairs = (line.split(":") for line in path.read_text().splitlines() if ":" in line)
    return {name.strip(): float(number) for name, number in pairs}


def mass_matrix(lab: dict[str, float], q: np.ndarray) -> np.ndarray:
    """Inertia of two links and of the drives' rotors behind their gears."""
    elbow, ratio, rotor = lab["m2"] * lab["l1"] * lab["r2"] * np.cos(q[1]), lab["gr"], lab["Ir"]
    first = lab["I1"] + lab["I2"] + lab["m2"] * lab["l1"] ** 2 + 2 * elbow + (ratio**2 + 1) * rotor
    both = lab["I2"] + elbow - ratio * rotor
    return np.array([[first, both], [both, lab["I2"] + ratio**2 * rotor]])


def gravity(lab: dict[str, float], q: np.ndarray) -> np.ndarray:
    """Torques of gravity."""
    second = lab["m2"] * lab["g"] * lab["r2"] * np.sin(q[0] + q[1])
    first = (lab["m1"] * lab["r1"] + lab["m2"] * lab["l1"]) * lab["g"] * np.sin(q[0])
    return np.array([first + second, second])


def main() -> None:
    """Print a line for each part."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("run", type=Path)
    arguments.add_argument("laboratory", type=Path)
    given = arguments.parse_args()
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's signature
    model, lab = load(given.run / "model.safetensors"), parameters(given.laboratory)
    if not isinstance(model, AbstractMechanical):
        raise TypeError(f"The run must be of a mechanical model; it is {type(model).__name__}.")
    for q in map(np.array, POSITIONS):
        mass, load_of = np.asarray(model.mass_matrix(jnp.asarray(q))), jax.grad(model.potential_energy)(jnp.asarray(q))
        off = mass / mass_matrix(lab, q) - 1, np.asarray(load_of) / gravity(lab, q) - 1
        print(f"{q}: M11, M12, M22 {100 * off[0][np.triu_indices(2)]} %, gravity {100 * off[1]} %")
    for speed in SPEEDS:
        learned = [
            float(model.dissipation_matrix(jnp.zeros(2), speed * jnp.eye(2)[joint])[joint, joint]) * speed
            for joint in range(2)
        ]
        law = [lab[f"b{k}"] * speed + lab[f"cf{k}"] * 2 / np.pi * np.arctan(SLOPE * speed) for k in (1, 2)]
        print(f"friction at {speed} rad/s: {100 * (np.array(learned) / law - 1)} %")


if __name__ == "__main__":
    np.set_printoptions(precision=1, suppress=True)
    main()

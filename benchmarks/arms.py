"""Simulated arms of any number of joints, as logs and URDF files: how many joints training can take, and how soon.

    python benchmarks/arms.py --joints 6 --out runs/arm-6
    symoden train runs/arm-6/robot.toml --out runs/arm-6/run --max-minutes 10

Axes from the base outwards are z y y x y x; there is dry friction, and noise on positions and velocities. `arm.toml`
describes the logs alone, `robot.toml` names a URDF file too, whose masses, centres and inertias are off by up to 30 %.
"""

import argparse
import csv
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from numpy.random import Generator

from symoden import KnownParts, read_urdf
from symoden.blocks import without_silent
from symoden.integrate import RK4
from symoden.mechanics import AbstractMechanical
from symoden.models import ModelConfig, build
from symoden.spaces import Space

AXES = "zyyxyx"
STEP = 0.01
NOISE = 2e-4, 5e-3  # [rad], [rad/s]
GUESS = 0.3
BENT = 0.7  # Middle of every joint's motion [rad]: stretched upwards, nothing would resist the first.
RECORDINGS = {"train": 6, "test": 2}


def urdf(joints: int, generator: Generator, error: float) -> str:
    """An arm of thick links, each number of a body off by up to a share."""

    def off() -> float:
        return float(1 + error * generator.uniform(-1, 1))

    links = ['<link name="base"/>']
    for k in range(joints):
        length, mass = 0.35 * 0.85**k, 4.0 * 0.7**k
        place = 0.35 * 0.85 ** (k - 1) if k else 0.0
        wide, thin = mass * length**2 / 12, 0.01 * mass
        axis = " ".join("1" if letter == AXES[k % len(AXES)] else "0" for letter in "xyz")
        links.append(
            f'<joint name="joint{k + 1}" type="continuous"><parent link="{"base" if k == 0 else f"link{k}"}"/>'
            f'<child link="link{k + 1}"/><origin xyz="0 0 {place}"/><axis xyz="{axis}"/></joint>'
            f'<link name="link{k + 1}"><inertial><mass value="{mass * off()}"/>'
            f'<origin xyz="0 0 {length / 2 * off()}"/><inertia ixx="{wide * off()}" iyy="{wide * off()}" '
            f'izz="{thin * off()}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
    return f'<robot name="arm">{"".join(links)}</robot>\n'


def friction(joints: int) -> list[list[str]]:
    """Viscous and dry friction of every joint, the larger ones nearer to the base."""
    sizes = 0.6 ** np.arange(joints)
    laws = [f"{0.3 * size} + {0.8 * size} / sqrt(v{k + 1}**2 + 0.0025)" for k, size in enumerate(sizes)]
    return [[law if i == k else "0" for i in range(joints)] for k, law in enumerate(laws)]


def simulate(arm: AbstractMechanical, seconds: float, generator: Generator) -> dict[str, np.ndarray]:
    """One recording: drives follow sums of sines, and what they push with is logged."""
    n, samples = arm.space.size, round(seconds / STEP)
    ts = np.arange(samples + 1) * STEP
    phases, paces = generator.uniform(0, 2 * np.pi, (3, n)), generator.uniform(0.8, 3.0, (3, n))
    sizes = generator.uniform(0.1, 0.35, (3, n))
    wanted = jnp.asarray(BENT + np.sum(sizes * np.sin(paces * ts[:, None, None] + phases), axis=1))
    stiffness = jnp.asarray(60.0 * 0.5 ** np.arange(n))
    solver = RK4(10)

    def step(state: jax.Array, sample: tuple) -> tuple:
        t, target = sample
        q, v = arm.decode(state)
        u = stiffness * (target - q) - 0.15 * stiffness * v
        u = u + jax.grad(arm.potential_energy)(q)
        after = solver.step(arm.derivative, state, t, t + STEP, u, u)
        return after, (q, v, u)

    start = arm.encode(wanted[0], jnp.zeros(n))
    _, (q, v, u) = jax.jit(lambda start: jax.lax.scan(step, start, (jnp.asarray(ts), wanted)))(start)
    return {
        "q": np.asarray(q) + NOISE[0] * generator.normal(size=q.shape),
        "v": np.asarray(v) + NOISE[1] * generator.normal(size=v.shape),
        "u": np.asarray(u),
    }


def write(path: Path, recording: dict[str, np.ndarray], *, digits: int = 7) -> None:
    """A CSV file of one recording."""
    path.parent.mkdir(parents=True, exist_ok=True)
    names = [f"{letter}{k + 1}" for letter, columns in recording.items() for k in range(columns.shape[1])]
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(np.concatenate([*recording.values()], axis=1).round(digits).tolist())


def description(joints: int, robot: str) -> str:
    """What TOML says of the logs."""
    named = {
        key: [f"{letter}{k + 1}" for k in range(joints)]
        for key, letter in (("positions", "q"), ("velocities", "v"), ("inputs", "u"))
    }
    lines = [f'space = "T{joints}"', f"dt = {STEP}", *(f"{key} = {names}" for key, names in named.items())]
    lines.append(f"input_matrix = {np.eye(joints).tolist()}")
    lines += [line for part in RECORDINGS for line in (f"[{part}]", f'files = ["{part}/*.csv"]')]
    return "\n".join([*lines, *(["[known]", f'robot = "{robot}"'] if robot else [])]) + "\n"


def main() -> None:
    """Write logs, URDF files and descriptions."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--joints", type=int, default=6)
    arguments.add_argument("--seconds", type=float, default=20.0)
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--out", type=Path, required=True)
    given = arguments.parse_args()
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's signature
    generator = np.random.default_rng(given.seed)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "truth.urdf").write_text(urdf(given.joints, generator, 0.0))
    (given.out / "guess.urdf").write_text(urdf(given.joints, generator, GUESS))
    known = KnownParts(robot=read_urdf(given.out / "truth.urdf"), dissipation_matrix=friction(given.joints))
    space = Space.parse(f"T{given.joints}")
    one = np.eye(given.joints)
    arm = build(ModelConfig(), space, given.joints, input_matrix=one, known=known, key=jax.random.key(0))
    if not isinstance(arm, AbstractMechanical):
        raise TypeError(f"An arm must be mechanical; got {type(arm).__name__}.")
    arm = without_silent(arm)
    for part, count in RECORDINGS.items():
        for k in range(count):
            write(given.out / part / f"{k}.csv", simulate(arm, given.seconds, generator))
    (given.out / "arm.toml").write_text(description(given.joints, ""))
    (given.out / "robot.toml").write_text(description(given.joints, "guess.urdf"))


if __name__ == "__main__":
    main()

"""Simulated machines with the quirks of real logs, beside what their true equations predict from the same starts.

    python benchmarks/machines.py emps --out runs/machines
    symoden train runs/machines/emps/machine.toml --out runs/machines/emps/run
    symoden evaluate runs/machines/emps/run

The first line writes recordings and their description, and prints how far the true equations, rolled out from the
measured starts, are from the test recordings: no model can be expected to do better.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from arms import write
from numpy.random import Generator

from symoden import KnownParts, read_dataset
from symoden.blocks import without_silent
from symoden.evaluation import score_recordings
from symoden.integrate import RK4
from symoden.mechanics import AbstractMechanical
from symoden.models import ModelConfig, build
from symoden.spaces import Space

Command = Callable[[jax.Array, jax.Array, jax.Array], jax.Array]
PARTS = {"train": 4, "test": 2}
SUBSTEP = 2.5e-4  # Longest step of the simulation [s].


@dataclass(frozen=True, kw_only=True)
class Machine:
    """Equations, a controller that moves the machine, and how it is logged.

    Attributes:
        space: Configuration space.
        parts: Inertia, potential, actuation and friction.
        command: Inputs from coordinates, velocities and what is wanted; held from sample to sample.
        wanted: Middle and half the range of everything that is wanted [m, rad].
        pace: Slowest and fastest of three sines that make what is wanted [rad/s]; or 0 and the time in which the
            machine moves from one point to the next [s].
        start: Coordinates at rest at the beginning; half a spread about them is drawn.
        rate: Samples a second.
        steps: Smallest step that is logged of every coordinate [m, rad]: a sensor's resolution.
        noise: Standard deviation of every coordinate's noise [m, rad].
        seconds: Length of a recording.
        recordings: How many recordings each part has.
    """

    space: str
    parts: KnownParts
    command: Command
    wanted: tuple[tuple[float, float], ...]
    pace: tuple[float, float]
    start: tuple[tuple[float, float], ...]
    rate: float
    steps: tuple[float, ...] = (0.0,)
    noise: tuple[float, ...] = (0.0,)
    seconds: float = 12.0
    recordings: Mapping[str, int] = field(default_factory=lambda: PARTS)

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return np.asarray(self.parts.input_matrix).shape[1]


def dry(joint: int, viscous: float, coulomb: float, knee: float) -> str:
    """Viscous and dry friction of one joint, the latter smoothed below a knee."""
    return f"{viscous} + {coulomb} / sqrt(v{joint}**2 + {knee**2})"


def turn(counts: int) -> float:
    """Step of an encoder [rad]."""
    return 2 * np.pi / counts


def fly(q: jax.Array, v: jax.Array, r: jax.Array) -> jax.Array:
    """Thrusts of a drone that is drawn to a point."""
    ahead = jnp.clip(2.0 * (r - q[:2]) - 2.5 * v[:2], -4, 4)
    lean = -jnp.arctan2(ahead[0], 9.81 + ahead[1])
    total = 0.5 * jnp.hypot(ahead[0], 9.81 + ahead[1])
    turning = 0.005 * (80.0 * (lean - q[2]) - 14.0 * v[2]) / 0.15
    return jnp.clip(jnp.stack([total + turning, total - turning]) / 2, 0.0, 6.0)


MACHINES: dict[str, Machine] = {
    # A drive of a slide, with the numbers of the EMPS (Janot, Gautier & Brunot 2019): force per volt, an offset.
    "emps": Machine(
        space="R1",
        parts=KnownParts(
            mass_matrix=[[95.1]],
            potential_energy="3.16 * q1",
            input_matrix=[[35.15]],
            dissipation_matrix=[[dry(1, 203.5, 20.4, 0.002)]],
        ),
        command=lambda q, v, r: jnp.clip(243.0 * (160.0 * (r - q) - v) / 35.15, -10, 10),
        wanted=((0.12, 0.12),),
        pace=(0.0, 1.5),
        start=((0.0, 0.0),),
        steps=(2e-6,),
        rate=1000.0,
        seconds=24.8,
        recordings={"train": 1, "test": 1},
    ),
    "belt": Machine(
        space="R2",
        parts=KnownParts(
            mass_matrix=[[1.5, 0], [0, 0.8]],
            potential_energy="2000 * (q1 - q2)**2",
            input_matrix=[[1], [0]],
            dissipation_matrix=[[dry(1, 2.0, 1.5, 0.005), 0], [0, dry(2, 1.0, 1.0, 0.005)]],
        ),
        command=lambda q, v, r: jnp.clip(150.0 * (r - q[:1]) - 15.0 * v[:1], -30, 30),
        wanted=((0.0, 0.3),),
        pace=(1.0, 12.0),
        start=((0.0, 0.0), (0.0, 0.0)),
        steps=(1e-5, 1e-5),
        rate=500.0,
    ),
    "cogging": Machine(
        space="T1",
        parts=KnownParts(
            mass_matrix=[[0.05]],
            potential_energy="-cos(q1) + 0.0125 * cos(12*q1)",
            input_matrix=[[1]],
            dissipation_matrix=[[dry(1, 0.02, 0.1, 0.03)]],
        ),
        command=lambda q, v, r: jnp.clip(8.0 * (r - q) - 0.5 * v, -3, 3),
        wanted=((0.0, 2.5),),
        pace=(0.7, 4.0),
        start=((0.0, 0.5),),
        steps=(turn(8192),),
        rate=200.0,
    ),
    # Motor and link, joined by a spring.
    "elastic": Machine(
        space="T2",
        parts=KnownParts(
            mass_matrix=[[0.03, 0], [0, 0.06]],
            potential_energy="12.5 * (q1 - q2)**2 - 1.2 * cos(q2)",
            input_matrix=[[1], [0]],
            dissipation_matrix=[[dry(1, 0.02, 0.12, 0.02), 0], [0, dry(2, 0.005, 0.03, 0.02)]],
        ),
        command=lambda q, v, r: jnp.clip(4.0 * (r - q[:1]) - 0.25 * v[:1], -4, 4),
        wanted=((0.0, 1.5),),
        pace=(0.8, 6.0),
        start=((0.0, 0.0), (0.0, 0.0)),
        steps=(turn(16384), turn(16384)),
        rate=200.0,
        seconds=15.0,
    ),
    # A motor in volts, whose back-EMF is friction; the pole hangs.
    "cartpole": Machine(
        space="R1 T1",
        parts=KnownParts(
            mass_matrix=[["0.7", "0.03 * cos(q2)"], ["0.03 * cos(q2)", "0.012"]],
            potential_energy="-0.3 * cos(q2)",
            input_matrix=[[1.7], [0]],
            dissipation_matrix=[[dry(1, 6.0, 1.0, 0.01), 0], [0, dry(2, 3e-4, 5e-4, 0.05)]],
        ),
        command=lambda q, v, r: jnp.clip(60.0 * (r - q[:1]) - 6.0 * v[:1], -12, 12),
        wanted=((0.0, 0.25),),
        pace=(1.5, 9.0),
        start=((0.0, 0.0), (0.0, 1.5)),
        steps=(2.3e-5, turn(4096)),
        rate=500.0,
    ),
    "wheel": Machine(  # A pendulum with a reaction wheel; the wheel's angle is measured from the pendulum.
        space="T2",
        parts=KnownParts(
            mass_matrix=[[0.03, 6e-4], [6e-4, 6e-4]],
            potential_energy="-0.9 * cos(q1)",
            input_matrix=[[0], [1]],
            dissipation_matrix=[[dry(1, 1e-3, 4e-3, 0.05), 0], [0, dry(2, 2e-5, 2e-3, 0.5)]],
        ),
        command=lambda q, v, r: jnp.clip(0.12 * (r - q[:1]) - 8e-4 * v[1:], -0.12, 0.12),
        wanted=((0.0, 1.2),),
        pace=(3.0, 8.0),
        start=((0.0, 1.0), (0.0, 0.0)),
        steps=(turn(4096), turn(2048)),
        rate=200.0,
    ),
    "furuta": Machine(
        space="T2",
        parts=KnownParts(
            mass_matrix=[
                ["0.006 + 0.0012 * sin(q2)**2", "0.0016 * cos(q2)"],
                ["0.0016 * cos(q2)", "0.0012"],
            ],
            potential_energy="-0.12 * cos(q2)",
            input_matrix=[[1], [0]],
            dissipation_matrix=[[dry(1, 4e-3, 6e-3, 0.05), 0], [0, dry(2, 5e-5, 2e-4, 0.05)]],
        ),
        command=lambda q, v, r: jnp.clip(0.4 * (r - q[:1]) - 0.03 * v[:1], -0.2, 0.2),
        wanted=((0.0, 1.2),),
        pace=(2.0, 9.0),
        start=((0.0, 0.0), (0.0, 2.5)),
        steps=(turn(2048), turn(2048)),
        rate=200.0,
    ),
    # A planar drone: thrusts of two propellers along the body's normal, drag; it follows points in the plane.
    "drone": Machine(
        space="R2 T1",
        parts=KnownParts(
            mass_matrix=[[0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.005]],
            potential_energy="0.5 * 9.81 * q2",
            input_matrix=[["-sin(q3)", "-sin(q3)"], ["cos(q3)", "cos(q3)"], [0.15, -0.15]],
            dissipation_matrix=[[0.15, 0, 0], [0, 0.15, 0], [0, 0, 0.004]],
        ),
        command=fly,
        wanted=((0.0, 1.5), (1.0, 0.8)),
        pace=(0.8, 2.5),
        start=((0.0, 0.0), (1.0, 0.0), (0.0, 0.0)),
        noise=(1e-3, 1e-3, 2e-3),
        rate=200.0,
    ),
    # A boat with two screws: drag by direction, which turns with it.
    "boat": Machine(
        space="R2 T1",
        parts=KnownParts(
            mass_matrix=[[25.0, 0, 0], [0, 25.0, 0], [0, 0, 3.0]],
            potential_energy="0",
            input_matrix=[["cos(q3)", "cos(q3)"], ["sin(q3)", "sin(q3)"], [-0.3, 0.3]],
            dissipation_matrix=[
                ["8 * cos(q3)**2 + 40 * sin(q3)**2", "-32 * sin(q3) * cos(q3)", "0"],
                ["-32 * sin(q3) * cos(q3)", "8 * sin(q3)**2 + 40 * cos(q3)**2", "0"],
                ["0", "0", "4 + 2 * sqrt(v3**2 + 1e-6)"],
            ],
        ),
        command=lambda q, v, r: jnp.stack([7.0 + r[0] - r[1], 7.0 + r[0] + r[1]]),
        wanted=((0.0, 4.0), (0.0, 6.0)),
        pace=(0.2, 0.9),
        start=((0.0, 0.0), (0.0, 0.0), (0.0, 1.5)),
        noise=(5e-3, 5e-3, 5e-3),
        rate=20.0,
        seconds=60.0,
    ),
}


def wanted(machine: Machine, generator: Generator) -> np.ndarray:
    """What the controller is told, sample by sample."""
    ts = np.arange(round(machine.seconds * machine.rate)) / machine.rate
    middle, half = np.asarray(machine.wanted).T
    slow, fast = machine.pace
    if slow:
        phases, paces = generator.uniform(0, 2 * np.pi, (3, len(half))), generator.uniform(slow, fast, (3, len(half)))
        sizes = half * generator.dirichlet(np.ones(3), len(half)).T
        return middle + np.sum(sizes * np.sin(paces * ts[:, None, None] + phases), axis=1)
    points = generator.uniform(-1, 1, (round(machine.seconds / fast) + 2, len(half)))
    points[0] = -1
    place, share = np.divmod(ts / fast, 1.0)
    share = np.clip(1.5 * share, 0, 1)[:, None]  # A third of the time at rest.
    share = share**3 * (10 - 15 * share + 6 * share**2)
    before = points[place.astype(int)]
    return middle + half * (before + share * (points[place.astype(int) + 1] - before))


def equations(machine: Machine) -> AbstractMechanical:
    """The machine itself."""
    model = build(ModelConfig(), Space.parse(machine.space), machine.inputs, known=machine.parts, key=jax.random.key(0))
    if not isinstance(model, AbstractMechanical):
        raise TypeError(f"A machine must be mechanical; got {type(model).__name__}.")
    return without_silent(model)


def simulate(machine: Machine, model: AbstractMechanical, generator: Generator) -> dict[str, np.ndarray]:
    """One recording, as its sensors log it."""
    interval = 1 / machine.rate
    solver = RK4(int(np.ceil(interval / SUBSTEP)))
    middle, spread = np.asarray(machine.start).T

    def step(state: jax.Array, sample: tuple[jax.Array, jax.Array]) -> tuple:
        t, told = sample
        q, v = model.decode(state)
        u = machine.command(q, v, told)
        return solver.step(model.derivative, state, t, t + interval, u, u), (q, u)

    q = jnp.asarray(middle + spread * generator.uniform(-1, 1, middle.shape))
    told = wanted(machine, generator)
    start = model.encode(q, jnp.zeros_like(q))
    ts = np.arange(len(told)) * interval
    _, (q, u) = jax.jit(lambda start: jax.lax.scan(step, start, (jnp.asarray(ts), jnp.asarray(told))))(start)
    q = np.asarray(q) + np.asarray(machine.noise) * generator.normal(size=q.shape)
    coarse = np.asarray(machine.steps)
    logged = np.where(coarse > 0, np.round(q / np.where(coarse > 0, coarse, 1)) * coarse, q)
    return {"t": ts[:, None], "q": logged, "u": np.asarray(u)}


def description(machine: Machine, size: int) -> str:
    """What TOML says of the logs."""
    return "\n".join(
        [
            f'space = "{machine.space}"',
            'time = "t1"',
            f"positions = {[f'q{k + 1}' for k in range(size)]}",
            f"inputs = {[f'u{k + 1}' for k in range(machine.inputs)]}",
            'hold = "zero"',
            *(f'[{part}]\nfiles = ["{part}/*.csv"]' for part in machine.recordings),
            "",
        ]
    )


def main() -> None:
    """Write logs and their description, and score the true equations."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("names", nargs="+", choices=MACHINES)
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--out", type=Path, required=True)
    given = arguments.parse_args()
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's signature
    for name in given.names:
        machine, folder = MACHINES[name], given.out / name
        model, generator = equations(machine), np.random.default_rng(given.seed)
        for part, count in machine.recordings.items():
            for k in range(count):
                write(folder / part / f"{k}.csv", simulate(machine, model, generator), digits=8)
        path = folder / "machine.toml"
        path.write_text(description(machine, model.space.size))
        dataset = read_dataset(path)
        solver = RK4(int(np.ceil(np.diff(dataset.test[0].ts).max() / SUBSTEP)))
        scores = score_recordings(model, dataset, solver=solver, splits=("test",))
        for each in scores:
            print(f"{name}, {each.name}: the truth, 1 s {each.window_rmse.median:.2e}, whole {each.rollout_rmse:.2e}")


if __name__ == "__main__":
    main()

"""What each command can be told. Nothing here imports JAX, so that `--help` is quick."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Final, Literal, TypeAlias

from tyro.conf import Positional, arg

SourceName: TypeAlias = Annotated[Positional[str], arg(metavar="SOURCE")]
OwnSource: TypeAlias = Annotated[
    Positional[str | None], arg(metavar="[SOURCE]", help_behavior_hint="(default: the run's)")
]
RunFolder: TypeAlias = Annotated[Positional[Path], arg(metavar="RUN")]
Figure: TypeAlias = Annotated[Path | None, arg(metavar="FILE.png", help_behavior_hint="(default: none)")]
ArrayFile: TypeAlias = Annotated[Path, arg(metavar="FILE.npz")]


@dataclass(frozen=True, kw_only=True)
class General:
    """How to report.

    Attributes:
        json: Print one JSON object as the last line of standard output.
        debug: Log what is done, and show the traceback of an error.
    """

    json: bool = False
    debug: bool = False


@dataclass(frozen=True, kw_only=True)
class Simulate:
    """Simulate a task's trajectories, accurate to 1e-9, into an NPZ file.

    The file holds `train_ts` (T,), `train_q` and `train_rates` (trajectory, T, coordinate), `train_us` (trajectory, T,
    input), the same of `test` and `prediction`; and `task`, `space`, `seed`, `momenta` (whether rates are momenta).

    Attributes:
        task: pendulum-canonical, pendulum, cartpole, acrobot, cartpole-full or acrobot-full.
        out: File to write.
        seed: Seed of the initial conditions.
        general: How to report.
    """

    task: Annotated[Positional[str], arg(metavar="TASK")]
    out: ArrayFile
    seed: int = 0
    general: General = field(default_factory=General)


@dataclass(frozen=True, kw_only=True)
class Train:
    """Train a model on a task or a data set.

    Attributes:
        source: A task (pendulum-canonical, pendulum, cartpole, acrobot, cartpole-full, acrobot-full) or the TOML file
            that describes a data set; a run that is continued has it.
        out: Folder of the run, absent or empty: config.json, model.safetensors, metrics.jsonl, checkpoints/.
        model: Kind of model: dissipative, unstructured, symoden, naive or geometric.
        preset: Settings: default (Adam, then Levenberg-Marquardt) or paper (its sizes and Adam).
        space: Configuration space instead of the source's own, such as "T1" for an angle that it calls a number.
        seed: Seed of a task's initial conditions, of the initial weights and of the batches.
        trajectories: Number of a task's training trajectories, chosen at random; more are simulated where needed.
        noise: Standard deviation of Gaussian noise on every coordinate and rate of a task's training trajectories.
        members: Also train this many models like it, from other initial weights on windows drawn with replacement: how
            they scatter makes the bands of `inspect`, `evaluate`, `predict` and `report`. At least 2, better 8; with
            --resume they are added to a run that has ended, or to those that it has.
        keep_disturbed: Train on everything, also on moments that something else than the inputs moves, such as a push.
        resume: Continue the run in the folder, with its settings.
        max_minutes: Stop after this time with the best model so far, or ten seconds later where a stage had to be
            compiled. What takes longer in one piece, as judging by windows left out in turn may, is left to the next
            run, which ends it first. Reading the data before and scores afterwards come on top; `--resume` has the
            time anew.
        general: How to report.
    """

    source: OwnSource = None
    out: Annotated[Path, arg(metavar="RUN")]
    model: Annotated[str | None, arg(metavar="KIND", help_behavior_hint="(default: dissipative)")] = None
    preset: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(default: default)")] = None
    space: Annotated[str | None, arg(metavar="S", help_behavior_hint="(default: the source's)")] = None
    seed: Annotated[int | None, arg(metavar="INT", help_behavior_hint="(default: 0)")] = None
    trajectories: Annotated[int | None, arg(metavar="N", help_behavior_hint="(default: the task's)")] = None
    noise: Annotated[float | None, arg(metavar="S", help_behavior_hint="(default: 0)")] = None
    members: Annotated[int | None, arg(metavar="N", help_behavior_hint="(default: 0)")] = None
    keep_disturbed: bool = False
    resume: bool = False
    max_minutes: Annotated[float | None, arg(metavar="M", help_behavior_hint="(default: no limit)")] = None
    general: General = field(default_factory=General)


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Score a model: the paper's errors on a task, position errors on the recordings of a data set.

    On a task: the sum of squared errors over each trajectory's samples and observed channels, mean and standard
    deviation over trajectories. On a data set: position RMSE over windows of 1 s started every 0.25 s (of less, where
    all recordings of a part are shorter), and of one rollout from the start of the whole recording, in rad and m.

    In JSON an error that is not finite is null. It is so where rollouts diverge: `diverged` counts them, beside the
    number of `windows` of a recording, for each part of a task. A recording that is too short has 0 windows.

    Attributes:
        run: Folder of the run.
        source: Another task or description than the run's own.
        bands: Also predict with 90 % bands, and say how many of a data set's measured positions they cover.
        figure: Picture of test recordings and rollouts along them, with their bands if asked for: PNG, PDF or SVG.
        general: How to report.
    """

    run: RunFolder
    source: OwnSource = None
    bands: bool = False
    figure: Figure = None
    general: General = field(default_factory=General)


@dataclass(frozen=True, kw_only=True)
class Predict:
    """Roll out a model along recordings, each from its first state under its inputs, into an NPZ file.

    For each recording the file holds PART:NAME/ts (T,) [s], PART:NAME/q, …/rates, …/u as recorded, and …/q_predicted,
    …/rates_predicted (T, n), such as test:swing#1/q_predicted; rates are velocities or momenta as in the data. PART is
    train, validation, test or, of a task, prediction. The first state is the measured one; where the data set
    has `initial_samples` above 1, or velocities are estimated and poor at the ends, it is found from the first samples
    with the model.

    With --bands the file also holds …/q_half_width (T, n), half of the 90 % band of q_predicted over its first second,
    and NaN after that: bands are judged over windows of a second, as `evaluate` has them. Such windows go along the
    whole recording in …/q_windows (T, n), rollouts one after the other, each from a measured state, and
    …/q_windows_half_width, half of their bands, as `report` draws them; NaN at the end, which no whole window reaches.

    Attributes:
        run: Folder of the run.
        source: A task or the description of a data set.
        out: File to write.
        bands: Also write 90 % bands; they need the data that the run was trained on.
        general: How to report.
    """

    run: RunFolder
    source: SourceName
    out: ArrayFile
    bands: bool = False
    general: General = field(default_factory=General)


@dataclass(frozen=True, kw_only=True)
class Inspect:
    """Show what a model learned and how certain it is: M, V, g and D over the data's range, and the power audit.

    Of a robot (`robot = "arm.urdf"` under [known]) --urdf writes a copy of its file with the identified masses, centres
    and moments of inertia, and with damping and dry friction where two numbers tell it; all else stays. What hangs on a
    body by fixed joints shares what was found of it. The inertia of drives, which a URDF has no place for, is printed,
    and named in a comment of the file.

    Attributes:
        run: Folder of the run.
        figure: Picture of M, V, g, D and friction with their bands: PNG, PDF or SVG.
        urdf: URDF file to write, with what was learned of the robot that the run was given.
        general: How to report.
    """

    run: RunFolder
    figure: Figure = None
    urdf: Annotated[Path | None, arg(metavar="FILE.urdf", help_behavior_hint="(default: none)")] = None
    general: General = field(default_factory=General)


@dataclass(frozen=True, kw_only=True)
class Report:
    """Write what is known of a run into one HTML page that needs no other file.

    What it predicts of recordings that it was not trained on, what it learned, each with bands; how certain that is;
    the power audit; how training went; settings and versions.

    Attributes:
        run: Folder of the run.
        out: Page to write.
        general: How to report.
    """

    run: RunFolder
    out: Annotated[Path, arg(metavar="FILE.html")]
    general: General = field(default_factory=General)


@dataclass(frozen=True, kw_only=True)
class Reproduce:
    """Train and score the paper's models on its tasks, and make its table and figures.

    Each finished cell (a task, a model, a preset, a seed) is kept: the same command goes on where it was interrupted,
    and another one extends it. The folder holds table.json, table.csv, table.md, table.tex, figures/ and cells/, each
    cell being a run that the other commands read.

    Attributes:
        out: Folder of the results.
        tasks: Tasks, each TASK or TASK:SPACE for another space than the task's own.
        models: Kinds of model; geometric is left out where a task observes momenta.
        preset: Settings: default, paper.
        seeds: Number of seeds: 0, 1, and so on.
        trajectories: Numbers of training trajectories to compare.
        noise: Standard deviations of the noise on training trajectories to compare.
        jobs: Number of cells to run at once.
        figures: Leave out the figures, which need matplotlib.
        page: Markdown page to write, with the table and the figures.
        general: How to report.
    """

    out: Annotated[Path, arg(metavar="DIR")]
    tasks: Annotated[tuple[str, ...], arg(metavar="TASK...")] = (
        "pendulum-canonical",
        "pendulum-canonical:T1",
        "pendulum",
        "cartpole",
        "acrobot",
    )
    models: Annotated[tuple[str, ...], arg(metavar="KIND...")] = (
        "dissipative",
        "symoden",
        "unstructured",
        "geometric",
        "naive",
    )
    preset: Annotated[tuple[str, ...], arg(metavar="NAME...")] = ("default",)
    seeds: Annotated[int, arg(metavar="N")] = 1
    trajectories: Annotated[tuple[int, ...], arg(metavar="N...", help_behavior_hint="(default: the task's)")] = ()
    noise: Annotated[tuple[float, ...], arg(metavar="S...", help_behavior_hint="(default: 0)")] = ()
    jobs: Annotated[int, arg(metavar="N")] = 1
    figures: Annotated[bool, arg(help_behavior_hint="(default: draw them)")] = True
    page: Annotated[Path | None, arg(metavar="FILE.md", help_behavior_hint="(default: none)")] = None
    general: General = field(default_factory=General)


@dataclass(frozen=True, kw_only=True)
class Data:
    """Check a data set: what was read, and what looks wrong, with what to do.

    It lists each recording (samples, steps of time, missing numbers, gaps) and each column (range, rounding, noise,
    cut-off, motion, position against velocity), and names stuck sensors, wrong units, signs and columns, jumps, and
    time stamps out of order. Its exit status is 0 if training takes the data, 2 if it refuses them or a file cannot be
    read.

    Attributes:
        source: The TOML file that describes the data set.
        figure: Picture to draw of all recordings, with the findings marked: PNG, PDF or SVG.
        space: Configuration space instead of the description's own.
        general: How to report.
    """

    source: Annotated[Positional[Path], arg(metavar="FILE.toml")]
    figure: Figure = None
    space: Annotated[str | None, arg(metavar="S", help_behavior_hint="(default: the description's)")] = None
    general: General = field(default_factory=General)


@dataclass(frozen=True, kw_only=True)
class Control:
    """Make a controller from a run's model, and try it on the true machine from random states.

    The controller knows the model alone. An episode succeeds if every coordinate stays within 0.05 rad or m of the
    target, and every velocity within 0.1, for its last 2 s. The machine's input is held for each control period.

    Of your own machine there is no simulation: with --target the controller is tried on the learned model, or on the
    models of the run's ensemble in turn (`symoden train … --members 8`), which differ where the data say little.

    Attributes:
        run: Folder of the run.
        env: Machine: symoden/DampedPendulum-v0, symoden/DampedCartPole-v0, symoden/DampedAcrobot-v0,
            symoden/FullyActuatedCartPole-v0 or symoden/FullyActuatedAcrobot-v0; or model, the learned one.
        target: Where to go, a number for each coordinate [rad or m], or - where it need not come to rest anywhere, as a
            reaction wheel; of a simulated machine it is upright.
        method: How: energy-shaping, energy-shaping+lqr, ida-pbc, controlled-lagrangian, swing-up, tracking or lqr.
        max_input: Largest magnitude of every input, or of each [N or N m].
        noise: Standard deviation of the noise on every measured coordinate and velocity; an extended Kalman filter on
            the model then stands before the controller.
        period: Control period [s].
        delay: Time from a measurement to its input [s]; the filter then looks ahead. The run's data set tells it by
            input_delay and position_delay.
        lag: Time constant of the lag by which what acts follows every input, or each [s]; the filter then looks ahead.
        duration: Length of an episode [s].
        episodes: Number of episodes.
        seed: Seed of initial states and noise.
        out: File to write the controller to, which Python reads with symoden.control.load_controller.
        figure: Picture of angles, inputs and desired energy: PNG, PDF or SVG.
        video: Animation of the episode of median settling time, of a simulated machine.
        general: How to report.
    """

    run: RunFolder
    env: Annotated[str | None, arg(metavar="ID", help_behavior_hint="(default: the run's task, or its model)")] = None
    target: Annotated[
        tuple[float | Literal["-"], ...],
        arg(metavar="Q [Q ...]", help_behavior_hint="(default: upright; of the learned model it must be given)"),
    ] = ()
    method: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(default: what suits the system)")] = None
    max_input: Annotated[
        tuple[float, ...],
        arg(metavar="U [U ...]", help_behavior_hint="(default: the machine's, or the largest in the logs)"),
    ] = ()
    noise: Annotated[float, arg(metavar="S")] = 0.0
    period: Annotated[float, arg(metavar="T")] = 0.005
    delay: Annotated[float | None, arg(metavar="T", help_behavior_hint="(default: what the data set tells)")] = None
    lag: Annotated[
        tuple[float, ...], arg(metavar="T [T ...]", help_behavior_hint="(default: the data set's input_lag)")
    ] = ()
    duration: Annotated[float, arg(metavar="T")] = 15.0
    episodes: Annotated[int, arg(metavar="N")] = 100
    seed: int = 0
    out: Annotated[Path | None, arg(metavar="FILE.safetensors", help_behavior_hint="(default: none)")] = None
    figure: Figure = None
    video: Annotated[Path | None, arg(metavar="FILE.gif", help_behavior_hint="(default: none)")] = None
    general: General = field(default_factory=General)


COMMANDS: Final[Mapping[str, type]] = MappingProxyType(
    {
        "simulate": Simulate,
        "train": Train,
        "evaluate": Evaluate,
        "predict": Predict,
        "inspect": Inspect,
        "report": Report,
        "control": Control,
        "reproduce": Reproduce,
        "data": Data,
    }
)
DATA_COMMANDS: Final[Mapping[str, type]] = MappingProxyType({"check": Data})
"""What `symoden data` can be told to do."""
Command: TypeAlias = Simulate | Train | Evaluate | Predict | Inspect | Report | Control | Reproduce | Data

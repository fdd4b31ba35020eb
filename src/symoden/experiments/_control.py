"""Try a controller made from a run's model: on which machine, from which states, and how the episodes went."""

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from symoden.control import (
    MOST_PERIODS,
    AbstractController,
    Compiled,
    Episode,
    IdaPbc,
    Loop,
    LyapunovAudit,
    Matching,
    Method,
    Observer,
    Stuck,
    Tell,
    Tolerance,
    Tracking,
    Verdict,
    audit_energies,
    choose_method,
    design,
    desired_energies,
    find_stuck,
    input_limits,
    judge,
    rates_of,
    run_in_turn,
    silent,
)
from symoden.evaluation import Ranges
from symoden.mechanics import AbstractDynamics
from symoden.spaces import Space
from symoden.systems import MACHINES, Machine, Pendulum
from symoden.wording import LEARNED

from ._starts import Starts, starts_of

_FINE_STEP: Final = 0.001  # [s]: learned dry friction is stiff.
_FAR: Final = 10.0  # Of the range of the data.
_CALLS: Final = 2000
_LEAST_NOISE: Final = 1e-3
_WARM: Final = 50
_TASK_MACHINES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "pendulum": "symoden/DampedPendulum-v0",
        "cartpole": "symoden/DampedCartPole-v0",
        "acrobot": "symoden/DampedAcrobot-v0",
        "cartpole-full": "symoden/FullyActuatedCartPole-v0",
        "acrobot-full": "symoden/FullyActuatedAcrobot-v0",
    }
)
_HANGING: Final = Machine(  # Task 1, whose data are momenta and whose angle is told to be a number.
    name="pendulum-canonical",
    system=Pendulum(gravity=10.0, damping=0.1, momenta=True),
    target=(np.pi,),
    max_input=(15.0,),
)


@dataclass(frozen=True, kw_only=True)
class ControlConfig:
    """What is tried.

    Attributes:
        method: How the controller is made; `choose_method` decides if None.
        max_input: Largest magnitude of every input, or of each; the machine's own if None.
        loop: How the controller is connected; its regulators are optimal for this period.
        episodes: Number of episodes.
        seed: Seed of the initial states and of the noise.
    """

    method: Method | None = None
    max_input: float | tuple[float, ...] | None = None
    loop: Loop = field(default_factory=lambda: Loop(duration=15.0))
    episodes: int = 100
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse numbers out of range.

        Raises:
            ValueError: If there is no episode, the seed is negative, the largest input is not positive, episodes are
                too short to be judged, or all together are too long.
        """
        Tolerance().check_duration(self.loop.duration)
        if self.episodes < 1 or self.seed < 0:
            raise ValueError(f"Episodes must be at least 1 and the seed 0; got {self.episodes} and {self.seed}.")
        if self.episodes * self.loop.samples > MOST_PERIODS:
            raise ValueError(
                f"All episodes together must have at most {MOST_PERIODS} control periods; got {self.episodes} of "
                f"{self.loop.samples}."
            )
        if self.max_input is not None and not np.all(np.asarray(self.max_input) > 0):
            raise ValueError(f"The largest input must be positive; got {self.max_input}.")


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlResult:
    """How it went.

    Attributes:
        machine: What was controlled.
        method: How the controller was made.
        controller: The controller.
        limits: Largest magnitude of each input.
        plants: What moved: the machine's system, or those that stood in for it, each in a block of the episodes.
        starts: Where episodes begin.
        episodes: Records of the true states.
        energy: Desired energy along each record.
        verdict: How each episode ended.
        audit: Where the desired energy falls.
        stuck: What friction holds beside the target; nothing where a reference is followed.
        matching: How well the matching conditions hold, for IDA-PBC.
        controller_ms: Median time of a call of the compiled controller for one state [ms].
        design_s: Time it took to make it [s].
    """

    machine: Machine
    method: Method
    controller: AbstractController
    limits: tuple[float, ...]
    plants: tuple[AbstractDynamics, ...]
    starts: Starts
    episodes: Episode
    energy: Float[np.ndarray, "k T"]
    verdict: Verdict
    audit: LyapunovAudit
    stuck: Stuck | None
    matching: Matching | None
    controller_ms: float
    design_s: float

    @property
    def tried_on(self) -> str:
        """What the controller was tried on, in words."""
        if not self.machine.learned:
            return self.machine.name
        others = [plant for plant in self.plants if plant is not self.machine.system]
        return f"{len(others)} of the ensemble's models" if others else "the learned model"

    @property
    def settling(self) -> float:
        """Median settling time of the successful episodes [s]; NaN without any."""
        times = self.verdict.settling[self.verdict.success]
        return float(np.median(times)) if times.size else float("nan")

    @property
    def shown(self) -> int:
        """Episode that is shown: the successful one of median settling time, the first one without any."""
        good = np.flatnonzero(self.verdict.success)
        if not good.size:
            return 0
        return int(good[np.argsort(self.verdict.settling[good])[len(good) // 2]])


def machine_of(source: str, env: str | None, *, space: str | None = None) -> Machine:
    """Machine to control.

    Args:
        source: Source of the run's data.
        env: Identity of an environment; the run's own task if None.
        space: The run's configuration space, of which the refusal gives an example of where to go.

    Returns:
        The machine.

    Raises:
        ValueError: If there is no such environment, or the run's data do not say which.
    """
    if env is not None:
        if env not in MACHINES:
            raise ValueError(f"An environment must be one of {', '.join(MACHINES)}; got {env!r}.")
        return MACHINES[env]
    if source in _TASK_MACHINES:
        return MACHINES[_TASK_MACHINES[source]]
    if source == _HANGING.name:
        return _HANGING
    angles = () if space is None else Space.parse(space).is_angle
    example = " ".join(["--target", *("3.14" if angle else "0" for angle in angles)])
    raise ValueError(
        f"The run was trained on `{source}`, and there is no simulation of that machine. Name where to go, and the "
        f"controller is tried on the learned model itself: `{example}` [rad, m], a number for each coordinate; or name "
        f"a simulated machine by `--env` if the logs are of one: {', '.join(MACHINES)}."
    )


def learned_machine(model: AbstractDynamics, target: Sequence[float], ranges: Ranges) -> Machine:
    """A learned model in place of its machine.

    Args:
        model: The model.
        target: Where to go; NaN along coordinates that need not come to rest anywhere.
        ranges: Ranges of its training data; the inputs' largest magnitudes there limit them, and episodes begin within.

    Returns:
        The machine.

    Raises:
        ValueError: If the target is no configuration, lies far outside the data or more than a turn away, or the model
            has no inputs.
    """
    if len(target) != model.space.size or np.isinf(target).any():
        raise ValueError(
            f"The target must be one finite number for each of the {model.space.size} coordinates of {model.space}, or "
            f"- where one is free; got {', '.join('-' if np.isnan(place) else str(place) for place in target)}."
        )
    for i, (angle, value, bounds) in enumerate(zip(model.space.is_angle, target, ranges.positions, strict=True)):
        if not np.isnan(value):
            _check_target(i + 1, value, bounds, angle=angle)
    limits = tuple(max(abs(low), abs(high)) for low, high in ranges.inputs)
    if not limits:
        raise ValueError("A controller needs inputs; the model was learned from free motion and has none.")
    seen = tuple((-math.inf, math.inf) if i in ranges.cyclic else each for i, each in enumerate(ranges.positions))
    return Machine(name=LEARNED, system=model, target=tuple(map(float, target)), max_input=limits, seen=seen)


def _check_target(coordinate: int, value: float, bounds: tuple[float, float], *, angle: bool) -> None:
    """Refuse where no model can know anything, which is what a mistaken unit asks for."""
    low, high = bounds
    away = max(low - value, value - high)
    if angle and min(abs(value), away) > 2 * np.pi:
        raise ValueError(
            f"The target of an angle must be within a turn of zero or of the training data; coordinate {coordinate} "
            f"got {value:g} rad, which is {abs(value) / (2 * np.pi):.3g} turns. If degrees were meant, write "
            f"{np.radians(value):.5g}."
        )
    if not angle and away > _FAR * max(high - low, Tolerance().position):
        raise ValueError(
            f"The target must be near the training data; coordinate {coordinate} got {value:g}, far outside "
            f"[{low:.4g}, {high:.4g}]. Give it in the unit that `units` brings the data to, as a rule m or rad."
        )


def try_control(
    model: AbstractDynamics,
    machine: Machine,
    config: ControlConfig,
    *,
    plants: Sequence[AbstractDynamics] = (),
    tell: Tell = silent,
) -> ControlResult:
    """Make a controller from a model and try it on a machine.

    Args:
        model: Learned model, or the true system for comparison; the controller knows nothing else.
        machine: What is controlled.
        config: What is tried.
        plants: Systems that stand in for the machine in turn, such as the models that the data do not tell apart; the
            machine's own if there are none.
        tell: Called with what is being done.

    Returns:
        How it went.

    Raises:
        ValueError: If the model is of another kind of mechanism than the machine, or the method does not suit it.
    """
    system = machine.system
    if (str(model.space), model.inputs) != (str(system.space), system.inputs):
        raise ValueError(
            f"The model has the space {model.space} and {model.inputs} inputs; {machine.name} has {system.space} and "
            f"{system.inputs}. Choose the environment of the mechanism that the model was trained on."
        )
    loop = config.loop
    if machine.learned:
        loop = dataclasses.replace(loop, step=min(loop.step, _FINE_STEP))
    limits = machine.max_input
    if config.max_input is not None:
        limits = tuple(input_limits(config.max_input, system.inputs).tolist())
    if not min(limits) > 0:
        raise ValueError(
            f"An input did nothing in the logs, whose largest are {limits}. Say what it may: `--max-input`."
        )
    method = config.method or choose_method(model, machine.target, limits=limits)
    start = time.perf_counter()
    controller = design(model, machine.target, method=method, limits=limits, period=loop.period, tell=tell)
    design_s = time.perf_counter() - start
    starts = starts_of(machine, method)
    q0, v0 = starts.draw(config.episodes, config.seed)
    tell(f"{config.episodes} episodes of {loop.duration:g} s")
    observer = Observer(model, max(loop.noise, _LEAST_NOISE)) if loop.noise or loop.is_late else None
    every = (plants or (system,))[: config.episodes]
    if len(every) < len(plants):
        tell(f"so few episodes are on {len(every)} of the {len(plants)} models")
    tried = run_in_turn(every, controller, q0, v0, loop, observer=observer, seed=config.seed)
    episodes = jax.tree.map(lambda *each: jnp.concatenate(each), *(records for _, records in tried))
    return ControlResult(
        machine=machine,
        method=method,
        controller=controller,
        limits=limits,
        plants=tuple(every),
        starts=starts,
        episodes=episodes,
        energy=desired_energies(controller, episodes),
        verdict=_judged(controller, episodes, machine),
        audit=audit_energies(tried, controller),
        stuck=None if isinstance(controller, Tracking) else _stuck(tried, machine),
        matching=controller.matching() if isinstance(controller, IdaPbc) else None,
        controller_ms=_call_ms(controller, q0[0], v0[0]),
        design_s=design_s,
    )


def _judged(controller: AbstractController, episodes: Episode, machine: Machine) -> Verdict:
    """Distance from the target, or from the reference."""
    if not isinstance(controller, Tracking):
        return judge(episodes, machine.system.space, np.asarray(machine.target))
    q, v, _ = jax.vmap(controller.wanted)(episodes.ts[0])
    return judge(episodes, machine.system.space, np.asarray(q), velocities=np.asarray(v))


def _stuck(tried: Sequence[tuple[AbstractDynamics, Episode]], machine: Machine) -> Stuck:
    """What friction holds in the episodes of all plants."""
    found = [find_stuck(plant, records, np.asarray(machine.target)) for plant, records in tried]
    return Stuck(*map(np.concatenate, zip(*found, strict=True)))


def _call_ms(controller: AbstractController, q: Float[np.ndarray, " n"], v: Float[np.ndarray, " n"]) -> float:
    """Median time of a call [ms]."""
    call = Compiled(controller)
    times = []
    for _ in range(_WARM + _CALLS):
        start = time.perf_counter()
        call(q, v)
        times.append(time.perf_counter() - start)
    return 1e3 * float(np.median(times[_WARM:]))


def outside_data(result: ControlResult, ranges: Ranges) -> float:
    """Share of the visited states that lie outside the ranges of the training data, where a model must extrapolate.

    Args:
        result: How the episodes went.
        ranges: Ranges of the training data.

    Returns:
        The share; inputs do not count.
    """
    space = result.machine.system.space
    q, rates = (np.asarray(part).reshape(-1, space.size) for part in result.episodes[1:3])
    system = result.machine.system
    rates = np.asarray(jax.vmap(lambda q, v: rates_of(system, q, v))(jnp.asarray(q), jnp.asarray(rates)))
    return float(ranges.outside(q, rates, None, space).mean())

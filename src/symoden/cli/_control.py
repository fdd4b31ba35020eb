"""`symoden control`."""

import contextlib
import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, cast

import jax.numpy as jnp
import numpy as np

from symoden.blocks import without_silent
from symoden.control import Loop, Method, Tolerance, has_height, indifferent, input_limits, save_controller
from symoden.experiments import (
    ControlConfig,
    ControlResult,
    DataSummary,
    RunConfig,
    learned_machine,
    machine_of,
    outside_data,
    read_ensemble,
    read_model,
    read_run,
    try_control,
)
from symoden.mechanics import AbstractDynamics, AbstractPortHamiltonian
from symoden.storage import write_atomically
from symoden.systems import Machine
from symoden.training import POSTERIOR, AbstractPosterior
from symoden.units import titled
from symoden.wording import LEARNED, number

from ._arguments import Control
from ._figure import save_figure
from ._learned import name_untold_inputs, own_source, posterior_of
from ._output import print_json, print_table
from ._words import name_unfinished

_TIMES: Final = 4  # As far as the tolerance is what tells nothing.
_OUTSIDE: Final = 0.05  # Of the range of the data.
_MOSTLY: Final = 0.5  # Of the visited states.
_SLOWER: Final = 2.0  # Times the control period that rows are apart.


def run(command: Control) -> None:
    """Make the controller, try it, and say how it went.

    Args:
        command: What to do, checked by `check_control`.
    """
    config = read_run(command.run)
    name_unfinished(config)
    settings = ControlConfig(
        method=cast("Method | None", command.method),
        max_input=command.max_input or None,
        loop=Loop(
            duration=command.duration,
            period=command.period,
            noise=command.noise,
            delay=config.data.delay if command.delay is None else command.delay,
            lag=command.lag or config.data.lag,
        ),
        episodes=command.episodes,
        seed=command.seed,
    )
    input_limits(settings.max_input, len(config.data.input_names))
    settings.loop.lag_of(len(config.data.input_names))
    model, plants = read_model(command.run), ()
    if command.target or command.env == LEARNED:
        machine, plants = _learned(command, config, model)
    else:
        machine = machine_of(config.source, command.env, space=config.data.space)
    result = try_control(without_silent(model), machine, settings, plants=plants, tell=_tell)
    if command.out is not None:
        save_controller(command.out, result.controller)
    outside = outside_data(result, config.data.ranges)
    if command.figure is not None:
        _draw(result, config, command.figure)
    if command.video is not None:
        _film(result, command.video)
    if command.general.json:
        print_json(_as_json(result, settings, outside, command))
    else:
        _print(result, settings, outside, config)
        for what, path in (("controller", command.out), ("figure", command.figure), ("animation", command.video)):
            if path is not None:
                print(f"{what}: {path}")


def _learned(
    command: Control, config: RunConfig, model: AbstractDynamics
) -> tuple[Machine, tuple[AbstractDynamics, ...]]:
    """The model in place of its machine, and the others of its ensemble, to be tried on."""
    ensemble = read_ensemble(command.run, model, config)
    plants = () if ensemble is None else tuple(map(without_silent, ensemble.models()))
    target = [math.nan if place == "-" else place for place in command.target]
    machine, data = learned_machine(without_silent(model), target, config.data.ranges), config.data
    for i, name in enumerate(data.position_names):
        if math.isnan(target[i]):
            continue
        (low, high), angle = data.ranges.positions[i], model.space.is_angle[i]
        near = "" if angle else hardly_moves(name, high - low)
        # Elsewhere along what nothing depends on all is as it was in training.
        far = "" if i in data.ranges.cyclic else beyond_data(name, machine.target[i], (low, high), angle=angle)
        for said in filter(None, (near, far)):
            print(f"warning: {said}", file=sys.stderr)
    _name_untold_inputs(command.run, model, config, ensemble)
    return machine, plants


def _name_untold_inputs(
    run: Path, model: AbstractDynamics, config: RunConfig, ensemble: AbstractPosterior | None
) -> None:
    """Say which inputs do nothing that the data tell, where another command has found out how certain the model is."""
    posterior = ensemble
    if posterior is None and (run / POSTERIOR).is_file():
        with contextlib.suppress(ValueError, OSError):  # The data may be elsewhere by now.
            posterior = posterior_of(run, model, config, own_source(config).dataset)
    if posterior is not None:
        name_untold_inputs(run, model, config, posterior)


def hardly_moves(name: str, way: float) -> str:
    """What to say of a length that hardly goes as far as what counts as being at the target.

    Args:
        name: Its name.
        way: How far it goes in the training data.

    Returns:
        The words; none where it goes farther.
    """
    near = Tolerance().position
    if way >= _TIMES * near:
        return ""
    return (
        f"`{name}` goes {number(way)} in the training data, where {near:g} from the target counts as being there: "
        "successes mean little. Give it in a smaller unit, as a factor under `units`, and train anew."
    )


def beyond_data(name: str, value: float, bounds: tuple[float, float], *, angle: bool) -> str:
    """What to say of a coordinate's target that lies well outside the training data.

    Args:
        name: Name of the coordinate.
        value: Its target.
        bounds: Its least and largest value in the training data.
        angle: Whether it is an angle, of which turns do not matter.

    Returns:
        The words; none where it lies within the data, or hardly outside.
    """
    low, high = bounds
    above, below = value - high, low - value
    if angle:  # Whichever way round is shorter.
        above = (value - low) % (2 * math.pi) - (high - low)
        below = 2 * math.pi - (value - low) % (2 * math.pi)
    away = min(above, below) if angle else max(above, below)
    if away <= max(_OUTSIDE * (high - low), Tolerance().position):
        return ""
    return (
        f"the target {number(value)} of `{name}` is {number(away)} outside its training data, {number(low)} to "
        f"{number(high)}: there the model is a guess."
    )


def _tell(text: str) -> None:
    """Say on standard error what is being done."""
    print(text, file=sys.stderr, flush=True)


def _coordinates(result: ControlResult, config: RunConfig) -> list[tuple[str, str]]:
    """Name and unit of each coordinate."""
    data, machine = config.data, result.machine
    units = data.position_units if machine.learned else machine.system.space.units
    return list(zip(data.position_names, units, strict=True))


def _print(result: ControlResult, settings: ControlConfig, outside: float, config: RunConfig) -> None:
    """How it went, in words."""
    verdict, audit, loop = result.verdict, result.audit, settings.loop
    limits = ", ".join(number(limit) for limit in result.limits)
    print(f"{result.method} on {result.tried_on}, inputs up to {limits}, every {1e3 * loop.period:g} ms{_late(loop)}")
    print(f"episodes begin with {', '.join(_start_words(result, _coordinates(result, config)))}")
    rows = [
        ["successes", f"{int(verdict.success.sum())} of {len(verdict.success)}"],
        ["median settling time [s]", result.settling],
        ["largest position error at the end, median", float(np.median(verdict.position_error))],
        ["largest speed at the end, median", float(np.median(verdict.velocity_error))],
        ["largest input", float(np.nanmax(np.abs(np.asarray(result.episodes.u))))],
        ["one call of the controller [ms]", result.controller_ms],
        ["making the controller [s]", result.design_s],
        ["desired energy falls under continuous control at, of visited states", f"{audit.share:.1%}"],
        ["visited states outside the data", f"{outside:.1%}"],
    ]
    print_table("closed loop", ("quantity", "value"), rows)
    if result.matching is not None:
        matching = result.matching
        where, then = (", ".join(number(x) for x in part) for part in (matching.rest_q, matching.moving_q))
        rows = [
            ["at rest", f"{matching.rest:.2g}", f"({where})"],
            ["at the natural speed", f"{matching.moving:.2g}", f"({then})"],
        ]
        print_table("forces that no input matches, relative to the largest load", ("", "largest", "at q"), rows)
    pace = pace_words(loop, config.data) if result.machine.learned else ()
    for line in (*pace, *_stuck_words(result), *_other_methods(result), *_outside_words(result, outside)):
        print(line)
    if audit.share < 1:
        q, v = (", ".join(number(x) for x in part) for part in (audit.worst_q, audit.worst_v))
        print(f"the desired energy rises fastest at q = ({q}), v = ({v})")


def _late(loop: Loop) -> str:
    """How late inputs act, in words."""
    delay = f", {1e3 * loop.delay:.3g} ms late" if loop.delay else ""
    lag = ", ".join(f"{1e3 * each:.3g}" for each in loop.lag) if any(loop.lag) else ""
    return delay + (f", with a lag of {lag} ms" if lag else "")


def pace_words(loop: Loop, data: DataSummary) -> Iterator[str]:
    """Offer the pace at which inputs changed in the data, where the controller is much faster.

    Args:
        loop: The loop that it was tried in.
        data: What the run keeps of its data.

    Yields:
        The offer, if there is one.
    """
    if data.hold == "zero" and data.step > _SLOWER * loop.period:
        yield (
            f"inputs of the data are held for {1e3 * data.step:.3g} ms: `--period {data.step:.3g}` tries the "
            "controller at their pace."
        )


def _start_words(result: ControlResult, coordinates: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Where episodes begin, and how fast, one coordinate after the other."""
    for (name, unit), angle, middle, way, speed in zip(
        coordinates, result.machine.system.space.is_angle, *result.starts, strict=True
    ):
        near = f"within {_measured(way, unit)} of {number(middle)}"
        yield f"`{name}` {'anywhere' if angle and way >= math.pi else near} at up to {_measured(speed, unit, '/s')}"


def _measured(value: float, unit: str, per: str = "") -> str:
    """A number with its unit, where that is known."""
    return f"{number(value)} {unit}{per}" if unit else number(value)


def _stuck_words(result: ControlResult) -> Iterator[str]:
    """What friction holds beside the target, if anything, and what helps."""
    if result.stuck is None or not result.stuck.held.any():
        return
    held = result.stuck.held
    distance, push, friction = (number(float(np.median(part[held]))) for part in result.stuck[1:])
    yield (
        f"friction holds {held.sum()} of {len(held)} episodes beside the target, in the median {distance} away: there "
        f"{push} of input pushes, and moving takes {friction}. More `--max-input` or a shorter `--period` allows "
        "larger gains."
    )


def _other_methods(result: ControlResult) -> Iterator[str]:
    """What may do better where not all episodes come to the target."""
    missed, system, target = int((~result.verdict.success).sum()), result.machine.system, result.machine.target
    if not missed or not isinstance(system, AbstractPortHamiltonian):
        return
    left = f"{result.method} leaves {missed} of {len(result.verdict.success)} episodes beside the target; "
    if result.method in {"energy-shaping", "energy-shaping+lqr"}:
        others = ("energy-shaping+lqr",) if result.method == "energy-shaping" else ()
        others += ("swing-up",) if has_height(system, target, limits=result.limits) else ()
        if others:
            yield f"{left}{' or '.join(f'`--method {each}`' for each in others)} may not."
    if result.machine.learned and result.method in {"swing-up", "lqr"} and not np.isnan(target).any():
        free = indifferent(system, jnp.asarray(target))
        if free.any() and not free.all():
            places = " ".join("-" if may else number(place) for may, place in zip(free, target, strict=True))
            yield f"{left}if what nothing depends on need not come to rest anywhere, `--target {places}` may not."


def _outside_words(result: ControlResult, outside: float) -> Iterator[str]:
    """That what was tried, and failed, says little where hardly any data are."""
    if outside > _MOSTLY and not result.verdict.success.all():
        yield (
            f"{outside:.0%} of the visited states lie outside of the data, where the model is a guess: what fails "
            "there tells little. Record motion there, or choose a target within."
        )


def _as_json(result: ControlResult, settings: ControlConfig, outside: float, command: Control) -> dict[str, object]:
    """The object of the command line's contract."""
    verdict, audit, loop = result.verdict, result.audit, settings.loop
    return {
        "env": result.machine.name,
        "method": result.method,
        "episodes": len(verdict.success),
        "successes": int(verdict.success.sum()),
        "median_settling_s": None if math.isnan(result.settling) else result.settling,
        "controller_ms": result.controller_ms,
        "design_s": result.design_s,
        "max_input": list(result.limits),
        "largest_input": float(np.nanmax(np.abs(np.asarray(result.episodes.u)))),
        "noise": loop.noise,
        "period_s": loop.period,
        "delay_s": loop.delay,
        "lag_s": list(loop.lag),
        "target": [None if math.isnan(place) else place for place in result.machine.target],
        "models": len(result.plants),
        "duration_s": loop.duration,
        "seed": settings.seed,
        "position_error": float(np.median(verdict.position_error)),
        "velocity_error": float(np.median(verdict.velocity_error)),
        "outside_data": outside,
        "lyapunov": {
            "share": audit.share,
            "worst": audit.worst,
            "worst_q": audit.worst_q,
            "worst_v": audit.worst_v,
            "saturated": audit.saturated,
        },
        "starts": {key: part.tolist() for key, part in result.starts._asdict().items()},
        "held_by_friction": 0 if result.stuck is None else int(result.stuck.held.sum()),
        "matching": None if result.matching is None else result.matching._asdict(),
        "out": None if command.out is None else str(command.out),
        "figure": None if command.figure is None else str(command.figure),
        "video": None if command.video is None else str(command.video),
    }


def _draw(result: ControlResult, config: RunConfig, path: Path) -> None:
    """Draw the episodes into a file."""
    from symoden.report import draw_control

    positions = [titled(*each) for each in _coordinates(result, config)]
    figure = draw_control(result, positions=positions, inputs=config.data.input_names)
    save_figure(figure, path)


def _film(result: ControlResult, path: Path) -> None:
    """Write the animation."""
    from symoden.report import film

    write_atomically(path, film(result))

"""`symoden train`."""

import dataclasses
import sys
from collections.abc import Collection, Mapping
from typing import Final

from symoden.blocks import count_active, count_parameters
from symoden.evaluation import identified_parameters
from symoden.experiments import (
    RunConfig,
    Source,
    absolute_name,
    evaluation_solver,
    holds_run,
    preset,
    read_run,
    read_run_source,
    read_source,
    refuse_occupied,
    summarize,
    train_run,
    undisturbed,
)
from symoden.models import KINDS
from symoden.spaces import Space
from symoden.training import FEWEST_MEMBERS, FitResult

from ._arguments import Train
from ._other_hold import name_other_hold
from ._output import print_json
from ._progress import show_progress
from ._scores import report_scores
from ._words import ensemble_words, hardly_judged, size_words

_POOR: Final = 0.3  # Loss relative to the motion from which it is worth a word.
_MANY: Final = 5  # Angles: products of so many harmonics are thousands of numbers.
_VANISHED: Final = 0.02  # Of a start value, which may be several times off.
_GOOD: Final = 0.25  # Share of the motion that predictions over a second are off by, whatever a few windows say.


def run(command: Train) -> None:
    """Train a model, and score it.

    Args:
        command: What to do.

    Raises:
        ValueError: If a setting is out of range.
    """
    if command.max_minutes is not None and not command.max_minutes > 0:
        raise ValueError(f"`--max-minutes` must be positive; got {command.max_minutes}.")
    resume = command.resume and holds_run(command.out)
    if not resume:
        refuse_occupied(command.out)
    config, source = _continued(command) if resume else _new(command)
    if command.resume and not resume:
        print(f"{command.out} holds no run yet: starting it", file=sys.stderr)
    print(_headline(config, source, command), file=sys.stderr, flush=True)
    known = source.dataset.known
    _name_many_joints(config.model.kind, source.dataset.space, () if known is None else known.given)
    with show_progress() as progress:
        result = train_run(
            command.out,
            config,
            source.dataset,
            resume=resume,
            max_minutes=command.max_minutes,
            progress=progress,
        )
    trained = read_run(command.out)
    scores = report_scores(result.model, trained, source, json=command.general.json)
    if source.task is None and not scores.warning:
        name_other_hold(result.model, undisturbed(trained, source.dataset), evaluation_solver(trained))
    if known is not None:
        _name_vanished(known.parameters, identified_parameters(result.model))
    doubtful = result.completed and config.training.scaled_loss and result.loss > _POOR
    if doubtful and not scores.warning and not scores.share < _GOOD:
        print(
            f"warning: a loss of {result.loss:.2g} is much of the motion: one of 1 predicts nothing. Unless noise "
            "is as large, look for a wrong unit, sign or space, or for an input that is not in the log (`data check`).",
            file=sys.stderr,
        )
    if command.general.json:
        print_json(_as_json(command, result) | scores.values)
    else:
        model = result.model
        size = size_words(count_parameters(model), count_active(model))
        more = "" if result.completed else " (--resume goes on)"
        print(f"{result.outcome}{more}, after {result.seconds:.0f} s; parameters: {size}")
        if result.ensemble is not None:
            words = ensemble_words(len(result.ensemble.members), result.ensemble.tried)
            enough = len(result.ensemble.members) >= FEWEST_MEMBERS
            print(f"{words}; {'how they scatter makes the bands' if enough else 'too few for bands'}")
        if words := hardly_judged(result.hardly_judged):
            print(words)
        print(f"the run is in {command.out}")


def _name_vanished(starts: Mapping[str, float], found: Mapping[str, float]) -> None:
    """Say which parameters of formulas ran to zero, where a wrong sign of their start keeps them."""
    gone = {name: start for name, start in starts.items() if abs(found.get(name, start)) < _VANISHED * abs(start)}
    if gone:
        names = ", ".join(f"`{name}` ({found[name]:.2g} from {start:.2g})" for name, start in gone.items())
        print(
            f"warning: parameters keep the signs of their starts, and these went to zero: {names}. Where the other "
            "sign is possible, start at 0, which allows both; where not, the data have nothing of it.",
            file=sys.stderr,
        )


def _new(command: Train) -> tuple[RunConfig, Source]:
    """Settings of a new run, and its data."""
    seed = command.seed or 0
    kind = command.model or "dissipative"
    if kind not in KINDS:
        raise ValueError(f"`--model` must be one of {', '.join(KINDS)}; got {kind!r}.")
    if seed < 0:
        raise ValueError(f"`--seed` must be at least 0; got {seed}.")
    if command.source is None:
        raise ValueError(f"SOURCE must name a task or a description; `{command.out}` holds no run to go on with.")
    name = command.preset or "default"
    source_name = absolute_name(command.source)
    task = source_name if source_name == command.source else None
    model, training = preset(name, task=task, kind=kind)
    noise = command.noise or 0.0
    source = read_source(command.source, seed=seed, space=command.space, trajectories=command.trajectories, noise=noise)
    if not source.dataset.train:
        raise ValueError(f"`{source.name}` must have recordings to train on; it has none. Give [train] files.")
    config = RunConfig(
        source=source.name,
        seed=seed,
        space=command.space,
        preset=name,
        trajectories=command.trajectories,
        noise=noise,
        members=command.members or 0,
        model=model,
        training=dataclasses.replace(training, seed=seed, left_out=() if command.keep_disturbed else training.left_out),
        data=summarize(source.dataset),
    )
    return config, source


def _continued(command: Train) -> tuple[RunConfig, Source]:
    """Settings of the run to continue, and its data, which must be the same as before."""
    config = read_run(command.out)
    asked = {
        "SOURCE": (command.source and absolute_name(command.source), config.source),
        "--model": (command.model, config.model.kind),
        "--preset": (command.preset, config.preset),
        "--space": (command.space, config.space),
        "--seed": (command.seed, config.seed),
        "--trajectories": (command.trajectories, config.trajectories),
        "--noise": (command.noise, config.noise),
        "--keep-disturbed": (command.keep_disturbed or None, config.training.left_out == ()),
    }
    for option, (given, saved) in asked.items():
        if given is not None and given != saved:
            raise ValueError(
                f"`{option}` must be that of the run in `{command.out}` to continue it, {saved!r}; got {given!r}. "
                "Leave it out, or start another run."
            )
    if command.members is not None:
        config = dataclasses.replace(config, members=command.members)
    source = read_run_source(config)
    if source.task is None and source.dataset.digest != config.data.digest:
        raise ValueError(
            f"`{source.name}`: the data must be those that the run in `{command.out}` began with; they have changed. "
            "Restore them, or start another run."
        )
    told = dataclasses.replace(config.data, position_units=source.dataset.position_units)  # The same numbers, named.
    return dataclasses.replace(config, data=told), source


def _name_many_joints(kind: str, space: str, given: Collection[str]) -> None:
    """Say that many joints take long where nothing is known of how they are joined."""
    angles = len(Space.parse(space).angles)
    if kind in ("dissipative", "symoden") and angles >= _MANY and "mass_matrix" not in given:
        print(
            f"warning: {angles} angles of which nothing is known take hours, and their harmonics may be too few for "
            'inertia. A URDF says how they are joined: `robot = "arm.urdf"` under `[known]`; or fix joints, and learn '
            "the others.",
            file=sys.stderr,
        )


def _headline(config: RunConfig, source: Source, command: Train) -> str:
    """The settings in one line."""
    data = source.dataset
    inputs = f"{data.inputs} input{'' if data.inputs == 1 else 's'}"
    recordings = f"{len(data.train)} recording{'' if len(data.train) == 1 else 's'}"
    return (
        f"training a {config.model.kind} model of {command.source or config.source}: space {data.space}, {inputs}, "
        f"{recordings}; preset {config.preset}, seed {config.seed}; into {command.out}"
    )


def _as_json(command: Train, result: FitResult) -> dict[str, object]:
    """What is said of training."""
    return {
        "run": str(command.out),
        "outcome": result.outcome,
        "completed": result.completed,
        "parameters": count_parameters(result.model),
        "loss": result.loss,
        "left_out": result.config.left_out or (),
        "seconds": result.seconds,
        "members": None if result.ensemble is None else len(result.ensemble.members),
    }

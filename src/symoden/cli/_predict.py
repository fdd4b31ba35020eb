"""`symoden predict`."""

import sys
from collections.abc import Sequence
from typing import Final

import numpy as np

from symoden.data import Trajectory
from symoden.evaluation import LEVEL, Bands, Prediction, bands_along, predict
from symoden.experiments import RunConfig, evaluation_solver, read_model, read_run, read_run_source
from symoden.mechanics import AbstractDynamics
from symoden.spaces import Space
from symoden.storage import StorageError
from symoden.wording import number

from ._arguments import Predict
from ._learned import bands_of, own_source, posterior_of
from ._other_data import name_other_data
from ._output import check_npz, print_json, save_npz
from ._progress import show_work
from ._words import name_unfinished

_COLUMNS: Final = ("ts", "q", "rates", "u", "q_predicted", "rates_predicted")
_BANDS: Final = ("q_half_width", "q_windows", "q_windows_half_width")
_MANY = 0.05  # Share of samples outside of the training data from which it is worth a word.
_MARGIN = 0.02  # Of a column's range in training, beyond which it lies outside.


def run(command: Predict) -> None:
    """Roll out the model of a run along recordings, into a file.

    Args:
        command: What to do.
    """
    check_npz(command.out)
    config = read_run(command.run)
    model = read_model(command.run)
    name_unfinished(config)
    source = read_run_source(config, command.source)
    name_other_data(config, source)
    every = {f"{part}:{each.name}": each for part, recordings in source.parts.items() for each in recordings}
    recordings = list(every.values())
    predictions = predict(model, recordings, hold=source.dataset.hold, solver=evaluation_solver(config))
    arrays: dict[str, np.ndarray] = {}
    for name, recording, prediction in zip(every, recordings, predictions, strict=True):
        columns = (recording.ts, recording.q, recording.rates, recording.us, prediction.q, prediction.rates)
        arrays |= {f"{name}/{key}": column for key, column in zip(_COLUMNS, columns, strict=True)}
    bands, told = None, {}
    if command.bands:
        bands, missing = _bands(command, model, config)
        more, said = _bands_along(bands, every, predictions)
        arrays, told = arrays | more, {"bands": said if bands is not None else {"unavailable": missing}}
    save_npz(command.out, arrays)
    outside = _outside(config, every, predictions)
    for (name, recording), prediction in zip(every.items(), predictions, strict=True):
        if outside[name] > _MANY:
            _name_outside(name, outside[name], _farthest(config, recording, prediction))
    if command.general.json:
        print_json(
            {
                "run": str(command.run),
                "source": source.name,
                "out": str(command.out),
                "recordings": len(every),
                "outside": outside,
                **told,
            }
        )
        return
    several = "" if len(every) == 1 else "s"
    names = ",".join((*_COLUMNS, *(_BANDS if command.bands else ())))
    print(f"rollouts along {len(every)} recording{several} of {source.name} in {command.out}: arrays")
    print(f"  PART:NAME/{{{names}}}, such as {next(iter(outside), 'test:a')}/q_predicted")
    if bands is not None:
        print(
            f"{LEVEL:.0%} bands of the first {number(bands.horizon)} s of q_predicted, and of q_windows, which begins "
            "anew from measured states; `symoden evaluate --bands` says what they cover"
        )


def _bands(command: Predict, model: AbstractDynamics, config: RunConfig) -> tuple[Bands | None, str]:
    """What makes bands, or why nothing does, which is said."""
    own = own_source(config).dataset
    try:
        return bands_of(posterior_of(command.run, model, config, own), config, own), ""
    except StorageError:
        raise
    except ValueError as error:  # Too few windows, or too many parameters: rollouts are worth having.
        print(f"warning: no bands, so that their arrays are NaN: {error}", file=sys.stderr)
        return None, str(error)


def _bands_along(
    bands: Bands | None, every: dict[str, Trajectory], predictions: Sequence[Prediction]
) -> tuple[dict[str, np.ndarray], dict[str, object]]:
    """Arrays of bands along recordings, NaN where there are none, and what a program wants to know of them."""
    if bands is None:
        nowhere = {name: np.full(each.q.shape, np.nan) for name, each in every.items()}
        return {f"{name}/{key}": column for name, column in nowhere.items() for key in _BANDS}, {}
    with show_work("bands along the recordings"):
        along = bands_along(bands, list(every.values()), predictions)
    arrays: dict[str, np.ndarray] = {}
    for name, each in zip(every, along, strict=True):
        columns = (each.half_width, each.windows, each.windows_half_width)
        arrays |= {f"{name}/{key}": column for key, column in zip(_BANDS, columns, strict=True)}
    coverage = {name: each.coverage for name, each in zip(every, along, strict=True)}
    said = {"level": LEVEL, "horizon_s": bands.horizon, "calibrated_on": bands.calibrated_on, "coverage": coverage}
    return arrays, said


def _outside(config: RunConfig, every: dict[str, Trajectory], predictions: Sequence[Prediction]) -> dict[str, float]:
    """Share of each recording that lies outside of the training data: what is asked for, or where the rollout goes."""
    space, ranges = Space.parse(config.data.space), config.data.ranges
    found: dict[str, float] = {}
    for (name, recording), prediction in zip(every.items(), predictions, strict=True):
        asked = ranges.outside(recording.q, recording.rates, recording.us, space, margin=_MARGIN)
        went = ranges.outside(prediction.q, prediction.rates, recording.us, space, margin=_MARGIN)
        found[name] = float(np.mean(asked | went))
    return found


def _farthest(config: RunConfig, recording: Trajectory, prediction: Prediction) -> str:
    """What goes farthest beyond training, recorded or predicted, and how far; nothing if all that is finite is in."""
    space, ranges = Space.parse(config.data.space), config.data.ranges
    found = [
        (where, farthest)
        for where, path in (("recorded", recording), ("predicted", prediction))
        if (farthest := ranges.farthest(path.q, path.rates, recording.us, space))
    ]
    if not found:
        return ""
    where, farthest = max(found, key=lambda each: each[1].share)
    names = config.data.input_names if farthest.of == "input" else config.data.position_names
    rate = "the momentum of " if config.data.momenta else "the velocity of "
    here, training = (f"{number(low)} to {number(high)}" for low, high in (farthest.here, farthest.training))
    what = f"{rate if farthest.of == 'rate' else ''}`{names[farthest.column]}`"
    return f": farthest {what}, {where} from {here}, in training from {training}"


def _name_outside(name: str, share: float, farthest: str) -> None:
    """Say on standard error that the model extrapolates on so large a share of a recording, and where farthest."""
    print(
        f"warning: `{name}` lies outside of what training saw for {share:.0%} of its samples, recorded or "
        f"predicted{farthest}. There the model extrapolates."
        + ("" if name.startswith("train:") else " Train on data that reach as far."),
        file=sys.stderr,
    )

"""`symoden predict`."""

import sys
from typing import Final

import numpy as np

from symoden.experiments import evaluation_solver, predict, read_model, read_run, read_run_source
from symoden.spaces import Space

from ._arguments import Predict
from ._output import check_npz, print_json, save_npz
from ._words import name_unfinished

_COLUMNS: Final = ("ts", "q", "rates", "u", "q_predicted", "rates_predicted")
_MANY = 0.05  # Share of samples outside of the training data from which it is worth a word.


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
    every = [(part, recording) for part, recordings in source.parts.items() for recording in recordings]
    recordings = [recording for _, recording in every]
    predictions = predict(model, recordings, hold=source.dataset.hold, solver=evaluation_solver(config))
    arrays: dict[str, np.ndarray] = {}
    outside: dict[str, float] = {}
    space = Space.parse(config.data.space)
    for (part, recording), prediction in zip(every, predictions, strict=True):
        name = f"{part}:{recording.name}"
        # What is asked for may lie outside, or the rollout may go there.
        asked = config.data.ranges.outside(recording.q, recording.rates, recording.us, space)
        went = config.data.ranges.outside(prediction.q, prediction.rates, recording.us, space)
        outside[name] = float(np.mean(asked | went))
        columns = (recording.ts, recording.q, recording.rates, recording.us, prediction.q, prediction.rates)
        arrays |= {f"{name}/{key}": column for key, column in zip(_COLUMNS, columns, strict=True)}
    save_npz(command.out, arrays)
    for name, share in outside.items():
        if share > _MANY:
            print(
                f"warning: `{name}` lies outside of what training saw for {share:.0%} of its samples, recorded or "
                "predicted (a rollout may, where the recording does not); there the model extrapolates. Train on "
                "data that reach as far.",
                file=sys.stderr,
            )
    if command.general.json:
        print_json(
            {
                "run": str(command.run),
                "source": source.name,
                "out": str(command.out),
                "recordings": len(every),
                "outside": outside,
            }
        )
    else:
        several = "" if len(every) == 1 else "s"
        print(f"rollouts along {len(every)} recording{several} of {source.name} in {command.out}: arrays")
        print(f"  PART:NAME/{{{','.join(_COLUMNS)}}}, such as {next(iter(outside), 'test:a')}/q_predicted")

"""`symoden predict`."""

from collections import Counter

import numpy as np

from symoden.experiments import evaluation_solver, predict, read_model, read_run, read_run_source

from ._arguments import Predict
from ._output import print_json, save_npz


def run(command: Predict) -> None:
    """Roll out the model of a run along recordings, into a file.

    Args:
        command: What to do.
    """
    config = read_run(command.run)
    model = read_model(command.run)
    source = read_run_source(config, command.source)
    every = [(part, recording) for part, recordings in source.parts.items() for recording in recordings]
    recordings = [recording for _, recording in every]
    predictions = predict(model, recordings, hold=source.dataset.hold, solver=evaluation_solver(config))
    counts = Counter(recording.name for recording in recordings)
    arrays: dict[str, np.ndarray] = {}
    for (part, recording), prediction in zip(every, predictions, strict=True):
        name = recording.name if counts[recording.name] == 1 else f"{part}:{recording.name}"
        arrays |= {
            f"{name}/ts": recording.ts,
            f"{name}/q": recording.q,
            f"{name}/rates": recording.rates,
            f"{name}/u": recording.us,
            f"{name}/q_predicted": prediction.q,
            f"{name}/rates_predicted": prediction.rates,
        }
    save_npz(command.out, arrays)
    if command.general.json:
        print_json({"run": str(command.run), "source": source.name, "out": str(command.out), "recordings": len(every)})
    else:
        print(f"rollouts along {len(every)} recordings of {source.name} in {command.out}")

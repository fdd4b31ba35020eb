"""`symoden simulate`."""

import numpy as np

from symoden.experiments import simulate, task

from ._arguments import Simulate
from ._output import check_npz, print_json, save_npz


def run(command: Simulate) -> None:
    """Simulate a task into a file.

    Args:
        command: What to do.

    Raises:
        ValueError: If a setting is out of range.
    """
    check_npz(command.out)
    chosen = task(command.task)
    if command.seed < 0:
        raise ValueError(f"`--seed` must be at least 0; got {command.seed}.")
    data = simulate(chosen, seed=command.seed)
    parts = {"train": data.dataset.train, "test": data.dataset.test, "prediction": data.prediction}
    arrays = {
        "task": np.array(chosen.name),
        "space": np.array(chosen.space),
        "seed": np.array(command.seed),
        "momenta": np.array(data.dataset.momenta),
    }
    for name, recordings in parts.items():
        arrays[f"{name}_ts"] = recordings[0].ts
        for column in ("q", "rates", "us"):
            arrays[f"{name}_{column}"] = np.stack([getattr(recording, column) for recording in recordings])
    save_npz(command.out, arrays)
    counts = {name: len(recordings) for name, recordings in parts.items()}
    if command.general.json:
        print_json({"task": chosen.name, "seed": command.seed, "out": str(command.out), "trajectories": counts})
    else:
        listed = ", ".join(f"{count} {name}" for name, count in counts.items())
        print(f"{chosen.name}, seed {command.seed}: {listed} trajectories in {command.out}")

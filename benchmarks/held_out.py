"""How well recordings are predicted that training was not given: what to choose settings by, beside the test ones.

    python benchmarks/held_out.py examples/dfki-c1.toml --out runs/held-out

Of up to eight recordings each is held out in turn, of more every fourth. What is done is kept, and not done again.
"""

import argparse
import dataclasses
import json
from pathlib import Path

import numpy as np

from symoden import fit, read_dataset
from symoden.data import Dataset
from symoden.evaluation import score_recordings
from symoden.integrate import RK4

FEW = 8
MANY = 4


def parts(dataset: Dataset) -> list[Dataset]:
    """The data set with some of its training recordings for testing, as often as there are folds."""
    count = len(dataset.train) if len(dataset.train) <= FEW else MANY
    fold = np.arange(len(dataset.train)) % count
    return [
        dataclasses.replace(
            dataset,
            train=tuple(each for k, each in zip(fold, dataset.train, strict=True) if k != held),
            test=tuple(each for k, each in zip(fold, dataset.train, strict=True) if k == held),
        )
        for held in range(count)
    ]


def main() -> None:
    """Train and score fold by fold."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("description", type=Path, help="TOML file of a data set")
    arguments.add_argument("--out", type=Path, required=True, help="folder of the results")
    chosen = arguments.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    print("| held out | 1 s, median | whole |\n|---|---:|---:|")
    for number, dataset in enumerate(parts(read_dataset(chosen.description))):
        path = chosen.out / f"{chosen.description.stem}-{number}.json"
        if not path.exists():
            result = fit(dataset)
            scores = score_recordings(result.model, dataset, solver=RK4(result.substeps), splits=("test",))
            path.write_text(json.dumps([[each.name, each.window_rmse.median, each.rollout_rmse] for each in scores]))
        for name, window, whole in json.loads(path.read_text()):
            print(f"| {name} | {window:.4f} | {whole:.3f} |", flush=True)


if __name__ == "__main__":
    main()

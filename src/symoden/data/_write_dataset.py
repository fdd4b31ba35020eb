"""From recordings to files and a description of them, which `read_dataset` and the command line read."""

import io
import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from symoden.storage import write_atomically

from ._dataset import Dataset
from ._errors import DataError
from ._trajectory import Trajectory

_FORBIDDEN = set('/\\:*?"<>|[]\0')


def write_dataset(path: Path | str, dataset: Dataset) -> None:
    """Write a data set as a description, with a file of arrays for each recording in a folder beside it.

    `arm.toml` names `arm/train/….npz`, `arm/test/….npz` and `arm/validation/….npz`, whose variables are t, q, v (or p)
    and u. Files of the same names are replaced, others left alone.

    Args:
        path: The description, by custom `<name>.toml`.
        dataset: The data set. Names of columns are not kept. Where velocities of all recordings were estimated, the
            median recording says how well.

    Raises:
        DataError: If a name is no name of a file or is there twice, the recordings' numbers of initial samples differ,
            or parts of the mechanism are known, which is to be written by hand.
        StorageError: If a file cannot be written.

    Example:
        >>> import tempfile
        >>> from symoden.data import read_dataset
        >>> ts = np.linspace(0.0, 1.0, 11)
        >>> q, v, u = np.sin(ts)[:, None], np.cos(ts)[:, None], np.zeros((11, 0))
        >>> swing = Trajectory(name="swing", ts=ts, q=q, rates=v, us=u)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_dataset(f"{folder}/arm.toml", Dataset(name="arm", space="T1", train=(swing,)))
        ...     read_dataset(f"{folder}/arm.toml").train[0].name
        'swing'
    """
    path = Path(path)
    if path.suffix != ".toml":
        raise DataError(
            f"`{path}`: a description must be a file `<name>.toml`, beside which the folder `<name>` is made."
        )
    parts = {"train": dataset.train, "test": dataset.test, "validation": dataset.validation}
    _refuse_unwritable(path, dataset, parts.values())
    for part, recordings in parts.items():
        for recording in recordings:
            _write_recording(path.with_suffix("") / part / f"{recording.name}.npz", recording, momenta=dataset.momenta)
    column = "q" if dataset.size == 1 else "q[{}]"  # As a table names them.
    # Of angles too: many turns would look like degrees.
    units = [f'"{column.format(i)}" = "{unit}"' for i, unit in enumerate(dataset.position_units) if unit]
    lines = [
        f"space = {json.dumps(dataset.space)}",
        'time = "t"',
        'positions = "q"',
        *(['momenta = "p"'] if dataset.momenta else ['velocities = "v"', "trust_velocities = true"]),
        *_estimates(dataset),
        *(['inputs = "u"', f"hold = {json.dumps(dataset.hold)}"] if dataset.inputs else []),
        *([f"units = {{ {', '.join(units)} }}"] if units else []),
        *([] if dataset.input_matrix is None else [f"input_matrix = {dataset.input_matrix.tolist()}"]),
        f"initial_samples = {dataset.recordings[0].initial_samples}",
    ]
    for part, recordings in parts.items():
        if recordings:
            files = [json.dumps(f"{path.stem}/{part}/{each.name}.npz", ensure_ascii=False) for each in recordings]
            lines += ["", f"[{part}]", "files = [", *(f"    {file}," for file in files), "]"]
    write_atomically(path, ("\n".join(lines) + "\n").encode())


def _refuse_unwritable(path: Path, dataset: Dataset, parts: Iterable[tuple[Trajectory, ...]]) -> None:
    """Refuse what the files could not say, before anything is written."""
    if dataset.known is not None:
        raise DataError(f"`{path}`: known parts are not written. Write the data set without them, and add `[known]`.")
    for names in ([path.stem], *([recording.name for recording in part] for part in parts)):
        unfit = [name for name in names if not name or name.startswith(".") or _FORBIDDEN & set(name)]
        twice = [name for name in names if names.count(name) > 1]
        if unfit or twice:
            raise DataError(
                f"`{path}`: names must differ and be names of files; got {(unfit or twice)[0]!r}"
                f"{'' if unfit else ' twice'}. Rename it with `dataclasses.replace`."
            )
    if len({recording.initial_samples for recording in dataset.recordings}) > 1:
        raise DataError(
            f"`{path}`: all recordings must have the same `initial_samples`; got several. Write them apart."
        )


def _estimates(dataset: Dataset) -> list[str]:
    """The line on velocities that were estimated, if all were."""
    gains = [each.noise_gain for each in dataset.recordings]
    known = [np.ravel(gain) for gain in gains if gain is not None]
    if dataset.momenta or len(known) < len(gains):
        return []
    typical = np.median(known, axis=0).tolist()
    one_sided = float(np.median([each.one_sided for each in dataset.recordings]))
    return [f"estimated_velocities = {{ noise_gain = {typical}, one_sided = {one_sided!r} }}"]


def _write_recording(path: Path, recording: Trajectory, *, momenta: bool) -> None:
    """Write the arrays of a recording."""
    arrays = {"t": recording.ts, "q": recording.q, "p" if momenta else "v": recording.rates}
    if recording.us.shape[1]:
        arrays["u"] = recording.us
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    write_atomically(path, buffer.getvalue())

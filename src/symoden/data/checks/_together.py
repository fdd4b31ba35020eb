"""Inputs that never change while a file lasts, and inputs or positions that change together."""

from typing import Final

import numpy as np
from jaxtyping import Bool, Float

from symoden.data._dataset import Dataset
from symoden.data._findings import Finding
from symoden.data._trajectory import pieces_of
from symoden.wording import first_few

_ENDS: Final = 2  # First and last rows of a file, in which inputs are switched on and off.
_NOTHING: Final = 1e-9  # Of an input's size: errors of floats.
_TOGETHER: Final = 1e-2  # Singular value beside the largest one, of inputs of one size, up to which nothing is told.
_PART: Final = 0.1  # Of directions that are not told: inputs that have no more of them are told but for that.
_NAMED: Final = 6  # Inputs or positions.
_TURN: Final = 2 * np.pi  # Beyond which a motion of more does not hide how far joints are apart [rad].
_SEVERAL: Final = 2  # Of one position nothing can be tied to another.


def find_untold_inputs(dataset: Dataset) -> list[Finding]:
    """Say which inputs of training files change together, or never while a file lasts.

    Effects of inputs that go together cannot be told from each other. Where these have other values in other files
    comparing files tells them apart, as far as nothing else differs.

    Args:
        dataset: Recordings as training sees them.

    Returns:
        One finding: a warning where comparing files does not tell them either. None where the input matrix is given.
    """
    given = dataset.input_matrix is not None or (dataset.known is not None and dataset.known.input_matrix is not None)
    files = _files(dataset)
    if given or not files:
        return []
    every = np.concatenate(files)
    changes = np.ptp(every, axis=0) > _NOTHING * np.abs(every).max(axis=0)  # Of others the check says so already.
    if not changes.any():
        return []
    size = every[:, changes].std(axis=0)
    whole = (every - every.mean(axis=0))[:, changes] / size
    within = np.concatenate([us - us.mean(axis=0) for us in files])[:, changes] / size
    largest = float(np.linalg.norm(whole, 2))
    apart, part_of = _untold(within, largest)
    if not apart:
        return []
    names = [dataset.input_names[j] for j in np.flatnonzero(changes)[part_of]]
    return [_finding(names, len(names) - apart, told=not _untold(whole, largest)[0])]


def _finding(names: list[str], ways: int, *, told: bool) -> Finding:
    """What to say of inputs that change in fewer ways than they are, and whether comparing files tells them apart."""
    one, listed = len(names) == 1, first_few((f"`{name}`" for name in names), _NAMED)
    how = f"change together within files, as if they were {ways} input{'s' * (ways > 1)}"
    if not ways:
        how = f"never {'changes' if one else 'change'} within a file"
    record = f"ecord motions in which {'this input changes' if one else 'these inputs change one after another'}"
    begin = "Nothing need be done if nothing else differs from file to file. Else r" if told else "R"
    return Finding(
        kind="together",
        level="note" if told else "warning",
        channel=names[0] if one else "",
        text=f"in [train] {listed} {how}: what {'it' if one else 'each of them'} does is "
        + ("told by comparing files alone" if told else "not told"),
        advice=f"{begin}{record}, or give `input_matrix` if it is known.",
    )


def find_tied_positions(dataset: Dataset) -> list[Finding]:
    """Say which positions of the training files go together, as where joints follow one path.

    Args:
        dataset: Recordings as training sees them.

    Returns:
        One finding, or none.
    """
    known = dataset.known
    given = known is not None and {"mass_matrix", "potential_energy"} <= set(known.fixed)
    every = [each.q - each.q.mean(axis=0) for each in dataset.train if len(each) > each.q.shape[1]]
    if given or not every or every[0].shape[1] < _SEVERAL:
        return []
    q = np.concatenate(every)
    moves = np.ptp(q, axis=0) > _NOTHING
    if np.count_nonzero(moves) < _SEVERAL:
        return []
    apart, part_of = _tied(q[:, moves])
    if not apart or not all(_tied(each[:, moves])[0] for each in every):
        return []
    names = [dataset.position_names[i] for i in np.flatnonzero(moves)[part_of]]
    ways = len(names) - apart
    return [
        Finding(
            kind="together",
            level="note",
            channel="",
            text=f"in [train] {first_few((f'`{name}`' for name in names), _NAMED)} move together, as if they were "
            f"{ways} joint{'s' * (ways > 1)}: what inertia, energy and friction are beside that path is not told",
            advice="Nothing need be done if they are to be predicted along it alone. Else record motions in which they "
            "move one after another, or give what is known (`robot`, [known]).",
        )
    ]


def _tied(q: Float[np.ndarray, "T n"]) -> tuple[int, Bool[np.ndarray, " n"]]:
    """In how many directions positions do not move, and which have a part in these."""
    # Joints that turn on and on are apart by as much as others, though by little beside all that they turn.
    size = np.clip(q.std(axis=0), np.finfo(float).tiny, _TURN)
    return _untold(q / size, float(np.sqrt(len(q))))


def _files(dataset: Dataset) -> list[Float[np.ndarray, "T m"]]:
    """Inputs of each training file, whose recordings may be pieces, without its first and last rows."""
    logs = pieces_of(dataset.train).values() if dataset.inputs else ()
    every = [np.concatenate([dataset.train[k].us for k in pieces])[_ENDS:-_ENDS] for pieces in logs]
    return [us for us in every if len(us)]


def _untold(us: Float[np.ndarray, "T m"], largest: float) -> tuple[int, Bool[np.ndarray, " m"]]:
    """In how many directions inputs do not change, and which have a part in these."""
    _, values, directions = np.linalg.svd(np.linalg.qr(us, mode="r"))
    values = np.append(values, np.zeros(len(directions) - len(values)))
    untold = directions[values <= _TOGETHER * largest]
    return len(untold), np.linalg.norm(untold, axis=0) > _PART

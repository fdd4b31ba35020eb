"""`symoden data check`."""

import dataclasses
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from symoden.data import ChannelFacts, DataError, DatasetCheck, Finding, RecordingCheck, check_dataset

from ._arguments import Data
from ._figure import check_figure, save_figure
from ._output import print_json, print_table

_DPI = 200


def run(command: Data) -> None:
    """Check a data set.

    Args:
        command: What to do.

    Raises:
        ValueError: If the figure's format is unknown.
        DataError: If the description is not what it must be; and in the end, if training refuses the data.
    """
    check_figure(command.figure)
    try:
        check = check_dataset(command.source, space=command.space)
    except DataError as error:
        raise DataError(str(error)) from None  # A file that the system refuses is wrong input, as any other is.
    figure = command.figure if check.recordings else None
    if figure is not None:
        _draw(check, figure)
    if command.general.json:
        print_json(_as_json(check, command.source, figure))
    else:
        _print_recordings(check)
        _print_channels(check)
        print(f"\nFindings\n{check}")
        if command.figure is not None:
            print(f"\n{'nothing is drawn' if figure is None else f'all recordings are drawn in {figure}'}")
    if check.refused:
        sys.stdout.flush()  # The message comes after what it is about, also where both go into one file.
        raise DataError(f"`{command.source}`: training refuses these data. Mend what is named refused.")


def _print_recordings(check: DatasetCheck) -> None:
    """A line for each file of each part."""
    columns = (
        "part", "recording", "rows", "duration [s]", "step [ms]", "least", "most", "incomplete rows", "gaps",
        "recordings",
    )  # fmt: skip
    rows: list[tuple[object, ...]] = [
        (
            each.log.part,
            each.log.name,
            len(each.log),
            each.duration,
            *(1e3 * each.steps[i] for i in (1, 0, 2)),
            each.missing,
            len(each.gaps),
            each.recordings or "refused",
        )
        for each in check.recordings
    ]
    rows.extend((each.part, each.name, *["-"] * 7, "refused") for each in check.unreadable)
    said = check.description
    resampled = f", resampled to {said.resample:g} s" if said.resample else ""
    title = f"What was read: space {said.space}, hold {said.hold}{resampled}; step: median, least and most"
    print_table(title, columns, rows)


def _print_channels(check: DatasetCheck) -> None:
    """A line for each column, over all recordings."""
    columns = ("column", "role", "least", "most", "rms", "rounded to", "noise", "cut off", "moves", "(dq/dt) / v")
    measured = [each.channels for each in check.recordings if each.channels]
    if not measured:
        return
    rows = [_channel_row(facts) for facts in zip(*measured, strict=True)]
    print_table("Columns over all recordings, in SI and rad (rounding and noise: medians)", columns, rows)


def _channel_row(facts: Sequence[ChannelFacts]) -> tuple[object, ...]:
    """One column of all recordings."""
    rounded = [one.quantum for one in facts if one.quantum]  # Of a log that changes too seldom nothing is known.
    noise = float(np.median([one.noise for one in facts]))
    least, most = min(one.minimum for one in facts), max(one.maximum for one in facts)
    cut_off = float(np.mean([one.cut_off for one in facts]))
    moving = [one.moving for one in facts if one.moving is not None]
    ratios = [one.ratio for one in facts if one.ratio is not None]
    return (
        facts[0].title,
        facts[0].role,
        least,
        most,
        float(np.sqrt(np.mean([one.rms**2 for one in facts]))),
        statistics.median_low(rounded) if rounded else "-",
        noise if noise > 1e-9 * (most - least) else "-",
        f"{cut_off:.0%}" if cut_off else "-",
        f"{np.mean(moving):.0%}" if moving else "-",
        _interval(ratios),
    )


def _interval(values: Sequence[float]) -> str:
    """The values in three digits, as one number or as least to most."""
    texts = [f"{value:.3g}" for value in (min(values), max(values))] if values else ["-"]
    return " to ".join(dict.fromkeys(texts))


def _draw(check: DatasetCheck, path: Path) -> None:
    """Draw all recordings into a file."""
    from symoden.report import draw_check

    save_figure(draw_check(check), path, dpi=_DPI)


def _as_json(check: DatasetCheck, source: Path, figure: Path | None) -> dict[str, object]:
    """Everything that was found."""
    return {
        "source": str(source),
        "space": check.description.space,
        "refused": check.refused,
        "findings": [_finding_as_json(finding) for finding in check.findings],
        "recordings": [_recording_as_json(each) for each in check.recordings],
        "unreadable": [
            {
                "name": each.name,
                "split": each.part,
                "file": str(each.path),
                "findings": [_finding_as_json(each.finding)],
            }
            for each in check.unreadable
        ],
        "figure": None if figure is None else str(figure),
    }


def _recording_as_json(each: RecordingCheck) -> dict[str, object]:
    """What was found in one recording."""
    least, median, most = each.steps
    return {
        "name": each.log.name,
        "split": each.log.part,
        "file": str(each.log.path),
        "rows": len(each.log),
        "recordings": each.recordings,
        "duration_s": each.duration,
        "step_s": {"min": least, "median": median, "max": most},
        "missing_rows": each.missing,
        "gaps_s": each.gaps,
        "channels": [dataclasses.asdict(one) for one in each.channels],
        "findings": [_finding_as_json(finding) for finding in each.findings],
    }


def _finding_as_json(finding: Finding) -> dict[str, object]:
    """One finding."""
    plain = dataclasses.asdict(finding)
    return plain | {"spans_s": plain.pop("spans")}

"""What is said of scores."""

import dataclasses
import math

import pytest

from symoden.cli._scores import _recordings, by_heart, diverging, poor, running_away, share_of_motion
from symoden.evaluation import MotionScore, RecordingScore, WindowScore


def recording(error, motion, name="run", coasting=math.nan):
    return RecordingScore(
        name=name,
        split="train",
        samples=200,
        window_rmse=WindowScore(horizon_s=1.0, median=error, mean=error),
        rollout_rmse=error,
        motion=motion,
        in_motion=MotionScore(error=error, motion=motion, coasting=coasting),
    )


@pytest.mark.parametrize(
    ("recordings", "is_poor"),
    [
        ([], False),
        ([recording(0.4, 1.0)], False),
        ([recording(0.6, 1.0)], True),
        ([recording(0.9, 1.0), recording(0.01, 1.0)], False),  # One of them may be another motion.
        ([recording(math.nan, math.nan)], False),  # Shorter than a window.
        ([recording(math.nan, math.nan), recording(0.6, 1.0)], True),
    ],
)
def test_predictions_that_are_hardly_better_than_standing_still_are_called_so(recordings, is_poor):
    words = poor(recordings)
    assert bool(words) == is_poor
    assert not is_poor or "hardly better than standing still" in words


def test_the_length_of_windows_is_named():
    short = recording(0.6, 1.0)
    short = dataclasses.replace(short, window_rmse=dataclasses.replace(short.window_rmse, horizon_s=0.2))
    assert poor([short]).startswith("over 0.2 s predictions are off by 0.6")


@pytest.mark.parametrize(
    ("units", "named"),
    [
        (("rad", "rad"), "rad"),
        (("m", "rad"), "rad, m"),
        (("m", "m"), "m"),
        (("", "rad"), "rad, lengths in m, or as they were logged without `units`"),
        (("m", ""), "lengths in m, or as they were logged without `units`"),
    ],
)
def test_errors_are_in_the_units_of_the_coordinates(units, named):
    assert _recordings([recording(0.1, 1.0)], units, ("a", "b")).title.startswith(f"position RMSE [{named}]: over")


def test_rollouts_of_whole_recordings_that_diverge_are_named():
    lost = dataclasses.replace(recording(0.1, 1.0, "lost"), rollout_rmse=math.inf)
    assert diverging([recording(0.1, 1.0)]) == ""
    assert diverging([recording(0.1, 1.0), lost]).startswith("one rollout over the whole of `lost` diverges. The")


def test_single_windows_that_diverge_are_named():
    one = recording(0.1, 1.0, "one")
    one = dataclasses.replace(one, window_rmse=dataclasses.replace(one.window_rmse, mean=math.inf))
    both = dataclasses.replace(one, name="both", rollout_rmse=math.inf)
    assert diverging([one, recording(0.1, 1.0)]).startswith("over 1 s some predictions of `one` diverge. The")
    said = "over 1 s some predictions of `one`, `both` diverge, and one rollout over the whole of `both` diverges. The"
    assert diverging([one, both]).startswith(said)


@pytest.mark.parametrize(
    ("astray", "said"),
    [
        ((0.3, 1.9), ""),
        ((33.0, 2.2), "rollouts over the whole of `ball` (train), `ball` (test) run away, off by up to 33 times the"),
        (
            (1.4, 2.2),
            "rollouts over the whole of `ball` (test) run away, off by up to 2.2 times the range in which all",
        ),
        ((math.inf, 1.9), ""),  # It diverges, and is called so.
        ((math.nan, math.nan), ""),
    ],
)
def test_rollouts_that_run_away_are_named(astray, said):
    scores = [
        dataclasses.replace(recording(0.002, 0.02, "ball"), astray=each, split=split)
        for each, split in zip(astray, ("train", "test"), strict=True)
    ]
    words = running_away(scores)
    assert words.startswith(said)
    assert bool(words) == bool(said)
    assert not said or "good over 1 s may be unstable over longer times" in words


@pytest.mark.parametrize(
    ("error", "coasting", "is_poor"),
    [
        (0.3, 0.3, True),  # An arm that goes on as it went, with currents of the wrong sign.
        (0.1, 0.3, False),
        (0.3, 2.0, False),  # A pendulum never does.
        (0.05, 0.02, False),  # Nothing is better on a wheel that turns evenly.
    ],
)
def test_predictions_that_are_hardly_better_than_coasting_are_called_so(error, coasting, is_poor):
    words = poor([recording(error, 1.0, coasting=coasting)])
    assert bool(words) == is_poor
    assert not is_poor or "going on at the first velocity is off by 0.3, in the mean" in words
    assert not is_poor or "hardly better than that. An input that has the wrong sign" in words


@pytest.mark.parametrize(
    ("learned", "error", "said"),
    [(0.002, 0.07, True), (0.02, 0.07, False), (0.002, 0.03, False), (0.002, math.nan, False), (math.nan, 0.07, False)],
)
def test_what_was_learned_by_heart_is_called_so(learned, error, said):
    """Six joints, and nothing known of them: 5 Hz of one motion, and the 2 s that came after it."""
    scores = [
        recording(learned, 0.35 if learned > 0 else math.nan, coasting=0.08),
        dataclasses.replace(recording(error, 0.26 if error > 0 else math.nan, coasting=0.08), split="test"),
    ]
    words = by_heart(scores)
    assert bool(words) == said
    assert not said or words.startswith("over 1 s predictions of test recordings are off by 0.07, of training")
    assert by_heart(scores[:1]) == by_heart(scores[1:]) == by_heart([]) == ""


@pytest.mark.parametrize(
    ("error", "coasting", "said"),
    [
        (0.95, math.nan, "hardly better than standing still."),
        (3.0, math.nan, "worse than standing still."),
        (3.0, 2.0, "worse than standing still."),
        (0.3, 0.35, "hardly better than that."),
        (0.7, 0.35, "worse than that."),
        (0.15, 0.02, "worse than that."),  # Noise alone tells what is off by less than a fifth of the motion.
    ],
)
def test_predictions_that_are_worse_than_none_are_called_so(error, coasting, said):
    words = poor([recording(error, 1.0, coasting=coasting)])
    assert f"while they move: {said} An input" in words
    assert ("that." not in said) or f"going on at the first velocity is off by {coasting}, in the mean" in words


def test_predictions_that_diverge_are_not_blamed_on_inputs():
    words = poor([recording(0.1, 1.0), recording(math.inf, 1.0)])
    assert words.startswith("over 1 s most predictions of `run` diverge")
    assert "sign" not in words
    others = poor([recording(0.9, 1.0), recording(math.inf, 1.0), recording(math.nan, math.nan)])
    assert others.startswith(f"{words} Of the others, over 1 s predictions are off by 0.9 where positions move 1, ")


def test_recordings_that_alone_are_predicted_badly_are_named():
    words = poor([recording(0.05, 0.3, "swing"), recording(0.3, 0.03, "rest")])
    assert words.startswith("over 1 s predictions of `rest` are off by 0.3 where positions move 0.03, in the mean")
    assert "an input that acts there alone" in words  # Elsewhere its sign is right, or tells nothing.
    assert "dry friction" in words
    resting = [recording(1e-4, 1e-4, f"rest {k}") for k in range(5)]
    words = poor([*resting, recording(0.3, 0.3, "bad"), recording(0.02, 0.03, "good"), recording(0.9, 0.9, "worst")])
    assert words.startswith("over 1 s predictions of `worst`, `bad` are off by 0.6 where positions move 0.6, in the")


@pytest.mark.parametrize(("error", "motion", "named"), [(0.01, 0.001, True), (0.01, 0.02, False), (2e-3, 1e-3, False)])
def test_one_recording_that_is_predicted_worse_than_not_at_all_is_named(error, motion, named):
    """In centimetres among others in millimetres: its motion is small beside theirs, and so is its error."""
    words = poor([*(recording(1e-3, 0.02, f"log{k}") for k in range(5)), recording(error, motion, "cm")])
    assert bool(words) == named
    assert not named or words.startswith("over 1 s predictions of `cm` are off by 0.01 where positions move 0.001, in")


@pytest.mark.parametrize(
    ("errors", "motion", "named"),
    [((0.12, 0.13), 0.08, True), ((0.12, 0.05), 0.1, False), ((0.02, 0.03), 0.01, False)],
)
def test_test_recordings_that_together_are_predicted_worse_than_not_at_all_are_named(errors, motion, named):
    """Not where those of training are predicted well, and the machine hardly moves in those for testing."""
    seen = [recording(error, 0.3, f"seen {k}") for k, error in enumerate((0.1, 0.08, 0.03))]
    tests = [dataclasses.replace(recording(e, motion, f"new {k}"), split="test") for k, e in enumerate(errors)]
    words = poor([*seen, *tests])
    assert bool(words) == named
    assert not named or words.startswith("over 1 s predictions of `new 1`, `new 0` are off by 0.12")
    assert not named or "worse than standing still. The others" in words


def test_recordings_of_one_name_are_told_apart_by_their_parts():
    good, bad = recording(0.05, 1.0), dataclasses.replace(recording(1.0, 1.0), split="test")
    other = recording(1.0, 1.0, "other")
    assert poor([good, bad, other]).startswith("over 1 s predictions of `run` (test), `other` are off by 1 where")
    assert poor([good, other]).startswith("over 1 s predictions of `other` are off by")
    lost = dataclasses.replace(recording(math.inf, 1.0), split="test")
    words = poor([good, bad, lost, recording(1.0, 1.0), other])
    assert words.startswith("over 1 s most predictions of `run` (test) diverge.")
    assert "predictions of `run` (test), `run` (train), `other` are off" in words
    assert "whole of `run` (test) diverges" in diverging([good, lost])


def test_errors_are_compared_with_the_motion():
    assert share_of_motion([recording(0.2, 1.0), recording(0.1, 0.5), recording(math.nan, math.nan)]) == pytest.approx(
        0.2
    )
    assert share_of_motion([recording(math.inf, 1.0)]) == math.inf
    assert math.isnan(share_of_motion([]))


@pytest.mark.parametrize("missing", [False, True])
def test_of_many_coordinates_the_worst_are_named(missing):
    names = ("waist", "shoulder", "elbow", "forearm", "wrist")
    errors = (math.nan,) * 5 if missing else (0.01, 0.02, 0.03, 0.34, 0.49)
    table = _recordings([dataclasses.replace(recording(0.1, 1.0), coordinates=errors)], ("rad",) * 5, names)
    assert table.columns[-2:] == ("1 s, worst", "whole")
    assert table.rows[0][-2] == ("-" if missing else "wrist 0.49, forearm 0.34")
    assert "worst" not in " ".join(_recordings([], ("rad",) * 4, names[:4]).columns)


@pytest.mark.parametrize(
    ("units", "whole"), [(("m", "rad"), {"whole, x": 0.3, "whole, pole": 0.4}), (("rad",) * 2, {})]
)
def test_rollouts_are_scored_by_coordinates_that_have_no_common_unit(units, whole):
    score = dataclasses.replace(recording(0.1, 1.0), coordinates=(0.1, 0.2), rollout_coordinates=(0.3, 0.4), windows=7)
    table = _recordings([score], units, ("x", "pole"))
    said = dict(zip(table.columns, table.rows[0], strict=True))
    assert {name: each for name, each in said.items() if name.startswith("whole,")} == whole
    assert ("whole" in said) == (not whole)
    assert said["windows"] == 7

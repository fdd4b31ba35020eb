"""What a model predicts, how far to trust it, and what it learned: scores, bands, audits, inspections."""

from ._audit import Audit as Audit, audit as audit
from ._bands import (
    BandedPath as BandedPath,
    Bands as Bands,
    BandScore as BandScore,
    calibrate_bands as calibrate_bands,
    infer_bands as infer_bands,
    score_bands as score_bands,
)
from ._batches import Stretch as Stretch
from ._certainty import LEVEL as LEVEL, Certainty as Certainty, certainty as certainty
from ._inspect import (
    FrictionProfile as FrictionProfile,
    Inspection as Inspection,
    Profile as Profile,
    anchor as anchor,
    identified_parameters as identified_parameters,
    inspect_model as inspect_model,
)
from ._predict import Prediction as Prediction, predict as predict
from ._ranges import Ranges as Ranges
from ._recorded import (
    BandsAlong as BandsAlong,
    RecordedPaths as RecordedPaths,
    bands_along as bands_along,
    recorded_paths as recorded_paths,
)
from ._scores import (
    MotionScore as MotionScore,
    RecordingScore as RecordingScore,
    WindowScore as WindowScore,
    score_recordings as score_recordings,
)
from ._urdf import IdentifiedJoint as IdentifiedJoint, write_urdf as write_urdf

__all__ = [
    "LEVEL",
    "Audit",
    "BandScore",
    "BandedPath",
    "Bands",
    "BandsAlong",
    "Certainty",
    "FrictionProfile",
    "IdentifiedJoint",
    "Inspection",
    "MotionScore",
    "Prediction",
    "Profile",
    "Ranges",
    "RecordedPaths",
    "RecordingScore",
    "Stretch",
    "WindowScore",
    "anchor",
    "audit",
    "bands_along",
    "calibrate_bands",
    "certainty",
    "identified_parameters",
    "infer_bands",
    "inspect_model",
    "predict",
    "recorded_paths",
    "score_bands",
    "score_recordings",
    "write_urdf",
]

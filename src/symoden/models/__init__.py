"""The paper's five models, composed of blocks."""

from ._baselines import GeometricModel as GeometricModel, NaiveModel as NaiveModel
from ._build import awaken as awaken, build as build
from ._config import KINDS as KINDS, BlockConfig as BlockConfig, Kind as Kind, ModelConfig as ModelConfig
from ._embedded import embedded_vector_field as embedded_vector_field
from ._files import MODULES as MODULES, check_savable as check_savable, load as load, save as save
from ._gauge import rescale as rescale
from ._given import (
    Given as Given,
    energies_are_given as energies_are_given,
    given_parts as given_parts,
    parts_that_fix_the_scale as parts_that_fix_the_scale,
)
from ._known_data import (
    KnownMagnitudes as KnownMagnitudes,
    check_known as check_known,
    known_magnitudes as known_magnitudes,
    parameter_units as parameter_units,
)
from ._lagrangian import Lagrangian as Lagrangian, Tangent as Tangent, lagrangian as lagrangian, pull_back as pull_back
from ._scales import Scales as Scales
from ._structured import StructuredModel as StructuredModel
from ._trees import FileFormat as FileFormat
from ._unstructured import UnstructuredModel as UnstructuredModel

__all__ = [
    "KINDS",
    "MODULES",
    "BlockConfig",
    "FileFormat",
    "GeometricModel",
    "Given",
    "Kind",
    "KnownMagnitudes",
    "Lagrangian",
    "ModelConfig",
    "NaiveModel",
    "Scales",
    "StructuredModel",
    "Tangent",
    "UnstructuredModel",
    "awaken",
    "build",
    "check_known",
    "check_savable",
    "embedded_vector_field",
    "energies_are_given",
    "given_parts",
    "known_magnitudes",
    "lagrangian",
    "load",
    "parameter_units",
    "parts_that_fix_the_scale",
    "pull_back",
    "rescale",
    "save",
]

"""The paper's five models, composed of blocks."""

from ._baselines import GeometricModel as GeometricModel, NaiveModel as NaiveModel
from ._build import KINDS as KINDS, BlockConfig as BlockConfig, Kind as Kind, ModelConfig as ModelConfig, build as build
from ._files import load as load, save as save
from ._scales import Scales as Scales
from ._structured import StructuredModel as StructuredModel
from ._unstructured import UnstructuredModel as UnstructuredModel

__all__ = [
    "KINDS",
    "BlockConfig",
    "GeometricModel",
    "Kind",
    "ModelConfig",
    "NaiveModel",
    "Scales",
    "StructuredModel",
    "UnstructuredModel",
    "build",
    "load",
    "save",
]

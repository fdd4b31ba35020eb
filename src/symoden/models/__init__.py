"""The paper's five models, composed of blocks."""

from ._baselines import GeometricModel as GeometricModel, NaiveModel as NaiveModel
from ._build import KINDS as KINDS, BlockConfig as BlockConfig, Kind as Kind, ModelConfig as ModelConfig, build as build
from ._embedded import embedded_vector_field as embedded_vector_field
from ._files import load as load, save as save
from ._gauge import rescale as rescale
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
    "embedded_vector_field",
    "load",
    "rescale",
    "save",
]

"""What fills M⁻¹, V, g and D: networks, learned constants, known functions; positive (semi)definite by Cholesky factor.

A *function* maps a configuration to a flat vector of coefficients; a *block* gives those coefficients their shape,
their sign and their physical scale. Every function goes into every block.
"""

from ._fields import (
    AbstractBlock as AbstractBlock,
    CholeskyBlock as CholeskyBlock,
    KnownFunction as KnownFunction,
    KnownValue as KnownValue,
    MatrixBlock as MatrixBlock,
    ScalarBlock as ScalarBlock,
)
from ._friction import (
    AbstractFriction as AbstractFriction,
    JointFriction as JointFriction,
    NoFriction as NoFriction,
    ViscousFriction as ViscousFriction,
)
from ._functions import (
    ACTIVATIONS as ACTIVATIONS,
    AbstractFunction as AbstractFunction,
    Constant as Constant,
    Correction as Correction,
    Network as Network,
    Perceptron as Perceptron,
    Sum as Sum,
)
from ._known import Known as Known
from ._trainable import count_parameters as count_parameters, trainable as trainable
from ._triangles import identity_triangle as identity_triangle, lower_triangle as lower_triangle

__all__ = [
    "ACTIVATIONS",
    "AbstractBlock",
    "AbstractFriction",
    "AbstractFunction",
    "CholeskyBlock",
    "Constant",
    "Correction",
    "JointFriction",
    "Known",
    "KnownFunction",
    "KnownValue",
    "MatrixBlock",
    "Network",
    "NoFriction",
    "Perceptron",
    "ScalarBlock",
    "Sum",
    "ViscousFriction",
    "count_parameters",
    "identity_triangle",
    "lower_triangle",
    "trainable",
]

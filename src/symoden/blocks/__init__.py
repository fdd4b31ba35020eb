"""What fills M⁻¹, V, g and D: networks, learned constants, formulas; positive (semi)definite by Cholesky factor.

A *function* maps a configuration to a flat vector of coefficients; a *block* gives those coefficients their shape,
their sign and their physical scale. Every function goes into every block.
"""

from ._corrected import (
    Congruence as Congruence,
    CorrectedBlock as CorrectedBlock,
    CorrectedFriction as CorrectedFriction,
    CorrectedMatrix as CorrectedMatrix,
)
from ._fields import (
    AbstractBlock as AbstractBlock,
    CholeskyBlock as CholeskyBlock,
    GramBlock as GramBlock,
    InverseBlock as InverseBlock,
    KnownFunction as KnownFunction,
    KnownValue as KnownValue,
    MatrixBlock as MatrixBlock,
    ScalarBlock as ScalarBlock,
)
from ._formulas import (
    Formula as Formula,
    FormulaBlock as FormulaBlock,
    FormulaFriction as FormulaFriction,
    Parameters as Parameters,
    with_parameters as with_parameters,
)
from ._fourier import FourierSeries as FourierSeries
from ._friction import (
    ODD_SHAPES as ODD_SHAPES,
    AbstractFriction as AbstractFriction,
    JointFriction as JointFriction,
    KnownFriction as KnownFriction,
    NoFriction as NoFriction,
    ViscousFriction as ViscousFriction,
)
from ._functions import (
    ACTIVATIONS as ACTIVATIONS,
    ACTUATION as ACTUATION,
    CORRECTIONS as CORRECTIONS,
    DIRECTIONS as DIRECTIONS,
    FRICTION as FRICTION,
    INERTIA as INERTIA,
    NETWORKS as NETWORKS,
    POTENTIAL as POTENTIAL,
    AbstractFunction as AbstractFunction,
    Constant as Constant,
    Correction as Correction,
    Network as Network,
    Perceptron as Perceptron,
    Reduced as Reduced,
    Sum as Sum,
)
from ._harmonics import Harmonics as Harmonics, products as products
from ._known import Known as Known
from ._lagrange import forces as forces, momenta as momenta
from ._links import Links as Links, LinksBlock as LinksBlock
from ._polynomial import Polynomial as Polynomial, monomials as monomials
from ._trainable import (
    count_active as count_active,
    count_parameters as count_parameters,
    is_silent as is_silent,
    kinds_in_use as kinds_in_use,
    silenced as silenced,
    trainable as trainable,
    without_silent as without_silent,
)
from ._triangles import (
    identity_triangle as identity_triangle,
    inverse_of_positive as inverse_of_positive,
    lower_triangle as lower_triangle,
)

__all__ = [
    "ACTIVATIONS",
    "ACTUATION",
    "CORRECTIONS",
    "DIRECTIONS",
    "FRICTION",
    "INERTIA",
    "NETWORKS",
    "ODD_SHAPES",
    "POTENTIAL",
    "AbstractBlock",
    "AbstractFriction",
    "AbstractFunction",
    "CholeskyBlock",
    "Congruence",
    "Constant",
    "CorrectedBlock",
    "CorrectedFriction",
    "CorrectedMatrix",
    "Correction",
    "Formula",
    "FormulaBlock",
    "FormulaFriction",
    "FourierSeries",
    "GramBlock",
    "Harmonics",
    "InverseBlock",
    "JointFriction",
    "Known",
    "KnownFriction",
    "KnownFunction",
    "KnownValue",
    "Links",
    "LinksBlock",
    "MatrixBlock",
    "Network",
    "NoFriction",
    "Parameters",
    "Perceptron",
    "Polynomial",
    "Reduced",
    "ScalarBlock",
    "Sum",
    "ViscousFriction",
    "count_active",
    "count_parameters",
    "forces",
    "identity_triangle",
    "inverse_of_positive",
    "is_silent",
    "kinds_in_use",
    "lower_triangle",
    "momenta",
    "monomials",
    "products",
    "silenced",
    "trainable",
    "with_parameters",
    "without_silent",
]

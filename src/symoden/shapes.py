"""Physical names for the shapes of arrays; equal axis names mean equal lengths within one call."""

from typing import TypeAlias

from jaxtyping import Array, Bool, Float

Scalar: TypeAlias = Float[Array, ""]
Coordinates: TypeAlias = Float[Array, " n"]
Velocities: TypeAlias = Float[Array, " n"]
Momenta: TypeAlias = Float[Array, " n"]
Rates: TypeAlias = Float[Array, " n"]  # velocities or momenta, as the data state it
Inputs: TypeAlias = Float[Array, " m"]
Embedding: TypeAlias = Float[Array, " e"]
State: TypeAlias = Float[Array, " s"]
Observation: TypeAlias = Float[Array, " o"]
SquareMatrix: TypeAlias = Float[Array, "n n"]
InputMatrix: TypeAlias = Float[Array, "n m"]
DissipationMatrix: TypeAlias = Float[Array, "d d"]  # d = n (on momenta) or 2n (the paper's full D)
Times: TypeAlias = Float[Array, " T"]
Flag: TypeAlias = Bool[Array, ""]

"""The blocks of one model, from its settings."""

from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PRNGKeyArray

from symoden.blocks import (
    ACTUATION,
    DIRECTIONS,
    FRICTION,
    INERTIA,
    NETWORKS,
    ODD_SHAPES,
    POTENTIAL,
    AbstractBlock,
    AbstractFriction,
    AbstractFunction,
    CholeskyBlock,
    Congruence,
    Constant,
    Correction,
    FourierSeries,
    GramBlock,
    Harmonics,
    InverseBlock,
    JointFriction,
    Known,
    KnownValue,
    MatrixBlock,
    Network,
    Perceptron,
    Polynomial,
    Reduced,
    ScalarBlock,
    Sum,
    ViscousFriction,
    identity_triangle,
    monomials,
    products,
)
from symoden.spaces import Space

from ._config import BlockConfig, ModelConfig
from ._known import Corrections
from ._scales import Scales

_BODIES = 3  # Rows of the Jacobian for each coordinate; with two, one start in four ended in a poor minimum.
_SPREAD = 0.3  # Of the harmonics' first weights; with 0.1, one start in four did.
_DEGREES = (4, 3, 2)  # Of the polynomial in lengths that V starts from: the first that leaves few enough weights.
_BEYOND = 2.0  # Times the range of the data, up to where V is a polynomial: springs that harden are told there, too.
_CRANK = 4  # Harmonics of 1/√M.
_ORDER = 24  # Of the harmonics of single angles in V: twelve detents a turn, and what is half as wide.
_MOST_WEIGHTS = 2000  # Of what a block starts from: a step of Levenberg-Marquardt costs the square of their number.


@dataclass(frozen=True)
class Maker:
    """Makes the blocks of one model.

    Attributes:
        config: Settings.
        space: Configuration space, of n coordinates.
        kept: Indices of those that what is learned may depend on: all but the cyclic ones.
        inputs: Number of inputs m.
        momenta: Whether the rates in the data are momenta.
        scales: Natural units.
        input_matrix: The n × m matrix g where it is known.
    """

    config: ModelConfig
    space: Space
    kept: tuple[int, ...]
    inputs: int
    momenta: bool
    scales: Scales
    input_matrix: np.ndarray | None

    @property
    def seen(self) -> Space:
        """Space of the coordinates that something depends on, of which there must be one."""
        return Space(tuple(self.space.is_angle[i] for i in self.kept))

    @property
    def turns(self) -> bool:
        """Whether something depends on an angle."""
        return any(self.space.is_angle[i] for i in self.kept)

    def inverse_mass(self, key: PRNGKeyArray) -> AbstractBlock:
        """M⁻¹, near the identity in natural units at the start unless the data's units are used."""
        n = self.space.size
        turning = self.config.inverse_mass.harmonics and self.turns
        if turning and n > 1:
            rows = _BODIES * n
            jacobian = self._function(
                self.config.inverse_mass, rows * n, base=np.eye(rows, n).ravel(), powers=0, key=key
            )
            if len(self.seen.lengths):
                jacobian = self._also_sliding(jacobian, rows * n, key=jax.random.fold_in(key, 1))
            scale = Known.of(np.sqrt(self.scales.momentum / self.scales.velocity))
            return InverseBlock(GramBlock(self._reduced(jacobian), scale, floor=self.config.floor**2))
        base = identity_triangle(n) if self.config.scaled or not self.kept else None
        config = self.config.inverse_mass
        if config.harmonics:
            config = replace(config, constant=True, harmonics=False)
        function = self._function(config, n * (n + 1) // 2, base=base, key=key)
        if turning:  # Of what turns alone the inertia is the same all round, but of a crank's.
            harmonics = self._harmonics(1, powers=0, spread=0.0, key=jax.random.fold_in(key, 1))
            for added in (FourierSeries.init(self.seen, 1, order=_CRANK), harmonics):
                function = _asked_first(function, added, INERTIA)
        return CholeskyBlock(
            function=self._reduced(function),
            scale=Known.of(np.sqrt(self.scales.velocity / self.scales.momentum)),
            floor=self.config.floor,
        )

    def potential(self, key: PRNGKeyArray) -> ScalarBlock:
        """V."""
        function = self._function(self.config.potential, 1, kind=NETWORKS if self.turns else POTENTIAL, key=key)
        if self.turns and isinstance(function, Sum) and self.config.potential.harmonics:
            function = _asked_first(function, FourierSeries.init(self.seen, 1, order=_ORDER), POTENTIAL)
        return ScalarBlock(function=self._reduced(function), scale=Known.of(self.scales.energy))

    def actuation(self, key: PRNGKeyArray) -> AbstractBlock:
        """The g that was given, or a learned one."""
        if self.input_matrix is not None or not self.inputs:
            known = np.zeros((self.space.size, 0)) if self.input_matrix is None else np.asarray(self.input_matrix)
            return KnownValue(Known.of(known))
        size = self.space.size * self.inputs
        function = self._function(self.config.actuation, size, base=0.1, key=key)
        if isinstance(function, Sum) and self.config.actuation.constant and self.turns:
            # Forces that turn with a body, or pull at a lever.
            turning = self._harmonics(size, powers=1, spread=0.0, key=jax.random.fold_in(key, 1))
            function = _asked_first(function, turning, ACTUATION)
        scale = np.outer(self.scales.force, 1 / self.scales.input)
        return MatrixBlock(function=self._reduced(function), scale=Known.of(scale))

    def friction(self, key: PRNGKeyArray) -> AbstractFriction:
        """D on the momenta, viscous or with every joint's own law, or the paper's D on the full state."""
        n, s = self.space.size, self.scales
        size = 2 * n if self.config.full_friction else n
        base = 0.3 * identity_triangle(size)
        # On the full state, D takes (∂H/∂q, ∂H/∂p) = (force, velocity) to (velocity, force).
        unit = np.sqrt(np.concatenate([s.velocity / s.force, s.force / s.velocity])[-size:])
        viscous = self._reduced(self._function(self.config.friction, size * (size + 1) // 2, base=base, key=key))
        if not self.config.knees:
            return ViscousFriction(CholeskyBlock(function=viscous, scale=Known.of(unit)))
        laws, directions = n * JointFriction.shapes(self.config.knees), n * ODD_SHAPES
        return JointFriction(
            viscous=viscous,
            laws=Correction(Constant(jnp.zeros(laws, float)), kind=FRICTION),
            scale=Known.of(unit),
            speed=Known.of(s.velocity),
            knees=self.config.knees,
            directions=Correction(Constant(jnp.zeros(directions, float)), kind=DIRECTIONS),
        )

    def corrections(self, key: PRNGKeyArray) -> Corrections:
        """What corrects given parts that are only nearly right."""
        n, s = self.space.size, self.scales
        keys, mass = jax.random.split(key, 4), np.sqrt(s.momentum / s.velocity)

        def silent(config: BlockConfig, size: int, key: PRNGKeyArray) -> AbstractFunction:
            if not self.kept:
                return Correction(Constant(jnp.zeros(size, float)))
            perceptron = self._perceptron(self._standard(), config.hidden or (8,), size, key=key)
            return self._reduced(Correction(Network(self.seen, perceptron.silenced())))

        triangle = n * (n + 1) // 2
        return Corrections(
            mass=Congruence(silent(self.config.inverse_mass, triangle, keys[0]), Known.of(mass)),
            potential=ScalarBlock(silent(self.config.potential, 1, keys[1]), Known.of(s.energy)),
            actuation=MatrixBlock(
                silent(self.config.actuation, n * self.inputs, keys[2]), Known.of(np.outer(s.force, 1 / s.input))
            ),
            friction=Congruence(
                silent(self.config.friction, triangle, keys[3]), Known.of(np.sqrt(s.force / s.velocity))
            ),
        )

    def energy(self, key: PRNGKeyArray) -> Perceptron:
        """H as a network of (embedded q, p)."""
        return self._perceptron(self._standard(self.scales.momentum), self.config.energy, 1, key=key)

    def flow(self, key: PRNGKeyArray) -> Perceptron:
        """(q̇, ṗ) as a network of (embedded q, p, u)."""
        standard = self._standard(self.scales.momentum, self.scales.input)
        return self._perceptron(standard, self.config.flow, 2 * self.space.size, key=key)

    def naive_flow(self, key: PRNGKeyArray) -> Perceptron:
        """Derivative of the observation as a network of the observation and u."""
        standard = self._standard(self._rates(), self.scales.input)
        return self._perceptron(standard, self.config.flow, len(self.naive_scale().array), key=key)

    def naive_scale(self) -> Known:
        """Units of the derivative of the observation; those of (ṙ, d cos φ, d sin φ) follow from the velocities."""
        velocity = self.scales.velocity
        lengths, angles = velocity[self.space.lengths], velocity[self.space.angles]
        return Known.of(np.concatenate([lengths, angles, angles, self._rates() / self.scales.time]))

    def _rates(self) -> np.ndarray:
        """Units of the data's rates."""
        return self.scales.momentum if self.momenta else self.scales.velocity

    def _standard(self, *others: np.ndarray) -> dict[str, np.ndarray]:
        """How a network's input is standardised: the embedded coordinates, then the others."""
        zeros = np.zeros(sum(len(other) for other in others))
        return {
            "center": np.concatenate([self._embedded(self.scales.center), zeros]),
            "scale": np.concatenate([self._embedded(self.scales.spread), *others]),
        }

    def _embedded(self, numbers: np.ndarray) -> np.ndarray:
        """Of numbers that each belong to an embedded coordinate, those of the coordinates that are kept."""
        owners = np.concatenate([self.space.lengths, self.space.angles, self.space.angles])
        return numbers[np.isin(owners, self.kept)]

    def _reduced(self, function: AbstractFunction) -> AbstractFunction:
        """A function of the coordinates that are kept, as one of all."""
        whole = len(self.kept) == self.space.size or isinstance(function, Constant)
        return function if whole else Reduced(function, self.kept)

    def _perceptron(
        self, standard: dict[str, np.ndarray], hidden: tuple[int, ...], outputs: int, *, key: PRNGKeyArray
    ) -> Perceptron:
        """Network of standardised inputs."""
        sizes = (len(standard["center"]), *hidden, outputs)
        activation = self.config.activation or ("silu" if self.turns else "sin")
        return Perceptron.init(sizes, activation=activation, **standard, key=key)

    def _function(
        self,
        config: BlockConfig,
        size: int,
        *,
        base: np.ndarray | float | None = None,
        powers: int = 2,
        kind: int = NETWORKS,
        key: PRNGKeyArray,
    ) -> AbstractFunction:
        """Coefficients of a block, a network beside them being a correction of some kind."""
        # A `base` is what a constant starts from; `powers` are those of lengths in harmonics.
        start: AbstractFunction = Constant(jnp.broadcast_to(jnp.asarray(0.0 if base is None else base, float), (size,)))
        if not self.kept:
            return start
        if config.harmonics:
            terms = (
                self._harmonics(size, powers=powers, spread=_SPREAD, key=jax.random.fold_in(key, 0))
                if self.turns
                else self._polynomial(size)
            )
            start = eqx.tree_at(lambda terms: terms.weights, terms, terms.weights.at[0].set(start.values))
        if not config.hidden:
            return start
        perceptron = self._perceptron(self._standard(), config.hidden, size, key=key)
        if config.constant or config.harmonics:
            return Sum((start, Correction(Network(self.seen, perceptron.silenced()), kind=kind)))
        if base is not None and self.config.scaled:
            return Sum((start, Network(self.seen, perceptron)))
        return Network(self.seen, perceptron)

    def _polynomial(self, size: int) -> Polynomial:
        """Monomials of lengths, of a degree that leaves few weights, as far as twice the data's range."""
        counts = {degree: size * monomials(len(self.kept), degree) for degree in _DEGREES}
        degree = next((degree for degree, count in counts.items() if count <= _MOST_WEIGHTS), _DEGREES[-1])
        reach = None if self.scales.reach is None else _BEYOND * self._embedded(self.scales.reach)
        return Polynomial.init(size, degree=degree, **self._standard(), reach=reach)

    def _also_sliding(self, function: AbstractFunction, size: int, *, key: PRNGKeyArray) -> Sum:
        """Products with lengths are another correction: along most lengths the inertia stays as it is."""
        return _asked_first(function, self._harmonics(size, powers=1, spread=0.0, key=key).of_lengths(), INERTIA)

    def _harmonics(self, size: int, *, powers: int, spread: float, key: PRNGKeyArray) -> Harmonics:
        """Products of the first harmonics and of powers of lengths, with as many factors as leave few weights."""
        standard = self._standard()
        counts = {order: size * len(products(self.seen, powers, order)) for order in (3, 2)}
        return Harmonics.init(
            self.seen,
            size,
            powers=powers,
            order=next((order for order, count in counts.items() if count <= _MOST_WEIGHTS), 1),
            spread=spread,
            center=standard["center"],
            scale=standard["scale"],
            key=key,
        )


def _asked_first(function: AbstractFunction, added: AbstractFunction, kind: int) -> Sum:
    """A function with one more correction, before the network that corrects it if there is one."""
    start, *networks = function.terms if isinstance(function, Sum) else (function,)
    return Sum((start, Correction(added, kind=kind), *networks))

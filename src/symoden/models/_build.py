"""Build one of the five models from its settings."""

import jax
import numpy as np
from jaxtyping import PRNGKeyArray

from symoden.blocks import POTENTIAL, Correction, Known, Network, NoFriction, Perceptron
from symoden.known import KnownParts
from symoden.mechanics import AbstractDynamics
from symoden.spaces import Space

from ._baselines import GeometricModel, NaiveModel
from ._config import ModelConfig
from ._known import insert_known
from ._maker import Maker
from ._scales import Scales
from ._structured import StructuredModel
from ._unstructured import UnstructuredModel


def build(
    config: ModelConfig,
    space: Space,
    inputs: int,
    *,
    momenta: bool = False,
    scales: Scales | None = None,
    input_matrix: np.ndarray | None = None,
    known: KnownParts | None = None,
    key: PRNGKeyArray,
) -> AbstractDynamics:
    """Make an untrained model.

    Args:
        config: Settings.
        space: Configuration space, of n coordinates.
        inputs: Number of inputs m; may be 0.
        momenta: Whether the rates in the data are momenta rather than velocities.
        scales: Natural units; ones if absent.
        input_matrix: The n × m matrix g where it is known; it fixes the scale of the energy.
        known: Parts of the mechanism that are given; for the kinds "dissipative" and "symoden".
        key: Source of the weights.

    Returns:
        The model, a PyTree.

    Raises:
        ValueError: If `input_matrix` is not n × m, or what is given does not fit the kind, the space or the inputs.

    Example:
        >>> import jax.numpy as jnp
        >>> model = build(ModelConfig(), Space.parse("T1"), 1, key=jax.random.key(0))
        >>> model.input_matrix(jnp.zeros(1)).shape
        (1, 1)
    """
    if input_matrix is not None and np.shape(input_matrix) != (space.size, inputs):
        raise ValueError(
            f"`input_matrix` must be coordinates × inputs, {space.size} × {inputs}; got {np.shape(input_matrix)}."
        )
    if known is not None:
        _refuse_unused(config, known)
    maker = Maker(
        config, space, _kept(space, known), inputs, momenta, scales or Scales.units(space, inputs), input_matrix
    )
    mass_key, energy_key, actuation_key, friction_key = jax.random.split(key, 4)
    common = {"space": space, "inputs": inputs, "momenta": momenta}
    match config.kind:
        case "naive":
            return NaiveModel(**common, flow=maker.naive_flow(energy_key), scale=maker.naive_scale())
        case "geometric":
            return GeometricModel(
                **common,
                flow=maker.flow(energy_key),
                scale=Known.of(np.concatenate([maker.scales.velocity, maker.scales.force])),
                inverse_mass=maker.inverse_mass(mass_key),
            )
        case "unstructured":
            return UnstructuredModel(
                **common,
                energy=maker.energy(energy_key),
                energy_scale=Known.of(maker.scales.energy),
                inverse_mass=None if momenta else maker.inverse_mass(mass_key),
                actuation=maker.actuation(actuation_key),
                friction=maker.friction(friction_key),
            )
        case "dissipative" | "symoden":
            model = StructuredModel(
                **common,
                inverse_mass=maker.inverse_mass(mass_key),
                potential=maker.potential(energy_key),
                actuation=maker.actuation(actuation_key),
                friction=NoFriction() if config.kind == "symoden" else maker.friction(friction_key),
            )
            if known is None:
                return model
            corrections = maker.corrections(jax.random.fold_in(key, 4))
            return insert_known(model, known, corrections, maker.scales.parameters)


def awaken(model: AbstractDynamics, *, key: PRNGKeyArray) -> AbstractDynamics:
    """Draw the network that corrects a V of lengths, which starts at zero: Adam finds no way from there.

    Args:
        model: An untrained model.
        key: Source of the weights.

    Returns:
        The model with such networks drawn; itself if it has none.
    """

    def drawn(node: object) -> object:
        if not isinstance(node, Correction) or node.kind != POTENTIAL or not isinstance(node.function, Network):
            return node
        silent = node.function.perceptron
        sizes = (len(silent.weights[0]), *(len(bias) for bias in silent.biases))
        standard = {"center": np.asarray(silent.center.array), "scale": np.asarray(silent.scale.array)}
        perceptron = Perceptron.init(sizes, activation=silent.activation, **standard, key=key)
        return Correction(Network(node.function.space, perceptron), kind=node.kind)

    return jax.tree.map(drawn, model, is_leaf=lambda node: isinstance(node, Correction))


def _refuse_unused(config: ModelConfig, known: KnownParts) -> None:
    """Refuse parts that the kind of model does not have."""
    if config.kind not in ("dissipative", "symoden"):
        raise ValueError(
            f"Known parts are for models of the kinds dissipative and symoden; got {config.kind}, which has no such "
            "parts. Choose one of these, or data described without them."
        )
    if config.kind == "symoden" and known.dissipation_matrix is not None:
        raise ValueError("A model of the kind symoden has no friction; got a known `dissipation_matrix`. Remove it.")


def _kept(space: Space, known: KnownParts | None) -> tuple[int, ...]:
    """The coordinates that what is learned may depend on."""
    cyclic = () if known is None else known.cyclic
    return tuple(i for i in range(space.size) if f"q{i + 1}" not in cyclic)

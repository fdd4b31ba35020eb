"""Building models: every setting has its effect, sizes are what they should be, nonsense is refused."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from symoden.blocks import (
    ACTUATION,
    INERTIA,
    NETWORKS,
    AbstractBlock,
    Constant,
    Correction,
    GramBlock,
    Harmonics,
    InverseBlock,
    JointFriction,
    KnownValue,
    Network,
    NoFriction,
    Polynomial,
    ViscousFriction,
    count_parameters,
    trainable,
)
from symoden.experiments import preset
from symoden.models import KINDS, BlockConfig, ModelConfig, Scales, UnstructuredModel, build
from symoden.spaces import Space

NETWORK = BlockConfig(hidden=(5,))
BASE = ModelConfig(
    inverse_mass=NETWORK, potential=NETWORK, actuation=NETWORK, friction=NETWORK, energy=(6,), flow=(6,), knees=()
)
WIDER = BlockConfig(hidden=(7,))


def made(config, space="R1 T1", inputs=1, *, key=0, **others) -> Any:
    return build(config, Space.parse(space), inputs, key=jax.random.key(key), **others)


@eqx.filter_jit
def motion(model):
    q, rates, u = jnp.array([0.3, -0.7]), jnp.array([0.5, 1.1]), jnp.array([0.9])
    state = model.encode(q, rates)
    return jax.jvp(model.observe, (state,), (model.derivative(jnp.zeros(()), state, u),))[1]


def test_blocks_start_from_harmonics_on_angles_and_from_a_constant_or_a_polynomial_on_lengths():
    """Corrections are silent and frozen; on lengths alone M⁻¹ is a constant."""
    harmonic = BlockConfig(hidden=(5,), harmonics=True)
    config = dataclasses.replace(BASE, inverse_mass=harmonic, potential=harmonic)
    model = made(config)
    assert isinstance(model.inverse_mass, InverseBlock)
    assert isinstance(model.inverse_mass.matrix, GramBlock)
    kinds = [type(term) for term in model.potential.function.terms]
    assert kinds == [Harmonics, Correction, Correction]
    bare = dataclasses.replace(config, inverse_mass=BlockConfig(harmonics=True), potential=BlockConfig(harmonics=True))
    assert np.asarray(motion(made(bare))) == pytest.approx(np.asarray(motion(model)), abs=1e-12)
    assert count_parameters(made(bare), corrections=0) == count_parameters(model, corrections=0)
    assert count_parameters(made(bare)) < count_parameters(model)
    sliding = made(config, space="R2")
    assert [type(term) for term in sliding.inverse_mass.function.terms] == [Constant, Correction]
    assert [type(term) for term in sliding.potential.function.terms] == [Polynomial, Correction]
    assert isinstance(made(bare, space="R2").potential.function, Polynomial)


@pytest.mark.parametrize(("space", "degree"), [("R1", 4), ("R12", 4), ("R13", 3), ("R20", 3), ("R21", 2)])
def test_polynomials_of_many_lengths_stay_few(space, degree):
    config = dataclasses.replace(BASE, potential=BlockConfig(harmonics=True))
    function = made(config, space=space).potential.function
    assert function.degree == degree
    assert function.weights.size <= 2000


@pytest.mark.parametrize(("space", "orders"), [("T2", (2, 2)), ("T3", (3, 3)), ("T4", (2, 3)), ("R1 T5", (1, 1, 3))])
def test_harmonics_of_many_joints_stay_few(space, orders):
    """A step of second-order training costs the square of their number."""
    config = dataclasses.replace(BASE, inverse_mass=BlockConfig(harmonics=True), potential=BlockConfig(harmonics=True))
    model = made(config, space=space)
    functions = jax.tree.leaves((model.inverse_mass, model.potential), is_leaf=lambda node: isinstance(node, Harmonics))
    functions = [function for function in functions if isinstance(function, Harmonics)]
    assert tuple(function.order for function in functions) == orders
    assert all(function.weights.size <= 2000 for function in functions)


CHANGES = {
    "kind": ("dissipative", {"kind": "symoden"}),
    "inverse_mass": ("dissipative", {"inverse_mass": WIDER}),
    "potential": ("dissipative", {"potential": WIDER}),
    "actuation": ("dissipative", {"actuation": WIDER}),
    "friction": ("dissipative", {"friction": WIDER}),
    "energy": ("unstructured", {"energy": (7,)}),
    "flow": ("geometric", {"flow": (7,)}),
    "full_friction": ("dissipative", {"full_friction": True}),
    "activation": ("dissipative", {"activation": "tanh"}),
    "floor": ("dissipative", {"floor": 0.3}),
    "scaled": ("dissipative", {"scaled": False}),
}


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(ModelConfig) if field.name != "knees"])
def test_a_setting_changes_the_motion(name):
    kind, change = CHANGES[name]
    base = dataclasses.replace(BASE, kind=kind)
    before, after = (np.asarray(motion(made(config))) for config in (base, dataclasses.replace(base, **change)))
    assert np.isfinite(after).all()
    assert np.abs(after - before).max() > 1e-6


def test_knees_give_dry_friction_coefficients_of_its_own():
    model = made(dataclasses.replace(BASE, knees=(0.1, 1.0)))
    assert isinstance(model.friction, JointFriction)
    laws = jax.tree.leaves(model.friction.laws)
    assert [law.shape for law in laws] == [(2 * 5,)]
    assert not any(jax.tree.leaves(trainable(model, corrections=0).friction.laws))  # frozen until asked for
    freed = eqx.tree_at(lambda model: jax.tree.leaves(model.friction.laws), model, [jnp.ones(10)])
    assert np.abs(motion(freed) - motion(model)).max() > 1e-3


def test_dry_friction_may_be_as_sharp_as_that_of_a_precise_axis():
    friction = made(dataclasses.replace(BASE, knees=ModelConfig().knees)).friction
    assert isinstance(friction, JointFriction)
    still = eqx.tree_at(lambda f: f.viscous, friction, Constant(jnp.zeros(3)))
    first = jnp.zeros((2, JointFriction.shapes(friction.knees))).at[:, 0].set(1.0)
    dry = eqx.tree_at(lambda f: f.laws.function.values, still, first.ravel())
    speed, q = friction.speed.value, jnp.zeros(2)
    slow, usual = (np.diag(dry(q, v)) * v for v in (0.01 * speed, speed))
    assert np.all(slow > 0.9 * usual)


def test_arguments_of_build_change_the_motion():
    base = motion(made(BASE))
    units = Scales.units(Space.parse("R1 T1"), 1)
    for name in ("center", "spread", "velocity", "momentum", "input", "time"):
        scales = dataclasses.replace(units, **{name: 1.5 * getattr(units, name) + 0.25})
        momenta = name == "momentum"  # With velocities, it is the gauge and has no effect.
        before, after = (motion(made(BASE, momenta=momenta, scales=scales)) for scales in (units, scales))
        assert np.abs(after - before).max() > 1e-6, name
    assert np.abs(motion(made(BASE, key=1)) - base).max() > 1e-6
    assert np.abs(motion(made(BASE, momenta=True)) - base).max() > 1e-6
    assert np.abs(motion(made(BASE, input_matrix=np.array([[3.0], [0.0]]))) - base).max() > 1e-6


@pytest.mark.usefixtures("single_use_keys")
@pytest.mark.parametrize("kind", KINDS)
def test_the_same_key_gives_the_same_weights_and_any_number_of_inputs_fits(kind):
    config = dataclasses.replace(BASE, kind=kind)
    for inputs in (0, 1, 3):
        model = made(config, inputs=inputs)
        assert eqx.tree_equal(model, made(config, inputs=inputs))
        state = model.encode(jnp.ones(2), jnp.ones(2))
        assert np.isfinite(model.derivative(jnp.zeros(()), state, jnp.ones(inputs))).all()


class Perceptron(AbstractBlock):
    """A block of somebody's own, with a function among its leaves."""

    layers: eqx.nn.MLP

    def __call__(self, q):
        return self.layers(jnp.concatenate([jnp.cos(q), jnp.sin(q)]))


def test_blocks_may_have_leaves_that_are_no_arrays():
    layers = eqx.nn.MLP(2, "scalar", 4, 1, activation=jax.nn.softplus, key=jax.random.key(1), dtype=float)
    plain = build(ModelConfig(), Space.parse("T1"), 1, key=jax.random.key(0))
    model = eqx.tree_at(lambda one: one.potential, plain, Perceptron(layers))
    q, p = jnp.array([0.3]), jnp.array([0.5])
    assert model.potential_energy(q) == pytest.approx(float(model.potential(q)), rel=1e-12)
    slope = jax.grad(model.potential)(q)
    np.testing.assert_allclose(model.vector_field(q, 0 * p, jnp.zeros(1))[1], -slope, rtol=1e-9)


def test_a_known_input_matrix_is_kept_and_not_trained():
    g = np.array([[2.0], [0.0]])
    model = made(BASE, input_matrix=g)
    assert isinstance(model.actuation, KnownValue)
    assert np.asarray(model.input_matrix(jnp.ones(2))) == pytest.approx(g, abs=0)
    assert jax.tree.leaves(eqx.filter(model.actuation, trainable(model.actuation))) == []


def test_the_inertia_depends_on_lengths_by_a_correction():
    model = made(dataclasses.replace(BASE, inverse_mass=BlockConfig(hidden=(5,), harmonics=True)), space="R1 T1")
    terms = model.inverse_mass.matrix.function.terms
    assert [type(term) for term in terms] == [Harmonics, Correction, Correction]
    assert [(type(term.function), term.kind) for term in terms[1:]] == [(Harmonics, INERTIA), (Network, NETWORKS)]
    assert count_parameters(model, corrections=INERTIA) - count_parameters(model, corrections=0) == 12 * 3
    here, further = jnp.array([0.3, 0.5]), jnp.array([1.7, 0.5])
    assert np.asarray(model.mass_matrix(further)) == pytest.approx(np.asarray(model.mass_matrix(here)), abs=1e-14)
    moved = eqx.tree_at(
        lambda model: model.inverse_mass.matrix.function.terms[1].function.weights, model, jnp.ones((3, 12))
    )
    assert np.abs(moved.mass_matrix(further) - moved.mass_matrix(here)).max() > 0.1


def test_inputs_may_act_by_harmonics_where_there_are_angles():
    config = dataclasses.replace(BASE, actuation=BlockConfig(hidden=(5,), constant=True))
    model = made(config)
    terms = model.actuation.function.terms
    assert [type(term) for term in terms] == [Constant, Correction, Correction]
    assert [(type(term.function), term.kind) for term in terms[1:]] == [(Harmonics, ACTUATION), (Network, NETWORKS)]
    assert count_parameters(model, corrections=ACTUATION) - count_parameters(model, corrections=0) == 2 * 6
    constant = eqx.tree_at(lambda model: model.actuation.function, model, terms[0])
    assert np.asarray(motion(constant)) == pytest.approx(np.asarray(motion(model)), abs=1e-12)
    turned = eqx.tree_at(lambda model: jax.tree.leaves(model.actuation.function.terms[1])[0], model, jnp.ones((6, 2)))
    assert np.abs(motion(turned) - motion(model)).max() > 1e-3
    assert [type(term.function) for term in made(config, "R2").actuation.function.terms[1:]] == [Network]


def test_corrections_are_silent_and_frozen_at_first():
    corrected = dataclasses.replace(BASE, friction=BlockConfig(hidden=(5,), constant=True))
    constant = dataclasses.replace(BASE, friction=BlockConfig(constant=True))
    assert np.asarray(motion(made(corrected))) == pytest.approx(np.asarray(motion(made(constant))), abs=1e-12)
    model = made(corrected)
    frozen = jax.tree.leaves(eqx.filter(model, trainable(model, corrections=0)))
    free = jax.tree.leaves(eqx.filter(model, trainable(model)))
    assert sum(x.size for x in free) - sum(x.size for x in frozen) == 5 * 3 + 5 + 3 * 5 + 3


def test_each_kind_has_the_friction_of_its_name():
    assert isinstance(made(dataclasses.replace(BASE, kind="symoden")).friction, NoFriction)
    assert isinstance(made(BASE).friction, ViscousFriction)
    sizes = [
        made(dataclasses.replace(BASE, full_friction=full)).friction.matrix.scale.array.size for full in (False, True)
    ]
    assert sizes == [2, 4]


@pytest.mark.parametrize(
    ("task", "space", "momenta", "count"),
    [
        ("pendulum-canonical", "R1", True, 155_406),
        ("pendulum", "T1", False, 156_056),
        ("cartpole", "R1 T1", False, 529_116),
        ("acrobot", "T2", False, 530_216),
    ],
)
def test_the_paper_preset_has_the_paper_s_number_of_parameters(task, space, momenta, count):
    config, _ = preset("paper", task=task, kind="dissipative")
    counts = []

    def trace(key):
        counts.append(count_parameters(build(config, Space.parse(space), 1, momenta=momenta, key=key)))

    jax.eval_shape(trace, jax.random.key(0))
    assert counts == [count]


@pytest.mark.parametrize("space", ["R1", "T1", "R1 T1", "T2"])
def test_the_default_preset_stays_below_five_thousand_parameters(space):
    config, _ = preset("default", task=None, kind="dissipative")
    assert count_parameters(build(config, Space.parse(space), 2, key=jax.random.key(0))) < 5000


def test_the_unscaled_model_reads_raw_data():
    model = made(dataclasses.replace(BASE, scaled=False, kind="geometric"))
    assert np.asarray(model.flow.scale.array) == pytest.approx(1.0)
    assert np.asarray(model.flow.center.array) == pytest.approx(0.0)


def test_dry_friction_on_the_full_state_is_refused():
    with pytest.raises(ValueError, match="Set `knees=\\(\\)`"):
        dataclasses.replace(BASE, full_friction=True, knees=(0.1,))


def test_an_unknown_kind_is_refused():
    config = ModelConfig()
    object.__setattr__(config, "kind", "hamiltonian")  # Past the check of types, which tests switch on.
    with pytest.raises(ValueError, match="`kind` must be one of dissipative"):
        config.__post_init__()


def test_a_block_needs_parameters():
    with pytest.raises(ValueError, match="got none"):
        BlockConfig()
    with pytest.raises(ValueError, match="got both"):
        BlockConfig(constant=True, harmonics=True)
    with pytest.raises(ValueError, match="must be at least 1"):
        BlockConfig(hidden=(3, 0))


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        *[({"knees": (0.1, value)}, "Every speed in `knees`") for value in (0.0, -0.1, np.nan, np.inf)],
        *[({"floor": value}, "`floor` must be positive") for value in (-0.1, 0.0, np.nan, np.inf)],
        ({"activation": "relu6"}, "`activation` must be one of tanh, silu, gelu, softplus, sin, or None"),
    ],
    ids=str,
)
def test_numbers_and_names_that_no_model_has_are_refused(setting: dict[str, Any], message):
    with pytest.raises(ValueError, match=message):
        ModelConfig(**setting)
    ModelConfig(knees=(1e-3, 10.0), floor=1e-9, activation="gelu")


def test_an_input_matrix_has_a_row_for_each_coordinate():
    with pytest.raises(ValueError, match="2 × 1; got \\(1, 2\\)"):
        made(BASE, input_matrix=np.ones((1, 2)))


def test_velocity_data_need_an_inertia():
    model = made(dataclasses.replace(BASE, kind="unstructured"), momenta=True)
    assert isinstance(model, UnstructuredModel)
    with pytest.raises(ValueError, match="Velocity data need `inverse_mass`"):
        dataclasses.replace(model, momenta=False)


def test_the_inertia_of_an_unstructured_model_of_momenta_is_read_off_its_energy():
    model = made(dataclasses.replace(BASE, kind="unstructured"), momenta=True)
    q = jnp.array([0.3, 0.4])
    hessian = jax.hessian(lambda p: model.hamiltonian(q, p))(jnp.zeros(2))
    assert np.asarray(model.inverse_mass_matrix(q)) == pytest.approx(np.asarray(hessian), abs=1e-12)


@pytest.mark.parametrize("name", ["joint", "unstructured"])
def test_a_configuration_of_another_size_is_refused(name, small_model):
    model = small_model(name)  # on T1 R1
    for wrong in (jnp.array([0.3]), jnp.zeros(3)):
        with pytest.raises(ValueError, match=r"`q` must have the shape \(2,\), one number per coordinate of T1 R1"):
            model.mass_matrix(wrong)


def test_a_model_takes_lists_of_numbers(small_model):
    model, q, v = small_model("joint"), [0.3, -1], [1, 0.5]
    there, at = jnp.array(q), jnp.array(v)
    assert jnp.array_equal(model.mass_matrix(q), model.mass_matrix(there))
    assert jnp.array_equal(model.potential_energy(tuple(q)), model.potential_energy(q=there))
    assert jnp.array_equal(model.dissipation_matrix(q, v=v), model.dissipation_matrix(there, at))
    with pytest.raises(TypeError, match="too many positional arguments"):
        model.dissipation_matrix(q, v, v)
    with pytest.raises(ValueError, match="`q` must be an array of numbers; got 'up'"):
        model.mass_matrix("up")

"""What was tried is what runs on the machine: controllers survive their files, and act as before."""

import re
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from symoden import control
from symoden.control import (
    AbstractController,
    CollocatedPump,
    Compiled,
    ControlledLagrangian,
    EnergyPump,
    EnergyShaping,
    Follower,
    Handover,
    IdaPbc,
    Regulator,
    Tracking,
    load_controller,
    save_controller,
)
from symoden.control._expansion import Expansion
from symoden.models import save
from symoden.storage import StorageError, load_arrays, save_arrays

from .conftest import PENDULUM


def numbers(*shape):
    """An array of distinct numbers."""
    return jnp.asarray(np.linspace(0.5, 1.5, int(np.prod(shape))).reshape(shape))


@pytest.fixture
def controllers(learned):
    """One of each class: of a learned pendulum, and of a learned cart and pole."""
    one, two = learned("T1", 1, 0), learned("R1 T1", 1, 1)
    near = Regulator(
        configurations=one.space,
        **{name: numbers(1) for name in ("target", "fastest", "hold", "limits")},
        **{name: numbers(2, 2) for name in ("cost", "state_weight")},
        gain=numbers(1, 2),
        input_weight=numbers(1, 1),
    )
    shaped = EnergyShaping.of(one, [0.3], limits=20.0)
    goal, scalar, limits = numbers(2), numbers(), numbers(1)
    field = Expansion(two.space, goal, numbers(1, 2), 2)
    field = eqx.tree_at(lambda each: each.coefficients, field, numbers(len(field.degrees()), 2))
    shape = eqx.tree_at(lambda each: each.coefficients, field, field.coefficients[:, :1])
    pump = {"energy": scalar, "steepness": scalar, "speed": scalar, "limits": limits}
    plan = {"x": numbers(3, 2), "u": numbers(3, 1), "gain": numbers(3, 1, 2), "cost": numbers(3, 2, 2)}
    calm = {"level": scalar, "stiffness": numbers(1, 1), "damping": numbers(1, 1), "limits": limits}
    on_cart = {"model": two, "target": goal, "limits": limits}
    return [
        near,
        shaped,
        Handover(far=shaped, near=near, level=scalar, limits=limits),
        EnergyPump(model=one, target=numbers(1), swung=0, **pump),
        Follower(model=one, **plan, **calm),
        CollocatedPump(actuated=0, energy=scalar, energy_range=scalar, gains=numbers(7), **on_cart),
        IdaPbc(field=field, shape=shape, ratio=scalar, damping=numbers(1, 1), reach=goal, **on_cart),
        ControlledLagrangian(actuated=0, gains=numbers(4), top=scalar, **on_cart),
    ]


def test_every_controller_comes_back_and_acts_as_before(controllers, tmp_path):
    classes = {
        each for each in vars(control).values() if isinstance(each, type) and issubclass(each, AbstractController)
    }
    assert classes - {AbstractController, Tracking} == {type(each) for each in controllers}
    for controller in controllers:
        save_controller(tmp_path / "it.safetensors", controller)
        copy = load_controller(tmp_path / "it.safetensors")
        assert eqx.tree_equal(controller, copy), type(controller).__name__
        state = 0.1 * np.ones(controller.space.size), np.zeros(controller.space.size)
        assert Compiled(copy)(*state).tolist() == Compiled(controller)(*state).tolist(), type(controller).__name__


def test_code_is_no_data(learned, tmp_path):
    model = learned("T1", 1, 0)
    follows = Tracking.of(model, lambda t: jnp.sin(t)[None], limits=3.0)
    for controller, what in (
        (follows, r"`controller.reference` must be data to be saved; got function, which is code\. Make it anew where"),
        (EnergyShaping.of(PENDULUM, [0.0], limits=15.0), "`controller.model` must be data to be saved; got Pendulum"),
    ):
        with pytest.raises(StorageError, match=what):
            save_controller(tmp_path / "it.safetensors", controller)
    assert not list(tmp_path.iterdir())


def test_other_files_and_controllers_that_do_not_fit_together_are_refused(learned, controllers, tmp_path):
    path = tmp_path / "it.safetensors"
    save(path, learned("T1", 1, 0))
    with pytest.raises(
        StorageError, match=r"must be a controller file of format symoden-controller-1; got 'symoden-model-1'"
    ):
        load_controller(path)
    save_controller(path, controllers[0])
    arrays, metadata = load_arrays(path)
    save_arrays(path, {**arrays, "controller.gain": np.zeros((1, 3))}, metadata)
    with pytest.raises(StorageError, match="must describe a controller of this version"):
        load_controller(path)
    save_arrays(path, arrays, {**metadata, "structure": metadata["structure"]["fields"]["configurations"]})
    with pytest.raises(StorageError, match="the structure is a Space, not a controller"):
        load_controller(path)


def test_the_loop_of_the_documentation_runs_on_a_machine(learned, tmp_path, monkeypatch):
    model = learned("T1", 1, 0)
    save_controller(tmp_path / "upright.safetensors", EnergyShaping.of(model, [0.3], limits=20.0))
    (tmp_path / "runs" / "arm").mkdir(parents=True)
    save(tmp_path / "runs" / "arm" / "model.safetensors", model)
    text = Path(__file__).parents[2].joinpath("docs", "control.md").read_text("utf-8").split("## On the machine")[1]
    plain, filtered = re.findall(r"```python\n(.*?)```", text.split("## Which method")[0], flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    sent = []

    def measure():
        return np.array([0.3 if len(sent) % 2 else np.nan]), np.array([0.1])

    names = {"measure": measure, "send": sent.append, "running": lambda: len(sent) % 5 < 4}
    exec(compile(plain, "docs/control.md", "exec"), names)
    assert [u.item() == 0.0 for u in sent] == [True, False, True, False]
    sent.append(np.zeros(1))  # Once more.
    names["measure"] = lambda: (np.array([0.3]), np.array([0.1]))
    exec(compile(filtered, "docs/control.md", "exec"), names)
    assert len(sent) == 9
    assert 0 < np.abs(sent[-1]).item() <= 20.0

"""What brings the gain: one factor at a time, on tasks 3 and 4, dissipative model, default preset otherwise.

    python benchmarks/ablation.py [--out runs/ablation] [TASK ...]

Every finished training is kept, so that an interrupted run goes on where it was. The table is printed in Markdown.
"""

import argparse
import contextlib
import dataclasses
import json
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final
from unittest import mock

import equinox as eqx
import jax
import jax.numpy as jnp

from symoden.blocks import count_parameters
from symoden.experiments import block_errors, read_source, score_task
from symoden.integrate import RK4
from symoden.mechanics import AbstractDynamics
from symoden.models import BlockConfig, ModelConfig, StructuredModel, build, embedded_vector_field
from symoden.shapes import Coordinates, Inputs, Observation, Rates, Scalar, State
from symoden.storage import write_atomically
from symoden.training import TrainingConfig, TrainingError, fit
from symoden.training._gauss_newton import Linearization


@final
class Embedded(AbstractDynamics):
    """The paper's way: the state is the observation (r, cos φ, sin φ, q̇), and leaves the circles by and by.

    Attributes:
        model: What gives M⁻¹, V, g and D.
    """

    model: StructuredModel

    @property
    def space(self) -> Any:  # noqa: ANN401 - as in the model
        """Configuration space."""
        return self.model.space

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return self.model.inputs

    @property
    def momenta(self) -> bool:
        """Whether the rates in the data are momenta."""
        return self.model.momenta

    def encode(self, q: Coordinates, rates: Rates) -> State:
        """The observation."""
        return jnp.concatenate([self.space.embed(q), rates])

    def derivative(self, t: Scalar, state: State, u: Inputs) -> State:
        """The paper's right-hand side."""
        del t
        return embedded_vector_field(self.model, state, u)

    def decode(self, state: State) -> tuple[Coordinates, Rates]:
        """Nearest configuration, and rates."""
        embedding, rates = jnp.split(state, [self.space.embedded_size])
        return self.space.project(embedding), rates

    def observe(self, state: State) -> Observation:
        """The state itself."""
        return state


@dataclass(frozen=True)
class Variant:
    """One change to the default.

    Attributes:
        name: What the table calls it.
        model: Changed settings of the model.
        training: Changed settings of training.
        change: What to do with an untrained model.
        patches: Constants of the optimiser to change, by their full names.
    """

    name: str
    model: dict[str, Any] = field(default_factory=dict)
    training: dict[str, Any] = field(default_factory=dict)
    change: Callable[[Any], AbstractDynamics] | None = None
    patches: dict[str, Any] = field(default_factory=dict)


def with_free_dry_friction(model: StructuredModel) -> StructuredModel:
    """Train the coefficients of dry and quadratic friction from the start; other corrections stay frozen."""
    return eqx.tree_at(lambda model: model.friction.laws, model, model.friction.laws.function)  # pyright: ignore[reportAttributeAccessIssue]


def in_double(*problem: Any) -> Linearization:  # noqa: ANN401 - as `Linearization.at`
    """J in double precision; the default has it in single."""
    return dataclasses.replace(_AT(*problem), precision=float)


def networks(*hidden: int) -> dict[str, BlockConfig]:
    """M⁻¹ and V as networks of this size, without harmonics."""
    return {"inverse_mass": BlockConfig(hidden=hidden), "potential": BlockConfig(hidden=hidden)}


_AT = Linearization.at
_NETWORK = BlockConfig(hidden=(16, 16))
_LONG = {"lm_steps": 0, "restarts": 1, "adam_steps": 10000}
VARIANTS = (
    Variant("default"),
    Variant("Adam alone, 3 × 600 steps", training={"lm_steps": 0}),
    Variant("Levenberg-Marquardt alone", training={"adam_steps": 0}),
    Variant("M⁻¹ and V as networks of 16, 16", networks(16, 16)),
    Variant("these with tanh for silu", networks(16, 16) | {"activation": "tanh"}),
    Variant("these with sin for silu", networks(16, 16) | {"activation": "sin"}),
    Variant("M⁻¹ and V as networks of 8, 8", networks(8, 8)),
    Variant("M⁻¹ and V as networks of 32, 32", networks(32, 32)),
    Variant("g and D as networks", {"actuation": _NETWORK, "friction": _NETWORK, "knees": ()}),
    Variant("full friction, 2n × 2n", {"full_friction": True, "knees": ()}),
    Variant("dry friction free from the start", change=with_free_dry_friction),
    Variant("embedded integration", change=lambda model: Embedded(model=model)),  # pyright: ignore[reportCallIssue]
    Variant("no acceleration", patches={"symoden.training._levenberg_marquardt._LARGEST_BEND": 0.0}),
    Variant("J in double precision", patches={"symoden.training._gauss_newton.Linearization.at": in_double}),
    Variant("one start of Adam", training={"restarts": 1}),
    Variant("Adam alone, 10 000 steps", training=_LONG),
    Variant("Adam alone, 10 000 steps, networks of 64, 64", networks(64, 64), _LONG),
)


@contextlib.contextmanager
def changed(variant: Variant) -> Iterator[None]:
    """Apply what no setting reaches."""
    patches = dict(variant.patches)
    change = variant.change
    if change is not None:
        patches["symoden.training._fit.build"] = lambda *args, **kwargs: change(build(*args, **kwargs))
    with contextlib.ExitStack() as stack:
        for name, value in patches.items():
            stack.enter_context(mock.patch(name, value))
        yield
        eqx.clear_caches()  # Compiled functions would go on with the constants of this variant.


def measure(task: str, variant: Variant) -> dict[str, Any]:
    """Train and score once; errors are infinite where no model came of it."""
    source = read_source(task)
    model, training = ModelConfig(**variant.model), TrainingConfig(**variant.training)
    with changed(variant):
        try:
            result = fit(source.dataset, model=model, config=training)
        except TrainingError:
            failed = dict.fromkeys(("test_error", "prediction_error", "seconds"), math.inf)
            return {"task": task, "variant": variant.name, "parameters": 0, "blocks": None} | failed
        score = score_task(result.model, source, solver=RK4(4))
    learned = result.model.model if isinstance(result.model, Embedded) else result.model
    blocks = block_errors(learned, source)
    return {
        "task": task,
        "variant": variant.name,
        "parameters": count_parameters(result.model),
        "test_error": score.test.mean,
        "prediction_error": score.prediction.mean,
        "seconds": result.seconds,
        "blocks": None if blocks is None else dataclasses.asdict(blocks),
    }


def main() -> None:
    """Measure what is not measured yet, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", default=["cartpole", "acrobot"])
    parser.add_argument("--out", type=Path, default=Path("runs/ablation"))
    arguments = parser.parse_args()
    rows = []
    for variant in VARIANTS:
        for task in arguments.tasks:
            slug = re.sub(r"[^a-z0-9]+", "-", variant.name.lower())
            file = arguments.out / f"{task}-{slug}.json"
            if not file.exists():
                write_atomically(file, json.dumps(measure(task, variant), indent=2).encode())
            row = json.loads(file.read_text())
            rows.append(row)
            print(f"{task}, {variant.name}: {row['prediction_error']:.2g}", flush=True)
    print("\n| task | variant | parameters | test error | prediction error | seconds |\n|---|---|---|---|---|---|")
    for row in sorted(rows, key=lambda row: arguments.tasks.index(row["task"])):
        errors = f"{row['test_error']:.2g} | {row['prediction_error']:.2g}"
        print(f"| {row['task']} | {row['variant']} | {row['parameters']} | {errors} | {row['seconds']:.0f} |")


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)  # noqa: FBT003 - JAX's signature
    main()

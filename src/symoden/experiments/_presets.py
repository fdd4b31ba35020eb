"""Presets: what we recommend, and what the paper did."""

from typing import NamedTuple

from symoden.models import BlockConfig, Kind, ModelConfig
from symoden.training import TrainingConfig

PRESETS = ("default", "paper")
"""Names of the presets: our settings and the paper's."""


class _PaperSizes(NamedTuple):
    """Hidden widths of the authors' networks, and the settings of their optimiser, for one task."""

    inverse_mass: tuple[int, ...]
    potential: int
    actuation: int
    energy: int
    naive: int
    geometric: int
    learning_rate: float
    weight_decay: float


# Facts of the authors' published experiments (Zhong, Dey & Chakraborty 2020). Matrices of size 2 or more have three
# hidden layers. The paper has no geometric baseline in task 1; task 2's size stands in.
_PAPER = {
    "pendulum-canonical": _PaperSizes((300, 300), 50, 200, 400, 600, 600, 1e-3, 1e-4),
    "pendulum": _PaperSizes((300, 300), 50, 200, 500, 800, 600, 1e-3, 1e-4),
    "cartpole": _PaperSizes((400, 400, 400), 300, 300, 500, 1000, 700, 1e-4, 1e-4),
    "acrobot": _PaperSizes((400, 400, 400), 300, 300, 600, 1200, 800, 1e-4, 5e-5),
}
_LARGEST = "cartpole"


def preset(name: str, *, task: str | None, kind: Kind) -> tuple[ModelConfig, TrainingConfig]:
    """Settings of a preset.

    Args:
        name: "default": small networks, Adam, then Levenberg-Marquardt, the same for every mechanism. "paper": the
            authors' sizes, data order, loss and optimiser.
        task: Name of the task; the paper's sizes depend on it, and for other data they are those of its cart-pole.
        kind: Which of the five models.

    Returns:
        Settings of the model and of training.

    Raises:
        ValueError: If there is no such preset.

    Example:
        >>> model, training = preset("paper", task="pendulum", kind="dissipative")
        >>> model.inverse_mass.hidden, training.adam_steps
        ((300, 300), 5000)
    """
    if name == "default":
        return ModelConfig(kind=kind), TrainingConfig()
    if name != "paper":
        raise ValueError(f"A preset must be one of {', '.join(PRESETS)}; got {name!r}.")
    sizes = _PAPER.get((task or _LARGEST).removesuffix("-full"), _PAPER[_LARGEST])
    model = ModelConfig(
        kind=kind,
        inverse_mass=BlockConfig(hidden=sizes.inverse_mass),
        potential=BlockConfig(hidden=(sizes.potential,) * 2),
        actuation=BlockConfig(hidden=(sizes.actuation,) * 2),
        friction=BlockConfig(hidden=(100,) * 3),
        energy=(sizes.energy,) * 2,
        flow=(sizes.naive if kind == "naive" else sizes.geometric,) * 2,
        full_friction=True,
        knees=(),
        activation="tanh",
        floor=0.1,
        scaled=False,
    )
    training = TrainingConfig(
        validation=0.0,
        horizon=3,
        unroll=True,
        restarts=1,
        adam_steps=5000,
        batch_size=1088,
        shuffle=False,
        learning_rate=sizes.learning_rate,
        cosine=False,
        clip=None,
        weight_decay=sizes.weight_decay,
        keep_best=False,
        scaled_loss=False,
        lm_steps=0,
    )
    return model, training

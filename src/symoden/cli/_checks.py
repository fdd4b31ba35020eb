"""What can be refused of a command before JAX is imported and anything is read. Nothing here imports JAX."""

import math
from typing import Final

from symoden.wording import LEARNED

from ._arguments import Control
from ._figure import check_figure

METHODS: Final = (
    "energy-shaping",
    "energy-shaping+lqr",
    "ida-pbc",
    "controlled-lagrangian",
    "swing-up",
    "tracking",
    "lqr",
)
"""Names of all methods of control; a test compares them."""


def check_control(command: Control) -> None:
    """Refuse options of `symoden control` that no run can make right.

    Args:
        command: What to do.

    Raises:
        ValueError: If one is out of range, or two contradict each other.
    """
    check_figure(command.figure)
    if command.method is not None and command.method not in METHODS:
        raise ValueError(f"`--method` must be one of {', '.join(METHODS)}; got {command.method!r}.")
    if command.episodes < 1 or command.seed < 0:
        raise ValueError(f"`--episodes` must be at least 1, `--seed` 0; got {command.episodes} and {command.seed}.")
    if not all(limit > 0 for limit in command.max_input):
        raise ValueError(f"`--max-input` must be positive; got {', '.join(map(str, command.max_input))}.")
    if not (0 < command.period <= command.duration < math.inf):
        raise ValueError(
            "`--period` must be positive, and `--duration` at least one period; got "
            f"{command.period} and {command.duration} s."
        )
    for option, given in (
        ("--noise", command.noise),
        ("--delay", command.delay or 0.0),
        *(("--lag", T) for T in command.lag),
    ):
        if not 0 <= given < math.inf:
            raise ValueError(f"`{option}` must be at least 0; got {given}.")
    _check_out(command)
    _check_machine(command)


def _check_out(command: Control) -> None:
    """Refuse a file that the controller cannot be written to."""
    if command.out is None:
        return
    if command.out.suffix.lower() != ".safetensors":
        raise ValueError(f"`--out` must end in .safetensors; got `{command.out}`.")
    if command.out.resolve().parent == command.run.resolve():
        raise ValueError(f"`--out` must not lie in the run's own folder; got `{command.out}`. Choose another one.")
    if command.method == "tracking":
        raise ValueError(
            "`--out` cannot hold a tracking controller: the motion that it follows is a function of yours. Make it "
            'in Python: `symoden.design(model, target, method="tracking", reference=…)`.'
        )


def _check_machine(command: Control) -> None:
    """Refuse what contradicts the machine."""
    if command.video is not None and command.video.suffix.lower() != ".gif":
        raise ValueError(f"`--video` must end in .gif; got `{command.video}`.")
    if command.video is not None and (command.target or command.env == LEARNED):
        raise ValueError("`--video` needs a simulated machine: how a learned one looks is not known. Use `--figure`.")
    if command.target and command.env not in (None, LEARNED):
        raise ValueError(
            f"`--target` is for the learned model; {command.env} goes to where it is upright. Leave one of them out."
        )
    if any(isinstance(place, float) and math.isnan(place) for place in command.target):
        raise ValueError("`--target` must be finite numbers, or - where a coordinate is free; got nan.")
    if command.env == LEARNED and not command.target:
        raise ValueError("The learned model needs `--target`: where to go, a number for each coordinate [rad or m].")

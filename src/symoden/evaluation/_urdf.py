"""A learned robot as a URDF file."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import nnls

from symoden.blocks import Links
from symoden.known import Identified, Robot, rewrite_urdf
from symoden.mechanics import AbstractDynamics, friction_matrix
from symoden.models import StructuredModel, given_parts, parts_that_fix_the_scale
from symoden.shapes import Coordinates, Velocities
from symoden.storage import write_atomically

from ._inspect import identified_parameters
from ._ranges import Ranges

_STATES: Final = 512
_SLOWEST: Final = 0.1  # Of the largest velocity: below, dry friction is rounded off.
_MISSED: Final = 0.2  # Of the friction force: two numbers that miss more of it do not tell it.
_NOTHING: Final = 1e-9  # Of the largest force: rounding.
_SAME: Final = 1e-4  # [m], and of unit vectors; single precision.


@dataclass(frozen=True, kw_only=True)
class IdentifiedJoint:
    """What was found of a joint, beside what its body weighs.

    Attributes:
        joint: Its name.
        drive: Inertia of its drive as seen at the joint [kg m², or kg]. A URDF has no place for it.
        damping: Viscous friction [N m s/rad, or N s/m]; None where friction is not written.
        friction: Dry friction [N m, or N]; None likewise.
        missed: Root mean square of the friction force that these two numbers miss, relative to that of all of it; None
            where the joint does not move, or no ranges are known.
    """

    joint: str
    drive: float
    damping: float | None
    friction: float | None
    missed: float | None


def write_urdf(
    path: Path | str,
    model: AbstractDynamics,
    robot: Robot,
    *,
    ranges: Ranges | None = None,
    bands: Mapping[str, float] = MappingProxyType({}),
) -> tuple[IdentifiedJoint, ...]:
    """Write what a model learned of a robot into a copy of the robot's URDF file; all else in it stays.

    Each link that moves gets the identified mass, centre of mass and moments of inertia. Links that hang together by
    joints that stand still share what was found of their body (`rewrite_urdf` says how). A joint's <dynamics> get the
    damping and the dry friction of the line that is closest to its learned friction force over the data's range, where
    they miss no more than a fifth of it; the friction of other joints stays as it is in the file. The inertia of drives
    and what corrects M and V beyond rigid bodies have no place in a URDF: a comment in the file says what they are.

    Args:
        path: File to write; not the robot's own.
        model: Model that learned the robot.
        robot: The robot that it was given, as `read_urdf` reads it, or `known.robot` of a data set has it.
        ranges: Ranges of the training data, over which friction is looked at; friction is not written if None.
        bands: Half widths of the bands of identified numbers, by name, as `Certainty.identified` has them: the comment
            lists numbers that the data do not tell, with their bands.

    Returns:
        What was found of each joint, from the base outwards.

    Raises:
        ValueError: If the model is none of this robot, the robot's file cannot be read, or it would be overwritten.
    """
    if not isinstance(model, StructuredModel) or model.parameters is None or model.parameters.links is None:
        raise ValueError(
            "A URDF can be written of a model that was given a robot; this one was not. Train one with "
            '`robot = "arm.urdf"` under [known].'
        )
    links = model.parameters.links
    _refuse_other(Path(path), links, robot)
    frictions = [None] * len(links.joints) if ranges is None else _frictions(model, ranges)
    joints = tuple(
        _joint(name, float(drive), frictions[coordinate])
        for name, drive, coordinate in zip(links.joints, links.drives, links.coordinates, strict=True)
    )
    identified = {
        joint.joint: Identified(
            inertia=tuple(map(tuple, np.asarray(inertia, float).tolist())),
            damping=joint.damping,
            friction=joint.friction or 0.0,
        )
        for joint, inertia in zip(joints, links.inertias, strict=True)
    }
    comment = [*_comment(model, joints, links.prismatic, looked=ranges is not None), *_untold(model, bands)]
    try:
        text = rewrite_urdf(robot, identified, comment=comment)
    except OSError as error:
        raise ValueError(f"`{robot.file}` cannot be read: {error.strerror or error}. Move it back.") from None
    except ValueError as error:
        raise ValueError(f"`{robot.file}`: {error}") from None
    write_atomically(path, text)
    return joints


def _refuse_other(path: Path, links: Links, robot: Robot) -> None:
    """Refuse another robot than the model's, and to write over its file."""
    if robot.file is None:
        raise ValueError("The robot must come from a URDF file to be written to one. Read it by `read_urdf`.")
    if path.resolve() == robot.file.resolve():
        raise ValueError(
            f"`{path}` must not be the file that the robot was read from: what was learned began there. Choose another."
        )
    tree = [(each.joint, each.coordinate, each.parent, each.prismatic) for each in robot.bodies]
    axes, origins = (np.array([getattr(each, name) for each in robot.bodies], float) for name in ("axis", "origin"))
    if (
        tree != [*zip(links.joints, links.coordinates, links.parents, links.prismatic, strict=True)]
        or not np.allclose(np.asarray(links.axes.array), axes, atol=_SAME)
        or not np.allclose(np.asarray(links.origins.array), origins, atol=_SAME)
    ):
        raise ValueError(
            f"`{robot.file}` must be the robot that the model was given, with its joints {', '.join(links.joints)} "
            "where they were; it is another one. Restore the file, or what `joints` and `at` say of it."
        )


def _joint(name: str, drive: float, friction: tuple[float, float, float] | None) -> IdentifiedJoint:
    """What was found of a joint, friction left out where two numbers do not tell it."""
    damping, dry, missed = friction or (None, None, None)
    if missed is None or missed > _MISSED:
        damping = dry = None
    return IdentifiedJoint(joint=name, drive=drive, damping=damping, friction=dry, missed=missed)


def _frictions(model: StructuredModel, ranges: Ranges) -> list[tuple[float, float, float] | None]:
    """Damping and dry friction of each coordinate, and what they miss; None for one that does not move."""
    n = model.space.size
    low, high = np.concatenate([ranges.configurations(model.space), np.asarray(ranges.rates).T], axis=1)
    states = np.random.default_rng(0).uniform(low, high, (_STATES, 2 * n))
    q, v = np.split(states, 2, axis=1)
    if model.momenta:
        v = np.asarray(jax.vmap(lambda q, p: model.inverse_mass_matrix(q) @ p)(jnp.asarray(q), jnp.asarray(v)))
    speeds = np.abs(v).max(axis=0)
    found: list[tuple[float, float, float] | None] = []
    for i, coefficients in enumerate(np.asarray(_diagonals(model, jnp.asarray(q), jnp.asarray(v))).T):
        fast = np.abs(v[:, i]) >= _SLOWEST * speeds[i]
        if not speeds[i] > 0:
            found.append(None)
            continue
        features = np.stack([v[fast, i], np.sign(v[fast, i])], axis=1)
        force = coefficients[fast] * v[fast, i]
        numbers, missed = nnls(features / [speeds[i], 1.0], force)
        size = float(np.linalg.norm(force))
        damping, dry = np.where(numbers > _NOTHING * np.abs(force).max(), numbers / [speeds[i], 1.0], 0.0).tolist()
        found.append((damping, dry, missed / size if size > 0 else 0.0))
    return found


@eqx.filter_jit
def _diagonals(model: StructuredModel, q: Float[Array, "K n"], v: Float[Array, "K n"]) -> Float[Array, "K n"]:
    """Diagonal elements of D, each while its joint alone moves."""

    def one(q: Coordinates, v: Velocities) -> Float[Array, " n"]:
        return jnp.diag(jax.vmap(lambda v: jnp.diag(friction_matrix(model, q, v)))(jnp.diag(v)))

    return jax.vmap(one)(q, v)


def _comment(
    model: StructuredModel, joints: Sequence[IdentifiedJoint], prismatic: Sequence[bool], *, looked: bool
) -> Iterator[str]:
    """What the file cannot say otherwise."""
    yield "Identified by symoden: mass, centre of mass and moments of inertia of the links that move."
    yield "Inertia of the drives as seen at the joints, for which there is no place here; simulators that know it as"
    yield "reflected inertia or armature add it to the diagonal of the mass matrix:"
    for joint, slides in zip(joints, prismatic, strict=True):
        yield f"  {joint.joint}: {joint.drive:.6g} {'kg' if slides else 'kg m^2'}"
    if looked:
        yield "Damping and friction are those of the line that is closest to each joint's friction force. It misses"
        for joint in joints:
            yield f"  {joint.joint}: {_missed(joint)}"
    corrected = [name for name, how in given_parts(model).items() if how == "given up to a correction"]
    if lacks := [name for name in corrected if name in ("mass_matrix", "potential_energy")]:
        yield f"Without what the model adds to rigid bodies: {', '.join(lacks)}."
    if not parts_that_fix_the_scale(model):
        yield "Nothing fixed the unit of forces: it is that in which the links weigh on the whole what they did before."


def _untold(model: StructuredModel, bands: Mapping[str, float]) -> Iterator[str]:
    """Numbers of the links whose bands are wider than they are themselves."""
    found = identified_parameters(model)
    wide = [f"  {name}: {found[name]:.4g} +- {width:.2g}" for name, width in bands.items() if width > abs(found[name])]
    if wide:
        yield "Of these numbers the data hardly tell even the size (90 % bands). Motion depends on combinations of"
        yield "them, which are certain where the bands of M and V are narrow (symoden inspect):"
        yield from wide


def _missed(joint: IdentifiedJoint) -> str:
    """How much of a joint's friction two numbers miss."""
    if joint.missed is None:
        return "all, because the joint did not move: its friction is not written"
    return f"{joint.missed:.1%} of it{'' if joint.damping is not None else ': its friction is not written'}"

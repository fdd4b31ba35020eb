"""Rigid bodies on joints, read from a URDF file: the kinematics are given, what the bodies weigh is a first guess."""

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, NamedTuple, TypeAlias

import numpy as np

Vector: TypeAlias = tuple[float | int, ...]
Matrix: TypeAlias = tuple[Vector, ...]

GRAVITY: Final = (0.0, 0.0, -9.81)
"""Acceleration of free fall where z points upwards [m/s²]."""

_MOVING: Final = ("revolute", "continuous", "prismatic")
_LARGEST: Final = 10**7  # Bytes of a file.
_THINNEST: Final = 1e-3  # Least second moment of a body's mass beside its largest: a rod's.
_FARTHEST: Final = 1e6  # A joint's value [rad or m].
_SMALLEST: Final = 1e-3  # Least radius of gyration [m].


@dataclass(frozen=True, kw_only=True)
class Body:
    """What moves with one joint.

    Attributes:
        joint: The joint's name.
        coordinate: Number of its coordinate.
        parent: Number of the body that carries it, which stands before it; -1 for the base.
        prismatic: It slides along its axis instead of turning about it.
        axis: The axis, of length one, in the frame of the joint.
        origin: Frame of the joint at coordinate zero in that of the parent's, 4 × 4.
        inertia: Pseudo-inertia ∫ x xᵀ dm of (x, y, z, 1) in the frame of the joint, 4 × 4 [kg m², kg m, kg].
        drive: Inertia of its drive as seen at the joint [kg m², or kg]; None where nothing is known of it.

    Raises:
        ValueError: If the drive has no positive inertia.
    """

    joint: str
    coordinate: int
    parent: int
    prismatic: bool
    axis: Vector
    origin: Matrix
    inertia: Matrix
    drive: float | int | None = None

    def __post_init__(self) -> None:
        """Refuse a drive that cannot be."""
        if self.drive is not None and not (np.isfinite(self.drive) and self.drive > 0):
            raise ValueError(f"joint `{self.joint}`: its drive must have a positive inertia; got {self.drive:g}.")


@dataclass(frozen=True, kw_only=True)
class Robot:
    """Rigid bodies on joints. Kinematics are given; masses, centres and inertias are where learning starts from.

    Attributes:
        bodies: From the base outwards.
        gravity: Acceleration of free fall in the frame of the base [m/s²].
        file: What it was read from, for `write_urdf`; None where nothing was.
        at: Where joints of the file stand that are no coordinates [rad or m]; at zero where nothing is said.
    """

    bodies: tuple[Body, ...]
    gravity: Vector = GRAVITY
    # Neither changes what is learned: `Dataset.digest`, which is made of what is printed, stays as it is without them.
    file: Path | None = field(default=None, repr=False, compare=False)
    at: Mapping[str, float | int] = field(default_factory=dict, repr=False, compare=False)

    def with_drives(self, inertias: Sequence[float | int]) -> "Robot":
        """The same robot with other drives.

        Args:
            inertias: That of each body's drive [kg m², or kg].

        Returns:
            The robot.
        """
        pairs = zip(self.bodies, inertias, strict=True)
        return replace(self, bodies=tuple(replace(body, drive=float(inertia)) for body, inertia in pairs))


class Joint(NamedTuple):
    """A joint as the file has it."""

    name: str
    kind: str
    parent: str
    child: str
    origin: np.ndarray
    axis: np.ndarray
    mimics: str


class Assembly(NamedTuple):
    """Links of a file on the bodies that move.

    Attributes:
        bodies: The joint of each body, from the base outwards, the number of the body that carries it (-1 for the
            base), and where on that.
        links: Pseudo-inertia of each link in its own frame.
        carried: The body that each link which hangs on a joint belongs to, and where on it, from the base outwards.
    """

    bodies: list[tuple[Joint, int, np.ndarray]]
    links: dict[str, np.ndarray]
    carried: dict[str, tuple[int, np.ndarray]]

    def inertias(self) -> list[np.ndarray]:
        """Pseudo-inertia of each body in the frame of its joint."""
        found = [np.zeros((4, 4)) for _ in self.bodies]
        for link, (body, frame) in self.carried.items():
            if body >= 0:
                found[body] += frame @ self.links[link] @ frame.T
        return found


def read_urdf(
    path: Path | str,
    *,
    joints: Sequence[str] | None = None,
    at: Mapping[str, float | int] | None = None,
    gravity: Sequence[float | int] = GRAVITY,
) -> Robot:
    """Read a robot from a URDF file.

    Args:
        path: The file.
        joints: Names of the joints that move, in the order of the coordinates; the others stand still, as fingers of a
            gripper may. All that can move, from the base outwards, if None.
        at: Where joints that stand still do so [rad or m]; at zero where nothing is said.
        gravity: Acceleration of free fall in the frame of the base [m/s²]; another one where the base is tilted.

    Returns:
        The robot. Moments of inertia that no body can have are brought to the next that one can.

    Raises:
        ValueError: If the file is no URDF of one tree, a number is unfit, or a joint is unknown or of another kind.
        OSError: If the file cannot be read.
    """
    at = {} if at is None else dict(at)
    assembly = assemble(parse(Path(path).read_bytes()), joints, at)
    names = [joint.name for joint, _, _ in assembly.bodies] if joints is None else joints
    coordinates = {name: k for k, name in enumerate(names)}
    inertias = assembly.inertias()
    if not any(inertia[3, 3] > 0 for inertia in inertias):
        raise ValueError(
            "A body that moves must have a mass; none has. Give the links their <inertial>, if only roughly."
        )
    bodies = tuple(
        Body(
            joint=joint.name,
            coordinate=coordinates[joint.name],
            parent=parent,
            prismatic=joint.kind == "prismatic",
            axis=_tuple(joint.axis),
            origin=tuple(map(_tuple, frame)),
            inertia=tuple(map(_tuple, inertia)),
        )
        for (joint, parent, frame), inertia in zip(assembly.bodies, inertias, strict=True)
    )
    falls = _tuple(_numbers(" ".join(map(str, gravity)), 3, "`gravity`"))
    return Robot(bodies=bodies, gravity=falls, file=Path(path).absolute(), at=at)


def parse(content: bytes) -> ET.Element:
    """Root of a file's tree, which may define nothing of its own.

    Args:
        content: The file.

    Returns:
        The root.

    Raises:
        ValueError: If it is no plain XML file of a robot.
    """
    if len(content) > _LARGEST or b"<!ENTITY" in content or b"<!DOCTYPE" in content:
        raise ValueError(f"a URDF must be a plain XML file of at most {_LARGEST} bytes, without a DOCTYPE. Remove it.")
    try:
        root = ET.fromstring(content)
    except (ET.ParseError, ValueError, RecursionError) as error:
        raise ValueError(f"a URDF must be an XML file; reading stopped at: {error}.") from None
    if root.tag != "robot":
        raise ValueError(f"a URDF must begin with <robot>; got <{root.tag}>. (Xacro must be expanded first.)")
    return root


def assemble(root: ET.Element, joints: Sequence[str] | None, at: Mapping[str, float | int]) -> Assembly:
    """Put the links of a file together to bodies that move.

    Args:
        root: Root of the file's tree.
        joints: Names of the joints that move; all that can if None.
        at: Where others stand.

    Returns:
        The links on their bodies.
    """
    links = {_name(node, "link"): pseudo_inertia(node) for node in root.findall("link")}
    tree = _outwards([_joint(node) for node in root.findall("joint")], links)
    chosen = [joint.name for joint in tree if joint.kind in _MOVING] if joints is None else list(joints)
    _refuse_joints(chosen, tree, at)
    placed = {link: (-1, np.eye(4)) for link in links}
    assembly = Assembly([], links, {})
    for joint in tree:
        body, frame = placed[joint.parent]
        frame = frame @ joint.origin
        if joint.name in chosen:
            assembly.bodies.append((joint, body, frame))
            body, frame = len(assembly.bodies) - 1, np.eye(4)
        elif joint.name in at:
            frame = frame @ _motion(joint, at[joint.name])
        placed[joint.child] = assembly.carried[joint.child] = body, frame
    return assembly


def _outwards(joints: Sequence[Joint], links: Mapping[str, np.ndarray]) -> list[Joint]:
    """The joints from the base outwards, branch by branch."""
    for what, names in (("link", [joint.child for joint in joints]), ("joint", [joint.name for joint in joints])):
        name, count = Counter(names).most_common(1)[0] if names else ("", 0)
        if count > 1:
            raise ValueError(f"every joint must have a name and a child of its own; the {what} `{name}` has {count}.")
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise ValueError(f"joint `{joint.name}`: its parent and its child must be links; there is no `{link}`.")
    hanging: dict[str, list[Joint]] = {link: [] for link in links}
    for joint in reversed(joints):
        hanging[joint.parent].append(joint)
    children = {joint.child for joint in joints}
    waiting = [joint for joint in reversed(joints) if joint.parent not in children]
    found: list[Joint] = []
    while waiting:
        found.append(waiting.pop())
        waiting.extend(hanging[found[-1].child])
    if len(found) < len(joints):
        raise ValueError(
            "the links must hang together as a tree; some joints go round in a circle. Remove one of them."
        )
    return found


def _refuse_joints(chosen: Sequence[str], tree: Sequence[Joint], at: Mapping[str, float | int]) -> None:
    """Refuse coordinates that are no joints, or none that are supported, and places of joints that move or cannot."""
    kinds = {joint.name: joint.kind for joint in tree}
    moving = ", ".join(f"`{name}`" for name, kind in kinds.items() if kind in _MOVING)
    if not chosen:
        raise ValueError(f"a robot must have a joint that moves, {' or '.join(_MOVING)}; got {moving or 'none'}.")
    for name, count in Counter(chosen).items():
        if count > 1 or kinds.get(name) not in _MOVING:
            got = "twice" if count > 1 else kinds.get(name, "none of that name")
            raise ValueError(f"`joints` must be names of joints that move, once each, of {moving}; `{name}`: {got}.")
    for joint in tree:
        if joint.mimics and {joint.name, joint.mimics} & {*chosen}:
            raise ValueError(
                f"joint `{joint.name}` must move by itself; it mimics `{joint.mimics}`. Make it fixed, or leave both "
                "out of `joints`: they then stay where `at` says, or at zero."
            )
    for name, value in at.items():
        if name in chosen or kinds.get(name) not in _MOVING or not abs(value) < _FARTHEST:
            still = ", ".join(f"`{other}`" for other in kinds if kinds[other] in _MOVING and other not in chosen)
            raise ValueError(
                f"`at` must say where joints stand that are not in `joints`, by numbers below {_FARTHEST:g} "
                f"[rad or m]: {still or 'none here'}; got `{name}` at {str(value)[:20]}."
            )
    for name, kind in kinds.items():
        if kind not in (*_MOVING, "fixed"):
            raise ValueError(f"joint `{name}` must be fixed, {' or '.join(_MOVING)}; got {kind}. Replace it by these.")


def _joint(node: ET.Element) -> Joint:
    """A joint."""
    name = _name(node, "joint")
    ends = [node.find(end) for end in ("parent", "child")]
    parent, child = ("" if end is None else end.get("link", "") for end in ends)
    axis = node.find("axis")
    direction = _numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"), 3, f"joint `{name}`: its axis")
    length = np.linalg.norm(direction)
    kind = node.get("type", "")
    if kind in _MOVING and not length > 0:
        raise ValueError(f"joint `{name}`: its axis must have a length; got zero.")
    mimic = node.find("mimic")
    mimics = "" if mimic is None or kind not in _MOVING else mimic.get("joint", "another one")
    return Joint(name, kind, parent, child, _frame(node, f"joint `{name}`"), direction / (length or 1), mimics)


def _motion(joint: Joint, value: float | int) -> np.ndarray:
    """Motion of a joint by a value, 4 × 4."""
    from scipy.spatial.transform import Rotation

    found = np.eye(4)
    if joint.kind == "prismatic":
        found[:3, 3] = value * joint.axis
    else:
        found[:3, :3] = Rotation.from_rotvec(value * joint.axis).as_matrix()
    return found


def pseudo_inertia(node: ET.Element) -> np.ndarray:
    """∫ x xᵀ dm of a link in its own frame; zero for one without a mass.

    Args:
        node: The link.

    Returns:
        The matrix, of a body that can be.

    Raises:
        ValueError: If a number is unfit.
    """
    what = f"link `{_name(node, 'link')}`"
    inertial = node.find("inertial")
    if inertial is None:
        return np.zeros((4, 4))
    mass_node, inertia_node = inertial.find("mass"), inertial.find("inertia")
    mass = float(_numbers("" if mass_node is None else mass_node.get("value", ""), 1, f"{what}: its mass")[0])
    if mass < 0:
        raise ValueError(f"{what}: its mass must not be below zero; got {mass:g}.")
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    texts = " ".join("0" if inertia_node is None else inertia_node.get(name, "0") for name in names)
    xx, xy, xz, yy, yz, zz = _numbers(texts, 6, f"{what}: its inertia")
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments, basis = np.linalg.eigh(0.5 * np.trace(about) * np.eye(3) - about)
    moments = np.maximum(moments, max(_THINNEST * moments[-1], mass * _SMALLEST**2)) if mass else np.zeros(3)
    central = np.zeros((4, 4))
    central[:3, :3], central[3, 3] = (basis * moments) @ basis.T, mass
    frame = _frame(inertial, what)
    return frame @ central @ frame.T


def _frame(node: ET.Element, what: str) -> np.ndarray:
    """The <origin> of a node, 4 × 4."""
    from scipy.spatial.transform import Rotation

    origin = node.find("origin")
    found = np.eye(4)
    if origin is not None:
        found[:3, 3] = _numbers(origin.get("xyz", "0 0 0"), 3, f"{what}: its origin")
        roll, pitch, yaw = _numbers(origin.get("rpy", "0 0 0"), 3, f"{what}: its origin's angles")
        found[:3, :3] = Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix()
    return found


def _name(node: ET.Element, what: str) -> str:
    """A node's name."""
    name = node.get("name", "")
    if not name:
        raise ValueError(f"every {what} must have a name; one has none.")
    return name


def _numbers(text: str, count: int, what: str) -> np.ndarray:
    """Finite numbers of a text."""
    try:
        found = np.array([float(part) for part in text.split()])
    except ValueError:
        found = np.zeros(0)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise ValueError(f"{what} must be {count} finite number{'s' if count > 1 else ''}; got {text[:60]!r}.")
    return found


def _tuple(row: np.ndarray) -> tuple[float, ...]:
    """Plain numbers."""
    return tuple(row.tolist())

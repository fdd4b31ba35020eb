"""A robot's URDF file with other numbers: what bodies weigh and how joints brake; all else stays, byte by byte."""

import io
import re
import xml.parsers.expat
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from ._robot import Assembly, Matrix, Robot, assemble, parse

_TAG: Final = re.compile(rb"<[^\"'>]*(?:\"[^\"]*\"[^\"'>]*|'[^']*'[^\"'>]*)*>")  # A value may contain >.
_STEP: Final = "  "
_OTHER: Final = "its numbers cannot be replaced as it is written. Save it as plain XML in UTF-8."
_EQUAL: Final = 2e-3  # Of what is read back beside what was written: bodies that are too thin are read thicker.


@dataclass(frozen=True, kw_only=True)
class Identified:
    """What was found of a joint and of the body that moves with it.

    Attributes:
        inertia: Pseudo-inertia ∫ x xᵀ dm of (x, y, z, 1) in the frame of the joint, 4 × 4 [kg m², kg m, kg].
        damping: Viscous friction [N m s/rad, or N s/m]; None leaves the file's friction as it is.
        friction: Dry friction [N m, or N].
    """

    inertia: Matrix
    damping: float | None = None
    friction: float = 0.0


class _Element(NamedTuple):
    """Where an element stands in the file: [start, opened) is its first tag, [closing, stop) its last one."""

    tag: str
    attributes: Mapping[str, str]
    start: int
    opened: int
    closing: int
    stop: int
    children: "list[_Element]"

    def child(self, tag: str) -> "_Element | None":
        """The first child of a kind."""
        return next((child for child in self.children if child.tag == tag), None)


def rewrite_urdf(robot: Robot, found: Mapping[str, Identified], *, comment: Sequence[str] = ()) -> bytes:
    """Put what was found into the text of the file that a robot was read from.

    The links of a body, which hang together by joints that stand still, are all deformed by one affine map, which takes
    the body of the file to that which was found, and their masses multiplied by one factor: only their sum is told by
    motions, and each of them stays one that can be. Their <inertial> is written along their own axes, in their own
    frame. A link without a mass stays without, as do all links on the base.

    Args:
        robot: The robot, as `read_urdf` gives it.
        found: What was found, by the joint's name; joints that are not there stay as they are.
        comment: Lines that are written at the top.

    Returns:
        The text of the new file.

    Raises:
        ValueError: If the robot comes from no file, or the file is no URDF any more.
        OSError: If the file cannot be read.
    """
    if robot.file is None:
        raise ValueError("A robot must come from a URDF file to be written to one; this one was made otherwise.")
    content = robot.file.read_bytes()
    names = [body.joint for body in sorted(robot.bodies, key=lambda body: body.coordinate)]
    assembly = assemble(parse(content), names, robot.at)
    shares = dict(_shares(assembly, found))
    root = _elements(content)
    edits = [*_comment(root, comment)]
    for element in root.children:
        name = element.attributes.get("name", "")
        if element.tag == "link" and name in shares and (inertial := element.child("inertial")) is not None:
            edits.append((inertial.start, inertial.stop, _inertial(shares[name], *_layout(content, inertial.start))))
        if element.tag == "joint" and name in found:
            edits.extend(_dynamics(content, element, found[name]))
    pieces, last = [], 0
    for start, stop, text in sorted(edits):
        pieces += [content[last:start], text.encode("ascii", "xmlcharrefreplace")]
        last = stop
    written = b"".join([*pieces, content[last:]])
    _refuse_other(written, names, robot, shares)
    return written


def _shares(assembly: Assembly, found: Mapping[str, Identified]) -> Iterator[tuple[str, np.ndarray]]:
    """Pseudo-inertias of the links that bodies are made of, in their own frames."""
    maps: list[np.ndarray | None] = []
    for (joint, _, _), before in zip(assembly.bodies, assembly.inertias(), strict=True):
        known = joint.name in found and before[3, 3] > 0
        maps.append(_deformation(before, np.array(found[joint.name].inertia, float)) if known else None)
    for link, (body, frame) in assembly.carried.items():
        A = maps[body] if body >= 0 else None
        if A is not None and assembly.links[link][3, 3] > 0:
            to_link = np.linalg.inv(frame) @ A @ frame
            yield link, to_link @ assembly.links[link] @ to_link.T


def _deformation(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The 4 × 4 matrix A with A J Aᵀ = J' that deforms a body least: an affine map, times the root of masses' ratio."""
    masses, centres, roots = [], [], []
    for J in (before, after):
        masses.append(J[3, 3])
        centres.append(J[:3, 3] / J[3, 3])
        roots.append(_root(J[:3, :3] / J[3, 3] - np.outer(centres[-1], centres[-1])))
    # The map between ellipsoids of inertia that moves points least in the mean square (of optimal transport).
    inverse = np.linalg.inv(roots[0])
    stretch = inverse @ _root(roots[0] @ roots[1] @ roots[1] @ roots[0]) @ inverse
    A = np.eye(4)
    A[:3, :3], A[:3, 3] = stretch, centres[1] - stretch @ centres[0]
    return np.sqrt(masses[1] / masses[0]) * A


def _root(matrix: np.ndarray) -> np.ndarray:
    """Square root of a symmetric matrix that is positive definite up to rounding."""
    values, basis = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return (basis * np.sqrt(np.maximum(values, 1e-15 * values[-1]))) @ basis.T


def _inertial(J: np.ndarray, pad: str, line: str) -> str:
    """The element of a link with this pseudo-inertia."""
    mass, centre = J[3, 3], J[:3, 3] / J[3, 3]
    second = J[:3, :3] - mass * np.outer(centre, centre)
    inertia = np.trace(second) * np.eye(3) - second
    axes = "xyz"
    entries = " ".join(f'i{axes[i]}{axes[k]}="{_number(inertia[i, k])}"' for i in range(3) for k in range(i, 3))
    within = f"{line}{pad}{_STEP}" if line else ""
    place = " ".join(map(_number, centre))
    return (
        f'<inertial>{within}<origin xyz="{place}" rpy="0 0 0"/>{within}<mass value="{_number(mass)}"/>'
        f"{within}<inertia {entries}/>{line}{pad if line else ''}</inertial>"
    )


def _dynamics(content: bytes, joint: _Element, found: Identified) -> Iterator[tuple[int, int, str]]:
    """What a joint's friction changes in the file."""
    if found.damping is None:
        return
    numbers = {"damping": _number(found.damping), "friction": _number(found.friction)}
    element = joint.child("dynamics")
    given = {} if element is None else element.attributes
    tag = " ".join(["<dynamics", *(f"{name}={quoteattr(value)}" for name, value in {**given, **numbers}.items())])
    if element is not None:
        yield element.start, element.opened, f"{tag}{'/>' if element.opened == element.stop else '>'}"
        return
    pad, line = _layout(content, joint.closing)
    yield joint.closing, joint.closing, f"{_STEP}{tag}/>{line}{pad}" if line else f"{tag}/>"


def _comment(root: _Element, lines: Sequence[str]) -> Iterator[tuple[int, int, str]]:
    """A comment at the top; two hyphens would end it."""
    if lines:
        text = "\n".join(f"{_STEP}{line}".rstrip() for line in lines)
        yield root.opened, root.opened, f"\n{_STEP}<!--\n{re.sub('-(?=-)', '- ', text)}\n{_STEP}-->"


def _layout(content: bytes, start: int) -> tuple[str, str]:
    """Blanks before what stands there, and the end of a line; none where it is not the first of its line."""
    end = content.rfind(b"\n", 0, start)
    before = content[end + 1 : start]
    if end < 0 or before.strip(b" \t"):
        return "", ""
    return before.decode("ascii"), "\r\n" if content[:end].endswith(b"\r") else "\n"


def _number(value: float) -> str:
    """A number that reads back as good as it was."""
    return f"{float(value):.12g}"


def _elements(content: bytes) -> _Element:
    """The root of the file with its children, and with theirs."""
    parser, open_ones, done = xml.parsers.expat.ParserCreate(), [], []

    def begin(tag: str, attributes: dict[str, str]) -> None:
        start = parser.CurrentByteIndex
        found = _TAG.match(content, start)
        open_ones.append(_Element(tag, attributes, start, found.end() if found else start, 0, 0, []))

    def end(_tag: str) -> None:
        element = open_ones.pop()
        if content[: element.opened].endswith(b"/>"):
            closing = stop = element.opened
        else:
            closing = parser.CurrentByteIndex
            found = _TAG.match(content, closing)
            stop = found.end() if found else closing
        element = element._replace(closing=closing, stop=stop)
        (open_ones[-1].children if open_ones else done).append(element)

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.ParseFile(io.BytesIO(content))
    return done[0]


def _refuse_other(written: bytes, names: Sequence[str], robot: Robot, shares: Mapping[str, np.ndarray]) -> None:
    """Refuse a text that does not say what it should: a file may be written in ways that nobody has thought of."""
    try:
        links = assemble(parse(written), names, robot.at).links
    except ValueError:
        raise ValueError(_OTHER) from None
    for link, J in shares.items():
        if not np.allclose(links[link], J, rtol=_EQUAL, atol=_EQUAL * np.abs(J).max()):
            raise ValueError(_OTHER)

"""URDF out: full-precision text of a robot's parts, the same for the same robot."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape  # xml.sax.saxutils would import urllib and cost 40 ms

import numpy as np

from .. import se3
from .._arrays import Array
from ..drive import Transmission
from ..errors import UrdfError
from ..geometry import FIXED, PRISMATIC, constant_factors
from ..visual import Box, Color, Cylinder, Mesh, Sphere, Visual, skeleton
from .parts import TOOL, RobotParts

_LARGEST = repr(float(np.finfo(np.float64).max))
_SMALLEST_MASS = 1e-12  # Pinocchio takes masses below its epsilon for zero in sums


def urdf_text(parts: RobotParts, visuals: bool = True) -> str:
    """Write the parts of a robot as URDF.

    The root link is the world; a fixed joint places R_0 in it, each frame of the table is a link
    whose z axis is the joint's axis, the tool and the named frames are links without mass.
    Numbers have all their digits. Book eq. [1.3]; wiki.ros.org/urdf/XML.

    Parameters
    ----------
    parts : RobotParts
        The robot to write.
    visuals : bool
        Whether shapes are written: those of the source, else a skeleton sized from the table.

    Returns
    -------
    str
        The text.
    """
    table = parts.table
    names = link_names(parts)
    mimics = _mimics(parts.transmission, table.joint_names)
    shapes: dict[int, list[Visual]] = {}
    if visuals:
        for visual in parts.visuals or skeleton(table, parts.tool, parts.tip):
            shapes.setdefault(visual.frame, []).append(visual)
    lines = ['<?xml version="1.0" encoding="utf-8"?>', f"<robot name={_quoted(parts.name)}>"]
    lines += _link(names.world, parts, -1, [])
    lines += _link(names.frames[0], parts, -1, shapes.get(0, []))
    lines += fixed_joint(names.world, names.frames[0], parts.base, names.fixed[names.frames[0]])
    C = constant_factors(table)
    column = 0
    for k in range(table.f):
        parent, child = names.frames[int(table.antecedent[k])], names.frames[k + 1]
        lines += _link(child, parts, k, shapes.get(k + 1, []))
        if table.sigma[k] == FIXED:
            lines += fixed_joint(parent, child, C[k], table.names[k])
            continue
        kind = "prismatic" if table.sigma[k] == PRISMATIC else "revolute"
        lines.append(f"  <joint name={_quoted(table.names[k])} type={_quoted(kind)}>")
        lines += _placement(parent, child, C[k])
        lines.append('    <axis xyz="0 0 1"/>')
        lines.append(
            f'    <limit lower="{_limit(table.lower[column])}" '
            f'upper="{_limit(table.upper[column])}" effort="{_limit(table.effort[column])}" '
            f'velocity="{_limit(table.velocity[column])}"/>'
        )
        # readers refuse negative friction
        Fv = max(float(parts.drive.Fv[column]), 0.0)
        Fc = max(float(parts.drive.Fc[column]), 0.0)
        if Fv or Fc:
            lines.append(f'    <dynamics damping="{Fv!r}" friction="{Fc!r}"/>')
        lines += mimics.get(column, [])
        lines.append("  </joint>")
        column += 1
    lines += _link(names.tool, parts, -1, [])
    lines += fixed_joint(names.frames[parts.tip], names.tool, parts.tool, names.fixed[names.tool])
    written = {names.world, *names.frames, names.tool}
    for frame in parts.frames:
        if frame.name in written:
            continue
        lines += _link(frame.name, parts, -1, [])
        carrier = names.frames[frame.parent]
        lines += fixed_joint(carrier, frame.name, frame.pose, names.fixed[frame.name])
    return "\n".join([*lines, "</robot>", ""])


@dataclass(frozen=True, slots=True)
class LinkNames:
    """Names of the links and fixed joints a URDF gets besides the named frames."""

    world: str
    frames: tuple[str, ...]
    tool: str
    fixed: dict[str, str]


def link_names(parts: RobotParts) -> LinkNames:
    """Choose link names that collide neither with each other nor with joints or named frames."""
    # the tool is called so, whatever the source called it: that is how it is found again
    has_tool = any(
        frame.name == TOOL and frame.parent == parts.tip and np.array_equal(frame.pose, parts.tool)
        for frame in parts.frames
    )
    spare = [frame for frame in parts.frames if not (has_tool and frame.name == TOOL)]

    def own(parent: int, pose: Array) -> str | None:
        """A named frame that is the very frame to be written gives its name to it."""
        for frame in spare:
            if frame.parent == parent and np.array_equal(frame.pose, pose):
                spare.remove(frame)
                return frame.name
        return None

    given = [own(0, se3.inverse(parts.base))]
    given += [own(k, np.eye(4)) for k in range(parts.table.f + 1)]
    given.append(TOOL if has_tool else None)
    stems = [name.removeprefix("joint_").removeprefix("frame_") for name in parts.table.names]
    wanted = [
        f"link_{stem}" if stem != name else f"{name}_link"
        for stem, name in zip(stems, parts.table.names, strict=True)
    ]
    taken = {*parts.table.names, *(frame.name for frame in parts.frames)}

    def free(name: str) -> str:
        while name in taken:
            name += "_kk"
        taken.add(name)
        return name

    base = "R_0" if "base" in taken else "base"
    links = [
        free(name) if have is None else have
        for have, name in zip(given, ("world", base, *wanted, TOOL), strict=True)
    ]
    carried = (links[1], links[-1], *(frame.name for frame in spare))
    return LinkNames(
        links[0], tuple(links[1:-1]), links[-1], {name: free(f"{name}_fixed") for name in carried}
    )


def holds_inertia(row: Array) -> bool:
    """Whether a URDF (and Pinocchio) can hold ten parameters: mass positive, or no moments."""
    return bool(row[9] > 0 or (row[9] == 0 and not row[6:9].any()))


def keeps_inertia(row: Array) -> bool:
    """Whether ten parameters survive the way through the centre of mass, where a URDF has them.

    First moments over hardly any mass put it far away: the digits about the origin cancel.
    """
    M, moments = row[9], row[6:9]
    if not holds_inertia(row) or 0.0 < M < _SMALLEST_MASS:
        return False
    # up to two digits, for a robot of about a metre
    with np.errstate(over="ignore"):  # masses near the largest float
        return bool(moments @ moments <= 100.0 * M * (np.abs(row[:6]).sum() + M))


def _link(name: str, parts: RobotParts, row: int, visuals: list[Visual]) -> list[str]:
    body: list[str] = []
    if row >= 0:
        pi = parts.inertia.values[row]
        if pi.any() and holds_inertia(pi):
            body += _inertial(pi)
    for visual in visuals:
        body += _visual(visual)
    if not body:
        return [f"  <link name={_quoted(name)}/>"]
    return [f"  <link name={_quoted(name)}>", *body, "  </link>"]


def _inertial(pi: Array) -> list[str]:
    M = float(pi[9])
    com = pi[6:9] / M if M else np.zeros(3)
    S = se3.skew(com)
    tensor = np.array([[pi[0], pi[1], pi[2]], [pi[1], pi[3], pi[4]], [pi[2], pi[4], pi[5]]])
    tensor = tensor + M * (S @ S)
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = tensor[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    inertia = " ".join(f'{k}="{float(v)!r}"' for k, v in zip(keys, values, strict=True))
    return [
        "    <inertial>",
        f'      <origin xyz="{_words(com)}" rpy="0 0 0"/>',
        f'      <mass value="{M!r}"/>',
        f"      <inertia {inertia}/>",
        "    </inertial>",
    ]


def _visual(visual: Visual) -> list[str]:
    shape = visual.shape
    if isinstance(shape, Box):
        geometry = f'<box size="{_words(shape.size)}"/>'
    elif isinstance(shape, Cylinder):
        geometry = f'<cylinder radius="{shape.radius!r}" length="{shape.length!r}"/>'
    elif isinstance(shape, Sphere):
        geometry = f'<sphere radius="{shape.radius!r}"/>'
    else:
        geometry = _mesh(shape)
    lines = [
        "    <visual>",
        f"      {origin_element(visual.pose)}",
        f"      <geometry>{geometry}</geometry>",
    ]
    if visual.color is not None:
        lines.append(f"      {_material(visual.color)}")
    return [*lines, "    </visual>"]


def _mesh(mesh: Mesh) -> str:
    return f'<mesh filename={_quoted(mesh.filename)} scale="{_words(mesh.scale)}"/>'


def _material(color: Color) -> str:
    name = "color_" + "_".join(f"{round(255 * c):02x}" for c in color)
    return f'<material name="{escape(name)}"><color rgba="{_words(color)}"/></material>'


def fixed_joint(parent: str, child: str, pose: Array, name: str) -> list[str]:
    """Lines of a fixed joint that places one link in another."""
    head = f'  <joint name={_quoted(name)} type="fixed">'
    return [head, *_placement(parent, child, pose), "  </joint>"]


def _placement(parent: str, child: str, pose: Array) -> list[str]:
    return [
        f"    {origin_element(pose)}",
        f"    <parent link={_quoted(parent)}/>",
        f"    <child link={_quoted(child)}/>",
    ]


def origin_element(pose: Array) -> str:
    """A pose as ``<origin>``, with all digits."""
    return f'<origin xyz="{_words(pose[:3, 3])}" rpy="{_words(se3.to_rpy(pose[:3, :3]))}"/>'


def _quoted(text: str) -> str:
    return f'"{escape(text)}"'


def _words(values: Array | tuple[float, ...]) -> str:
    return " ".join(repr(float(v) + 0.0) for v in values)


def _limit(value: float) -> str:
    """Infinity as the largest float: URDF parsers read no infinity, and take this for one."""
    if np.isinf(value):
        return _LARGEST if value > 0 else "-" + _LARGEST
    return repr(float(value))


def _mimics(transmission: Transmission | None, joints: tuple[str, ...]) -> dict[int, list[str]]:
    """<mimic> elements of a singular transmission, by joint column."""
    if transmission is None or transmission.is_invertible:
        return {}
    K, elements = transmission.matrix, {}
    for i in range(transmission.n):
        masters = np.flatnonzero(K[i])
        if K[i, i] == 1.0 and masters.size == 1 and transmission.offset[i] == 0.0:
            continue
        # a factor of zero is a joint that stands still: any joint that moves can be its master
        free = [k for k in range(transmission.n) if K[k, k] == 1.0 and k != i]
        master = int(masters[0]) if masters.size else (free[0] if free else -1)
        if masters.size > 1 or master < 0 or K[:, i].any() or K[master, master] != 1.0:
            raise UrdfError(
                f"joint {joints[i]!r} is tied to others by the transmission in a way that a URDF "
                "cannot express (it holds q_i = factor * q_k + offset only): without it the "
                "robot would reach other poses. Remove it first: model.with_transmission(None)."
            )
        elements[i] = [
            f'    <mimic joint={_quoted(joints[master])} multiplier="{float(K[i, master])!r}" '
            f'offset="{float(transmission.offset[i])!r}"/>'
        ]
    return elements

"""The text of a URDF as a checked tree of links and joints.

The parser is the standard library's expat with document type declarations refused, so that entity
bombs and external entities never reach it; it reads the elements that kinematics and dynamics need.
Meshes are only located here and are opened for drawing.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from xml.parsers import expat

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import UrdfError, nearest_names
from ..visual import Box, Color, Cylinder, Mesh, Shape, Sphere
from .meshes import MeshFinder

MOVING_TYPES = ("revolute", "continuous", "prismatic")
OTHER_TYPES = ("floating", "planar")


@dataclass(frozen=True, slots=True)
class UrdfVisual:
    """A shape and its pose in its link (see `robotmodels.visual`)."""

    pose: Array
    shape: Shape
    color: Color | None


@dataclass(frozen=True, slots=True)
class UrdfLink:
    """A link: mass (kg), centre of mass (m), inertia about it in link axes (kg m^2), shapes."""

    name: str
    mass: float
    com: Array
    inertia: Array
    visuals: tuple[UrdfVisual, ...]


@dataclass(frozen=True, slots=True)
class UrdfJoint:
    """A joint as written: origin in the parent link, axis in the joint frame, limits, friction."""

    name: str
    kind: str
    parent: str
    child: str
    origin: Array
    axis: Array
    lower: float
    upper: float
    velocity: float
    effort: float
    damping: float
    friction: float
    mimic: tuple[str, float, float] | None


@dataclass(frozen=True, slots=True)
class UrdfTree:
    """Links and joints by name, in the order of the file, and the root link's name."""

    name: str
    links: dict[str, UrdfLink]
    joints: dict[str, UrdfJoint]
    root: str

    def children(self, link: str) -> list[UrdfJoint]:
        """Joints whose parent is a link, in the order of the file."""
        return [joint for joint in self.joints.values() if joint.parent == link]

    def parent_joint(self, link: str) -> UrdfJoint | None:
        """The joint that carries a link; None for the root."""
        return next((joint for joint in self.joints.values() if joint.child == link), None)


def parse_urdf(text: str, meshes: MeshFinder) -> UrdfTree:
    """Read and check a URDF text."""
    robot = _element_tree(text)
    _refuse_xacro(robot)
    if robot.tag != "robot":
        raise UrdfError(f"expected the root element <robot>, got <{robot.tag}>: is this a URDF?")
    materials = {
        m.get("name", ""): color
        for m in robot.findall("material")
        if (color := _color(m)) is not None
    }
    links: dict[str, UrdfLink] = {}
    for element in robot.findall("link"):
        link = _link(element, materials, meshes)
        _add(links, link.name, link, "link")
    joints: dict[str, UrdfJoint] = {}
    for element in robot.findall("joint"):
        joint = _joint(element)
        _add(joints, joint.name, joint, "joint")
    if not links:
        raise UrdfError("the robot has no <link>.")
    root = _root(links, joints)
    tree = UrdfTree(robot.get("name", "robot"), links, joints, root)
    reached = [root]
    for link in reached:  # grows
        reached += [joint.child for joint in tree.children(link)]
    if lost := sorted(links.keys() - {*reached}):
        raise UrdfError(f"the links {', '.join(lost[:5])} form a loop apart from the root.")
    return tree


def _element_tree(text: str) -> ET.Element:
    # declared encodings were undone when the file was read as text
    parser = expat.ParserCreate("utf-8")
    builder = ET.TreeBuilder()

    def refuse(*_: object) -> None:
        raise UrdfError(
            "the text has a DOCTYPE: entities can read files and exhaust memory, and a URDF needs "
            "none. Remove the <!DOCTYPE ...> declaration."
        )

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        # a text in triple quotes often starts with a line end, which XML forbids
        parser.Parse(text.lstrip("\ufeff \t\r\n").encode("utf-8"), True)
    except expat.ExpatError as error:
        raise UrdfError(f"not well-formed XML: {error}.") from None
    except UrdfError:
        raise
    except (LookupError, ValueError) as error:
        raise UrdfError(f"the text cannot be decoded: {error}.") from None
    return builder.close()


def _refuse_xacro(robot: ET.Element) -> None:
    for element in robot.iter():
        found = element.tag if element.tag.startswith("xacro:") else next(
            (v for v in element.attrib.values() if "${" in v or "$(" in v), None
        )  # fmt: skip
        if found is not None:
            raise UrdfError(
                f"this is a xacro file (found {found!r}), not a URDF. Expand it first: "
                "`xacro robot.urdf.xacro > robot.urdf` (Python packages xacro or xacrodoc)."
            )


def _add(known: dict, name: str, item: object, kind: str) -> None:
    if name in known:
        raise UrdfError(f"two {kind}s are called {name!r}; names must be unique.")
    known[name] = item


def _root(links: dict[str, UrdfLink], joints: dict[str, UrdfJoint]) -> str:
    carried: dict[str, str] = {}
    for joint in joints.values():
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                near = nearest_names(link, list(links))
                hint = f" Did you mean {near[0]!r}?" if near else ""
                raise UrdfError(
                    f"joint {joint.name!r}: its {role} link {link!r} is not defined.{hint}"
                )
        if joint.child in carried:
            raise UrdfError(
                f"link {joint.child!r} hangs from two joints, {carried[joint.child]!r} and "
                f"{joint.name!r}: a URDF is a tree. Closed loops cannot be described by one."
            )
        carried[joint.child] = joint.name
    roots = [name for name in links if name not in carried]
    if len(roots) != 1:
        what = "no root link: the joints form a loop" if not roots else (
            f"{len(roots)} root links ({', '.join(roots[:5])}): connect them with joints"
        )  # fmt: skip
        raise UrdfError(f"the robot has {what}.")
    return roots[0]


def _numbers(text: str | None, count: int, default: tuple[float, ...], where: str) -> Array:
    if text is None:
        return np.array(default)
    try:
        values = np.array([float(word) for word in text.split()])
        if "_" in text:  # Python's float takes 1_0 for 10
            raise ValueError
    except ValueError:
        raise UrdfError(f"{where}: expected {count} numbers, got {text!r}.") from None
    if values.size != count or not np.isfinite(values).all():
        raise UrdfError(f"{where}: expected {count} finite numbers, got {text!r}.")
    return values


def _number(element: ET.Element | None, key: str, default: float, where: str) -> float:
    text = None if element is None else element.get(key)
    return float(_numbers(text, 1, (default,), f"{where} {key}")[0])


def _origin(element: ET.Element, where: str) -> Array:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    zero = (0.0, 0.0, 0.0)
    return se3.from_rpy(
        _numbers(origin.get("rpy"), 3, zero, f"{where}: origin rpy"),
        _numbers(origin.get("xyz"), 3, zero, f"{where}: origin xyz"),
    )


def _named(element: ET.Element, kind: str) -> str:
    name = element.get("name", "")
    if not name:
        raise UrdfError(f"a <{kind}> has no name.")
    return name


def _link(element: ET.Element, materials: dict[str, Color], meshes: MeshFinder) -> UrdfLink:
    name = _named(element, "link")
    where = f"link {name!r}"
    mass, com, tensor = 0.0, np.zeros(3), np.zeros((3, 3))
    inertial = element.find("inertial")
    if inertial is not None:
        given = inertial.find("mass")
        if given is None or given.get("value") is None:
            raise UrdfError(f"{where}: <inertial> needs <mass value=...>; remove it if unknown.")
        mass = _number(given, "value", 0.0, f"{where}: mass")
        if mass < 0:
            raise UrdfError(f"{where}: a mass cannot be negative, got {mass} kg.")
        pose = _origin(inertial, f"{where}: inertial")
        block = inertial.find("inertia")
        ixx, ixy, ixz, iyy, iyz, izz = (
            _number(block, key, 0.0, f"{where}: inertia")
            for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        own = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
        com, tensor = pose[:3, 3], pose[:3, :3] @ own @ pose[:3, :3].T
    visuals = tuple(
        _visual(v, f"{where}: visual", materials, meshes) for v in element.findall("visual")
    )
    return UrdfLink(name, mass, com, tensor, visuals)


def _visual(
    element: ET.Element, where: str, materials: dict[str, Color], meshes: MeshFinder
) -> UrdfVisual:
    geometry = element.find("geometry")
    shape = None if geometry is None else next(iter(geometry), None)
    if shape is None:
        raise UrdfError(f"{where}: there is no shape in <geometry>.")
    material = element.find("material")
    color = None
    if material is not None:
        color = _color(material) or materials.get(material.get("name", ""))
    return UrdfVisual(_origin(element, where), _shape(shape, where, meshes), color)


def _shape(element: ET.Element, where: str, meshes: MeshFinder) -> Shape:
    if element.tag == "box":
        x, y, z = _numbers(element.get("size", ""), 3, (), f"{where}: box size")
        return Box((float(x), float(y), float(z)))
    if element.tag in ("cylinder", "capsule"):
        radius = _number(element, "radius", 0.0, f"{where}: {element.tag}")
        return Cylinder(radius, _number(element, "length", 0.0, f"{where}: {element.tag}"))
    if element.tag == "sphere":
        return Sphere(_number(element, "radius", 0.0, f"{where}: sphere"))
    if element.tag == "mesh":
        filename = element.get("filename", "")
        if not filename:
            raise UrdfError(f"{where}: a mesh has no filename.")
        x, y, z = _numbers(element.get("scale"), 3, (1.0, 1.0, 1.0), f"{where}: mesh scale")
        return Mesh(filename, meshes.find(filename), (float(x), float(y), float(z)))
    raise UrdfError(f"{where}: unknown shape <{element.tag}>; box, cylinder, sphere or mesh.")


def _color(material: ET.Element) -> Color | None:
    element = material.find("color")
    if element is None:
        return None
    r, g, b, a = _numbers(element.get("rgba", ""), 4, (), "material color")
    return float(r), float(g), float(b), float(a)


def _joint(element: ET.Element) -> UrdfJoint:
    name = _named(element, "joint")
    where = f"joint {name!r}"
    kind = element.get("type", "")
    parent, child = element.find("parent"), element.find("child")
    if parent is None or child is None:
        raise UrdfError(f"{where}: a joint needs a <parent link=...> and a <child link=...>.")
    axis_element = element.find("axis")
    text = None if axis_element is None else axis_element.get("xyz")
    axis = _numbers(text, 3, (1.0, 0.0, 0.0), f"{where}: axis")
    largest = float(np.abs(axis).max())
    length = float(np.linalg.norm(axis / largest)) * largest if largest else 0.0
    if kind in MOVING_TYPES and length < 1e-6:
        raise UrdfError(f"{where}: its axis is {text!r}; an axis needs a direction.")
    limit = element.find("limit")
    bounded = kind in ("revolute", "prismatic")
    if bounded and limit is None:
        raise UrdfError(
            f"{where}: a {kind} joint needs <limit lower=... upper=... effort=... velocity=...>; "
            "a revolute joint without limits is of type continuous."
        )
    lower, upper = -np.inf, np.inf
    if bounded:
        lower = _limit(limit, "lower", 0.0, where)
        upper = _limit(limit, "upper", 0.0, where)
        if lower > upper:
            raise UrdfError(f"{where}: the lower limit {lower} is above the upper limit {upper}.")
    dynamics, mimic = element.find("dynamics"), element.find("mimic")
    return UrdfJoint(
        name=name,
        kind=kind,
        parent=parent.get("link", ""),
        child=child.get("link", ""),
        origin=_origin(element, where),
        axis=axis / largest / (length / largest) if length else axis,
        lower=lower,
        upper=upper,
        velocity=_limit(limit, "velocity", np.inf, where),
        effort=_limit(limit, "effort", np.inf, where),
        damping=_number(dynamics, "damping", 0.0, f"{where}: dynamics"),
        friction=_number(dynamics, "friction", 0.0, f"{where}: dynamics"),
        mimic=None if mimic is None else (
            mimic.get("joint", ""),
            _number(mimic, "multiplier", 1.0, f"{where}: mimic"),
            _number(mimic, "offset", 0.0, f"{where}: mimic"),
        ),
    )  # fmt: skip


def _limit(element: ET.Element | None, key: str, default: float, where: str) -> float:
    """A limit; the largest floats stand for infinity, as other programs write it."""
    text = None if element is None else element.get(key)
    if text is None:
        return default
    try:
        value = float(text)
    except ValueError:
        raise UrdfError(f"{where}: limit {key} must be a number, got {text!r}.") from None
    if np.isnan(value):
        raise UrdfError(f"{where}: limit {key} is NaN; leave it out or give a number.")
    if value < 0 and key in ("velocity", "effort"):
        raise UrdfError(f"{where}: limit {key} is a magnitude, got {value}.")
    return float(np.copysign(np.inf, value)) if abs(value) >= 1e300 else value

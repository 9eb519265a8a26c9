"""Looped robots from files: SYMORO's ``.par`` and MuJoCo's MJCF."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._arrays import Array
from ..drive import DriveParameters
from ..errors import LoopError, ParFileError
from ..geometry import PRISMATIC
from ..model import RobotModel
from ..symoro.read import read_tree
from .robot import Closure, LoopedRobot

_UPPER = np.triu_indices(3)


def read_par(
    path: str | Path,
    values: Mapping[str, float] | None = None,
    gravity: ArrayLike | None = None,
) -> LoopedRobot:
    """Read a SYMORO ``.par`` file with loops.

    Joints NL + 1 to NJ are cut: the closure ``cut_j`` joins frame j to its second frame, which is
    one of the last NJ - NL fixed frames. A cut revolute joint is no joint of the tree; a cut
    prismatic one stays, without mass. Joints with mu = 1 are actuated.

    Parameters
    ----------
    path, values, gravity
        As for `robotmodels.read_par`.

    Returns
    -------
    LoopedRobot
        Spanning tree, closures and actuated joints.

    Raises
    ------
    ParFileError, TableError, InvalidValueError
        As for `robotmodels.read_par`; a file without loops.

    References
    ----------
    W. Khalil and D. Creusot, "SYMORO+: a system for the symbolic modelling of robots", Robotica
    15, 1997. Seed book section 1.2.1.

    Examples
    --------
    >>> text = '''NL = 3
    ... NJ = 4
    ... NF = 5
    ... Type = 2
    ... ant = {0, 0, 1, 3, 2}
    ... sigma = {0, 0, 0, 0, 2}
    ... mu = {1, 0, 0, 0, 0}
    ... d = {0, 1, 0.5, 1, 0.5}
    ... alpha = {0, 0, 0, 0, 0}
    ... r = {0, 0, 0, 0, 0}
    ... theta = {t1, t2, t3, t4, 0}
    ... '''
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "parallelogram.par"
    ...     _ = file.write_text(text)
    ...     read_par(file)
    <LoopedRobot 'parallelogram': 3 joints, actuated [0], closures: cut_4 (revolute)>
    """
    tree, cuts = read_tree(path, values, gravity, loops=True)
    if not cuts:
        raise ParFileError(
            f"{Path(path).name}: NJ = NL, so that no loop is cut; read it with rm.read_par."
        )
    kinds = ["full" if tree.table.sigma[j - 1] == PRISMATIC else "revolute" for j, _ in cuts]
    return LoopedRobot(
        tree,
        [Closure(f"cut_{pair[0]}", pair, kind) for pair, kind in zip(cuts, kinds, strict=True)],
    )


def read_mjcf(path: str | Path) -> LoopedRobot:
    """Read an MJCF file with hinge and slide joints and ``<connect>`` or ``<weld>`` closures.

    Pinocchio reads bodies and joints. Joints of actuators are actuated, in the order of the tree;
    armature, damping and friction loss are Ia, Fv and Fc.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    LoopedRobot
        The tree (in joint variables of the file), a closure ``connect_k`` (point) or ``weld_k``
        (full) for each equality, actuated joints.

    Raises
    ------
    LoopError
        A file that cannot be read; other joints or equalities, which are named.

    Examples
    --------
    >>> text = '''<mujoco model="bars"><worldbody>
    ... <body name="crank"><joint name="j1" axis="0 0 1"/><inertial pos="0 0 0" mass="1"
    ...   diaginertia="1 1 1"/><body name="rod" pos="0.5 0 0"><joint name="j2" axis="0 0 1"/>
    ...   <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body>
    ... <body name="rocker" pos="1 0 0"><joint name="j3" axis="0 0 1"/><inertial pos="0 0 0"
    ...   mass="1" diaginertia="1 1 1"/></body></worldbody>
    ... <equality><connect body1="rod" body2="rocker" anchor="1 0 0"/></equality>
    ... <actuator><motor joint="j1"/></actuator></mujoco>'''
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "bars.xml"
    ...     _ = file.write_text(text)
    ...     read_mjcf(file)
    <LoopedRobot 'bars': 3 joints, actuated [0], closures: connect_1 (point)>
    """
    path = Path(path)
    try:
        root = ET.parse(path).getroot()
    except (OSError, ET.ParseError) as error:
        raise LoopError(f"cannot read {str(path)!r} as MJCF: {error}.") from None
    world = root.find("worldbody")
    if root.tag != "mujoco" or world is None:
        raise LoopError(f"{path.name}: expected an MJCF file, <mujoco> with a <worldbody>.")
    for group in root.findall("equality"):
        for equality in [e for e in group if e.get("active") == "false"]:
            group.remove(equality)
    equalities = root.findall("equality/*")
    for k, equality in enumerate(equalities, start=1):
        if equality.tag not in ("connect", "weld") or equality.get("body1") is None:
            raise LoopError(
                f"{path.name}: the equality {ET.tostring(equality, encoding='unicode').strip()} "
                "is not supported; closures are <connect> and <weld> of body1 and body2."
            )
        _check_numbers(equality, path.name)
        equality.set("name", f"{equality.tag}_{k:06d}")  # Pinocchio sorts by kind and by name
    with TemporaryDirectory() as folder:
        try:
            model, constraints = pin.buildModelAndLegacyConstraintsFromMJCF(
                str(_with_one_root(root, world, Path(folder) / path.name))
            )
        except (ValueError, RuntimeError) as error:
            raise LoopError(f"{path.name}: Pinocchio cannot read it: {error}") from None
    text = _urdf(model, root.get("model") or path.stem, path.name)
    tree = RobotModel.from_urdf(text, gravity=model.gravity.linear)
    order = [model.idx_vs[model.getJointId(name)] for name in tree.table.joint_names]
    lower, upper = model.lowerPositionLimit[order], model.upperPositionLimit[order]
    none = np.full(len(order), np.inf)
    limits = {"lower": lower, "upper": upper, "velocity": none, "effort": none}
    tree = tree.with_table(tree.table.replace(**limits))
    Ia, Fv, Fc = (getattr(model, key)[order] for key in ("armature", "damping", "friction"))
    closures = []
    if len(constraints) != len(equalities):
        raise LoopError(
            f"{path.name}: Pinocchio reads {len(constraints)} of {len(equalities)} equalities; "
            "check the names of their bodies."
        )
    places = sorted(range(len(equalities)), key=lambda k: str(equalities[k].get("name")))
    found = dict(zip(places, constraints, strict=True))
    for k, equality in enumerate(equalities):
        constraint, name, frames = found[k], f"{equality.tag}_{k + 1}", []
        for side in ("1", "2"):
            body = getattr(constraint, f"joint{side}_id")
            place = getattr(constraint, f"joint{side}_placement").homogeneous
            frames.append(f"{name}_{side}")
            tree = tree.with_frames({frames[-1]: place}, f"body_{body}" if body else 0)
        kind = "point" if equality.tag == "connect" else "full"
        closures.append(Closure(name, (frames[0], frames[1]), kind))
    driven = {element.get("joint") for element in root.findall("actuator/*")}
    actuated = [j for j, name in enumerate(tree.table.joint_names) if name in driven]
    tree = tree.with_drive(DriveParameters(Ia=Ia, Fv=Fv, Fc=Fc))
    return LoopedRobot(tree, closures, actuated)  # type: ignore[arg-type]


def _check_numbers(equality: ET.Element, label: str) -> None:
    """Raise for anchors and poses that are not numbers, which Pinocchio reads as any number."""
    for key, count in (("anchor", 3), ("relpose", 7)):
        text = equality.get(key)
        if text is None and not (key == "anchor" and equality.tag == "connect"):
            continue
        try:
            values = [float(word) for word in (text or "").split()]
        except ValueError:
            values = []
        if len(values) != count or not np.isfinite(values).all():
            raise LoopError(
                f"{label}: expected {key} with {count} numbers, got {text!r} in "
                f"{ET.tostring(equality, encoding='unicode').strip()}."
            )


def _with_one_root(root: ET.Element, world: ET.Element, path: Path) -> Path:
    """A file with one body that carries all root bodies: Pinocchio leaves out all but one."""
    bodies = world.findall("body")
    if len(bodies) != 1:
        together = ET.SubElement(world, "body", name="robotmodels_roots")
        for body in bodies:
            world.remove(body)
            together.append(body)
    ET.ElementTree(root).write(path)
    return path


def _urdf(model: Any, name: str, label: str) -> str:
    """URDF of a Pinocchio model of hinge and slide joints; the link of joint k is ``body_k``."""
    lines = [f"<robot name={quoteattr(name)}><link name='body_0'/>"]
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    for k in range(1, model.njoints):
        kind = model.joints[k].shortname()
        sort = {"R": "revolute", "P": "prismatic"}.get(kind.removeprefix("JointModel")[0])
        if sort is None or model.joints[k].nq != 1:
            raise LoopError(
                f"{label}: joint {model.names[k]!r} is a {kind}; only hinge and slide joints with "
                "one of them in each joint are supported."
            )
        twist = pin.getJointJacobian(model, data, k, pin.LOCAL)[:, model.idx_vs[k]]
        axis = twist[3:] if sort == "revolute" else twist[:3]
        place, Y = model.jointPlacements[k], model.inertias[k]
        origin = _origin(place.translation, pin.rpy.matrixToRpy(place.rotation))
        tensor = zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), Y.inertia[_UPPER], strict=True)
        entries = " ".join(f"{key}='{float(value)!r}'" for key, value in tensor)
        lines.append(
            f"<link name='body_{k}'><inertial>{_origin(Y.lever, np.zeros(3))}"
            f"<mass value='{float(Y.mass)!r}'/><inertia {entries}/></inertial></link>"
            f"<joint name={quoteattr(model.names[k])} type='{sort}'>{origin}"
            f"<parent link='body_{model.parents[k]}'/><child link='body_{k}'/>"
            f"<axis xyz='{_numbers(axis)}'/>"
            "<limit lower='-1' upper='1' effort='1' velocity='1'/></joint>"
        )
    return "\n".join([*lines, "</robot>"])


def _origin(xyz: Array, rpy: Array) -> str:
    return f"<origin xyz='{_numbers(xyz)}' rpy='{_numbers(rpy)}'/>"


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)

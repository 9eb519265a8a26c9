"""Looped robots from files: SYMORO's ``.par`` and MuJoCo's MJCF.

Parameters
----------
path : str or Path
    The file.
values, gravity
    As for `robotmodels.read_par`.

Returns
-------
LoopedRobot
    Spanning tree, closures and actuated joints. ParFileError or LoopError names the
    entries of a file that are not supported.

References
----------
W. Khalil and D. Creusot, "SYMORO+: a system for the symbolic modelling of robots", Robotica 15,
1997. Book section 1.2.1.

Examples
--------
>>> body = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
>>> text = f'''<mujoco model="bars"><worldbody>
... <body name="crank"><joint name="j1" axis="0 0 1"/>{body}
...   <body name="rod" pos="0.5 0 0"><joint name="j2" axis="0 0 1"/>{body}</body></body>
... <body name="rocker" pos="1 0 0"><joint name="j3" axis="0 0 1"/>{body}</body></worldbody>
... <equality><connect body1="rod" body2="rocker" anchor="1 0 0"/></equality>
... <actuator><motor joint="j1"/></actuator></mujoco>'''
>>> with TemporaryDirectory() as folder:
...     _ = (Path(folder) / "bars.xml").write_text(text)
...     read_mjcf(Path(folder) / "bars.xml")
<LoopedRobot 'bars': 3 joints, actuated [0], closures: connect_1 (point)>
"""

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
from ..urdf.write import origin_element
from .robot import Closure, LoopedRobot


def read_par(
    path: str | Path, values: Mapping[str, float] | None = None, gravity: ArrayLike | None = None
) -> LoopedRobot:
    """Read a SYMORO ``.par`` file with loops.

    Joints NL + 1 to NJ are cut: the closure ``cut_j`` joins frame j to its second frame, which is
    one of the last NJ - NL fixed frames. A cut revolute joint is no joint of the tree; a cut
    prismatic one stays, without mass. Joints with mu = 1 are actuated.
    """
    tree, cuts = read_tree(path, values, gravity, loops=True)
    if not cuts:
        raise ParFileError(
            f"{Path(path).name}: NJ = NL, so that no loop is cut; read it with rm.read_par."
        )
    kinds = ["full" if tree.table.sigma[j - 1] == PRISMATIC else "revolute" for j, _ in cuts]
    pairs = zip(cuts, kinds, strict=True)
    return LoopedRobot(tree, [Closure(f"cut_{pair[0]}", pair, kind) for pair, kind in pairs])


def read_mjcf(path: str | Path) -> LoopedRobot:
    """Read an MJCF file with hinge and slide joints and ``<connect>`` or ``<weld>`` closures.

    Pinocchio reads bodies and joints. Each equality is a closure, ``connect_k`` (point) or
    ``weld_k`` (full). Joints of actuators are actuated, in the order of the tree; armature,
    damping and friction loss are Ia, Fv and Fc.
    """
    try:
        path = Path(path)
        root = ET.parse(path).getroot()
    except (OSError, TypeError, ValueError, ET.ParseError) as error:
        raise LoopError(f"cannot read {str(path)!r} as MJCF: {error}.") from None
    world = root.find("worldbody")
    if root.tag != "mujoco" or world is None:
        raise LoopError(f"{path.name}: expected an MJCF file, <mujoco> with a <worldbody>.")
    for group in root.findall("equality"):
        for equality in [e for e in group if e.get("active") == "false"]:
            group.remove(equality)
    equalities = root.findall("equality/*")
    for k, equality in enumerate(equalities, start=1):
        _check_equality(equality, path.name)
        equality.set("name", f"{equality.tag}_{k:06d}")  # Pinocchio sorts by kind and by name
    bodies = world.findall("body")
    if len(bodies) != 1:  # of several root bodies, Pinocchio leaves out all but one
        together = ET.SubElement(world, "body", name="robotmodels_roots")
        for body in bodies:
            world.remove(body)
            together.append(body)
    with TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        ET.ElementTree(root).write(copy)
        try:
            model, constraints = pin.buildModelAndLegacyConstraintsFromMJCF(str(copy))
        except (ValueError, RuntimeError) as error:
            raise LoopError(f"{path.name}: Pinocchio cannot read it: {error}") from None
    if not model.nq:
        raise LoopError(f"{path.name}: expected bodies with joints, got none.")
    if len(constraints) != len(equalities):
        raise LoopError(
            f"{path.name}: {len(equalities) - len(constraints)} equalities name unknown bodies."
        )
    text = _urdf(model, root.get("model") or path.stem, path.name)
    tree = RobotModel.from_urdf(text, gravity=model.gravity.linear)
    names = tree.table.joint_names
    order = [model.idx_vs[model.getJointId(name)] for name in names]
    lower, upper = model.lowerPositionLimit[order], model.upperPositionLimit[order]
    none = np.full(len(order), np.inf)
    table = tree.table.replace(lower=lower, upper=upper, velocity=none, effort=none)
    Ia, Fv, Fc = (getattr(model, key)[order] for key in ("armature", "damping", "friction"))
    tree = tree.with_table(table).with_drive(DriveParameters(Ia=Ia, Fv=Fv, Fc=Fc))
    closures = []
    places = sorted(range(len(equalities)), key=lambda k: str(equalities[k].get("name")))
    for k, constraint in sorted(zip(places, constraints, strict=True), key=lambda pair: pair[0]):
        kind, name = equalities[k].tag, f"{equalities[k].tag}_{k + 1}"
        for side in "12":
            body = getattr(constraint, f"joint{side}_id")
            place = getattr(constraint, f"joint{side}_placement").homogeneous
            tree = tree.with_frames({f"{name}_{side}": place}, f"body_{body}" if body else 0)
        frames = f"{name}_1", f"{name}_2"
        closures.append(Closure(name, frames, "point" if kind == "connect" else "full"))
    driven = {element.get("joint") for element in root.findall("actuator/*")}
    actuated = [j for j, name in enumerate(names) if name in driven]
    return LoopedRobot(tree, closures, actuated)  # type: ignore[arg-type]


def _check_equality(equality: ET.Element, label: str) -> None:
    """Raise for other equalities, and anchors that Pinocchio would read as any number."""
    shown = ET.tostring(equality, encoding="unicode").strip()
    if equality.tag not in ("connect", "weld") or equality.get("body1") is None:
        raise LoopError(
            f"{label}: the equality {shown} is not supported, only <connect> and <weld>."
        )
    for key, count, text in (("anchor", 3, "0 0 0"), ("relpose", 7, "0 0 0 1 0 0 0")):
        text = equality.get(key, "" if (key, equality.tag) == ("anchor", "connect") else text)
        try:
            fits = np.isfinite(np.array(text.split(), np.float64)).sum() == count
        except ValueError:
            fits = False
        if not fits:
            raise LoopError(
                f"{label}: expected {key} with {count} numbers, got {text!r} in {shown}."
            )


def _urdf(model: Any, name: str, label: str) -> str:
    """URDF of a Pinocchio model of hinge and slide joints; the link of joint k is ``body_k``."""
    lines = [f"<robot name={quoteattr(name)}><link name='body_0'/>"]
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    for k in range(1, model.njoints):
        kind, Y = model.joints[k].shortname(), model.inertias[k]
        sort = {"R": "revolute", "P": "prismatic"}.get(kind.removeprefix("JointModel")[0])
        if sort is None or model.joints[k].nq != 1:
            raise LoopError(
                f"{label}: joint {model.names[k]!r} is a {kind}, neither hinge nor slide."
            )
        twist = pin.getJointJacobian(model, data, k, pin.LOCAL)[:, model.idx_vs[k]]
        axis = twist[3:] if sort == "revolute" else twist[:3]
        tensor = [
            f"i{'xyz'[a]}{'xyz'[b]}='{float(Y.inertia[a, b])!r}'"
            for a in range(3)
            for b in range(a, 3)
        ]
        lines.append(
            f"<link name='body_{k}'><inertial><origin xyz='{_words(Y.lever)}'/>"
            f"<mass value='{float(Y.mass)!r}'/><inertia {' '.join(tensor)}/></inertial></link>"
            f"<joint name={quoteattr(model.names[k])} type='{sort}'>"
            f"{origin_element(model.jointPlacements[k].homogeneous)}"
            f"<parent link='body_{model.parents[k]}'/><child link='body_{k}'/>"
            f"<axis xyz='{_words(axis)}'/>"
            "<limit lower='-1' upper='1' effort='1' velocity='1'/></joint>"
        )
    return "\n".join([*lines, "</robot>"])


def _words(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)

"""References of elastic models: exact large bending of one beam, and lumped rigid segments.

Parameters
----------
length, EI : float
    Length, m, and bending stiffness, N m^2.
force, moment : float
    On the tip along y, whatever its slope, N, and about z, N m; ``force length^2 / EI`` and
    ``moment length / EI`` up to 100.
arm : FlexibleRobot
    The robot; its flexible links are made by `beam`, its joints are rigid.
segments : int
    Hinges of each beam, from 1.

Returns
-------
Elastica
    The shape that is continued from the straight beam.
model, stiffness : RobotModel and ndarray, shape (N,)
    Robot whose last rows are moved behind the segments; the drives keep their joints. Springs of
    its N joints, N m/rad; 0 for the joints of the arm.

Examples
--------
>>> elastica(1.0, 1.0, force=1.0).tip[:2, 3].round(5)  # Bisshopp and Drucker (1945)
array([0.94357, 0.30172])
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .. import se3
from .._arrays import Array, Frozen, Value, as_number
from ..errors import InvalidValueError
from ..geometry import DHTable
from ..inertia import InertialParameters
from ..model import RobotModel
from .link import BeamData
from .robot import FlexibleRobot, check_arm

Row = dict[str, float]
_ROW = ("sigma", "mu", "gamma", "b", "beta", "alpha", "d", "theta", "r")
_X = np.eye(3)[0]
_POINTS = 101
_MOST = 100.0  # greatest load of `elastica`, of the same
_LOAD_STEP = 0.5  # of force L^2 / EI and moment L / EI, along which the solution is continued


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Elastica(Frozen, Value):
    """Exact shape of a bent cantilever.

    ``tip`` (4, 4) is its pose in the frame of the root, x along the beam; ``points`` (N, 3) the
    bent axis, m, and ``angle`` (N,) its slope, rad.
    """

    tip: Array
    points: Array
    angle: Array


def elastica(length: float, EI: float, force: float = 0.0, moment: float = 0.0) -> Elastica:
    """Exact static bending of one beam clamped along x: ``EI theta'' + force cos(theta) = 0``."""
    from scipy.integrate import solve_ivp
    from scipy.optimize import newton

    L, stiff = as_number(length, "length", above=0.0), as_number(EI, "EI", above=0.0)
    F = as_number(force, "force") * L * L / stiff
    M = as_number(moment, "moment") * L / stiff
    if not max(abs(F), abs(M)) <= _MOST:
        raise InvalidValueError(
            "force, moment: expected force length^2 / EI and moment length / EI up to "
            f"{_MOST:g}, got {F:.4g} and {M:.4g}; check the units, EI in N m^2."
        )

    def bent(root: float, share: float, rtol: float = 1e-11, s: Array | None = None) -> Array:
        """Slope, curvature and axis of a beam of length 1 from the curvature at its root."""

        def rate(_: float, y: Array) -> list[float]:
            cos, sin = np.cos(y[0]), np.sin(y[0])
            return [y[1], -share * F * cos, cos, sin]

        return solve_ivp(
            rate, (0.0, 1.0), [0.0, root, 0.0, 0.0], "DOP853", s, rtol=rtol, atol=0.01 * rtol
        ).y

    curvature, steps = 0.0, max(1, int(np.ceil(max(abs(F), abs(M)) / _LOAD_STEP)))
    slope = (F + M) / steps
    for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
        rtol = 1e-11 if share == 1.0 else 1e-6

        def left(c: float, share: float = share, rtol: float = rtol) -> float:
            return bent(c, share, rtol)[1, -1] - share * M

        found = float(newton(left, curvature + slope, tol=0.1 * rtol))
        slope, curvature = found - curvature, found
    angle, _, x, y = bent(curvature, 1.0, s=np.linspace(0.0, 1.0, _POINTS))
    points = L * np.stack([x, y, 0.0 * x], axis=-1)
    cos, sin = np.cos(angle[-1]), np.sin(angle[-1])
    tip = np.eye(4)
    tip[:2, :2], tip[:3, 3] = [[cos, -sin], [sin, cos]], points[-1]
    return Elastica(tip, points, angle)


# --- segments with springs -----------------------------------------------------------------------


def lumped(arm: FlexibleRobot, segments: int) -> tuple[RobotModel, Array]:
    """Rigid segments and springs in place of the beams of an arm: an independent model of it.

    Each beam becomes ``segments`` + 1 rigid parts, halves at the ends, with a joint for each
    elastic direction between them. Its frequencies approach those of the beam with 1 / segments^2;
    of slender ones, as the sections of segments have inertia when they bend, those of modes none.
    """
    if not isinstance(segments, int | np.integer) or segments < 1:
        raise InvalidValueError(f"segments: expected a number from 1, got {segments!r:.40}.")
    if len(check_arm(arm).joints) or not all(link.source for link in arm.links.values()):
        raise InvalidValueError(
            "arm: lumped models are made of beams; links from modes and flexible joints have none."
        )
    model, table, columns = arm.model, arm.model.table, list[int]()
    rows, inertia, springs, ends = list[Row](), list[Array](), list[float](), [0]
    for k in range(model.f):
        row = {name: getattr(table, name)[k] for name in _ROW}
        rows.append({**row, "antecedent": ends[int(table.antecedent[k])]})
        if row["sigma"] < 2:
            columns.append(len(springs))
            springs.append(0.0)
        if link := arm.links.get(k + 1):
            _append_beam(link.source, int(segments), rows, inertia, springs)  # type: ignore[arg-type]
        else:
            inertia.append(model.inertia.values[k])
        ends.append(len(rows))
    drives = {name: np.zeros(len(springs)) for name in ("Ia", "Fv", "Fc", "offset")}
    for name, values in drives.items():
        values[columns] = getattr(model.drive, name)
    tool = model.tool
    if model.tip in arm.links and np.array_equal(tool, np.eye(4)):
        tool = se3.translation(*arm.links[model.tip].tip.position)
    parts = InertialParameters(np.array(inertia)), replace(model.drive, **drives), model.base, tool
    name = f"{model.name} in segments"
    made = DHTable.from_rows(rows)
    segmented = RobotModel.from_table(made, *parts, ends[model.tip], model.gravity, name=name)
    return segmented, np.array(springs)


def _append_beam(
    beam: BeamData, count: int, rows: list[Row], inertia: list[Array], springs: list[float]
) -> None:
    """Append the parts of a beam: their first is the row of the joint, their last where it was."""
    from scipy.spatial.transform import Rotation

    h = beam.length / count

    def append(*added: Row) -> None:
        """Rows, fixed ones unless they have sigma, each behind the last."""
        for row in added:
            rows.append({"sigma": 2, **row})
            inertia.append(np.zeros(10))

    def place(T: Array) -> None:
        """Two fixed rows: a translation, then a rotation, which is the frame of a part."""
        x, y, z = T[:3, 3]
        turn, d = float(np.arctan2(y, x)), float(np.hypot(x, y))
        yaw, pitch, roll = Rotation.from_matrix(T[:3, :3]).as_euler("ZYX").tolist()
        append({"gamma": turn, "d": d, "theta": -turn, "r": z})
        append({"gamma": yaw, "beta": pitch, "alpha": roll})

    def hold(mass: float, com: Array, J: Array) -> None:
        """Add inertia to the last part."""
        inertia[-1] = inertia[-1] + InertialParameters.from_com([mass], [com], [J]).values[0]

    # bending about y and z, torsion: the angles that make z the axis of the hinge, and back
    turn = np.pi / 2
    turns = ({"alpha": -turn}, {"alpha": turn}), ({}, {}), ({"beta": turn}, {"beta": -turn})
    hinges = [x for x in zip((*beam.EI, beam.GJ), turns, strict=True) if np.isfinite(x[0])]
    inertia.append(np.r_[0.0, 0.0, 0.0, 0.0, 0.0, beam.hub, np.zeros(4)])
    place(beam.pose)
    for k in range(count + 1):
        if k:
            append({"d": 0.5 * h if k == 1 else h})
            for stiffness, (there, back) in hinges:
                append({"sigma": 0, **there}, back)
                springs.append(stiffness / h)
        length = h if 0 < k < count else 0.5 * h
        mass = beam.density * length
        bent, spin = mass * length**2 / 12.0, 0.5 * mass * beam.gyration**2
        hold(mass, 0.5 * length * _X, np.diag([2.0 * spin, bent + spin, bent + spin]))
    tip_mass, com, J = beam.tip
    hold(tip_mass, com + 0.5 * h * _X, J)
    place(se3.translation(0.5 * h - beam.length, 0.0, 0.0) @ np.linalg.inv(beam.pose))

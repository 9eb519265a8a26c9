"""Workspaces of parallel robots: limits of legs, cones of joints, interference of legs.

Parameters
----------
robot : ParallelRobot
    The robot.
kind : {"orientation", "dexterous", "reachable"}
    Positions in the given orientation, in every one of them, or in at least one of them.
orientation : array_like, shape (3, 3) or (K, 3, 3), or float, optional
    Rotations of the platform, or its angle about z, rad. Default the home orientation; of dexterous
    and reachable workspaces 72 angles about z, in space turned from home.
limits : bool or tuple (lower, upper)
    Whether the robot's limits count, or limits in their place, m or rad.
joint_cone, leg_radius : float, optional
    Largest angle between a leg and its direction at home, seen from base and platform, rad; radius
    of legs and rods, which must not touch each other, m.
height, resolution : float and int, optional
    Makes a section at this z of the world, m; cells along each axis, default 300 in a plane, 40 in
    space.

Returns
-------
PlatformWorkspace
    A `performance.Workspace` whose ``count`` is the number of working modes, with ``margin`` (N,)
    at the centres of the cells: the least distance of lengths or angles from their limits, and of
    joints and legs from theirs, m or rad, negative outside. Areas and volumes are interpolated from
    it. ``rotations`` (K, 3, 3), ``lower`` and ``upper`` (m,) are those that count.

Examples
--------
>>> from robotmodels.parallel import planar_3rpr
>>> robot = planar_3rpr([[0, 0], [2, 0], [1, 2]], [[0, 0], [0.5, 0], [0.2, 0.5]], 0.3, 1.5)
>>> round(workspace(robot, orientation=0.1, resolution=100).area, 2)
1.2
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, as_core, as_count, as_floats, as_number, read_only
from .._choices import one_of
from ..errors import InvalidValueError, ShapeError
from ..obstacles.shapes import nearest_points
from ..performance import Workspace, WorkspaceStatus
from .families import checked_limits
from .legs import LegStates, is_looped, leg_states
from .robot import ParallelRobot

KINDS = ("orientation", "dexterous", "reachable")
_ROWS = 20000  # poses at a time
_MOST = 1e8  # cells
_FAR = 1e9


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PlatformWorkspace(Workspace):
    """Workspace of a platform: `performance.Workspace` with margins. Read-only."""

    margin: Array
    rotations: Array
    lower: Array
    upper: Array
    joint_cone: float | None
    leg_radius: float | None

    @property
    def area(self) -> float:
        """Area that is reached, m^2; NaN in space."""
        return measure(self.margin.reshape(self.shape), self.size, 2)

    @property
    def volume(self) -> float:
        """Volume that is reached, m^3; NaN in a plane."""
        return measure(self.margin.reshape(self.shape), self.size, 3)

    def contains(self, points: ArrayLike) -> Any:
        """Whether points (..., 2 or 3) are reached, computed exactly; shape (...)."""
        given = as_core(points, (len(self.size),), "points")
        rows = self.cells.world(given.reshape(-1, given.shape[-1]))
        options = self.rotations, self.lower, self.upper, self.joint_cone, self.leg_radius
        robot: Any = self.model
        return (_margins(robot, self.kind, rows, options)[0] >= 0.0).reshape(given.shape[:-1])


def workspace(
    robot: ParallelRobot,
    kind: str = "orientation",
    orientation: ArrayLike | None = None,
    limits: bool | tuple[Any, Any] = True,
    joint_cone: float | None = None,
    leg_radius: float | None = None,
    height: float | None = None,
    resolution: int | None = None,
) -> PlatformWorkspace:
    """Workspace of a platform: positions reached in one, every, or some orientation."""
    if is_looped(robot):
        raise InvalidValueError("robot: workspaces of kinematic loops are not computed.")
    one_of(kind, KINDS, "kind")
    R, (low, high) = _rotations(robot, kind, orientation), _limits(robot, limits)
    bounds = [
        None if x is None else as_number(x, n, above=0.0)
        for x, n in ((joint_cone, "joint_cone"), (leg_radius, "leg_radius"))
    ]
    d = 2 if 2 not in robot.columns or height is not None else 3
    frame = np.eye(4)
    if d == 2:
        frame[2, 3] = robot.home[2, 3] if height is None else as_number(height, "height")
    cells = {2: 300, 3: 40}[d] if resolution is None else resolution
    n = as_count(cells, "resolution", 2, int(_MOST ** (1 / d)))
    # the boxes about spheres of the legs' longest reach
    reach = robot.crank + robot.rod if robot.has_cranks else high
    if not np.isfinite(reach).all():
        raise InvalidValueError(
            "limits: legs of unlimited length reach everywhere; give limits=(lower, upper)."
        )
    centre = robot.base - robot.platform @ np.swapaxes(R, 1, 2)
    first, last = (centre - reach[:, None]).max(axis=1), (centre + reach[:, None]).min(axis=1)
    every = kind == "dexterous"
    first = first.max(axis=0) if every else first.min(axis=0)
    last = last.min(axis=0) if every else last.max(axis=0)
    half = 0.5 * np.maximum(last - first, 1e-3 * robot.size)[:d]
    size = 2.02 * half / (n - 1)  # centres of the outermost cells are outside
    axes = 0.5 * (first + last)[:d] + np.outer(np.arange(n) - 0.5 * (n - 1), size)
    points = np.stack(np.meshgrid(*axes.T, indexing="ij"), axis=-1).reshape(-1, d)
    options = (read_only(R), low, high, *bounds)
    places = points @ frame[:3, :d].T + frame[:3, 3]
    margin, count = _margins(robot, kind, places, options)
    status = WorkspaceStatus.COUNTED if len(R) == 1 else WorkspaceStatus.SAMPLED
    status = status if count.any() else WorkspaceStatus.EMPTY
    model: Any = robot
    return PlatformWorkspace(
        model, kind, limits is not False, None, None, R[0], points, count, size, (n,) * d,
        "plane" if d == 2 else "space", frame, status, margin, *options,
    )  # fmt: skip


def measure(f: Array, size: Array, dimension: int) -> float:
    """Area or volume where a function is positive, linear within cells about nodes; else NaN."""
    d = f.ndim
    if d != dimension:
        return float("nan")
    rise = np.abs(np.gradient(f))  # across a cell, along each axis
    rise = np.maximum(rise, 1e-3 * rise.max(axis=0) + 1e-30)
    half = 0.5 * rise.sum(axis=0)
    f = np.clip(f, -half, half)
    share = np.zeros(f.shape)
    for corner in product((-0.5, 0.5), repeat=d):
        top = np.maximum(f + np.tensordot(corner, rise, axes=1), 0.0)
        share += np.sign(np.prod(corner)) * top**2 * top ** (d - 2)  # quicker than a cube
    share /= factorial(d) * rise.prod(axis=0)
    return float(share.sum() * np.prod(size))


def _rotations(robot: ParallelRobot, kind: str, orientation: Any) -> Array:
    """Rotations that are looked at, shape (K, 3, 3)."""
    home, turns = robot.home[:3, :3], np.zeros(1)
    if orientation is None and kind != "orientation" and 5 in robot.columns:
        turns = 2.0 * np.pi * np.arange(72) / 72
    elif orientation is not None and np.ndim(orientation) == 0:
        home, turns = np.eye(3), np.array([as_number(orientation, "orientation")])
    R = np.array([se3.rotation("z", angle)[:3, :3] for angle in turns]) @ home
    given: Any = orientation
    if np.ndim(given):
        R = as_floats(given, "orientation")
    if R.shape[-2:] != (3, 3) or R.ndim > 3 or not len(R):
        raise ShapeError(
            f"orientation: expected an angle, or rotations (3, 3) or (K, 3, 3), got {R.shape}."
        )
    R = R.reshape(-1, 3, 3)
    if kind == "orientation" and len(R) > 1:
        raise ShapeError("orientation: expected one rotation; several suit the other kinds.")
    T = np.tile(robot.home, (len(R), 1, 1))
    T[:, :3, :3] = R
    return robot.checked(T, "orientation")[:, :3, :3]


def _limits(robot: ParallelRobot, limits: Any) -> tuple[Array, Array]:
    """Limits that count."""
    if isinstance(limits, bool | np.bool_):
        limits = (robot.lower, robot.upper) if limits else (None, None)
    if not isinstance(limits, tuple | list) or len(limits) != 2:
        raise InvalidValueError(
            f"limits: expected True, False or (lower, upper), got {limits!r:.60}."
        )
    lower, upper = limits
    return checked_limits(lower, upper, robot.m, not robot.has_cranks)


def _margins(
    robot: ParallelRobot, kind: str, places: Array, options: tuple[Any, ...]
) -> tuple[Array, NDArray[np.int64]]:
    """Margins and numbers of working modes at positions (N, 3)."""
    R = options[0]
    margin = np.full(len(places), -_FAR if kind == "reachable" else _FAR)
    count = np.zeros(len(places), np.int64)
    for start in range(0, len(places), _ROWS):
        part = slice(start, start + _ROWS)
        T = np.tile(np.eye(4), (len(places[part]), 1, 1))
        T[:, :3, 3] = places[part]
        for rotation in R:
            T[:, :3, :3] = rotation
            here, modes = _margin(robot, T, *options[1:])
            pick = np.maximum if kind == "reachable" else np.minimum
            margin[part] = pick(margin[part], here)
            count[part] = np.maximum(count[part], modes)
    return margin, np.where(margin >= 0.0, count, 0)


def _margin(
    robot: ParallelRobot, T: Array, low: Array, high: Array, cone: Any, radius: Any
) -> tuple[Array, Array]:
    """Margins and numbers of working modes at poses. Shapes: (N, 4, 4) -> (N,), (N,)."""
    every: list[Array] = []
    for mode in (0, 2**robot.m - 1) if robot.has_cranks else (0,):
        legs = leg_states(robot, T, mode)
        q = legs.q
        if robot.has_cranks:
            first = np.where(np.isfinite(low), low, 0.0)
            q = np.where(np.isfinite(low), first + np.mod(q - first, 2.0 * np.pi), q)
        inside = np.minimum(q - low, high - q)
        if robot.has_cranks:
            inside = np.minimum(inside, _annulus(robot, T[:, None, :3, 3] + legs.arm - robot.base))
        if cone is not None:
            inside = np.minimum(inside, cone - _bend(robot, T, legs))
        every.append(inside)
    count = np.prod(np.sum([inside >= 0.0 for inside in every], axis=0), axis=1)
    margin = np.minimum(np.maximum.reduce(every).min(axis=1), _FAR)
    if radius is not None:
        margin = np.minimum(margin, _clearance(T, leg_states(robot, T)) - 2.0 * radius)
    return margin, count


def _annulus(robot: ParallelRobot, d: Array) -> Array:
    """Distance of anchors from the reach of cranks that turn in planes. Shapes: -> (N, m)."""
    x, y = (d * robot.outward).sum(axis=-1), (d * robot.downward).sum(axis=-1)
    across = (d * np.cross(robot.outward, robot.downward)).sum(axis=-1)
    rho, rest = np.hypot(x, y), robot.rod**2 - across**2
    rod = np.sqrt(np.maximum(rest, 0.0))
    near = np.minimum(robot.crank + rod - rho, rho - np.abs(robot.crank - rod))
    return np.where(rest >= 0.0, near, robot.rod - np.abs(across))


def _bend(robot: ParallelRobot, T: Array, legs: LegStates) -> Array:
    """Angles of legs from their directions at home, at the base and the platform: the larger."""
    home = leg_states(robot, robot.home[None]).direction
    pairs = ((legs.direction, home), (legs.direction @ T[:, :3, :3], home @ robot.home[:3, :3]))
    cosine = np.minimum(*((a * b).sum(axis=-1) for a, b in pairs))
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _clearance(T: Array, legs: LegStates) -> Array:
    """Least distance between rods that do not share an end. Shapes: N poses -> (N,)."""
    start, end = legs.knee, T[:, None, :3, 3] + legs.arm
    least = np.full(len(T), np.inf)
    for i, j in combinations(range(start.shape[1]), 2):
        a, b, c, e = start[:, i], end[:, i], start[:, j], end[:, j]
        if any(np.abs(apart).max(initial=0.0) < 1e-12 for apart in (a - c, b - e)):
            continue
        s, t = nearest_points(a, b, c, e)
        gap = a + s[:, None] * (b - a) - c - t[:, None] * (e - c)
        least = np.minimum(least, np.linalg.norm(gap, axis=-1))
    return least

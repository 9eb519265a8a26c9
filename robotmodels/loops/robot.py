"""Robots with kinematic loops: a spanning tree, the closures of its cut loops, actuated joints."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Value, as_floats, read_only
from .._choices import as_instance, one_of
from ..errors import InvalidValueError, LoopError
from ..geometry import PRISMATIC
from ..minimal_parameters.rules import reach
from ..model import RobotModel

ROWS = {"point": 3, "revolute": 5, "full": 6}
"""Number of constraint rows of each kind of closure."""
_AXES = ("x", "y", "z", "rx", "ry", "rz")
_NO_EFFECT = 1e-10  # largest entry of the Jacobian of a closure without effect, dimensionless


@dataclass(frozen=True, slots=True)
class Closure:
    """Closure of a cut loop: two frames of the spanning tree that have to coincide.

    Parameters
    ----------
    name : str
        Name of the closure, which messages and constraint rows use.
    frames : (int or str, int or str)
        Numbers or names of the two frames, on different bodies; 0 is the base.
    kind : {"revolute", "point", "full"}
        ``"revolute"``: origins and z axes coincide (rows ``x y z rx ry``); ``"point"``: origins
        coincide, as in a spherical joint; ``"full"``: the frames coincide, as in a cut body.

    Examples
    --------
    >>> Closure("cut", frames=(4, 7)).rows
    ('cut.x', 'cut.y', 'cut.z', 'cut.rx', 'cut.ry')
    """

    name: str
    frames: tuple[int | str, int | str]
    kind: str = "revolute"

    def __post_init__(self) -> None:
        pair = self.frames
        if not as_instance(self.name, str, "name"):
            raise InvalidValueError("name: expected a text, not empty.")
        one_of(self.kind, tuple(ROWS), "kind")
        if isinstance(pair, str) or not isinstance(pair, Iterable) or len(tuple(pair)) != 2:
            raise InvalidValueError(
                f"frames: expected two frames of the tree such as (4, 7), got {pair!r:.60}."
            )
        object.__setattr__(self, "frames", tuple(pair))

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the constraint rows: the closure's name and the axis of its first frame."""
        return tuple(f"{self.name}.{axis}" for axis in _AXES[: ROWS[self.kind]])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LoopedRobot(Value):
    """Robot with kinematic loops: spanning tree, closures and actuated joints. Read-only.

    Closures between frames of one body, and those that no joint can violate, raise LoopError.

    Parameters
    ----------
    tree : RobotModel
        Spanning tree of n joints, in which each loop is cut.
    closures : sequence of Closure
        Closures of the cut loops.
    actuated : array_like of int, shape (n_a,), optional
        Columns of ``q`` of the actuated joints, from 0; default the joints with ``mu = 1``.

    Attributes
    ----------
    passive : ndarray of int, shape (n - n_a,)
        Columns of the passive joints, ascending.
    units : ndarray, shape (n,)
        Natural unit of each joint: 1 rad, or the size of the robot in metres.
    rows : tuple of str
        Names of the c constraint rows, such as ``"cut.x"``.

    References
    ----------
    W. Khalil and J.-F. Kleinfinger, "A new geometric notation for open and closed-loop robots",
    ICRA 1986. Book sections 1.2.1 and 2.2.

    Examples
    --------
    A parallelogram: two cranks on the base, a coupler on the first one that meets the second.

    >>> from robotmodels.geometry import DHTable
    >>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
    >>> LoopedRobot(RobotModel.from_table(table), [Closure("cut", (4, 5))], actuated=[0])
    <LoopedRobot 'robot': 3 joints, actuated [0], closures: cut (revolute)>
    """

    tree: RobotModel
    closures: Sequence[Closure]
    actuated: NDArray[np.int64] = None  # type: ignore[assignment]
    passive: NDArray[np.int64] = field(init=False)
    units: Array = field(init=False)
    rows: tuple[str, ...] = field(init=False)
    cuts: Any = field(init=False)
    scratch: Any = field(init=False)

    def __post_init__(self) -> None:
        tree, given = as_instance(self.tree, RobotModel, "tree"), self.closures
        closures = tuple(given) if isinstance(given, Iterable) else (given,)
        names = [as_instance(x, Closure, f"closures[{k}]").name for k, x in enumerate(closures)]
        if len(set(names)) < len(names):
            raise InvalidValueError(f"closures: each needs its own name, got {', '.join(names)}.")
        actuated, cuts = _actuated(tree, self.actuated), _cuts(tree, closures)
        for name, value in {
            "closures": closures,
            "actuated": actuated,
            "passive": read_only(np.setdiff1d(np.arange(tree.n), actuated), np.int64),
            "units": cuts.units,
            "rows": tuple(row for closure in closures for row in closure.rows),
            "cuts": cuts,
            "scratch": threading.local(),
        }.items():
            object.__setattr__(self, name, value)
        acting_rows(self)

    @property
    def n(self) -> int:
        """Number of joints of the tree."""
        return self.tree.n

    @property
    def name(self) -> str:
        """Name of the tree."""
        return self.tree.name

    def __repr__(self) -> str:
        listed = ", ".join(f"{c.name} ({c.kind})" for c in self.closures) or "none"
        joints = f"{self.n} joints, actuated {self.actuated.tolist()}"
        return f"<LoopedRobot {self.name!r}: {joints}, closures: {listed}>"

    @property
    def _values(self) -> tuple[Any, ...]:
        return self.tree, self.closures, self.actuated


def scaled(robot: LoopedRobot, J: Array) -> Array:
    """Rows (..., c, n) of the closures in sizes of the robot, rad and natural joint units."""
    return np.sqrt(robot.cuts.weight)[:, None] * J * robot.units


def check_looped(robot: object) -> None:
    """Raise unless the argument is a looped robot."""
    as_instance(robot, LoopedRobot, "robot", "(tree, closures, actuated)")


def _actuated(tree: RobotModel, actuated: Any) -> NDArray[np.int64]:
    """Columns of the actuated joints."""
    if actuated is None:
        return read_only(np.flatnonzero(tree.table.mu[tree.table.joint_rows]), np.int64)
    given = as_floats(actuated, "actuated")
    known = given.ndim == 1 and np.isin(given, np.arange(tree.n)).all()
    if not known or len({*given.tolist()}) < given.size:
        raise InvalidValueError(
            f"actuated: expected different columns below {tree.n}, got {actuated!r:.60}."
        )
    return read_only(given, np.int64)


def _cuts(tree: RobotModel, closures: tuple[Closure, ...]) -> Any:
    """Arrays of closures."""
    from .kernels import Cuts

    size, table = reach(tree), tree.table
    places = [tree.twin.frame(frame) for closure in closures for frame in closure.frames]
    paths = [np.isin(table.joint_rows + 1, x.path).astype(int) for x in places]
    weight = [[1.0 / size**2] * 3 + [1.0] * (ROWS[c.kind] - 3) for c in closures]
    return Cuts(
        chain=tree.chain,
        parent=read_only([x.parent for x in places], np.int64),
        rotation=read_only(np.reshape([x.rotation for x in places], (-1, 3, 3))),
        position=read_only(np.reshape([x.position for x in places], (-1, 3))),
        rows=read_only([ROWS[c.kind] for c in closures], np.int64),
        side=read_only(np.ravel(np.subtract(paths[1::2], paths[::2])), np.int64),
        units=read_only(np.where(table.sigma[table.joint_rows] == PRISMATIC, size, 1.0)),
        weight=read_only(np.concatenate([[], *weight])),
    )


def acting_rows(robot: LoopedRobot) -> NDArray[np.bool_]:
    """Rows that some joint can violate (c,); raises for closures without any, and of one body."""
    from .kernels import closure_jacobians

    q = np.random.default_rng(0).uniform(-3.0, 3.0, (3, robot.n))
    e, J = np.empty((3, len(robot.rows))), np.empty((3, len(robot.rows), robot.n))
    closure_jacobians(q, robot.cuts, e, J)
    acts = np.abs(scaled(robot, J)).max(axis=(0, 2), initial=0.0) > _NO_EFFECT
    sides = robot.cuts.side.reshape(-1, robot.n)
    for closure, side in zip(robot.closures, sides, strict=True):
        named = "closure {!r}: the frames {!r} and {!r}".format(closure.name, *closure.frames)
        if not side.any():
            raise LoopError(
                f"{named} are on the same body; give frames of the two bodies that it joins."
            )
        if not acts[[robot.rows.index(row) for row in closure.rows]].any():
            raise LoopError(f"{named} add no constraint, as no joint moves them apart.")
    return acts

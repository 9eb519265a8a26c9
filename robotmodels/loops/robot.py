"""Robots with kinematic loops: a spanning tree, the closures of its cut loops, actuated joints."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Value, read_only
from ..errors import InvalidValueError, LoopError
from ..geometry import PRISMATIC
from ..kinematics import dgm, jacobian
from ..minimal_parameters.rules import reach
from ..model import RobotModel

ROWS = {"point": 3, "revolute": 5, "full": 6}
"""Number of constraint rows of each kind of closure."""
_AXES = ("x", "y", "z", "rx", "ry", "rz")
_NO_EFFECT = 1e-10  # largest entry of the Jacobian of a closure without effect, of the robot's size


class Cuts(NamedTuple):
    """Closures as kernels take them: the two frames of each, and its joints.

    Shapes: first, second, rows (k,); rotation (2 k, 3, 3), position (2 k, 3), of the frames in rows
    of the table; side (k n,): -1 or 1 for joints that move the first or the second frame alone.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    rows: NDArray[np.int64]
    rotation: Array
    position: Array
    side: NDArray[np.int64]
    units: Array
    length: Array


@dataclass(frozen=True, slots=True)
class Closure:
    """Closure of a cut loop: two frames of the spanning tree that have to coincide.

    Parameters
    ----------
    name : str
        Name of the closure, which messages and constraint rows use.
    frames : (int or str, int or str)
        Numbers or names of the two frames; 0 is the base. They lie on different bodies.
    kind : {"revolute", "point", "full"}
        ``"revolute"``: origins and z axes coincide, as in a cut revolute joint, rows
        ``x y z rx ry``; ``"point"``: origins coincide, as in a spherical joint, rows ``x y z``;
        ``"full"``: the frames coincide, as in a cut body, rows ``x y z rx ry rz``.

    Raises
    ------
    InvalidValueError
        An empty name, another kind, or not two frames.

    References
    ----------
    Seed book section 1.2.1; W. Khalil and J.-F. Kleinfinger, "A new geometric notation for open and
    closed-loop robots", ICRA 1986.

    Examples
    --------
    >>> Closure("cut", frames=(4, 7)).rows
    ('cut.x', 'cut.y', 'cut.z', 'cut.rx', 'cut.ry')
    """

    name: str
    frames: tuple[int | str, int | str]
    kind: str = "revolute"

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise InvalidValueError(f"name: expected a text, not empty, got {self.name!r:.60}.")
        if self.kind not in ROWS:
            kinds = ", ".join(map(repr, ROWS))
            raise InvalidValueError(f"kind: expected one of {kinds}, got {self.kind!r:.60}.")
        pair = self.frames
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

    Joint variables ``q (..., n)`` are those of all n joints of the tree; n_a of them are actuated.

    Parameters
    ----------
    tree : RobotModel
        Spanning tree, in which each loop is cut.
    closures : sequence of Closure
        Closures of the cut loops.
    actuated : array_like of int, shape (n_a,), optional
        Columns of ``q`` of the actuated joints, from 0; default the joints with ``mu = 1``.

    Raises
    ------
    LoopError
        A closure between frames of one body, or one that no joint can violate.
    FrameNotFoundError, InvalidValueError, ShapeError
        Unknown frames; repeated names; actuated joints that do not exist or are repeated.

    References
    ----------
    Seed book section 1.2.1, for the tree; the article of `Closure`, for cut loops.

    Examples
    --------
    A parallelogram: two cranks on the base, a coupler of which both carry an end.

    >>> from robotmodels.geometry import DHTable
    >>> table = DHTable(antecedent=[0, 0, 1, 3, 2], sigma=[0, 0, 0, 2, 2], d=[0, 1, 0.5, 1, 0.5])
    >>> robot = LoopedRobot(RobotModel.from_table(table), [Closure("cut", (4, 5))], actuated=[0])
    >>> robot
    <LoopedRobot 'robot': 3 joints, 1 actuated, closures: cut (revolute)>
    """

    tree: RobotModel
    closures: tuple[Closure, ...]
    actuated: NDArray[np.int64] = None  # type: ignore[assignment]
    _cuts: Cuts | None = field(default=None, init=False)
    scratch: Any = field(default=None, init=False)

    def __post_init__(self) -> None:
        if not isinstance(self.tree, RobotModel):
            raise InvalidValueError(
                f"tree: expected the RobotModel of a spanning tree, got {type(self.tree).__name__}."
            )
        closures = self.closures if isinstance(self.closures, Iterable) else (self.closures,)
        object.__setattr__(self, "closures", tuple(closures))
        for k, closure in enumerate(self.closures):
            if not isinstance(closure, Closure):
                raise InvalidValueError(f"closures[{k}]: expected a Closure, got {closure!r:.60}.")
        names = [closure.name for closure in self.closures]
        if len(set(names)) < len(names):
            raise InvalidValueError(f"closures: each needs its own name, got {', '.join(names)}.")
        object.__setattr__(self, "actuated", self._checked_actuated())
        object.__setattr__(self, "_cuts", self._checked_cuts())
        object.__setattr__(self, "scratch", threading.local())

    def _checked_actuated(self) -> NDArray[np.int64]:
        """Columns of the actuated joints."""
        table, n = self.tree.table, self.tree.n
        if self.actuated is None:
            return read_only(np.flatnonzero(table.mu[table.joint_rows]), np.int64)
        given = np.asarray(self.actuated)
        if given.ndim != 1 or (given.size and given.dtype.kind not in "iu"):
            raise InvalidValueError(
                f"actuated: expected columns of q such as [0, 1], got {self.actuated!r:.60}."
            )
        wrong = [int(j) for j in given if not 0 <= j < n]
        if wrong or len(set(given.tolist())) < given.size:
            raise InvalidValueError(
                f"actuated: expected different columns from 0 to {n - 1}, got {given.tolist()}."
            )
        return read_only(given, np.int64)

    def _checked_cuts(self) -> Cuts:
        """Arrays of the closures, each of which some joint can violate."""
        tree, size = self.tree, reach(self.tree)
        moving = tree.table.joint_rows + 1
        sides = np.zeros((len(self.closures), tree.n), dtype=np.int64)
        places = []
        for closure, side in zip(self.closures, sides, strict=True):
            first, second = pair = [tree.twin.frame(frame) for frame in closure.frames]
            side[:] = np.isin(moving, second.path).astype(int) - np.isin(moving, first.path)
            places += pair
            named = f"closure {closure.name!r}: the frames {closure.frames[0]!r} and "
            if not side.any():
                raise LoopError(
                    f"{named}{closure.frames[1]!r} are on the same body; give frames of the two "
                    "bodies that the closure joins."
                )
            if not _acts(tree, closure, size):
                raise LoopError(
                    f"{named}{closure.frames[1]!r} add no constraint: no joint moves them against "
                    f"each other in the rows {', '.join(closure.rows)}. Remove the closure, or "
                    "correct its frames."
                )
        slides = tree.table.sigma[moving - 1] == PRISMATIC
        return Cuts(
            first=read_only([place.parent for place in places[::2]], np.int64),
            second=read_only([place.parent for place in places[1::2]], np.int64),
            rows=read_only([ROWS[closure.kind] for closure in self.closures], np.int64),
            rotation=read_only(np.array([p.rotation for p in places]).reshape(-1, 3, 3)),
            position=read_only(np.array([p.position for p in places]).reshape(-1, 3)),
            side=read_only(sides.ravel(), np.int64),
            units=read_only(np.where(slides, size, 1.0)),
            length=read_only([size]),
        )

    @property
    def n(self) -> int:
        """Number of joints of the tree."""
        return self.tree.n

    @property
    def name(self) -> str:
        """Name of the tree."""
        return self.tree.name

    @property
    def passive(self) -> NDArray[np.int64]:
        """Columns of the passive joints, ascending."""
        return np.setdiff1d(np.arange(self.n), self.actuated)

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the c constraint rows, such as ``"cut.x"``."""
        return tuple(row for closure in self.closures for row in closure.rows)

    @property
    def cuts(self) -> Cuts:
        """Closures as arrays for the kernels."""
        return self._cuts  # type: ignore[return-value]

    def __repr__(self) -> str:
        listed = ", ".join(f"{c.name} ({c.kind})" for c in self.closures[:4])
        more = f" and {len(self.closures) - 4} more" if len(self.closures) > 4 else ""
        return (
            f"<LoopedRobot {self.name!r}: {self.n} joints, {len(self.actuated)} actuated, "
            f"closures: {listed or 'none'}{more}>"
        )

    @property
    def _values(self) -> tuple[Any, ...]:
        return self.tree, self.closures, self.actuated


def _acts(tree: RobotModel, closure: Closure, size: float) -> bool:
    """Whether some joint moves the two frames against each other in the rows of the closure."""
    for q in np.random.default_rng(0).uniform(-3.0, 3.0, (3, tree.n)):
        first, second = (dgm(tree, q, frame) for frame in closure.frames)
        twist = np.subtract(*(jacobian(tree, q, frame, "world") for frame in closure.frames))
        linear = twist[:3] + np.cross(twist[3:], second[:3, 3], axis=0)
        rows = np.vstack((linear / size, twist[3:]))
        rows = np.vstack((first[:3, :3].T @ rows[:3], first[:3, :3].T @ rows[3:]))
        if np.abs(rows[: ROWS[closure.kind]]).max(initial=0.0) > _NO_EFFECT:
            return True
    return False


def check_looped(robot: object) -> None:
    """Refuse what is not a looped robot."""
    if not isinstance(robot, LoopedRobot):
        hint = (
            "; give its closures: LoopedRobot(tree, closures=[...])"
            if isinstance(robot, RobotModel)
            else ""
        )
        raise InvalidValueError(f"robot: expected a LoopedRobot, got {type(robot).__name__}{hint}.")

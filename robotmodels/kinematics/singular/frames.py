"""Frames in which the lost directions are simplest: their axes, and their point.

A wrench that is balanced without motor torques has other components at another point, and so has
the combination of velocities that cannot be produced. In the right frame most of them are zero; the
book finds that frame by choosing the projection and the intermediate frame of the Jacobian.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ...errors import FrameNotFoundError, InvalidValueError
from ..poses import dgm, link_poses
from .rank import combination_text, normalised, sparse_basis
from .task import SingularTask

WORLD = -1
"""In place of a frame's number: the axes of the world."""

_VELOCITY = ("vx", "vy", "vz", "wx", "wy", "wz")
_WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")


@dataclass(frozen=True, slots=True, eq=False)
class LostDirections(Rebuilt):
    """Combinations of velocities that cannot be produced, in chosen axes at a chosen point.

    Parameters
    ----------
    axes, point : int or None
        Numbers of the frames in whose axes and at whose origin they are; 0 is R_0, -1 the world,
        None the frame of the task (the tool).
    wrenches : ndarray, shape (p, 6)
        Rows ``c = [f; m]``: ``c . [v; w] = 0`` for every twist the joints can produce, and by
        duality the wrench c needs no joint torque. Largest component 1, forces in N for moments in
        N m.
    twists : ndarray, shape (p, 6)
        Rows ``[v; w]``, m/s and rad/s, orthogonal to all twists that can be produced when metres
        are divided by the characteristic length. Where a wrench is a pure force or a pure moment,
        its twist has the same numbers whatever that length is.
    frame : str
        Name of the frame of the task, such as ``"the tool"``.
    """

    axes: int | None
    point: int | None
    wrenches: Array
    twists: Array
    frame: str = "the tool"

    @property
    def where(self) -> str:
        """Axes and point in words."""
        names = {None: self.frame, WORLD: "the world"}
        axes, point = (names.get(k, f"R{k}") for k in (self.axes, self.point))
        return f"axes of {axes}, at the origin of {point}"

    def rounded(self, least: float) -> tuple[str, ...]:
        """Combinations in words, without coefficients below ``least``."""
        rows = np.where(np.abs(self.wrenches) < least, 0.0, self.wrenches)
        return tuple(combination_text(row, _VELOCITY) for row in rows)

    @property
    def combinations(self) -> tuple[str, ...]:
        """Combinations of velocity components that stay zero, in words."""
        return tuple(combination_text(row, _VELOCITY) for row in self.wrenches)

    @property
    def carried(self) -> tuple[str, ...]:
        """Wrenches that are carried without torque, in words."""
        return tuple(combination_text(row, _WRENCH) for row in self.wrenches)


def lost_in_task_axes(task: SingularTask, lost: Array) -> LostDirections:
    """Lost directions in the axes of the task (the world's, or the frame's own), at its origin.

    Shapes: lost (m, p).
    """
    axes = None if task.mask_axes == "tool" else WORLD
    return _expressed(task, _wide(task, lost).T, axes, None, 1e-9)


def simplest_frame(
    task: SingularTask,
    q: Array,
    lost: Array,
    missing: Array,
    zero: float,
    axes: int | None = None,
    point: int | None = None,
) -> LostDirections:
    """Lost directions in the axes and at the point where they have the most zeros.

    Shapes: q (n,), lost (m, p), missing (m, s).
    """
    model = task.model
    tool = dgm(model, q, task.frame)
    poses: dict[int | None, Array] = {None: tool, 0: model.base}
    links = link_poses(model, q)
    for j in model.twin.frame(task.frame).path:
        poses[int(j)] = links[int(j) - 1]
    whole = task.is_whole
    if not _has_vectors(task):
        return lost_in_task_axes(task, lost)
    start = tool[:3, :3] if task.mask_axes == "tool" else np.eye(3)
    spaces = _wide(task, lost).T, _wide(task, missing).T
    best: tuple[tuple[float, ...], LostDirections] | None = None
    for k, A in poses.items():
        for j, P in poses.items():
            if j is not None and not whole:
                continue
            if (axes not in (None, k)) or (whole and point not in (None, j)):
                continue
            turn, lever = A[:3, :3].T @ start, start.T @ (tool[:3, 3] - P[:3, 3])
            rows = _complement(task, *(_moved(s, turn, lever) for s in spaces))
            found = _expressed(task, rows, k, j, zero)
            size = np.abs(found.wrenches).max(axis=1, keepdims=True, initial=0.0)
            zeros = int((np.abs(found.wrenches) <= zero * size).sum())
            nearness = [model.f + 1 if i is None else i for i in (j, k)]
            rank = (-zeros, k != j, -nearness[0], -nearness[1])
            if best is None or rank < best[0]:
                best = rank, found
    assert best is not None  # the frame itself is always among them
    return best[1]


def check_frames(task: SingularTask, axes: int | None, point: int | None) -> None:
    """Refuse frames in which lost directions cannot be given."""
    known = [0, *(int(j) for j in task.model.twin.frame(task.frame).path)]
    for selected in (axes, point):
        if selected is not None and selected not in known:
            raise FrameNotFoundError(
                "frame number", selected, map(str, known),
                "Lost directions are given in frames from the base to that of the task.",
            )  # fmt: skip
    if point is not None and not task.is_whole:
        raise InvalidValueError(
            "point: where not all six components count (with a mask, and by default where up to "
            "three joints move the position), the lost directions belong to the frame's origin; "
            "leave it out, or pass mask=[1, 1, 1, 1, 1, 1]."
        )
    if axes is not None and not _has_vectors(task):
        raise InvalidValueError(
            "axes: this mask takes single components, which belong to its own axes; leave it out."
        )


def frame_words(frame: str | int | None) -> str:
    """Name of a frame in a sentence."""
    if frame is None:
        return "the tool"
    return f"frame {frame!r}" if isinstance(frame, str) else f"R{frame}"


def _has_vectors(task: SingularTask) -> bool:
    """Whether velocity and angular velocity each count as a whole or not at all."""
    return all(len(set(task.mask[k : k + 3].tolist())) == 1 for k in (0, 3))


def _wide(task: SingularTask, lost: Array) -> Array:
    """Wrenches (6, p) of directions without units: f per metre, m per radian."""
    wide = np.zeros((6, lost.shape[1]))
    wide[task.mask] = lost * task.row_scale[:, None]
    return wide


def _moved(wrenches: Array, turn: Array, lever: Array) -> Array:
    """Wrenches (p, 6) at another point and in other axes; the lever leads from there to here."""
    force, moment = wrenches[:, :3], wrenches[:, 3:]
    moment = moment + np.cross(lever, force)
    return np.hstack([force @ turn.T, moment @ turn.T])


def _complement(task: SingularTask, lost: Array, missing: Array) -> Array:
    """Lost wrenches freed of what is always missing, in the metric of the task at that point."""
    if not len(missing):
        return lost
    scale = np.repeat([task.length, 1.0], 3)
    fixed = np.linalg.qr((missing * scale).T)[0]
    rows = lost * scale
    return (rows - rows @ fixed @ fixed.T) / scale


def _expressed(
    task: SingularTask,
    wrenches: Array,
    axes: int | None,
    point: int | None,
    zero: float,
) -> LostDirections:
    """Sparse rows, found in units that compare."""
    scale = np.repeat([task.length, 1.0], 3)
    rows = sparse_basis(wrenches * scale, zero)
    clean = [normalised(row / scale) for row in rows]
    twists = [normalised(row * scale) for row in rows]
    return LostDirections(
        axes=axes,
        point=point,
        wrenches=read_only(np.reshape(clean, (-1, 6))),
        twists=read_only(np.reshape(twists, (-1, 6))),
        frame=frame_words(task.frame),
    )

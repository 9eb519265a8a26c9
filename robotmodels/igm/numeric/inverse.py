"""The numeric inverse geometric model: any robot, any mask, one posture a pose."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from math import inf
from operator import index
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ... import se3
from ..._arrays import Array, as_mask, as_vector, batch_rows, read_only
from ...errors import InvalidValueError
from ...geometry import REVOLUTE
from ...model import RobotModel
from ..request import above_zero
from ..solutions import IGMSolutions

METHOD = "numeric (Levenberg-Marquardt)"
"""What `igm_numeric` calls itself in its results."""

_SEED = 20
# the first few starts also tell how many components of the task the arm can govern
_FEWEST_STARTS = 8


def igm_numeric(
    model: RobotModel,
    T: ArrayLike,
    q0: ArrayLike | None = None,
    mask: ArrayLike | str | None = None,
    mask_axes: Literal["world", "tool"] = "world",
    position_tolerance: float = 1e-6,
    orientation_tolerance: float = 1e-6,
    rng: np.random.Generator | int | None = None,
    limits: bool = False,
    restarts: int = 100,
    iterations: int = 40,
) -> IGMSolutions:
    """Numeric inverse geometric model: one posture that brings the tool to each pose.

    Also called inverse kinematics, ``ikine``, ``ik_LM``, CLIK. For any robot: any number of
    joints, any tree, redundant or with fewer joints than the task has components. It
    starts from ``q0`` if given, then from postures spread over the joint ranges, those whose pose
    is nearest first. A solution is a posture whose pose was computed again and is met within both
    tolerances.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    T : array_like, shape (..., 4, 4)
        World poses of the tool, metres. A rotation that is off by less than 1e-6 is rounded to
        the nearest one.
    q0 : array_like, shape (..., n), optional
        Where to start, rad or m; broadcasts with the poses. The solution found from it is usually
        near it. Joints that do not move the tool keep its value. Without it nothing is
        preferred, and such joints stay at 0 (with ``limits`` at the nearest value inside them).
    mask : array_like, shape (6,), or {"position", "xyz", "orientation"}, optional
        Ones for the components ``x y z rx ry rz`` that are asked for, zeros for the others;
        default all. Rotations are the components of ``log(R_desired R^T)``.
    mask_axes : {"world", "tool"}
        Axes of the components: the world's, or those of the tool at the desired pose. Pointing
        the tool's z axis is ``[1, 1, 1, 1, 1, 0]`` in tool axes.
    position_tolerance : float
        Metres, on the length of the asked-for translation that is missing.
    orientation_tolerance : float
        Radians, on the asked-for rotation that is missing. For poses given with few digits take
        wider tolerances.
    rng : numpy.random.Generator or int, optional
        Generator or seed of the spread starts; default a fixed seed. The starts are the same for
        all poses of a call, so that a batch gives what its poses give one by one.
    limits : bool
        Whether solutions must lie within the joint limits. Angles are then shifted by whole turns
        to be nearest to ``q0`` (else to mid-range) inside the limits; otherwise they are in
        (-pi, pi].
    restarts : int
        How many starts to try beside ``q0``; 0 needs a ``q0``.
    iterations : int
        Most steps from one start.

    Returns
    -------
    IGMSolutions
        With one row (S = 1) for every pose, its ``error`` per component, and ``closest``: the
        posture the search ended with, also where it is no solution. Then ``status`` tells whether
        limits are the reason; whether the position is met but the orientation is not (``closest``
        is where the remaining angle is least); or whether the position is too far or too near.
        These are findings of the search, not proofs.
        Postures of redundant arms are marked as members of an infinite family, with
        the joints that move along it; double roots and families at singular postures are not
        looked for.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        ``T`` that are not poses, ``q0`` or ``mask`` of the wrong length, NaN or infinity; a mask
        that is not of zeros and ones or that leaves nothing; an unknown option.

    References
    ----------
    The exercise, section 4.3 (``ikine`` and its mask). T. Sugihara, Solvability-unconcerned
    inverse kinematics by the Levenberg-Marquardt method, IEEE T-RO 27(5), 2011.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.kinematics import dgm
    >>> arm = load("panda")
    >>> T = dgm(arm, [0.1, 0.2, 0.3, -1.4, 0.5, 1.6, 0.7])
    >>> found = igm_numeric(arm, T, limits=True)
    >>> bool(found.within_limits[0]), bool(np.allclose(dgm(arm, found.q[0]), T, atol=1e-6))
    (True, True)

    The exercise's pose B: its position is reached, its orientation cannot be.

    >>> trr = load("lab_trr")
    >>> B = [[-1, 0, 0, 0.4], [0, 1, 0, 0.2], [0, 0, -1, 0.5], [0, 0, 0, 1]]
    >>> igm_numeric(trr, B, mask=[1, 1, 1, 0, 0, 0]).reason()
    'The pose is reached.'
    >>> igm_numeric(trr, B).reason()
    'The position is reached, but the orientation is not available there. It is off by 180 deg.'
    """
    if not isinstance(model, RobotModel):
        raise InvalidValueError(f"model: expected a RobotModel, got {type(model).__name__}.")
    T = se3.as_pose(T)
    asked = as_mask(mask)
    if mask_axes not in ("world", "tool"):
        raise InvalidValueError(f"mask_axes: expected 'world' or 'tool', got {mask_axes!r}.")
    tolerance = np.array(
        [
            above_zero(position_tolerance, "position_tolerance"),
            above_zero(orientation_tolerance, "orientation_tolerance"),
        ]
    )
    restarts = _whole(restarts, "restarts", 0)
    iterations = _whole(iterations, "iterations", 1)
    if not isinstance(limits, (bool, np.bool_)):
        raise InvalidValueError(f"limits: expected True or False, got {limits!r}.")
    if restarts == 0 and q0 is None:  # nowhere to start from
        raise InvalidValueError("restarts: 0 leaves no start without q0; give q0 or restarts.")
    search = _search(model, bool(limits), restarts, rng)
    first = search.middle if q0 is None else as_vector(q0, model.n, "q0")
    flat = T.reshape(*T.shape[:-2], 16)
    batch, (targets, first) = batch_rows((flat, first), ("T", "q0"))
    if limits:
        first = np.clip(first, model.lower, model.upper)
    N, n = first.shape
    closest, q, error, residual = (np.empty((N, n)), np.empty((N, n)), np.empty((N, 6)),
                                   np.empty(N))  # fmt: skip
    valid, inside = np.empty((2, N), dtype=np.bool_)
    family = np.empty((N, n), dtype=np.bool_)
    status = np.empty(N, dtype=np.int8)
    from ._solve import solve_poses

    solve_poses(
        targets.reshape(N, 4, 4), first, int(q0 is not None), search.starts, search.poses,
        model.chain, *search.tool, model.lower, model.upper, int(limits),
        asked.astype(np.int64), int(mask_axes == "tool"), search.length, search.reach, tolerance,
        restarts, iterations, closest, q, error, residual, valid, inside, family, status,
    )  # fmt: skip
    rows = (*batch, 1)
    return IGMSolutions(
        q=q.reshape(*rows, n),
        valid=valid.reshape(rows),
        residual=residual.reshape(rows),
        within_limits=inside.reshape(rows),
        code=np.where(valid, 0, -1).reshape(rows),
        labels=("",),
        status=status.reshape(batch),
        double=np.zeros(rows, dtype=np.bool_),
        free_joints=np.zeros((*rows, n), dtype=np.bool_),
        family_joints=family.reshape(*rows, n),
        method=METHOD,
        periodic=search.revolute & (not limits),
        mask=asked,
        error=error.reshape(*rows, 6),
        closest=closest.reshape(*batch, n),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """What every call with a model and its limits needs: starts, their poses, lengths."""

    tool: tuple[NDArray[np.int64], Array, Array]
    """Path, rotation and position of the tool as kernels take them."""
    revolute: NDArray[np.bool_]
    length: float
    """Of the path's constant links, metres."""
    reach: float
    """What the tool's distance from its path's first frame never exceeds, metres."""
    middle: Array
    """Where joints without effect stay, and mid-range."""
    starts: Array
    poses: Array


# by identity: a model's hash reads all of its numbers
_SEARCHES: dict[tuple[int, bool, int], tuple[weakref.ref[RobotModel], _Search]] = {}


def _search(model: RobotModel, limits: bool, restarts: int, rng: Any) -> _Search:
    """What `_new_search` builds, kept with the model when the starts are the fixed ones."""
    if rng is not None:
        return _new_search(model, limits, restarts, rng)
    key = (id(model), limits, restarts)
    entry = _SEARCHES.get(key)
    if entry is None or entry[0]() is not model:
        search = _new_search(model, limits, restarts, _SEED)
        entry = (weakref.ref(model, lambda _: _SEARCHES.pop(key, None)), search)
        _SEARCHES[key] = entry
    return entry[1]


def _new_search(model: RobotModel, limits: bool, restarts: int, rng: Any) -> _Search:
    """Draw the starts and multiply out what they and the lengths need."""
    if not isinstance(rng, np.random.Generator):
        rng = np.random.default_rng(_whole(rng, "rng", 0))
    table, chain, n = model.table, model.chain, model.n
    path, E = read_only(table.path(model.tip), np.int64), model.tool
    tool = path, read_only(E[:3, :3]), read_only(E[:3, 3])
    revolute = read_only(table.sigma[table.joint_rows] == REVOLUTE, np.bool_)
    joints = chain.joint[path - 1]
    on_path = np.zeros(n, dtype=np.bool_)
    on_path[joints[joints >= 0]] = True
    links = np.linalg.norm(chain.position[path[1:] - 1], axis=-1).sum()
    length = float(links + np.linalg.norm(tool[2])) or 1.0
    strokes = np.maximum(np.abs(model.lower), np.abs(model.upper)) if limits else np.full(n, inf)
    reach = (length + strokes[on_path & ~revolute].sum()) * (1.0 + 1e-12)
    low, high = _ranges(model, revolute, limits, length)
    starts = low + rng.random((max(restarts, _FEWEST_STARTS), n)) * (high - low)
    poses = np.empty((len(starts), 4, 4))
    from ...kernels.poses import tip_poses

    tip_poses(starts, chain, *tool, poses)
    still = np.zeros(n)
    if limits:
        still = np.where(on_path, 0.5 * (low + high), np.clip(still, model.lower, model.upper))
    return _Search(
        tool, revolute, length, float(reach), read_only(still), read_only(starts), read_only(poses)
    )


def _ranges(
    model: RobotModel, revolute: NDArray[np.bool_], limits: bool, length: float
) -> tuple[Array, Array]:
    """Where spread starts lie: the limits, or a whole turn, or the length of the arm."""
    span = np.where(revolute, 2.0 * np.pi, 2.0 * length)
    lower, upper = model.lower, model.upper
    if not limits:
        lower = np.where(revolute, -inf, lower)
        upper = np.where(revolute, inf, upper)
    low = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper - span, -span / 2))
    high = np.where(np.isfinite(upper), upper, low + span)
    # more than a turn says nothing new; the one around mid-range is taken
    wide = revolute & (high - low > span)
    middle = 0.5 * (low + high)
    return np.where(wide, middle - span / 2, low), np.where(wide, middle + span / 2, high)


def _whole(value: Any, name: str, least: int) -> int:
    try:
        number = index(value)
    except TypeError:
        raise InvalidValueError(f"{name}: expected a whole number, got {value!r}.") from None
    if isinstance(value, (bool, np.bool_)) or number < least:
        raise InvalidValueError(f"{name}: expected a whole number >= {least}, got {value!r}.")
    return number

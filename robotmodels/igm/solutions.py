"""The result of every inverse geometric model: all postures found, and why there are no more."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import degrees, hypot
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_vector, batch_shape, read_only
from ..errors import InvalidValueError, ShapeError
from .status import IGMStatus

_WHOLE_POSE = (True,) * 6
_SHOWN = 8
_WITH_SOLUTIONS = (IGMStatus.REACHED, IGMStatus.REACHED_FAMILY, IGMStatus.INCOMPLETE)


class _Rows(Protocol):
    """Rows of a solver from which the fields of a result are made."""

    def fields(self) -> tuple[Any, ...]: ...


class _Later:
    """Place of the rows of a result whose fields are made when the first of them is read."""

    __slots__ = ("_rows",)
    _rows: _Rows | None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class IGMSolutions(_Later):
    """Postures that reach the poses of one call. Read-only, picklable.

    The leading axes are those of the poses. S is the number of rows kept for each pose: the most
    solutions found for any of them (always 1 for `igm_numeric`). Rows are packed: rows
    without a solution come last, NaN in ``q`` and False in ``valid``.

    Parameters
    ----------
    q : ndarray, shape (..., S, n)
        Joint variables, rad or m.
    valid : ndarray of bool, shape (..., S)
        Whether the row is a solution.
    residual : ndarray, shape (..., S)
        The larger of the position error in metres and the rotation angle in radians, of the
        requested components, by the direct model.
    within_limits : ndarray of bool, shape (..., S)
        Whether the row is a solution inside the joint limits as it stands, no whole turns added.
    code : ndarray of int16, shape (..., S)
        Number of the branch, which of ``labels`` it has; -1 in rows without a solution.
    labels : tuple of str
        Words for the branches.
    status : ndarray of int8, shape (...)
        Codes of `IGMStatus`.
    double : ndarray of bool, shape (..., S)
        Double roots, which are given once.
    free_joints : ndarray of bool, shape (..., S, n)
        Joints of an infinite family whose value was taken from the reference posture, one for each
        of its dimensions. Joints that do not move the tool keep their reference and are not marked.
    family_joints : ndarray of bool, shape (..., S, n)
        Other joints that move along the infinite family the row belongs to.
    method : str
        The solver, in words.
    periodic : ndarray of bool, shape (n,)
        Joints whose values count modulo a whole turn in `nearest`: the revolute ones, unless
        limits were requested.
    mask : array_like of bool, shape (6,)
        Which components x y z rx ry rz were requested.
    error : ndarray, shape (..., S, 6), optional
        Translation (m) and rotation (rad) that are missing, ``x y z rx ry rz`` in the axes of the
        mask. From `igm_numeric` also where there is no solution: then of ``closest``.
    closest : ndarray, shape (..., n), optional
        The posture a search ended with, also where it is no solution, rad or m. From a closed form
        only for poses without a solution, NaN for the others.
    missing : ndarray, shape (..., 6), optional
        Translation and rotation that ``closest`` lacks, as in ``error``.

    Raises
    ------
    ShapeError
        Fields that do not fit each other.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.igm import igm_numeric
    >>> arm = load("rx90")
    >>> found = igm_numeric(arm, dgm(arm, [0.1, 0.2, 1.3, 0.4, 0.5, 0.6]))
    >>> found.q.shape, found.count, found.reason()
    ((1, 6), np.int64(1), 'The pose is reached.')
    """

    q: Array
    valid: NDArray[np.bool_]
    residual: Array
    within_limits: NDArray[np.bool_]
    code: NDArray[np.int16]
    labels: tuple[str, ...]
    status: NDArray[np.int8]
    double: NDArray[np.bool_]
    free_joints: NDArray[np.bool_]
    family_joints: NDArray[np.bool_]
    method: str
    periodic: NDArray[np.bool_]
    mask: NDArray[np.bool_] = _WHOLE_POSE  # type: ignore[assignment]
    error: Array | None = None
    closest: Array | None = None
    missing: Array | None = None

    def __post_init__(self) -> None:
        *batch, S, n = np.shape(self.q)
        shapes = {
            "q": (float, (*batch, S, n)),
            "valid": (bool, (*batch, S)),
            "residual": (float, (*batch, S)),
            "within_limits": (bool, (*batch, S)),
            "code": (np.int16, (*batch, S)),
            "status": (np.int8, tuple(batch)),
            "double": (bool, (*batch, S)),
            "free_joints": (bool, (*batch, S, n)),
            "family_joints": (bool, (*batch, S, n)),
            "periodic": (bool, (n,)),
            "mask": (bool, (6,)),
            "error": (float, (*batch, S, 6)),
            "closest": (float, (*batch, n)),
            "missing": (float, (*batch, 6)),
        }
        for name, (dtype, shape) in shapes.items():
            value = getattr(self, name)
            if value is None:
                continue
            array = read_only(value, dtype)
            if array.shape != shape:
                raise ShapeError(f"{name}: expected shape {shape}, got {array.shape}.")
            object.__setattr__(self, name, array)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            # a slot without a value is a field that is not made yet
            if name not in _PUT:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            rows = self._rows
            if rows is not None:
                for put, value in zip(_PUT.values(), rows.fields(), strict=True):
                    put(self, value)
                _PUT_ROWS(self, None)  # after the fields, for threads that read the same result
            return object.__getattribute__(self, name)

    @property
    def branch(self) -> NDArray[np.str_]:
        """Labels of the branches, shape (..., S); empty in rows without a solution."""
        labels = np.array((*self.labels, ""))[self.code]
        labels.flags.writeable = False
        return labels

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of solutions of each pose, shape (...)."""
        return self.valid.sum(axis=-1)

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Outcome of one pose as a sentence.

        Parameters
        ----------
        i : int or tuple of int
            Which pose; left out for a call with a single pose.

        Returns
        -------
        str
            The sentence of its status, with the missing distance where it is known.

        Raises
        ------
        InvalidValueError
            ``i`` does not name one pose.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.igm import igm_numeric
        >>> from robotmodels.se3 import translation
        >>> igm_numeric(load("lab_rr"), translation(0.5, 0, 0.5)).reason()
        'The position is out of reach: too far. The closest posture misses it by 0.3 m.'
        """
        status, at = self._status(i)
        lacking = self.missing if self.error is None else self.error[..., 0, :]
        if lacking is None or status in _WITH_SOLUTIONS:
            return status.sentence
        missing = np.where(self.mask, lacking[at], 0.0)
        if np.isnan(missing).any():
            return status.sentence
        metres = f"{hypot(*missing[:3]):.4g} m"
        angle = f"{degrees(hypot(*missing[3:])):.4g} deg"
        if status in (IGMStatus.TOO_FAR, IGMStatus.TOO_NEAR):
            return f"{status.sentence} The closest posture misses it by {metres}."
        if status is IGMStatus.ORIENTATION_NOT_AVAILABLE:
            return f"{status.sentence} It is off by {angle}."
        if status is IGMStatus.NOT_CONVERGED:
            parts = [metres] * bool(self.mask[:3].any()) + [angle] * bool(self.mask[3:].any())
            return f"{status.sentence} The closest one misses it by {' and '.join(parts)}."
        return status.sentence

    def nearest(self, q: ArrayLike) -> Array:
        """The solution of each pose that is nearest to a posture.

        Parameters
        ----------
        q : array_like, shape (..., n)
            Postures, rad or m; the leading axes broadcast with the poses.

        Returns
        -------
        ndarray, shape (..., n)
            Solutions as they are in ``q``, NaN for poses without any. The distance is the square
            root of the summed squares; a revolute joint counts by its shorter way round unless
            limits were requested.

        Raises
        ------
        ShapeError, InvalidValueError
            ``q`` of the wrong length, or with NaN or infinity.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.igm import igm_numeric
        >>> arm = load("lab_trr")
        >>> igm_numeric(arm, [[0, 0, -1, 0.2], [0, 1, 0, -0.3], [1, 0, 0, 0.7], [0, 0, 0, 1]],
        ...             mask=[1, 1, 1, 0, 0, 0], q0=[0, -1, 0.5]).nearest([0, 0, 0]).round(4)
        array([-0.3   , -1.5708,  1.5708])
        """
        S, n = self.q.shape[-2:]
        q = as_vector(q, n, "q")
        batch = batch_shape((q, np.empty((*self.status.shape, n))), ("q", "solutions"))
        rows = np.broadcast_to(self.q, (*batch, S, n))
        if S == 0:
            return np.full((*batch, n), np.nan)
        distance = posture_distance(rows, q[..., None, :], self.periodic)
        best = np.where(self.valid, distance, np.inf).argmin(axis=-1)
        return np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]

    def path(self, q0: ArrayLike) -> Array:
        """One continuous path of joint positions through the solutions of a path of poses.

        Parameters
        ----------
        q0 : array_like, shape (n,)
            Posture before the first pose, rad or m.

        Returns
        -------
        ndarray, shape (N, n)
            The solution of each pose that is nearest to the one before, as in `nearest`. Revolute
            joints are given by the angle nearest to the one before, so that they make no jumps of
            whole turns, unless limits were requested.

        Raises
        ------
        ShapeError, InvalidValueError
            Solutions of a single pose or of more batch axes than one; a pose without a solution;
            ``q0`` of the wrong length, or with NaN or infinity.

        See Also
        --------
        robotmodels.trajectories.joint_path : the same with a report of jumps and singularities.

        Examples
        --------
        >>> import numpy as np
        >>> from robotmodels.igm import igm
        >>> from robotmodels.kinematics import dgm
        >>> from robotmodels.robots import load
        >>> arm, t = load("rx90"), np.linspace(0.0, 1.0, 40)[:, None]
        >>> q = [0.0, 0.4, 1.2, 0.3, 0.9, 0.0] + t * [7.0, 0.2, 0.2, -9.0, 0.3, 1.0]
        >>> bool(np.abs(igm(arm, dgm(arm, q)).path(q[0]) - q).max() < 1e-9)
        True
        """
        if self.status.ndim != 1:
            raise ShapeError(
                f"path: expected the solutions of poses of shape (N, 4, 4), got poses of shape "
                f"{(*self.status.shape, 4, 4)}."
            )
        lost = np.flatnonzero(self.count == 0)
        if lost.size:
            raise InvalidValueError(
                f"path: pose {lost[0]} has no solution: {self.reason(int(lost[0]))} "
                "`trajectories.joint_path` reports such poses and goes on."
            )
        q = as_exact(q0, self.q.shape[-1:], "q0")
        out = np.empty((len(self.q), q.size))
        turn = 2.0 * np.pi
        for i, (rows, valid) in enumerate(zip(self.q, self.valid, strict=True)):
            distance = posture_distance(rows, q, self.periodic)
            best = rows[np.where(valid, distance, np.inf).argmin()]
            turns = np.where(self.periodic, np.round((q - best) / turn), 0.0)
            q = out[i] = best + turn * turns
        return out

    def __repr__(self) -> str:
        poses = int(self.status.size)
        total = int(self.valid.sum())
        head = (
            f"<IGMSolutions: {total} posture{'s' * (total != 1)} for {poses} "
            f"pose{'s' * (poses != 1)}, method {self.method!r}>"
        )
        lines = [head]
        for i in list(np.ndindex(self.status.shape))[:_SHOWN] if poses <= _SHOWN else ():
            head = f"pose {', '.join(map(str, i))}: " if i else ""
            lines.append(f"  {head}{self.reason(i)}")
            for s in np.flatnonzero(self.valid[i]):
                # no minus before a zero
                numbers = " ".join(f"{round(float(v), 5) + 0.0:9.5f}" for v in self.q[i][s])
                where = "" if self.within_limits[i][s] else ", outside the limits"
                where += ", double root" if self.double[i][s] else ""
                where += _named("free", self.free_joints[i][s])
                where += _named("moving with it", self.family_joints[i][s])
                label = self.labels[self.code[i][s]]
                branch = f"  {label}" if label else ""
                lines.append(
                    f"    q = [{numbers}]{branch}  residual {self.residual[i][s]:.1e}{where}"
                )
        if poses > _SHOWN:
            codes, numbers = np.unique(self.status, return_counts=True)
            for code, number in zip(codes, numbers, strict=True):
                lines.append(f"  {number} x {IGMStatus(code).sentence}")
        return "\n".join(lines)

    def __reduce__(self) -> tuple[Any, ...]:
        # rebuilt, so that its arrays are read-only again
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    def _status(self, i: int | tuple[int, ...]) -> tuple[IGMStatus, tuple[int, ...]]:
        at = tuple(i) if isinstance(i, tuple) else (i,)
        try:
            # a single pose is also the first of one
            codes = self.status if self.status.ndim == 0 and at == (0,) else self.status[at]
            codes = np.asarray(codes)
        except (IndexError, TypeError):
            codes = self.status[None]
        if codes.ndim:
            raise InvalidValueError(
                f"i: expected the index of one pose among {self.status.shape}, got {i!r}."
            )
        return IGMStatus(int(codes)), at if self.status.ndim else ()


def _named(what: str, joints: NDArray[np.bool_]) -> str:
    """Marked joints, as columns of q."""
    if not joints.any():
        return ""
    return f", {what}: " + " ".join(f"q[{m}]" for m in np.flatnonzero(joints))


# the slots themselves: quicker than by name
_PUT = {field.name: getattr(IGMSolutions, field.name).__set__ for field in fields(IGMSolutions)}
_PUT_ROWS = vars(_Later)["_rows"].__set__


def of_fields(values: tuple[Any, ...]) -> IGMSolutions:
    """A result of fields, in their order, that are read-only and fit each other already."""
    result = object.__new__(IGMSolutions)
    for put, value in zip(_PUT.values(), values, strict=True):
        put(result, value)
    return result


def later(rows: _Rows) -> IGMSolutions:
    """A result whose fields are made when one is read: that takes longer than to solve a pose."""
    result = object.__new__(IGMSolutions)
    _PUT_ROWS(result, rows)
    return result


def posture_distance(a: Array, b: Array, periodic: NDArray[np.bool_]) -> Array:
    """Distance between postures; periodic joints by the shorter way round."""
    delta, turn = a - b, 2.0 * np.pi
    delta = np.where(periodic, delta - turn * np.round(delta / turn), delta)
    return np.sqrt((delta * delta).sum(axis=-1))

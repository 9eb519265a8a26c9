"""The result of an inverse kinematic model: joint velocities, and what is known of each row."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import hypot
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, read_only
from ...errors import InvalidValueError, ShapeError
from .status import IKMStatus

_SHOWN = 8


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class IKMSolution:
    """Joint velocities of twists, or joint accelerations. Read-only, picklable.

    The leading axes are those of the call. Six-vectors are linear then angular; rows that were
    not asked for are zero. With joint accelerations (`ikm_second_order`) all that is said of
    twists holds for accelerations, in m/s^2 and rad/s^2.

    Parameters
    ----------
    v : ndarray, shape (..., n)
        Joint velocities, rad/s or m/s; from `ikm_second_order` those that were given.
    status : ndarray of int8, shape (...)
        Codes of `IKMStatus`.
    achieved : ndarray, shape (..., 6)
        ``J v``, the part that was asked for [m/s, rad/s].
    error : ndarray, shape (..., 6)
        The twist minus ``achieved``.
    reachable : ndarray, shape (..., 6)
        The part of the twist that some joint velocities produce: its projection onto the range of
        J (metres and radians compared by the length).
    singular_values : ndarray, shape (..., k)
        Of the scaled Jacobian, descending, k the smaller of its numbers of rows and columns.
        Tasks stacked by ``augmented`` are among its rows.
    rank : ndarray of int8, shape (...)
        How many of them are not zero but for rounding (1e-10 of the Jacobian's norm).
    damping : ndarray, shape (...)
        Largest damping of any direction; 0 where nothing is damped.
    scale : ndarray, shape (...)
        Part of the twist that is kept under limits, 1 without.
    limited : ndarray of bool, shape (..., n)
        Joints that are at a limit of their velocity or acceleration.
    mask : ndarray of bool, shape (6,)
        Rows that were asked for.
    task_errors : tuple of ndarray, shapes (..., m_i)
        What is missing of the tasks: ``augmented`` in their order, then ``tasks``.
    task_scales : ndarray, shape (..., t)
        Part of the rates of ``tasks`` that is kept under limits.
    a : ndarray, shape (..., n), optional
        Joint accelerations, rad/s^2 or m/s^2, from `ikm_second_order`.

    Raises
    ------
    ShapeError
        Fields that do not fit each other.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.kinematics.inverse.ikm import ikm
    >>> found = ikm(load("rx90"), [0.1, 0.2, 1.3, 0.4, 0.0, 0.6], [0.0, 0.0, 0.0, 0.1, 0.2, 0.3])
    >>> found.rank, found.status
    (array(5, dtype=int8), array(2, dtype=int8))
    >>> found.reason()
    'The motion has a part that cannot be produced at this singular position. ...'
    """

    v: Array
    status: NDArray[np.int8]
    achieved: Array
    error: Array
    reachable: Array
    singular_values: Array
    rank: NDArray[np.int8]
    damping: Array
    scale: Array
    limited: NDArray[np.bool_]
    mask: NDArray[np.bool_]
    task_errors: tuple[Array, ...] = ()
    task_scales: Array = ()  # type: ignore[assignment]
    a: Array | None = None

    def __post_init__(self) -> None:
        *batch, n = np.shape(self.v)
        leading = tuple(batch)
        if not np.size(self.task_scales):
            object.__setattr__(self, "task_scales", np.zeros((*leading, 0)))
        k, t = np.shape(self.singular_values)[-1:], np.shape(self.task_scales)[-1:]
        shapes = {
            "v": (float, (*leading, n)),
            "status": (np.int8, leading),
            "achieved": (float, (*leading, 6)),
            "error": (float, (*leading, 6)),
            "reachable": (float, (*leading, 6)),
            "singular_values": (float, (*leading, *k)),
            "rank": (np.int8, leading),
            "damping": (float, leading),
            "scale": (float, leading),
            "limited": (bool, (*leading, n)),
            "mask": (bool, (6,)),
            "task_scales": (float, (*leading, *t)),
            "a": (float, (*leading, n)),
        }
        for name, (dtype, shape) in shapes.items():
            value = getattr(self, name)
            if value is None:
                continue
            array = read_only(value, dtype)
            if array.shape != shape:
                raise ShapeError(f"{name}: expected shape {shape}, got {array.shape}.")
            object.__setattr__(self, name, array)
        errors = tuple(read_only(error) for error in self.task_errors)
        for i, error in enumerate(errors):
            if error.shape[:-1] != leading or not error.ndim:
                wanted = ", ".join(map(str, (*leading, "m")))
                raise ShapeError(f"task_errors[{i}]: expected shape ({wanted}), got {error.shape}.")
        object.__setattr__(self, "task_errors", errors)

    @classmethod
    def checked_before(cls, *values: Any) -> Self:
        """Build from fields, in their order, that are read-only and fit each other already."""
        result = object.__new__(cls)
        for put, value in zip(_PUT, values, strict=True):
            put(result, value)
        return result

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """What became of one row, in a sentence.

        Parameters
        ----------
        i : int or tuple of int
            Which row; left out for a call with a single one.

        Returns
        -------
        str
            The sentence of its status, with what is missing of the twist.

        Raises
        ------
        InvalidValueError
            ``i`` does not name one row.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> from robotmodels.kinematics.inverse.ikm import ikm
        >>> ikm(load("lab_rr"), [0.1, 0.2], [0.0, 0.0, 0.5, 0.0, 0.0, 0.0]).reason()
        'The motion has a part that cannot be produced: too few degrees of freedom. It misses ...'
        """
        at = i if isinstance(i, tuple) else (i,)
        try:
            # a single row is also the first of one
            code = self.status if self.status.ndim == 0 and at == (0,) else self.status[at]
            code = np.asarray(code)
        except (IndexError, TypeError):
            code = self.status[None]
        if code.ndim:
            raise InvalidValueError(
                f"i: expected the index of one row among {self.status.shape}, got {i!r}."
            )
        status = IKMStatus(int(code))
        if status is IKMStatus.MET:
            return status.sentence
        error = self.error[at if self.status.ndim else ()]
        per = "s" if self.a is None else "s^2"
        missing = [f"{hypot(*error[:3]):.4g} m/{per}"] * bool(self.mask[:3].any())
        missing += [f"{hypot(*error[3:]):.4g} rad/{per}"] * bool(self.mask[3:].any())
        return f"{status.sentence} It misses {' and '.join(missing)}."

    def __repr__(self) -> str:
        rows = int(self.status.size)
        values = self.v if self.a is None else self.a
        what = "velocities" if self.a is None else "accelerations"
        lines = [f"<IKMSolution: joint {what} for {rows} row{'s' * (rows != 1)}>"]
        if rows > _SHOWN:
            codes, numbers = np.unique(self.status, return_counts=True)
            for code, number in zip(codes, numbers, strict=True):
                lines.append(f"  {number} x {IKMStatus(code).sentence}")
            return "\n".join(lines)
        for i in np.ndindex(self.status.shape):
            # no minus before a zero
            numbers = " ".join(f"{round(float(x), 5) + 0.0:9.5f}" for x in values[i])
            head = f"row {', '.join(map(str, i))}: " if i else ""
            lines.append(f"  {head}[{numbers}]  {self.reason(i)}")
        return "\n".join(lines)

    def __reduce__(self) -> tuple[Any, ...]:
        # rebuilt, so that its arrays are read-only again
        return type(self), tuple(getattr(self, field.name) for field in fields(self))


# the slots themselves: quicker than by name
_PUT = tuple(getattr(IKMSolution, field.name).__set__ for field in fields(IKMSolution))

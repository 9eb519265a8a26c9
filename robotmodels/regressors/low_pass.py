"""Low-pass filters for identification without accelerations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats, read_only
from ..errors import InvalidValueError, ShapeError


@dataclass(frozen=True, slots=True, eq=False, init=False)
class LowPass:
    """A stable continuous filter without direct feed-through: ``x' = A x + B u``, ``y = C x``.

    From the same state it gives the filtered signal and the filtered derivative of the signal,
    ``C A x + C B u``, so that nothing is ever differentiated. Samples are joined by straight lines
    (first-order hold), for which it is exact.

    Parameters
    ----------
    A : array_like, shape (m, m)
        Eigenvalues with negative real parts, 1/s.
    B, C : array_like, shape (m,)
        Input and output.

    Raises
    ------
    ShapeError, InvalidValueError
        Shapes that do not fit each other, NaN, or a filter that is not stable.

    References
    ----------
    J.-J. Slotine and W. Li, "On the adaptive control of robot manipulators", IJRR 6(3), 1987.

    Examples
    --------
    >>> LowPass.first_order(10.0).A
    array([[-10.]])
    """

    A: Array
    B: Array
    C: Array

    def __init__(self, A: ArrayLike, B: ArrayLike, C: ArrayLike) -> None:
        matrix = as_floats(A, "A")
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
            raise ShapeError(f"A: expected a square matrix (m, m), got {matrix.shape}.")
        m = len(matrix)
        vectors = {"B": as_floats(B, "B"), "C": as_floats(C, "C")}
        for name, vector in vectors.items():
            if vector.shape != (m,):
                raise ShapeError(f"{name}: expected shape ({m},), got {vector.shape}.")
        slowest = float(np.linalg.eigvals(matrix).real.max())
        if slowest >= 0.0:
            raise InvalidValueError(
                f"A: the filter is not stable, it has a pole of real part {slowest:g} 1/s."
            )
        object.__setattr__(self, "A", read_only(matrix))
        for name, vector in vectors.items():
            object.__setattr__(self, name, read_only(vector))

    @classmethod
    def first_order(cls, cutoff: float) -> Self:
        """The filter ``cutoff / (s + cutoff)``.

        Parameters
        ----------
        cutoff : float
            Cut-off frequency, rad/s, positive.

        Returns
        -------
        LowPass
            Of order one and gain one.

        Raises
        ------
        InvalidValueError
            A frequency that is not positive.

        Examples
        --------
        >>> LowPass.first_order(10.0).order
        1
        """
        value = as_floats(cutoff, "cutoff")
        if value.ndim != 0 or not value > 0.0:
            raise InvalidValueError(f"cutoff: expected a positive number in rad/s, got {cutoff!r}.")
        return cls([[-float(value)]], [float(value)], [1.0])

    @classmethod
    def from_scipy(cls, system: Any) -> Self:
        """A continuous filter of SciPy, such as ``scipy.signal.butter(4, 60.0, analog=True)``.

        Parameters
        ----------
        system : scipy.signal.lti or tuple
            ``(b, a)``, ``(z, p, k)`` or ``(A, B, C, D)`` in continuous time, rad/s.

        Returns
        -------
        LowPass
            The same filter.

        Raises
        ------
        InvalidValueError
            Not a continuous system of one input and one output; one that does not fall off at high
            frequencies; one that is not stable.

        Examples
        --------
        >>> from scipy.signal import butter
        >>> LowPass.from_scipy(butter(2, 60.0, analog=True)).order
        2
        """
        from scipy import linalg, signal

        if isinstance(system, signal.dlti):
            raise InvalidValueError("system: expected a continuous filter (analog=True).")
        try:
            given: Any = system if isinstance(system, signal.lti) else signal.lti(*system)
            space = given.to_ss()
        except (TypeError, ValueError) as error:
            raise InvalidValueError(
                "system: expected a continuous filter of SciPy, such as butter(2, 60.0, "
                f"analog=True), got {system!r:.80} ({error})."
            ) from None
        A, B, C, D = (np.asarray(part) for part in (space.A, space.B, space.C, space.D))
        if B.shape[1:] != (1,) or C.shape[:1] != (1,):
            raise InvalidValueError("system: expected one input and one output.")
        gain = np.abs(C @ np.linalg.solve(A, B)).max() if A.size else 0.0
        if not A.size or np.abs(D).max() > 1e-12 * max(gain, 1.0):
            raise InvalidValueError(
                "system: expected a filter whose gain falls off at high frequencies, so that the "
                "derivative of its output needs none of its input."
            )
        # coefficients of a polynomial span many decades: states of like sizes instead
        balanced, T = linalg.matrix_balance(A, permute=False)
        scale = np.diag(T)
        return cls(balanced, B[:, 0] / scale, C[0] * scale)

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)

    def filter(self, u: ArrayLike, dt: float) -> Array:
        """Filter a sampled signal, from rest.

        Parameters
        ----------
        u : array_like, shape (N, ...)
            Samples along the first axis.
        dt : float
            Sampling period, seconds.

        Returns
        -------
        ndarray, shape (N, ...)
            The filtered samples; the first is zero.

        Raises
        ------
        InvalidValueError, ShapeError
            NaN, a period that is not positive, or no axis of samples.

        Examples
        --------
        >>> LowPass.first_order(1.0).filter([1.0, 1.0, 1.0], 1.0).round(4)
        array([0.    , 0.6321, 0.8647])
        """
        signal = as_floats(u, "u")
        if signal.ndim < 1:
            raise ShapeError("u: expected samples along the first axis, got one number.")
        run = FilterRun(self, check_period(dt))
        rows = np.ascontiguousarray(signal.reshape(signal.shape[0], -1))
        out = np.empty(rows.shape)
        run.values(rows, out)
        return out.reshape(signal.shape)

    def __reduce__(self) -> tuple[Any, ...]:  # rebuilt, so that a copy is read-only as well
        return type(self), (self.A, self.B, self.C)


class FilterRun:
    """A filter in the middle of a signal of several channels; pieces follow each other.

    Parameters
    ----------
    low_pass : LowPass
        The filter.
    dt : float
        Sampling period, seconds.
    """

    def __init__(self, low_pass: LowPass, dt: float) -> None:
        from scipy.linalg import expm

        m = low_pass.order
        block = np.zeros((m + 2, m + 2))
        block[:m, :m] = low_pass.A * dt
        block[:m, m] = low_pass.B * dt
        block[m, m + 1] = 1.0
        step = np.asarray(expm(block))
        self.low_pass = low_pass
        self.state_step = np.ascontiguousarray(step[:m, :m])
        self.present = step[:m, m] - step[:m, m + 1]  # of the sample before
        self.coming = np.ascontiguousarray(step[:m, m + 1])  # of the sample itself
        self.state: Array | None = None
        self.last: Array | None = None

    def values(self, u: Array, out: Array) -> None:
        """Write the filtered signal ``(k, c)``, from a state of rest."""
        self._run(u, np.zeros(self.low_pass.order), self.low_pass.C, 0.0, out)

    def derivatives(self, u: Array, out: Array) -> None:
        """Write the filtered derivative of the signal ``(k, c)``; that is filtered from rest."""
        A, B, C = self.low_pass.A, self.low_pass.B, self.low_pass.C
        rest = np.asarray(-np.linalg.solve(A, B), np.float64)
        self._run(u, rest, C @ A, float(C @ B), out)

    def _run(self, u: Array, rest: Array, output: Array, through: float, out: Array) -> None:
        from ..kernels.state_space import filtered

        if not u.shape[0]:
            return
        first = self.state is None or self.last is None
        if first:
            self.state, self.last = rest[:, None] * u[0], np.zeros(u.shape[1])
        filtered(
            u, self.state_step, self.present, self.coming, output, through, first,
            self.state, self.last, out,
        )  # fmt: skip


def check_period(dt: float) -> float:
    """The sampling period as a positive number."""
    period = as_floats(dt, "dt")
    if period.ndim != 0 or not period > 0.0:
        raise InvalidValueError(f"dt: expected the sampling period in seconds, got {dt!r:.80}.")
    return float(period)

"""Low-pass filters for identification without accelerations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats, read_only
from ..errors import InvalidValueError, ShapeError

_PERIODS = 1e-6  # relative: sampling periods that are the same, as from a clock's time stamps


@dataclass(frozen=True, slots=True, eq=False, init=False)
class LowPass:
    """A stable filter without direct feed-through: ``x' = A x + B u``, ``y = C x``.

    From the same state it gives the filtered signal and the filtered derivative of the signal,
    ``C A x + C B u``, so that nothing is ever differentiated. Samples of a continuous filter are
    joined by straight lines (first-order hold), for which it is exact. A discrete filter is run by
    the trapezoidal rule at its own sampling period, where it is the discrete filter itself.

    Parameters
    ----------
    A : array_like, shape (m, m)
        Eigenvalues with negative real parts, 1/s.
    B, C : array_like, shape (m,)
        Input and output.
    period : float, optional
        Sampling period of the discrete filter that the bilinear transformation
        ``s = 2 (z - 1) / (period (z + 1))`` makes of it, seconds; None for a continuous filter.

    Raises
    ------
    ShapeError, InvalidValueError
        Shapes that do not fit each other, NaN, a filter that is not stable, or a period that is
        not positive.

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
    period: float | None

    def __init__(
        self,
        A: ArrayLike,
        B: ArrayLike | None = None,
        C: ArrayLike | None = None,
        period: float | None = None,
    ) -> None:
        if B is None or C is None:
            raise InvalidValueError(
                "LowPass: expected the matrices A, B and C; for a cut-off frequency in rad/s take "
                "LowPass.first_order(cutoff), for filters of SciPy LowPass.from_scipy(...)."
            )
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
        object.__setattr__(self, "period", None if period is None else check_period(period))

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
    def from_scipy(cls, system: Any, dt: float | None = None) -> Self:
        """A filter of SciPy, continuous or discrete.

        Parameters
        ----------
        system : scipy.signal.lti, scipy.signal.dlti, tuple or array
            ``(b, a)``, ``(z, p, k)`` or ``(A, B, C, D)``; of a discrete filter second-order
            sections ``sos (k, 6)`` as well, which keep the digits of high orders.
        dt : float, optional
            Sampling period of a discrete filter, seconds; a ``dlti`` brings its own. Without it, a
            tuple is a continuous filter, in rad/s.

        Returns
        -------
        LowPass
            The same filter; a discrete one is for signals sampled at its period alone.

        Raises
        ------
        InvalidValueError
            Not a system of one input and one output; one that does not fall off at high
            frequencies (a discrete one: not to zero at half the sampling rate, as bilinear designs
            such as ``butter`` do); one that is not stable.

        Examples
        --------
        >>> from scipy.signal import butter
        >>> LowPass.from_scipy(butter(2, 60.0, analog=True)).order
        2
        >>> LowPass.from_scipy(butter(4, 10.0, fs=1000.0, output="sos"), dt=1e-3).order
        4
        """
        from scipy import linalg

        from .state_spaces import continuous_space, discrete_space, is_discrete

        if is_discrete(system, dt):
            (A, B, C, D), period = discrete_space(system, dt)
            # the inverse of the bilinear transformation; D is the gain at half the sampling rate
            M = np.linalg.inv(np.eye(len(A)) + A)
            A, B, C, D = (np.eye(len(A)) - 2 * M) * 2 / period, M @ B * 2 / period, C @ M * 2, (
                D - C @ M @ B
            )  # fmt: skip
        else:
            (A, B, C, D), period = continuous_space(system), None
        gain = np.abs(C @ np.linalg.solve(A, B)).max() if A.size else 0.0
        if not A.size or np.abs(D).max() > 1e-9 * max(gain, 1e-300):
            where = "high frequencies" if period is None else "half the sampling rate"
            raise InvalidValueError(
                f"system: expected a filter whose gain falls off to nothing at {where} (here it is "
                f"{np.abs(D).max():.3g}, {gain:.3g} at zero), so that the derivative of its output "
                "needs none of its input. Designs of butter, bessel and cheby1 do."
            )
        # coefficients of a polynomial span many decades: states of like sizes instead
        balanced, T = linalg.matrix_balance(A, permute=False)
        scale = np.diag(T)
        return cls(balanced, B[:, 0] / scale, C[0] * scale, period)

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)

    def filter(self, u: ArrayLike, dt: float) -> Array:
        """Filter a sampled signal, from rest.

        A discrete filter gives what ``scipy.signal.lfilter`` does for a signal whose first sample
        is zero; others begin without the step from zero to their first sample.

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
            NaN, a period that is not positive or not that of a discrete filter, or no axis of
            samples.

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
        return type(self), (self.A, self.B, self.C, self.period)


class FilterRun:
    """A filter in the middle of a signal of several channels; pieces follow each other."""

    def __init__(self, low_pass: LowPass, dt: float) -> None:
        self.low_pass = low_pass
        if low_pass.period is None:
            step, self.present, coming = _first_order_hold(low_pass.A, low_pass.B, dt)
        elif abs(dt - low_pass.period) <= _PERIODS * low_pass.period:
            step, self.present, coming = _trapezoidal(low_pass.A, low_pass.B, low_pass.period)
        else:
            raise InvalidValueError(
                f"dt: the filter is a discrete one of sampling period {low_pass.period:g} s, the "
                f"samples have {dt:g} s. Design it for these, or take a continuous filter "
                "(analog=True)."
            )
        self.state_step = np.ascontiguousarray(step)
        self.coming = np.ascontiguousarray(coming)
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


def _first_order_hold(A: Array, B: Array, dt: float) -> tuple[Array, Array, Array]:
    """State over a period, and shares of the samples before and after it, joined by a line."""
    from scipy.linalg import expm

    m = len(A)
    block = np.zeros((m + 2, m + 2))
    block[:m, :m] = A * dt
    block[:m, m] = B * dt
    block[m, m + 1] = 1.0
    step = np.asarray(expm(block), np.float64)
    return step[:m, :m], step[:m, m] - step[:m, m + 1], step[:m, m + 1]


def _trapezoidal(A: Array, B: Array, dt: float) -> tuple[Array, Array, Array]:
    """The same by the trapezoidal rule, which makes the bilinear transformation of the filter."""
    one = np.eye(len(A))
    step = np.linalg.solve(one - 0.5 * dt * A, one + 0.5 * dt * A)
    share = np.linalg.solve(one - 0.5 * dt * A, 0.5 * dt * B)
    return np.asarray(step, np.float64), share.astype(np.float64), share.astype(np.float64)


def check_period(dt: float) -> float:
    """The sampling period as a positive number."""
    period = as_floats(dt, "dt")
    if period.ndim != 0 or not period > 0.0:
        raise InvalidValueError(f"dt: expected the sampling period in seconds, got {dt!r:.80}.")
    return float(period)

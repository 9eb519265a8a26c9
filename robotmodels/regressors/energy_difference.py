"""Energy model between samples: the integral of the power, without accelerations."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_floats, as_vector
from ..drive import Drives
from ..errors import InvalidValueError, ShapeError
from ..friction import Friction, LinearFriction
from ..friction.protocols import basis_at
from ..model import RobotModel, check_model
from .chunks import check_log, check_size, pieces
from .columns import ChosenColumns, Columns, chosen_columns, friction_of, standard_blocks
from .drives import couplings
from .energy import fill_energies

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


def energy_difference_regressor(
    model: RobotModel,
    t: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    drive: Drives = True,
    columns: Columns | None = None,
    friction: Friction | None = None,
    knots: ArrayLike | None = None,
) -> Array:
    """Rows of the work of the torques between samples: energy gained plus work of friction.

    ``row @ parameters = integral of tau . v dt``, which `joint_work` gives from measured torques.
    The columns of links and rotors are differences of `energy_regressor` and exact; those of
    friction are integrals, exact where the velocity is linear between the samples (also through
    zero), and those of offsets are differences of ``q``. No accelerations are needed.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints.
    t : array_like, shape (N,)
        Times, ascending, seconds; need not be regular.
    q, v : array_like, shape (N, n)
        Joint variables (rad or m) and velocities at these times.
    drive : bool or collection of DriveKind or str
        Which drive parameters have columns: all, none, or kinds such as ``("Ia", "Fv", "Fc")``;
        what couples motors goes with its kind.
    columns, friction
        As for `torque_regressor`.
    knots : array_like of int, shape (k,), optional
        Numbers of the samples that the rows lie between, ascending; default every sample. Longer
        stretches are fewer rows with less noise; friction is integrated over all samples.

    Returns
    -------
    ndarray, shape (k - 1, p)
        Joules per unit of each parameter; columns as `parameter_names`.

    Raises
    ------
    ShapeError, InvalidValueError
        As `torque_regressor`; times or knots that do not ascend, or fewer than two of them.

    References
    ----------
    Seed book section 1.5.1.2; M. Gautier and W. Khalil, "On the identification of the inertial
    parameters of robots", IEEE CDC 1988 (energy model).

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> t = np.array([0.0, 1.0, 2.0])
    >>> energy_difference_regressor(one, t, t[:, None]**2, 2 * t[:, None], columns=["ZZ1", "Fc1"])
    array([[2., 1.], [6., 3.]])
    """
    check_model(model)
    t, q, v, at = _samples(model, t, q, v, knots)
    chosen = chosen_columns(standard_blocks(model, drive, friction), columns, model)
    out = np.empty((at.size - 1, chosen.count))
    _fill(model, chosen, friction_of(model, friction), t, q, v, at, out)
    return out


def energy_difference_regressor_chunks(
    model: RobotModel,
    t: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    drive: Drives = True,
    size: int = 1024,
    columns: Columns | None = None,
    friction: Friction | None = None,
    knots: ArrayLike | None = None,
) -> Iterator[tuple[slice, Array]]:
    """The rows of a long log, a piece at a time in one reused buffer.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    t : array_like, shape (N,)
        Times, ascending, seconds.
    q, v : array_like, shape (N, n)
        Joint variables (rad or m) and velocities.
    drive : bool or collection of DriveKind or str
        Which drive parameters have columns: all, none, or kinds such as ``("Ia", "Fv", "Fc")``;
        what couples motors goes with its kind.
    size : int
        Rows in a piece.
    columns, friction, knots
        As for `energy_difference_regressor`.

    Yields
    ------
    rows : slice
        Which of the k - 1 rows the piece holds.
    d : ndarray, shape (m, p)
        The rows. The next piece overwrites them.

    Raises
    ------
    ShapeError, InvalidValueError
        As `energy_difference_regressor`, or ``size`` below 1.

    References
    ----------
    Seed book section 1.5.1.2.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> t, x = np.arange(1000.0), np.zeros((1000, 1))
    >>> [d.shape for _, d in energy_difference_regressor_chunks(one, t, x, x, size=600)]
    [(600, 14), (399, 14)]
    """
    check_model(model)
    check_size(size)
    t, q, v, at = _samples(model, t, q, v, knots)
    chosen = chosen_columns(standard_blocks(model, drive, friction), columns, model)
    return _stream(model, chosen, friction_of(model, friction), t, q, v, at, size)


def joint_work(t: ArrayLike, v: ArrayLike, tau: ArrayLike, knots: ArrayLike | None = None) -> Array:
    """Work of joint torques between samples, ``integral of tau . v dt``.

    Exact where torques and velocities are linear between the samples.

    Parameters
    ----------
    t : array_like, shape (N,)
        Times, ascending, seconds.
    v, tau : array_like, shape (N, n)
        Joint velocities and torques.
    knots : array_like of int, shape (k,), optional
        As for `energy_difference_regressor`.

    Returns
    -------
    ndarray, shape (k - 1,)
        Joules.

    Raises
    ------
    ShapeError, InvalidValueError
        Arrays that do not fit each other, NaN, times or knots that do not ascend, or fewer than
        two of them.

    References
    ----------
    Seed book section 1.5.1.2.

    Examples
    --------
    >>> joint_work([0.0, 2.0], [[1.0], [1.0]], [[3.0], [5.0]])
    array([8.])
    """
    times = _times(t)
    v = as_floats(v, "v")
    if v.ndim != 2 or v.shape[0] != times.size:
        raise ShapeError(f"v: expected shape ({times.size}, n), got {v.shape}.")
    tau = as_exact(tau, v.shape, "tau")
    at = _knots(knots, times.size)
    return _summed(_products(np.diff(times), v, tau).sum(axis=1)[:, None], at)[:, 0]


def _samples(
    model: RobotModel, t: ArrayLike, q: ArrayLike, v: ArrayLike, knots: ArrayLike | None
) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    times = _times(t)
    shape = (times.size, model.n)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    for name, array in (("q", q), ("v", v)):
        if array.shape != shape:
            raise ShapeError(f"{name}: expected shape {shape}, one row a time, got {array.shape}.")
    at = _knots(knots, times.size)
    return times, np.ascontiguousarray(q), np.ascontiguousarray(v), at


def _times(t: ArrayLike) -> Array:
    times = as_floats(t, "t")
    if times.ndim != 1:
        raise ShapeError(f"t: expected times of shape (N,), got {times.shape}.")
    check_log(times.size, "t", least=2)
    steps = np.diff(times)
    if (steps <= 0.0).any():
        k = int(np.argmax(steps <= 0.0)) + 1
        raise InvalidValueError(
            f"t: expected ascending times, but t[{k}] = {times[k]:g} follows {times[k - 1]:g}."
        )
    return times


def _knots(knots: ArrayLike | None, N: int) -> NDArray[np.int64]:
    if knots is None:
        return np.arange(N)
    at = np.asarray(knots)
    if at.ndim != 1 or (at.size and at.dtype.kind not in "iu"):
        raise InvalidValueError(f"knots: expected numbers of samples, got {knots!r:.80}.")
    if at.size < 2:
        raise InvalidValueError(
            f"knots: expected at least two samples, which a row lies between, got {at.size}."
        )
    at = at.astype(np.int64)
    if at[0] < 0 or at[-1] >= N or (np.diff(at) <= 0).any():
        raise InvalidValueError(
            f"knots: expected ascending numbers of samples from 0 to {N - 1}, got {knots!r:.80}."
        )
    return at


def _stream(
    model: RobotModel,
    chosen: ChosenColumns,
    friction: LinearFriction | None,
    t: Array,
    q: Array,
    v: Array,
    at: NDArray[np.int64],
    size: int,
) -> Iterator[tuple[slice, Array]]:
    count = at.size - 1
    out = np.empty((min(size, count), chosen.count))
    for piece in pieces(count, out.shape[0]):
        part = out[: piece.stop - piece.start]
        _fill(model, chosen, friction, t, q, v, at[piece.start : piece.stop + 1], part)
        yield piece, part


def _fill(
    model: RobotModel,
    chosen: ChosenColumns,
    friction: LinearFriction | None,
    t: Array,
    q: Array,
    v: Array,
    at: NDArray[np.int64],
    out: Array,
) -> None:
    energy = np.empty((at.size, chosen.count))
    fill_energies(model, chosen, (q[at], v[at]), energy)
    out[...] = np.diff(energy, axis=0)
    stretch = slice(at[0], at[-1] + 1)
    h, x, dx, local = np.diff(t[stretch]), q[stretch], v[stretch], at - at[0]
    for kind, place in chosen.places.items():
        joints = np.flatnonzero(place >= 0)
        columns = place[joints]
        if not joints.size:
            continue
        if kind in _BY_JOINT and not _is_of(friction, kind):
            out[:, columns] = _summed(_BY_JOINT[kind](h, x[:, joints], dx[:, joints]), local)
        elif kind in ("Fvm", "Fcm"):
            for motor, column in zip(joints, columns, strict=True):
                row, cross = couplings(model)[motor]
                work = (
                    _products(h, dx, dx @ cross).sum(axis=1)
                    if kind == "Fvm"
                    else _distances(h, x, (dx @ row)[:, None])[:, 0]
                )
                out[:, column] = _summed(work[:, None], local)[:, 0]
    if friction is not None and chosen.has(*friction.kinds):
        works = _friction_works(h, x, dx, friction)
        for kind, work in zip(friction.kinds, works, strict=True):
            place = chosen.places[kind]
            joints = np.flatnonzero(place >= 0)
            out[:, place[joints]] = _summed(work[:, joints], local)


def _is_of(friction: LinearFriction | None, kind: str) -> bool:
    return friction is not None and kind in friction.kinds


def _products(h: Array, x: Array, y: Array) -> Array:
    """Integrals of x y between samples, x and y linear there."""
    return h[:, None] / 6.0 * (x[:-1] * (2.0 * y[:-1] + y[1:]) + x[1:] * (2.0 * y[1:] + y[:-1]))


def _viscous(h: Array, x: Array, v: Array) -> Array:
    return _products(h, v, v)


def _distances(h: Array, x: Array, v: Array) -> Array:
    """Integrals of |v| between samples, v linear there and perhaps zero in between."""
    a, b = v[:-1], v[1:]
    plain = np.abs(a + b)
    width = np.abs(b - a)
    through = (a * b < 0.0) | (np.sign(a) * np.sign(b) < 0.0)
    turning = np.divide(a * a + b * b, width, out=plain.copy(), where=through & (width > 0.0))
    return 0.5 * h[:, None] * turning


def _moves(h: Array, x: Array, v: Array) -> Array:
    return np.diff(x, axis=0)


_BY_JOINT = {"Fv": _viscous, "Fc": _distances, "offset": _moves}


def _friction_works(h: Array, x: Array, v: Array, friction: LinearFriction) -> Array:
    """Work of unit parameters (k, N - 1, n): Gauss quadrature on either side of a turn."""
    a, b = v[:-1], v[1:]
    turn = np.divide(a, a - b, out=np.ones_like(a), where=np.sign(a) * np.sign(b) < 0.0)
    works = 0.0
    for first, last in ((np.zeros_like(turn), turn), (turn, np.ones_like(turn))):
        length = last - first
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            s = first + 0.5 * (1.0 + node) * length
            speed = a + s * (b - a)
            # at positions of this speed that end where the samples do
            way = 0.5 * s * ((2.0 - s) * a + s * b) * h[:, None]
            way = way + s * (np.diff(x, axis=0) - 0.5 * (a + b) * h[:, None])
            terms = np.moveaxis(basis_at(friction, speed, x[:-1] + way), -2, 0)
            works = works + 0.5 * weight * terms * speed * (length * h[:, None])
    return np.asarray(works)


def _summed(values: Array, at: NDArray[np.int64]) -> Array:
    """Sums over the stretches between knots of what each step between samples has."""
    return np.add.reduceat(values[: at[-1]], at[:-1], axis=0)

"""Energy and power regressors, and the work of the torques between samples.

Source: M. Gautier and W. Khalil, "On the identification of the inertial parameters of robots", IEEE
CDC 1988 (energy); M. Gautier, "Dynamic identification of robots with power model", IEEE ICRA 1997.

Parameters
----------
model, drive, columns, friction
    As for `torque_regressor`. Friction stores no energy: that has columns of the links, ``Ia`` and
    ``Iam`` alone, with base parameters such as ``base_parameters(model, drive=("Ia",))``.
q, v, a : array_like, shape (..., n)
    Joint variables (rad or m), velocities and accelerations; between samples of shape (N, n).
t : array_like, shape (N,)
    Times, ascending, seconds; need not be regular.
knots : array_like of int, shape (k,), optional
    Numbers of the samples that the rows lie between, ascending; default every sample. Longer
    stretches are fewer rows with less noise.

Returns
-------
ndarray
    Joules or watts, per unit of each parameter for a regressor.

Raises
------
ShapeError, InvalidValueError
    As `torque_regressor`; times or knots that do not ascend, or fewer than two of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_floats
from ..drive import Drives
from ..errors import InvalidValueError, ShapeError
from ..friction import Friction, LinearFriction
from ..friction.protocols import basis_at
from ..model import RobotModel, check_model
from .chunks import FORMS, Form, check_log, evaluate
from .columns import (
    LINKS,
    ChosenColumns,
    Columns,
    chosen_columns,
    friction_of,
    standard_blocks,
)
from .drives import add_powers, couplings, friction_terms, rotor_terms

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


def energy_regressor(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    drive: Drives = True,
    columns: Columns | None = None,
) -> Array:
    """Row of the total energy: kinetic plus potential energy is the row times the parameters.

    Shapes: q, v (..., n) -> (..., 10 f + n), columns as `energy_parameter_names`. Base parameters
    give the energy up to a constant.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> energy_regressor(one, [0.0], [2.0])[[5, 10]]
    array([2., 2.])
    """
    return evaluate(FORMS[energy_regressor], model, (q, v), drive, columns)


def power_regressor(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    drive: Drives = True,
    columns: Columns | None = None,
    friction: Friction | None = None,
) -> Array:
    """Row of the joint power: ``v . idm(model, q, v, a)`` is the row times the parameters.

    Shapes: q, v, a (..., n) -> (..., p), columns as `parameter_names`: for links and rotors the
    rate of `energy_regressor`, for friction and offsets the dissipated power.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> power_regressor(one, [0.0], [3.0], [2.0], columns=["ZZ1", "Fv1", "Fc1"])
    array([6., 9., 3.])
    """
    return evaluate(FORMS[power_regressor], model, (q, v, a), drive, columns, friction)


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
    Shapes: t (N,), q, v (N, n), knots (k,) -> (k - 1, p), columns as `parameter_names`. Those of
    links, rotors and offsets are exact; those of friction where the velocity is linear between the
    samples (also through zero). No accelerations are needed.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> one = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> t = np.array([0.0, 1.0, 2.0])
    >>> energy_difference_regressor(one, t, t[:, None]**2, 2 * t[:, None], columns=["ZZ1", "Fc1"])
    array([[2., 1.], [6., 3.]])
    """
    check_model(model)
    t = _times(t)
    q, v = (as_exact(x, (t.size, model.n), name) for name, x in (("q", q), ("v", v)))
    at = _knots(knots, t.size)
    chosen = chosen_columns(standard_blocks(model, drive, friction), columns, model)
    energy = np.empty((at.size, chosen.count))
    _fill_energies(model, chosen, None, (q[at], v[at]), energy)
    out = np.diff(energy, axis=0)
    for kind, works in _friction_works(model, chosen, np.diff(t), q, v, friction):
        numbers, places = chosen.parameters(kind)
        out[:, places] = _summed(works[:, numbers], at)
    return out


def joint_work(t: ArrayLike, v: ArrayLike, tau: ArrayLike, knots: ArrayLike | None = None) -> Array:
    """Work of joint torques between samples, ``integral of tau . v dt``.

    Shapes: t (N,), v, tau (N, n), knots (k,) -> (k - 1,). Exact where torques and velocities are
    linear between the samples.

    Examples
    --------
    >>> joint_work([0.0, 2.0], [[1.0], [1.0]], [[3.0], [5.0]])
    array([8.])
    """
    times, v = _times(t), as_floats(v, "v")
    if v.ndim != 2 or len(v) != times.size:
        raise ShapeError(f"v: expected shape ({times.size}, n), got {v.shape}.")
    products = _products(np.diff(times), v, as_exact(tau, v.shape, "tau"))
    return _summed(products.sum(axis=1), _knots(knots, times.size))


def _fill_energies(
    model: RobotModel,
    chosen: ChosenColumns,
    friction: None,
    rows: Sequence[Array],
    out: Array,
) -> None:
    """Write the energies of the samples ``(q, v)`` into ``out (N, c)``, zero for friction."""
    from ..kernels.regressors import energy_regressors

    energy_regressors(*rows, model.chain, model.gravity, chosen.places[LINKS], out[:, None])
    add_powers(chosen, rotor_terms(model, rows[1]), rows[1], out, 0.5)


def _fill_powers(
    model: RobotModel,
    chosen: ChosenColumns,
    friction: LinearFriction | None,
    rows: Sequence[Array],
    out: Array,
) -> None:
    """Write the powers of the samples ``(q, v, a)`` into ``out (N, c)``."""
    from ..kernels.regressors import power_regressors

    q, v, a = rows
    power_regressors(*rows, model.chain, model.gravity, chosen.places[LINKS], out[:, None])
    add_powers(chosen, rotor_terms(model, a), v, out)
    add_powers(chosen, friction_terms(model, q, v, friction), v, out)


FORMS[energy_regressor] = Form(_fill_energies, "qv", by_joint=False, stored=True)
FORMS[power_regressor] = Form(_fill_powers, "qva", by_joint=False)


def _times(t: ArrayLike) -> Array:
    """Ascending times (N,)."""
    times = as_floats(t, "t")
    if times.ndim != 1:
        raise ShapeError(f"t: expected times of shape (N,), got {times.shape}.")
    check_log(times.size, "t", least=2)
    for k in np.flatnonzero(np.diff(times) <= 0.0)[:1]:
        raise InvalidValueError(
            f"t: expected ascending times, but t[{k + 1}] = {times[k + 1]:g} follows {times[k]:g}."
        )
    return times


def _knots(knots: ArrayLike | None, N: int) -> NDArray[np.int64]:
    """Ascending numbers (k,) of samples between which the rows lie."""
    at = np.arange(N) if knots is None else np.asarray(knots)
    good = at.ndim == 1 and at.size > 1 and at.dtype.kind in "iu"
    if not good or at[0] < 0 or at[-1] >= N or (np.diff(at.astype(np.int64)) <= 0).any():
        raise InvalidValueError(
            f"knots: expected two or more ascending numbers of samples from 0 to {N - 1}, got "
            f"{knots!r:.80}."
        )
    return at.astype(np.int64)


def _friction_works(
    model: RobotModel,
    chosen: ChosenColumns,
    h: Array,
    q: Array,
    v: Array,
    friction: Friction | None,
) -> Iterator[tuple[str, Array]]:
    """Work (N - 1, k) of each unit parameter of each kind of friction between samples."""
    linear = friction_of(model, friction)
    yield "Fv", _products(h, v, v)
    yield "Fc", _distances(h, v)
    yield "offset", np.diff(q, axis=0)
    if motors := couplings(model):
        crossed = [_products(h, v, v @ cross).sum(axis=1) for _, cross in motors]
        yield "Fvm", np.stack(crossed, axis=1)
        yield "Fcm", _distances(h, v @ np.stack([row for row, _ in motors], axis=1))
    if linear is not None and chosen.has(*linear.kinds):
        yield from zip(linear.kinds, _quadrature(h, q, v, linear), strict=True)


def _products(h: Array, x: Array, y: Array) -> Array:
    """Integrals of x y between samples, x and y linear between them."""
    return h[:, None] / 6.0 * (x[:-1] * (2.0 * y[:-1] + y[1:]) + x[1:] * (2.0 * y[1:] + y[:-1]))


def _distances(h: Array, v: Array) -> Array:
    """Integrals of |v| between samples, v linear between them, also through zero."""
    a, b = v[:-1], v[1:]
    turns = np.sign(a) * np.sign(b) < 0.0
    mean = np.divide(a * a + b * b, np.abs(b - a), out=np.abs(a + b), where=turns)
    return 0.5 * h[:, None] * mean


def _quadrature(h: Array, q: Array, v: Array, friction: LinearFriction) -> Array:
    """Works of unit parameters (k, N - 1, n): Gauss quadrature on either side of a turn."""
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
            way = way + s * (np.diff(q, axis=0) - 0.5 * (a + b) * h[:, None])
            terms = np.moveaxis(basis_at(friction, speed, q[:-1] + way), -2, 0)
            works = works + 0.5 * weight * terms * speed * (length * h[:, None])
    return np.asarray(works)


def _summed(values: Array, at: NDArray[np.int64]) -> Array:
    """Sums over the stretches between knots of values that each step between samples has."""
    return np.add.reduceat(values[: at[-1]], at[:-1], axis=0)

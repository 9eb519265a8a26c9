"""Joint by joint from the last to the first: each with its own equations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...errors import InvalidValueError
from ..equations import Equations
from ..scale.reduction import Reduction
from .detailed import DetailedEstimate
from .estimate import Method
from .least_squares import check_count, deviations_of, weights_of

_ZERO = 1e-12
"""Length of a column in a joint's equations, relative to all, below which it has no part there."""
_NOTHING = 1e-7
"""Singular value, relative to the largest of columns of one length, that determines nothing."""


@dataclass(frozen=True, slots=True)
class SequentialStep:
    """What the equations of one joint, or of joints that motors couple, have told.

    Parameters
    ----------
    joints : tuple of int
        From 1, of the robot's n joints.
    names : tuple of str
        Parameters that are known from here on.
    waiting : tuple of str
        Parameters of these equations that wait for those of the joints before.
    equations : int
        Their number.
    sigma : float
        Deviation of their residuals with the values found, the mean of the joints, N m or N.
    condition : float
        Of the columns of ``names`` and ``waiting``, of length one, where they are independent.
    """

    joints: tuple[int, ...]
    names: tuple[str, ...]
    waiting: tuple[str, ...]
    equations: int
    sigma: float
    condition: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SequentialEstimate(DetailedEstimate):
    """Parameters joint by joint. Read-only.

    Parameters
    ----------
    steps : tuple of SequentialStep
        From the last joint to the first.
    """

    steps: tuple[SequentialStep, ...]


def sequential(system: Equations, reduction: Reduction) -> SequentialEstimate:
    """Identify joint by joint, from the last to the first, carrying on what is known.

    The torque of a joint depends on the links beyond it alone. So the last joint's equations give
    the parameters of the last link that they tell; with these, the equations of the joint before
    give those of its link, and so on. Joints whose motors are coupled are one step. Parameters
    that a step tells only in combination wait, with the equations that are left over, for the
    step that tells them apart. Errors of values that are known enter the steps that use them, and
    the covariance is of all together, but values are not improved later: weighted least squares,
    which solves all steps at once, has smaller deviations. What is gained are small problems, and
    joints whose errors of modelling do not reach those beyond them.

    Parameters
    ----------
    system : Equations
        Robot and choices; torques or their momentum form, which have equations by joint.
    reduction : Reduction
        Of the same equations.

    Returns
    -------
    SequentialEstimate
        With a report of each step.

    Raises
    ------
    InvalidValueError
        Equations of a power or an energy; fewer equations than parameters.

    References
    ----------
    Seed book section 1.6.4.

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.identification import Log, choose_processing, equations, reduce_equations
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> from robotmodels.robots import load
    >>> model, t, w = load("rx90"), 0.01 * np.arange(600)[:, None], np.linspace(1.0, 5.0, 6)
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.01, q, idm(model, q, v, a), v, a)
    >>> base = base_parameters(model, drive=False)
    >>> given = choose_processing(log, filtered=False, decimation=1, edges=0.0, dead_band=0.0)
    >>> system = equations(base, log, given)
    >>> found = sequential(system, reduce_equations(system))
    >>> [step.joints for step in found.steps], bool(np.allclose(found.values, base.values(model)))
    ([(6,), (5,), (4,), (3,), (2,), (1,)], True)
    """
    if not system.form.by_joint:
        raise InvalidValueError(
            "form: going joint by joint needs equations of each joint; take the torque or the "
            f"filtered form instead of {system.form.name.lower()!r}."
        )
    check_count(reduction)
    groups = _groups(system)
    known = _Known(len(reduction.names))
    weights = 1.0 / _own_deviations(reduction)
    steps = tuple(_step(known, reduction, group, weights) for group in groups)
    lost = np.flatnonzero(~known.done)
    if lost.size:  # rounding: what all equations tell, they have told in turn
        raise InvalidValueError(
            f"reduction: no step tells {', '.join(reduction.names[k] for k in lost)}; its columns "
            "are nearly dependent. Take weighted least squares, or fewer parameters."
        )
    return SequentialEstimate(
        Method.SEQUENTIAL, reduction.names, known.values, known.covariance,
        deviations_of(reduction, known.values), iterations=len(steps), steps=steps,
    )  # fmt: skip


class _Known:
    """Values so far, their covariance, and equations (of noise 1) of parameters that wait."""

    def __init__(self, b: int) -> None:
        self.values = np.zeros(b)
        self.covariance = np.zeros((b, b))
        self.done = np.zeros(b, dtype=bool)
        self.left = np.zeros((0, b + 1))


def _groups(system: Equations) -> list[tuple[int, ...]]:
    """Joints of each step, from 0, from the last to the first."""
    n = system.model.n
    label = list(range(n))
    transmission = system.model.transmission
    if transmission is not None:
        for motor in transmission.coupled_motors:
            joints = [j for j in range(n) if transmission.weights[motor - 1][j] != 0.0]
            # joints between them are behind the first as well
            first, last = min(joints), max(joints)
            for j in range(first, last + 1):
                label[j] = min(label[first], label[j])
    found = sorted(set(label), reverse=True)
    return [tuple(j for j in range(n) if label[j] == k) for k in found]


def _own_deviations(reduction: Reduction) -> Array:
    """Deviations of the residuals of each joint's equations when they alone are solved."""
    sigma = np.zeros(len(reduction.factors))
    for j, F in enumerate(reduction.factors):
        A, y = F[:, :-1], F[:, -1]
        size = np.linalg.norm(A, axis=0)
        own = size > 0.0
        if not len(F) or not own.any():
            sigma[j] = np.linalg.norm(y) / np.sqrt(max(reduction.counts[j], 1))
            continue
        U, s, _ = np.linalg.svd(A[:, own] / size[own], full_matrices=False)
        rank = int((s > _NOTHING * s[0]).sum())
        e = y - U[:, :rank] @ (U[:, :rank].T @ y)
        sigma[j] = np.linalg.norm(e) / np.sqrt(max(int(reduction.counts[j]) - rank, 1))
    return 1.0 / weights_of(sigma, reduction)


def _step(
    known: _Known, reduction: Reduction, group: tuple[int, ...], weights: Array
) -> SequentialStep:
    b = len(known.values)
    own = np.vstack([weights[j] * reduction.factors[j] for j in group])
    rows = np.vstack((known.left, own))
    squares = [(w * np.linalg.norm(F[:, :b], axis=0)) ** 2
               for w, F in zip(weights, reduction.factors, strict=True)]  # fmt: skip
    longest = np.sqrt(np.sum(squares, axis=0))
    sizes = np.linalg.norm(rows[:, :b], axis=0)
    new = np.flatnonzero(~known.done & (sizes > _ZERO * longest))
    count = int(sum(reduction.counts[j] for j in group))
    told, waiting, condition = new[:0], new[:0], 1.0
    if new.size:
        A = rows[:, new] / sizes[new]
        U, s, Vt = np.linalg.svd(A)
        rank = int((s > _NOTHING * s[0]).sum())
        condition = float(s[0] / s[rank - 1])
        # a parameter is told if no combination without effect has it
        part = np.abs(Vt[rank:]).max(axis=0, initial=0.0) > np.sqrt(_NOTHING)
        told, waiting = new[~part], new[part]
        inverse = (Vt[:rank].T / s[:rank]) @ U[:, :rank].T / sizes[new][:, None]
        _take(known, told, inverse[~part], rows)
        # equations of those that wait, without those that are known now
        Q = np.linalg.qr(rows[:, told], mode="complete")[0][:, told.size :]
        rest = Q.T @ rows if waiting.size else np.zeros((0, b + 1))
        rest[:, told] = 0.0
        if len(rest) > b + 1:
            rest = np.asarray(np.linalg.qr(rest, mode="r"))
        known.left = rest
    e = own[:, b] - own[:, :b] @ known.values if not waiting.size else _rest(own, known, waiting)
    sigma = (
        np.linalg.norm(e)
        / np.sqrt(max(count - new.size, 1))
        * np.mean([1.0 / weights[j] for j in group])
    )
    name = reduction.names.__getitem__
    return SequentialStep(
        tuple(j + 1 for j in group), tuple(map(name, told.tolist())),
        tuple(map(name, waiting.tolist())), count, float(sigma), condition,
    )  # fmt: skip


def _rest(own: Array, known: _Known, waiting: NDArray[np.int64]) -> Array:
    """Residuals of a step with those parameters that wait as they fit best."""
    y = own[:, -1] - own[:, :-1] @ known.values
    columns = own[:, waiting]
    return y - columns @ np.linalg.lstsq(columns, y, rcond=_NOTHING)[0]


def _take(known: _Known, told: NDArray[np.int64], inverse: Array, rows: Array) -> None:
    """Values of parameters, and how they vary with the noise of the rows and with what is known."""
    done = np.flatnonzero(known.done)
    y = rows[:, -1] - rows[:, done] @ known.values[done]
    known.values[told] = inverse @ y
    effect = -inverse @ rows[:, done]
    P = known.covariance[np.ix_(done, done)]
    cross = effect @ P
    known.covariance[np.ix_(told, done)] = cross
    known.covariance[np.ix_(done, told)] = cross.T
    known.covariance[np.ix_(told, told)] = inverse @ inverse.T + cross @ effect.T
    known.done[told] = True

"""Static deflection, natural frequencies and linear models about an equilibrium (7.3.3.3, 7.3.3.4).

Parameters
----------
arm, q, wrench
    See `robotmodels.flexible`; q of `linearize` has shape (n,).
joints, output : str
    ``"locked"`` or ``"free"``: motors held or without torque; ``"joint"`` or ``"tip"``.

Returns
-------
Deflection, ndarray or LinearModel
    Equilibrium; frequencies, rad/s; matrices, poles and zeros. Postures without equilibrium, and
    singular ones for the tip, are not linearised.

Examples
--------
>>> from robotmodels import RobotModel, DHTable, flexible
>>> model = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]), gravity=(0, 0, 0))
>>> arm = flexible.FlexibleRobot(model, {1: flexible.beam(1.0, EI=(np.inf, 1.0), hub=0.1)})
>>> linearize(arm, [0.0]).zeros.imag.round(3)                # the clamped frequencies
array([-22.034,  -3.516,   3.516,  22.034])
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, Value, as_exact
from .._choices import one_of
from .._outcomes import Outcome, Result
from ..errors import InvalidValueError, SingularMassMatrixError
from .models import checked_rows, forces, jacobian, mass_matrix
from .robot import FlexibleRobot, check_arm

_LARGE = 0.1  # of the length: deflections for which linear modes are within 1 %
_ITERATIONS = 50
_SINGULAR = 1e-9
_SOFT = 1e-12  # least stiffness of a stable equilibrium, relative to the greatest


class DeflectionStatus(Outcome):
    """Outcome of a static deflection; fits int8."""

    SMALL = 0, "The deflection of every link is small, so that its linear modes hold."
    LARGE = 1, "The tip of a link moves by more than a tenth of its length: see elastica."
    NOT_FOUND = 2, "No equilibrium was found: the load is beyond the range of linear modes."
    UNSTABLE = 3, "The equilibrium is unstable: the load exceeds the one at which the arm buckles."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Deflection(Result):
    """Elastic equilibrium of an arm whose joints are held.

    ``e`` (..., m) and the torques ``tau`` (..., n) that hold the joints, NaN where none was found;
    ``deflection`` (...), the largest displacement of a link's tip relative to its length;
    ``status``.
    """

    e: Array
    tau: Array
    deflection: Array
    status: NDArray[np.int8]
    outcomes = DeflectionStatus


def static_deflection(
    arm: FlexibleRobot, q: ArrayLike, wrench: ArrayLike | None = None
) -> Deflection:
    """Deflection of an arm at rest under gravity and a wrench, joints held."""
    batch, (x, wrench) = checked_rows(arm, (q, None), wrench=wrench)
    n, m, size = arm.n, arm.m, scales(arm)[arm.n :]
    status = np.full(len(x), DeflectionStatus.NOT_FOUND, np.int8)
    todo = np.arange(len(x))
    for _ in range(_ITERATIONS):
        if not todo.size:
            break
        y = x[todo]
        K = tangent(arm, y, wrench[todo], 1)[:, n:, n:]
        left = forces(arm, y, 0.0 * y, 0.0 * y, wrench[todo])[0][:, n:, None]
        try:
            step = np.linalg.solve(K, left)[..., 0]
        except np.linalg.LinAlgError:  # exactly at the load of buckling
            step = (np.linalg.pinv(K) @ left)[..., 0]
        length = np.abs(step / size).max(axis=1, initial=0.0)
        x[todo, n:] -= step / np.maximum(2.0 * length, 1.0)[:, None]
        bent = np.abs(x[todo, n:] / size).max(axis=1, initial=0.0)
        done = length < 1e-11 * (1.0 + bent)
        stiff = np.linalg.eigvalsh(size[:, None] * (K + K.swapaxes(1, 2)) * size)
        stable = (stiff > _SOFT * np.abs(stiff).max(axis=1, initial=0.0)[:, None]).all(axis=1)
        kinds = np.where(stable, DeflectionStatus.SMALL, DeflectionStatus.UNSTABLE)
        status[todo[done]] = kinds[done]
        todo = todo[~done & (bent < 10.0)]
    tau, drives = forces(arm, x, 0.0 * x, 0.0 * x, wrench)[0][:, :n], arm.model.drive_matrices
    tau = tau + (0.0 if drives is None else drives.offset)
    e, deflection = x[:, n:], np.zeros(len(x))
    for row, link in arm.links.items():
        here = slice(*arm.parts.chain.start[row - 1 : row + 1])
        moved = np.linalg.norm(e[:, here] @ link.tip.Phi, axis=1) / link.length
        deflection = np.maximum(deflection, moved)
    status[(status == DeflectionStatus.SMALL) & (deflection > _LARGE)] = DeflectionStatus.LARGE
    found = np.hstack([e, tau, deflection[:, None]])
    found[status == DeflectionStatus.NOT_FOUND] = np.nan
    e, tau, deflection = np.split(found.reshape(*batch, m + n + 1), [m, m + n], axis=-1)
    return Deflection(e, tau, deflection[..., 0], status.reshape(batch))


def natural_frequencies(arm: FlexibleRobot, q: ArrayLike, joints: str = "locked") -> Array:
    """Natural frequencies (..., m) of the undeformed arm at rest, without gravity, ascending.

    With free joints (..., n + m): those of the n motions without vibration are zero.
    """
    one_of(joints, ("locked", "free"), "joints")
    batch, (x,) = checked_rows(arm, (q, None))
    first = arm.n if joints == "locked" else 0
    M, K = mass_matrix(arm, x[:, : arm.n])[:, first:, first:], arm.parts.K[first:, first:]
    L = _inverse_factor(arm, M)
    found = np.sqrt(np.maximum(np.linalg.eigvalsh(L @ K @ L.swapaxes(1, 2)), 0.0))
    if not first:
        found[:, : arm.n] = 0.0
    return found.reshape(*batch, len(K))


def scales(arm: FlexibleRobot) -> Array:
    """Sizes of coordinates: 1 rad or m, of modes the amplitude with the tip at a length."""
    sizes = [np.full(link.m, link.length) for link in arm.links.values()]
    return np.concatenate([np.ones(arm.n), *sizes, np.ones(len(arm.joints))])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LinearModel(Frozen, Value):
    """Linear model about an equilibrium: ``x' = A x + B u``, ``y = C x + D u``.

    With k = n + m the state (2 k,) is the deviation of (q, e, v, e_v), the input (n,) that of tau;
    ``poles`` (2 k,) and finite transmission ``zeros`` (up to 2 m,) are complex, 1/s; ``e`` (m,) are
    the elastic coordinates of the equilibrium.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    poles: NDArray[np.complex128]
    zeros: NDArray[np.complex128]
    e: Array


def linearize(arm: FlexibleRobot, q: ArrayLike, output: str = "joint") -> LinearModel:
    """Linear model about the equilibrium at q under gravity, with its poles and zeros.

    The output ``"joint"`` is q; ``"tip"`` the motion of the joints that would move the tool of the
    rigid arm as the flexible one moves: ``q + J_q^+ J_e e``, of positions where they determine it,
    else of poses. Its zeros on the right side are the reason why a tip is not tracked causally.
    """
    one_of(output, ("joint", "tip"), "output")
    n, q = check_arm(arm).n, as_exact(q, (arm.n,), "q")
    k, found = n + arm.m, static_deflection(arm, q)
    if found.status == DeflectionStatus.NOT_FOUND:
        raise InvalidValueError(f"q: there is no equilibrium to linearise about. {found.reason()}")
    e = found.e
    M, D = mass_matrix(arm, q, e), arm.parts.D
    K = tangent(arm, np.concatenate([q, e])[None], None)[0]
    J = jacobian(arm, q, e)
    H = np.zeros((n, arm.m)) if output == "joint" else tip_inverse(J, n) @ J[:, n:]
    L, E, F = _inverse_factor(arm, M), slice(n, k), slice(0, n)
    inverse = L.T @ L
    A = np.block([[np.zeros((k, k)), np.eye(k)], [-inverse @ K, -inverse @ D]])
    return LinearModel(
        A=A,
        B=np.vstack([np.zeros((k, n)), inverse[:, :n]]),
        C=np.hstack([np.eye(n), H, np.zeros((n, k))]),
        D=np.zeros((n, n)),
        poles=_roots(M, D, K),
        zeros=_roots(M[E, E] - M[E, F] @ H, D[E, E], K[E, E] - K[E, F] @ H),
        e=e,
    )


def _inverse_factor(arm: FlexibleRobot, M: Array) -> Any:
    """Inverse of Cholesky's factor of mass matrices (..., k, k)."""
    try:
        return np.linalg.inv(np.linalg.cholesky(M))
    except np.linalg.LinAlgError:
        raise SingularMassMatrixError(
            f"{arm.model.name!r}: a coordinate moves no inertia; see model.with_inertia, Ia."
        ) from None


def tip_inverse(J: Array, n: int) -> Array:
    """J_q^+ of Jacobians (..., 6, n + m), with zeros for rotations if positions determine it."""
    for rows in (3, 6):
        values = np.linalg.svd(J[..., :rows, :n], compute_uv=False)
        if n <= rows and (values[..., -1] > _SINGULAR * values[..., 0]).all():
            inverse: Any = np.linalg.pinv(J[..., :n] * (np.arange(6) < rows)[:, None])
            return inverse
    raise InvalidValueError(
        "q: the joints do not determine the pose of the tool; take output='joint' or another q."
    )


def tangent(arm: FlexibleRobot, x: Array, wrench: Array | None, order: int = 3) -> Array:
    """Derivatives (N, k, k) of the forces at rest by rows of (q, e), by central differences."""
    k, h = x.shape[1], (1e-4 if order == 1 else 1e-2) * scales(arm)
    load = None if wrench is None else np.repeat(wrench, k, axis=0)

    def at(c: int) -> Array:
        y = (x[:, None] + c * np.diag(h)).reshape(-1, k)
        return forces(arm, y, 0.0 * y, 0.0 * y, load)[0].reshape(-1, k, k)

    weights = (0.5,) if order == 1 else (0.75, -0.15, 1.0 / 60.0)
    moved = [w * (at(c) - at(-c)) for c, w in enumerate(weights, 1)]
    return (sum(moved) / h[:, None]).swapaxes(1, 2)


def _roots(M: Array, D: Array, K: Array) -> NDArray[np.complex128]:
    """Finite s with M s^2 + D s + K singular, ordered by imaginary and real parts."""
    from scipy.linalg import eig

    if not len(M):
        return np.zeros(0, np.complex128)
    zero, one, pencil = np.zeros_like(M), np.eye(len(M)), (-K, M)
    if D.any():
        pencil = np.block([[zero, one], [-K, -D]]), np.block([[one, zero], [zero, M]])
    alpha, beta = eig(*pencil, right=False, homogeneous_eigvals=True)
    finite = np.abs(beta) > 1e-13 * np.abs(alpha)
    s: Any = alpha[finite] / beta[finite]
    if not D.any():
        root = np.sqrt(s.astype(np.complex128))
        s = np.concatenate([root, -root])
    return s[np.lexsort((s.real.round(9), s.imag.round(9)))]

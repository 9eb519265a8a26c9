"""Sequential least squares: joint by joint from the last to the first, and recursive in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..._arrays import Array, Frozen, as_number
from ...errors import InvalidValueError
from ...estimation.estimate import Estimate
from ...estimation.factor import TriangularFactors, triangle
from ...estimation.linear import (
    check_count,
    first_weights,
    inverse_triangle,
    residual_noise,
    residual_std,
)
from ..equations import Equations
from .base import Method

_ZERO = 1e-12  # rank tolerance: norm of a column in a joint's equations relative to all equations
_RANK = 1e-7  # rank tolerance: singular value of the scaled columns relative to the largest


@dataclass(frozen=True, slots=True)
class SequentialStep:
    """Step of one joint, or of joints that motors couple (from 1): parameters, equations.

    ``waiting`` are left to later steps; ``sigma``: residuals, N m or N; ``condition``: of columns.
    """

    joints: tuple[int, ...]
    names: tuple[str, ...]
    waiting: tuple[str, ...]
    equations: int
    sigma: float
    condition: float


@dataclass(frozen=True, slots=True, eq=False)
class Sequential(Method):
    """Sequential least squares, joint by joint from the last to the first.

    The torque of a joint depends on the links beyond it alone. Parameters that a step determines
    only in combination are left to later steps. Errors of known values enter the covariance, but
    values are not improved later; weighted least squares has smaller standard errors. ``details``
    is a tuple of steps, with ``joints, names, waiting, equations, sigma, condition``.

    References
    ----------
    Book section 1.6.4.
    """

    name: ClassVar[str] = "sequential"
    title: ClassVar[str] = "sequential least squares, from the last joint to the first"

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters."""
        if not system.form.by_joint:
            raise InvalidValueError(
                "form: the sequential method needs equations of each joint; use form 'torque' or "
                f"'filtered' instead of {system.form.name.lower()!r}."
            )
        check_count(factors)
        b, noise = len(factors.names), residual_noise(factors)
        scaled = [R / s for R, s in zip(factors.factors, noise, strict=True)]
        joint = np.repeat(np.arange(len(scaled)), [len(R) for R in scaled])
        A, y = (whole := np.vstack(scaled))[:, :b], whole[:, b]
        longest = np.linalg.norm(A, axis=0)
        # values = L @ y; equations left by earlier steps: left @ values = kept @ y
        L, done = np.zeros((b, len(y))), np.zeros(b, dtype=bool)
        left, kept = np.zeros((0, b)), np.zeros((0, len(y)))
        steps = []
        for joints in _joint_groups(system):
            at = np.isin(joint, joints)
            added = A[at]
            rows, rights = np.vstack((left, added)), np.vstack((kept, np.eye(len(y))[at]))
            sizes = np.linalg.norm(rows, axis=0)
            new = np.flatnonzero(~done & (sizes > _ZERO * longest))
            U, s, Vt = np.linalg.svd(rows[:, new] / sizes[new], full_matrices=True)
            rank = int((s > _RANK * s.max(initial=0.0)).sum())
            # a parameter is determined if no combination without effect contains it
            alone = np.abs(Vt[rank:]).max(axis=0, initial=0.0) <= np.sqrt(_RANK)
            found, waiting = new[alone], new[~alone]
            inverse = (Vt[:rank].T / s[:rank]) @ U[:, :rank].T / sizes[new][:, None]
            L[found] = inverse[alone] @ (rights - rows[:, done] @ L[done])
            done[found] = True
            # equations of the other parameters, projected off the determined ones
            Q = np.linalg.qr(rows[:, found], mode="complete")[0][:, found.size :]
            Q = Q[:, : Q.shape[1] if waiting.size else 0]
            left, kept = Q.T @ rows, Q.T @ rights
            left[:, found] = 0.0
            e = y[at] - added @ (L @ y)
            e -= added[:, waiting] @ np.linalg.lstsq(added[:, waiting], e, rcond=_RANK)[0]
            count = int(factors.counts[list(joints)].sum())
            sigma = np.linalg.norm(e) / np.sqrt(max(count - new.size, 1))
            steps.append(
                SequentialStep(
                    tuple(j + 1 for j in joints),
                    tuple(factors.names[k] for k in found),
                    tuple(factors.names[k] for k in waiting),
                    count,
                    float(sigma * noise[list(joints)].mean()),
                    float(s[0] / s[rank - 1]) if rank else 1.0,
                )
            )
        if not done.all():  # by rounding only: the steps together have the rank of all equations
            missing = ", ".join(factors.names[k] for k in np.flatnonzero(~done))
            raise InvalidValueError(
                f"log: no step determines {missing}; their columns are nearly dependent. Use "
                "weighted least squares, or fewer parameters."
            )
        values, sigma = L @ y, residual_std(factors, L @ y)
        return Estimate(
            factors.names, values, L @ L.T, sigma, iterations=len(steps), details=tuple(steps)
        )


def _joint_groups(system: Equations) -> list[tuple[int, ...]]:
    """Joints of each step, from 0, from the last to the first; coupled motors join them."""
    n = system.model.n
    label = list(range(n))
    transmission = system.model.transmission
    if transmission is not None:
        for motor in transmission.coupled_motors:
            joints = np.flatnonzero(transmission.weights[motor - 1]).tolist()
            first, last = min(joints), max(joints)
            for j in range(first, last + 1):
                label[j] = min(label[first], label[j])
    labels = sorted(set(label), reverse=True)
    return [tuple(j for j in range(n) if label[j] == k) for k in labels]


_POINTS = 200  # number of points of the history
_DETERMINED = 1e-9  # least diagonal entry of the scaled factor for a determined parameter


@dataclass(frozen=True, slots=True, eq=False)
class RecursiveHistory(Frozen):
    """Estimates as the log proceeds (NaN while not determined), effective number of instants.

    Shapes: t (h,) s; values, standard_errors (h, b).
    """

    t: Array
    values: Array
    standard_errors: Array
    memory: float

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True, eq=False)
class Recursive(Method):
    """Weighted least squares in the order of time, by updates of a triangular factor.

    The estimate is that at the end of the log; ``details`` is the history.

    Parameters
    ----------
    forgetting : float
        Weight of the squares of an instant relative to those of the next, above 0 and at most 1;
        the effective number of instants is about ``1 / (1 - forgetting)``.

    References
    ----------
    Book section 1.6.4; G. Bierman, "Factorization Methods for Discrete Sequential Estimation",
    1977, chapter V (square-root information form).
    """

    forgetting: float = 1.0
    name: ClassVar[str] = "recursive"
    title: ClassVar[str] = "recursive least squares in time"

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters."""
        forgetting = as_number(self.forgetting, "forgetting", above=0.0)
        if forgetting > 1.0:
            raise InvalidValueError(f"forgetting: expected at most 1, got {forgetting:g}.")
        check_count(factors)
        b, weights = len(factors.names), first_weights(factors)
        stride = max(1, int((factors.counts + factors.left_out).max()) // _POINTS)
        R, equations, memory, count, t = np.zeros((0, b + 1)), 0.0, 0.0, 0, 0.0
        points: list[tuple[float, Array, Array]] = []
        for block in system.blocks():
            if not len(block):  # a recording hardly longer than its edges
                continue
            cuts = np.arange(stride - count % stride, len(block), stride)
            for part in np.split(np.arange(len(block)), cuts):
                age = forgetting ** np.arange(len(part) - 1, -1, -1.0)
                fade, use = forgetting ** len(part), block.use[part]
                new = np.concatenate((block.W[part], block.y[part, :, None]), axis=2)
                new *= weights[:, None] * np.sqrt(age)[:, None, None]
                R = np.vstack((np.sqrt(fade) * R, new[use]))
                R = triangle(R) if len(R) > b else R  # fewer rows have no solution yet
                equations = fade * equations + float(age @ use.sum(axis=1))
                memory = fade * memory + float(age.sum())
                count, t = count + len(part), float(block.t[part[-1]])
                if count % stride == 0:
                    points.append((t, *_solution(R, equations)))
        if count % stride:
            points.append((t, *_solution(R, equations)))
        values, covariance = points[-1][1:]
        if np.isnan(values).any():
            raise InvalidValueError(
                f"forgetting: with {forgetting:g} about {memory:.3g} instants count at the "
                "end of the log, which do not determine the parameters; use a larger factor."
            )
        notes = (
            f"About {memory:.3g} instants of the log count, those at its end most; earlier "
            "ones are forgotten.",
        )
        times, history, covariances = (np.array(x) for x in zip(*points, strict=True))
        errors = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
        return Estimate(
            factors.names,
            values,
            covariance,
            residual_std(factors, values),
            iterations=len(points),
            notes=notes if forgetting < 1.0 else (),
            details=RecursiveHistory(times, history, errors, memory),
        )


def _solution(R: Array, equations: float) -> tuple[Array, Array]:
    """Values (b,) and covariance (b, b) of the equations so far; NaN if not determined."""
    b = R.shape[1] - 1
    size = np.linalg.norm(R[:, :b], axis=0)
    if len(R) <= b or equations <= b or (np.abs(np.diag(R)[:b]) <= _DETERMINED * size).any():
        return np.full(b, np.nan), np.full((b, b), np.nan)
    inverse = inverse_triangle(R[:b, :b])
    return inverse @ R[:b, b], float(R[b, b] ** 2) / (equations - b) * inverse @ inverse.T

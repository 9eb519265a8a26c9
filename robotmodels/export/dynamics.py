"""Dynamic models on a tape: Khalil's customised recursions of Newton and Euler, written once.

Everything is linear in the standard parameters, which are constants, inputs or units: torques,
regressors (a unit parameter at a time) and mass matrices come from the same recursions.

References
----------
Seed book sections 1.5.1 and 1.5.2; W. Khalil and J.-F. Kleinfinger, IEEE Journal of Robotics and
Automation 3(6), 1987.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..inertia import PARAMETERS
from ..model import RobotModel
from .geometry import Link, Pose, constant_pose
from .tape import Number, Scalar, Vector, cross, function, plus, times

Parameters = Mapping[str, Number]
"""Standard parameters by their names; those that are missing are zero."""
Ten = tuple[Number, ...]
Wrench = tuple[Vector, Vector]

_ZERO: Vector = (0.0, 0.0, 0.0)
_PLACES = ((0, 1, 2), (1, 3, 4), (2, 4, 5))  # of the elements of an inertia matrix


class Motion(NamedTuple):
    """Angular velocity and acceleration of a link, acceleration of its origin, Khalil's ``U``."""

    w: Vector
    dw: Vector
    u: Vector
    U: tuple[Vector, ...]


def ten_of(parameters: Parameters, number: int, link: Link) -> Ten:
    """Inertial parameters of a link about its origin, lifted or not."""
    ten = tuple(parameters.get(f"{name}{number}", 0.0) for name in PARAMETERS)
    J = _shifted(ten[:6], ten[6:9], ten[9], (0.0, 0.0, link.lift))
    return (*J, *ten[6:8], ten[8] + ten[9] * link.lift, ten[9])


def motions(
    model: RobotModel, links: Sequence[Link], v: Sequence[Number], a: Sequence[Number]
) -> list[Motion]:
    """Motions of all links; the base is accelerated against gravity."""
    g = -model.gravity @ np.array(constant_pose(model.base)[0])
    g[np.abs(g) < 1e-15 * np.abs(g).max(initial=0.0)] = 0.0
    out = [Motion(_ZERO, _ZERO, tuple(g.tolist()), (_ZERO,) * 3)]
    for link in links:
        of = out[link.antecedent]
        w, dw = link.inward(of.w), link.inward(of.dw)
        u = link.inward(plus(of.u, times(of.U, link.shift)))
        rate, change = (v[link.joint], a[link.joint]) if link.joint >= 0 else (0.0, 0.0)
        if not link.slides:
            dw = dw[0] + w[1] * rate, dw[1] - w[0] * rate, dw[2] + change
            w = w[0], w[1], w[2] + rate
        xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
        xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
        U = (
            (-(yy + zz), xy - dw[2], xz + dw[1]),
            (xy + dw[2], -(xx + zz), yz - dw[0]),
            (xz - dw[1], yz + dw[0], -(xx + yy)),
        )
        u = plus(u, (U[0][2] * link.r, U[1][2] * link.r, U[2][2] * link.r))
        if link.slides:
            twice = 2.0 * rate
            u = u[0] + w[1] * twice, u[1] - w[0] * twice, u[2] + change
        out.append(Motion(w, dw, u, U))
    return out


def wrench_of(motion: Motion, ten: Ten) -> Wrench:
    """Force ``M u + U MS`` and moment ``J dw + w x J w + MS x u`` that accelerate a link."""
    XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = ten
    w, dw, u, U = motion
    xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    MS = MX, MY, MZ
    N = (
        XX * dw[0] + (ZZ - YY) * (w[1] * w[2]) - XY * U[2][0] + XZ * U[1][0] + YZ * (yy - zz),
        YY * dw[1] + (XX - ZZ) * (w[0] * w[2]) + XY * U[2][1] - YZ * U[0][1] + XZ * (zz - xx),
        ZZ * dw[2] + (YY - XX) * (w[0] * w[1]) - XZ * U[1][2] + YZ * U[0][2] + XY * (xx - yy),
    )
    return plus(times(U, MS), (M * u[0], M * u[1], M * u[2])), plus(N, cross(MS, u))


def passed_on(link: Link, F: Vector, N: Vector) -> Wrench:
    """A wrench on a link as that on its antecedent."""
    N = N[0] - link.r * F[1], N[1] + link.r * F[0], N[2]
    F = link.outward(F)
    return F, plus(link.outward(N), cross(link.shift, F))


def joint_torques(
    links: Sequence[Link], wrenches: Mapping[int, Wrench], drives: Sequence[Number]
) -> list[Number]:
    """Torques that carry wrenches on the links (by their numbers), and those of the drives."""
    total, tau = dict(wrenches), list(drives)
    for number in range(len(links), 0, -1):
        link = links[number - 1]
        if number in total:
            F, N = total[number]
            if link.joint >= 0:
                tau[link.joint] = (F[2] if link.slides else N[2]) + tau[link.joint]
            F, N = passed_on(link, F, N)
            before = total.get(link.antecedent, (_ZERO, _ZERO))
            total[link.antecedent] = plus(before[0], F), plus(before[1], N)
    return tau


def tool_wrench(
    model: RobotModel, links: Sequence[Link], tool: tuple[int, Pose], wrench: Sequence[Number]
) -> dict[int, Wrench]:
    """Wrench of the tool on the environment (world axes) as one on the link that carries it."""
    number, (_, point) = tool
    columns: Sequence[Vector] = list(zip(*constant_pose(model.base)[0], strict=True))  # type: ignore[arg-type]
    F, N = times(columns, tuple(wrench[:3])), times(columns, tuple(wrench[3:]))  # type: ignore[arg-type]
    for k in model.table.path(number):
        F, N = links[k - 1].inward(F), links[k - 1].inward(N)
        point = plus(point, (0.0, 0.0, links[k - 1].lift))  # not zero for the last one alone
    return {number: (F, plus(N, cross(point, F)))}


def torques_of_drives(
    model: RobotModel, parameters: Parameters, v: Sequence[Number], a: Sequence[Number]
) -> list[Number]:
    """Torques of rotors, friction and offsets, with those of coupled motors."""
    rows, tau, K = (model.table.joint_rows + 1).tolist(), [], model.transmission
    for row, rate, change in zip(rows, v, a, strict=True):
        Ia, Fv, Fc, offset = (parameters.get(f"{c}{row}", 0.0) for c in DRIVE_TERMS)
        tau.append(Ia * change + Fv * rate + Fc * function("sign", rate) + offset)
    for m in () if K is None else K.coupled_motors:
        w = K.weights[m - 1].tolist()  # type: ignore[union-attr]
        Iam, Fvm, Fcm = (parameters.get(f"{c}m{rows[m - 1]}", 0.0) for c in DRIVE_TERMS[:3])
        rate, change = dot(w, v), dot(w, a)
        for j in np.flatnonzero(w).tolist():
            rest = Iam * (change - w[j] * a[j]) + Fvm * (rate - w[j] * v[j])
            tau[j] = tau[j] + w[j] * (rest + Fcm * function("sign", rate))
    return tau


DRIVE_TERMS = ("Ia", "Fv", "Fc", "offset")


def dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    """Sum of products."""
    return sum((x * y for x, y in zip(a, b, strict=True)), 0.0)


def inverse_dynamics(
    model: RobotModel, links: Sequence[Link], moved: Sequence[Motion], parameters: Parameters,
    v: Sequence[Number], a: Sequence[Number], tool: Mapping[int, Wrench],
) -> list[Number]:  # fmt: skip
    """Joint torques of a motion, drives and the wrench of the tool included."""
    wrenches = {}
    for number in range(1, len(links) + 1):
        ten = ten_of(parameters, number, links[number - 1])
        F, N = tool.get(number, (_ZERO, _ZERO))
        if any(map(given, ten)) or number in tool:
            own = wrench_of(moved[number], ten)
            wrenches[number] = plus(own[0], F), plus(own[1], N)
    return joint_torques(links, wrenches, torques_of_drives(model, parameters, v, a))


def given(x: Number) -> bool:
    """Whether a number is not zero."""
    return isinstance(x, Scalar) or x != 0.0


def mass_matrix(
    model: RobotModel, links: Sequence[Link], parameters: Parameters
) -> list[list[Number]]:
    """Joint-space inertia matrix by composite bodies, with rotors."""
    zero, rotors = [0.0] * model.n, {k: x for k, x in parameters.items() if k.startswith("Ia")}
    units = np.eye(model.n).tolist()
    M = [torques_of_drives(model, rotors, zero, unit) for unit in units]  # symmetric
    composite: list[Ten] = [(0.0,) * 10]
    composite += [ten_of(parameters, k, link) for k, link in enumerate(links, start=1)]
    for number in range(len(links), 0, -1):
        link, ten = links[number - 1], composite[number]
        if link.joint >= 0:
            MX, MY, mass = ten[6], ten[7], ten[9]
            F: Vector = (0.0, 0.0, mass) if link.slides else (-MY, MX, 0.0)
            N: Vector = (MY, -MX, 0.0) if link.slides else (ten[2], ten[4], ten[5])
            for k in reversed(model.table.path(number)):
                at, i = links[k - 1], link.joint
                if at.joint >= 0:
                    M[i][at.joint] = M[at.joint][i] = M[i][at.joint] + (F if at.slides else N)[2]
                F, N = passed_on(at, F, N)
        before, moved = composite[link.antecedent], _moved_body(link, ten)
        composite[link.antecedent] = tuple(x + y for x, y in zip(before, moved, strict=True))
    return M


def _moved_body(link: Link, ten: Ten) -> Ten:
    """The ten parameters of a body in the axes and about the origin of the antecedent."""
    J, MS, mass = _shifted(ten[:6], ten[6:9], ten[9], (0.0, 0.0, link.r)), ten[6:9], ten[9]  # type: ignore[arg-type]
    MS = link.outward((MS[0], MS[1], MS[2] + mass * link.r))
    for axis, c, s in reversed(link.turns):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        ii, ij, jj = _PLACES[i][i], _PLACES[i][j], _PLACES[j][j]
        ik, jk = _PLACES[i][axis], _PLACES[j][axis]
        e = s * (J[ii] - J[jj]) + c * J[ij]
        t = s * (e + c * J[ij])
        J[ii], J[jj], J[ij] = J[ii] - t, J[jj] + t, c * e - s * (s * J[ij])
        J[ik], J[jk] = c * J[ik] - s * J[jk], s * J[ik] + c * J[jk]
    moved = plus(MS, tuple(mass * x for x in link.shift))  # type: ignore[arg-type]
    return (*_shifted(J, MS, mass, link.shift), *moved, mass)


def _shifted(J: Sequence[Number], MS: Vector, mass: Number, P: Vector) -> list[Number]:
    """Inertia matrix about a point from which the body's origin is at P."""
    # J + 2 (P.s) 1 - P s^T - s P^T with s = MS + mass P / 2
    s = plus(MS, tuple(0.5 * mass * x for x in P))  # type: ignore[arg-type]
    xx, yy, zz = (2.0 * (P[i] * s[i]) for i in range(3))
    xy, xz, yz = (P[i] * s[j] + s[i] * P[j] for i, j in ((0, 1), (0, 2), (1, 2)))
    change = yy + zz, -xy, -xz, xx + zz, -yz, xx + yy
    return [x + y for x, y in zip(J, change, strict=True)]


def solved(M: Sequence[Sequence[Number]], right: Sequence[Number]) -> list[Number]:
    """Solution of ``M x = right`` by ``M = L^T D L``, from the leaves of the tree to its root."""
    L, x = [list(row) for row in M], list(right)
    for k in range(len(L) - 1, -1, -1):
        factors = [y / L[k][k] if given(y) else 0.0 for y in L[k][:k]]
        for i, factor in enumerate(factors):
            L[i][: i + 1] = [y - factor * z for y, z in zip(L[i][: i + 1], L[k], strict=False)]
            x[i] = x[i] - factor * x[k]
        L[k][:k] = factors
    for k, row in enumerate(L):
        x[k] = (x[k] / row[k] if given(x[k]) else 0.0) - dot(row[:k], x[:k])
    return x

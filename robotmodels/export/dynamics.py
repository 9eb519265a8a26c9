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
from dataclasses import dataclass

import numpy as np

from ..inertia import PARAMETERS
from ..model import RobotModel
from .geometry import Frames, Link, constant_pose
from .tape import Number, Scalar, Vector, cross, function, plus, quotient, times

Parameters = Mapping[str, Number]
"""Standard parameters by their names; those that are missing are zero."""
Ten = tuple[Number, ...]
Wrench = tuple[Vector, Vector]

_ZERO: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Motion:
    """Angular velocity and acceleration of a link, acceleration of its origin, Khalil's ``U``."""

    w: Vector
    dw: Vector
    u: Vector
    U: tuple[Vector, Vector, Vector]


def ten_of(parameters: Parameters, number: int) -> Ten:
    """Inertial parameters of a link."""
    return tuple(parameters.get(f"{name}{number}", 0.0) for name in PARAMETERS)


def motions(
    frames: Frames, v: Sequence[Number], a: Sequence[Number], gravity: Vector
) -> dict[int, Motion]:
    """Motions of all links; the base is accelerated against gravity (base axes)."""
    at_rest = (_ZERO, _ZERO, _ZERO)
    out = {0: Motion(_ZERO, _ZERO, (-gravity[0], -gravity[1], -gravity[2]), at_rest)}
    for link in frames.links:
        of = out[link.parent]
        w, dw = link.inward(of.w), link.inward(of.dw)
        u = link.inward(plus(of.u, times(of.U, link.shift)))
        rate, change = (v[link.joint], a[link.joint]) if link.joint >= 0 else (0.0, 0.0)
        if not link.slides:
            dw = dw[0] + w[1] * rate, dw[1] - w[0] * rate, dw[2] + change
            w = w[0], w[1], w[2] + rate
        U = _rotation_acceleration(w, dw)
        u = plus(u, (U[0][2] * link.r, U[1][2] * link.r, U[2][2] * link.r))
        if link.slides:
            twice = 2.0 * rate
            u = u[0] + w[1] * twice, u[1] - w[0] * twice, u[2] + change
        out[link.number] = Motion(w, dw, u, U)
    return out


def _rotation_acceleration(w: Vector, dw: Vector) -> tuple[Vector, Vector, Vector]:
    """``U = [dw]x + [w]x [w]x``."""
    xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    return (
        (-(yy + zz), xy - dw[2], xz + dw[1]),
        (xy + dw[2], -(xx + zz), yz - dw[0]),
        (xz - dw[1], yz + dw[0], -(xx + yy)),
    )


def link_wrench(motion: Motion, ten: Ten) -> Wrench:
    """Force ``M u + U MS`` and moment ``J dw + w x J w + MS x u`` that accelerate a link."""
    XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M = ten
    w, dw, u, U = motion.w, motion.dw, motion.u, motion.U
    xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    MS = MX, MY, MZ
    F = plus(times(U, MS), (M * u[0], M * u[1], M * u[2]))
    N = (
        XX * dw[0] + (ZZ - YY) * (w[1] * w[2]) - XY * U[2][0] + XZ * U[1][0] + YZ * (yy - zz),
        YY * dw[1] + (XX - ZZ) * (w[0] * w[2]) + XY * U[2][1] - YZ * U[0][1] + XZ * (zz - xx),
        ZZ * dw[2] + (YY - XX) * (w[0] * w[1]) - XZ * U[1][2] + YZ * U[0][2] + XY * (xx - yy),
    )
    return F, plus(N, cross(MS, u))


def passed_on(link: Link, F: Vector, N: Vector) -> Wrench:
    """A wrench on a link as that on its parent."""
    N = N[0] - link.r * F[1], N[1] + link.r * F[0], N[2]
    F = link.outward(F)
    return F, plus(link.outward(N), cross(link.shift, F))


def joint_torques(frames: Frames, wrenches: Mapping[int, Wrench], n: int) -> list[Number]:
    """Torques that carry wrenches on the links."""
    total = dict(wrenches)
    tau: list[Number] = [0.0] * n
    for link in reversed(frames.links):
        if link.number not in total:
            continue
        F, N = total[link.number]
        if link.joint >= 0:
            tau[link.joint] = F[2] if link.slides else N[2]
        if link.parent > 0:
            F, N = passed_on(link, F, N)
            before = total.get(link.parent, (_ZERO, _ZERO))
            total[link.parent] = plus(before[0], F), plus(before[1], N)
    return tau


def tool_wrench(
    frames: Frames, number: int, point: Vector, wrench: Sequence[Number]
) -> dict[int, Wrench]:
    """Wrench of the tool on the environment (world axes, at a point of a link) on that link."""
    columns: tuple[Vector, ...] = tuple(zip(*frames.base[0], strict=True))  # type: ignore[arg-type]
    F, N = (times(columns, tuple(part)) for part in (wrench[:3], wrench[3:]))  # type: ignore[arg-type]
    for link in frames.path(number):
        F, N = link.inward(F), link.inward(N)
    return {number: (F, plus(N, cross(point, F)))} if number else {}


def drive_torques(
    model: RobotModel, parameters: Parameters, v: Sequence[Number], a: Sequence[Number]
) -> list[Number]:
    """Torques of rotors, friction and offsets, with those of coupled motors."""
    rows = (model.table.joint_rows + 1).tolist()
    tau: list[Number] = []
    for i, row in enumerate(rows):
        Ia, Fv, Fc, offset = (
            parameters.get(f"{c}{row}", 0.0) for c in ("Ia", "Fv", "Fc", "offset")
        )
        tau.append(Ia * a[i] + Fv * v[i] + Fc * function("sign", v[i]) + offset)
    transmission = model.transmission
    for m in () if transmission is None else transmission.coupled_motors:
        w = transmission.weights[m - 1].tolist()  # type: ignore[union-attr]
        Iam, Fvm, Fcm = (parameters.get(f"{c}{rows[m - 1]}", 0.0) for c in ("Iam", "Fvm", "Fcm"))
        rate, change = (sum((w[k] * x[k] for k in range(model.n)), 0.0) for x in (v, a))
        for j in np.flatnonzero(w).tolist():
            rest = Iam * (change - w[j] * a[j]) + Fvm * (rate - w[j] * v[j])
            tau[j] = tau[j] + w[j] * (rest + Fcm * function("sign", rate))
    return tau


def inverse_dynamics(
    model: RobotModel,
    frames: Frames,
    parameters: Parameters,
    v: Sequence[Number],
    a: Sequence[Number],
    tool: Mapping[int, Wrench],
) -> list[Number]:
    """Joint torques of a motion, drives and the wrench of the tool included."""
    moved = motions(frames, v, a, gravity_of(model))
    wrenches = {
        link.number: link_wrench(moved[link.number], ten_of(parameters, link.number))
        for link in frames.links
    }
    for number, (F, N) in tool.items():
        own = wrenches[number]
        wrenches[number] = plus(own[0], F), plus(own[1], N)
    rigid = joint_torques(frames, wrenches, model.n)
    drives = drive_torques(model, parameters, v, a)
    return [x + y for x, y in zip(rigid, drives, strict=True)]


def gravity_of(model: RobotModel) -> Vector:
    """Acceleration of gravity in base axes."""
    g = model.gravity @ np.array(constant_pose(model.base)[0])
    g[np.abs(g) < 1e-15 * np.abs(g).max(initial=0.0)] = 0.0
    return float(g[0]), float(g[1]), float(g[2])


def regressor(
    model: RobotModel, frames: Frames, names: Sequence[str],
    v: Sequence[Number], a: Sequence[Number],
) -> list[list[Number]]:  # fmt: skip
    """Torques per unit of each named parameter, columns of the regressor."""
    moved = motions(frames, v, a, gravity_of(model))
    columns = []
    for name in names:
        unit = {name: 1.0}
        wrenches = {}
        for link in frames.links:
            ten = ten_of(unit, link.number)
            if any(ten):
                wrenches[link.number] = link_wrench(moved[link.number], ten)
        rigid = joint_torques(frames, wrenches, model.n)
        drives = drive_torques(model, unit, v, a)
        columns.append([x + y for x, y in zip(rigid, drives, strict=True)])
    return columns


def mass_matrix(model: RobotModel, frames: Frames, parameters: Parameters) -> list[list[Number]]:
    """Joint-space inertia matrix by composite bodies, with rotors."""
    n = model.n
    composite = {link.number: ten_of(parameters, link.number) for link in frames.links}
    M: list[list[Number]] = [[0.0] * n for _ in range(n)]
    of = {link.number: link for link in frames.links}
    for link in reversed(frames.links):
        ten = composite[link.number]
        if link.joint >= 0:
            MX, MY, MZ, mass = ten[6:]
            F: Vector = (0.0, 0.0, mass) if link.slides else (-MY, MX, 0.0)
            N: Vector = (MY, -MX, 0.0) if link.slides else (ten[2], ten[4], ten[5])
            at = link
            while True:
                if at.joint >= 0:
                    M[link.joint][at.joint] = M[at.joint][link.joint] = F[2] if at.slides else N[2]
                if at.parent == 0:
                    break
                F, N = passed_on(at, F, N)
                at = of[at.parent]
        if link.parent > 0:
            moved = _moved_body(link, ten)
            composite[link.parent] = tuple(
                x + y for x, y in zip(composite[link.parent], moved, strict=True)
            )
    zero = [0.0] * n
    for j in range(n):
        unit = [float(k == j) for k in range(n)]
        rotors = {k: x for k, x in parameters.items() if k.startswith("Ia")}
        for i, x in enumerate(drive_torques(model, rotors, zero, unit)):
            M[i][j] = M[i][j] + x
    return M


def _moved_body(link: Link, ten: Ten) -> Ten:
    """The ten parameters of a body in the axes and about the origin of the parent."""
    XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, mass = ten
    ten = _shifted((XX, XY, XZ, YY, YZ, ZZ), (MX, MY, MZ), mass, (0.0, 0.0, link.r))
    J, MS = list(ten[:6]), tuple(ten[6:9])
    for axis, c, s in reversed(link.turns):
        J = _turned_inertia(J, axis, c, s)
    MS = link.outward(MS)  # type: ignore[arg-type]
    return _shifted(tuple(J), MS, mass, link.shift)


def _shifted(J: Ten, MS: Vector, mass: Number, P: Vector) -> Ten:
    """Parameters about a point from which the body's origin is at P."""
    moved = MS[0] + mass * P[0], MS[1] + mass * P[1], MS[2] + mass * P[2]
    # J + 2 (P.s) 1 - P s^T - s P^T with s = MS + mass P / 2, by the sum of both first moments
    s = plus(MS, (0.5 * mass * P[0], 0.5 * mass * P[1], 0.5 * mass * P[2]))
    xx, yy, zz = 2.0 * (P[0] * s[0]), 2.0 * (P[1] * s[1]), 2.0 * (P[2] * s[2])
    return (
        J[0] + (yy + zz),
        J[1] - (P[0] * s[1] + s[0] * P[1]),
        J[2] - (P[0] * s[2] + s[0] * P[2]),
        J[3] + (xx + zz),
        J[4] - (P[1] * s[2] + s[1] * P[2]),
        J[5] + (xx + yy),
        *moved,
        mass,
    )


_PLACES = ((0, 1, 2), (1, 3, 4), (2, 4, 5))  # of the elements of a symmetric matrix


def _turned_inertia(J: Sequence[Number], axis: int, c: Number, s: Number) -> list[Number]:
    """Inertia matrix turned about a coordinate axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    ii, ij, jj = _PLACES[i][i], _PLACES[i][j], _PLACES[j][j]
    e = s * (J[ii] - J[jj]) + c * J[ij]
    t = s * (e + c * J[ij])
    out = list(J)
    out[ii], out[jj], out[ij] = J[ii] - t, J[jj] + t, c * e - s * (s * J[ij])
    ik, jk = _PLACES[i][axis], _PLACES[j][axis]
    out[ik], out[jk] = c * J[ik] - s * J[jk], s * J[ik] + c * J[jk]
    return out


def solved(M: Sequence[Sequence[Number]], right: Sequence[Number]) -> list[Number]:
    """Solution of ``M x = right`` by ``M = L^T D L``, from the leaves of the tree to its root."""
    n = len(M)
    L, x = [list(row) for row in M], list(right)
    for k in range(n - 1, -1, -1):
        factors = [quotient(L[k][i], L[k][k]) if _given(L[k][i]) else 0.0 for i in range(k)]
        for i, factor in enumerate(factors):
            for j in range(i + 1):
                L[i][j] = L[i][j] - factor * L[k][j]
            x[i] = x[i] - factor * x[k]
        L[k][:k] = factors
    for k in range(n):
        y = quotient(x[k], L[k][k])
        for i in range(k):
            y = y - L[k][i] * x[i]
        x[k] = y
    return x


def _given(x: Number) -> bool:
    return isinstance(x, Scalar) or x != 0.0

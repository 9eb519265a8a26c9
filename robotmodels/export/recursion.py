"""Recursions over a robot on a tape: Khalil's customised method of Newton and Euler, written once.

A vector changes frames by planar rotations, and the place of a frame is split into a shift before
its rotations and a part ``r`` along its own axis: both leave out products with zeros. Everything
is linear in the standard parameters, which are constants, inputs or units: torques, regressors (a
unit parameter at a time) and mass matrices come from the same recursions.

References
----------
Book sections 1.2, 1.5.1 and 1.5.2; W. Khalil and J.-F. Kleinfinger, "Minimum operations and
minimum parameters of the dynamic models of tree structure robots", IEEE Journal of Robotics and
Automation 3(6), 1987.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..geometry import PRISMATIC, REVOLUTE
from ..inertia import PARAMETERS
from ..model import RobotModel
from ..symbolic.angles import exact_turns
from .tape import Number, Scalar, function

Constant = Callable[[str, int], Number]
"""Value of a geometric parameter: column and number of the row."""
Parameters = Mapping[str, Number]
"""Standard parameters by their names; those that are missing are zero."""
Vector = NDArray[np.object_]
"""Numbers and scalars; matrices as well."""
Wrench = tuple[Vector, Vector]
"""Force and moment."""

COLUMNS = ("gamma", "b", "beta", "alpha", "d", "theta", "r")
DRIVE_TERMS = ("Ia", "Fv", "Fc", "offset")
_SINES = (0.0, 0.5, sqrt(0.5), sqrt(0.75), 1.0)  # of multiples of 30 and 45 degrees
_PLACES = ((0, 1, 2), (1, 3, 4), (2, 4, 5))  # of the elements of an inertia matrix


@dataclass(frozen=True, slots=True)
class Link:
    """Frame in its antecedent: the shift, the turns, then ``r`` along its own z axis."""

    antecedent: int
    joint: int  # column of q, -1 if it does not move
    slides: bool
    shift: Vector  # in the axes of the antecedent
    turns: tuple[tuple[int, Number, Number], ...]  # axis (0 x, 1 y, 2 z), cosine, sine
    r: Number
    lift: Number = 0.0  # place along the axis of a link without successors, if it is not r

    def inward(self, a: Vector) -> Vector:
        """Vector of the antecedent's axes, or columns of a matrix, in those of the link."""
        for axis, c, s in self.turns:
            a = _turned(a, axis, c, -s)
        return a

    def outward(self, a: Vector) -> Vector:
        """Vector of the link's axes in those of the antecedent."""
        for axis, c, s in reversed(self.turns):
            a = _turned(a, axis, c, s)
        return a


def vector(*x: Number) -> Vector:
    """An array of numbers and scalars."""
    return np.array(x, dtype=object)


def cross(x: Vector, y: Vector) -> Vector:
    """Vector product."""
    return vector(*(x[i] * y[j] - x[j] * y[i] for i, j in ((1, 2), (2, 0), (0, 1))))


def _turned(a: Vector, axis: int, c: Number, s: Number) -> Vector:
    i, j, out = (axis + 1) % 3, (axis + 2) % 3, a.copy()
    out[i], out[j] = a[i] * c - a[j] * s, a[i] * s + a[j] * c
    return out


def _cosine_sine(angle: Number, offset: Number = 0.0) -> tuple[Number, Number]:
    """Cosine and sine of the sum of a variable and a constant angle, exact for fractions of pi."""
    if isinstance(offset, Scalar):
        angle, offset = angle + offset, 0.0
    if isinstance(angle, Scalar):
        turns = exact_turns(offset)
        if turns is None or (2 * turns).denominator > 1:
            return function("cos", angle + offset), function("sin", angle + offset)
        c, s = function("cos", angle), function("sin", angle)
        return ((c, s), (-s, c), (-c, -s), (s, -c))[int(2 * turns) % 4]
    pair = cos(angle + offset), sin(angle + offset)
    if exact_turns(angle + offset) is None:
        return pair
    c, s = (min(_SINES, key=lambda size: abs(abs(x) - size)) for x in pair)
    return (c if pair[0] > 0.0 else -c), (s if pair[1] > 0.0 else -s)


def links_of(
    model: RobotModel, q: Sequence[Number], constant: Constant, is_lowered: bool = True
) -> list[Link]:
    """The frames of a robot in the order of its table.

    Lowered, links without successors are moved along their axes: no motion depends on their ``r``.
    """
    table, links = model.table, []
    inner = {*table.antecedent.tolist()}
    for k, (sigma, j) in enumerate(zip(table.sigma, model.chain.joint.tolist(), strict=True)):
        gamma, b, beta, alpha, d, theta, r = (constant(c, k + 1) for c in COLUMNS)
        before = [(axis, *_cosine_sine(x)) for axis, x in ((2, gamma), (1, beta), (0, alpha))]
        # d lies along the axis x that gamma and beta turn; alpha does not turn it
        shift = _turned(_turned(vector(d, 0.0, 0.0), *before[1]) + vector(0.0, 0.0, b), *before[0])
        last = _cosine_sine(q[j] if sigma == REVOLUTE else 0.0, theta)
        r, lift = (q[j] + r if sigma == PRISMATIC else r), 0.0
        if is_lowered and sigma != PRISMATIC and k + 1 not in inner:
            r, lift = lift, r
        turns = tuple(turn for turn in (*before, (2, *last)) if turn[1:] != (1.0, 0.0))
        slides = bool(sigma == PRISMATIC)
        links.append(Link(int(table.antecedent[k]), j, slides, shift, turns, r, lift))
    return links


def poses(model: RobotModel, links: Sequence[Link]) -> list[tuple[Vector, Vector]]:
    """World poses of frames 0 to f: rotations and positions."""
    out = [_constant_pose(model.base)]
    for link in links:
        R, p = out[link.antecedent]
        p, R = p + R @ link.shift, link.inward(R.T).T
        out.append((R, p + R[:, 2] * link.r))
    return out


def point_of(model: RobotModel, frame: str | int | None) -> tuple[int, Vector, Vector]:
    """Number of the table's frame that carries a frame, and the constant pose in it."""
    point, T = model.twin.frame(frame), np.eye(4)
    T[:3, :3], T[:3, 3] = point.rotation, point.position
    return point.parent, *_constant_pose(T)


def jacobian(model: RobotModel, links: Sequence[Link], number: int, point: Vector) -> Vector:
    """World-aligned Jacobian of a point of a frame."""
    places, J = poses(model, links), np.full((6, model.n), 0.0, dtype=object)
    tip = places[number][1] + places[number][0] @ point
    for k in model.table.path(number):
        j, (R, p) = links[k - 1].joint, places[k]
        if j >= 0 and links[k - 1].slides:
            J[:3, j] = R[:, 2]
        elif j >= 0:
            J[:3, j], J[3:, j] = cross(R[:, 2], tip - p), R[:, 2]
    return J


def _constant_pose(T: Array) -> tuple[Vector, Vector]:
    """A constant pose, its rotation exact where it is 0 or +-1 to rounding."""
    R, near = T[:3, :3], np.round(T[:3, :3])
    return np.where(np.abs(R - near) < 1e-15, near + 0.0, R).astype(object), T[:3, 3].astype(object)


def motions(
    model: RobotModel, links: Sequence[Link], v: Sequence[Number], a: Sequence[Number]
) -> list[tuple[Vector, ...]]:
    """Angular velocity and acceleration, acceleration of the origin, Khalil's ``U`` of all links.

    The base is accelerated against gravity.
    """
    g = -model.gravity @ _constant_pose(model.base)[0].astype(float)
    g[np.abs(g) < 1e-15 * np.abs(g).max(initial=0.0)] = 0.0
    zero = np.full((3, 3), 0.0, dtype=object)
    out: list[tuple[Vector, ...]] = [(zero[0], zero[0], g.astype(object), zero)]
    for link in links:
        w, dw, u, U = out[link.antecedent]
        w, dw, u = link.inward(w), link.inward(dw), link.inward(u + U @ link.shift)
        rate, change = (v[link.joint], a[link.joint]) if link.joint >= 0 else (0.0, 0.0)
        if not link.slides:
            dw, w = dw + vector(w[1] * rate, -w[0] * rate, change), w + vector(0.0, 0.0, rate)
        xx, yy, zz = w * w
        xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
        U = np.array((
            (-(yy + zz), xy - dw[2], xz + dw[1]),
            (xy + dw[2], -(xx + zz), yz - dw[0]),
            (xz - dw[1], yz + dw[0], -(xx + yy)),
        ), dtype=object)  # fmt: skip
        u = u + U[:, 2] * link.r
        if link.slides:
            u = u + vector(w[1] * (2.0 * rate), -w[0] * (2.0 * rate), change)
        out.append((w, dw, u, U))
    return out


def inverse_dynamics(
    model: RobotModel, links: Sequence[Link], moved: Sequence[tuple[Vector, ...]],
    parameters: Parameters, v: Sequence[Number], a: Sequence[Number], tool: Mapping[int, Wrench],
) -> Vector:  # fmt: skip
    """Joint torques of a motion, drives and the wrench of the tool included."""
    total, tau = dict(tool), torques_of_drives(model, parameters, v, a)
    zero = (vector(0.0, 0.0, 0.0),) * 2
    for number in range(len(links), 0, -1):
        link, ten = links[number - 1], _ten(parameters, number, links[number - 1])
        F, N = total.get(number, zero)
        if any(map(given, ten)):
            (w, dw, u, U), MS, M = moved[number], vector(*ten[6:9]), ten[9]
            XX, XY, XZ, YY, YZ, ZZ = ten[:6]
            xx, yy, zz = w * w
            F = F + (U @ MS + u * M)
            N = N + cross(MS, u) + (
                XX * dw[0] + (ZZ - YY) * (w[1] * w[2]) - XY * U[2, 0] + XZ * U[1, 0]
                + YZ * (yy - zz),
                YY * dw[1] + (XX - ZZ) * (w[0] * w[2]) + XY * U[2, 1] - YZ * U[0, 1]
                + XZ * (zz - xx),
                ZZ * dw[2] + (YY - XX) * (w[0] * w[1]) - XZ * U[1, 2] + YZ * U[0, 2]
                + XY * (xx - yy),
            )  # fmt: skip
        elif number not in total:
            continue
        if link.joint >= 0:
            tau[link.joint] = (F if link.slides else N)[2] + tau[link.joint]
        passed, before = passed_on(link, F, N), total.get(link.antecedent, zero)
        total[link.antecedent] = before[0] + passed[0], before[1] + passed[1]
    return tau


def passed_on(link: Link, F: Vector, N: Vector) -> Wrench:
    """A wrench on a link as that on its antecedent."""
    N = N + vector(-(link.r * F[1]), link.r * F[0], 0.0)
    F = link.outward(F)
    return F, link.outward(N) + cross(link.shift, F)


def tool_wrench(model: RobotModel, links: Sequence[Link], wrench: Vector) -> dict[int, Wrench]:
    """Wrench of the tool on the environment (world axes) as one on the link that carries it."""
    number, _, point = point_of(model, None)
    FN = wrench.reshape(2, 3) @ _constant_pose(model.base)[0]
    for k in model.table.path(number):
        FN = links[k - 1].inward(FN.T).T
        point = point + vector(0.0, 0.0, links[k - 1].lift)  # not zero for the last one alone
    return {number: (FN[0], FN[1] + cross(point, FN[0]))}


def torques_of_drives(
    model: RobotModel, parameters: Parameters, v: Sequence[Number], a: Sequence[Number]
) -> Vector:
    """Torques of rotors, friction and offsets, with those of coupled motors."""
    rows, K = (model.table.joint_rows + 1).tolist(), model.transmission
    tau = vector(*(0.0,) * model.n)
    for j, (row, rate, change) in enumerate(zip(rows, v, a, strict=True)):
        Ia, Fv, Fc, offset = (parameters.get(f"{c}{row}", 0.0) for c in DRIVE_TERMS)
        tau[j] = Ia * change + Fv * rate + Fc * function("sign", rate) + offset
    for m in () if K is None else K.coupled_motors:
        w = K.weights[m - 1].astype(object)  # type: ignore[union-attr]
        Iam, Fvm, Fcm = (parameters.get(f"{c}m{rows[m - 1]}", 0.0) for c in DRIVE_TERMS[:3])
        rate, change = w @ vector(*v), w @ vector(*a)
        for j in np.flatnonzero(w).tolist():
            rest = Iam * (change - w[j] * a[j]) + Fvm * (rate - w[j] * v[j])
            tau[j] = tau[j] + w[j] * (rest + Fcm * function("sign", rate))
    return tau


def given(x: Number) -> bool:
    """Whether a number is not zero."""
    return isinstance(x, Scalar) or x != 0.0


def mass_matrix(model: RobotModel, links: Sequence[Link], parameters: Parameters) -> Vector:
    """Joint-space inertia matrix by composite bodies, with rotors."""
    zero, rotors = [0.0] * model.n, {k: x for k, x in parameters.items() if k.startswith("Ia")}
    units = np.eye(model.n).tolist()
    rows = [torques_of_drives(model, rotors, zero, unit) for unit in units]
    M = np.array(rows, dtype=object).reshape(model.n, model.n)
    composite = [vector(*(0.0,) * 10)]
    composite += [_ten(parameters, k, link) for k, link in enumerate(links, start=1)]
    for number in range(len(links), 0, -1):
        link, ten = links[number - 1], composite[number]
        if link.joint >= 0:
            MX, MY, mass = ten[6], ten[7], ten[9]
            F = vector(0.0, 0.0, mass) if link.slides else vector(-MY, MX, 0.0)
            N = vector(MY, -MX, 0.0) if link.slides else ten[[2, 4, 5]]
            for k in reversed(model.table.path(number)):
                at, i = links[k - 1], link.joint
                if at.joint >= 0:
                    M[i, at.joint] = M[at.joint, i] = M[i, at.joint] + (F if at.slides else N)[2]
                F, N = passed_on(at, F, N)
        composite[link.antecedent] = composite[link.antecedent] + _moved_body(link, ten)
    return M


def _ten(parameters: Parameters, number: int, link: Link) -> Vector:
    """Inertial parameters of a link about its origin, lifted or not."""
    ten = vector(*(parameters.get(f"{name}{number}", 0.0) for name in PARAMETERS))
    return _shifted(ten, vector(0.0, 0.0, link.lift))


def _moved_body(link: Link, ten: Vector) -> Vector:
    """The ten parameters of a body in the axes and about the origin of the antecedent."""
    ten = _shifted(ten, vector(0.0, 0.0, link.r))
    J = ten[:6]
    for axis, c, s in reversed(link.turns):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        ii, ij, jj = _PLACES[i][i], _PLACES[i][j], _PLACES[j][j]
        ik, jk = _PLACES[i][axis], _PLACES[j][axis]
        e = s * (J[ii] - J[jj]) + c * J[ij]
        t = s * (e + c * J[ij])
        J[ii], J[jj], J[ij] = J[ii] - t, J[jj] + t, c * e - s * (s * J[ij])
        J[ik], J[jk] = c * J[ik] - s * J[jk], s * J[ik] + c * J[jk]
    return _shifted(vector(*J, *link.outward(ten[6:9]), ten[9]), link.shift)


def _shifted(ten: Vector, P: Vector) -> Vector:
    """The ten parameters of a body about a point from which its origin is at P."""
    # J + 2 (P.s) 1 - P s^T - s P^T with s = MS + mass P / 2
    MS, mass = ten[6:9], ten[9]
    s = MS + P * (0.5 * mass)
    xx, yy, zz = P * s * 2.0
    xy, xz, yz = (P[i] * s[j] + s[i] * P[j] for i, j in ((0, 1), (0, 2), (1, 2)))
    change = vector(yy + zz, -xy, -xz, xx + zz, -yz, xx + yy)
    return vector(*(ten[:6] + change), *(MS + P * mass), mass)


def solved(M: Vector, right: Vector) -> Vector:
    """Solution of ``M x = right`` by ``M = L^T D L``, from the leaves of the tree to its root."""
    L, x = M.copy(), right.copy()
    for k in range(len(L) - 1, -1, -1):
        factors = vector(*(y / L[k, k] if given(y) else 0.0 for y in L[k, :k]))
        for i, factor in enumerate(factors):
            L[i, : i + 1] = L[i, : i + 1] - L[k, : i + 1] * factor
            x[i] = x[i] - factor * x[k]
        L[k, :k] = factors
    for k, row in enumerate(L):
        x[k] = (x[k] / row[k] if given(x[k]) else 0.0) - (row[:k] @ x[:k] if k else 0.0)
    return x

"""A sampled controller and the robot that it moves, by Runge-Kutta steps of fixed length.

The direct model is that of `mass.joint_accelerations`; nothing divides by a mass, so links may be
those of base parameters, and only the mass matrix has to be positive definite.
"""

from math import isfinite

import numpy as np

from . import Chain
from ._compile import CHAIN, INT, MATRIX, OUT2, VECTOR, Floats, compiled
from .mass import POSITIVE, mass_of_sample, solve_in_place
from .torques import torque_room, torques_of_sample

__all__ = ["follow_references"]


@compiled()
def direction(v: float, width: float) -> float:
    """Direction of dry friction: linear over the width on either side of rest, then its sign."""
    if v > width:
        return 1.0
    if v < -width:
        return -1.0
    if width == 0.0:
        return 0.0
    return v / width


@compiled()
def drive_torque(
    v: Floats,
    viscous: Floats,
    coulomb: Floats,
    offset: Floats,
    coupling: Floats,
    coupled: Floats,
    width: Floats,
    coupled_width: Floats,
    out: Floats,
) -> None:
    """Torques that friction and offsets of the drives take up at the velocities v (1, n)."""
    n = v.shape[1]
    for j in range(n):
        tau = offset[j] + coulomb[j] * direction(v[0, j], width[j])
        for k in range(n):
            tau += viscous[j, k] * v[0, k]
        out[0, j] = tau
    for m in range(coupling.shape[0]):
        speed = 0.0
        for k in range(n):
            speed += coupling[m, k] * v[0, k]
        tau = coupled[m] * direction(speed, coupled_width[m])
        for j in range(n):
            out[0, j] += coupling[m, j] * tau


@compiled(
    INT(
        MATRIX, MATRIX, MATRIX, MATRIX, VECTOR, INT, INT, MATRIX.dtype, CHAIN, MATRIX, VECTOR,
        MATRIX, MATRIX, MATRIX, MATRIX, VECTOR, OUT2, OUT2, OUT2, OUT2, OUT2,
    )
)  # fmt: skip
def follow_references(
    q_ref: Floats,
    v_ref: Floats,
    feed: Floats,
    gains: Floats,
    astray: Floats,
    hold: int,
    substeps: int,
    dt: float,
    chain: Chain,
    pi: Floats,
    gravity: Floats,
    rotor: Floats,
    viscous: Floats,
    drives: Floats,
    coupling: Floats,
    coupled: Floats,
    state: Floats,
    q: Floats,
    v: Floats,
    a: Floats,
    tau: Floats,
) -> int:
    """Follow references from a state on, and write what a log has of it.

    Shapes: q_ref, v_ref, feed (N + 1, n); gains (4, n); pi (f, 10); rotor, viscous (n, n); drives
    (3, n); coupling (k, n); coupled (2,) or (2 k,); state (5, n) -> q, v, a, tau (N, n).
    """
    N, n = q.shape
    f = chain.antecedent.shape[0]
    motors = coupling.shape[0]
    step = dt / substeps
    room = torque_room(chain, gravity)
    composite, M = np.empty((f, 10)), np.empty((1, n, n))
    sizes = np.empty(n)
    diagonal = np.empty(n)
    x = np.empty((1, n))
    y = np.empty((1, n))
    h = np.empty((1, n))
    rest = np.zeros((1, n))
    taken = np.empty((1, n))
    slopes = np.empty((2, 4, n))
    ticks = int(state[4, 0])
    for i in range(N):
        for part in range(substeps):
            if ticks % hold == 0:
                share = part / substeps
                for j in range(n):
                    e = q_ref[i, j] + share * (q_ref[i + 1, j] - q_ref[i, j]) - state[0, j]
                    de = v_ref[i, j] + share * (v_ref[i + 1, j] - v_ref[i, j]) - state[1, j]
                    ahead = feed[i, j] + share * (feed[i + 1, j] - feed[i, j])
                    asked = gains[0, j] * e + gains[1, j] * de + gains[2, j] * state[2, j] + ahead
                    most = gains[3, j]
                    state[3, j] = min(max(asked, -most), most)
                    if abs(asked) <= most:  # no wind-up
                        state[2, j] += hold * step * e
            ticks += 1
            for stage in range(4):
                ahead = 0.0 if stage == 0 else (step if stage == 3 else 0.5 * step)
                before = max(stage - 1, 0)
                for j in range(n):
                    x[0, j] = state[0, j]
                    y[0, j] = state[1, j]
                    if stage > 0:
                        x[0, j] += ahead * slopes[0, before, j]
                        y[0, j] += ahead * slopes[1, before, j]
                torques_of_sample(x, y, rest, 0, chain, pi, room, h)
                mass_of_sample(chain, pi, room[0], room[1], composite, M, 0)
                drive_torque(
                    y, viscous, drives[0], drives[1], coupling, coupled[:motors], drives[2],
                    coupled[motors:], taken,
                )  # fmt: skip
                for row in range(n):
                    h[0, row] = state[3, row] - h[0, row] - taken[0, row]
                    for column in range(n):
                        M[0, row, column] += rotor[row, column]
                if solve_in_place(M[0], h[0], sizes, diagonal) != POSITIVE:
                    return i
                for j in range(n):
                    slopes[0, stage, j] = y[0, j]
                    slopes[1, stage, j] = h[0, j]
                if stage == 0 and part == 0:
                    for j in range(n):
                        q[i, j] = state[0, j]
                        v[i, j] = state[1, j]
                        a[i, j] = h[0, j]
                        tau[i, j] = state[3, j]
            for j in range(n):
                for s in range(2):
                    middle = slopes[s, 1, j] + slopes[s, 2, j]
                    state[s, j] += step / 6.0 * (slopes[s, 0, j] + 2.0 * middle + slopes[s, 3, j])
        for j in range(n):
            if not isfinite(state[1, j]) or not abs(state[0, j] - q_ref[i + 1, j]) < astray[j]:
                return i
    state[4, 0] = ticks
    return -1

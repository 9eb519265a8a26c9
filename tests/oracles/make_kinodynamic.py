"""How `kinodynamic.json` was made, outside of the package: a planar 2R in formulas of its own.

    python make_kinodynamic.py            # needs toppra 0.6.10 and casadi 3.8 with IPOPT

Durations along paths: TOPP-RA of toppra on the same grid, torques limited at its points
(``collocation``). Free minimum times: direct multiple shooting, 200 intervals of constant torque,
Runge-Kutta of order 4, IPOPT from several starts, the least of them.
"""

import json
import logging

import casadi as ca
import numpy as np
import toppra as ta
from toppra import algorithm, constraint

M1, M2, C1, C2, I1, I2, L1 = 5, 3, 0.5, 0.5, 0.42, 0.25, 1.0
VIA = [[0, 0], [0.5, 1.0], [1.0, 0.5]]
FREE = {
    "A": ([0, 0], [1, 0.5], [120, 40], 9.81),
    "B": ([0, 0], [1.5, 0.5], [60, 20], 0.0),
    "C": ([-1.2, 0.3], [1.0, -0.8], [90, 40], 9.81),
    "D": ([0, 0], [1.57, -1.57], [30, 10], 0.0),
}


def terms(q, g, cos, sin):
    """Entries of the mass matrix, the Coriolis factor and the torques of gravity."""
    c = cos(q[1])
    m11 = I1 + I2 + M1 * C1**2 + M2 * (L1**2 + C2**2 + 2 * L1 * C2 * c)
    m12, m22 = I2 + M2 * (C2**2 + L1 * C2 * c), I2 + M2 * C2**2
    far = g * M2 * C2 * cos(q[0] + q[1])
    near = g * (M1 * C1 + M2 * L1) * cos(q[0])
    return m11, m12, m22, M2 * L1 * C2 * sin(q[1]), near + far, far


def torque(q, v, a, g):
    m11, m12, m22, h, g1, g2 = terms(q, g, np.cos, np.sin)
    return np.array([
        m11 * a[0] + m12 * a[1] - h * (2 * v[0] * v[1] + v[1] ** 2) + g1,
        m12 * a[0] + m22 * a[1] + h * v[0] ** 2 + g2,
    ])  # fmt: skip


def along(path, g, points, limit=(120.0, 40.0)):
    limit = np.array(limit)
    rows = constraint.JointTorqueConstraint(
        lambda q, v, a: torque(q, v, a, g), np.stack((-limit, limit), axis=1), [0, 0]
    )
    grid = np.linspace(0, path.duration, points + 1)
    solver = algorithm.TOPPRA([rows], path, gridpoints=grid, solver_wrapper="seidel")
    return solver.compute_trajectory(0, 0).duration


def slope(x, u, g):
    m11, m12, m22, h, g1, g2 = terms(x, g, ca.cos, ca.sin)
    b1 = u[0] + h * (2 * x[2] * x[3] + x[3] ** 2) - g1
    b2 = u[1] - h * x[2] ** 2 - g2
    d = m11 * m22 - m12**2
    return ca.vertcat(x[2], x[3], (m22 * b1 - m12 * b2) / d, (m11 * b2 - m12 * b1) / d)


def free(q0, q1, limit, g, N=200, starts=3):
    best = np.inf
    for seed in range(starts):
        problem = ca.Opti()
        X, U, T = problem.variable(4, N + 1), problem.variable(2, N), problem.variable()
        h = T / N
        for k in range(N):
            x, u = X[:, k], U[:, k]
            k1 = slope(x, u, g)
            k2 = slope(x + h / 2 * k1, u, g)
            k3 = slope(x + h / 2 * k2, u, g)
            k4 = slope(x + h * k3, u, g)
            problem.subject_to(X[:, k + 1] == x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
        for j in range(2):
            problem.subject_to(problem.bounded(-limit[j], U[j, :], limit[j]))
        problem.subject_to(X[:, 0] == np.r_[q0, 0, 0])
        problem.subject_to(X[:, N] == np.r_[q1, 0, 0])
        problem.subject_to(problem.bounded(0.05, T, 10))
        problem.minimize(T)
        s = np.linspace(0, 1, N + 1)
        bump = np.random.default_rng(seed).normal(0, 0.7, 2) * (seed > 0)
        q = np.outer(1 - s, q0) + np.outer(s, q1) + np.outer(np.sin(np.pi * s), bump)
        problem.set_initial(X, np.c_[q, np.gradient(q, s, axis=0)].T)
        problem.set_initial(T, 1.0)
        problem.solver("ipopt", {"print_time": 0}, {"print_level": 0, "max_iter": 600})
        best = min(best, float(problem.solve().value(T)))
    return best


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    paths = {
        "spline": ta.SplineInterpolator([0, 1, 2.0], VIA, bc_type="natural"),
        "not_a_knot": ta.SplineInterpolator([0, 1, 2, 3.0], [*VIA, [0.2, 0.1]]),
        "line": ta.SplineInterpolator([0, 1.0], [[0, 0], [1, 0.5]]),
    }
    found = {
        "source": "toppra 0.6.10, casadi 3.8.2 with IPOPT; make_kinodynamic.py",
        "along": [
            {"path": name, "gravity": g, "points": N, "duration": along(path, g, N)}
            for name, path in paths.items()
            for g in (9.81, 0.0)
            for N in (60, 200)
        ],
        "free": {name: free(*case) for name, case in FREE.items()},
    }
    print(json.dumps(found, indent=1))

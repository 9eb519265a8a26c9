"""Limits of jerk and of the rates of torques along a path, by sequential linear programming.

The rate of a torque is not convex in the squared rates x of the path parameter. From the quickest
motion without such limits, linear programs change x within a bound until the rates are kept, and
then as long as the motion becomes quicker: the result is a local optimum.
"""

from __future__ import annotations

from itertools import product
from typing import Any, cast

import numpy as np

from .._arrays import Array
from .path_limits import PathLimits, Rows
from .piecewise import PiecewisePolynomial
from .splines import cubic_spline

_FIRST, _LEAST = 0.3, 1e-4  # of x: bounds of a step
_STEPS = 80
_ENOUGH = 1e-5  # relative gain that ends the search
_KEPT = 0.01  # of a limit of rates: a greater excess of the smooth law is made smaller
_TRIES = 6


def rate_limited(
    problem: PathLimits, s: Array, q: Array, rate: Array, rows: Rows, x: Array
) -> tuple[Array, PiecewisePolynomial] | None:
    """Squared rates (N + 1,) and a law that keep limits and rates, or None if none was found."""
    share = 1.0
    for _ in range(_TRIES):
        found = _improved(problem, s, q, rate, rows, x, share * problem.rates)
        if found is None:
            return None
        x = found
        ends = np.sqrt(x[[0, -1]])
        h = 2.0 * np.diff(s) / (np.sqrt(x[1:]) + np.sqrt(x[:-1]))
        times = np.concatenate(((0.0,), np.cumsum(h)))
        # the same times at the points of the grid, and a continuous acceleration
        law = cast("PiecewisePolynomial", cubic_spline(s, times, v0=ends[0], v1=ends[1]).motion)
        here = problem.tangent(rows, x, q, rate)
        _, v, u = law.derivatives(times, (0, 1, 2))
        w = here.a * u + here.b * v * v + here.c
        over = float((np.abs(np.diff(w, axis=0)) / h[:, None] / problem.rates).max())
        if over <= 1.0 + _KEPT:
            break
        share /= over
    return x, law


def _improved(
    problem: PathLimits, s: Array, q: Array, rate: Array, rows: Rows, x: Array, rates: Array
) -> Array | None:
    """Squared rates (N + 1,) that are a local optimum, or None where a limit is not kept."""
    from scipy.optimize import linprog

    radius, moving = _FIRST, np.diff(s)
    now = _Program(problem, moving, problem.tangent(rows, x, q, rate), x, rates)
    for _ in range(_STEPS):
        if radius < _LEAST:
            break
        gain, A, room = now.program()
        bounds = [
            (-radius * v, min(radius * v, t - v)) for v, t in zip(now.x, rows.top, strict=True)
        ]
        bounds[0] = bounds[-1] = (0.0, 0.0)
        found = linprog(gain, A, room, bounds=[*bounds, (0.0, np.inf)], method="highs")
        if found.x is None:
            radius *= 0.3
            continue
        trial = now.x + found.x[:-1]
        then = _Program(problem, moving, problem.tangent(rows, trial, q, rate), trial, rates)
        better = now.merit - then.merit
        if not better > 0.0:
            radius *= 0.3
            continue
        hoped = now.duration * now.excess - float(found.fun)
        radius = min(2.0 * radius, 0.8) if better > 0.5 * hoped else radius
        settled = better < _ENOUGH * now.merit and then.excess <= 1e-6
        now = then
        if settled:
            break
    return now.x if now.excess <= 1e-3 else None


class _Program:
    """A linear program for the step of x, with a slack for the rates."""

    def __init__(
        self, problem: PathLimits, steps: Array, rows: Rows, x: Array, rates: Array
    ) -> None:  # fmt: skip
        self.x, self.problem, self.steps, self.rates = x, problem, steps, rates
        root = np.sqrt(x)
        pace = root[1:] + root[:-1]
        self.h = 2.0 * steps / pace
        with np.errstate(divide="ignore"):
            slope = -self.h / pace * 0.5
            self.left = np.where(x[:-1] > 0.0, slope / root[:-1], 0.0)
            self.right = np.where(x[1:] > 0.0, slope / root[1:], 0.0)
        # of each quantity at the start and at the end of every interval, by x there
        half = 0.5 / steps[:, None]
        a, b, c = rows.a, rows.b, rows.c
        self.start = (b[:-1] - a[:-1] * half, a[:-1] * half, c[:-1])
        self.end = (-a[1:] * half, b[1:] + a[1:] * half, c[1:])
        self.values = [p * x[:-1, None] + r * x[1:, None] + k for p, r, k in (self.start, self.end)]
        middle = 0.5 * (self.values[0] + self.values[1])
        self.change = np.diff(middle, axis=0)
        allowed = self.rates * 0.5 * (self.h[1:] + self.h[:-1])[:, None]
        self.allowed = np.where(np.isfinite(self.rates), allowed, np.inf)
        # from rest the mean acceleration of the first interval is 3/4 of the one that is reached
        self.jumps = [
            (e, middle[e] - rows.c[e], 0.75 * self.rates * self.h[e])
            for e in (0, -1)
            if x[e] == 0.0
        ]
        self.excess = max(float((np.abs(self.change) / self.allowed).max(initial=0.0)) - 1.0, 0.0)
        for _, jump, most in self.jumps:
            self.excess = max(self.excess, float((np.abs(jump) / most).max(initial=0.0)) - 1.0)
        for k in range(problem.scale.size):
            for _, value in self.imposed(k):
                over = max(*(value[:, k] - problem.upper[k]), *(problem.lower[k] - value[:, k]))
                self.excess = max(self.excess, float(over))
        self.duration = float(self.h.sum())
        self.merit = self.duration * (1.0 + self.excess)

    def imposed(self, k: int) -> list[tuple[tuple[Array, Array, Array], Array]]:
        """Where a limit of quantity k is imposed: at the start of every interval, or at both."""
        both = list(zip((self.start, self.end), self.values, strict=True))
        return both[: 1 + int(self.problem.ends[k])]

    def program(self) -> tuple[Array, Any, Array]:
        """Objective, rows and bounds of the step (N + 1,) and the slack."""
        from scipy.sparse import coo_array, vstack

        problem, N = self.problem, self.steps.size
        gain = np.zeros(N + 2)
        gain[:N] += self.left
        gain[1 : N + 1] += self.right
        gain[-1] = self.duration
        blocks: list[Any] = []
        room: list[Array] = []

        def add(columns: Any, coefficients: Array, most: Array, slack: Array | None) -> None:
            """Rows with entries at columns (M, e), and a slack."""
            wanted = np.flatnonzero(np.isfinite(most))
            columns, coefficients = columns[wanted], coefficients[wanted]
            M, e = columns.shape
            i = np.repeat(np.arange(M), e)
            block = coo_array((coefficients.ravel(), (i, columns.ravel())), shape=(M, N + 2))
            if slack is not None:
                block = block + coo_array(
                    (-slack[wanted], (np.arange(M), np.full(M, N + 1))), shape=(M, N + 2)
                )
            blocks.append(block)
            room.append(most[wanted])

        i = np.arange(N)
        for k in range(problem.scale.size):
            for (p, r, _), value in self.imposed(k):
                for side, bound in ((1.0, problem.upper[k]), (-1.0, -problem.lower[k])):
                    spare = bound - side * value[:, k]
                    add(np.stack((i, i + 1), 1), side * np.stack((p[:, k], r[:, k]), 1),
                        np.maximum(spare, 0.0), None)  # fmt: skip
            if not np.isfinite(self.rates[k]):
                continue
            p, r = (0.5 * (self.start[e][:, k] + self.end[e][:, k]) for e in (0, 1))
            R = 0.5 * self.rates[k]
            for side, (e, jump, most) in product((1.0, -1.0), self.jumps):
                at = i[e]
                slope = 0.75 * self.rates[k] * np.array([self.left[e], self.right[e]])
                entry = side * np.array([p[e], r[e]]) - slope
                add(np.array([[at, at + 1]]), entry[None], most[k : k + 1] - side * jump[k : k + 1],
                    most[k : k + 1])  # fmt: skip
            for side in (1.0, -1.0):
                entries = (
                    -side * p[:-1] - R * self.left[:-1],
                    side * (p[1:] - r[:-1]) - R * (self.right[:-1] + self.left[1:]),
                    side * r[1:] - R * self.right[1:],
                )
                spare = self.allowed[:, k] - side * self.change[:, k]
                add(np.stack((i[:-1], i[:-1] + 1, i[:-1] + 2), 1), np.stack(entries, 1),
                    spare, self.allowed[:, k])  # fmt: skip
        return gain, vstack(blocks).tocsr(), np.concatenate(room)

"""Limits of jerk and of the rates of torques along a path, by sequential linear programming.

The rate of a torque is not convex in the squared rates x of the path parameter. From the quickest
motion without such limits, linear programs change x within a bound until the rates are kept, and
then as long as the motion becomes quicker: the result is a local optimum.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from .._arrays import Array
from .motions import PiecewisePolynomial
from .path_limits import PathLimits, Rows
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
    share, law = 1.0, None
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
    assert law is not None
    return x, law


def _improved(
    problem: PathLimits, s: Array, q: Array, rate: Array, rows: Rows, x: Array, rates: Array
) -> Array | None:
    """Squared rates (N + 1,) that are a local optimum, or None where a limit is not kept."""
    from scipy.optimize import linprog

    def program_at(x: Array) -> _Program:
        return _Program(problem, np.diff(s), problem.tangent(rows, x, q, rate), x, rates)

    radius, now = _FIRST, program_at(x)
    for _ in range(_STEPS):
        if radius < _LEAST:
            break
        gain, A, room = now.program()
        bounds = np.stack((-radius * now.x, np.minimum(radius * now.x, rows.top - now.x)), axis=1)
        bounds[[0, -1]] = 0.0
        found = linprog(gain, A, room, bounds=[*bounds.tolist(), (0.0, np.inf)], method="highs")
        then = now if found.x is None else program_at(now.x + found.x[:-1])
        better = now.merit - then.merit
        if not better > 0.0:
            radius *= 0.3
            continue
        if better > 0.5 * (now.duration * now.excess - float(found.fun)):
            radius = min(2.0 * radius, 0.8)
        settled, now = better < _ENOUGH * now.merit and then.excess <= 1e-6, then
        if settled:
            break
    return now.x if now.excess <= 1e-3 else None


class _Program:
    """A linear program for the step of x, with a slack for the rates."""

    def __init__(
        self, problem: PathLimits, steps: Array, rows: Rows, x: Array, rates: Array
    ) -> None:  # fmt: skip
        from scipy.sparse import csr_array, diags_array

        N = steps.size

        def banded(*bands: Array) -> Any:
            """Rows with entries on the diagonal and beside it."""
            shape = (bands[0].size, bands[0].size + 1)
            return diags_array(bands, offsets=(0, 1), shape=shape, format="csr")

        self.x = x
        root = np.sqrt(x)
        pace = root[1:] + root[:-1]
        h = 2.0 * steps / pace
        with np.errstate(divide="ignore"):
            slope = -0.5 * h / pace
            left, right = (np.where(r > 0.0, slope / r, 0.0) for r in (root[:-1], root[1:]))
        self.by_duration, self.duration = banded(left, right), float(h.sum())
        one, half = np.ones(N - 1), 0.5 / steps
        change, mean = banded(-one, one), banded(0.5 * one, 0.5 * one)
        # from rest the mean acceleration of the first interval is 3/4 of the one that is reached
        rests = np.flatnonzero(x[[0, -1]] == 0.0)
        ends = csr_array(np.eye(N)[rests * (N - 1)])
        self.blocks: list[tuple[Any, Array, Array | None]] = []  # rows, values and room, slack
        excess = 0.0
        for k in range(problem.scale.size):
            a, b, c = rows.a[:, k], rows.b[:, k], rows.c[:, k]
            start = banded(b[:-1] - a[:-1] * half, a[:-1] * half)  # of every interval
            end = banded(-a[1:] * half, b[1:] + a[1:] * half)
            for part, still in ((start, c[:-1]), (end, c[1:]))[: 1 + int(problem.ends[k])]:
                value = part @ x + still
                for side, bound in ((1.0, problem.upper[k]), (-1.0, -problem.lower[k])):
                    excess = max(excess, float((side * value - bound).max()))
                    if np.isfinite(bound):
                        room = np.maximum(bound - side * value, 0.0)
                        self.blocks.append((side * part, room, None))
            if not np.isfinite(rates[k]):
                continue
            middle = 0.5 * (start + end)
            value, still = middle @ x, 0.5 * (c[1:] + c[:-1])
            at_ends = ends @ (value + still) - c[[0, -1]][rests]
            for moved, by_x, weight in (
                (change @ (value + still), change @ middle, mean),
                (at_ends, ends @ middle, 0.75 * ends),
            ):
                allowed = rates[k] * (weight @ h)
                excess = max(excess, float((np.abs(moved) / allowed).max(initial=0.0)) - 1.0)
                by_time = rates[k] * (weight @ self.by_duration)
                for side in (1.0, -1.0):
                    self.blocks.append((side * by_x - by_time, allowed - side * moved, allowed))
        self.excess = excess
        self.merit = self.duration * (1.0 + self.excess)

    def program(self) -> tuple[Array, Any, Array]:
        """Objective, rows and bounds of the step (N + 1,) and the slack."""
        from scipy.sparse import csr_array, hstack, vstack

        gain, rows, rooms = np.append(self.by_duration.sum(axis=0), self.duration), [], []
        for block, room, slack in self.blocks:
            column = np.zeros(room.size) if slack is None else -slack
            rows.append(hstack((block, csr_array(column[:, None]))))
            rooms.append(room)
        return gain, vstack(rows).tocsr(), np.concatenate(rooms)

"""Nearest joint velocities inside bounds, and the largest part of a task that they leave.

What a task leaves free is ``v = x + s w + F^T y``: s is the part of the task, F has orthonormal
rows, y is free. For a given s the nearest v to a wish is found by the dual active set method of
D. Goldfarb and A. Idnani (1983); where some bounds exclude each other, their multipliers say how
far s has to fall, so that s comes down to the largest value possible in a few steps.
"""

from math import inf, sqrt

import numpy as np

from ._compile import Floats, Ints, compiled

__all__ = ["cleared", "complement", "largest_part"]

_DEPENDENT = 1e-12
"""Length of what is left of a column of F, beside orthonormal rows, that counts as zero."""

_ROUNDING = 1e-13
"""Violation of a bound, relative to the velocities, that counts as none."""

_CUTS = 60
_STEPS_PER_JOINT = 40


@compiled()
def cleared(x: Floats, V: Floats, k: int, d: int, parts: Floats) -> float:
    """Take the parts along the first k orthonormal rows of V out of x, and square what is left.

    Shapes: x (>= d,), V (>= k, >= d) -> parts (>= k,).
    """
    for i in range(k):
        parts[i] = 0.0
    for _ in range(2):  # twice is enough
        for i in range(k):
            inner = 0.0
            for c in range(d):
                inner += V[i, c] * x[c]
            parts[i] += inner
            for c in range(d):
                x[c] -= inner * V[i, c]
    total = 0.0
    for c in range(d):
        total += x[c] * x[c]
    return total


@compiled()
def complement(V: Floats, r: int, d: int) -> None:
    """Complete r orthonormal rows of ``V (>= d, >= d)`` to a basis of the space of d dimensions."""
    left, parts = np.empty(d), np.empty(d)
    for c in range(d):
        left[c] = 1.0
        for i in range(r):
            left[c] -= V[i, c] * V[i, c]
    for k in range(r, d):
        best = 0
        for c in range(1, d):
            if left[c] > left[best]:
                best = c
        for c in range(d):
            V[k, c] = 0.0
        V[k, best] = 1.0
        length = sqrt(cleared(V[k], V, k, d, parts))
        for c in range(d):
            V[k, c] /= length
            left[c] -= V[k, c] * V[k, c]


@compiled()
def dependence(
    F: Floats, f: int, p: int, side: float, k: int, E: Floats, R: Floats, r: Floats, z: Floats
) -> float:
    """Decompose the normal of a bound into the active normals and an orthogonal rest.

    Shapes: F, f (>= f, n); E (>= k, >= f); R (>= k, >= k) -> r (>= k,), z (>= f,).
    """
    for c in range(f):
        z[c] = side * F[c, p]
    square = cleared(z, E, k, f, r)
    for i in range(k - 1, -1, -1):
        for j in range(i + 1, k):
            r[i] -= R[j, i] * r[j]
        r[i] /= R[i, i]
    return square


@compiled()
def factorise(
    F: Floats, f: int, active: Ints, sides: Floats, done: int, k: int, E: Floats, R: Floats
) -> None:
    """Orthogonal factors of the normals of the k active bounds, from those of the first ones."""
    for i in range(done, k):
        for c in range(f):
            E[i, c] = sides[i] * F[c, active[i]]
        R[i, i] = sqrt(cleared(E[i], E, i, f, R[i]))
        for c in range(f):
            E[i, c] /= R[i, i]


@compiled()
def nearest_inside(
    x: Floats,
    F: Floats,
    f: int,
    wish: Floats,
    bounds: Floats,
    v: Floats,
    active: Ints,
    work: Floats,
    basis: Floats,
) -> tuple[int, int, float, float]:
    """Nearest ``v = x + F^T y`` to a wish with ``bounds[0] <= v <= bounds[1]``.

    Shapes: x, wish (n,); bounds (2, n); F (>= f, n); basis (2, n, n) -> v, active (n,), and rows of
    work (5, n): scratch, sides and pressures of active bounds, `dependence` of the last one.
    """
    n = x.shape[0]
    lower, upper = bounds[0], bounds[1]
    sides, press, r, z = work[1], work[2], work[3], work[4]
    E, R = basis[0], basis[1]
    for j in range(n):
        v[j] = x[j]
    for c in range(f):
        inner = 0.0
        for j in range(n):
            inner += F[c, j] * wish[j]
        for j in range(n):
            v[j] += inner * F[c, j]
    size = 0.0
    for j in range(n):
        size = max(size, abs(x[j]), abs(v[j]))
    k, done = 0, 0
    for _ in range(_STEPS_PER_JOINT * (n + 1)):
        joint, side, worst = -1, 0.0, _ROUNDING * size
        for j in range(n):
            if v[j] - upper[j] > worst:
                joint, side, worst = j, 1.0, v[j] - upper[j]
            if lower[j] - v[j] > worst:
                joint, side, worst = j, -1.0, lower[j] - v[j]
        if joint < 0:
            break
        pressure = 0.0
        while True:
            factorise(F, f, active, sides, done, k, E, R)
            done = k
            square = dependence(F, f, joint, side, k, E, R, r, z)
            dual, leaving = inf, -1
            for i in range(k):
                if r[i] > 0.0 and press[i] < dual * r[i]:
                    dual, leaving = press[i] / r[i], i
            primal = inf
            if k < f and square > _DEPENDENT * _DEPENDENT:
                bound = upper[joint] if side > 0.0 else lower[joint]
                primal = max(0.0, side * (v[joint] - bound)) / square
            step = min(dual, primal)
            if step == inf:
                return k, joint, side, size
            if primal < inf:
                for j in range(n):
                    for c in range(f):
                        v[j] -= step * F[c, j] * z[c]
            pressure += step
            for i in range(k):
                press[i] -= step * r[i]
            if primal <= dual:
                active[k], sides[k], press[k] = joint, side, pressure
                k += 1
                break
            for i in range(leaving, k - 1):
                active[i], sides[i], press[i] = active[i + 1], sides[i + 1], press[i + 1]
            k -= 1
            done = leaving
    return k, -1, 0.0, size


@compiled()
def largest_part(
    x: Floats,
    w: Floats,
    F: Floats,
    f: int,
    wish: Floats,
    bounds: Floats,
    v: Floats,
    marks: Ints,
    work: Floats,
    basis: Floats,
) -> float:
    """Largest s in [0, 1] with a ``v = x + s w + F^T y`` inside the bounds, and the nearest v.

    Shapes as for `nearest_inside`; marks (3, n): joints at a bound, joints that limit s (both 1 or
    -1, else 0), and scratch.
    """
    n = x.shape[0]
    lower, upper = bounds[0], bounds[1]
    base, sides, r = work[0], work[1], work[3]
    at, stuck, active = marks[0], marks[1], marks[2]
    s, size, k = 1.0, 0.0, 0
    for j in range(n):
        stuck[j] = 0
    for _ in range(_CUTS):
        for j in range(n):
            base[j] = x[j] + s * w[j]
        k, joint, side, size = nearest_inside(base, F, f, wish, bounds, v, active, work, basis)
        if joint < 0:
            break
        bound = upper[joint] if side > 0.0 else lower[joint]
        slope = side * w[joint]
        room = side * (bound - x[joint])
        terms, most = abs(slope), abs(room)
        for i in range(k):
            bound = upper[active[i]] if sides[i] > 0.0 else lower[active[i]]
            part = -r[i] * sides[i] * w[active[i]]
            space = -r[i] * sides[i] * (bound - x[active[i]])
            slope += part
            room += space
            terms, most = max(terms, abs(part)), max(most, abs(space), abs(r[i]) * size)
        if not slope > _DEPENDENT * terms:
            return -1.0
        part = room / slope
        if part < 0.0:
            if room < -_ROUNDING * max(size, most):
                return -1.0
            part = 0.0
        if not part < s:
            break  # what is left is rounding
        s = part
        for j in range(n):
            stuck[j] = 0
        stuck[joint] = 1 if side > 0.0 else -1
        for i in range(k):
            if r[i] < -_DEPENDENT:
                stuck[active[i]] = 1 if sides[i] > 0.0 else -1
    for j in range(n):
        at[j] = stuck[j]
    for i in range(k):
        at[active[i]] = 1 if sides[i] > 0.0 else -1
    near = _ROUNDING * size
    for j in range(n):
        if at[j] > 0 or (at[j] == 0 and v[j] >= upper[j] - near):
            v[j], at[j] = upper[j], 1
        elif at[j] < 0 or v[j] <= lower[j] + near:
            v[j], at[j] = lower[j], -1
    return s

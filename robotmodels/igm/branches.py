"""Labels of IK solutions: the sides of the shoulder, elbow and wrist singularities."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, singledispatch

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .arm_angle import ArmAngle
from .closed_form import ClosedForm
from .loop import JointChain
from .motion import axes_of, cross
from .postures import Postures
from .reduced import FewerJoints
from .solver import Solver
from .structure import Family

Codes = NDArray[np.int16]

SIDES = tuple(
    f"shoulder{shoulder} elbow{elbow} wrist{wrist}"
    for shoulder in "+-"
    for elbow in "+-"
    for wrist in "+-"
)
"""Labels of six-joint arms with a closed form; the signs are those of three geometric products."""


@singledispatch
def branches(solver: Solver, found: Postures) -> tuple[Codes, tuple[str, ...]]:
    """Branches of the solutions of each pose, and the names of all. Shapes: -> code (N, S)."""
    return np.zeros(found.valid.shape, np.int16), ("",)


@branches.register
def _(solver: ClosedForm, found: Postures) -> tuple[Codes, tuple[str, ...]]:
    plan = solver.plan
    parallel = plan.family is Family.PARALLEL
    signs = sides(solver.chain, [int(j) for j in plan.order], parallel, found.q[found.valid])
    return _numbered(found, signs), SIDES


@branches.register
def _(solver: FewerJoints, found: Postures) -> tuple[Codes, tuple[str, ...]]:
    way = solver.ways[0]
    if not isinstance(way.solver, ClosedForm):
        return np.zeros(found.valid.shape, np.int16), ("",)
    # the virtual joints are at zero
    longer = np.zeros((*found.q.shape[:2], way.solver.chain.k))
    longer[..., way.places] = found.q
    return branches(way.solver, replace(found, q=longer))


@branches.register
def _(solver: ArmAngle, found: Postures) -> tuple[Codes, tuple[str, ...]]:
    signs = arm_angle_sides(solver.chain, found.q[found.valid])
    return _numbered(found, signs), SIDES


def sides(chain: JointChain, order: list[int], parallel: bool, q: Array) -> tuple[Array, ...]:
    """Products that vanish at the shoulder, elbow and wrist singularities.

    Shapes: q (M, k) -> three of (M,). ``order``: three joints and three whose axes meet, or one,
    three with parallel axes and two.
    """
    z, p = axes_of(chain, q)
    a, b, c, d, e, f = order

    def velocity(j: int, point: Array) -> Array:
        return z[j] if chain.sigma[j] else cross(z[j], point - p[j])

    if parallel:
        centre = _nearest_point(z[f], p[f], z[e], p[e])
        elbow = _triple(z[b], p[c] - p[b], p[d] - p[c])
        wrist = _triple(z[e], z[b], z[f])
        return _dot(cross(z[a], centre - p[a]), z[b]), elbow, wrist
    centre = _nearest_point(z[d], p[d], z[e], p[e])
    wrist = _triple(z[d], z[e], z[f])
    u, v, w = (velocity(j, centre) for j in (a, b, c))
    elbow = _triple(u, v, w)
    if chain.sigma[a] or chain.sigma[b]:
        return np.ones(len(q)), elbow, wrist
    shoulder = _dot(u, z[b])
    return shoulder, np.where(shoulder >= 0.0, elbow, -elbow), wrist


@lru_cache(maxsize=64)
def _samples(chain: JointChain) -> tuple[Array, tuple[Array, ...]]:
    """Three angles, and the products of a shoulder, an elbow and a wrist at them.

    Seven joints with a spherical shoulder (1 to 3) and wrist (5 to 7): each product depends on one
    joint alone, as ``a + b cos q + c sin q``.
    """
    t: Array = 2.0 * np.pi / 3.0 * np.arange(3.0)
    z, p = axes_of(chain, np.repeat(t[:, None], 7, axis=1))
    shoulder = _nearest_point(z[1], p[1], z[2], p[2])
    wrist = _nearest_point(z[5], p[5], z[4], p[4])
    elbow = _triple(z[3], p[3] - shoulder, wrist - p[3])
    return t, (_triple(z[0], z[1], z[2]), elbow, _triple(z[4], z[5], z[6]))


def arm_angle_sides(chain: JointChain, q: Array) -> tuple[Array, ...]:
    """The same for arms with an arm angle, by trigonometric interpolation in joints 2, 4, 6."""
    t, products = _samples(chain)
    return tuple(
        values.sum() + 2.0 * np.cos(q[:, j, None] - t) @ values
        for j, values in zip((1, 3, 5), products, strict=True)
    )


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->i", a, b)


def _triple(a: Array, b: Array, c: Array) -> Array:
    """``a . (b x c)``."""
    return _dot(a, cross(b, c))


def _nearest_point(z: Array, p: Array, other_z: Array, other_p: Array) -> Array:
    """Point of a line that is nearest to another; its origin if they are parallel."""
    n = cross(z, other_z)
    size = _dot(n, n)
    along = _triple(other_p - p, other_z, n) / np.where(size > 1e-12, size, np.inf)
    return p + along[:, None] * z


def _numbered(found: Postures, products: tuple[Array, ...]) -> Codes:
    """Number of the label in `SIDES`: 4 for shoulder-, 2 for elbow-, 1 for wrist-."""
    code = np.full(found.valid.shape, -1, np.int16)
    shoulder, elbow, wrist = (product < 0.0 for product in products)
    code[found.valid] = 4 * shoulder + 2 * elbow + wrist
    return code

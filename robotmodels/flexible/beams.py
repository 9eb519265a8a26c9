"""Uniform Euler-Bernoulli beams as flexible links: modes of bending and torsion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss, legint, legval
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_exact, as_number, as_reals
from .._choices import one_of
from ..errors import InertiaError, InvalidValueError
from .link import BeamData, FlexibleLink, Section, integrals

_ENDS = ("clamped-free", "pinned-hub")
_SLENDER = 0.02  # default radius of gyration of the section, relative to the length
_LIGHT = 1e-10  # least mass of a mode, relative to the first
_DRAWN = 41  # nodes of a beam
_X, _Y, _Z = np.eye(3)


class Mode(NamedTuple):
    """Bending about an axis (1: y, 2: z) or torsion (0) of a beam.

    Shapes: Legendre series (N,) of the displacement on a beam of length 1, and its derivatives.
    """

    axis: int
    stiffness: float
    frequency: float
    series: list[Array]


def beam(
    length: float,
    EI: ArrayLike,
    GJ: float | None = None,
    density: float = 1.0,
    tip: Any = None,
    hub: float | None = None,
    modes: int = 2,
    ends: str = "clamped-free",
    stiffening: bool = False,
    *,
    gyration: float | None = None,
    pose: ArrayLike | None = None,
) -> FlexibleLink:
    """Flexible link from a uniform Euler-Bernoulli beam along the x axis of its frame.

    Its modes are those of the beam with its tip body: bending about y (displacement along z),
    about z (along y), torsion. The largest displacement of each is 1, so that elastic coordinates
    are metres, of torsion radians at the tip.

    Parameters
    ----------
    length, density : float
        From the root to the tip, m; mass per length, kg/m.
    EI : array_like, shape (2,) or ()
        Bending stiffness about y and z, or both, N m^2; infinite where the beam is rigid.
    GJ : float, optional
        Torsional stiffness, N m^2; default rigid.
    tip : float, (mass, inertia) or (mass, com, inertia), optional
        Body fixed to the tip: kg; centre of mass (3,) from the tip, m; inertia about it, kg m^2, a
        number, shape (3,) or (3, 3).
    hub : float, optional
        Rotary inertia about z at the root, kg m^2; default 0.
    modes : int
        Of each bending plane and of torsion.
    ends : str
        ``"clamped-free"``, for joints whose angle or torque is given, or ``"pinned-hub"``: the
        modes about z, and their frequencies, are those with a free joint and the hub on it. Their
        shapes are taken from the tangent at the root, so that q remains the angle of the hub.
    stiffening : bool
        Whether foreshortening is included, which keeps a spinning beam stiff.
    gyration : float, optional
        Polar radius of gyration of the section, m; default ``length / 50`` with torsion, else 0.
    pose : array_like, shape (4, 4), optional
        Pose of the beam's root in the frame of its joint; default identity.

    Returns
    -------
    FlexibleLink
        The link. A tip that is no physical body raises InertiaError.

    References
    ----------
    Sections 7.2.2.3 and 7.2.2.12; for the stiffening T. Kane et al., J. Guidance 10 (1987).

    Examples
    --------
    >>> link = beam(2.0, EI=(np.inf, 3.0), density=0.5, modes=3)
    >>> ((link.frequencies * 4.0 * np.sqrt(0.5 / 3.0)) ** 0.5).round(6)
    array([1.875104, 4.694091, 7.854757])
    """
    L = as_number(length, "length", above=0.0)
    rho = as_number(density, "density", above=0.0)
    stiff, torsion = as_reals(EI, "EI"), as_reals(np.inf if GJ is None else GJ, "GJ")
    stiff = np.broadcast_to(stiff, (2,)) if stiff.ndim == 0 else stiff
    if (stiff.shape, torsion.shape) != ((2,), ()) or not (np.append(stiff, torsion) > 0.0).all():
        raise InvalidValueError(
            f"EI, GJ: expected positive stiffness or infinity, got {EI!r:.60} and {GJ!r:.20}."
        )
    one_of(ends, _ENDS, "ends")
    if not isinstance(modes, int | np.integer) or modes < 0:
        raise InvalidValueError(f"modes: expected a number from 0, got {modes!r:.40}.")
    h = 0.0 if hub is None else as_number(hub, "hub", least=0.0)
    slender = 0.0 if GJ is None else _SLENDER * L
    k = slender if gyration is None else as_number(gyration, "gyration", least=0.0)
    if np.isfinite(torsion) and k == 0.0:
        raise InvalidValueError("gyration: torsion needs a positive radius of gyration, got 0.")
    T = np.eye(4) if pose is None else se3.as_single_pose(pose, "pose")
    own, planes = _tip_body(tip), (float(stiff[0]), float(stiff[1]))
    kinds = list[Mode]()
    for axis, value in ((1, planes[0]), (2, planes[1]), (0, float(torsion))):
        m, c, J = own
        loads = [(J[0, 0] + m * float(c[1:] @ c[1:]), 1.0, 0.0)]
        if axis:
            spin = (J[axis, axis] + m * c[3 - axis] ** 2) / L**2
            loads = [(m, 1.0, c[0] / L), (spin, 0.0, 1.0)]
        if np.isfinite(value):
            free = h / L**2 if ends == "pinned-hub" and axis == 2 else None
            mass = rho * L * (1.0 if axis else k * k)
            kinds += _modes(int(modes), axis, value / L ** (3 if axis else 1), mass, loads, free)
    body = BeamData(L, planes, float(torsion), rho, k, own, h, T)
    return _link(kinds, body, 24 + 8 * int(modes), bool(stiffening))


def _link(kinds: list[Mode], body: BeamData, count: int, stiffening: bool) -> FlexibleLink:
    """Flexible link of modes; integrals by Gauss quadrature with so many points."""
    L, m, R, p = body.length, len(kinds), body.pose[:3, :3], body.pose[:3, 3]
    points, weights = leggauss(count)
    points, weights = 0.5 + 0.5 * points, 0.5 * weights

    def shortened(x: Array) -> Array:
        """Second displacement of the axis, along the beam. Shapes: (N,) -> (N, 3, m, m)."""
        if not stiffening:
            return np.zeros((len(x), 3, m, m))
        slope = _fields(kinds, L, np.outer(x, points).ravel())[1].reshape(len(x), count, 3, m)
        slope = slope[:, :, 1:]  # of torsion none
        inner = np.einsum("n,g,ngsk,ngsl->nkl", x, weights, slope, slope)
        return -_X[:, None, None] * inner[:, None]

    x, end = L * points, np.array([L])
    Phi, turn = _fields(kinds, L, x)
    Gamma, X, share = shortened(x), np.outer(x, _X), body.density * L * weights
    cloud = [(share, X, Phi, Gamma)]
    if body.gyration > 0.0:  # the mass of a section at four points, which torsion turns
        arms = body.gyration * np.array((_Y, -_Y, _Z, -_Z))
        cloud = [(share / 4.0, X + r, Phi + _turned(turn * _X[:, None], r), Gamma) for r in arms]
    tip, tip_turn, tip_short = (v[0] for v in (*_fields(kinds, L, end), shortened(end)))
    for mass, r in _points_of(*body.tip):
        spun = _turned(tip_turn, r)
        both = np.cross(tip_turn[:, :, None], spun[:, None, :], axis=0) * stiffening
        bent = tip_short + 0.5 * (both + both.swapaxes(1, 2))
        cloud.append((np.array([mass]), (L * _X + r)[None], (tip + spun)[None], bent[None]))
    W, X, Phi, Gamma = (np.concatenate(parts) for parts in zip(*cloud, strict=True))
    stiffness = np.diag([mode.stiffness for mode in kinds]).reshape(m, m)
    Phi, Gamma = np.einsum("ij,njk->nik", R, Phi), np.einsum("ij,njkl->nikl", R, Gamma)
    found = integrals(W, X @ R.T + p, Phi, Gamma, stiffness)
    found = replace(found, inertia=found.inertia + np.diag([0.0, 0.0, body.hub]))
    curved = np.moveaxis(np.tensordot(R, tip_short, 1), 0, -1)
    section = Section(L * R[:, 0] + p, (R @ tip).T, (R @ tip_turn).T, curved)
    drawn = np.linspace(0.0, L, _DRAWN)
    shapes = np.einsum("ij,njk->nik", R, _fields(kinds, L, drawn)[0])
    frequencies, nodes = np.array([mode.frequency for mode in kinds]), np.outer(drawn, R[:, 0]) + p
    return FlexibleLink(found, frequencies, section, nodes, shapes, stiffening, body)


def _fields(kinds: list[Mode], L: float, x: Array) -> tuple[Array, Array]:
    """Displacements and rotations of the axis by modes. Shapes: (N,) -> (N, 3, m), (N, 3, m)."""
    Phi, turn = np.zeros((2, len(x), 3, len(kinds)))
    u = 2.0 * x / L - 1.0
    for c, mode in enumerate(kinds):
        if mode.axis == 0:
            turn[:, 0, c] = legval(u, mode.series[0])
        else:
            Phi[:, 3 - mode.axis, c] = legval(u, mode.series[0])
            slope = legval(u, mode.series[1]) / L
            turn[:, mode.axis, c] = slope if mode.axis == 2 else -slope
    return Phi, turn


def _turned(turn: Array, r: Array) -> Array:
    """Displacements (..., 3, m) of a point at r by rotations (..., 3, m)."""
    return np.cross(turn, r, axisa=-2, axisb=0, axisc=-2)


def _tip_body(tip: Any) -> tuple[float, Array, Array]:
    """Mass, centre of mass and inertia about it, of a tip in any of its forms."""
    given = (0.0,) if tip is None else tuple(tip) if isinstance(tip, list | tuple) else (tip,)
    if not 1 <= len(given) <= 3:
        raise InvalidValueError(
            f"tip: expected mass, (mass, inertia) or (mass, com, inertia), got {len(given)}."
        )
    mass = as_number(given[0], "tip mass", least=0.0)
    com = as_exact(given[1], (3,), "tip com") if len(given) == 3 else np.zeros(3)
    J = as_reals(given[-1] if len(given) > 1 else 0.0, "tip inertia")
    J = as_exact(J * np.eye(3) if J.shape in ((), (3,)) else J, (3, 3), "tip inertia")
    least = np.linalg.eigvalsh(0.5 * np.trace(J) * np.eye(3) - J)[0]
    if not np.allclose(J, J.T) or least < -1e-9 * abs(np.trace(J)) or (mass == 0.0 and J.any()):
        raise InertiaError(f"tip: mass {mass:g}, inertia {J.tolist()}: not a physical body.")
    return mass, com, J


def _points_of(mass: float, com: Array, J: Array) -> list[tuple[float, Array]]:
    """Point masses with the inertia of the tip body, and their places from the tip."""
    if mass == 0.0 or not J.any():
        return [(mass, com)] if mass else []
    moments, axes = np.linalg.eigh(0.5 * np.trace(J) * np.eye(3) - J)
    arms = (np.sqrt(3.0 * np.maximum(moments, 0.0) / mass) * axes).T
    return [(mass / 6.0, com + s * r) for r in arms for s in (1.0, -1.0)]


Loads = list[tuple[float, float, float]]


def _modes(
    count: int, axis: int, stiffness: float, mass: float, loads: Loads, hub: float | None
) -> list[Mode]:
    """First modes of a clamped beam, or with a free root and a hub on it, by Galerkin's method.

    The basis are polynomials whose second derivatives (first ones of torsion) are orthonormal.
    Each load is the inertia of a combination of displacement and slope of the tip.
    """
    N, order = 2 * count + 16, 2 if axis else 1
    series = [np.diag(np.sqrt(2.0 * np.arange(N) + 1.0))]
    for _ in range(order):
        series.insert(0, legint(series[0], lbnd=-1, scl=0.5))
    u, weights = leggauss(N + 2)
    # with the rigid rotation as the first function
    w = np.vstack([0.5 + 0.5 * u, legval(u, series[0])])
    tip, slope = (np.append(1.0, legval(1.0, c)) for c in series[:2])
    M = 0.5 * mass * (w * weights) @ w.T
    for inertia, a, b in loads:
        M += inertia * np.outer(a * tip + b * slope, a * tip + b * slope)
    free = 0.0 if hub is None else np.outer(M[1:, 0], M[0, 1:]) / (M[0, 0] + hub)
    values, V = np.linalg.eigh(M[1:, 1:] - free)
    values, V = values[::-1][:count], V[:, ::-1]
    if count and values[-1] < _LIGHT * values[0]:
        raise InvalidValueError(
            "tip, hub, density: the beam is too light for its loads; take fewer modes."
        )
    found = []
    for c, value in enumerate(values):
        shape = legval(np.linspace(-1.0, 1.0, 201), series[0] @ V[:, c])
        size = shape[np.abs(shape).argmax() if axis else -1]
        rows = [row @ V[:, c] / size for row in series]
        found.append(Mode(axis, stiffness / size**2, np.sqrt(stiffness / value), rows))
    return found

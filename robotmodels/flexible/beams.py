"""Uniform Euler-Bernoulli beams as flexible links: exact mode shapes of bending and torsion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, as_exact, as_number, as_reals, read_only
from ..errors import InertiaError, InvalidValueError
from .link import BeamData, FlexibleLink, Section, integrals

_ENDS = ("clamped-free", "pinned-hub")
_SLENDER = 0.02  # default radius of gyration of the section, relative to the length
_LEAST = 1e-4  # least wave number of a mode of a beam of length 1
_DRAWN = 41  # nodes of a beam
_X, _Y, _Z = np.eye(3)
Shape = Callable[[Array, int], Array]
"""Derivative of an order of a mode of a beam of length 1 at places (N,)."""


class Mode(NamedTuple):
    """Bending about an axis (1: y, 2: z) or torsion (0) of a beam."""

    axis: int
    stiffness: float
    frequency: float
    shape: Shape


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
    carried: Any = None,
    pose: ArrayLike | None = None,
) -> FlexibleLink:
    """Flexible link from a uniform Euler-Bernoulli beam along the x axis of its frame.

    Its modes are the exact ones of the beam with what it carries, in the order: bending about y
    (displacement along z), bending about z (along y), torsion. The largest displacement of each is
    1, so that elastic coordinates are metres, of torsion radians at the tip.

    Parameters
    ----------
    length : float
        From the root to the tip, m.
    EI : array_like, shape (2,) or ()
        Bending stiffness about y and z, N m^2; infinite where the beam is rigid; one number for
        both.
    GJ : float, optional
        Torsional stiffness, N m^2; default rigid.
    density : float
        Mass per length, kg/m.
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
    carried : float, (mass, inertia) or (mass, com, inertia), optional
        What the next links and their load are at the tip, for the shapes of the modes alone: fewer
        modes suffice. It is no part of this link's mass.
    pose : array_like, shape (4, 4), optional
        Pose of the beam's root in the frame of its joint; default identity.

    Returns
    -------
    FlexibleLink
        The link, with its invariants and frequencies.

    Raises
    ------
    InvalidValueError, ShapeError, InertiaError
        Stiffness, length or density that is not positive; an unknown kind of ends; a negative
        number of modes; a tip that is no physical body.

    References
    ----------
    Seed book sections 7.2.2.3 and 7.2.2.12; T. Kane, R. Ryan, A. Banerjee, "Dynamics of a
    cantilever beam attached to a moving base", J. Guidance 10 (1987), for the stiffening.

    Examples
    --------
    >>> link = beam(2.0, EI=(np.inf, 3.0), density=0.5, modes=3)
    >>> ((link.frequencies * 4.0 * np.sqrt(0.5 / 3.0)) ** 0.5).round(6)
    array([1.875104, 4.694091, 7.854757])
    """
    L = as_number(length, "length", above=0.0)
    rho = as_number(density, "density", above=0.0)
    stiff = np.broadcast_to(as_reals(EI, "EI"), (2,)) if np.ndim(EI) == 0 else as_reals(EI, "EI")
    torsion = np.inf if GJ is None else float(as_reals(GJ, "GJ"))
    if stiff.shape != (2,) or not ((stiff > 0.0).all() and torsion > 0.0):
        raise InvalidValueError(
            f"EI, GJ: expected positive stiffness, N m^2: EI = (about y, about z) and GJ, got EI = "
            f"{EI!r:.60}, GJ = {GJ!r:.20}; infinite where the beam is rigid."
        )
    if ends not in _ENDS:
        raise InvalidValueError(f"ends: expected one of {_ENDS}, got {ends!r:.40}.")
    if not isinstance(modes, int | np.integer) or modes < 0:
        raise InvalidValueError(f"modes: expected a number from 0, got {modes!r:.40}.")
    h = 0.0 if hub is None else as_number(hub, "hub", least=0.0)
    mass, com, J = _tip_body(tip)
    k = (
        (_SLENDER * L if GJ is not None else 0.0)
        if gyration is None
        else as_number(gyration, "gyration", least=0.0)
    )
    if np.isfinite(torsion) and k == 0.0:
        raise InvalidValueError("gyration: torsion needs a positive radius of gyration, got 0.")
    T = np.eye(4) if pose is None else se3.as_single_pose(pose, "pose")

    more, lever, spin = _tip_body(carried)
    kinds, all_mass = list[Mode](), mass + more
    place = (mass * com[0] + more * lever[0]) / all_mass if all_mass else 0.0
    for axis in (1, 2):
        if np.isfinite(EI_p := float(stiff[axis - 1])):
            about = J[axis, axis] + spin[axis, axis]
            about += mass * (com[0] - place) ** 2 + more * (lever[0] - place) ** 2
            about += mass * com[3 - axis] ** 2 + more * lever[3 - axis] ** 2
            loads = (all_mass / (rho * L), place / L, about / (rho * L**3))
            root = h / (rho * L**3) if ends == "pinned-hub" and axis == 2 else None
            for b, shape in bending_modes(int(modes), loads, root):
                kinds.append(Mode(axis, EI_p, (b / L) ** 2 * np.sqrt(EI_p / rho), shape))
    if np.isfinite(torsion):
        polar = J[0, 0] + spin[0, 0] + mass * float(com[1:] @ com[1:])
        polar += more * float(lever[1:] @ lever[1:])
        for b, shape in torsion_modes(int(modes), polar / (rho * L * k * k)):
            kinds.append(Mode(0, torsion, b / L * np.sqrt(torsion / (rho * k * k)), shape))
    body = BeamData(
        length=L,
        EI=(float(stiff[0]), float(stiff[1])),
        GJ=torsion,
        density=rho,
        gyration=k,
        tip_mass=mass,
        tip_com=tuple(com.tolist()),
        tip_inertia=tuple(J.ravel().tolist()),
        hub=h,
        pose=tuple(T.ravel().tolist()),
    )
    return _link(kinds, body, 24 + 8 * int(modes), bool(stiffening))


def _link(kinds: list[Mode], body: BeamData, count: int, stiffening: bool) -> FlexibleLink:
    """Flexible link of modes; integrals by Gauss quadrature with so many points."""
    L, m, T = body.length, len(kinds), np.array(body.pose).reshape(4, 4)
    points, weights = np.polynomial.legendre.leggauss(count)
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
        twist = turn * _X[:, None]
        arms = body.gyration * np.array((_Y, -_Y, _Z, -_Z))
        cloud = [(share / 4.0, X + r, Phi + _turned(twist, r), Gamma) for r in arms]
    tip, tip_turn, tip_short = (v[0] for v in (*_fields(kinds, L, end), shortened(end)))
    for mass, r in _points_of(body):
        spun = _turned(tip_turn, r)
        both = np.cross(tip_turn[:, :, None], spun[:, None, :], axis=0) * stiffening
        bent = tip_short + 0.5 * (both + both.swapaxes(1, 2))
        cloud.append((np.array([mass]), (L * _X + r)[None], (tip + spun)[None], bent[None]))
    W, X, Phi, Gamma = (np.concatenate(parts) for parts in zip(*cloud, strict=True))
    R, p = T[:3, :3], T[:3, 3]
    stiffness = np.array([[_bent(a, b, L, points, weights) for b in kinds] for a in kinds])
    Phi, Gamma = np.einsum("ij,njk->nik", R, Phi), np.einsum("ij,njkl->nikl", R, Gamma)
    found = integrals(W, X @ R.T + p, Phi, Gamma, stiffness.reshape(m, m))
    found = replace(found, inertia=found.inertia + np.diag([0.0, 0.0, body.hub]))
    curved = np.moveaxis(np.tensordot(R, tip_short, 1), 0, -1)
    section = Section(*map(read_only, (L * R[:, 0] + p, (R @ tip).T, (R @ tip_turn).T, curved)))
    drawn = np.linspace(0.0, L, _DRAWN)
    shapes = np.einsum("ij,njk->nik", R, _fields(kinds, L, drawn)[0])
    frequencies, nodes = np.array([mode.frequency for mode in kinds]), np.outer(drawn, R[:, 0]) + p
    return FlexibleLink(found, frequencies, section, nodes, shapes, stiffening, body)


def _fields(kinds: list[Mode], L: float, x: Array) -> tuple[Array, Array]:
    """Displacements and rotations of the axis by modes. Shapes: (N,) -> (N, 3, m), (N, 3, m)."""
    Phi, turn = np.zeros((2, len(x), 3, len(kinds)))
    for c, (axis, _, _, shape) in enumerate(kinds):
        if axis == 0:
            turn[:, 0, c] = shape(x / L, 0)
        else:
            Phi[:, 3 - axis, c] = shape(x / L, 0)
            turn[:, axis, c] = shape(x / L, 1) / L * (1.0 if axis == 2 else -1.0)
    return Phi, turn


def _turned(turn: Array, r: Array) -> Array:
    """Displacements (..., 3, m) of a point at r by rotations (..., 3, m)."""
    return np.cross(turn, r, axisa=-2, axisb=0, axisc=-2)


def _bent(a: Mode, b: Mode, L: float, points: Array, weights: Array) -> float:
    """Second derivative of the elastic energy by two modes."""
    if a.axis != b.axis:
        return 0.0
    order = 2 if a.axis else 1
    bent = a.shape(points, order) * b.shape(points, order)
    return a.stiffness * L ** (1 - 2 * order) * float(weights @ bent)


def _tip_body(tip: Any) -> tuple[float, Array, Array]:
    """Mass, centre of mass and inertia about it, of a tip in any of its forms."""
    given = (0.0,) if tip is None else tuple(tip) if isinstance(tip, list | tuple) else (tip,)
    if not 1 <= len(given) <= 3:
        raise InvalidValueError(
            "tip: expected a mass, (mass, inertia) or (mass, com, inertia), got "
            f"{len(given)} entries."
        )
    mass = as_number(given[0], "tip mass", least=0.0)
    com = as_exact(given[1], (3,), "tip com") if len(given) == 3 else np.zeros(3)
    J = as_reals(given[-1] if len(given) > 1 else 0.0, "tip inertia")
    J = as_exact(J if J.ndim == 2 else np.diag(np.broadcast_to(J, (3,))), (3, 3), "tip inertia")
    least = np.linalg.eigvalsh(0.5 * np.trace(J) * np.eye(3) - J)[0]
    if not np.allclose(J, J.T) or least < -1e-9 * abs(np.trace(J)) or (mass == 0.0 and J.any()):
        raise InertiaError(
            f"tip: mass {mass:g} and inertia {J.tolist()} belong to no body: expected a positive "
            "mass, and moments of which none exceeds the sum of the others."
        )
    return mass, com, J


def _points_of(body: BeamData) -> list[tuple[float, Array]]:
    """Point masses with the inertia of the tip body, and their places from the tip."""
    J, com = np.array(body.tip_inertia).reshape(3, 3), np.array(body.tip_com)
    if body.tip_mass == 0.0 or not J.any():
        return [(body.tip_mass, com)] if body.tip_mass else []
    moments, axes = np.linalg.eigh(0.5 * np.trace(J) * np.eye(3) - J)
    arms = (np.sqrt(3.0 * np.maximum(moments, 0.0) / body.tip_mass) * axes).T
    return [(body.tip_mass / 6.0, com + s * r) for r in arms for s in (1.0, -1.0)]


# --- exact shapes of a beam of length, mass and stiffness 1 --------------------------------------


def _basis(b: Array | float, x: Array | float, order: int) -> Array:
    """Solutions of d4w/dx4 = b^4 w, derivatives divided by b^order. Shapes: (...) -> (..., 4)."""
    c, s = np.cos(b * np.asarray(x)), np.sin(b * np.asarray(x))
    waves = ((c, s), (-s, c), (-c, -s), (s, -c))[order % 4]
    near, far = np.exp(-b * np.asarray(x)), np.exp(-b * (1.0 - np.asarray(x)))
    return np.stack([*waves, (-1.0) ** order * near, far], axis=-1)


def _conditions(b: Array, loads: tuple[float, float, float], hub: float | None) -> Array:
    """Conditions on the coefficients of a mode: root, then tip. Shapes: (N,) -> (N, 4, 4)."""
    mass, com, J = loads
    root = [_basis(b, 0.0 * b, order) for order in range(3)]
    tip = [_basis(b, 1.0 + 0.0 * b, order) for order in range(4)]
    b = b[:, None]
    push = mass * (tip[0] + com * b * tip[1])
    rows = (
        root[0],
        root[1] if hub is None else root[2] + b**3 * hub * root[1],
        tip[2] - b**2 * com * push - b**3 * J * tip[1],
        tip[3] + b * push,
    )
    stack = np.stack(rows, axis=1)
    return stack / np.linalg.norm(stack, axis=-1, keepdims=True)


def bending_modes(
    count: int, loads: tuple[float, float, float], hub: float | None
) -> list[tuple[float, Shape]]:
    """The first roots b and shapes of a beam with a tip body; clamped, or pinned with a hub."""

    def shape_of(b: float) -> Shape:
        c = np.linalg.svd(_conditions(np.array([b]), loads, hub)[0])[2][-1]
        slope = 0.0 if hub is None else b * float(_basis(b, 0.0, 1) @ c)

        def shape(x: Array, order: int) -> Array:
            tangent = (slope * x, slope, 0.0)[order]
            return (b**order * (_basis(b, x, order) @ c) - tangent) / size

        size = 1.0
        w = shape(np.linspace(0.0, 1.0, 201), 0)
        size = float(w[np.argmax(np.abs(w))])
        return shape

    bare = _conditions(np.array([_LEAST]), (0.0, 0.0, 0.0), None if hub is None else 0.0)
    before = float(np.linalg.det(bare)[0])
    roots = _roots(lambda b: np.linalg.det(_conditions(b, loads, hub)), count, before)
    return [(b, shape_of(b)) for b in roots]


def torsion_modes(count: int, J: float) -> list[tuple[float, Shape]]:
    """The first roots and shapes of a clamped bar with a polar inertia J at its tip."""

    def shape_of(b: float) -> Shape:
        return lambda x, order: b**order * (np.cos(b * x) if order else np.sin(b * x)) / np.sin(b)

    return [
        (b, shape_of(b)) for b in _roots(lambda b: np.cos(b) - J * b * np.sin(b), count, 1.0, 1e-9)
    ]


def _roots(
    function: Callable[[Array], Array], count: int, before: float, least: float = _LEAST
) -> list[float]:
    """The first positive roots of a function of b, which has the sign of ``before`` before them."""
    from scipy.optimize import brentq

    b = np.concatenate([np.geomspace(least, 0.5, 200), np.arange(0.51, np.pi * (count + 2), 0.01)])
    signs = np.sign(function(b))

    def at(x: float) -> float:
        return float(function(np.array([x]))[0])

    changes = np.flatnonzero(signs[1:] != signs[:-1])[:count]
    if count and (len(changes) < count or signs[0] != np.sign(before)):
        raise InvalidValueError(
            "tip, hub, density: not all modes were found, because the beam is too light for its "
            "loads. Take a greater density or radius of gyration."
        )
    return [float(brentq(at, b[i], b[i + 1], xtol=1e-20)) for i in changes]  # type: ignore[arg-type]

"""Flexible links: the shapes of their modes and the integrals over their mass (7.2.2.12).

A point X of the link is displaced by ``Phi_k(X) e_k``, in the axes of the frame at the root, which
the link is clamped to. With foreshortening ``Gamma_kl(X) e_k e_l / 2`` is added (stiffening).

Parameters
----------
invariants : Invariants
    The integrals of section 7.2.2.
frequencies : ndarray, shape (m,)
    Of the modes, rad/s: clamped at the root, or with a free joint for ``"pinned-hub"``.
tip : Section
    Section to which the next body is fixed.
nodes, shapes : ndarray, shape (N, 3) and (N, 3, m)
    Undeformed points from root to tip, m, and their displacements by the modes.
stiffening : bool
    Whether foreshortening is part of the model.
source : BeamData or None
    The uniform beam.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import Array, Frozen, Value


@dataclass(frozen=True, slots=True, eq=False)
class Section(Frozen, Value):
    """Undeformed position of the tip section, displacement and rotation of it by the modes.

    Shapes: position (3,), Phi, Psi (m, 3), Gamma (m, m, 3).
    """

    position: Array
    Phi: Array
    Psi: Array
    Gamma: Array


@dataclass(frozen=True, slots=True, eq=False)
class BeamData(Frozen, Value):
    """The uniform beam that a link is made of, with mass, centre and inertia of its tip body."""

    length: float
    EI: tuple[float, float]
    GJ: float
    density: float
    gyration: float
    tip: tuple[float, Array, Array]
    hub: float
    pose: Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Invariants(Frozen, Value):
    """Integrals over the mass of an elastic body, r = X + Phi e + Gamma e e / 2 (7.2.2.12).

    ``mass``; ``first_moment`` (3,) and ``inertia`` (3, 3) about the root; ``translation, rotation``
    (m, 3), of Phi_k dm and X x Phi_k dm; ``modal_mass, modal_stiffness`` (m, m); ``gyroscopic``
    (m, m, 3), of (Phi_l x Phi_k + X x Gamma_kl) dm; ``inertia_first`` (m, 3, 3), ``inertia_second``
    (m, m, 3, 3), derivatives by e; ``foreshortening`` (m, m, 3), of Gamma_kl dm. SI units.
    """

    mass: float
    first_moment: Array
    inertia: Array
    translation: Array
    rotation: Array
    modal_mass: Array
    modal_stiffness: Array
    gyroscopic: Array
    inertia_first: Array
    inertia_second: Array
    foreshortening: Array

    @property
    def m(self) -> int:
        """Number of modes."""
        return len(self.modal_mass)


@dataclass(frozen=True, slots=True, eq=False)
class FlexibleLink(Frozen, Value):
    """An elastic body clamped to the frame at its root, made by `beam` or `from_modes`."""

    invariants: Invariants
    frequencies: Array
    tip: Section
    nodes: Array
    shapes: Array
    stiffening: bool = False
    source: BeamData | None = None

    @property
    def m(self) -> int:
        """Number of modes."""
        return self.invariants.m

    @property
    def length(self) -> float:
        """Distance from the root to the tip, m."""
        return float(np.linalg.norm(self.tip.position - self.nodes[0]))

    def __repr__(self) -> str:
        modes = ", ".join(f"{w:.4g}" for w in self.frequencies[:6])
        return f"<FlexibleLink: {self.invariants.mass:g} kg, {self.m} modes, rad/s: {modes}>"


def integrals(W: Array, X: Array, Phi: Array, Gamma: Array, stiffness: Array) -> Invariants:
    """Invariants of points with the masses W, or of fields between them (W a matrix).

    Shapes: W (N,) or (N, N), X (N, 3), Phi (N, 3, m), Gamma (N, 3, m, m), stiffness (m, m).
    """
    W = np.diag(W) if W.ndim == 1 else W
    total = W.sum(axis=0)
    XX, XP, XG = (np.tensordot(X, np.tensordot(W, b, 1), (0, 0)) for b in (X, Phi, Gamma))
    PP = np.tensordot(Phi, np.tensordot(W, Phi, 1), (0, 0))  # (3, m, 3, m)

    def inertia(S: Array) -> Array:  # of second moments S (..., 3, 3)
        S = 0.5 * (S + np.swapaxes(S, -1, -2))
        return np.trace(S, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - S

    a, b = [1, 2, 0], [2, 0, 1]  # components of vector products
    cross = np.stack([PP[i, :, j].T - PP[j, :, i].T for i, j in zip(a, b, strict=True)], -1)
    return Invariants(
        mass=float(total.sum()),
        first_moment=total @ X,
        inertia=inertia(XX),
        translation=np.tensordot(total, Phi, 1).T,
        rotation=(XP[a, b] - XP[b, a]).T,
        modal_mass=np.einsum("ikil->kl", PP),
        modal_stiffness=stiffness,
        gyroscopic=cross + np.moveaxis(XG[a, b] - XG[b, a], 0, -1),
        inertia_first=2.0 * inertia(np.moveaxis(XP, 2, 0)),
        inertia_second=2.0 * inertia(PP.transpose(1, 3, 0, 2) + np.moveaxis(XG, (2, 3), (0, 1))),
        foreshortening=np.moveaxis(np.tensordot(total, Gamma, 1), 0, -1),
    )

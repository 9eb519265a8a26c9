"""Friction that falls as a joint starts to move."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..errors import InvalidValueError
from .joint import JointFriction


@dataclass(frozen=True, slots=True, init=False, eq=False)
class StribeckFriction(JointFriction):
    """Friction that falls from its static value as the joint starts to move.

    ``tau = Fv v + (Fc + (Fs - Fc) exp(-|v / vs|^exponent)) sign(v)``, linear in Fv, Fc and Fs for
    given ``vs`` and ``exponent``.

    Parameters
    ----------
    Fv, Fc, Fs : array_like, shape (n,)
        Viscous, Coulomb and static friction, ``Fv >= 0`` and ``Fs >= Fc >= 0``.
    vs : array_like, shape (n,)
        Stribeck velocity, positive, rad/s or m/s.
    exponent : array_like, shape (n,), optional
        Positive, default 2 for every joint.

    Raises
    ------
    ShapeError, InvalidValueError
        Lengths that differ; NaN or infinity; a velocity or exponent that is not positive; friction
        that drives its joint, or is less at rest than in motion.

    References
    ----------
    Seed book section 1.5.1.4; B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, "A survey of
    models, analysis tools and compensation methods for the control of machines with friction",
    Automatica 30(7), 1994, section 2.

    Examples
    --------
    >>> slide = StribeckFriction(Fv=[0.0], Fc=[1.0], Fs=[1.5], vs=[0.01])
    >>> slide.torque([[1e-9], [1.0]]).ravel()
    array([1.5, 1. ])
    """

    kinds: ClassVar[tuple[str, ...]] = ("Fv", "Fc", "Fs")
    Fv: Array
    Fc: Array
    Fs: Array
    vs: Array
    exponent: Array

    def __init__(
        self,
        Fv: ArrayLike,
        Fc: ArrayLike,
        Fs: ArrayLike,
        vs: ArrayLike,
        exponent: ArrayLike | None = None,
    ) -> None:
        power = np.full(np.shape(vs), 2.0) if exponent is None else exponent
        self._set(Fv=Fv, Fc=Fc, Fs=Fs, vs=vs, exponent=power)
        for name in ("vs", "exponent"):
            values = getattr(self, name)
            if (values <= 0.0).any():
                raise InvalidValueError(f"{name}: expected positive numbers, got {values.min()}.")
        advice = (
            "Identified values that are noise about zero are set to zero; ViscousFriction and "
            "CoulombFriction take any numbers."
        )
        for name in ("Fv", "Fc"):
            for j in np.flatnonzero(getattr(self, name) < 0.0)[:1]:
                raise InvalidValueError(
                    f"{name}: friction of joint {j + 1} is negative ({getattr(self, name)[j]:g}), "
                    f"so that it would drive the joint. {advice}"
                )
        for j in np.flatnonzero(self.Fs < self.Fc)[:1]:
            raise InvalidValueError(
                f"Fs: static friction of joint {j + 1} ({self.Fs[j]:g}) is less than its Coulomb "
                f"friction Fc ({self.Fc[j]:g}), where Stribeck's curve falls from Fs to Fc. "
                f"Exchange them if they are in the wrong order. {advice}"
            )

    def basis(self, v: ArrayLike) -> Array:
        """Torque per unit of each parameter, see `LinearFriction`."""
        v = as_vector(v, self.n, "v")
        with np.errstate(over="ignore", under="ignore"):  # far from vs nothing of it is left
            fallen = np.exp(-((np.abs(v) / self.vs) ** self.exponent))
        sign = np.sign(v)
        return np.stack([v, (1.0 - fallen) * sign, fallen * sign], axis=-2)

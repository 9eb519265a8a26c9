"""Environments: elastic walls that push, slide and rub."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Value, as_core, as_exact, as_number, batch_shape, read_only
from ..errors import InvalidValueError


@dataclass(frozen=True, slots=True, eq=False)
class SpringWall(Value):
    """An elastic wall: the wrench that a tool exerts on it, as a function of its motion.

    The tool point pushes with ``stiffness depth + damping depth'``, never pulls unless the wall is
    bilateral, and rubs with Coulomb friction ``friction |push|`` along its sliding velocity,
    smoothed below `slip`. A tool is a point: there are no moments.

    Parameters
    ----------
    point, normal : array_like, shape (3,)
        Point of the undeformed surface in the world, m; direction to the free side, of any length.
    stiffness, damping, friction : float
        N/m, N s/m, and the coefficient of dry friction.
    bilateral : bool
        Whether it holds the tool on both sides: a spring.
    slip : float
        Sliding velocity below which friction is smoothed, m/s.

    Raises
    ------
    ShapeError, InvalidValueError
        A normal of length zero, a stiffness that is not positive, negative damping or friction.

    References
    ----------
    Seed book section 5.3.1.

    Examples
    --------
    >>> wall = SpringWall([0.5, 0.0, 0.0], normal=[-1.0, 0.0, 0.0], stiffness=1e4)
    >>> tool = np.eye(4)
    >>> tool[0, 3] = 0.501
    >>> wall(0.0, tool, np.zeros(6)).round(9)[:3]
    array([10.,  0.,  0.])
    """

    point: Array
    normal: Array
    stiffness: float
    damping: float = 0.0
    friction: float = 0.0
    bilateral: bool = False
    slip: float = 1e-3

    def __post_init__(self) -> None:
        normal = as_exact(self.normal, (3,), "normal")
        if not normal.any():
            raise InvalidValueError("normal: expected a vector that is not zero.")
        normal = normal / np.abs(normal).max()
        for bound, names in (("above", ("stiffness", "slip")), ("least", ("damping", "friction"))):
            for name in names:
                object.__setattr__(self, name, as_number(getattr(self, name), name, **{bound: 0.0}))
        if not isinstance(self.bilateral, (bool, np.bool_)):
            raise InvalidValueError(
                f"bilateral: expected True or False, got {self.bilateral!r:.40}."
            )
        object.__setattr__(self, "point", read_only(as_exact(self.point, (3,), "point")))
        object.__setattr__(self, "normal", read_only(normal / np.linalg.norm(normal)))

    def __call__(self, t: float, T: ArrayLike, twist: ArrayLike) -> Array:
        """Wrench (..., 6) on the wall, world axes, for poses (..., 4, 4) and twists (..., 6)."""
        T, twist = as_core(T, (4, 4), "T"), as_core(twist, (6,), "twist")
        wrench = np.zeros((*batch_shape((T[..., 0], twist), ("T", "twist")), 6))
        depth, v = self.depth(T), twist[..., :3]
        away = v @ self.normal
        push = self.stiffness * depth - self.damping * away
        if not self.bilateral:
            push = np.where(depth > 0.0, np.maximum(push, 0.0), 0.0)
        wrench[..., :3] = -push[..., None] * self.normal
        if self.friction:
            sliding = v - away[..., None] * self.normal
            speed = np.sqrt((sliding * sliding).sum(axis=-1) + self.slip**2)
            drag = self.friction * np.abs(push) / speed
            wrench[..., :3] += drag[..., None] * sliding
        return wrench

    def depth(self, T: ArrayLike) -> Array:
        """Depth of the tool point in the wall, m, negative on the free side, shape (...)."""
        return -(as_core(T, (4, 4), "T")[..., :3, 3] - self.point) @ self.normal

"""Gravity compensators: springs and hydraulic cylinders beside a joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Value, as_each, as_floats, as_vector, read_only
from ..errors import InvalidValueError, ShapeError
from .protocols import Summable


@dataclass(frozen=True, slots=True, eq=False)
class GravityCompensator(Summable, Value):
    """Spring or hydraulic cylinder beside revolute joints: torque as a function of their angle.

    With known geometry it pulls a point of the link before the joint, at distance ``a`` from the
    axis, and a point of the link behind it, at distance ``b``, together with the force
    ``Kc l + Pc``; both are in line with the axis, on the same side of it, at ``q = phi``, and
    ``l(q) = sqrt(a^2 + b^2 - 2 a b cos(q - phi))``. A spring of stiffness k and free length l0 has
    ``Kc = k, Pc = -k l0``; a cylinder with an accumulator, of force F0 at the length l1,
    ``Kc = k, Pc = F0 - k l1``. The joint needs ``tau = (Kc l + Pc) dl/dq``. Without geometry it is
    a Fourier series: ``tau = Gs sin(q) + Gc cos(q) + Gss sin(2 q) + Gcc cos(2 q)``.

    It dissipates no energy. Base parameters regroup ``Kc``, ``Gs`` and ``Gc`` into the first
    moments of a link that gravity turns in the same way.

    Parameters
    ----------
    n : int
        Number of joints of the robot.
    joints : int or array_like of int, shape (k,)
        Numbers 1..n of the revolute joints that have one; parameters of the others have no effect.
    a, b, phi : array_like, scalar or shape (k,), optional
        Geometry of each: distances in metres, positive, and angle in rad; all three or none.
    values : array_like, shape (m,) or (m, k), optional
        ``Kc`` (N/m) and ``Pc`` (N) with geometry, the four amplitudes (N m) without; default zeros,
        as for a model that is to be identified.

    Examples
    --------
    >>> spring = GravityCompensator(n=2, joints=2, a=0.3, b=0.4, phi=0.0, values=[1000.0, 0.0])
    >>> spring.torque([0.0, 0.0], q=[0.0, np.pi / 2]).round(9)
    array([  0., 120.])
    """

    needs_position: ClassVar[bool] = True
    n: int
    joints: Any
    a: Any = None
    b: Any = None
    phi: Any = None
    values: Any = None

    def __post_init__(self) -> None:
        numbers = np.atleast_1d(as_floats(self.joints, "joints"))
        outside = ~np.isin(numbers, np.arange(1, self.n + 1))
        if numbers.ndim != 1 or outside.any() or np.unique(numbers).size != numbers.size:
            raise InvalidValueError(
                f"joints: expected different numbers from 1 to {self.n}, got {self.joints!r:.60}."
            )
        k, m = numbers.size, len(self.kinds)
        set_ = object.__setattr__
        set_(self, "n", int(self.n))
        set_(self, "joints", read_only(numbers, np.int64))
        geometry = {name: getattr(self, name) for name in ("a", "b", "phi")}
        if len({value is None for value in geometry.values()}) > 1:
            raise InvalidValueError(
                "a, b, phi: expected all three, or none where the geometry is not known."
            )
        for name, value in geometry.items() if self.a is not None else ():
            above = -np.inf if name == "phi" else 0.0
            set_(self, name, read_only(as_each(value, k, name, above=above, finite=True)))
        rows = np.zeros(m) if self.values is None else as_floats(self.values, "values")
        if rows.shape not in ((m,), (m, k)):
            raise ShapeError(f"values: expected shape ({m},) or ({m}, {k}), got {rows.shape}.")
        set_(self, "values", read_only(np.broadcast_to(rows.reshape(m, -1), (m, k))))

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of a joint's parameters."""
        return ("Gs", "Gc", "Gss", "Gcc") if self.a is None else ("Kc", "Pc")

    @property
    def parameters(self) -> Array:
        """Values of the parameters that the torque is linear in, shape (m, n)."""
        return self._of_all(self.values)

    def basis(self, v: ArrayLike, q: ArrayLike | None = None) -> Array:
        """Torque per unit of each parameter of its joint at states (..., n), shape (..., m, n)."""
        if q is None:
            raise InvalidValueError(
                "q: the torque of a gravity compensator depends on the joint variables; give them "
                "beside the velocities."
            )
        v, q = np.broadcast_arrays(as_vector(v, self.n, "v"), as_vector(q, self.n, "q"))
        x = q[..., self.joints - 1]
        if self.a is None:
            return self._of_all(np.stack([np.sin(x), np.cos(x), np.sin(2 * x), np.cos(2 * x)], -2))
        x = x - self.phi
        slope = self.a * self.b * np.sin(x)
        length = np.sqrt((self.a - self.b) ** 2 + 4 * self.a * self.b * np.sin(x / 2) ** 2)
        rate = np.divide(slope, length, out=np.zeros_like(slope), where=length > 0.0)
        return self._of_all(np.stack([slope, rate], -2))

    def torque(self, v: ArrayLike, q: ArrayLike | None = None) -> Array:
        """Joint torque that balances the compensators at states (..., n)."""
        return (self.basis(v, q) * self.parameters).sum(axis=-2)

    def _of_all(self, columns: Array) -> Array:
        """Columns (..., k) of the joints that have one as columns (..., n) of all joints."""
        out = np.zeros((*columns.shape[:-1], self.n))
        out[..., self.joints - 1] = columns
        return out

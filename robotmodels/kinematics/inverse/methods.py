"""Inverses of the Jacobian near singular positions: pseudo-inverse, filtered or damped.

All of them solve ``A y = b`` with the Jacobian ``A`` and the twist ``b`` made comparable: linear
rows divided by a characteristic length, columns by the square roots of the joints' weights. The
singular values of ``A`` are then numbers of order one: ``1 / sigma`` is the speed of the joints
[rad/s] that a turn of 1 rad/s, or a motion of one length per second, takes in that direction.

Attributes
----------
gain : float
    Largest joint speed per speed of the twist, both comparable.

Examples
--------
>>> PseudoInverse().gain, FilteredInverse(0.05).gain
(inf, 22.5)
>>> DampedInverse(damping=Damping.CONSTANT, largest=0.05).gain
10.0
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import inf, sqrt

from ..._arrays import as_number
from ..._choices import chosen
from ...errors import InvalidValueError

THRESHOLD = 0.003
"""Default singular value below which a direction counts as weak: some 3 deg from the singular
positions of an industrial arm, one random configuration in thirty. At it, the joints turn at 300
rad/s for one length of the robot per second, at 20 rad/s for some centimetres per second."""

LARGEST_DAMPING = 0.0021
"""Default damping at a singular position: the gain is then nearly the least for the threshold."""


class Damping(Enum):
    """Choice of the damped directions."""

    WEAK_DIRECTIONS = "each direction whose singular value is below the threshold, by its own"
    SMALLEST_SINGULAR_VALUE = "all directions, by the smallest singular value"
    MANIPULABILITY = "all directions, by the product of the singular values"
    CONSTANT = "all directions, always"


_KINDS = (Damping.CONSTANT, Damping.WEAK_DIRECTIONS, Damping.SMALLEST_SINGULAR_VALUE,
          Damping.MANIPULABILITY)  # fmt: skip
_FIRST_KIND = 2


@dataclass(frozen=True, slots=True)
class PseudoInverse:
    """The regular solution: exact, of least weighted norm, unbounded near singular positions.

    Singular values up to ``tolerance``, relative to the largest, in [0, 1), count as zero: their
    directions are left out. Book sections 1.3.2.1 and 1.3.2.4.
    """

    tolerance: float = 1e-10

    def __post_init__(self) -> None:
        _set(self, "tolerance", least=0.0, below=1.0)

    @property
    def gain(self) -> float:
        """Infinite."""
        return inf

    @property
    def kernel_arguments(self) -> tuple[int, float, float, float]:
        """Kind, threshold, largest damping and largest speed."""
        return 0, self.tolerance, 0.0, inf


@dataclass(frozen=True, slots=True)
class FilteredInverse:
    """Singular value filtering: the inverse of a small singular value fades out.

    ``1 / sigma`` above the threshold e, ``s (3 - 2 s) / e`` with ``s = sigma / e`` below: the same
    value and slope at the threshold, 0 at a singular position. Book section 1.3.2.2;
    A. A. Maciejewski and C. A. Klein 1988.
    """

    threshold: float = THRESHOLD

    def __post_init__(self) -> None:
        _set(self, "threshold", above=0.0)

    @property
    def gain(self) -> float:
        """``9 / (8 threshold)``."""
        return 1.125 / self.threshold

    @property
    def kernel_arguments(self) -> tuple[int, float, float, float]:
        """Kind, threshold, largest damping and largest speed."""
        return 1, self.threshold, 0.0, inf


@dataclass(frozen=True, slots=True)
class DampedInverse:
    """Damped least squares: ``sigma / (sigma^2 + lambda^2)`` in place of ``1 / sigma``.

    Book section 1.3.2.2; Y. Nakamura and H. Hanafusa 1986 (manipulability), A. A. Maciejewski
    and C. A. Klein 1988 (weak directions), S. Chiaverini 1997 (smallest singular value), A. S. Deo
    and I. D. Walker 1993 (bounded speed).

    Parameters
    ----------
    threshold : float
        Singular value e below which damping sets in (for MANIPULABILITY the product w of them);
        not used by CONSTANT.
    largest : float
        Damping ``lambda`` at a singular position; ``lambda^2 = largest^2 (1 - (sigma / e)^2)``
        below the threshold, ``lambda = largest (1 - w / e)`` for MANIPULABILITY.
    damping : Damping
        Which directions are damped. The default leaves all above the threshold exact.
    largest_speed : float, optional
        Bound on the weighted norm of the task's part of ``v`` [rad/s],
        ``sqrt(sum(joint_weights v^2))``: where needed the least further damping is added.
    """

    threshold: float = THRESHOLD
    largest: float = LARGEST_DAMPING
    damping: Damping = Damping.WEAK_DIRECTIONS
    largest_speed: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "damping", chosen(Damping, self.damping, "damping"))
        by_product = self.damping is Damping.MANIPULABILITY
        _set(self, "threshold", **{"above" if by_product else "least": 0.0})
        _set(self, "largest", least=0.0)
        if self.largest_speed is not None:
            _set(self, "largest_speed", above=0.0)

    @property
    def gain(self) -> float:
        """The gain by the damping; infinite where that may vanish beside a singular position."""
        if self.damping is Damping.MANIPULABILITY or self.largest == 0.0:
            return inf
        if self.damping is Damping.CONSTANT:
            return 0.5 / self.largest
        if self.threshold == 0.0:
            return inf
        # s / (s^2 + r^2 (1 - s^2)) for s in [0, 1] is largest at s^2 = r^2 / (1 - r^2), or at 1
        r = self.largest / self.threshold
        if r * r >= 0.5:
            return 1.0 / self.threshold
        return 0.5 / (self.largest * sqrt(1.0 - r * r))

    @property
    def kernel_arguments(self) -> tuple[int, float, float, float]:
        """Kind, threshold, largest damping and largest speed."""
        speed = inf if self.largest_speed is None else self.largest_speed
        return _FIRST_KIND + _KINDS.index(self.damping), self.threshold, self.largest, speed


InverseMethod = PseudoInverse | FilteredInverse | DampedInverse


def as_method(method: InverseMethod | None) -> InverseMethod:
    """The method requested; None is `DampedInverse` with its defaults."""
    if method is None:
        return _DEFAULT
    if not isinstance(method, InverseMethod):
        raise InvalidValueError(
            "method: expected a PseudoInverse, FilteredInverse or DampedInverse, got "
            f"{method!r:.80}; a class needs its parentheses, DampedInverse()."
        )
    return method


def _set(method: object, name: str, **bounds: float) -> None:
    """Replace a field by a finite number within bounds."""
    object.__setattr__(method, name, as_number(getattr(method, name), name, **bounds))


_DEFAULT = DampedInverse()

"""Manipulability of a whole twist or some of its components: one number, and ratios along twists.

The six-dimensional ellipsoids as numbers; `velocity_ellipsoid` and `force_ellipsoid` are their
three-dimensional halves, which can be drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, Value, as_core, as_mask, as_number, as_vector, batch_shape
from ..errors import InvalidValueError
from ..model import RobotModel, check_model
from .ellipsoids import joint_scale
from .jacobians import COMPONENTS, Reference, complete_svd, jacobian
from .lengths import length_of

_ON = 1e-9


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Manipulability(Frozen, Value):
    """Manipulability of m components of the twist. Read-only.

    Parameters
    ----------
    singular_values : ndarray, shape (..., m)
        Of the weighted Jacobian, largest first; zero beyond the rank.
    rank : ndarray of int64, shape (...)
        Number of singular values above 0.
    jacobian : ndarray, shape (..., m, n)
        Rows of the components times the joint velocities of the ball, m/s and rad/s.
    weights : ndarray, shape (m,)
        What the rows were multiplied by to be comparable: 1 / length for linear ones next to
        angular ones, else 1.
    """

    singular_values: Array
    rank: NDArray[np.int64]
    jacobian: Array
    weights: Array

    @property
    def measure(self) -> Array:
        """Product of the k = min(m, n) singular values that can be, shape (...); 0 where rank < k.

        Yoshikawa's manipulability ``sqrt(det(J J^T))``, or ``sqrt(det(J^T J))`` with fewer joints
        than components, of the rows times ``weights``.
        """
        return np.asarray(self._possible.prod(axis=-1))

    @property
    def condition(self) -> Array:
        """Largest singular value over the k-th, shape (...), k as for `measure`.

        Infinite where rank < k, NaN without joints. It depends on the length that makes metres
        comparable with radians.
        """
        s = self._possible
        if not s.shape[-1]:
            return np.full(s.shape[:-1], np.nan)
        last = s[..., -1]
        return np.divide(s[..., 0], last, out=np.full(last.shape, np.inf), where=last > 0)

    @property
    def _possible(self) -> Array:
        """The singular values that are not zero only because joints are fewer than components."""
        return self.singular_values[..., : min(self.jacobian.shape[-2:])]

    def velocity_transmission(self, twist: ArrayLike) -> Array:
        """Largest multiple (...) of a twist (..., m) that joint velocities of the ball give.

        ``1 / sqrt(x^T (J J^T)^-1 x)`` with x in m/s and rad/s; 0 for a twist that cannot be.
        Components that were masked out may be anything. S. L. Chiu, "Task compatibility of
        manipulator postures", International Journal of Robotics Research 7(5), 1988.
        """
        x = self._component_vector(twist, "twist") * self.weights
        U, s = self._left()
        along = np.einsum("...ik,...i->...k", U, x)
        moves = s > 0
        v = np.divide(along, s, out=np.zeros_like(along), where=moves)
        outside = np.linalg.norm(np.where(moves, 0.0, along), axis=-1)
        possible = outside <= _ON * np.linalg.norm(x, axis=-1)
        size = np.linalg.norm(v, axis=-1)
        return np.divide(1.0, size, out=np.zeros_like(size), where=possible & (size > 0))

    def force_transmission(self, wrench: ArrayLike) -> Array:
        """Largest multiple (...) of a wrench (..., m) that the dual ball of torques balances.

        ``1 / sqrt(w^T J J^T w)``, w in N and N m, for torques with ``sum_i (s_i tau_i)^2 <= 1``,
        s_i the joint velocities of the ball; infinity for a wrench that the structure carries. Chiu
        1988.
        """
        w = self._component_vector(wrench, "wrench") / self.weights
        U, s = self._left()
        tau = s * np.einsum("...ik,...i->...k", U, w)
        size = np.linalg.norm(tau, axis=-1)
        felt = size > _ON * np.linalg.norm(w, axis=-1) * s[..., 0]
        return np.divide(1.0, size, out=np.full(size.shape, np.inf), where=felt)

    def _left(self) -> tuple[Array, Array]:
        """Left singular vectors (..., m, m) and the singular values of the weighted Jacobian."""
        return complete_svd(self.weights[:, None] * self.jacobian)[0], self.singular_values

    def _component_vector(self, value: ArrayLike, name: str) -> Array:
        x = as_core(value, self.weights.shape, name)
        batch_shape((x, self.singular_values), (name, "manipulability"))
        if (np.abs(x).max(axis=-1, initial=0.0) == 0).any():
            raise InvalidValueError(f"{name}: expected a direction, got zeros.")
        return x


def manipulability(
    model: RobotModel,
    q: ArrayLike,
    frame: str | int | None = None,
    reference: Reference = "world_aligned",
    mask: ArrayLike | str | None = None,
    joint_velocity: ArrayLike | None = None,
    length: float = 1.0,
    tolerance: float = 1e-9,
) -> Manipulability:
    """Singular values, Yoshikawa's measure and condition of the Jacobian.

    Khalil and Dombre, sections 5.8.1 and 5.8.2; T. Yoshikawa, "Manipulability of robotic
    mechanisms", International Journal of Robotics Research 4(2), 1985.

    Parameters
    ----------
    joint_velocity : array_like, shape (n,), optional
        Half axes of the ball of joint velocities (rad/s, m/s), as in `velocity_ellipsoid`.
    length : float
        Metres that count as much as a radian where both kinds of row are requested. The default
        of 1 m is the measure of most books; the size of the robot makes a fairer condition.
    tolerance : float
        Singular values below this part of the size of the whole Jacobian are zero.

    Examples
    --------
    A planar arm of two links: ``l1 l2 |sin q2|``.

    >>> from robotmodels.geometry import DHTable
    >>> from robotmodels.se3 import translation
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]),
    ...                             tool=translation(0.2, 0, 0))
    >>> found = manipulability(arm, [0.0, np.pi / 6], mask=[1, 1, 0, 0, 0, 0])
    >>> found.measure.round(12)
    np.float64(0.03)
    """
    check_model(model)
    rows = as_mask(mask, COMPONENTS)
    own = length_of(model, frame, None)
    relative = as_number(tolerance, "tolerance", above=0.0, below=1.0)
    scale = joint_scale(model, joint_velocity, "joint_velocity", 0.0)
    J = jacobian(model, as_vector(q, model.n, "q"), frame, reference) * scale
    size = np.linalg.norm(J[..., :3, :], axis=(-2, -1)) / own
    size = size + np.linalg.norm(J[..., 3:, :], axis=(-2, -1))
    mixed = rows[:3].any() and rows[3:].any()
    weights = np.repeat((1.0 / length_of(model, frame, length) if mixed else 1.0, 1.0), 3)
    # the size in the unit of the rows requested
    unit = np.max(np.where(rows, weights * np.repeat((own, 1.0), 3), 0.0))
    J, weights = J[..., rows, :], weights[rows]
    s = complete_svd(weights[:, None] * J)[1]
    s = np.where(s > relative * unit * size[..., None], s, 0.0)
    return Manipulability(s, (s > 0).sum(axis=-1), J, weights)

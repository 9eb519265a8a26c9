"""Links that bend and a mount that tilts under gravity: compliance that no joint variable holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Rebuilt, as_exact, read_only
from ..extended_table.elements import Element, ErrorLaw
from ..extended_table.loads import gravity_loads
from ..extended_table.parameters import GeometricParameter, GeometricParameters
from ..extended_table.skeleton import Skeleton

_OWN = (Element.THETA, Element.R, None)  # of sigma 0, 1, 2
_DIFFERENCE = 1e-4  # rad or m: of loads, whose slope only leads Newton's steps


@dataclass(frozen=True, slots=True, eq=False)
class Bending(Rebuilt):
    """How far elements of the extended table give way where the joints read ``q_read``.

    ``element += compliance * load(q_read)``, with the gravity loads of the nominal robot.

    Parameters
    ----------
    skeleton : Skeleton
        The nominal extended table, R rows.
    elements : ndarray, shape (R, 7)
        Its elements with the constant deviations, rad and m.
    row, element, source : ndarray of int, shape (B,)
        What gives way, and the row that all the load hangs on.
    compliance : ndarray, shape (B,)
        rad or m, per N m or N.

    References
    ----------
    Seed book section 1.4.2; 1.5.1.1 for the loads.

    Examples
    --------
    >>> import numpy as np
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("erd:ur10"), compliance="links")
    >>> soft = 1e-6 * (np.array(parameters.names) == "compliance_beta3")
    >>> bending = bending_of(parameters, parameters.skeleton.nominal, soft)
    >>> bending.row, bending.given_way(np.zeros((1, 6))).shape
    (array([3]), (1, 1))
    """

    skeleton: Skeleton
    elements: Array
    row: NDArray[np.int64]
    element: NDArray[np.int64]
    source: NDArray[np.int64]
    compliance: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "elements", read_only(self.elements))
        object.__setattr__(self, "compliance", read_only(self.compliance))
        for name in ("row", "element", "source"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.int64))

    @property
    def is_zero(self) -> bool:
        """Whether nothing gives way but the joints about their own axes."""
        return not self.compliance.size

    @property
    def tilts_mount(self) -> bool:
        """Whether the base gives way."""
        return bool((self.row == 0).any())

    @property
    def bent_rows(self) -> tuple[str, ...]:
        """Names of the frames whose place on the link before gives way."""
        rows = sorted({int(row) for row in self.row if row > 0})
        return tuple(self.skeleton.row_name(row) for row in rows)

    def path_to(self, row: int) -> NDArray[np.int64]:
        """Rows from the world to a row of the extended table, the base's (0) first."""
        rows = [row]
        while rows[-1] > 0:
            rows.append(int(self.skeleton.antecedent[rows[-1]]))
        return np.array(rows[::-1], dtype=np.int64)

    def given_way(self, q_read: Array) -> Array:
        """How far each element gives way.

        Parameters
        ----------
        q_read : ndarray, shape (N, n)
            Readings, rad or m.

        Returns
        -------
        ndarray, shape (N, B)
            rad or m.
        """
        bent = [
            (int(row), Element(int(element)), int(source))
            for row, element, source in zip(self.row, self.element, self.source, strict=True)
        ]
        return gravity_loads(self.skeleton, q_read, bent) * self.compliance

    def poses(self, q_read: Array, q: Array, path: NDArray[np.int64], after: Array) -> Array:
        """World poses behind a row.

        Parameters
        ----------
        q_read, q : ndarray, shape (N, n)
            Readings, on which the loads depend, and joint variables, rad or m.
        path : ndarray of int, shape (k,)
            Rows from the world.
        after : ndarray, shape (4, 4)
            Constant pose behind the last of them, metres.

        Returns
        -------
        ndarray, shape (N, 4, 4)
            Metres.
        """
        owner = np.arange(len(self.row))
        actions = owner, self.row, self.element
        ones = np.ones(len(owner))
        return self._recursion(q, path, after, ones, actions, self.given_way(q_read), 0)[0]

    def jacobians(
        self, q_read: Array, q: Array, path: NDArray[np.int64], after: Array
    ) -> tuple[Array, Array]:
        """How what is behind a row moves with the joints, and with the readings through the loads.

        Parameters
        ----------
        q_read, q, path, after
            As for `poses`.

        Returns
        -------
        by_joint : ndarray, shape (N, 6, n)
            ``[v; w]`` per unit of q at constant loads, world axes.
        by_load : ndarray, shape (N, 6, n)
            The same per unit of q_read through the loads alone, which are differentiated by
            central differences.
        """
        skeleton, B = self.skeleton, len(self.row)
        n = skeleton.model.n
        moving = np.flatnonzero(skeleton.joint >= 0)
        own = np.array([_OWN[sigma] for sigma in skeleton.sigma[moving]], dtype=np.int64)
        # what bends is moved as it is bent, and once more by a unit of nothing, for its screw
        owner = np.concatenate([np.arange(2 * B), 2 * B + skeleton.joint[moving]])
        actions = (
            owner,
            np.concatenate([self.row, self.row, moving]),
            np.concatenate([self.element, self.element, own]),
        )
        factor = np.ones((len(q), len(owner)))
        factor[:, :B] = self.given_way(q_read)
        size = np.concatenate([np.ones(B), np.zeros(B + n)])
        screws = self._recursion(q, path, after, size, actions, factor, 2 * B + n)[1]
        steps = _DIFFERENCE * np.eye(n)
        slope = np.empty((len(q), B, n))
        for j in range(n):
            slope[..., j] = self.given_way(q_read + steps[j]) - self.given_way(q_read - steps[j])
        slope /= 2.0 * _DIFFERENCE
        return screws[..., 2 * B :], screws[..., B : 2 * B] @ slope

    def _recursion(
        self,
        q: Array,
        path: NDArray[np.int64],
        after: Array,
        size: Array,
        actions: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]],
        factor: Array,
        columns: int,
    ) -> tuple[Array, Array]:
        from ...kernels.erroneous_poses import erroneous_poses

        skeleton = self.skeleton
        T, screws = np.empty((len(q), 4, 4)), np.empty((len(q), 6, columns))
        erroneous_poses(
            np.ascontiguousarray(q), self.elements, skeleton.sigma, skeleton.joint, path,
            np.ascontiguousarray(skeleton.before[:3, :3]),
            np.ascontiguousarray(skeleton.before[:3, 3]),
            np.ascontiguousarray(after[:3, :3]), np.ascontiguousarray(after[:3, 3]),
            size, *actions, factor, T, screws,
        )  # fmt: skip
        return T, screws


def bends(parameters: GeometricParameters, entry: GeometricParameter) -> bool:
    """Whether a parameter is a compliance that does not add to the variable of its own joint."""
    if entry.law is not ErrorLaw.COMPLIANCE:
        return False
    own = entry.element is _OWN[int(parameters.skeleton.sigma[entry.row])]
    return not (own and entry.moves_own_joint and entry.source == entry.row)


def bending_of(parameters: GeometricParameters, elements: Array, deviation: ArrayLike) -> Bending:
    """The corrections that bend links or tilt the mount.

    Shapes: elements (R, 7), deviation (P,).
    """
    xi = as_exact(deviation, (len(parameters),), "deviation")
    found = [
        (*action, value)
        for entry, value in zip(parameters.entries, xi, strict=True)
        if value != 0.0 and bends(parameters, entry)
        for action in entry.actions
    ]
    where = np.array([action[:3] for action in found], dtype=np.int64).reshape(-1, 3)
    row, element, source = where.T
    compliance = np.array([action[3] for action in found], dtype=np.float64)
    return Bending(parameters.skeleton, elements, row, element, source, compliance)

"""Distance from singular positions, by the volume of the velocity ellipsoid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...._arrays import Array, Rebuilt, as_exact, read_only
from ....errors import InvalidValueError
from ....model import RobotModel
from ...jacobians import Reference, jacobian, jacobian_rate, reference_of
from ..tasks import rows_of
from .criterion import checked_positive

_CHUNK = 512
"""Configurations at a time: each takes n Jacobians."""


@dataclass(frozen=True, slots=True, eq=False)
class ManipulabilityCriterion(Rebuilt):
    """Manipulability ``sqrt(det(J J^T))`` of some rows of the Jacobian; large is good.

    With fewer joints than rows, ``sqrt(det(J^T J))``: the product of the singular values in both
    cases. The gradient is exact, from the derivatives of J, and finite at singular positions too,
    where it points to one of the two sides.

    Parameters
    ----------
    gain : float
        Factor of the gradient.
    frame : str or int, optional
        Name or number of a frame; default the tool.
    reference : {"world_aligned", "local", "world"}
        Axes and point of the rows, as in `jacobian`; it matters where a mask chooses among them.
    mask : array_like, shape (6,), optional
        Ones for the rows that count. Default all.
    length : float
        Metres that count as one radian. It is a constant factor of the value, without any
        influence on the direction of the gradient, unless there are fewer joints than rows.

    Raises
    ------
    ShapeError, InvalidValueError
        No mask, an unknown reference, a gain or a length that is not positive.

    References
    ----------
    Seed book section 1.3.2.4; T. Yoshikawa 1985.

    Examples
    --------
    A planar arm with links of 1 m, ``w = |sin q2|``:

    >>> from robotmodels.robots import load
    >>> criterion = ManipulabilityCriterion(mask=[1, 1, 0, 0, 0, 0])
    >>> criterion.value(load("planar_2r"), [0.3, np.pi / 6])
    array(0.5)
    """

    gain: float = 1.0
    frame: str | int | None = None
    reference: Reference = "world_aligned"
    mask: NDArray[np.bool_] | None = None
    length: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "gain", checked_positive(self.gain, "gain"))
        object.__setattr__(self, "length", checked_positive(self.length, "length"))
        reference_of(self.reference)
        mask = np.ones(6) if self.mask is None else np.asarray(self.mask)
        mask = as_exact(mask.astype(float) if mask.dtype == bool else mask, (6,), "mask")
        if not np.isin(mask, (0.0, 1.0)).all() or not mask.any():
            raise InvalidValueError(
                "mask: expected six zeros or ones for vx vy vz wx wy wz, at least one of them a "
                f"one, got {self.mask!r}."
            )
        object.__setattr__(self, "mask", read_only(mask != 0.0, np.bool_))

    def value(self, model: RobotModel, q: ArrayLike) -> Array:
        """Manipulability, see `Criterion.value`."""
        batch, q, _ = rows_of(model, q)
        values = np.linalg.svd(self._rows(jacobian(model, q, self.frame, self.reference)),
                               compute_uv=False)  # fmt: skip
        return values.prod(axis=-1).reshape(batch)

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Gradient of the manipulability times the gain, see `Criterion.gradient`."""
        batch, q, _ = rows_of(model, q)
        out = np.empty_like(q)
        for first in range(0, len(q), _CHUNK):
            rows = slice(first, first + _CHUNK)
            out[rows] = self._gradients(model, q[rows])
        return self.gain * out.reshape(*batch, model.n)

    def _gradients(self, model: RobotModel, q: Array) -> Array:
        J = self._rows(jacobian(model, q, self.frame, self.reference))
        U, S, Vt = np.linalg.svd(J, full_matrices=False)
        # dw = sum_i (product of the other singular values) u_i . dJ v_i: nothing is divided by
        others = np.ones_like(S)
        for i in range(S.shape[-1]):
            others[:, i] = np.delete(S, i, axis=-1).prod(axis=-1)
        adjugate = np.einsum("kai,ki,kib->kab", U, others, Vt)
        units = np.eye(model.n)
        rates = jacobian_rate(model, q[:, None], units, self.frame, self.reference)
        return np.einsum("kab,kjab->kj", adjugate, self._rows(rates))

    def _rows(self, J: Array) -> Array:
        factors = np.ones(6)
        factors[:3] = 1.0 / self.length
        asked = np.flatnonzero(np.asarray(self.mask))
        return J[..., asked, :] * factors[asked, None]

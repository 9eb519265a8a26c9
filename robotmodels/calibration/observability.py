"""Observability indices of an identification matrix, and sets of candidates that maximise them.

Candidate i brings rows ``R_i`` (k, p); a set has the information ``M = sum R_i^T R_i``, whose
eigenvalues are the squares of the singular values of the identification matrix.

Source of the exchange algorithm: V. V. Fedorov, "Theory of optimal experiments", Academic Press
1972; R. D. Cook, C. J. Nachtsheim, Technometrics 22(3), 1980 (member by member).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, as_count, as_exact, as_floats
from .._arrays.tasks import Workers
from ..errors import InvalidValueError, ShapeError
from .identifiable import IdentifiableParameters

_RANK_TOLERANCE = 1e-14  # a singular value below this part of the largest is zero
_RIDGE = 1e-12  # added to the information, relative, so that sets that are too small compare too
_GAIN = 1e-10
_SWEEPS = 50
_CHUNK = 4096


class Criterion(Enum):
    """The index to maximise; the value is its formula."""

    O1 = "(s_1 ... s_L)^(1/L) / sqrt(m)"
    O2 = "s_L / s_1"
    O3 = "s_L"
    O4 = "s_L^2 / s_1"
    O5 = "1 / (1/s_1 + ... + 1/s_L)"


@dataclass(frozen=True, slots=True, eq=False)
class Observability(Frozen):
    """The five observability indices (`Criterion`), of m configurations; larger is better for all.

    Parameters
    ----------
    o1, o2, o3, o4, o5 : float
        Volume of the ellipsoid of the effects of errors; its inverse condition; its shortest axis,
        the worst combination of parameters; noise amplification index; harmonic mean of the axes
        divided by L.
    singular_values, configurations : ndarray, shape (L,), and int
        Of the scaled matrix, the largest first; m.
    """

    o1: float
    o2: float
    o3: float
    o4: float
    o5: float
    singular_values: Array
    configurations: int

    @property
    def condition(self) -> float:
        """``s_1 / s_L``; infinite if a combination of the parameters is unidentifiable."""
        return 1.0 / self.o2 if self.o2 > 0.0 else np.inf

    def value(self, criterion: Criterion) -> float:
        """Index of a criterion."""
        return float(getattr(self, criterion.name.lower()))

    def __str__(self) -> str:
        return ", ".join(f"{c.name} {self.value(c):.4g}" for c in Criterion) + (
            f" ({len(self.singular_values)} parameters, {self.configurations} configurations)"
        )


def observability(
    psi: ArrayLike | IdentifiableParameters,
    configurations: int | None = None,
    *,
    scales: ArrayLike | None = None,
) -> Observability:
    """Observability indices O1 to O5 of an identification matrix (also: excitation indices).

    Rows of different units should be divided by their standard errors before, and columns be
    comparable: O1 alone orders sets of configurations in the same way in all units.

    Parameters
    ----------
    psi : array_like, shape (m, k, L) or (M, L), or IdentifiableParameters
        Rows of m configurations, k each, or all rows; of identifiable parameters those kept.
    configurations : int, optional
        m; default the first axis of ``psi``.
    scales : array_like, shape (L,), optional
        Sizes of the parameters that count as equal, such as expected errors; default 1.

    Returns
    -------
    Observability
        The indices.

    References
    ----------
    O1: J.-H. Borm, C.-H. Menq, Int. J. Robotics Research 10(1), 1991. O2: M. R. Driels, U. S.
    Pathre, J. Robotic Systems 7(2), 1990. O3, O4: A. Nahvi, J. M. Hollerbach, IEEE ICRA 1996. O5:
    Y. Sun, J. M. Hollerbach, IEEE ICRA 2008. Book section 1.4.4.

    Examples
    --------
    >>> found = observability(np.diag([4.0, 2.0, 1.0]), 1)
    >>> found.o1, found.o2, found.o3, found.o4, round(found.o5, 4)
    (2.0, 0.25, 1.0, 0.25, 0.5714)
    """
    if isinstance(psi, IdentifiableParameters):
        configurations = psi.configurations if configurations is None else configurations
        psi = psi.factor
    W = as_floats(psi, "psi")
    if W.ndim not in (2, 3) or not W.size:
        raise ShapeError(f"psi: expected shape (M, L) or (m, k, L), none of them 0, got {W.shape}.")
    m = as_count(len(W) if configurations is None else configurations, "configurations")
    W = W.reshape(-1, W.shape[-1])
    if scales is not None:
        sizes = as_exact(scales, (W.shape[1],), "scales")
        if not (sizes > 0.0).all():
            raise InvalidValueError("scales: expected positive sizes of the parameters.")
        W = W * sizes
    s, values = np.zeros(W.shape[1]), np.linalg.svd(W, compute_uv=False)
    s[: len(values)] = values
    s[s <= _RANK_TOLERANCE * s[0]] = 0.0
    first, last = float(s[0]), float(s[-1])
    if last <= 0.0:
        return Observability(0.0, 0.0, 0.0, 0.0, 0.0, s, m)
    o1, o5 = float(np.exp(np.log(s).mean()) / np.sqrt(m)), float(1.0 / (1.0 / s).sum())
    return Observability(o1, last / first, last, last**2 / first, o5, s, m)


# --- sets of candidates ---------------------------------------------------------------------------


def index_of(information: Array, criterion: Criterion) -> Array:
    """Logarithm of an observability index up to a constant. Shapes: information (..., p, p)."""
    if criterion is Criterion.O1:
        sign, value = np.linalg.slogdet(information)
        return np.where(sign > 0.0, 0.5 * value / information.shape[-1], -np.inf)
    s = np.sqrt(np.maximum(np.linalg.eigvalsh(information), 1e-300))
    first, last = np.log(s[..., -1]), np.log(s[..., 0])
    if criterion is Criterion.O5:
        return -np.log((1.0 / s).sum(axis=-1))
    return {Criterion.O2: last - first, Criterion.O3: last, Criterion.O4: 2.0 * last - first}[
        criterion
    ]


def added(base: Array, rows: Array, criterion: Criterion) -> Array:
    """Criterion after adding each candidate. Shapes: base (p, p), rows (N, k, p) -> (N,)."""
    N, k, p = rows.shape
    if criterion is Criterion.O1 and k < p:
        # det(M + R^T R) = det(M) det(1 + R M^-1 R^T): small determinants only
        L = np.linalg.cholesky(base)
        Y = np.linalg.solve(L, rows.reshape(-1, p).T).T.reshape(N, k, p)
        gain = np.linalg.slogdet(np.eye(k) + Y @ Y.swapaxes(-1, -2))[1]
        return (np.log(np.diag(L)).sum() + 0.5 * gain) / p
    parts = (rows[a : a + _CHUNK] for a in range(0, N, _CHUNK))
    indices = [index_of(base + R.swapaxes(-1, -2) @ R, criterion) for R in parts]
    return np.concatenate(indices)


def greedy(rows: Array, count: int, criterion: Criterion) -> NDArray[np.int64]:
    """Greedy forward selection of candidates. Shapes: rows (N, k, p) -> (count,)."""
    M = _ridge(rows)
    left = np.ones(len(rows), dtype=bool)
    selected: list[int] = []
    for _ in range(count):
        # with too few rows the worst combination of every set is the ridge: volume decides then
        enough = len(selected) * rows.shape[1] >= rows.shape[-1]
        value = added(M, rows, criterion if enough else Criterion.O1)
        best = int(np.argmax(np.where(left, value, -np.inf)))
        left[best] = False
        selected.append(best)
        M = M + rows[best].T @ rows[best]
    return np.array(selected, dtype=np.int64)


def exchanged(
    rows: Array, start: NDArray[np.int64], criterion: Criterion, work: Workers
) -> NDArray[np.int64]:
    """Swap members while the criterion improves. Shapes: rows (N, k, p), start (c,) -> (c,)."""
    members = np.array(start, dtype=np.int64)
    ridge, count = _ridge(rows), len(members)
    free = np.ones(len(rows), dtype=bool)
    free[members] = False
    value = float(index_of(ridge + information(rows[members]), criterion))
    unchanged, done, total = 0, 0, _SWEEPS * count
    while unchanged < count and done < total:
        k = done % count
        done += 1
        # summed anew: repeated subtraction leaves rounding
        rest = ridge + information(rows[np.delete(members, k)])
        values = np.where(free, added(rest, rows, criterion), -np.inf)
        best = int(np.argmax(values))
        unchanged += 1
        if values[best] > value + _GAIN:
            after = float(index_of(rest + rows[best].T @ rows[best], criterion))
            if after > value + _GAIN:
                free[members[k]], free[best] = True, False
                members[k], value, unchanged = best, after, 0
        work.done(done / total)
    work.done()
    return members


def information(rows: Array) -> Array:
    """Information matrix of a set. Shapes: rows (c, k, p) -> (p, p)."""
    R = rows.reshape(-1, rows.shape[-1])
    return R.T @ R


def _ridge(rows: Array) -> Array:
    """A small multiple of the identity beside the mean information of a candidate."""
    p = rows.shape[-1]
    size = float((rows**2).sum()) / max(len(rows), 1) / p
    return (_RIDGE * size or 1e-300) * np.eye(p)

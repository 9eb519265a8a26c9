"""Rank of the Jacobian and dimension of the operational space of a robot.

Book section 1.3.1.4. The number of degrees of freedom of the tool is the rank of its
Jacobian: the local one at a configuration, the global one M at almost all of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Frozen, Value, as_count, as_floats, as_number, as_vector
from ...model import RobotModel
from ..jacobians import COMPONENTS, jacobian
from ..lengths import spread_configurations
from .task import (
    MaskAxes,
    SingularTask,
    generator_of,
    singular_task,
    task_jacobians,
)

TOLERANCE = 1e-9
"""Singular values below this fraction of the largest are zero."""

_MOST_CHOICES = 2000


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class JacobianRank(Frozen, Value):
    """Ranks of the Jacobians of one call. Read-only.

    Parameters
    ----------
    rank : ndarray of int, shape (...)
        Local number of degrees of freedom.
    singular_values : ndarray, shape (..., k)
        Descending, k the smaller of the number of components and n; no unit.
    gap : ndarray, shape (...)
        Smallest singular value that counts over the largest that does not, a measure of how clear
        the decision is; infinite if none is left, or if it is exactly zero.
    length : float
        Characteristic length, metres.
    tolerance : float
        Fraction of the largest singular value below which one is zero.
    """

    rank: NDArray[np.int64]
    singular_values: Array
    gap: Array
    length: float
    tolerance: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class OperationalDimension(Frozen, Value):
    """Number of independent motions of a frame of a robot. Read-only.

    Parameters
    ----------
    dimension : int
        Global rank M: dimension of the operational space, global number of degrees of freedom.
    position_dimension, orientation_dimension : int
        Of the velocity of the origin alone, and of the angular velocity alone (within the mask).
    joints : int
        Joints between the base and the frame.
    redundancy : int
        ``joints - M``, order of redundancy.
    singular_values : ndarray, shape (k,)
        The largest found of each, relative to the first at its configuration: those beyond M
        are rounding, and a small one among the first M is a weak freedom.
    gap : float
        The M-th of them over the next; infinite if there is none.
    missing_in_world, missing_in_frame : ndarray, shape (k, 6)
        Combinations of the twist that no configuration can produce, at the frame's origin in world
        axes and in the frame's own: rows ``c`` with ``c . [v; w] = 0`` whatever the joints do, a
        basis with many zeros, largest entry 1; as wrenches ``[f; m]`` they need no torque. Only
        what is the same at all configurations is here: the full number is 6 - M.
    length : float
        Characteristic length, metres.
    local : JacobianRank or None
        At the configurations that were given.
    """

    dimension: int
    position_dimension: int
    orientation_dimension: int
    joints: int
    redundancy: int
    singular_values: Array
    gap: float
    missing_in_world: Array
    missing_in_frame: Array
    length: float
    local: JacobianRank | None = None

    @property
    def local_dimension(self) -> NDArray[np.int64] | None:
        """Local number of degrees of freedom at the given configurations, shape (...)."""
        return None if self.local is None else self.local.rank

    @property
    def singularity_order(self) -> NDArray[np.int64] | None:
        """``M - r(q)`` at the given configurations, shape (...); 0 where they are regular."""
        return None if self.local is None else np.asarray(self.dimension - self.local.rank)

    @property
    def never_in_world(self) -> str:
        """Combinations that are never produced, in world axes, in words."""
        return _listed(self.missing_in_world)

    @property
    def never_in_frame(self) -> str:
        """Combinations that are never produced, in the frame's own axes, in words."""
        return _listed(self.missing_in_frame)

    def __str__(self) -> str:
        """Describe it in a few lines."""
        lines = [
            f"Dimension of the operational space: {self.dimension} "
            f"(position {self.position_dimension}, orientation {self.orientation_dimension})",
            f"Joints that move the frame: {self.joints}, order of redundancy {self.redundancy}",
            f"Gap between the singular values that count and the rest: {self.gap:.3g}",
        ]
        for where, twists in (("world", self.never_in_world), ("own", self.never_in_frame)):
            if twists:
                lines.append(f"Never produced, in {where} axes at its origin: {twists}")
        if self.local is not None:
            least, most = self.local.rank.min(initial=6), self.local.rank.max(initial=0)
            ranks = f"{least}" if least >= most else f"{least} to {most}"
            lines.append(f"Local number of degrees of freedom: {ranks}")
        return "\n".join(lines)


def jacobian_rank(
    model: RobotModel,
    q: ArrayLike,
    frame: str | int | None = None,
    length: float | None = None,
    tolerance: float = TOLERANCE,
    mask: ArrayLike | str | None = None,
    mask_axes: MaskAxes = "world",
) -> JacobianRank:
    """Rank of the Jacobian at configurations: their local number of degrees of freedom.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> q = [[0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [0.1, 0.2, 0.3, 0.4, 0.0, 0.6]]
    >>> jacobian_rank(load("rx90"), q).rank
    array([6, 5])
    """
    task = singular_task(model, frame, mask, mask_axes, length)
    return task_rank(task, as_vector(q, model.n, "q"), as_number(tolerance, "tolerance", above=0.0))


def operational_dimension(
    model: RobotModel,
    frame: str | int | None = None,
    q: ArrayLike | None = None,
    length: float | None = None,
    tolerance: float = TOLERANCE,
    mask: ArrayLike | str | None = None,
    mask_axes: MaskAxes = "world",
    samples: int = 64,
    rng: np.random.Generator | int | None = None,
) -> OperationalDimension:
    """Dimension of the operational space of a robot: the rank its Jacobian has almost everywhere.

    The rank is the highest found over random configurations inside the limits: almost all have
    it, since the set where it drops has no volume.

    Parameters
    ----------
    q : array_like, shape (..., n), optional
        Configurations whose local number of degrees of freedom is wanted too, rad or m.
    samples : int
        Number of random configurations.
    rng : numpy.random.Generator or int, optional
        Generator or seed; default a fixed seed.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> found = operational_dimension(load("iiwa14"), q=np.zeros(7))
    >>> found.dimension, found.redundancy, found.local_dimension, found.singularity_order
    (6, 1, np.int64(3), array(3))
    """
    task = singular_task(model, frame, mask, mask_axes, length)
    tolerance = as_number(tolerance, "tolerance", above=0.0)
    count = as_count(samples, "samples", 1)
    spread = spread_configurations(model, count, generator_of(rng))
    if q is not None:
        spread = np.vstack([spread, as_vector(q, model.n, "q").reshape(-1, model.n)])
    J = task_jacobians(task, spread)
    largest = np.zeros(min(J.shape[1:]))
    sigma = np.linalg.svd(J, compute_uv=False)
    if largest.size:
        top = sigma[:, :1]
        largest = np.divide(sigma, top, out=np.zeros_like(sigma), where=top > 0.0).max(axis=0)
    M = int((largest > tolerance).sum())
    linear = int(task.mask[:3].sum())
    joints = int(task.moving.sum())
    return OperationalDimension(
        dimension=M,
        position_dimension=_greatest_rank(J[:, :linear], tolerance),
        orientation_dimension=_greatest_rank(J[:, linear:], tolerance),
        joints=joints,
        redundancy=joints - M,
        singular_values=largest,
        gap=float(_gap(largest, np.array(M))),
        missing_in_world=_never(task, spread, False, tolerance),
        missing_in_frame=_never(task, spread, True, tolerance),
        length=task.length,
        local=None if q is None else task_rank(task, as_vector(q, model.n, "q"), tolerance),
    )


def task_rank(task: SingularTask, q: Array, tolerance: float) -> JacobianRank:
    """Ranks of a task at configurations."""
    sigma = as_floats(np.linalg.svd(task_jacobians(task, q), compute_uv=False), "sigma")
    rank = (sigma > tolerance * sigma[..., :1]).sum(axis=-1)
    return JacobianRank(
        rank=rank,
        singular_values=sigma,
        gap=_gap(sigma, np.asarray(rank)),
        length=task.length,
        tolerance=tolerance,
    )


def _gap(sigma: Array, rank: NDArray[np.int64]) -> Array:
    """Ratio of the last singular value that counts to the next; without a next, infinite."""
    padded = np.zeros((*sigma.shape[:-1], sigma.shape[-1] + 1))
    padded[..., :-1] = sigma
    last = np.take_along_axis(padded, np.maximum(rank - 1, 0)[..., None], -1)[..., 0]
    following = np.take_along_axis(padded, rank[..., None], -1)[..., 0]
    gap = np.full(rank.shape, np.inf)
    return np.divide(last, following, out=gap, where=following > 0.0)


def _greatest_rank(J: Array, tolerance: float) -> int:
    if not J.size:
        return 0
    sigma = np.linalg.svd(J, compute_uv=False)
    # relative to the whole: a point on all axes has levers of rounding size, and no motion
    top = np.maximum(sigma.max(axis=1), tolerance)
    return int((sigma > tolerance * top[:, None]).sum(axis=1).max())


def _never(task: SingularTask, q: Array, own: bool, tolerance: float) -> Array:
    """Directions orthogonal to the columns of the Jacobians of all configurations."""
    if not task.is_whole and own is not (task.mask_axes == "tool"):
        return np.zeros((0, 6))  # the components that count turn in these axes
    J = jacobian(task.model, q, task.frame, "local" if own else "world_aligned")
    scale = np.repeat([1.0 / task.length, 1.0], 3)
    columns = (J * (scale[:, None] * task.joint_scale)).transpose(1, 0, 2).reshape(6, -1)
    U, sigma, _ = np.linalg.svd(columns[task.mask], full_matrices=True)
    rank = int((sigma > tolerance * sigma[:1]).sum())
    basis = np.zeros((U.shape[0] - rank, 6))
    # sparse in units that compare, then back to metres: the coefficients of v are per metre
    basis[:, task.mask] = sparse_basis(U[:, rank:].T) * task.row_scale
    return np.array([normalised(row) for row in basis]).reshape(-1, 6)


def _listed(twists: Array) -> str:
    return ", ".join(combination_text(row, COMPONENTS) for row in twists)


def sparse_basis(vectors: Array, tolerance: float = 1e-9) -> Array:
    """Basis of a row space with many zeros, each vector normalised to its largest entry.

    Shapes: vectors (k, m) -> (k, m).
    """
    k = vectors.shape[0]
    if k == 0:
        return vectors.copy()
    if k == 1:
        return normalised(vectors[0])[None]
    orthonormal = np.linalg.qr(vectors.T)[0].T
    choices = _pivot_choices(orthonormal)
    blocks = orthonormal[:, choices].transpose(1, 0, 2)
    weakest = np.linalg.svd(blocks, compute_uv=False)[:, -1]
    choices = [c for c, weak in zip(choices, weakest, strict=True) if weak > 0.02]
    if not choices:
        return np.array([normalised(row) for row in orthonormal])
    blocks, weakest = blocks[weakest > 0.02], weakest[weakest > 0.02]
    bases = np.linalg.solve(blocks, np.broadcast_to(orthonormal, (len(choices), *vectors.shape)))
    sizes = np.abs(bases)
    zeros = (sizes < tolerance * sizes.max(axis=2, keepdims=True)).sum(axis=(1, 2))
    # of equally sparse ones the best conditioned; rounding must not decide
    best = bases[np.lexsort((-weakest.round(6), -zeros))[0]]
    return np.array([normalised(row) for row in best])


def normalised(vector: Array, rounding: float = 1e-13) -> Array:
    """A vector divided by its entry of largest magnitude, its rounding errors set to zero."""
    size = np.abs(vector)
    pivot = int(np.argmax(size > (1.0 - 1e-9) * size.max()))
    row = vector / vector[pivot]
    row[np.abs(row) < rounding] = 0.0
    return row


def _pivot_choices(basis: Array) -> list[list[int]]:
    k, m = basis.shape
    if comb(m, k) <= _MOST_CHOICES:
        return [list(choice) for choice in combinations(range(m), k)]
    from scipy.linalg import qr

    # too many: the pivots of a pivoted factorisation, which are well conditioned
    return [[int(i) for i in qr(basis, pivoting=True)[-1][:k]]]


def combination_text(row: Array, names: tuple[str, ...]) -> str:
    """A linear combination in words. Shapes: row (m,)."""
    text = ""
    for value, name in zip(row, names, strict=True):
        if abs(value) < 1e-9:
            continue
        size = "" if abs(abs(value) - 1.0) < 1e-12 else f"{abs(value):.4g} "
        sign = "-" if value < 0 else "+"
        text += f" {sign} {size}{name}" if text else f"{'-' * int(value < 0)}{size}{name}"
    return text

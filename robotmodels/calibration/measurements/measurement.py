"""What every kind of measurement tells a calibration: predicted minus measured, and derivatives.

A kind asks for poses of ends of the robot at configurations (its views), may have unknown
fixtures of its own (a touched point, a plane, a target), and gives rows of residuals in blocks: one
block for each measurement, of a fixed number of rows.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ... import se3
from ..._arrays import Array, Rebuilt, as_core, as_floats, read_only
from ...errors import InvalidValueError, ShapeError
from ..skeleton import Frame


class View(NamedTuple):
    """Poses that a measurement needs: an end and the configurations.

    Attributes
    ----------
    frame : str, int or None
        The end; None is the tool.
    q : ndarray, shape (N, n)
        Readings of the joints, rad or m.
    """

    frame: Frame
    q: Array


class Evaluation(NamedTuple):
    """What the robot says about a view.

    Attributes
    ----------
    T : ndarray, shape (N, 4, 4)
        World poses, metres.
    psi : ndarray, shape (N, 6, P)
        ``[v; w]`` per unit of each parameter, world axes, at the end's origin.
    """

    T: Array
    psi: Array


class Fixture(NamedTuple):
    """One unknown number that is not the robot's; equal names are the same unknown.

    Attributes
    ----------
    name : str
        Such as ``contact:0.x``.
    unit : str
        ``"m"`` or ``"rad"``.
    """

    name: str
    unit: str


class Linearised(NamedTuple):
    """Residuals of a kind and their derivatives.

    Attributes
    ----------
    residual : ndarray, shape (B, k)
        Predicted minus measured, m or rad, one row of k for each of B blocks.
    by_parameters : ndarray, shape (B, k, P)
        By the parameters of the robot.
    by_fixtures : ndarray, shape (B, k, F)
        By the unknown fixtures.
    """

    residual: Array
    by_parameters: Array
    by_fixtures: Array


class Measurement(Rebuilt, ABC):
    """Base of the kinds of measurement; frozen dataclasses with B blocks of k rows."""

    __slots__ = ()

    name: str
    sigma: Array | None
    covariance: Array | None

    @property
    @abstractmethod
    def blocks(self) -> int:
        """Number of blocks B."""

    @property
    @abstractmethod
    def axes(self) -> tuple[str, ...]:
        """Label of each of the k rows of a block."""

    @property
    @abstractmethod
    def units(self) -> tuple[str, ...]:
        """``"m"`` or ``"rad"`` for each of the k rows of a block."""

    @property
    @abstractmethod
    def views(self) -> tuple[View, ...]:
        """Poses that are needed; block b uses row b of each view."""

    @property
    def fixtures(self) -> tuple[Fixture, ...]:
        """Unknowns besides the robot's."""
        return ()

    @property
    def is_constraint(self) -> bool:
        """Whether what is measured is that something is touched or linked.

        Ranks are then judged at readings that satisfy the constraint exactly.
        """
        return False

    @property
    @abstractmethod
    def knows_length(self) -> bool:
        """Whether a length is measured or given, so that the scale of the robot is seen."""

    @property
    @abstractmethod
    def sees_base(self) -> bool:
        """Whether the place of the robot in the world matters."""

    @property
    def dilation_centres(self) -> tuple[Array, Array]:
        """``A c = b``, shapes (m, 3) and (m,): where what is known in the world lets c be.

        A contact is still satisfied when robot and base are dilated from a place c, as long as
        the points, lines and planes that are known contain c.
        """
        return np.zeros((0, 3)), np.zeros(0)

    @property
    def groups(self) -> NDArray[np.int64]:
        """Number of the group of each block, shape (B,): blocks that share their own fixtures."""
        return np.zeros(self.blocks, dtype=np.int64)

    def guess(self, evaluations: Sequence[Evaluation]) -> Array | None:
        """First values of the fixtures from the poses of the nominal robot, shape (F,).

        None where the kind cannot say and another that shares the fixtures must.
        """
        return np.zeros(0)

    @abstractmethod
    def linearise(self, evaluations: Sequence[Evaluation], fixtures: Array) -> Linearised:
        """Residuals and derivatives at given poses and fixtures."""

    @abstractmethod
    def with_configurations(self, configurations: Sequence[Array]) -> Self:
        """The same measurement with other readings, one array for each view."""

    @abstractmethod
    def subset(self, blocks: NDArray[np.int64]) -> Self:
        """Only some of the blocks."""


def as_readings(value: ArrayLike, name: str = "q") -> Array:
    """Readings of joints at the border of a kind of measurement.

    Parameters
    ----------
    value : array_like, shape (N, n)
        rad or m.
    name : str
        Used in error messages.

    Returns
    -------
    ndarray, shape (N, n)
        Read-only.

    Raises
    ------
    ShapeError, InvalidValueError
        Not a matrix, no rows, NaN.
    """
    q = as_floats(value, name)
    if q.ndim != 2:
        raise ShapeError(
            f"{name}: expected shape (N, n), a row for each measurement, got {q.shape}."
        )
    if not len(q):
        raise InvalidValueError(f"{name}: expected one or more measurements, got none.")
    return read_only(q)


def as_noise(
    sigma: ArrayLike | None, covariance: ArrayLike | None, blocks: int, k: int
) -> tuple[Array | None, Array | None]:
    """Standard deviations or covariances at the border of a kind of measurement.

    Parameters
    ----------
    sigma : array_like, shape (), (k,) or (B, k), optional
        Standard deviations of the rows of a block, m or rad.
    covariance : array_like, shape (k, k) or (B, k, k), optional
        Instead: covariance of the rows of a block.
    blocks, k : int
        Number of blocks, rows of a block.

    Returns
    -------
    tuple of ndarray or None
        Sigma of shape (B, k), covariance of shape (B, k, k); at most one is not None.

    Raises
    ------
    ShapeError, InvalidValueError
        Both given; not positive (definite); shapes that do not fit.
    """
    if sigma is not None and covariance is not None:
        raise InvalidValueError("Give sigma or covariance, not both.")
    if sigma is not None:
        values = as_floats(sigma, "sigma")
        if values.shape not in ((), (k,), (blocks, k)):
            raise ShapeError(
                f"sigma: expected a number, shape ({k},) or ({blocks}, {k}), got {values.shape}."
            )
        if not (values > 0.0).all():
            raise InvalidValueError(f"sigma: expected positive numbers, got {sigma!r:.80}.")
        return read_only(np.broadcast_to(values, (blocks, k))), None
    if covariance is not None:
        values = as_core(covariance, (k, k), "covariance")
        if values.shape not in ((k, k), (blocks, k, k)):
            raise ShapeError(
                f"covariance: expected shape ({k}, {k}) or ({blocks}, {k}, {k}), got "
                f"{values.shape}."
            )
        if not np.allclose(values, values.swapaxes(-1, -2), rtol=1e-9, atol=0.0) or (
            np.linalg.eigvalsh(values).min() <= 0.0
        ):
            raise InvalidValueError(
                "covariance: expected symmetric positive definite matrices; give a row that is "
                "not measured by leaving it out, not by a zero variance."
            )
        return None, read_only(np.broadcast_to(values, (blocks, k, k)))
    return None, None


def part_of_noise(
    measurement: Measurement, blocks: NDArray[np.int64]
) -> tuple[Array | None, Array | None]:
    """Sigma and covariance of some of the blocks.

    Parameters
    ----------
    measurement : Measurement
        The whole.
    blocks : ndarray of int
        Which blocks.

    Returns
    -------
    tuple of ndarray or None
        As the fields of the measurement.
    """
    sigma, covariance = measurement.sigma, measurement.covariance
    return (
        None if sigma is None else sigma[blocks],
        None if covariance is None else covariance[blocks],
    )


def whitened(measurement: Measurement, rows: Array, scale: Array) -> Array:
    """Rows divided by their standard deviations, correlations taken out.

    Parameters
    ----------
    measurement : Measurement
        Whose noise.
    rows : ndarray, shape (B, k) or (B, k, m)
        Residuals or derivatives.
    scale : ndarray, shape (k,)
        Standard deviations to use where the measurement states none, m or rad.

    Returns
    -------
    ndarray, the shape of rows
        In standard deviations.
    """
    extra = (...,) + (None,) * (rows.ndim - 2)
    if measurement.covariance is not None:
        factor = np.linalg.cholesky(measurement.covariance)
        columns = rows if rows.ndim == 3 else rows[..., None]
        return np.linalg.solve(factor, columns).astype(np.float64).reshape(rows.shape)
    sigma = scale if measurement.sigma is None else measurement.sigma
    return rows / sigma[extra]


def as_rows(rows: Sequence[int | bool], count: int) -> tuple[bool, ...]:
    """Which rows of a block are measured, at the border of a kind of measurement.

    Parameters
    ----------
    rows : sequence of 0 or 1
        One for each.
    count : int
        How many there are.

    Returns
    -------
    tuple of bool
        At least one is True.

    Raises
    ------
    InvalidValueError
        Another number of them, something else than 0 and 1, none asked.
    """
    asked = tuple(rows)
    if len(asked) != count or any(r not in (0, 1) for r in asked) or not any(asked):
        raise InvalidValueError(
            f"rows: expected {count} numbers 0 or 1, not all 0, got {rows!r:.80}."
        )
    return tuple(bool(r) for r in asked)


def as_measured_poses(T: Any, blocks: int) -> Array:
    """Measured poses at the border of a kind of measurement.

    Parameters
    ----------
    T : array_like, shape (B, 4, 4)
        Metres.
    blocks : int
        Number of blocks B.

    Returns
    -------
    ndarray, shape (B, 4, 4)
        Read-only.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        Another number of them, NaN, no poses.
    """
    poses = se3.as_pose(T, "T")
    if poses.shape != (blocks, 4, 4):
        raise ShapeError(
            f"T: expected a pose for each row of q, shape ({blocks}, 4, 4), got {poses.shape}."
        )
    return read_only(poses)


def as_values(values: ArrayLike, blocks: int, name: str) -> Array:
    """A measured number for each block, at the border of a kind of measurement.

    Parameters
    ----------
    values : array_like, shape (B,) or ()
        One number holds for all.
    blocks : int
        Number of blocks B.
    name : str
        Used in error messages.

    Returns
    -------
    ndarray, shape (B,)
        Read-only.

    Raises
    ------
    ShapeError, InvalidValueError
        Another number of them, NaN.
    """
    numbers = as_floats(values, name)
    if numbers.shape not in ((), (blocks,)):
        raise ShapeError(
            f"{name}: expected a number for each row of q, shape ({blocks},), got {numbers.shape}."
        )
    return read_only(np.broadcast_to(numbers, (blocks,)))


def same_number_of_readings(q: Array, q_other: ArrayLike) -> Array:
    """Readings at the other of two configurations, as many as at the first.

    Parameters
    ----------
    q : ndarray, shape (N, n)
        At the first.
    q_other : array_like, shape (N, n)
        At the other, rad or m.

    Returns
    -------
    ndarray, shape (N, n)
        Read-only.

    Raises
    ------
    ShapeError, InvalidValueError
        Another shape, NaN.
    """
    other = as_readings(q_other, "q_other")
    if other.shape != q.shape:
        raise ShapeError(f"q_other: expected the shape of q, {q.shape}, got {other.shape}.")
    return other


POSE_AXES = ("x", "y", "z", "rx", "ry", "rz")
POSE_UNITS = ("m", "m", "m", "rad", "rad", "rad")

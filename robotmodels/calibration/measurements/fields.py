"""Fields of the kinds of measurement: metadata that defines how a field is checked and used.

``check(measurement, name, value)`` returns the value to store. A field with ``block`` has a value
for each block. Files hold the contents joints, pose, point, length (in a column with one of
``names``) and label.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np

from ... import se3
from ..._arrays import Array, as_core, as_exact, as_floats, read_only
from ...errors import InvalidValueError, ShapeError

Given = Any
"""A field: array-like when given, read-only array, tuple or mapping once the object is built."""
Metadata = dict[str, Any]


class FileRow(NamedTuple):
    """Row of a file, counted from 1 without the header."""

    name: str
    row: int

    def __str__(self) -> str:
        return f"{self.name} row {self.row}"


def as_readings(m: Any, name: str, value: Any) -> Any:
    """Check joint readings; those of another end have the shape of q."""
    if name != "q" and value is None:
        return None
    q = as_floats(cast(Any, value), name)
    if q.ndim != 2:
        raise ShapeError(
            f"{name}: expected shape (N, n), a row for each measurement, got {q.shape}."
        )
    if not len(q):
        raise InvalidValueError(f"{name}: expected one or more measurements, got none.")
    if name != "q" and q.shape != m.q.shape:
        raise ShapeError(f"{name}: expected the shape of q, {m.q.shape}, got {q.shape}.")
    return read_only(q)


def as_poses(m: Any, name: str, value: Any) -> Array:
    """Check a measured pose for each block."""
    return read_only(as_exact(se3.as_pose(value, name), (m.blocks, 4, 4), name))


def as_points(m: Any, name: str, value: Any) -> Array:
    """Check a measured position for each block."""
    return read_only(as_exact(value, (m.blocks, 3), name))


def as_values(m: Any, name: str, value: Any) -> Array:
    """Check a number for each block; one number counts for all."""
    numbers = as_floats(value, name)
    return read_only(as_exact(numbers if numbers.ndim else [numbers] * m.blocks, (m.blocks,), name))


def as_labels(m: Any, name: str, given: Any) -> tuple[str, ...]:
    """Check the labels of a measurement."""
    if given is None:
        return ("0",) * m.blocks
    if isinstance(given, str) or np.ndim(given) != 1 or len(given) != m.blocks:
        got = repr(given) if isinstance(given, str) else f"shape {np.shape(given)}"
        raise ShapeError(
            f"{name}: expected a label for each of the {m.blocks} rows of q, got {got}."
        )
    return tuple(str(label) for label in given)


def as_rows(m: Any, name: str, given: Any) -> tuple[bool, ...]:
    """Check the choice of rows of a block."""
    rows, count = tuple(given), len(m.all_rows)
    if len(rows) != count or any(r not in (0, 1) for r in rows) or not any(rows):
        raise InvalidValueError(
            f"{name}: expected {count} numbers 0 or 1, not all 0, got {given!r:.80}."
        )
    return tuple(bool(r) for r in rows)


def targets(check: Callable[[Any, str], Array]) -> Metadata:
    """Known targets by their labels; ``check(value, name)`` converts each."""

    def as_known(m: Any, name: str, given: Any) -> Mapping[str, Array]:
        if given is not None and not isinstance(given, Mapping):
            raise InvalidValueError(
                f"{name}: expected a mapping of labels to values, such as {{0: ...}}, got "
                f"{type(given).__name__}."
            )
        values = {str(k): check(v, f"{name}[{k!r}]") for k, v in (given or {}).items()}
        for label in values.keys() - set(m.label):
            raise InvalidValueError(
                f"{name}: no row of q has the {m.label_field} {label!r}; expected one "
                f"of {', '.join(m.labels)}."
            )
        return MappingProxyType(values)

    return {"check": as_known}


def as_known_pose(value: Any, name: str) -> Array:
    """Check a known pose."""
    return read_only(se3.as_single_pose(value, name))


def as_point(value: Any, name: str) -> Array:
    """Check a known point."""
    return read_only(as_exact(value, (3,), name))


def lengths(*names: str) -> Metadata:
    """A measured length for each block."""
    return {"check": as_values, "content": "length", "names": names, "block": True}


READINGS: Metadata = {"check": as_readings, "content": "joints", "block": True}
POSES: Metadata = {"check": as_poses, "content": "pose", "block": True}
POINTS: Metadata = {"check": as_points, "content": "point", "block": True}
LABELS: Metadata = {"check": as_labels, "content": "label", "block": True}
ROWS: Metadata = {"check": as_rows}
NOISE: Metadata = {"block": True}


def as_sigma(sigma: Any, blocks: int, k: int) -> Array:
    """Check standard deviations."""
    values = as_floats(sigma, "sigma")
    if values.shape not in ((), (k,), (blocks, k)):
        raise ShapeError(
            f"sigma: expected a number, shape ({k},) or ({blocks}, {k}), got {values.shape}."
        )
    if not (values > 0.0).all():
        raise InvalidValueError(f"sigma: expected positive numbers, got {sigma!r:.80}.")
    return read_only(np.broadcast_to(values, (blocks, k)))


def as_covariance(covariance: Any, blocks: int, k: int) -> Array:
    """Check covariances."""
    values = as_core(covariance, (k, k), "covariance")
    if values.shape not in ((k, k), (blocks, k, k)):
        raise ShapeError(
            f"covariance: expected shape ({k}, {k}) or ({blocks}, {k}, {k}), got {values.shape}."
        )
    if not np.allclose(values, values.swapaxes(-1, -2), rtol=1e-9, atol=0.0) or (
        np.linalg.eigvalsh(values).min() <= 0.0
    ):
        raise InvalidValueError(
            "covariance: expected symmetric positive definite matrices; give a row that is "
            "not measured by leaving it out, not by a zero variance."
        )
    return read_only(np.broadcast_to(values, (blocks, k, k)))

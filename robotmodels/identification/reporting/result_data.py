"""An identification as plain lists, numbers and words: what its JSON file holds.

Source: Seed book section 1.6.5.
"""

from __future__ import annotations

import hashlib
import platform
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._arrays import Array
from ...drive import drive_kinds
from ...logs import Log
from ...model import RobotModel
from ..methods.estimate import check_values
from .parameters import intervals, kind_names, parameter_units
from .residuals import residual_diagnostics
from .weak_parameters import not_seen, strong_correlations, understatement, wrong_signs

if TYPE_CHECKING:
    from ..consistency.result import ConsistentFit
    from ..result import IdentificationResult
    from ..solving import MethodOptions

FORMAT = 1
"""Raised when the meaning of an entry changes."""
_ROWS = 1 << 16
_PACKAGES = ("robotmodels", "numpy", "scipy", "numba", "pin")


def result_data(result: IdentificationResult, robot: ConsistentFit | None = None) -> dict[str, Any]:
    """An identification as plain lists, numbers and words, as `write_result` writes it."""
    estimate, base = result.estimate, result.base
    check_values(estimate)
    ends, units, factor = intervals(estimate), parameter_units(result), understatement(result)
    found = residual_diagnostics(result.system, result.values)
    parameters = [
        {
            "name": name, "unit": units[k], "value": _number(result.values[k]),
            "std": _number(result.deviations[k]),
            "relative_std": _number(result.relative_deviations[k]),
            "interval_95": _numbers(ends[k]), "std_white": _number(result.white[k]),
            "std_over_white": _number(factor[k]),
            "stands_for": dict(base.regrouping[name]),
        }
        for k, name in enumerate(result.names)
    ]  # fmt: skip
    return {
        "format": FORMAT,
        "chapter": "identification",
        "robot": result.model.name,
        "status": {"name": estimate.status.name, "sentence": estimate.status.sentence},
        "method": {
            "name": estimate.method.name, "sentence": estimate.method.value,
            "iterations": estimate.iterations, "lags": result.lags, "notes": list(estimate.notes),
            "options": option_data(result.options), "essential": result.essential_rule,
            "form": result.system.form.name,
            "drive": [kind.value for kind in drive_kinds(base.drive)],
            "friction": None if base.friction is None else repr(base.friction),
        },
        "data": log_data(result.system.log),
        "processing": _processing(result),
        "parameters": parameters,
        "covariance": [_numbers(row) for row in result.estimate.covariance],
        "sigma": _numbers(estimate.sigma),
        "unseen": list(result.unseen),
        "not_essential": list(result.not_essential),
        "relative_std_above_30_percent": list(not_seen(estimate)),
        "negative": [one.name for one in wrong_signs(base, estimate)],
        "strong_correlations": [[a, b, _number(c)] for a, b, c in strong_correlations(estimate)],
        "condition": _number(result.condition),
        "condition_scaled": _number(result.condition_scaled),
        "gap": _numbers(np.array(result.gap)),
        "equations": [
            {"of": name, "used": int(used), "in_dead_band": int(left)}
            for name, used, left in zip(
                kind_names(result), result.reduction.counts, result.reduction.left_out, strict=True
            )
        ],
        "residuals": [
            {
                "of": name, "mean": _number(found.mean[j]), "std": _number(found.deviation[j]),
                "autocorrelation": _numbers(found.autocorrelation[j]),
                "white_p": _number(found.whiteness[j].p), "skewness": _number(found.skewness[j]),
                "kurtosis": _number(found.kurtosis[j]),
                "normal_p": _number(found.normality[j].p),
            }
            for j, name in enumerate(kind_names(result))
        ],
        "errors": {
            "joints": list(result.model.table.joint_names),
            "fitted": _errors(result.fitted), "held_out": _errors(result.held_out),
        },
        "consistent": None if robot is None else _robot(robot),
        "versions": _versions(),
        "notes": list(result.notes),
    }  # fmt: skip


def option_data(options: MethodOptions) -> dict[str, Any]:
    """Options of a method, as JSON data."""
    given = ((f.name, getattr(options, f.name)) for f in fields(options))
    return {name: _option(value) for name, value in given if value is not None}


def _option(value: Any) -> Any:
    if isinstance(value, RobotModel):
        return value.name
    if isinstance(value, Enum):
        return value.name.lower()
    if is_dataclass(value):
        parts = ((f.name, getattr(value, f.name)) for f in fields(value))
        return {name: _option(part) for name, part in parts if part is not None}
    if isinstance(value, (str, bool)):
        return value
    return np.asarray(value).tolist()


def log_data(log: Log) -> dict[str, Any]:
    """Origin of a log, with hashes of its data."""
    return {
        "samples": len(log), "joints": list(log.names), "dt": log.dt, "duration": log.duration,
        "starts": log.starts.tolist(), "delay": log.delay, "sha256": _hash(log),
        "sources": [
            {"name": one.name, "sha256": one.sha256, "rows": one.rows} for one in log.sources
        ],
        "refused": [
            {"source": one.source, "rows": list(one.rows), "reason": one.reason}
            for one in log.refused
        ],
        "measured": [
            name for name in ("v", "a", "q_ref", "v_ref") if getattr(log, name) is not None
        ],
        "notes": list(log.notes),
    }  # fmt: skip


def _hash(log: Log) -> str:
    total = hashlib.sha256()
    for array in (log.q, log.tau):
        for first in range(0, len(log), _ROWS):
            rows = np.ascontiguousarray(array[first : first + _ROWS], dtype="<f8")
            total.update(rows.tobytes())
    return total.hexdigest()


def _processing(result: IdentificationResult) -> dict[str, Any]:
    chosen = result.system.processing
    return {
        "dt": chosen.dt, "cutoff": chosen.cutoff, "order": chosen.order,
        "accuracy": chosen.accuracy, "decimation": chosen.decimation,
        "torque_cutoff": chosen.torque_cutoff, "dead_band": _numbers(chosen.dead_band),
        "edges": chosen.edges, "motion": chosen.motion, "notes": list(chosen.notes),
    }  # fmt: skip


def _errors(side: Any) -> dict[str, Any] | None:
    if side is None:
        return None
    names = ("rmse", "relative", "bias", "filtered_rmse", "filtered_relative", "correlation")
    return {"samples": side.samples} | {name: _numbers(getattr(side, name)) for name in names}


def _robot(robot: ConsistentFit) -> dict[str, Any]:
    return {
        "status": {"name": robot.status.name, "sentence": robot.status.sentence},
        "price_percent": _number(robot.price), "distance": _number(robot.distance),
        "gap": _number(robot.gap), "active": list(robot.active), "stopped": robot.stopped,
        "standard": dict(zip(robot.standard_names, _numbers(robot.values), strict=True)),
        "base": dict(zip(robot.names, _numbers(robot.base_values), strict=True)),
    }  # fmt: skip


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # such as a source tree that was never installed
            found[name] = "unknown"
    return found


def _number(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None


def _numbers(values: Array) -> list[float | None]:
    return [_number(value) for value in values]

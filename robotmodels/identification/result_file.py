"""Files of an identification: JSON with every option, or a URDF of a consistent robot."""

from __future__ import annotations

import hashlib
import json
import platform
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._json_data import json_data
from ..drive import drive_kinds
from ..errors import InvalidValueError
from ..model import RobotModel, to_urdf
from .report_tables import (
    correlated_estimates,
    group_names,
    intervals,
    negative_parameters,
    parameter_units,
    standard_error_ratio,
    weak_parameters,
)
from .result import IdentificationResult, check_result, consistent_robot
from .validation import residual_diagnostics

if TYPE_CHECKING:
    from ..minimal_parameters import StandardParameters

FORMAT = 2
"""Version of the format, increased when the meaning of an entry changes."""
_ROWS = 1 << 16
_PACKAGES = ("robotmodels", "numpy", "scipy", "numba", "pin")


def write_result(
    result: IdentificationResult, path: str | Path, robot: StandardParameters | None = None
) -> None:
    """Write an identification to a file whose suffix gives the format.

    Parameters
    ----------
    result : IdentificationResult
        Result of `fit`.
    path : str or Path
        ``.json``: SI units (null where not finite) and the facts that repeat the fit: hashes of the
        data, options, versions. ``.urdf``: a physically consistent robot.
    robot : StandardParameters, optional
        Result of `consistent_robot`; default that nearest to the model's inertia.

    Raises
    ------
    InvalidValueError, UrdfError, InertiaError, MissingExtraError, OSError
        Another suffix; a result without parameters; as `to_urdf` and `consistent_robot`; the file
        cannot be written.

    Warns
    -----
    UrdfWarning
        Properties that URDF cannot represent.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> path = Path(mkdtemp()) / "arm.json"
    >>> write_result(fit(*example_log(), drive=("Fv",)), path)
    >>> len(json.loads(path.read_text(encoding="utf-8"))["parameters"])
    8
    """
    check_result(result)
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".urdf":
        consistent = consistent_robot(result) if robot is None else robot
        text = to_urdf(consistent.of(result.model))
    elif suffix == ".json":
        text = json.dumps(result_data(result, robot), indent=2, ensure_ascii=False) + "\n"
    else:
        raise InvalidValueError(f"path: expected a file named .json or .urdf, got {path.name!r}.")
    path.write_text(text, encoding="utf-8")


def result_data(
    result: IdentificationResult, robot: StandardParameters | None = None
) -> dict[str, Any]:
    """Content of the JSON file: lists, numbers and text."""
    check_result(result)
    base, estimate, details = result.base, result.estimate, result.details
    groups, units, ends = group_names(result), parameter_units(result), intervals(estimate)
    residuals = asdict(residual_diagnostics(result.equations, result.values))
    processing, log = result.equations.processing, result.equations.log
    sha256 = hashlib.sha256()
    for array in (log.q, log.tau):
        for first in range(0, len(log), _ROWS):
            part = np.ascontiguousarray(array[first : first + _ROWS], dtype="<f8")
            sha256.update(part.tobytes())
    kept = ("dt", "duration", "starts", "delay", "sources", "refused", "notes")
    measured = [name for name in ("v", "a", "q_ref", "v_ref") if getattr(log, name) is not None]
    options = {  # of a robot its parameters
        name: dict(zip(base.names, base.values(x), strict=True)) if isinstance(x, RobotModel) else x
        for name, x in result.method.options().items()
    }
    data = {
        "format": FORMAT,
        "chapter": "identification",
        "robot": result.model.name,
        "status": {"name": result.status.name, "sentence": result.reason()},
        "method": {
            "name": result.method.name,
            "title": result.method.title,
            "options": options,
            "iterations": estimate.iterations,
            "correlation_lags": details.correlation_lags,
            "notes": estimate.notes,
            "essential": details.essential_rule,
            "form": result.equations.form.name,
            "drive": [kind.value for kind in drive_kinds(base.drive)],
            "friction": None if base.friction is None else repr(base.friction),
        },
        "data": {
            "samples": len(log),
            "joints": log.names,
            "sha256": sha256.hexdigest(),
            "measured": measured,
        }
        | {name: getattr(log, name) for name in kept},
        "processing": asdict(processing) | {"torque_cutoff": processing.torque_cutoff},
        "parameters": _rows(
            name=result.names,
            unit=units,
            value=result.values,
            standard_error=result.standard_errors,
            relative_error=result.relative_errors,
            interval_95=ends,
            iid_standard_error=details.iid_standard_errors,
            standard_error_ratio=standard_error_ratio(result),
            stands_for=[dict(base.regrouping[name]) for name in result.names],
        ),
        "covariance": estimate.covariance,
        "sigma": estimate.sigma,
        "unidentifiable": details.unidentifiable,
        "dropped": details.dropped,
        "relative_error_above_30_percent": weak_parameters(estimate),
        "negative": [one.name for one in negative_parameters(base, estimate)],
        "correlated": correlated_estimates(estimate),
        "condition": result.condition,
        "scaled_condition": result.scaled_condition,
        "rank_gap": details.rank_gap,
        "equations": _rows(
            of=groups, used=result.factors.counts, in_dead_band=result.factors.left_out
        ),
        "residuals": _rows(of=groups, **residuals),
        "errors": {"joints": result.model.table.joint_names}
        | {name: getattr(result.validation, name) for name in ("in_sample", "held_out", "nominal")},
        "consistent": None if robot is None else _robot(robot),
        "versions": {"python": platform.python_version()} | {n: _version(n) for n in _PACKAGES},
        "notes": result.notes,
    }
    return json_data(data)


def _rows(**columns: Any) -> list[dict[str, Any]]:
    """Columns of a table as rows."""
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _robot(robot: StandardParameters) -> dict[str, Any]:
    return {
        "status": {"name": robot.status.name, "sentence": robot.status.sentence},
        "residual_increase_percent": robot.residual_increase,
        "distance": robot.distance,
        "gap": robot.fit.gap,
        "active": robot.fit.active,
        "stopped": robot.fit.stopped,
        "standard": dict(zip(robot.names, robot.values, strict=True)),
        "base": dict(zip(robot.base.names, robot.base_values, strict=True)),
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # such as a source tree that was never installed
        return "unknown"

"""A calibration as a file for other programs: JSON or YAML with units, or a URDF of the robot."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._arrays import Array
from ...errors import InvalidValueError, MissingExtraError, UrdfWarning
from ...estimation import confidence_intervals
from ...model import to_urdf
from ...urdf.in_place import urdf_in_place
from ..errors_seen import BlockErrors
from ..robot import CalibratedRobot

if TYPE_CHECKING:
    from ..result import CalibrationResult

_FORMAT = 1
"""Raised when the meaning of an entry changes."""
_YAML = (".yaml", ".yml")


def write_result(result: CalibrationResult, path: str | Path) -> None:
    """Write a calibration; the suffix of the file says how.

    ``.json`` and ``.yaml`` hold the same (SI units, stated beside each parameter; what is not
    finite is null). YAML is written by PyYAML, which the package's own dependencies bring (meshcat
    needs pyngrok, which needs it). To keep everything and go on with it in Python, pickle the
    result: files hold what other programs need.

    Parameters
    ----------
    result : CalibrationResult
        Of `fit`.
    path : str or Path
        A file named ``.json``, ``.yaml``, ``.yml`` or ``.urdf``.

    Raises
    ------
    InvalidValueError
        Another suffix.
    MissingExtraError
        PyYAML is not there.
    UrdfError
        As `calibrated_urdf`.
    OSError
        The file cannot be written.

    Warns
    -----
    UrdfWarning
        What a URDF has no place for.

    References
    ----------
    Seed book section 1.4.6.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> arm = rm.load("rx90")
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> result = calibration.fit(arm, calibration.Pose(q, rm.dgm(arm, q)), folds=0, held_out=0.0)
    >>> with TemporaryDirectory() as folder:
    ...     write_result(result, Path(folder) / "rx90.json")
    ...     json.loads((Path(folder) / "rx90.json").read_text())["status"]["name"]
    'CONVERGED'
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".urdf":
        text = calibrated_urdf(result.robot)
    elif suffix == ".json":
        text = json.dumps(result_data(result), indent=2, ensure_ascii=False) + "\n"
    elif suffix in _YAML:
        try:
            import yaml
        except ImportError:
            raise MissingExtraError(
                "YAML files need PyYAML; run: pip install pyyaml (or write a .json file)."
            ) from None
        text = yaml.safe_dump(result_data(result), sort_keys=False, allow_unicode=True)
    else:
        raise InvalidValueError(
            f"path: expected a file named .json, .yaml, .yml or .urdf, got {path.name!r}."
        )
    path.write_text(text, encoding="utf-8")


def result_data(result: CalibrationResult) -> dict[str, Any]:
    """A calibration as plain lists, numbers and words, as `write_result` writes it.

    Parameters
    ----------
    result : CalibrationResult
        Of `fit`.

    Returns
    -------
    dict
        SI units; None for what is not finite.

    References
    ----------
    Seed book section 1.4.6.

    Examples
    --------
    >>> import robotmodels as rm
    >>> import robotmodels.calibration as calibration
    >>> arm = rm.load("rx90")
    >>> q = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 6))
    >>> result = calibration.fit(arm, calibration.Pose(q, rm.dgm(arm, q)), folds=0, held_out=0.0)
    >>> result_data(result)["parameters"][0]["unit"]
    'm'
    """
    fit, problem = result.solution.fit, result.solution.problem
    interval = confidence_intervals(fit)
    start = result.parameters.nominal
    fixture_std = fit.standard_errors[problem.P :]
    return {
        "format": _FORMAT,
        "robot": result.nominal.name,
        "status": {"name": result.status.name, "sentence": result.status.sentence},
        "measurements": [
            {
                "name": m.name, "kind": type(m).__name__, "blocks": m.blocks,
                "rows": list(m.axes), "units": list(m.units),
                "noise": _numbers(scale) if m.sigma is None and m.covariance is None else None,
                "files": [{"name": file.name, "rows": file.rows} for file in m.files],
            }
            for m, scale in zip(problem.measurements, result.solution.scales, strict=True)
        ],
        "parameters": [
            {
                "name": name, "unit": unit, "start": _number(start[k]),
                "deviation": _number(result.deviation[k]), "value": _number(result.values[k]),
                "std": _number(result.standard_deviation[k]), "interval_95": _numbers(interval[k]),
            }
            for k, (name, unit) in enumerate(zip(result.names, result.units, strict=True))
        ],
        "covariance": [_numbers(row) for row in result.covariance],
        "fixtures": [
            {
                "name": fixture.name, "unit": fixture.unit,
                "value": _number(result.fixtures[fixture.name]), "std": _number(fixture_std[k]),
            }
            for k, fixture in enumerate(problem.fixtures)
        ],
        "known": list(result.known),
        "left_out": {name: why.name for name, why in result.identifiable.reasons.items()},
        "regrouping": {
            name: {other: float(c) for other, c in terms.items()}
            for name, terms in result.identifiable.regrouping.items()
        },
        "condition": _number(result.again.condition),
        "errors": {
            "given": _errors(result.given),
            "before": _errors(result.before),
            "after": _errors(result.after),
            "folds": _aside(result.cross_validation),
            "held_out": _aside(result.held_out),
        },
        "outliers": [int(block) for block in fit.outliers],
        "base": [_numbers(row) for row in result.model.base],
        "tool": [_numbers(row) for row in result.model.tool],
        "ends": [
            {"frame": end.frame, "parent": int(end.parent), "pose": [_numbers(r) for r in end.pose]}
            for end in result.robot.ends
        ],
        "table": _table(result),
        "notes": [*result.notes, *result.robot.notes],
    }  # fmt: skip


def _table(result: CalibrationResult) -> list[dict[str, Any]]:
    table = result.model.table
    columns = ("gamma", "b", "beta", "alpha", "d", "theta", "r")
    return [
        {
            "name": str(table.names[j]), "antecedent": int(table.antecedent[j]),
            "sigma": int(table.sigma[j]),
            **{word: _number(getattr(table, word)[j]) for word in columns},
        }
        for j in range(table.f)
    ]  # fmt: skip


def _errors(errors: BlockErrors) -> dict[str, Any]:
    return {
        unit: None if not (s := errors.summary(unit)).blocks else
        {"rms": s.rms, "mean": s.mean, "max": s.largest, "blocks": s.blocks}
        for unit in ("m", "rad")
    }  # fmt: skip


def _aside(errors: Any) -> dict[str, Any] | None:
    if errors is None:
        return None
    return {
        "fits": errors.folds, "before": _errors(errors.before), "after": _errors(errors.after)
    }  # fmt: skip


def _number(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None


def _numbers(values: Array) -> list[float | None]:
    return [_number(value) for value in values]


def calibrated_urdf(robot: CalibratedRobot) -> str:
    """URDF text of the calibrated robot: its own URDF, calibrated in place.

    Of a robot read by `RobotModel.from_urdf` only the ``<origin>`` elements of joints between the
    base and the measured ends change. The link that is its tool (``tip_link``) and measured
    links are the calibrated ones. All links, joints, meshes, masses, limits and comments stay;
    what is fixed to a link moves with it.

    - Base: the first joint of the chain, if it is fixed, takes the new origin. Without a fixed
      first joint, a new root link ``world`` is added; if ``base_link`` was given, the origin of
      the first moving joint changes instead.
    - Tool: a tool without a link (`RobotModel.with_tool`) becomes a new link ``tool``; the tip
      link is unchanged. If the tool link is the child of a moving joint whose axis changes
      relative to it, a new link is inserted between them, and its meshes move with it.

    A robot without such a source (a table) is written by `to_urdf`.

    Parameters
    ----------
    robot : CalibratedRobot
        The robot.

    Returns
    -------
    str
        Text that `RobotModel.from_urdf` reads back to the same poses of the tool and the measured
        links, with the same ``base_link`` and ``tip_link`` (``tip_link="tool"`` if that is new).
        Its joint variables are where the joints are, not what they read.

    Raises
    ------
    UrdfError
        As `to_urdf`; the robot's table has other joints than its URDF.

    Warns
    -----
    UrdfWarning
        Lists what a URDF has no place for, the errors of the readings among it.

    References
    ----------
    Seed book section 1.4.6.

    Examples
    --------
    >>> from robotmodels.calibration import calibrated_model, candidate_parameters
    >>> from robotmodels.model import RobotModel
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("lab_rr"))
    >>> text = calibrated_urdf(calibrated_model(parameters, np.full(len(parameters), 1e-3)))
    >>> RobotModel.from_urdf(text).n
    2
    """
    if robot.model.source is None:
        text = to_urdf(robot.model)
    else:
        measured = [end.frame for end in robot.ends if isinstance(end.frame, str)]
        text = urdf_in_place(robot.model.parts, measured)
    notes, K = [*robot.notes], robot.model.transmission
    if K is not None and K.is_invertible and robot.model.source is not None:
        notes.append("The transmission is in model: the joints of the text are the table's.")
    if notes:
        warnings.warn(
            f"Not in the URDF: {' '.join(notes)} Keep the calibrated robot (pickle) to keep them.",
            UrdfWarning,
            stacklevel=2,
        )
    return text

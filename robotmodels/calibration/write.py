"""A calibration as a file for other programs: JSON or YAML with units, or a URDF of the robot."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidValueError, MissingExtraError, UrdfWarning
from ..estimation import confidence_intervals
from ..model import to_urdf
from ..urdf.in_place import urdf_in_place
from .result import CalibrationResult
from .robot import CalibratedRobot, as_calibrated
from .solve import states_noise
from .validation import Errors, HeldOutErrors

_FORMAT = 2  # increased when the meaning or the name of an entry changes
_TILT = 1e-3  # of gravity away from the world's -z, rad, beyond which it is named
_COLUMNS = (
    *("names", "antecedent", "sigma"),
    *("gamma", "b", "beta", "alpha", "d", "theta", "r"),
)


def write_result(result: CalibrationResult, path: str | Path) -> None:
    """Write a calibration to a file whose suffix gives its format.

    ``.json`` and ``.yaml`` (needs PyYAML) hold the same: SI units, null for numbers that are not
    finite; ``.urdf`` is that of `calibrated_urdf`. To go on in Python, pickle the result.

    Parameters
    ----------
    result : CalibrationResult
        Of `fit`.
    path : str or Path
        A file named ``.json``, ``.yaml``, ``.yml`` or ``.urdf``.

    Raises
    ------
    InvalidValueError, MissingExtraError, UrdfError, OSError
        Another suffix; PyYAML is not installed; as `calibrated_urdf`; the file cannot be written.

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
    elif suffix in (".yaml", ".yml"):
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
    """A calibration as plain lists, numbers and words, SI units; None for what is not finite."""
    fit, problem = result.solution.fit, result.solution.problem
    validation, table, found = result.validation, result.model.table, result.identifiable
    measurements = zip(problem.measurements, result.solution.scales, strict=True)
    columns = result.names, result.units, result.parameters.nominal, result.corrections
    columns += result.values, result.standard_errors, confidence_intervals(fit)
    parameters = zip(*columns, strict=False)
    errors = fit.standard_errors[problem.P :]
    fixtures = zip(problem.fixtures, result.solution.fixtures, errors, strict=True)
    words = ("name", "unit", "start", "correction", "value", "standard_error", "interval_95")
    data = {
        "format": _FORMAT,
        "robot": result.nominal.name,
        "status": {"name": result.status.name, "sentence": result.reason()},
        "measurements": [
            {
                "name": m.name,
                "kind": type(m).__name__,
                "blocks": m.blocks,
                "rows": m.axes,
                "units": m.units,
                "noise": None if states_noise(m) else scale,
                "files": [{"name": name, "rows": rows} for name, rows in m.files],
            }
            for m, scale in measurements
        ],
        "parameters": [dict(zip(words, row, strict=True)) for row in parameters],
        "covariance": result.covariance,
        "fixtures": [
            {"name": fixture.name, "unit": fixture.unit, "value": value, "standard_error": error}
            for fixture, value, error in fixtures
        ],
        "known": result.known,
        "left_out": {name: why.name for name, why in found.reasons.items()},
        "regrouping": found.regrouping,
        "condition": result.identifiable_after.condition,
        "errors": {
            word: _errors(getattr(validation, word))
            for word in ("given", "nominal", "in_sample", "folds", "held_out")
        },
        "outliers": fit.outliers,
        "base": result.model.base,
        "tool": result.model.tool,
        "ends": [
            {"frame": end.frame, "parent": end.parent, "pose": end.pose}
            for end in result.robot.ends
        ],
        "table": {word: getattr(table, word) for word in _COLUMNS},
        "notes": [*result.notes, *result.robot.notes],
    }
    return dict(_plain(data))


def _errors(errors: Errors | None) -> dict[str, Any] | None:
    """Errors by unit; of those held out, also before the calibration."""
    if errors is None:
        return None
    words = ("rms", "mean", "max", "count")
    sizes: dict[str, Any] = {
        unit: {word: getattr(errors, word)[unit] for word in words} for unit in errors.count
    }
    if isinstance(errors, HeldOutErrors):
        sizes |= {"fits": errors.fits, "nominal": _errors(errors.nominal)}
    return sizes


def _plain(value: Any) -> Any:
    """Lists and numbers in place of tuples, arrays and numbers of NumPy; None for not finite."""
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


def calibrated_urdf(robot: CalibratedRobot | CalibrationResult) -> str:
    """URDF text of the calibrated robot: its own URDF, calibrated in place.

    Of a robot read by `RobotModel.from_urdf` only the ``<origin>`` elements of joints between the
    base and the measured ends change; the link that is its tool (``tip_link``) and measured links
    are the calibrated ones. A robot without such a source is written by `to_urdf`.

    The base is in the first joint if that is fixed; else a root link ``world`` is added, or, if
    ``base_link`` was given, the first moving joint changes. A tool without a link becomes a new
    link ``tool``. Where the axis of a moving joint changes relative to its link that is measured, a
    new link is inserted between them.

    Parameters
    ----------
    robot : CalibratedRobot or CalibrationResult
        The robot, or the result of `fit` that holds it.

    Returns
    -------
    str
        Text that `RobotModel.from_urdf` reads back to the same poses with the same ``base_link``
        and ``tip_link``. Its joint variables are positions of the joints, not readings.

    Raises
    ------
    InvalidValueError, UrdfError
        Another type; as `to_urdf`; the robot's table has other joints than its URDF.

    Warns
    -----
    UrdfWarning
        Lists properties that a URDF cannot hold, such as errors of the readings.

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
    robot = as_calibrated(robot)
    notes, K, g = [*robot.notes], robot.model.transmission, robot.model.gravity
    if np.linalg.norm(g[:2]) > _TILT * np.linalg.norm(g):
        notes.append(
            f"The tilt of the world is in the model's gravity, {g.round(3).tolist()} m/s^2."
        )
    if robot.model.source is None:
        text = to_urdf(robot.model)
    else:
        measured = [end.frame for end in robot.ends if isinstance(end.frame, str)]
        text = urdf_in_place(robot.model.parts, measured)
        if K is not None and K.is_invertible:
            notes.append("The transmission is in model: joints of the URDF are the table's.")
    if notes:
        warnings.warn(
            f"Not in the URDF: {' '.join(notes)} Keep the calibrated robot (pickle) to keep them.",
            UrdfWarning,
            stacklevel=2,
        )
    return text

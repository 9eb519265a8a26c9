"""An identification as a file for other programs: JSON with every option, or a URDF of a robot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._arrays import Array, as_floats
from ...errors import InvalidValueError
from ...model import to_urdf
from ..consistency.identified_robot import consistent_robot
from ..methods.estimate import Estimate, EstimateStatus, Method, check_values
from .result_data import FORMAT, result_data

if TYPE_CHECKING:
    from ..consistency.result import ConsistentFit
    from ..result import IdentificationResult


def write_result(
    result: IdentificationResult, path: str | Path, robot: ConsistentFit | None = None
) -> None:
    """Write an identification; the suffix of the file says how.

    ``.json`` holds SI units, what is not finite as null, and all that is needed to do it again:
    hashes of the data, every choice, versions. ``.urdf`` holds a physically consistent robot.

    Parameters
    ----------
    result : IdentificationResult
        Of `fit`.
    path : str or Path
        A file named ``.json`` or ``.urdf``.
    robot : ConsistentFit, optional
        Of `consistent_robot`, where it is there already: what a URDF is made of, and what JSON
        tells besides; a URDF without it is of a robot near the model's own inertia.

    Raises
    ------
    InvalidValueError
        Another suffix; the solver found no robot; the simulated robot ran away, so that there are
        no parameters.
    UrdfError
        As `to_urdf`.
    InertiaError, MissingExtraError
        As `consistent_robot`.
    OSError
        The file cannot be written.

    Warns
    -----
    UrdfWarning
        What a URDF has no place for.

    References
    ----------
    Seed book section 1.6.5.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> import robotmodels as rm
    >>> from robotmodels.identification import Log, fit
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> arm, t = rm.load("planar_2r"), np.arange(0.0, 20.0, 0.01)[:, None]
    >>> arm, w = arm.with_inertia(uniform_bodies(arm, 5.0)), np.array([1.0, 1.7])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)
    >>> result = fit(arm, Log(0.01, q, rm.idm(arm, q, v, a)), decimation=1)
    >>> with TemporaryDirectory() as folder:
    ...     write_result(result, Path(folder) / "arm.json")
    ...     bool((read_estimate(Path(folder) / "arm.json").values == result.values).all())
    True
    """
    path = Path(path)
    suffix = path.suffix.lower()
    check_values(result.estimate)
    if suffix == ".urdf":
        found = consistent_robot(result) if robot is None else robot
        text = to_urdf(found.of(result.model))
    elif suffix == ".json":
        text = json.dumps(result_data(result, robot), indent=2, ensure_ascii=False) + "\n"
    else:
        raise InvalidValueError(f"path: expected a file named .json or .urdf, got {path.name!r}.")
    path.write_text(text, encoding="utf-8")


def read_estimate(path: str | Path) -> Estimate:
    """The parameters and their covariance from a file of `write_result`.

    Parameters
    ----------
    path : str or Path
        A ``.json`` file.

    Returns
    -------
    Estimate
        To the bit what was written; `predicted_torque` takes its names and values.

    Raises
    ------
    InvalidValueError
        No such file of this or an older version.
    OSError
        It cannot be read.

    Examples
    --------
    >>> from robotmodels.identification import Log, fit
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from tempfile import TemporaryDirectory
    >>> found = fit(arm, log, drive=("Fv",))
    >>> with TemporaryDirectory() as folder:
    ...     write_result(found, Path(folder) / "arm.json")
    ...     again = read_estimate(Path(folder) / "arm.json")
    >>> bool((again.values == found.values).all())
    True
    """
    path = Path(path)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        kind = data["format"]
    except (ValueError, TypeError, KeyError):
        raise InvalidValueError(f"{path}: not a result of an identification.") from None
    if kind != FORMAT or data.get("chapter") != "identification":
        raise InvalidValueError(
            f"{path}: expected an identification of format {FORMAT}, got "
            f"{data.get('chapter')!r} of format {kind!r}."
        )

    try:
        return _estimate(data)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InvalidValueError(
            f"{path}: the parameters cannot be read ({type(error).__name__}: {error!s:.200}); it "
            "was changed after write_result wrote it."
        ) from None


def _estimate(data: dict[str, Any]) -> Estimate:
    def numbers(values: Any) -> Array:
        return np.array(values, dtype=np.float64)  # null becomes NaN

    names = tuple(str(one["name"]) for one in data["parameters"])
    p = len(names)
    covariance = numbers(data["covariance"])
    if covariance.shape != (p, p):
        raise ValueError(f"a covariance of shape {covariance.shape} for {p} parameters")
    return Estimate(
        Method[data["method"]["name"]],
        names,
        as_floats([one["value"] for one in data["parameters"]], "value"),
        covariance,
        numbers(data["sigma"]),
        EstimateStatus[data["status"]["name"]],
        int(data["method"]["iterations"]),
        tuple(map(str, data["method"]["notes"])),
    )

"""Files for controllers, and the coefficients that make the same motion again."""

from __future__ import annotations

import json
from collections.abc import Sequence
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from ..._arrays import Array, as_floats
from ..._choices import chosen
from ...errors import InvalidValueError, ShapeError
from ...geometry import REVOLUTE
from ...trajectories import Trajectory
from .basis import MotionBasis, MotionKind
from .result import ExcitingTrajectory

_FORMAT = "robotmodels exciting trajectory 1"


class TrajectoryFile(Enum):
    """File format of a trajectory."""

    CSV = ".csv"
    NPZ = ".npz"
    YAML = ".yaml"


_MODERATE = 500
"""Order up to which functions are made before their number is compared."""


def write_trajectory(
    trajectory: Trajectory | ExcitingTrajectory,
    path: str | Path,
    rate: float = 1000.0,
    *,
    degrees: bool = False,
    names: Sequence[str] | None = None,
    turns: Sequence[bool] | None = None,
) -> None:
    """Write a motion as samples, for a controller.

    Parameters
    ----------
    trajectory : Trajectory or ExcitingTrajectory
        The motion, n joints.
    path : str or Path
        By its ending: ``.csv`` (t, q, v, a, units in the header), ``.npz`` (arrays t, q, v, a,
        names, units) or ``.yaml`` (the fields of ROS' ``trajectory_msgs/JointTrajectory``).
    rate : float
        Samples per second, Hz. The last sample is the last multiple within the motion.
    degrees : bool
        Whether revolute joints are written in degrees; not for ROS, whose unit is the radian.
    names : sequence of str, length n, optional
        Of the joints; default those of the robot, else ``joint_1`` and so on.
    turns : sequence of bool, length n, optional
        Which joints are revolute; default those of the robot, else all.

    Raises
    ------
    InvalidValueError, ShapeError
        Another ending; a rate that is not positive; degrees for ROS; names of other joints.
    OSError
        The file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from robotmodels.trajectories import quintic
    >>> folder = Path(tempfile.mkdtemp())
    >>> write_trajectory(quintic([0.0], [1.0], duration=1.0), folder / "move.csv", rate=2.0)
    >>> (folder / "move.csv").read_text().splitlines()[0]
    't (s),q joint_1 (rad),v joint_1 (rad/s),a joint_1 (rad/s^2)'
    """
    path = Path(path)
    kind = _kind(path)
    if isinstance(trajectory, ExcitingTrajectory):
        table = trajectory.model.table
        names = list(table.joint_names) if names is None else names
        own = table.sigma[table.joint_rows] == REVOLUTE
        turns = [bool(turn) for turn in own] if turns is None else turns
        motion = trajectory.trajectory
    else:
        motion = trajectory
    hertz = as_floats(rate, "rate")
    if hertz.ndim or hertz <= 0.0:
        raise InvalidValueError(f"rate: expected a positive number of hertz, got {rate!r:.40}.")
    n = motion.n
    labels = [f"joint_{j + 1}" for j in range(n)] if names is None else [str(x) for x in names]
    round_ = [True] * n if turns is None else [bool(x) for x in turns]
    if len(labels) != n or len(round_) != n:
        raise ShapeError(
            f"names, turns: expected one for each of {n} joints, got {len(labels)} and "
            f"{len(round_)}."
        )
    t = np.arange(int(np.floor(motion.duration * float(hertz) * (1.0 + 1e-12))) + 1) / float(hertz)
    t = np.minimum(t, motion.duration)
    q, v, a = motion.motion.derivatives(t, (0, 1, 2))
    if kind is TrajectoryFile.YAML:
        if degrees:
            raise InvalidValueError("degrees: ROS reads radians; leave degrees=False for .yaml.")
        path.write_text(_ros(labels, t, q, v, a), encoding="utf-8")
        return
    factor = np.where(round_, 180.0 / np.pi if degrees else 1.0, 1.0)
    units = [("deg" if degrees else "rad") if turn else "m" for turn in round_]
    q, v, a = (x * factor for x in (q, v, a))
    if kind is TrajectoryFile.NPZ:
        np.savez(path, t=t, q=q, v=v, a=a, names=np.array(labels), units=np.array(units))
        return
    header = ["t (s)"]
    for letter, per in (("q", ""), ("v", "/s"), ("a", "/s^2")):
        header += [f"{letter} {name} ({unit}{per})" for name, unit in zip(labels, units,
                                                                          strict=True)]  # fmt: skip
    np.savetxt(
        path, np.column_stack((t, q, v, a)), delimiter=",", header=",".join(header), comments="",
        fmt="%.12g", encoding="utf-8",
    )  # fmt: skip


def write_coefficients(found: ExcitingTrajectory, path: str | Path) -> None:
    """Write what makes the same motion again, bit by bit, and how good it is, as JSON.

    Parameters
    ----------
    found : ExcitingTrajectory
        The motion.
    path : str or Path
        Of the file.

    Raises
    ------
    OSError
        The file cannot be written.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.identification.excitation import exciting_trajectory
    >>> from tempfile import TemporaryDirectory
    >>> found = exciting_trajectory(
    ...     load("planar_2r"), harmonics=2, starts=1, baseline=1, iterations=2, rng=0
    ... )
    >>> with TemporaryDirectory() as folder:
    ...     write_coefficients(found, Path(folder) / "motion.json")
    ...     again = read_coefficients(Path(folder) / "motion.json")
    >>> bool((again.q(1.0) == found.trajectory.q(1.0)).all())
    True
    """
    text = json.dumps(excitation_data(found), indent=2, ensure_ascii=False, allow_nan=False)
    Path(path).write_text(text + "\n", encoding="utf-8")


def read_coefficients(path: str | Path) -> Trajectory:
    """The motion of a file of `write_coefficients`, exactly as it was.

    Parameters
    ----------
    path : str or Path
        Of the file.

    Returns
    -------
    Trajectory
        Of n joints.

    Raises
    ------
    InvalidValueError
        Another kind of file.
    OSError
        It cannot be read.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.identification.excitation import exciting_trajectory
    >>> from tempfile import TemporaryDirectory
    >>> found = exciting_trajectory(
    ...     load("planar_2r"), harmonics=2, starts=1, baseline=1, iterations=2, rng=0
    ... )
    >>> with TemporaryDirectory() as folder:
    ...     write_coefficients(found, Path(folder) / "motion.json")
    ...     again = read_coefficients(Path(folder) / "motion.json")
    >>> bool((again.q(1.0) == found.trajectory.q(1.0)).all())
    True
    """
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
        made = data["format"] == _FORMAT
        motion = data["motion"] if made else {}
    except (ValueError, KeyError, TypeError):
        made, motion = False, {}
    if not made:
        raise InvalidValueError(f"{path}: expected a file of write_coefficients ({_FORMAT!r}).")
    try:
        basis = MotionBasis(
            chosen(MotionKind, motion["kind"], "kind"), float(motion["duration"]),
            int(motion["order"]), bool(motion["rest"]),
        )  # fmt: skip
        coefficients = as_floats(motion["coefficients"], "coefficients")
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InvalidValueError(f"{path}: the motion cannot be read: {error}.") from None
    if not 0.0 < basis.duration < float("inf"):
        raise InvalidValueError(f"{path}: a motion of {basis.duration} s; expected seconds.")
    rows = len(np.atleast_1d(coefficients))
    if basis.order > max(_MODERATE, rows + 1):  # before functions of that order are made
        raise ShapeError(f"{path}: {rows} rows of coefficients cannot be of order {basis.order}.")
    if coefficients.ndim != 2 or len(coefficients) != basis.count:
        raise ShapeError(
            f"{path}: expected {basis.count} rows of coefficients, got {coefficients.shape}."
        )
    return basis.trajectory(coefficients)


def excitation_data(found: ExcitingTrajectory) -> dict[str, Any]:
    """The result in plain numbers and texts."""
    limits, basis = found.limits, found.basis
    of = limits.motion.limits
    return {
        "format": _FORMAT,
        "robot": found.model.name,
        "status": found.status.name.lower(),
        "sentence": found.status.sentence,
        "criterion": found.criterion.name.lower(),
        "condition": _plain(found.condition),
        "scaled_condition": _plain(found.scaled_condition),
        "weighted_condition": _plain(found.quality.weighted_condition),
        "log_det": _plain(found.log_det),
        "base_parameters": list(found.base.names),
        "starts": [
            {
                "before": _plain(start.before.condition),
                "after": _plain(start.after.condition),
                "iterations": int(start.stages.sum()),
                "status": start.status.name.lower(),
            }
            for start in found.starts
        ],
        "random_conditions": _plain(found.baseline_conditions),
        "limits": {
            "kept": limits.kept,
            "violations": list(limits.violations()),
            "position": _plain(np.stack((of.lower, of.upper))),
            "velocity": _plain(np.stack((of.velocity_lower, of.velocity))),
            "acceleration": _plain(np.stack((of.acceleration_lower, of.acceleration))),
            "torque": _plain(limits.torque_limits),
            "greatest_torque": _plain(limits.torque),
            "clearance": _plain(limits.clearance),
        },
        "notes": list(found.notes),
        "motion": {
            "kind": basis.kind.name.lower(),
            "duration": basis.duration,
            "order": basis.order,
            "rest": basis.rest,
            "coefficients": found.coefficients.tolist(),
        },
    }


def _kind(path: Path) -> TrajectoryFile:
    suffix = ".yaml" if path.suffix.lower() == ".yml" else path.suffix.lower()
    try:
        return TrajectoryFile(suffix)
    except ValueError:
        raise InvalidValueError(
            f"{path.name}: expected the ending .csv, .npz or .yaml, got {path.suffix!r}."
        ) from None


def _ros(names: Sequence[str], t: Array, q: Array, v: Array, a: Array) -> str:
    """The fields of ROS' JointTrajectory; lists in JSON are YAML as well."""
    lines = ["joint_names: " + json.dumps(list(names), ensure_ascii=False), "points:"]
    nanoseconds = np.rint(t * 1e9).astype(np.int64)
    for k, ns in enumerate(nanoseconds):
        sec, nanosec = divmod(int(ns), 1_000_000_000)
        lines += [
            f"- positions: {_list(q[k])}",
            f"  velocities: {_list(v[k])}",
            f"  accelerations: {_list(a[k])}",
            f"  time_from_start: {{sec: {sec}, nanosec: {nanosec}}}",
        ]
    return "\n".join(lines) + "\n"


def _list(row: Array) -> str:
    return "[" + ", ".join(f"{x:.12f}" for x in row) + "]"


def _plain(value: Any) -> Any:
    """Numbers for JSON, which has no infinity."""
    if isinstance(value, np.ndarray):
        return [_plain(x) for x in value]
    number = float(value)
    return number if np.isfinite(number) else None

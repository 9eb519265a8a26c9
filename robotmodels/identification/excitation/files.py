"""Files of trajectories for controllers and scripts."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..._arrays import Array, as_number
from ..._json_data import json_data
from ...errors import InvalidValueError, ShapeError
from ...geometry import REVOLUTE
from ...trajectories import Trajectory
from .result import ExcitingTrajectory


def write_trajectory(
    trajectory: Trajectory | ExcitingTrajectory,
    path: str | Path,
    rate: float = 1000.0,
    *,
    degrees: bool = False,
    names: Sequence[str] | None = None,
    turns: Sequence[bool] | None = None,
) -> None:
    """Write a motion as samples for a controller, or an exciting trajectory with all its numbers.

    Parameters
    ----------
    trajectory : Trajectory or ExcitingTrajectory
        The motion, n joints.
    path : str or Path
        File; its suffix gives the format: ``.csv`` (t, q, v, a, units in the header), ``.npz``
        (arrays t, q, v, a, names, units), ``.yaml`` (the fields of ROS'
        ``trajectory_msgs/JointTrajectory``) or, of an exciting trajectory, ``.json``: condition
        numbers, limits, starts, and in ``motion`` the generator in `trajectories` and its
        arguments, which give the same motion bit by bit.
    rate : float
        Samples per second, Hz. The last sample is the last multiple within the motion.
    degrees : bool
        Whether revolute joints are written in degrees; not for ROS, whose unit is the radian.
    names, turns : sequences of str and bool, length n, optional
        Names of the joints, and whether they are revolute; default those of the robot, else
        ``joint_1`` and so on, and all.

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
    ending = path.suffix.lower().replace(".yml", ".yaml")
    if ending not in (".csv", ".npz", ".yaml", ".json"):
        raise InvalidValueError(
            f"{path.name}: expected the ending .csv, .npz, .yaml or .json, got {path.suffix!r}."
        )
    if isinstance(trajectory, ExcitingTrajectory):
        if ending == ".json":
            data = excitation_data(trajectory)
            text = json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False)
            path.write_text(text + "\n", encoding="utf-8")
            return
        table, motion = trajectory.model.table, trajectory.trajectory
        names = names or table.joint_names
        turns = (table.sigma[table.joint_rows] == REVOLUTE).tolist() if turns is None else turns
    else:
        motion = trajectory
        if ending == ".json":
            raise InvalidValueError(f"{path.name}: .json is for exciting trajectories; take .csv.")
    hertz = as_number(rate, "rate", above=0.0)
    n = motion.n
    names = names or [f"joint_{j + 1}" for j in range(n)]
    turns = [True] * n if turns is None else turns
    if len(names) != n or len(turns) != n:
        raise ShapeError(
            f"names, turns: expected one for each of {n} joints, got {len(names)} and {len(turns)}."
        )
    t = np.arange(int(np.floor(motion.duration * hertz * (1.0 + 1e-12))) + 1) / hertz
    t = np.minimum(t, motion.duration)
    q, v, a = motion.motion.derivatives(t, (0, 1, 2))
    if ending == ".yaml":
        if degrees:
            raise InvalidValueError("degrees: ROS reads radians; leave degrees=False for .yaml.")
        path.write_text(_ros(names, t, q, v, a), encoding="utf-8")
        return
    factor = np.where(turns, 180.0 / np.pi if degrees else 1.0, 1.0)
    units = [("deg" if degrees else "rad") if turn else "m" for turn in turns]
    q, v, a = (x * factor for x in (q, v, a))
    if ending == ".npz":
        np.savez(path, t=t, q=q, v=v, a=a, names=np.array(names), units=np.array(units))
        return
    header = ["t (s)"] + [
        f"{letter} {name} ({unit}{per})"
        for letter, per in (("q", ""), ("v", "/s"), ("a", "/s^2"))
        for name, unit in zip(names, units, strict=True)
    ]
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(header)  # names may hold commas
        np.savetxt(file, np.column_stack((t, q, v, a)), "%.12g", ",")


def excitation_data(result: ExcitingTrajectory) -> dict[str, Any]:
    """The result in plain numbers and texts."""
    limits, of = result.limits, result.limits.motion.limits
    generator, arguments = result.basis.arguments(result.coefficients)
    data = {
        "robot": result.model.name,
        "status": result.status,
        "sentence": result.status.sentence,
        "criterion": result.criterion,
        **asdict(result.quality),
        "base_parameters": result.base.names,
        "starts": [
            {
                "before": start.before.condition,
                "after": start.after.condition,
                "iterations": start.stages.sum(),
                "status": start.status,
            }
            for start in result.starts
        ],
        "random_conditions": result.baseline_conditions,
        "limits": {
            "kept": limits.kept,
            "violations": limits.violations(),
            "position": (of.lower, of.upper),
            "velocity": (of.velocity_lower, of.velocity),
            "acceleration": (of.acceleration_lower, of.acceleration),
            "torque": limits.torque_limits,
            "greatest_torque": limits.torque,
            "clearance": limits.clearance,
        },
        "notes": result.notes,
        "motion": {"generator": generator, "arguments": arguments},
    }
    return json_data(data)


def _ros(names: Sequence[str], t: Array, q: Array, v: Array, a: Array) -> str:
    """The fields of ROS' JointTrajectory; lists in JSON are YAML as well."""
    lines = ["joint_names: " + json.dumps([*map(str, names)], ensure_ascii=False), "points:"]
    for k, nanoseconds in enumerate(np.rint(t * 1e9).astype(np.int64).tolist()):
        for mark, name, row in (
            ("-", "positions", q),
            (" ", "velocities", v),
            (" ", "accelerations", a),
        ):
            lines.append(f"{mark} {name}: [{', '.join(f'{x:.12f}' for x in row[k])}]")
        sec, nanosec = divmod(nanoseconds, 1_000_000_000)
        lines.append(f"  time_from_start: {{sec: {sec}, nanosec: {nanosec}}}")
    return "\n".join(lines) + "\n"

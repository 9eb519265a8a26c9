"""Results of a search for an exciting trajectory, and files of trajectories."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from ..._arrays import Array, Frozen, as_number
from ..._json_data import json_data
from ..._outcomes import Outcome
from ...errors import InvalidValueError, ShapeError
from ...geometry import REVOLUTE
from ...minimal_parameters import BaseParameters
from ...model import RobotModel
from ...trajectories import LimitsReport, Trajectory
from .motions import KINDS, MotionBasis


class ExcitationStatus(Outcome):
    """Outcome of a search."""

    CONVERGED = 0, "The criterion decreased by less than 1 % in the last 25 iterations."
    LIMIT_OF_ITERATIONS = 1, "The iterations ended before the criterion converged (iterations=)."
    INFEASIBLE = 2, "No motion was found that keeps every limit."


@dataclass(frozen=True, slots=True)
class ExcitationQuality:
    """Condition numbers of a stacked base regressor, with the exact sign of dry friction.

    The condition numbers are in SI units, with columns of length 1, and weighted by the noise of
    the joints and the sizes of the parameters; ``log_det`` is that of the weighted ``W^T W / N``.
    """

    condition: float
    scaled_condition: float
    weighted_condition: float
    log_det: float

    def of(self, criterion: str) -> float:
        """Value that the criterion minimises."""
        return self.weighted_condition if criterion == "condition" else -self.log_det


@dataclass(frozen=True, slots=True, eq=False)
class ExcitationLimits(Frozen):
    """Extremes of a motion and limits: joints, torques (n,), least distance in m (inf if none).

    Those of torques and distances have an allowance for extremes between samples.
    """

    motion: LimitsReport
    torque_limits: Array
    torque: Array
    clearance: float

    @property
    def kept(self) -> bool:
        """Whether all limits are kept."""
        return not self.violations()

    def violations(self) -> tuple[str, ...]:
        """The limits that are not kept, one sentence each."""
        found = [
            f"joint {j + 1}: torque {self.torque[j]:.6g}, allowed {self.torque_limits[j]:.6g}"
            for j in np.flatnonzero(self.torque > self.torque_limits)
        ]
        if self.clearance < 0.0:
            found.append(
                f"workspace, obstacles: a frame is {-self.clearance:.4g} m outside of the "
                "workspace or within an obstacle"
            )
        return (*self.motion.violations(), *found)


@dataclass(frozen=True, slots=True, eq=False)
class ExcitationStart(Frozen):
    """One start: its random motion and the improved one, and the smooth criterion (K,) in between.

    ``stages`` are the iterations of each stage; between them the criterion may jump.
    """

    before: ExcitationQuality
    after: ExcitationQuality
    history: Array
    stages: Array
    status: ExcitationStatus

    def rank(self, criterion: str) -> tuple[bool, float]:
        """Sort key; the best start has the smallest."""
        return self.status is ExcitationStatus.INFEASIBLE, self.after.of(criterion)


@dataclass(frozen=True, slots=True, eq=False)
class ExcitingTrajectory(Frozen):
    """Exciting trajectory for the identification of base parameters, with its quality and limits.

    Parameters
    ----------
    trajectory, model, base, criterion
        One period, n joints; the robot; the parameters to be identified; the criterion.
    limits : ExcitationLimits
        Extremes and limits: ``kept``, ``violations()``, ``motion``, ``torque``,
        ``torque_limits``, ``clearance``.
    starts, baseline : tuples of ExcitationStart and ExcitationQuality
        Every start (``before, after, history, stages, status``); random motions within the limits.
    basis, coefficients : MotionBasis, ndarray of shape (P, n)
        Functions that the motion is made of, and their coefficients.
    notes : tuple of str
        Limits that were assumed, and how far the starts agree.
    """

    trajectory: Trajectory
    model: RobotModel
    base: BaseParameters
    criterion: str
    limits: ExcitationLimits
    starts: tuple[ExcitationStart, ...]
    baseline: tuple[ExcitationQuality, ...]
    basis: MotionBasis
    coefficients: Array
    notes: tuple[str, ...] = ()

    @property
    def best(self) -> ExcitationStart:
        """The start that became the trajectory."""
        return min(self.starts, key=lambda start: start.rank(self.criterion))

    status = property(attrgetter("best.status"), doc="Outcome of the best start.")
    quality = property(attrgetter("best.after"), doc="Condition numbers and log det.")
    condition = property(attrgetter("best.after.condition"), doc="Condition number, SI units.")
    scaled_condition = property(attrgetter("best.after.scaled_condition"), doc="Of unit columns.")
    log_det = property(attrgetter("best.after.log_det"), doc="Of the mean information of a sample.")

    @property
    def baseline_conditions(self) -> Array:
        """Condition numbers of the random motions, ascending."""
        return np.sort([quality.condition for quality in self.baseline])

    def __str__(self) -> str:
        random = self.baseline_conditions
        lines = [
            f"Exciting trajectory of {self.model.name}: {KINDS[self.basis.kind]}, "
            f"{self.basis.duration:g} s, {len(self.base)} base parameters",
            f"  {self.status.sentence}",
            f"  condition number     {self.condition:10.4g}",
            f"  with scaled columns  {self.scaled_condition:10.4g}",
            f"  log det              {self.log_det:10.4g}",
        ]
        if random.size:
            lines.append(
                f"  {random.size} random motions within the same limits: condition number "
                f"{np.median(random):.4g} in the middle, {random[0]:.4g} at best"
            )
        after = ", ".join(f"{start.after.condition:.4g}" for start in self.starts)
        lines.append(f"  condition numbers of the {len(self.starts)} starts: {after}")
        broken = self.limits.violations()
        lines.append("  limits that are not kept:" if broken else "  every limit is kept")
        lines += [f"    {line}" for line in broken]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])

    def __repr__(self) -> str:
        status = self.status.name.lower().replace("_", " ")
        return (
            f"<ExcitingTrajectory of {self.model.name!r}: condition number {self.condition:.4g}, "
            f"{status}>"
        )


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

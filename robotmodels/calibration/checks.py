"""Checks of measurements before a fit: readings and limits, repeated rows, units of lengths."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import permutations
from math import exp, log

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import InvalidValueError
from ..geometry import REVOLUTE
from ..kinematics import dgm
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel
from .measurements import (
    CameraPose,
    Distance,
    KnownDistance,
    Measurement,
    PointContact,
    Pose,
    Position,
    RelativePose,
    single_observations,
)
from .measurements.motions import best_motion
from .problem import Problem, measured_frames

_TURNS = 30.0  # largest plausible reading of a revolute joint, rad; beyond it, degrees are assumed
_TOLERANCE = 0.02  # tolerance beyond a limit, rad or m and relative to the range
_MOST = 0.6
"""Share of readings beyond a limit above which they are refused; simulated readings over a
symmetric range have a share of 0.5 where a limit is at zero."""
_HARDLY = 0.02  # standard deviation of a joint's readings below which it hardly moves, rad or m
_UNITS = {"metres": 1.0, "centimetres": 1e-2, "inches": 0.0254, "millimetres": 1e-3}
_SLIPS = {
    (unit, taken): _UNITS[taken] / _UNITS[unit]
    for unit, taken in permutations(_UNITS, 2)
    if {unit, taken} != {"centimetres", "inches"}
}
"""Ratio of stated to true lengths, by their unit and the unit that was assumed."""
_NEAR = 0.15  # relative tolerance of a unit factor
_ALIKE = 0.3  # largest relative residual of measured against scaled nominal lengths
_FAR = 3.0
"""Difference of a known distance, in scatters of the nominal points, for a check of its unit."""
_SPREAD = 50.0  # implausible ratio of measured lengths to the robot's reach
_FEW = 7  # smallest number of lengths for the check of a pivot


def notes_before(problem: Problem) -> tuple[str, ...]:
    """Notes on the measurements before the fit; errors that no fit can repair are raised."""
    model, measurements = problem.parameters.model, problem.measurements
    path = problem.parameters.table.path
    moving = {row for frame in measured_frames(measurements) for row in path(frame)}
    notes = check_readings(model, measurements, moving)
    check_units(model, measurements)
    owners = Counter((m.name, f.name) for m in measurements if m.views for f in m.fixtures)
    for k, m in enumerate(measurements):
        if m.views and (twice := _duplicates(m)):
            notes.append(
                f"measurements[{k}] ({m.name}): {twice} of {m.blocks} rows repeat another row "
                "exactly; they add no information, but make the standard errors too small. Leave "
                "them out."
            )
    notes += [
        f"More than one measurement is called {name!r}: equal labels are taken as the same point, "
        "plane or pose. Give them names of their own (name=...) if they are not."
        for name in dict.fromkeys(name for (name, _), count in owners.items() if count > 1)
    ]
    notes += single_observations(measurements).values()
    readings = [view.q for m in measurements for view in m.views]
    for j, q in enumerate(np.concatenate(readings).T if readings else ()):
        row = model.table.joint_rows[j]
        if row + 1 in moving and float(np.std(q)) < _HARDLY:
            unit = "rad" if model.table.sigma[row] == REVOLUTE else "m"
            notes.append(
                f"Joint {j + 1} ({model.table.joint_names[j]}) moves by {np.ptp(q):.2g} {unit} "
                "only: the frames before and after it can hardly be distinguished. Measure with "
                "that joint spread over its range."
            )
    return tuple(notes)


def _duplicates(m: Measurement) -> int:
    """Number of blocks whose readings and measured values repeat those of another one."""
    rows = [*(view.q for view in m.views), m.groups[:, None].astype(np.float64)]
    if isinstance(m, Pose | Position):
        rows.append((m.T if isinstance(m, Pose) else m.p).reshape(m.blocks, -1))
    return m.blocks - len(np.unique(np.hstack(rows), axis=0))


# --- readings and limits --------------------------------------------------------------------------


def check_readings(
    model: RobotModel, measurements: Sequence[Measurement], rows: set[int]
) -> list[str]:
    """Compare readings with the limits of the joints: notes, or an error."""
    notes: list[str] = []
    revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE
    for k, m in enumerate(measurements):
        if not m.views:
            continue
        where = f"measurements[{k}] ({m.name})"
        q = np.concatenate([view.q for view in m.views])
        largest = float(np.abs(q[:, revolute]).max(initial=0.0))
        if largest > _TURNS:
            raise InvalidValueError(
                f"{where}: a revolute joint reads {largest:.4g} rad; these look like degrees. "
                "Pass radians: np.deg2rad(q)."
            )
        sentences, most = beyond_limits(model, q, rows)
        if not sentences:
            continue
        note = (
            f"{where}: readings beyond the limits of the joints: {'; '.join(sentences)}. Check "
            "that the columns are readings in the order of the joints, with the signs and zeros "
            "of the model, in rad and m. If the limits of the model are wrong, give it others: "
            "model.with_table(model.table.replace(lower=..., upper=...))."
        )
        if most:
            raise InvalidValueError(note)
        notes.append(note)
    return notes


def beyond_limits(model: RobotModel, q: Array, rows: set[int]) -> tuple[list[str], bool]:
    """Sentences on joints beyond their limits, and whether to refuse them. Shapes: q (N, n)."""
    lower, upper = model.lower, model.upper
    width = np.where(np.isfinite(upper - lower), upper - lower, 0.0)
    tolerance = _TOLERANCE * np.maximum(1.0, width)
    checked = (upper > lower) & [row + 1 in rows for row in model.table.joint_rows]
    over = np.where(checked, np.maximum(lower - q, q - upper), -np.inf)
    number = (over > tolerance).sum(axis=0)
    sentences = []
    for j in np.flatnonzero(number):
        is_revolute = model.table.sigma[model.table.joint_rows[j]] == REVOLUTE
        sentences.append(
            f"joint {j + 1} ({model.table.joint_names[j]}) in {number[j]} of {len(q)} readings, by "
            f"up to {over[:, j].max():.3g} {'rad' if is_revolute else 'm'} (reads "
            f"{q[:, j].min():.4g} to {q[:, j].max():.4g}, limits {lower[j]:.4g} to {upper[j]:.4g})"
        )
    return sentences, bool((number > _MOST * len(q)).any())


# --- units of lengths -----------------------------------------------------------------------------


def _slip(pair: tuple[str, str], ratio: float) -> tuple[str, float]:
    """Sentence on lengths given in a wrong unit, and the factor that corrects them."""
    unit, taken = pair
    looks = f", as if {unit} had been converted as {taken}"
    looks = f"; these look like {unit}" if taken == "metres" else looks
    text = f"{ratio:.4g} times what the robot's nominal geometry gives{looks}"
    return text, 1.0 / _SLIPS[pair]


def _slip_of(ratio: float, near: float = _NEAR) -> tuple[str, float] | None:
    """The slip whose factor is near a ratio of measured to nominal lengths."""
    if not 0.0 < ratio < np.inf:
        return None
    pair = min(_SLIPS, key=lambda key: abs(log(ratio / _SLIPS[key])))
    return _slip(pair, ratio) if abs(log(ratio / _SLIPS[pair])) < log(1.0 + near) else None


def _slip_between(pairs: Iterable[tuple[Array, Array]]) -> tuple[str, float] | None:
    """The slip of nominal and measured lengths that are proportional."""
    for nominal, measured in pairs:
        square = float((nominal * nominal).sum())
        ratio = float((nominal * measured).sum()) / square if square > 0.0 else 0.0
        left = float(np.linalg.norm(measured - ratio * nominal))
        slip = _slip_of(ratio)
        if slip is not None and left < _ALIKE * float(np.linalg.norm(measured)):
            return slip
    return None


def _aligned(nominal: Array, measured: Array) -> tuple[Array, Array]:
    """Displacements from the mean, the nominal ones turned to the measured ones."""
    if len(nominal) < 3:
        return np.zeros((0, 3)), np.zeros((0, 3))
    R = best_motion(nominal, measured)[:3, :3]
    return (nominal - nominal.mean(axis=0)) @ R.T, measured - measured.mean(axis=0)


def _from_pivot(p: Array, length: Array) -> tuple[Array, Array]:
    """Nominal and measured lengths from a pivot c: ``|p - c|^2 = s length^2`` gives c and s."""
    if len(p) < _FEW:
        return np.zeros(0), np.zeros(0)
    x = p - p.mean(axis=0)
    square = (x * x).sum(axis=1)
    A = np.column_stack([x, np.ones(len(x)), (length / length.max()) ** 2])
    found = np.linalg.lstsq(A, square, rcond=None)[0]
    if np.linalg.norm(A @ found - square) > _ALIKE * np.linalg.norm(square - square.mean()):
        return np.zeros(0), np.zeros(0)
    return np.sqrt(max(found[-1], 0.0)) * length / length.max(), length


def check_units(model: RobotModel, measurements: Sequence[Measurement]) -> None:
    """Refuse lengths in another unit than metres."""
    points: dict[str, list[Array]] = {}
    for k, m in enumerate(measurements):
        quantity, pairs, size = _lengths_of(model, m)
        slip = _slip_between(pairs)
        if slip is None and size > _SPREAD:
            slip = _slip(("millimetres", "metres"), size)
        if slip is not None:
            raise InvalidValueError(
                f"measurements[{k}] ({m.name}): {quantity} are {slip[0]}. Pass metres: multiply by "
                f"{slip[1]:.4g}."
            )
        if isinstance(m, PointContact):
            for label, p in zip(m.label, dgm(model, m.q, m.frame)[:, :3, 3], strict=True):
                points.setdefault(f"{m.name}:{label}", []).append(p)
    for m in measurements:
        if isinstance(m, KnownDistance) and m.point in points and m.other in points:
            _check_distance(m, np.array(points[m.point]), np.array(points[m.other]))


def _lengths_of(model: RobotModel, m: Measurement) -> tuple[str, list[tuple[Array, Array]], float]:
    """The measured quantity, nominal and measured lengths, and their size by the reach or 0."""
    none: list[tuple[Array, Array]] = []
    if not isinstance(m, Pose | Position | CameraPose | RelativePose | Distance):
        return "", none, 0.0
    T = dgm(model, m.q, m.frame)
    p, reach = T[:, :3, 3], characteristic_length(model, m.frame)
    if isinstance(m, Distance):
        if m.offset:
            return "", none, 0.0
        groups = (m.groups == k for k in range(len(m.labels)))
        pairs = [_from_pivot(p[one], m.length[one]) for one in groups]
        if m.q_other is not None:
            other = dgm(model, m.q_other, m.frame)[:, :3, 3]
            pairs = [(np.linalg.norm(p - other, axis=1), m.length)]
        return "lengths", pairs, float(np.median(m.length)) / reach
    if not all(m.rows[:3]):
        return "", none, 0.0
    if isinstance(m, Position | Pose):
        measured = m.p if isinstance(m, Position) else m.T[:, :3, 3]
        spread = float(np.linalg.norm(np.ptp(measured, axis=0))) / reach
        return "positions", [_aligned(p, measured)], spread
    if isinstance(m, RelativePose):
        moved = se3.inverse(T) @ dgm(model, m.q_other, m.frame)
        return "displacements", [(moved[:, :3, 3], m.T[:, :3, 3])], 0.0
    seen = se3.inverse(m.T)[:, :3, 3]
    pairs = [_aligned(p[m.groups == k], seen[m.groups == k]) for k in range(len(m.labels))]
    return "positions of the boards", pairs if all(m.rows) else none, 0.0


def _check_distance(m: KnownDistance, one: Array, other: Array) -> None:
    """Refuse a known distance in another unit."""
    apart = float(np.linalg.norm(one.mean(axis=0) - other.mean(axis=0)))
    spread = np.concatenate([one - one.mean(axis=0), other - other.mean(axis=0)])
    scatter = float(np.sqrt((spread**2).sum(axis=1).mean()))
    if abs(m.length - apart) <= _FAR * scatter:
        return
    # halfway to the next factor, that of inches, if the nominal robot is no better
    near = min(_NEAR + scatter / max(apart, 1e-12), exp(0.5 * log(39.37 / 25.4)) - 1.0)
    slip = _slip_of(m.length / max(apart, 1e-12), near)
    if slip is not None:
        raise InvalidValueError(
            f"{m.name} {m.point} to {m.other}: {m.length:.6g} m is {slip[0]}. The nominal "
            f"robot gives {apart:.4g} m. Pass metres: {slip[1] * m.length:.5g}."
        )

"""Notes on measurements and fits."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..estimation import FitStatus
from ..geometry import REVOLUTE
from .folds import AsideErrors
from .identifiable import IdentifiableParameters
from .length_units import check_units
from .measurements import Pose, Position, lonely_labels
from .measurements.measurement import origin_of
from .parameters import ErrorLaw
from .problem import Problem, measured_frames
from .reading_limits import check_readings
from .reporting.units import in_unit, printed_unit
from .solve import Solution

_HARDLY = 0.02
"""Standard deviation of a joint's readings below which it hardly moves, rad or m."""
_FAR = 50.0
"""Residual in stated standard deviations that units explain better than noise."""
_UNLIKELY = 0.02
"""Noise that is estimated, relative to the robot or in rad, that no measurement of a robot has."""
_OTHER_LENGTH, _OTHER_ANGLE = 0.1, 0.35
"""Deviations beyond which it is another robot, in sizes of the robot and rad."""
_NO_GAIN = 0.98
_LISTED = 10
_FEW = 0.5
_CONFUSED = 50.0
"""Standard deviation, in that of the parameter if it were alone, beyond which others hide it."""


def notes_before(problem: Problem) -> tuple[str, ...]:
    """Notes on the measurements before the fit."""
    model = problem.parameters.model
    revolute = model.table.sigma[model.table.joint_rows] == REVOLUTE
    moving = {
        row
        for f in measured_frames(problem.measurements)
        for row in problem.parameters.skeleton.path(f)
    }
    notes = check_readings(model, problem.measurements, moving)
    check_units(model, problem.measurements)
    for k, m in enumerate(problem.measurements):
        where = f"measurements[{k}] ({m.name})"
        twice = _duplicates(problem, k)
        if twice:
            notes.append(
                f"{where}: {twice} of {m.blocks} rows repeat another row exactly; they add no "
                "information, but make the standard deviations too small. Leave them out."
            )
    notes += _same_names(problem)
    notes += [str(lonely) for lonely in lonely_labels(problem.measurements)]
    for j, reading in enumerate(_all_readings(problem).T):
        row = model.table.joint_rows[j] + 1
        if row in moving and len(reading) and float(np.std(reading)) < _HARDLY:
            unit = "rad" if revolute[j] else "m"
            notes.append(
                f"Joint {j + 1} ({model.table.joint_names[j]}) moves by {np.ptp(reading):.2g} "
                f"{unit} only: the frames before and after it can hardly be distinguished. Measure "
                "with that joint spread over its range."
            )
    return tuple(notes)


def notes_after(
    solution: Solution, before: IdentifiableParameters, again: IdentifiableParameters
) -> tuple[str, ...]:
    """Notes on the solution of a fit."""
    fit, problem = solution.fit, solution.problem
    notes = []
    if fit.status is not FitStatus.CONVERGED:
        notes.append(fit.status.sentence)
    lost = [name for name in before.names if name not in again.names]
    gained = [name for name in again.names if name not in before.names]
    if lost or gained:
        notes.append(
            "At the solution the identifiable parameters differ from those at the nominal robot."
            + (f" No longer: {', '.join(lost)}; their estimates are doubtful." if lost else "")
            + (f" Also: {', '.join(gained)}; these were not estimated." if gained else "")
        )
    hidden = _hidden(solution)
    if hidden:
        notes.append(
            f"{', '.join(hidden)}: nearly indistinguishable (standard errors over {_CONFUSED:g} "
            "times those with the other parameters known). "
            "Choose configurations with select_configurations, leave one of them out (known=...), "
            f"or give a prior{' of its own (named=...)' if _has_prior(solution) else ''}."
        )
    first = 0
    for m in problem.measurements:
        rows = slice(first, first + m.blocks * len(m.axes))
        first = rows.stop
        size = float(np.sqrt(np.mean(fit.residuals[rows] ** 2)))
        if (m.sigma is not None or m.covariance is not None) and size > _FAR:
            notes.append(
                f"{m.name}: residuals are {size:.3g} times the stated standard deviations. Look "
                "for a slip of units (mm for m, degrees for rad), a wrong frame, or readings that "
                "do not belong to their measurements."
            )
        elif (
            m.views
            and (m.sigma is not None or m.covariance is not None)
            and 0.0 < size < 1.0 / _FAR
        ):
            notes.append(
                f"{m.name}: residuals are {1.0 / size:.3g} times smaller than the stated standard "
                "deviations. Look for a slip of units in sigma; the standard errors of the "
                "parameters depend on it."
            )
    notes += _unlikely_deviations(solution)
    spare, unknowns = problem.rows - problem.P - problem.F, problem.P + problem.F
    if spare < _FEW * unknowns:
        notes.append(
            f"{spare} rows more than the {unknowns} unknowns: too few to know the noise well, so "
            "standard deviations are uncertain and intervals too short. Measure more "
            "configurations."
        )
    if len(fit.outliers):
        one = len(fit.outliers) == 1
        rows = [row for m in problem.measurements for row in origin_of(m) or [None] * m.blocks]
        numbers = ", ".join(
            f"{b + 1}" + (f" in {rows[b]}" if rows[b] else "") for b in fit.outliers[:_LISTED]
        )
        more = " and others" if len(fit.outliers) > _LISTED else ""
        notes.append(
            f"{len(fit.outliers)} of {problem.blocks} measurements "
            f"{'is an outlier (number' if one else 'are outliers (numbers'} {numbers}{more}, "
            f"counted from 1): {'its' if one else 'their'} residuals are larger than noise "
            "explains."
        )
    return tuple(notes)


def notes_of_errors(
    solution: Solution, validation: AsideErrors | None, held_out: AsideErrors | None
) -> tuple[str, ...]:
    """Notes that come first: implausible residuals, and no gain on data kept aside."""
    notes = _implausible(solution)
    found = []
    for unit, word in (("m", "position"), ("rad", "angle")):
        changes = []
        for aside, name in ((validation, "cross-validation"), (held_out, "held out")):
            if aside is None:
                continue
            after, was = aside.after.summary(unit), aside.before.summary(unit)
            if after.blocks and was.blocks and after.rms > _NO_GAIN * was.rms:
                changes.append(f"{name} {in_unit(was.rms, unit)} to {in_unit(after.rms, unit)}")
        if changes:
            found.append(f"{word} error ({', '.join(changes)} {printed_unit(unit)}, rms)")
    if found:
        notes.append(
            f"Calibration does not lower the {' and the '.join(found)} on data kept aside. The "
            "noise or the number of measurements does not support this many parameters: fewer "
            f"parameters, a {'narrower ' if _has_prior(solution) else ''}prior, or more data."
        )
    return tuple(notes)


def is_implausible(solution: Solution) -> bool:
    """Whether the residuals are larger than those of any measurement of this robot."""
    return bool(_implausible(solution))


def _implausible(solution: Solution) -> list[str]:
    """Notes on measurements whose estimated noise is larger than that of any measurement."""
    length, notes = solution.problem.parameters.skeleton.size, []
    for m, scale in zip(solution.problem.measurements, solution.scales, strict=True):
        if m.sigma is None and m.covariance is None and not solution.fit.sigma_known:
            size = max(
                (s / (length if unit == "m" else 1.0))
                for s, unit in zip(scale, m.units, strict=True)
            )
            if size > _UNLIKELY:
                notes.append(
                    f"{m.name}: what is left is {100.0 * size:.2g} % of the robot's size (or of a "
                    "radian). Look for readings that do not belong to their measurements, joints "
                    "in another order, a wrong frame or units."
                )
    return notes


def _has_prior(solution: Solution) -> bool:
    return bool(np.isfinite(solution.fit.prior.sigma).any())


def _unlikely_deviations(solution: Solution) -> list[str]:
    """Parameters of the table that would be another robot's."""
    parameters = solution.problem.parameters
    f = parameters.model.f
    size = solution.problem.parameters.skeleton.size
    far = [
        f"{entry.name} by {value:.3g} {entry.unit}"
        for entry, value in zip(parameters.entries, solution.deviation, strict=True)
        if entry.law is ErrorLaw.CONSTANT and 0 < entry.row <= f
        and abs(value) > (_OTHER_LENGTH * size if entry.element.is_length else _OTHER_ANGLE)
    ]  # fmt: skip
    if not far:
        return []
    return [
        f"{', '.join(far)}: deviations that no robot has. Look for a slip of units (mm for m, "
        "degrees for rad), joints in another order or with another sign or zero, rotations the "
        "other way round; or the data do not determine these parameters."
    ]


def _hidden(solution: Solution) -> list[str]:
    """Parameters of the table whose estimates depend on each other, or one and its partner."""
    fit, parameters = solution.fit, solution.problem.parameters
    if not np.isfinite(fit.covariance).all():
        return []
    alone = np.linalg.norm(fit.jacobian * np.sqrt(fit.weights)[:, None], axis=0)
    scale = 1.0 if fit.sigma_known else fit.scale
    inflation = fit.standard_errors * alone / max(scale, 1e-300)
    has_prior = np.isfinite(fit.prior.sigma)  # it says what the data do not
    found = [
        k for k, entry in enumerate(parameters.entries)
        if inflation[k] > _CONFUSED and not has_prior[k] and 0 < entry.row <= parameters.model.f
    ]  # fmt: skip
    if len(found) == 1 and len(parameters) > 1:
        P = len(parameters)
        correlation = np.abs(fit.covariance[found[0], :P]) / fit.standard_errors[:P]
        correlation[found[0]] = -np.inf
        found.append(int(np.argmax(correlation)))
    return [parameters.names[k] for k in found]


def _same_names(problem: Problem) -> list[str]:
    """Kinds that share fixtures because they share a name, which may be meant or not."""
    seen: dict[str, set[str]] = {}
    shared = []
    for m in problem.measurements:
        names = {fixture.name for fixture in m.fixtures}
        if m.views and names & seen.get(m.name, set()):
            shared.append(m.name)
        if m.views:
            seen.setdefault(m.name, set()).update(names)
    return [
        f"More than one measurement is called {name!r}: equal labels are taken as the same point, "
        "plane or pose. Give them names of their own (name=...) if they are not."
        for name in dict.fromkeys(shared)
    ]


def _duplicates(problem: Problem, k: int) -> int:
    """Blocks whose readings and residuals repeat those of another one."""
    m = problem.measurements[k]
    if not m.views:
        return 0
    rows = [view.q for view in m.views]
    if isinstance(m, Pose):
        rows.append(m.T.reshape(m.blocks, -1))
    elif isinstance(m, Position):
        rows.append(m.p)
    rows.append(m.groups[:, None].astype(np.float64))
    return m.blocks - len(np.unique(np.hstack(rows), axis=0))


def _all_readings(problem: Problem) -> Array:
    views = [view.q for m in problem.measurements for view in m.views]
    return np.concatenate(views) if views else np.zeros((0, problem.parameters.model.n))

"""Notes on measurements and fits."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..estimation import FitStatus
from ..geometry import REVOLUTE
from ..table_text import in_unit, printed_unit
from .identifiable import IdentifiableParameters
from .joint_readings import check_readings
from .length_units import check_units
from .measurements import Measurement, Pose, Position, single_observations
from .parameters import ErrorLaw
from .problem import Problem, measured_frames
from .solve import Solution, states_noise
from .validation import Validation

_HARDLY = 0.02  # standard deviation of a joint's readings below which it hardly moves, rad or m
_FAR = 50.0  # residual in stated standard deviations that units explain better than noise
_IMPLAUSIBLE = 0.02
"""Noise that is estimated, relative to the robot or in rad, that no measurement of a robot has."""
_OTHER_LENGTH, _OTHER_ANGLE = 0.1, 0.35
"""Corrections that are implausibly large, in sizes of the robot and rad."""
_NO_GAIN = 0.98
_LISTED = 10
_FEW = 0.5
_CONFUSED = 50.0
"""Ratio of the standard error to that with all others known, from which a note is given."""


def notes_before(problem: Problem) -> tuple[str, ...]:
    """Notes on the measurements before the fit; errors that no fit can repair are raised."""
    model, measurements = problem.parameters.model, problem.measurements
    path = problem.parameters.table.path
    moving = {row for frame in measured_frames(measurements) for row in path(frame)}
    notes = check_readings(model, measurements, moving)
    check_units(model, measurements)
    for k, m in enumerate(measurements):
        if twice := _duplicates(m):
            notes.append(
                f"measurements[{k}] ({m.name}): {twice} of {m.blocks} rows repeat another row "
                "exactly; they add no information, but make the standard errors too small. Leave "
                "them out."
            )
    notes += _shared_names(measurements)
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
    if not m.views:
        return 0
    rows = [*(view.q for view in m.views), m.groups[:, None].astype(np.float64)]
    if isinstance(m, Pose | Position):
        rows.append((m.T if isinstance(m, Pose) else m.p).reshape(m.blocks, -1))
    return m.blocks - len(np.unique(np.hstack(rows), axis=0))


def _shared_names(measurements: tuple[Measurement, ...]) -> list[str]:
    """Measurements that share fixtures because they share a name, which may be meant or not."""
    fixtures: dict[str, set[str]] = {}
    shared: dict[str, None] = {}
    for m in (m for m in measurements if m.views):
        names = {fixture.name for fixture in m.fixtures}
        if names & fixtures.setdefault(m.name, set()):
            shared[m.name] = None
        fixtures[m.name] |= names
    return [
        f"More than one measurement is called {name!r}: equal labels are taken as the same point, "
        "plane or pose. Give them names of their own (name=...) if they are not."
        for name in shared
    ]


def notes_after(
    solution: Solution, before: IdentifiableParameters, after: IdentifiableParameters
) -> tuple[str, ...]:
    """Notes on the solution of a fit."""
    fit, problem = solution.fit, solution.problem
    notes = [] if fit.status is FitStatus.CONVERGED else [fit.status.sentence]
    lost = [name for name in before.names if name not in after.names]
    gained = [name for name in after.names if name not in before.names]
    if lost or gained:
        notes.append(
            "At the solution the identifiable parameters differ from those at the nominal robot."
            + (f" No longer: {', '.join(lost)}; their estimates are doubtful." if lost else "")
            + (f" Also: {', '.join(gained)}; these were not estimated." if gained else "")
        )
    hidden = _indistinguishable(solution)
    if hidden:
        notes.append(
            f"{', '.join(hidden)}: nearly indistinguishable (standard errors over {_CONFUSED:g} "
            "times those with the other parameters known). "
            "Choose configurations with select_configurations, leave one of them out (known=...), "
            f"or give a prior{' of its own (named=...)' if _has_prior(solution) else ''}."
        )
    notes += _unlikely_noise(solution) + _unlikely_corrections(solution)
    unknowns = problem.P + problem.F
    if problem.rows - unknowns < _FEW * unknowns:
        notes.append(
            f"{problem.rows - unknowns} rows more than the {unknowns} unknowns: too few to know "
            "the noise well, so standard errors are uncertain and intervals too narrow. Measure "
            "more configurations."
        )
    if len(fit.outliers):
        rows = [row for m in problem.measurements for row in m.origin or [None] * m.blocks]
        numbers = ", ".join(
            f"{b + 1}" + (f" in {rows[b]}" if rows[b] else "") for b in fit.outliers[:_LISTED]
        )
        is_one, more = len(fit.outliers) == 1, len(fit.outliers) > _LISTED
        notes.append(
            f"{len(fit.outliers)} of {problem.blocks} measurements "
            f"{'is an outlier (number' if is_one else 'are outliers (numbers'} {numbers}"
            f"{' and others' if more else ''}, counted from 1): "
            f"{'its' if is_one else 'their'} residuals are larger than noise explains."
        )
    return tuple(notes)


def notes_of_errors(solution: Solution, validation: Validation) -> tuple[str, ...]:
    """Notes that come first: implausible residuals, and no gain on held-out data."""
    notes = implausible(solution)
    found = []
    for unit, word in (("m", "position"), ("rad", "angle")):
        changes = []
        for errors, name in (
            (validation.folds, "cross-validation"),
            (validation.held_out, "held out"),
        ):
            after, was = (errors.rms, errors.nominal.rms) if errors is not None else ({}, {})
            if unit in after and after[unit] > _NO_GAIN * was[unit]:
                changes.append(f"{name} {in_unit(was[unit], unit)} to {in_unit(after[unit], unit)}")
        if changes:
            found.append(f"{word} error ({', '.join(changes)} {printed_unit(unit)}, rms)")
    if found:
        notes.append(
            f"Calibration does not lower the {' and the '.join(found)} on held-out data. The "
            "noise or the number of measurements does not support this many parameters: fewer "
            f"parameters, a {'narrower ' if _has_prior(solution) else ''}prior, or more data."
        )
    return tuple(notes)


def implausible(solution: Solution) -> list[str]:
    """Notes on measurements whose estimated noise is larger than that of any measurement."""
    length, notes = solution.problem.parameters.table.size, []
    for m, scale in zip(solution.problem.measurements, solution.scales, strict=True):
        if not states_noise(m) and not solution.fit.sigma_known:
            size = max(scale / [length if unit == "m" else 1.0 for unit in m.units])
            if size > _IMPLAUSIBLE:
                notes.append(
                    f"{m.name}: the residuals are {100.0 * size:.2g} % of the robot's size (or of "
                    "a radian). Look for readings that do not belong to their measurements, joints "
                    "in another order, a wrong frame or units."
                )
    return notes


def _has_prior(solution: Solution) -> bool:
    return bool(np.isfinite(solution.fit.prior.sigma).any())


def _unlikely_noise(solution: Solution) -> list[str]:
    """Measurements whose residuals are far from their stated standard deviations."""
    notes = []
    first = 0
    for m in solution.problem.measurements:
        rows = slice(first, first + m.blocks * len(m.axes))
        first = rows.stop
        size = float(np.sqrt(np.mean(solution.fit.residuals[rows] ** 2)))
        if states_noise(m) and size > _FAR:
            notes.append(
                f"{m.name}: residuals are {size:.3g} times the stated standard deviations. Look "
                "for an error of units (mm for m, degrees for rad), a wrong frame, or readings "
                "that do not belong to their measurements."
            )
    return notes


def _unlikely_corrections(solution: Solution) -> list[str]:
    """Notes on implausibly large corrections of the table."""
    parameters = solution.problem.parameters
    limit = {True: _OTHER_LENGTH * parameters.table.size, False: _OTHER_ANGLE}
    far = [
        f"{e.name} by {value:.3g} {e.unit}"
        for e, value in zip(parameters.entries, solution.corrections, strict=True)
        if e.law is ErrorLaw.CONSTANT
        and 0 < e.row <= parameters.model.f
        and abs(value) > limit[e.element.is_length]
    ]
    if not far:
        return []
    return [
        f"{', '.join(far)}: corrections that no robot needs. Look for an error of units (mm for m, "
        "degrees for rad), joints in another order or with another sign or zero, rotations the "
        "other way round; or the data do not determine these parameters."
    ]


def _indistinguishable(solution: Solution) -> list[str]:
    """Parameters of the table whose estimates depend on each other, or one and its partner."""
    fit, parameters = solution.fit, solution.problem.parameters
    if not np.isfinite(fit.covariance).all():
        return []
    alone = np.linalg.norm(fit.jacobian * np.sqrt(fit.weights)[:, None], axis=0)
    scale = 1.0 if fit.sigma_known else fit.scale
    inflation: Array = fit.standard_errors * alone / max(scale, 1e-300)
    P, f = len(parameters), parameters.model.f
    of_table = (parameters.rows > 0) & (parameters.rows <= f)
    confused = of_table & (inflation[:P] > _CONFUSED) & ~np.isfinite(fit.prior.sigma[:P])
    found = np.flatnonzero(confused).tolist()
    if len(found) == 1 and P > 1:
        correlation = np.abs(fit.covariance[found[0], :P]) / fit.standard_errors[:P]
        correlation[found[0]] = -np.inf
        found.append(int(np.argmax(correlation)))
    return [parameters.names[k] for k in found]

"""Notes on the solution of a fit and its errors."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..estimation import FitStatus
from ..table_text import in_unit, printed_unit
from .identifiable import IdentifiableParameters
from .solve import Solution, by_units, states_noise
from .validation import Validation

_FAR = 50.0  # residual in stated standard deviations that units explain better than noise
_IMPLAUSIBLE = 0.02  # estimated noise, relative to the robot or in rad, that no measurement has
_OTHER_LENGTH, _OTHER_ANGLE = 0.1, 0.35  # implausible corrections, in sizes of the robot and rad
_NO_GAIN = 0.98
_LISTED = 10
_FEW = 0.5
_CONFUSED = 50.0  # ratio of a standard error to that with all others known, for a note


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
    if hidden := _indistinguishable(solution):
        notes.append(
            f"{', '.join(hidden)}: nearly indistinguishable (standard errors over {_CONFUSED:g} "
            "times those with the other parameters known). "
            "Choose configurations with select_configurations, leave one of them out (known=...), "
            f"or give a prior{' of its own (named=...)' if has_prior(solution) else ''}."
        )
    for m, rows in zip(problem.measurements, problem.row_slices, strict=True):
        size = float(np.sqrt(np.mean(fit.residuals[rows] ** 2)))
        if states_noise(m) and size > _FAR:
            notes.append(
                f"{m.name}: residuals are {size:.3g} times the stated standard deviations. Look "
                "for an error of units in the measurements or in sigma, or for readings that do "
                "not belong to their measurements."
            )
    p = problem.parameters
    limit = {True: _OTHER_LENGTH * p.table.size, False: _OTHER_ANGLE}
    far = [
        f"{e.name} by {value:.3g} {e.unit}"
        for e, value in zip(p.entries, solution.corrections, strict=True)
        if p.is_of_table(e) and abs(value) > limit[e.element.is_length]
    ]
    if far:
        notes.append(
            f"{', '.join(far)}: corrections of implausible size. Look for an error of units (mm "
            "for m, degrees for rad), joints in another order or with another sign or zero, "
            "rotations the other way round; or the data do not determine these parameters."
        )
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
        notes.append(
            f"{len(fit.outliers)} of {problem.blocks} measurements are outliers (numbers {numbers}"
            f"{' and others' if len(fit.outliers) > _LISTED else ''}, counted from 1): their "
            "residuals are larger than noise explains."
        )
    return tuple(notes)


def notes_of_errors(solution: Solution, validation: Validation) -> tuple[str, ...]:
    """Notes that come first: implausible residuals, and no gain on held-out data."""
    notes = implausible(solution)
    found = []
    named = (("cross-validation", validation.folds), ("held out", validation.held_out))
    for unit, word in (("m", "position"), ("rad", "angle")):
        changes = [
            f"{name} {in_unit(errors.nominal.rms[unit], unit)} to {in_unit(errors.rms[unit], unit)}"
            for name, errors in named
            if errors is not None
            and errors.rms.get(unit, -1.0) > _NO_GAIN * errors.nominal.rms.get(unit, 0.0)
        ]
        if changes:
            found.append(f"{word} error ({', '.join(changes)} {printed_unit(unit)}, rms)")
    if found:
        notes.append(
            f"Calibration does not lower the {' and the '.join(found)} on held-out data. The "
            "noise or the number of measurements does not support this many parameters: fewer "
            f"parameters, a {'narrower ' if has_prior(solution) else ''}prior, or more data."
        )
    return tuple(notes)


def implausible(solution: Solution) -> list[str]:
    """Notes on measurements whose estimated noise is larger than that of any measurement."""
    problem, notes = solution.problem, []
    units = by_units(problem, problem.parameters.table.size, 1.0)
    for m, scale, unit in zip(problem.measurements, solution.scales, units, strict=True):
        size = 0.0 if states_noise(m) or solution.fit.sigma_known else max(scale / unit)
        if size > _IMPLAUSIBLE:
            notes.append(
                f"{m.name}: the residuals are {100.0 * size:.2g} % of the robot's size (or of a "
                "radian). Look for readings that do not belong to their measurements, joints in "
                "another order, a wrong frame or units."
            )
    return notes


def has_prior(solution: Solution) -> bool:
    """Whether some parameter has a prior."""
    return bool(np.isfinite(solution.fit.prior.sigma).any())


def _indistinguishable(solution: Solution) -> list[str]:
    """Parameters of the table whose estimates depend on each other, or one and its partner."""
    fit, parameters = solution.fit, solution.problem.parameters
    if not np.isfinite(fit.covariance).all():
        return []
    alone = np.linalg.norm(fit.jacobian * np.sqrt(fit.weights)[:, None], axis=0)
    scale = 1.0 if fit.sigma_known else fit.scale
    inflation: Array = fit.standard_errors * alone / max(scale, 1e-300)
    P = len(parameters)
    of_table = (parameters.rows > 0) & (parameters.rows <= parameters.model.f)
    confused = of_table & (inflation[:P] > _CONFUSED) & ~np.isfinite(fit.prior.sigma[:P])
    found = np.flatnonzero(confused).tolist()
    if len(found) == 1 and P > 1:
        correlation = np.abs(fit.covariance[found[0], :P]) / fit.standard_errors[:P]
        correlation[found[0]] = -np.inf
        found.append(int(np.argmax(correlation)))
    return [parameters.names[k] for k in found]

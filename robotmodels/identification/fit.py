"""Identification of the dynamic parameters of a robot from a log."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from .._arrays import Array
from .._arrays.tasks import Progress
from .._choices import chosen
from ..drive import Drives
from ..errors import InvalidValueError, RobotModelsWarning
from ..estimation.columns import column_basis
from ..estimation.covariance import (
    CorrelatedCovariance,
    correlated_covariance,
    jackknife_inflation,
)
from ..estimation.estimate import Estimate, EstimateStatus
from ..estimation.factor import TriangularFactors
from ..estimation.linear import group_leverage, solved
from ..friction import Friction
from ..logs import Log
from ..logs.log import check_is_log
from ..loops import LoopedParameters, LoopedRobot
from ..minimal_parameters import BaseParameters
from ..model import RobotModel, check_model
from .checks import accepted_log, accepted_test
from .delay import representative_part
from .equations import Equations, equations, parameters_of, reduce_equations, segments
from .forms import EquationForm
from .looped import looped_equations, looped_method
from .method_names import method_of
from .methods.base import Method, essential
from .methods.linear import Wls, used_weights
from .processing import LEAST_EQUATIONS, checked_processing, processing_for
from .result import FitDetails, IdentificationResult
from .signals import Processing, signals
from .validation import Validation, friction_ramp, no_errors, poor_prediction, prediction_errors
from .weak_prior import plausible_sizes, shrunk

_NO_EFFECT = 1e-7  # rank tolerance: residual column norm relative to the largest
_SPARE = 0.9
_ONE_EQUATION = (
    "In equations of power or energy, noise of the velocities enters both sides: parameters may be "
    "biased by more than their standard errors where positions are noisy, and fewer are "
    "identifiable than with equations of torques."
)


def fit(
    model: RobotModel | LoopedRobot,
    log: Log,
    method: Method | str = "wls",
    *,
    drive: Drives = True,
    friction: Friction | None = None,
    base: BaseParameters | None = None,
    form: EquationForm | str = EquationForm.TORQUE,
    processing: Processing | Mapping[str, Any] | None = None,
    test: Log | None = None,
    checked: bool = True,
    executor: Executor | None = None,
    progress: Progress = None,
) -> IdentificationResult:
    """Identify the base parameters, frictions and rotor inertias of a robot from a log.

    Parameters
    ----------
    model : RobotModel or LoopedRobot
        The robot; its own inertia is not used by least squares. For kinematic loops there are
        methods "ols", "wls" and "irls" with torque equations; ``base`` names the assembly, by
        default that of the first sample with passive joints near zero.
    log : Log
        Positions and torques of its joints, from `read_log`; of the actuated joints alone where
        there are kinematic loops, which are closed at each sample.
    method : Method or str
        An object with its options such as ``Robust(loss="tukey")``, or a name: "ols", "wls",
        "irls", "robust", "tls", "ridge", "sequential", "recursive", "iv", "didim", "cloe".
    drive : bool or collection of DriveKind or str
        Drive parameters that are identified.
    friction, base : optional
        A friction model besides them, linear in its parameters; or base parameters to identify.
    form : EquationForm or str
        Quantity that the equations balance: "torque", "filtered", "power" or "energy".
    processing : Processing or mapping, optional
        Filters, decimation and dead bands, from `choose_processing`; or some choices by name
        (cutoff, decimation, dead_band, edges). The others are chosen for prediction: the highest
        cutoff at which noise of the positions is predicted to bias no parameter by more than 0.1
        standard errors, and at least 20 equations for each parameter where the log is long enough.
    test : Log, optional
        Motion that is not fitted; predicted torques are compared with it.
    checked : bool
        Whether the log is checked first: units, signs, order of the joints, constant channels,
        delay. Errors that make a fit meaningless are raised, warnings become notes; outliers and
        frozen samples are interpolated or left out. False uses the log unchanged.
    executor, progress : optional
        A `concurrent.futures.Executor` for the pieces of the log, on which the result does not
        depend; a function that is called with the fraction done, or True to log it.

    Returns
    -------
    IdentificationResult
        Parameters, standard errors, validation. The status is POOR_PREDICTION where torques are
        predicted poorly, and UNSTABLE, with NaN for all numbers, where a simulation diverged.

    Warns
    -----
    RobotModelsWarning
        More than 30 % of the torques of the log, or of ``test``, is unexplained.

    Raises
    ------
    InvalidValueError, ShapeError
        A log of other joints, or of too few samples; one that contradicts the robot (each finding
        with advice); options out of their range.

    References
    ----------
    Book section 1.6; M. Gautier and W. Khalil, "On the identification of the inertial
    parameters of robots", IEEE CDC 1988.

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> result = fit(*example_log(), drive=("Fv", "Fc"))
    >>> round(result.value("Fv1"), 3), result.standard_error("Fv1") < 1e-3
    (2.0, True)
    """
    check_is_log(log)
    method = method_of(method)
    form = chosen(EquationForm, form, "form")
    if isinstance(model, LoopedRobot):
        others = {f"form={form.name.lower()!r}": form is not EquationForm.TORQUE}
        others["friction="] = friction is not None
        method = looped_method(model, method, others)
        system, test, findings = looped_equations(
            model, log, test, drive, base, processing, checked
        )
        model, log = system.model, system.log
        factors = reduced(system, executor, progress)
    else:
        check_model(model)
        base = parameters_of(model, base, drive, friction)
        given, findings = log, ()
        if checked:
            log, findings = accepted_log(log, model, "log", base.friction)
        if test is not None:
            test, more = accepted_test(given, test, model.n, model, checked)
            findings = (*findings, *more)
        system, factors = _equations(base, log, form, processing, executor, progress)
    system, factors, gap, missing = _identifiable(system, factors)
    estimate = method.solve(system, factors)
    dropped, rule = (), ""
    if method.essential is not False and estimate.status is not EstimateStatus.UNSTABLE:
        names, dropped, rule = essential(factors, estimate, method.essential)
        if dropped:
            others = method.without([factors.names.index(name) for name in dropped])
            system, factors = system.with_names(names), factors.with_names(names)
            estimate = others.solve(system, factors)
    estimate, iid, lags = with_uncertainty(method, system, factors, estimate)
    validation, ramp = _validation(system, estimate, log, test)
    if estimate.status is EstimateStatus.UNSTABLE:
        warning = f"{estimate.status.sentence} {estimate.notes[-1]}"
    else:
        sides = validation.in_sample, validation.held_out
        warning = poor_prediction(model, system.processing, *sides)
    notes = (*log.notes, *findings, *system.processing.notes, *estimate.notes)
    notes = (*notes, *_count_notes(factors, missing, dropped))
    if warning:
        warnings.warn(warning, RobotModelsWarning, stacklevel=2)
        notes = (warning, *notes)
        if estimate.status is EstimateStatus.SOLVED:
            estimate = replace(estimate, status=EstimateStatus.POOR_PREDICTION)
    details = FitDetails(iid, lags, gap, missing, dropped, rule, ramp)
    return IdentificationResult(
        system.uncached(), factors, method, estimate, validation, details, notes
    )


def _equations(
    base: BaseParameters,
    log: Log,
    form: EquationForm,
    processing: Processing | Mapping[str, Any] | None,
    executor: Executor | None,
    progress: Progress,
) -> tuple[Equations, TriangularFactors]:
    """Equations with the given or chosen processing, and their triangular factors.

    Where dead bands leave too few equations, the decimation is reduced.
    """

    def made(choice: Processing, progress: Progress) -> tuple[Equations, TriangularFactors]:
        if not form.by_joint:
            choice = replace(choice, notes=(*choice.notes, _ONE_EQUATION))
        system = equations(base, log, choice, form).cached()
        return system, reduced(system, executor, progress)

    given = checked_processing(processing, log)
    if isinstance(given, Processing):
        return made(given, progress)
    groups = log.n if form.by_joint else 1
    system, factors = made(processing_for(base, log, **given, groups=groups), progress)
    share = factors.rows / (LEAST_EQUATIONS * len(base))
    step = system.processing.decimation
    if given["decimation"] is None and share < 1.0 < step:
        # with a margin, since the excluded samples depend on the cutoff
        given = given | {"decimation": max(1, int(_SPARE * share * step))}
        return made(processing_for(base, log, **given, groups=groups), None)
    return system, factors


def reduced(
    system: Equations,
    executor: Executor | None = None,
    progress: Progress = None,
) -> TriangularFactors:
    """Factors of equations, refused if there are none."""
    factors = reduce_equations(system, executor, progress)
    if not factors.rows:
        bands = " ".join(f"{band:.3g}" for band in system.processing.dead_band)
        raise InvalidValueError(
            f"log: no equations are left: {int(factors.left_out.sum())} lie in the dead bands "
            f"({bands} rad/s or m/s) or within 0.3 periods of the cutoff beside them. Give a "
            "smaller dead band or a higher cutoff (processing=), or a log in which the joints move."
        )
    return factors


def _identifiable(
    system: Equations, factors: TriangularFactors
) -> tuple[Equations, TriangularFactors, tuple[float, float], tuple[str, ...]]:
    """Equations in the identifiable parameters, into which the others are regrouped."""
    basis = column_basis(factors.stacked()[0], negligible=_NO_EFFECT)
    if basis.rank == len(factors.names):
        return system, factors, basis.gap, ()
    base, kept = system.base, basis.kept
    matrix, gap = basis.coefficients @ base.matrix, basis.gap
    reduced = replace(base, kept=base.kept[kept], matrix=matrix, gap=gap)
    names = tuple(factors.names[k] for k in kept)
    missing = tuple(name for name in factors.names if name not in names)
    return system.with_names(names, reduced), factors.with_names(names), gap, missing


def _validation(
    system: Equations, estimate: Estimate, log: Log, test: Log | None
) -> tuple[Validation, Array]:
    """Prediction errors, and friction regularisation velocities (n,)."""
    if estimate.status is EstimateStatus.UNSTABLE:
        none = no_errors(log.n)
        return Validation(none, None if test is None else none), system.processing.dead_band
    ramp = friction_ramp(system.base, system.names, estimate.values, log, system.processing)
    known = not isinstance(system.base, LoopedParameters)  # of loops, the tree alone is known
    in_sample, nominal = prediction_errors(system, estimate.values, ramp, nominal=known)
    held_out = None
    if test is not None:
        held_out, _ = prediction_errors(system.with_log(test), estimate.values, ramp)
    return Validation(in_sample, held_out, nominal), ramp


def _count_notes(
    factors: TriangularFactors, missing: tuple[str, ...], dropped: tuple[str, ...]
) -> tuple[str, ...]:
    each = factors.rows / len(factors.names)
    notes = [f"{factors.rows} equations, {each:.3g} for each of {len(factors.names)} parameters."]
    if each < LEAST_EQUATIONS:
        notes.append(
            f"Fewer than {LEAST_EQUATIONS} equations for each parameter: record a longer log, or "
            "identify fewer parameters."
        )
    if missing:
        notes.append(
            f"The log does not distinguish {', '.join(missing)} from other parameters: their "
            "joints do not move enough. They are regrouped (see base.regrouping) or without "
            "effect; use an exciting trajectory to identify them."
        )
    if dropped:
        notes.append(
            f"{len(dropped)} parameters are not essential and set to zero: {', '.join(dropped)}."
        )
    return tuple(notes)


_SEGMENTS = 25
_NOTED = 1.5  # least jackknife inflation factor for a note


def with_uncertainty(
    method: Method, system: Equations, factors: TriangularFactors, estimate: Estimate
) -> tuple[Estimate, Array, int]:
    """Estimate with its final covariance, standard errors for white residuals (b,), and lags.

    Weighted least squares uses a weak prior on request or where the log determines little.
    """
    if method.covariance == "given":
        details = estimate.details
        return estimate, details.iid_standard_errors, details.correlation_lags
    white = estimate.standard_errors
    spread, ratio, inflation = _spread(method, system, factors, estimate)
    if inflation > _NOTED:
        note = (
            f"Standard errors were multiplied by {inflation:.2g}: estimates from segments of the "
            "log differ by more than stationary residuals explain. The model may be incomplete, or "
            "the motion may excite different parameters at different times."
        )
        estimate = replace(estimate, notes=(*estimate.notes, note))
    scaled = method.covariance == "scaled"
    shrinkage = method.shrinkage if isinstance(method, Wls) else False
    if shrinkage is None and method.essential:  # an explicit choice of parameters is kept
        shrinkage = False
    if shrinkage is not False:
        part = representative_part(system.log, system.processing.motion)
        x = signals(part, system.processing)
        sizes = plausible_sizes(system.base, system.names, x.q, x.v, x.a, x.tau)
        errors = np.sqrt(np.diag(spread.covariance))
        always = bool(shrinkage) or factors.rows < LEAST_EQUATIONS * len(factors.names)
        shrunk_estimate = shrunk(factors, estimate, errors, ratio, sizes, always)
        if shrunk_estimate is not None:
            estimate, scaled = shrunk_estimate, True
    covariance = estimate.covariance * np.outer(ratio, ratio) if scaled else spread.covariance
    return replace(estimate, covariance=covariance), white, spread.lags


def _spread(
    method: Method, system: Equations, factors: TriangularFactors, estimate: Estimate
) -> tuple[CorrelatedCovariance, Array, float]:
    """Covariance for correlated residuals, ratio of standard errors (b,), and inflation.

    Covariances of other methods are for white residuals; they are scaled by the ratio of weighted
    least squares.
    """
    weights = used_weights(method, factors)
    values, inverse, rest = solved(factors, weights)
    leverage = group_leverage(factors, weights, inverse)
    at = estimate.values if method.covariance == "correlated" else values
    spread = correlated_covariance(system, at, weights, inverse, leverage=leverage)
    white = rest / (factors.rows - len(values)) * np.diag(inverse)
    # a part of a long log is enough
    part = representative_part(system.log, system.processing.motion)
    part_system = system if part is system.log else system.with_log(part).cached()
    inflation = 1.0
    if sum(len(block) for block in part_system.blocks()) >= _SEGMENTS:
        errors = np.sqrt(np.diag(spread.covariance))
        parts, share = segments(part_system, _SEGMENTS), len(part) / len(system.log)
        inflation = jackknife_inflation(parts, factors, weights, errors, share)
    spread = replace(spread, covariance=inflation**2 * spread.covariance)
    ratio = np.sqrt(np.diag(spread.covariance) / np.where(white > 0.0, white, 1.0))
    return spread, ratio, inflation

"""From a log to the dynamic parameters of a robot."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from .._choices import chosen
from ..drive import Drives
from ..errors import InvalidValueError, RobotModelsWarning
from ..estimation import column_basis
from ..friction import Friction
from ..logs import Log
from ..minimal_parameters import BaseParameters, base_parameters
from ..model import RobotModel, check_model
from .equations import EquationForm, Equations, equations
from .methods.essential import Essential, EssentialRule, with_columns
from .methods.essential import essential as essential_parameters
from .methods.estimate import Estimate, EstimateStatus, Method
from .prediction import friction_ramp
from .preparation.accepted import accepted_log, accepted_test
from .preparation.processing import Processing
from .processing_choice import LEAST_EQUATIONS, processing_for
from .result import IdentificationResult
from .scale.kept_equations import kept_equations, plain
from .scale.reduction import Reduction, reduce_equations
from .solving import MethodOptions, solve
from .uncertainty import with_uncertainty
from .validation import Validation, no_validation, poor_prediction, validate

if TYPE_CHECKING:
    from ..estimation import Loss
    from .closed_loop import ClosedLoop, Controller, Output

_ONE_AT_A_TIME = (
    "In equations of power or energy, noise of the velocities enters both sides: parameters may be "
    "biased by more than their standard errors where positions are noisy, and fewer are "
    "identifiable than with equations of torques."
)
_SPARE = 0.9
_NOTHING = 1e-7
"""Length of a column relative to the longest, below which the log does not show it."""


def fit(
    model: RobotModel,
    log: Log,
    method: Method | str = Method.WLS,
    *,
    drive: Drives = True,
    friction: Friction | None = None,
    form: EquationForm | str = EquationForm.TORQUE,
    base: BaseParameters | None = None,
    processing: Processing | None = None,
    cutoff: float | None = None,
    decimation: int | None = None,
    dead_band: ArrayLike | None = None,
    edges: float | None = None,
    loss: Loss | str | None = None,
    prior: RobotModel | ArrayLike | None = None,
    prior_deviations: ArrayLike | None = None,
    strength: float | None = None,
    noise: ArrayLike | None = None,
    forgetting: float | None = None,
    controller: Controller | None = None,
    loop: ClosedLoop | None = None,
    start: ArrayLike | None = None,
    output: Output | str | None = None,
    essential: bool | float | EssentialRule | str = False,
    shrinkage: bool | None = None,
    test: Log | None = None,
    checked: bool = True,
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
) -> IdentificationResult:
    """Identify the base parameters, frictions and rotor inertias of a robot from a log.

    Parameters
    ----------
    model : RobotModel
        The robot; its own inertia is not used by least squares.
    log : Log
        Positions and torques of its joints, of `read_log`.
    method : Method or str
        How the equations are solved, such as "ols", "wls" or "iv".
    drive : bool or collection of DriveKind or str
        Which drive parameters are identified.
    friction : Friction, optional
        A friction model besides them, linear in its parameters.
    form : EquationForm or str
        What the equations balance.
    base : BaseParameters, optional
        Instead of ``drive`` and ``friction``.
    processing : Processing, optional
        All choices of the signal processing; instead of them single ones:
    cutoff, decimation, dead_band, edges
        As for `choose_processing`. By default they are chosen for prediction: the highest cutoff at
        which noise of the positions is predicted to bias no parameter by more than 0.1 standard
        errors, and at least 20 equations for each parameter where the log is long enough.
    loss
        Of method "robust": "huber" (default), "cauchy" or "tukey".
    prior, prior_deviations, strength
        Of method "ridge": a robot or values (b,) to draw toward, how far they may be off (b,), and
        what the squares of the prior are multiplied by (default by cross-validation).
    noise
        Of method "tls": deviation of the noise of the columns, see `total`.
    forgetting
        Of method "recursive": weight of an instant relative to the next, default 1.
    controller, loop, start, output
        Of methods "iv", "didim" and "cloe", which simulate the controlled robot: its controller
        (default a tuned one), how it is simulated, parameters to begin with, and what "cloe"
        compares. An option that the method does not take is an error.
    essential : bool, float, EssentialRule or str
        Leave out parameters whose relative deviations say that they are not seen: True as is
        usual (30), a ratio of relative deviations, or a rule: "ratio", "f_test", "aic".
    shrinkage : bool, optional
        Of methods "wls" and "irls": whether parameters are shrunk towards zero by a weak
        prior whose scale is estimated from the log (empirical Bayes). By default where standard
        errors exceed 15 % of plausible sizes or there are fewer than 20 equations for each
        parameter; a note reports it.
    test : Log, optional
        Kept aside: the predicted torques are compared with it.
    checked : bool
        Whether the log is checked first: units, signs, order of the joints, constant channels,
        delay. Errors that make a fit meaningless are raised, doubts become notes; outliers and
        frozen samples are interpolated or left out. False takes the log as it is.
    executor : concurrent.futures.Executor, optional
        Who computes the pieces of the log; the result does not depend on it.
    progress : callable, optional
        Called with the fraction done.

    Returns
    -------
    IdentificationResult
        Parameters, deviations, errors; its status is POOR_PREDICTION where torques are predicted
        badly, and UNSTABLE, with NaN for all numbers, where the simulated robot ran away.

    Warns
    -----
    RobotModelsWarning
        Torques of the log, or of the one kept aside, are predicted badly: more than 30 % of them
        are not explained; which, and what to do. It stands in the notes too.

    Raises
    ------
    InvalidValueError, ShapeError
        A log of other joints, or of too few samples; one that cannot be what it is said to be
        (each finding with what to do); choices that make no sense.

    References
    ----------
    Seed book section 1.6; M. Gautier and W. Khalil, "On the identification of the inertial
    parameters of robots", IEEE CDC 1988.

    Examples
    --------
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> found = fit(arm, log, drive=("Fv", "Fc"))
    >>> round(found.value("Fv1"), 3), found.deviation("Fv1") < 1e-3
    (2.0, True)
    """
    check_model(model)
    way = chosen(Method, method, "method")
    options = MethodOptions(
        loss, prior, prior_deviations, strength, noise, forgetting, controller, loop, start, output,
        shrinkage,
    )  # fmt: skip
    options.check(way)
    balance = chosen(EquationForm, form, "form")
    if base is None:
        base = base_parameters(model, drive=drive, friction=friction)
    else:
        base.check(model)
    given = log
    log, findings = accepted_log(log, model, "log", base.friction) if checked else (log, ())
    if test is not None:
        test, of_test = accepted_test(given, test, model, checked)
        findings = (*findings, *of_test)
    choices = (cutoff, decimation, dead_band, edges)
    if processing is None:
        system, whole = _chosen(base, log, balance, choices, executor, progress)
    elif any(x is not None for x in choices):
        raise InvalidValueError(
            "processing: it holds every choice; leave out cutoff, decimation, dead_band and edges, "
            "or leave out processing."
        )
    else:
        _refuse_other_period(processing, log)
        system = kept_equations(equations(base, log, processing, balance))
        whole = reduce_equations(system, executor, progress)
    processing = system.processing
    _refuse_nothing(whole, processing)
    system, reduction, gap, unseen = _seen(system, whole)
    estimate = solve(system, reduction, way, options)
    found = _essential(reduction, estimate, essential)
    dropped = () if found is None else found.dropped
    if found is not None and dropped:
        system = system.with_names(found.names)
        reduction = with_columns(reduction, found.names)
        estimate = solve(system, reduction, way, options)
    R, _, _ = reduction.stacked()
    if shrinkage is None and essential is not False:
        shrinkage = False  # the user's own choice of parameters
    estimate, white, lags = with_uncertainty(way, system, reduction, estimate, shrinkage)
    lost = estimate.status is EstimateStatus.UNSTABLE
    ramp = (
        processing.dead_band
        if lost
        else friction_ramp(system.base, system.names, estimate.values, log, processing)
    )
    fitted = _validated(system, estimate, log, ramp, system)
    held_out = None if test is None else _validated(system, estimate, test, ramp)
    estimate, doubts = _judged(system, estimate, fitted, held_out)
    for doubt in doubts:
        warnings.warn(doubt, RobotModelsWarning, stacklevel=2)
    return IdentificationResult(
        system=plain(system),
        reduction=reduction,
        estimate=estimate,
        white=white,
        lags=lags,
        gap=gap,
        unseen=unseen,
        not_essential=dropped,
        condition=float(np.linalg.cond(R)),
        condition_scaled=float(np.linalg.cond(R / np.linalg.norm(R, axis=0))),
        fitted=fitted,
        held_out=held_out,
        options=options,
        ramp=ramp,
        essential_rule=_rule_name(found, essential),
        notes=(
            *doubts, *log.notes, *findings, *processing.notes, *estimate.notes,
            *_notes(reduction, unseen, dropped),
        ),
    )  # fmt: skip


def _chosen(
    base: BaseParameters,
    log: Log,
    balance: EquationForm,
    choices: tuple[float | None, int | None, ArrayLike | None, float | None],
    executor: Executor | None,
    progress: Callable[[float], None] | None,
) -> tuple[Equations, Reduction]:
    """Equations with the processing that suits the log, and their reduction.

    Where dead bands leave out so much that there are too few equations, less is thinned out.
    """
    cutoff, decimation, dead_band, edges = choices
    kinds = log.n if balance.by_joint else 1

    def made(step: int | None) -> Equations:
        processing = processing_for(base, log, cutoff, step, dead_band, edges, kinds)
        if not balance.by_joint:
            processing = replace(processing, notes=(*processing.notes, _ONE_AT_A_TIME))
        return kept_equations(equations(base, log, processing, balance))

    system = made(decimation)
    whole = reduce_equations(system, executor, progress)
    share = whole.rows / (LEAST_EQUATIONS * len(base))
    step = system.processing.decimation
    if decimation is None and share < 1.0 < step:
        # a little less, since the cutoff and with it what is left out may change
        system = made(max(1, int(_SPARE * share * step)))
        whole = reduce_equations(system, executor)
    return system, whole


def _validated(
    system: Equations, estimate: Estimate, log: Log, ramp: Array, own: Equations | None = None
) -> Validation:
    """Errors on a log, whose equations may be there already; NaN without parameters."""
    if estimate.status is EstimateStatus.UNSTABLE:
        return no_validation(log.n)
    return validate(system.base, system.names, estimate.values, log, system.processing, own, ramp)


def _judged(
    system: Equations, estimate: Estimate, fitted: Validation, held_out: Validation | None
) -> tuple[Estimate, tuple[str, ...]]:
    """The estimate with the status that its predictions deserve, and what `fit` warns of."""
    if estimate.status is EstimateStatus.UNSTABLE:
        return estimate, (f"{estimate.status.sentence} {estimate.notes[-1]}",)
    doubt = poor_prediction(system.model, system.processing, fitted, held_out)
    if doubt and estimate.status is EstimateStatus.SOLVED:
        estimate = replace(estimate, status=EstimateStatus.POOR_PREDICTION)
    return estimate, (doubt,) if doubt else ()


def _essential(
    reduction: Reduction, estimate: Estimate, asked: bool | float | EssentialRule | str
) -> Essential | None:
    if asked is False or estimate.status is EstimateStatus.UNSTABLE:
        return None
    if asked is True:
        return essential_parameters(reduction, estimate)
    if isinstance(asked, (str, EssentialRule)):
        return essential_parameters(reduction, estimate, rule=asked)
    return essential_parameters(reduction, estimate, ratio=asked)


def _rule_name(found: Essential | None, asked: bool | float | EssentialRule | str) -> str:
    if found is None:
        return ""
    if isinstance(asked, (bool, str, EssentialRule)):
        return found.rule.name.lower()
    return f"{found.rule.name.lower()} {asked:g}"


def _refuse_nothing(whole: Reduction, processing: Processing) -> None:
    if whole.rows:
        return
    bands = " ".join(f"{band:.3g}" for band in processing.dead_band)
    raise InvalidValueError(
        f"log: no equations are left: {int(whole.left_out.sum())} lie in the dead bands ({bands} "
        "rad/s or m/s) or within 0.3 periods of the cutoff beside them. Give a smaller dead_band=, "
        "a higher cutoff=, or a log in which the joints move."
    )


def _refuse_other_period(processing: Processing, log: Log) -> None:
    if abs(processing.dt - log.dt) > 1e-6 * log.dt:
        raise InvalidValueError(
            f"processing: it was chosen for samples of {processing.dt:g} s, the log has "
            f"{log.dt:g} s; leave out processing= for the default choice."
        )


def _seen(
    system: Equations, whole: Reduction
) -> tuple[Equations, Reduction, tuple[float, float], tuple[str, ...]]:
    """Equations in the parameters that the log tells from each other."""
    R, _, _ = whole.stacked()
    found = column_basis(R, nothing=_NOTHING)
    if found.rank == len(whole.names):
        return system, whole, found.gap, ()
    base = system.base
    kept = found.kept
    # what depends on others in this log is regrouped into them
    seen = BaseParameters(
        base.model, base.drive, base.kept[kept], found.coefficients @ base.matrix, base.method,
        found.gap, friction=base.friction,
    )  # fmt: skip
    factors = tuple(F[:, [*kept.tolist(), F.shape[1] - 1]] for F in whole.factors)
    names = tuple(whole.names[k] for k in kept)
    unseen = tuple(name for name in whole.names if name not in names)
    reduction = Reduction(names, factors, whole.counts, whole.left_out)
    return replace(system, base=seen, names=names), reduction, found.gap, unseen


def _notes(
    reduction: Reduction, unseen: tuple[str, ...], dropped: tuple[str, ...]
) -> tuple[str, ...]:
    each = reduction.rows / len(reduction.names)
    notes = [
        f"{reduction.rows} equations, {each:.3g} for each of {len(reduction.names)} parameters."
    ]
    if each < LEAST_EQUATIONS:
        notes.append(
            f"Fewer than {LEAST_EQUATIONS} equations for each parameter: record a longer log, or "
            "identify fewer parameters."
        )
    if unseen:
        notes.append(
            f"The log does not tell {', '.join(unseen)} from other parameters: their joints do not "
            "move enough. They are regrouped (see base.regrouping) or without effect; use an "
            "exciting trajectory to find them."
        )
    if dropped:
        notes.append(
            f"{len(dropped)} parameters are not essential, and taken as zero: {', '.join(dropped)}."
        )
    return tuple(notes)

"""Exciting trajectories for dynamic identification."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_floats
from ..._choices import chosen
from ...drive import Drives
from ...errors import InvalidValueError, ShapeError
from ...minimal_parameters import BaseParameters, base_parameters
from ...model import RobotModel, check_model
from ...trajectories import MotionLimits
from .basis import MotionBasis, MotionKind
from .bounds import excitation_limits, excitation_torques
from .boxes import WorkspaceBox, clearances
from .criterion import ExcitationCriterion
from .kept import limits_kept
from .problem import ExcitationProblem
from .quality import quality
from .result import ExcitationStart, ExcitationStatus, ExcitingTrajectory
from .search import ITERATIONS, STAGES, gain_of_twice, improved, shared_budget
from .starts import random_motion

_LOG = logging.getLogger(__name__)
_DENSE = 5  # times as many samples judge the result as were used in the search

Progress = Callable[[int, int], None]


def exciting_trajectory(
    model: RobotModel,
    *,
    duration: float = 10.0,
    harmonics: int = 5,
    points: int | None = None,
    kind: MotionKind | str = MotionKind.FOURIER,
    criterion: ExcitationCriterion | str = ExcitationCriterion.CONDITION,
    drive: Drives = ("Ia", "Fv", "Fc"),
    base: BaseParameters | None = None,
    limits: MotionLimits | None = None,
    torque_limits: ArrayLike | None = None,
    boxes: WorkspaceBox | Sequence[WorkspaceBox] = (),
    sigma: ArrayLike | None = None,
    scale: ArrayLike | None = None,
    samples: int | None = None,
    margin: float = 0.005,
    rest: bool = True,
    starts: int | None = None,
    baseline: int | None = None,
    iterations: int | None = None,
    rng: np.random.Generator | int | None = None,
    progress: bool | Progress = False,
) -> ExcitingTrajectory:
    """A motion that shows the base parameters of a robot as well as its limits allow.

    Random motions within the limits are made, the best of them are improved by quasi-Newton steps
    with analytic gradients, and the best result is kept. Positions, velocities and accelerations
    keep their limits everywhere, torques and boxes on a fine grid with an allowance for what lies
    between (see `ExcitationLimits`).

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    duration : float
        Of one period, s. The motion ends where it begins, so that it can be repeated.
    harmonics : int
        Of a Fourier series, at least 2.
    points : int, optional
        Of a spline, equally far in time, at least 3; default ``2 harmonics``.
    kind : MotionKind or str
        ``"fourier"`` or ``"spline"``.
    criterion : ExcitationCriterion or str
        ``"condition"`` number of the base regressor stacked over samples, or ``"log_det"``, the
        volume of the confidence ellipsoid.
    drive : bool or collection of DriveKind or str
        Which drive parameters are among those to be identified.
    base : BaseParameters, optional
        Which are to be identified; default those of the model with ``drive``.
    limits : MotionLimits, optional
        Of position, velocity, acceleration and jerk; default the table's. What has no limit there
        gets one, see `excitation_limits`; `ExcitingTrajectory.notes` says which.
    torque_limits : array_like, shape () or (n,), optional
        N m or N, for the model's own parameters; default the table's, where the model has masses.
    boxes : WorkspaceBox or sequence of WorkspaceBox
        Where frames stay inside, or keep out of.
    sigma : array_like, shape () or (n,), optional
        Standard deviations of the torques' noise, by which rows are divided; default 1.
    scale : array_like, shape (b,), optional
        Sizes of the base parameters that are expected, which multiply columns; default 1, the
        unscaled condition number. Zeros are refused.
    samples : int, optional
        Times in a period that the search looks at; default 20 for each harmonic, or 10 for each
        point.
    margin : float
        Part of the limits that the search keeps free for what lies between samples.
    rest : bool
        Whether a Fourier series begins and ends with zero velocity and acceleration, by two linear
        equations for the coefficients of each joint. Splines always do.
    starts : int, optional
        How many of the random motions are improved; default 8, fewer for robots whose evaluations
        are so long that the budget has no more. Twice as many are twice the budget; the notes say
        how much they would bring.
    baseline : int, optional
        How many random motions are made, at least ``starts``; default 100, or fewer likewise.
    iterations : int, optional
        Largest number of iterations of each of the four stages of a start; a stage ends earlier
        where the criterion falls by less than 1 % over 25 of them. Without it, 200 and a budget of
        evaluations (about 10 s of a processor for 8 starts). The budget counts multiplications, so
        that searches repeat exactly.
    rng : Generator or int, optional
        Chance, or its seed; default another one each time.
    progress : bool or callable
        A function of (done, total) stages; True logs them.

    Returns
    -------
    ExcitingTrajectory
        The motion, its quality beside the random ones, and a status. Where no motion keeps every
        limit the status is ``INFEASIBLE``, and ``limits.violations()`` says which are broken.

    Raises
    ------
    ShapeError, InvalidValueError
        Arguments that make no sense; too few samples for the parameters; friction in ``base``.
    FrameNotFoundError
        A box for a frame that is not there.

    References
    ----------
    Seed book section 1.6.2.3; M. Gautier and W. Khalil, "Exciting trajectories for the
    identification of base inertial parameters of robots", Int. J. Robotics Research 11(4), 1992;
    J. Swevers et al., "Optimal robot excitation and identification", IEEE T-RA 13(5), 1997.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> found = exciting_trajectory(
    ...     load("planar_2r"), harmonics=3, starts=1, baseline=5, iterations=20, rng=0
    ... )
    >>> found.limits.kept, bool(found.condition < found.baseline_conditions[0])
    (True, True)
    """
    check_model(model)
    basis = MotionBasis(
        way := chosen(MotionKind, kind, "kind"),
        _positive(duration, "duration"),
        order := _order(way, harmonics, points),
        bool(rest),
    )
    aim = chosen(ExcitationCriterion, criterion, "criterion")
    base = _checked_base(model, base, drive)
    if not len(base):
        raise InvalidValueError(
            f"{model.name} has no base parameters: nothing of it is to be excited."
        )
    bounds, notes = excitation_limits(model, limits)
    torques, torque_notes = excitation_torques(model, torque_limits)
    each = 20 if way is MotionKind.FOURIER else 10
    samples = max(each * order, 60) if samples is None else _whole(samples, "samples")
    if samples * model.n < len(base) or samples < 2 * order + 1:
        raise InvalidValueError(
            f"samples: {samples} times do not show {len(base)} base parameters and {order} "
            "harmonics or points; take more."
        )
    if not 0.0 <= margin < 0.5:
        raise InvalidValueError(f"margin: expected a part from 0 to below 0.5, got {margin!r:.40}.")
    problem = ExcitationProblem(
        model, basis, base, aim, bounds, torques, _boxes(model, boxes), samples,
        _sizes(sigma, model.n, "sigma"), _sizes(scale, len(base), "scale"), float(margin),
    )  # fmt: skip
    times = basis.duration / (_DENSE * samples) * np.arange(_DENSE * samples, dtype=np.float64)
    count, evaluations, pool = shared_budget(problem)
    count = count if starts is None else _whole(starts, "starts")
    pool = pool if baseline is None else _whole(baseline, "baseline")
    most, allowed = (
        (ITERATIONS, evaluations)
        if iterations is None
        else (_whole(iterations, "iterations"), None)
    )
    chance = np.random.default_rng(rng)
    drawn = [random_motion(problem, chance) for _ in range(max(pool, count))]
    judged = [quality(problem, basis.trajectory(X), times) for X in drawn]
    kept = [limits_kept(problem, basis.trajectory(X)).kept for X in drawn]
    # those within the limits first
    best = sorted(range(len(drawn)), key=lambda k: (not kept[k], judged[k].of(aim)))[:count]
    report = _progress(progress)
    done: list[ExcitationStart] = []
    ends: list[Array] = []
    for s, k in enumerate(best):

        def stage_done(stages: int, s: int = s) -> None:
            report(s * len(STAGES) + stages, count * len(STAGES))

        X, history, stages, status = improved(problem, drawn[k], most, allowed, stage_done)
        after = quality(problem, basis.trajectory(X), times)
        if kept[k] and (
            status is ExcitationStatus.INFEASIBLE or after.of(aim) > judged[k].of(aim)
        ):  # the start itself is better than what became of it
            X, after = drawn[k], judged[k]
            status = ExcitationStatus.LIMIT_OF_ITERATIONS
        done.append(ExcitationStart(judged[k], after, history, stages, status))
        ends.append(X)
    first = min(
        range(len(done)),
        key=lambda k: (done[k].status is ExcitationStatus.INFEASIBLE, done[k].after.of(aim)),
    )
    trajectory = basis.trajectory(ends[first])
    random = tuple(one for one, ok in zip(judged, kept, strict=True) if ok)
    if len(random) < len(drawn):
        notes = (
            *notes,
            f"{len(drawn) - len(random)} of {len(drawn)} random motions do not keep the limits and "
            "are left out of the comparison.",
        )
    return ExcitingTrajectory(
        trajectory, model, base, aim, done[first].after, limits_kept(problem, trajectory),
        tuple(done), random, basis, ends[first], done[first].status,
        (*notes, *torque_notes, *_advice(done[first].status), *_more(done, aim)),
    )  # fmt: skip


def _advice(status: ExcitationStatus) -> tuple[str, ...]:
    if status is ExcitationStatus.INFEASIBLE:
        return (
            "Widen the limits that are named as broken, give the motion more time (duration), or "
            "more starts; a robot that cannot hold its own weight needs larger torque_limits.",
        )
    return ()


def _more(done: Sequence[ExcitationStart], aim: ExcitationCriterion) -> tuple[str, ...]:
    """How much a greater budget would bring, by the spread of the starts and their last steps."""
    kept = [one for one in done if one.status is not ExcitationStatus.INFEASIBLE]
    if not kept:
        return ()
    values = np.array([one.after.of(aim) for one in kept])
    if aim is ExcitationCriterion.CONDITION:
        gain = f"lower the condition number by about {100.0 * gain_of_twice(np.log(values)):.2g} %"
    else:
        gain = f"raise the log det by about {gain_of_twice(values):.2g}"
    found = []
    if len(values) == 1:
        found.append("With one start the benefit of more starts cannot be estimated; use starts=2.")
    else:
        ends = values if aim is ExcitationCriterion.CONDITION else -values
        found.append(
            f"Doubling the number of starts (starts={2 * len(done)}) is expected to {gain}; the "
            f"{len(values)} starts ended between {ends.min():.4g} and {ends.max():.4g}."
        )
    best = kept[int(values.argmin())]
    last = best.history[len(best.history) - int(best.stages[-1]) :]
    if best.status is ExcitationStatus.LIMIT_OF_ITERATIONS and len(last) > 1:
        fall = 100.0 * (1.0 - np.exp(min(0.0, last[-1] - last[len(last) // 2])))
        found.append(
            f"In the second half of the last stage the criterion still fell by {fall:.2g} %; more "
            f"iterations (iterations={2 * max(int(best.stages.max()), 1)}) would lower it further."
        )
    return tuple(found)


def _checked_base(model: RobotModel, base: BaseParameters | None, drive: Drives) -> BaseParameters:
    if base is None:
        return base_parameters(model, drive=drive)
    if not isinstance(base, BaseParameters):
        raise InvalidValueError(
            f"base: expected base parameters of the model, got {type(base).__name__}."
        )
    base.check(model)
    if base.friction is not None:
        raise InvalidValueError(
            "base: friction besides that of the drives has no gradient here; make base parameters "
            "without friction= for the motion, and identify its parameters on the same motion."
        )
    return base


def _order(kind: MotionKind, harmonics: Any, points: Any) -> int:
    if kind is MotionKind.FOURIER:
        if points is not None:
            raise InvalidValueError("points: a Fourier series has none; take harmonics=.")
        return _whole(harmonics, "harmonics")
    return 2 * _whole(harmonics, "harmonics") if points is None else _whole(points, "points")


def _boxes(
    model: RobotModel, boxes: WorkspaceBox | Sequence[WorkspaceBox]
) -> tuple[WorkspaceBox, ...]:
    given = (boxes,) if isinstance(boxes, WorkspaceBox) else tuple(boxes)
    for box in given:
        if not isinstance(box, WorkspaceBox):
            raise InvalidValueError(f"boxes: expected WorkspaceBox, got {type(box).__name__}.")
        clearances(model, box, np.zeros((1, model.n)))  # refuses frames that are not there
    return given


def _sizes(value: ArrayLike | None, n: int, name: str) -> Array:
    given = as_floats(1.0 if value is None else value, name)
    if given.shape not in ((), (n,)):
        raise ShapeError(f"{name}: expected shape ({n},), got {given.shape}.")
    if not (given > 0.0).all():
        raise InvalidValueError(f"{name}: expected positive numbers, got {given}.")
    return np.full(n, given)


def _positive(value: Any, name: str) -> float:
    number = as_floats(value, name)
    if number.ndim or number <= 0.0:
        raise InvalidValueError(
            f"{name}: expected a positive number of seconds, got {value!r:.40}."
        )
    return float(number)


def _whole(value: Any, name: str) -> int:
    try:
        number = int(value)
    except (TypeError, ValueError, OverflowError):
        number = 0
    if isinstance(value, bool) or number < 1 or number != value:
        raise InvalidValueError(f"{name}: expected a whole number from 1, got {value!r:.60}.")
    return number


def _progress(progress: Any) -> Callable[[int, int], Any]:
    if progress is False or progress is None:
        return lambda done, total: None
    if progress is True:
        return lambda done, total: _LOG.info("%d of %d stages are done", done, total)
    if callable(progress):
        return progress
    raise InvalidValueError(
        f"progress: expected a flag or a function of (done, total), got {progress!r:.60}."
    )

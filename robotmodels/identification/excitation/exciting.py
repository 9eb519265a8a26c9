"""Exciting trajectories for dynamic identification."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_count, as_floats, as_number, as_reals, read_only
from ..._arrays.tasks import Progress, Workers
from ..._choices import one_of
from ...drive import Drives
from ...errors import InvalidValueError, ShapeError
from ...geometry import REVOLUTE
from ...minimal_parameters import BaseParameters, base_parameters
from ...model import RobotModel, check_model
from ...obstacles import Box
from ...obstacles.clearance import Frame, checked_obstacles, origins
from ...obstacles.shapes import Obstacle
from ...trajectories import MotionLimits
from . import search
from .motions import KINDS, MotionBasis
from .objective import CRITERIA, Distances, ExcitationProblem
from .result import ExcitationStart, ExcitationStatus, ExcitingTrajectory

_DENSE = 5  # samples for the final quality, times those of the search


def exciting_trajectory(
    model: RobotModel,
    *,
    duration: float = 10.0,
    harmonics: int = 5,
    points: int | None = None,
    kind: str = "fourier",
    criterion: str = "condition",
    drive: Drives = ("Ia", "Fv", "Fc"),
    base: BaseParameters | None = None,
    limits: MotionLimits | None = None,
    torque_limits: ArrayLike | None = None,
    workspace: Box | None = None,
    obstacles: Obstacle | Iterable[Obstacle] = (),
    frames: Sequence[Frame] = (None,),
    sigma: ArrayLike | None = None,
    scale: ArrayLike | None = None,
    samples: int | None = None,
    margin: float = 0.005,
    rest: bool = True,
    starts: int | None = None,
    baseline: int | None = None,
    iterations: int | None = None,
    rng: np.random.Generator | int | None = None,
    progress: Progress = False,
) -> ExcitingTrajectory:
    """Optimal exciting trajectory for the identification of the base parameters.

    Random motions within the limits are drawn, the best of them are improved by quasi-Newton steps
    with analytic gradients. Positions, velocities and accelerations keep their limits everywhere,
    torques and distances on a fine grid with an allowance for extremes between its samples.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    duration : float
        Duration of one period, s. The motion is periodic.
    harmonics, points : int
        Harmonics of a Fourier series, at least 2; points of a spline, at least 3, default
        ``2 harmonics``.
    kind : {"fourier", "spline"}
        A finite Fourier series, or a closed quintic spline through points at equal times.
    criterion : {"condition", "log_det"}
        Condition number of the base regressor stacked over samples, or the volume of the
        confidence ellipsoid.
    drive, base
        As for `fit`: the parameters to be identified.
    limits, torque_limits : MotionLimits, array_like of shape () or (n,), optional
        Limits of position, velocity, acceleration and jerk, and of torques (N m or N) for the
        model's own parameters; default the table's. Missing ones of motion are assumed, see
        ``notes``.
    workspace : Box, optional
        Box in which the origins of ``frames`` stay.
    obstacles : Sphere, Box, Plane, Capsule, or iterable of these
        Bodies of `obstacles` outside of which these origins stay, such as a floor.
    frames : sequence of str, int or None
        Names or numbers of frames; None is the tool.
    sigma, scale : array_like, shapes () or (n,), (b,), optional
        Standard deviations of the torques' noise, by which rows are divided, and expected sizes of
        the base parameters, which multiply columns; default 1.
    samples : int, optional
        Samples in a period; default 20 for each harmonic, or 10 for each point.
    margin : float
        Share of the limits reserved for extremes between samples.
    rest : bool
        Whether velocity and acceleration vanish at the ends of a Fourier series, as of a spline.
    starts, baseline : int, optional
        Numbers of random motions that are improved and drawn; default 8 and 100, or fewer.
    iterations : int, optional
        Largest number of iterations of each of the four stages of a start; a stage ends earlier
        where the criterion falls by less than 1 % over 25 of them. Default 200, within a budget of
        multiplications (about 10 s of a processor), so that searches repeat exactly.
    rng : Generator or int, optional
        Random generator, or its seed; default a fresh one.
    progress : bool or callable, optional
        A function is called with the fraction done; True writes it to the log (`logging`).

    Returns
    -------
    ExcitingTrajectory
        The motion, its quality and that of the random ones, and a status. Where no motion is within
        all limits the status is ``INFEASIBLE``, and ``limits.violations()`` lists the broken ones.

    References
    ----------
    Book section 1.6.2.3; M. Gautier and W. Khalil, "Exciting trajectories for the
    identification of base inertial parameters of robots", Int. J. Robotics Research 11(4), 1992;
    J. Swevers et al., "Optimal robot excitation and identification", IEEE T-RA 13(5), 1997.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> options = {"harmonics": 3, "starts": 1, "baseline": 5, "iterations": 20, "rng": 0}
    >>> result = exciting_trajectory(load("planar_2r"), **options)
    >>> result.limits.kept, bool(result.condition < result.baseline_conditions[0])
    (True, True)
    """
    check_model(model)
    one_of(kind, tuple(KINDS), "kind")
    criterion = one_of(str(criterion).replace("-", "_"), CRITERIA, "criterion")
    if kind == "fourier" and points is not None:
        raise InvalidValueError("points: a Fourier series has none; use harmonics=.")
    order = as_count(*((harmonics, "harmonics") if points is None else (points, "points")))
    if kind == "spline" and points is None:
        order *= 2
    basis = MotionBasis(kind, as_number(duration, "duration", above=0.0), order, bool(rest))
    base = _checked_base(model, base, drive)
    bounds, notes = excitation_limits(model, limits)
    torques, torque_notes = excitation_torques(model, torque_limits)
    default = max((20 if kind == "fourier" else 10) * order, 60)
    samples = default if samples is None else as_count(samples, "samples")
    if samples * model.n < len(base) or samples < 2 * order + 1:
        raise InvalidValueError(
            f"samples: {samples} times are too few for {len(base)} base parameters and {order} "
            "harmonics or points; take more."
        )
    margin = as_number(margin, "margin", least=0.0, below=0.5)
    scale = _sizes(1.0 if scale is None else scale, len(base), "scale")
    weight = scale / _sizes(1.0 if sigma is None else sigma, model.n, "sigma")[:, None]
    distances = _distances(model, workspace, obstacles, frames)
    problem = ExcitationProblem(
        model, basis, base, criterion, bounds, torques, distances, samples, weight, margin
    )
    count, evaluations, pool = search.shared_budget(problem)
    count = count if starts is None else as_count(starts, "starts")
    pool = pool if baseline is None else as_count(baseline, "baseline")
    budget: tuple[int, float] = (search.ITERATIONS, evaluations)
    if iterations is not None:
        budget = (as_count(iterations, "iterations"), np.inf)
    work, stages, total = Workers(progress=progress), len(search.STAGES), count * len(search.STAGES)
    generator = np.random.default_rng(rng)
    times = basis.duration / (_DENSE * samples) * np.arange(_DENSE * samples, dtype=np.float64)

    drawn = [search.random_motion(problem, generator) for _ in range(max(pool, count))]
    before = [search.quality(problem, basis.trajectory(X), times) for X in drawn]
    kept = [search.limits_kept(problem, basis.trajectory(X)).kept for X in drawn]
    # feasible motions first
    best = sorted(range(len(drawn)), key=lambda k: (not kept[k], before[k].of(criterion)))[:count]
    ends: list[tuple[ExcitationStart, Array]] = []
    for s, k in enumerate(best):
        X, history, counts, status = search.improved(
            problem, drawn[k], *budget, lambda stage, b=s * stages: work.done((b + stage) / total)
        )
        after = search.quality(problem, basis.trajectory(X), times)
        worse = after.of(criterion) > before[k].of(criterion)
        if kept[k] and (worse or status is ExcitationStatus.INFEASIBLE):  # the start was better
            X, after, status = drawn[k], before[k], ExcitationStatus.LIMIT_OF_ITERATIONS
        ends.append((ExcitationStart(before[k], after, history, counts, status), X))
    _, X = min(ends, key=lambda end: end[0].rank(criterion))
    random = tuple(quality for quality, ok in zip(before, kept, strict=True) if ok)
    done, trajectory = tuple(start for start, _ in ends), basis.trajectory(X)
    notes += (*torque_notes, _advice(done, criterion))
    extremes = search.limits_kept(problem, trajectory)
    return ExcitingTrajectory(
        trajectory, model, base, criterion, extremes, done, random, basis, X, notes
    )


def _advice(done: Sequence[ExcitationStart], criterion: str) -> str:
    """Sentence about broken limits, or how far the starts agree."""
    kept = [start.after for start in done if start.status is not ExcitationStatus.INFEASIBLE]
    if not kept:
        return (
            "Widen the limits that are named as broken, give the motion more time (duration), or "
            "more starts; a robot that cannot carry its weight needs larger torque_limits."
        )
    ends = [quality.of(criterion) for quality in kept]
    name = "condition numbers" if criterion == "condition" else "minus log det"
    return (
        f"Of {len(done)} starts {len(ends)} ended within the limits, at {name} from "
        f"{min(ends):.4g} to {max(ends):.4g}; more of them (starts=) may end lower."
    )


def _checked_base(model: RobotModel, base: BaseParameters | None, drive: Drives) -> BaseParameters:
    """Base parameters of the model, at least one, without friction models."""
    base = base_parameters(model, drive=drive) if base is None else base
    if not isinstance(base, BaseParameters) or base.friction is not None:
        raise InvalidValueError(
            "base: expected base parameters of the model without friction=, which has no gradient "
            "here; identify the parameters of other friction models on the same motion."
        )
    base.check(model)
    if not len(base):
        raise InvalidValueError(
            f"{model.name} has no base parameters: there is nothing to identify."
        )
    return base


def _distances(model: RobotModel, workspace: Any, obstacles: Any, frames: Any) -> Distances | None:
    """Distances that must not be negative as a function of q (N, n), None without any."""
    bodies = checked_obstacles(obstacles)
    if not isinstance(workspace, Box | None):
        raise InvalidValueError(f"workspace: expected Box, got {workspace!r:.60}.")
    frames = (frames,) if isinstance(frames, str | int | None) else tuple(frames)
    distances = partial(origin_distances, model, frames, workspace, bodies)
    distances(np.zeros((1, model.n)))  # raises for unknown frames
    return distances if frames and (workspace is not None or bodies) else None


def _sizes(
    value: ArrayLike, n: int, name: str, numbers: Callable[[ArrayLike, str], Array] = as_floats
) -> Array:
    """Positive numbers (n,), finite or not."""
    given = numbers(value, name)
    if given.shape not in ((), (n,)):
        raise ShapeError(f"{name}: expected shape ({n},), got {given.shape}.")
    if not (given > 0.0).all():
        raise InvalidValueError(f"{name}: expected positive numbers, got {given}.")
    return np.full(n, given)


_RISE = 0.25  # default time from rest to full velocity, s


def excitation_limits(
    model: RobotModel, limits: MotionLimits | None = None
) -> tuple[MotionLimits, tuple[str, ...]]:
    """Finite limits of every joint, and notes on assumed ones.

    Half a turn to each side (0.5 m), half a turn a second (1 m/s), full speed in 0.25 s.
    """
    given = (MotionLimits.of_model(model) if limits is None else limits).for_joints(model.n)
    turns = model.table.sigma[model.table.joint_rows] == REVOLUTE
    span, rate = np.where(turns, 2.0 * np.pi, 1.0), np.where(turns, np.pi, 1.0)
    open_low, open_high = np.isinf(given.lower), np.isinf(given.upper)
    lower = np.where(open_low, np.where(open_high, -0.5 * span, given.upper - span), given.lower)
    upper = np.where(open_high, np.where(open_low, 0.5 * span, given.lower + span), given.upper)
    finite = {"lower": lower, "upper": upper}
    notes = _assumed("position", given.lower, given.upper, lower, upper, 0.5 * (upper - lower))
    for name in ("velocity", "acceleration"):
        least, most = getattr(given, f"{name}_lower"), getattr(given, name)
        low, high = np.where(np.isinf(least), -rate, least), np.where(np.isinf(most), rate, most)
        finite |= {f"{name}_lower": low, name: high}
        notes += _assumed(name, least, most, low, high, high)
        rate = np.maximum(high, -low) / _RISE
    return replace(given, **finite), notes


def _assumed(
    name: str, least: Array, most: Array, low: Array, high: Array, taken: Array
) -> tuple[str, ...]:
    """Note on the joints whose given range is open; raises for finite ranges that are empty."""
    if (low >= high).any():
        j = int((low >= high).argmax())
        raise InvalidValueError(
            f"limits: the {name} of joint {j + 1} has no range, {low[j]:g} to {high[j]:g}: "
            "an unmoved joint is not excited. Widen it, or lock the joint in the model."
        )
    missing = np.isinf(most - least)
    if not missing.any():
        return ()
    joints = ", ".join(str(j + 1) for j in np.flatnonzero(missing))
    values = ", ".join(f"{x:.4g}" for x in np.unique(taken[missing]))
    return (f"No limit of {name} is given for joint {joints}; {values} is taken.",)


def excitation_torques(
    model: RobotModel, torque_limits: ArrayLike | None
) -> tuple[Array, tuple[str, ...]]:
    """Largest torques (n,), infinite where there is no limit, and notes."""
    massive = bool(np.any(model.inertia.values))
    if torque_limits is None:
        effort = np.asarray(model.table.effort, dtype=float)
        if massive or np.isinf(effort).all():
            return read_only(effort), ()
        return np.full(model.n, np.inf), (
            f"{model.name} has no inertial parameters, so that its limits of torque are not "
            "tested; give it rough ones with with_inertia.",
        )
    given = _sizes(torque_limits, model.n, "torque_limits", as_reals)
    if not massive and np.isfinite(given).any():
        raise InvalidValueError(
            f"torque_limits: {model.name} has no inertial parameters, which its torques need; "
            "give it some with with_inertia, or no limits of torque."
        )
    return read_only(given), ()


def origin_distances(
    model: RobotModel,
    frames: Sequence[Frame],
    workspace: Box | None,
    obstacles: Sequence[Obstacle],
    q: Array,
) -> tuple[Array, Array]:
    """Distances of origins from obstacles and the workspace's outside, and their gradients.

    Shapes: q (N, n) -> (N, p), (N, p, n).
    """
    P, J = origins(model, q, frames)
    distances, normals = [np.zeros((len(q), 0))], [np.zeros((len(q), 0, 3))]
    for body in obstacles:
        distance, _, normal = body.nearest(P, P)
        distances.append(distance)
        normals.append(normal)
    if workspace is not None:
        outside, normal = workspace.signed(P)
        distances.append(-outside)
        normals.append(-normal)
    repeated = np.tile(J, (1, len(distances) - 1, 1, 1))
    slopes = np.einsum("npc,npcj->npj", np.concatenate(normals, axis=1), repeated)
    return np.concatenate(distances, axis=1), slopes

"""Choice of configurations that show the parameters best."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_floats
from ..._choices import chosen
from ...errors import InvalidValueError, ShapeError
from ...model import RobotModel, check_model
from ...obstacles.clearance import checked_obstacles, clearance, links
from ...obstacles.shapes import Obstacle
from ..extended_table.candidates import candidate_parameters
from ..extended_table.parameters import GeometricParameters
from ..extended_table.skeleton import Frame
from ..identifiability.identifiable import identifiable_on
from ..measurements.kinds import Groups, Kind, as_kind, drawn_groups, groups_of, measurement_of
from .exchange import Progress, exchanged, greedy, index_of, nested
from .group_rows import group_rows
from .observability import Criterion, Observability, of_singular_values
from .selected import SelectedConfigurations

_LOG = logging.getLogger(__name__)
_JUDGED = 150
"""Candidates at which it is judged what can be told."""
_DRAWS = 12
_MEETING = 1e-6
"""Distance (m) and angle (rad) up to which given postures of a contact count as meeting."""


def select_configurations(
    model: RobotModel,
    kind: Kind | str,
    count: int,
    *,
    candidates: ArrayLike | None = None,
    drawn: int = 1000,
    parameters: GeometricParameters | Iterable[str] | None = None,
    known_lengths: Iterable[str] = (),
    criterion: Criterion | str = Criterion.O1,
    sigma: ArrayLike | None = None,
    frame: Frame = None,
    postures: int | None = None,
    obstacles: Iterable[Obstacle] = (),
    radius: float = 0.05,
    optimise: bool = False,
    starts: int = 3,
    rng: np.random.Generator | None = None,
    progress: bool | Progress = False,
) -> SelectedConfigurations:
    """Choose configurations for a calibration (optimal experiment design, exciting postures).

    An exchange algorithm takes the best set out of candidates: a greedy set and random ones are
    improved member by member until no single exchange makes them better, and the best is kept.
    For contacts the candidates are groups of postures that meet exactly on the nominal robot, each
    group with its own unknown point, pose or plane, and whole groups are exchanged.

    Configurations stay within the joint limits. Obstacles are tested against straight links
    between the origins of the frames (see `obstacles.clearance`), not against the robot's real
    bodies, and paths between configurations are not tested.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    kind : class or str
        What shall be measured: `Pose`, `PointContact`, ... or ``"point_contact"``, ...
    count : int
        How many configurations, or contacts.
    candidates : array_like, shape (N, n) or (N, m, n), optional
        To choose from: configurations, or groups of m postures; default ``drawn`` random ones.
    drawn : int
        How many candidates to draw.
    parameters : GeometricParameters or names, optional
        What shall be estimated; default all. Of these the identifiable ones are looked at.
    known_lengths : iterable of str
        Parameters that are known; contacts need one.
    criterion : Criterion
        Observability index to make large; default O1, the determinant.
    sigma : float or array_like, shape (k,), optional
        Standard deviations of the rows of a measurement, m or rad; default 0.1 mm, and for angles
        what turns the end by as much at the robot's reach.
    frame : str, int or None
        The measured end; None is the tool.
    postures : int, optional
        Postures of a contact; default by the kind.
    obstacles : iterable of Obstacle
        Sphere, Box, Plane, Capsule of `obstacles`.
    radius : float
        Of the links, metres.
    optimise : bool
        Whether the chosen configurations are moved afterwards, within limits and clear of
        obstacles, as long as that helps. Not for contacts.
    starts : int
        Sets to start from: a greedy one, the others random.
    rng : numpy.random.Generator, optional
        Where chance comes from; default a fresh one.
    progress : bool or callable
        True logs, a callable gets (done, total).

    Returns
    -------
    SelectedConfigurations
        The set, its indices, and the curve by which to say how many are enough.

    Raises
    ------
    ShapeError, InvalidValueError
        Fewer candidates than asked for, or fewer than the parameters need; contacts that do not
        meet; no length known; unknown names.

    References
    ----------
    Seed book section 1.4.4; V. V. Fedorov, "Theory of optimal experiments", 1972; J.-H. Borm,
    C.-H. Menq, Int. J. Robotics Research 10(1), 1991; D. Daney, Y. Papegay, B. Madeline,
    "Choosing measurement poses for robot calibration with the local convergence method and Tabu
    search", Int. J. Robotics Research 24(6), 2005.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> found = select_configurations(
    ...     load("rx90"), "pose", 20, drawn=200, rng=np.random.default_rng(0))
    >>> found.q.shape, len(found.parameters)
    ((20, 6), 30)
    """
    check_model(model)
    kind = as_kind(kind)
    criterion = chosen(Criterion, criterion, "criterion")
    count = _whole(count, "count")
    starts = _whole(starts, "starts")
    rng = np.random.default_rng() if rng is None else rng
    told = _progress(progress)
    if optimise and kind.is_constraint:
        raise InvalidValueError(
            "optimise: the postures of a contact cannot be moved one by one; draw more candidates."
        )
    if isinstance(parameters, GeometricParameters):
        looked_at = parameters
    else:
        looked_at = candidate_parameters(model, (frame,))
        looked_at = looked_at if parameters is None else looked_at.subset(parameters)
    space = _Space(model, frame, checked_obstacles(obstacles), radius)
    size = kind.postures if postures is None else _whole(postures, "postures")
    if candidates is None:
        pool, numbers, notes = _drawn(looked_at, kind, _whole(drawn, "drawn"), size, rng, space)
    else:
        pool, numbers, notes = _given(looked_at, kind, candidates, space)
    if len(pool) < count:
        raise InvalidValueError(
            f"count: {count} were asked for, but only {len(pool)} candidates are within the "
            f"limits, clear of obstacles and meet. {' '.join(notes)} Draw more (drawn), or ask "
            "for fewer."
        )
    kept = _identifiable(looked_at, kind, pool, known_lengths, frame, rng)
    rows = group_rows(kept, kind, pool, sigma, frame)
    p, least = len(kept), ceil(len(kept) / rows.shape[1])
    if count < least:
        raise InvalidValueError(
            f"count: {p} parameters need at least {least} for {kind.word}, got {count}."
        )
    effect = np.sqrt((rows**2).sum(axis=(0, 1)) / len(rows))
    scaled = rows / effect
    best = _best(scaled, count, criterion, starts, rng, told)
    groups, members, own = pool[best], numbers[best], scaled[best]
    if optimise:
        from .moved import moved_configurations

        groups = moved_configurations(
            groups, own, criterion,
            lambda q: group_rows(kept, kind, q, sigma, frame) / effect, space.inside, model, told,
        )  # fmt: skip
        members = np.where((groups == pool[best]).all(axis=(1, 2)), members, -1)
        own = group_rows(kept, kind, groups, sigma, frame) / effect
    order = nested(own, np.arange(count), criterion)
    own = own[order]
    curve = _curve(own, criterion)
    return SelectedConfigurations(
        kind=kind, groups=groups[order], candidates=members[order], parameters=kept,
        criterion=criterion, observability=_observability(own), counts=curve[0], values=curve[1],
        deviations=curve[2] / effect, errors=np.sqrt((curve[2] ** 2).mean(axis=1)),
        pool=len(pool), left_out=notes,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Space:
    """Where configurations may be."""

    model: RobotModel
    frame: Frame
    obstacles: tuple[Obstacle, ...]
    radius: float

    def within_limits(self, q: Array) -> NDArray[np.bool_]:
        within = (q >= self.model.lower - 1e-9) & (q <= self.model.upper + 1e-9)
        return np.asarray(within.all(axis=(1, 2)))

    def clear(self, q: Array) -> NDArray[np.bool_]:
        if not self.obstacles:
            return np.ones(len(q), dtype=bool)
        segments = links(self.model, self.frame)
        far = clearance(self.model, q, self.obstacles, self.radius, segments=segments)
        return np.asarray((far > 0.0).all(axis=1))

    def inside(self, q: Array) -> NDArray[np.bool_]:
        """Groups, shape (G, m, n), that are within limits and clear."""
        return self.within_limits(q) & self.clear(q)


Pool = tuple[Array, NDArray[np.int64], tuple[str, ...]]


def _drawn(
    parameters: GeometricParameters,
    kind: Kind,
    wanted: int,
    postures: int,
    rng: np.random.Generator,
    space: _Space,
) -> Pool:
    """Random groups within limits and clear of obstacles."""
    parts: list[Array] = []
    found, touching, short = 0, 0, 0
    for _ in range(_DRAWS):
        drawn = drawn_groups(parameters, kind, wanted, postures, rng, frame=space.frame)
        groups = _whole_groups(drawn, postures)
        short += wanted - len(groups)
        clear = space.clear(groups)
        touching += int((~clear).sum())
        parts.append(groups[clear])
        found += int(clear.sum())
        if found >= wanted:
            break
    pool = np.concatenate(parts)[:wanted]
    notes = []
    if short:
        notes.append(f"{short} drawn contacts do not have {postures} postures within the limits.")
    if touching:
        notes.append(f"{touching} drawn ones touch an obstacle.")
    return pool, np.arange(len(pool)), tuple(notes)


def _whole_groups(drawn: Groups, postures: int) -> Array:
    """Groups with that many postures, shape (G, m, n)."""
    n = drawn.q.shape[1]
    number = np.bincount(drawn.label, minlength=drawn.count)
    full = number[drawn.label] == postures
    return drawn.q[full].reshape(-1, postures, n)


def _given(
    parameters: GeometricParameters, kind: Kind, candidates: ArrayLike, space: _Space
) -> Pool:
    """What the caller gave, without what is beyond limits or touches."""
    q = as_floats(candidates, "candidates")
    n = parameters.model.n
    expected = f"(N, m, {n})" if kind.postures > 1 else f"(N, {n})"
    if q.ndim == 2 and kind.postures == 1:
        q = q[:, None]
    if q.ndim != 3 or q.shape[2] != n or q.shape[1] < min(kind.postures, 2):
        raise ShapeError(f"candidates: expected shape {expected}, got {q.shape}.")
    if kind.is_constraint and len(q):
        _check_meeting(parameters, kind, q, space.frame)
    within = space.within_limits(q)
    clear = space.clear(q)
    notes = []
    if not within.all():
        notes.append(f"{int((~within).sum())} candidates are beyond the limits of the joints.")
    if not clear.all():
        notes.append(f"{int((~clear).sum())} candidates touch an obstacle.")
    at = np.flatnonzero(within & clear)
    return q[at], at, tuple(notes)


def _check_meeting(parameters: GeometricParameters, kind: Kind, q: Array, frame: Frame) -> None:
    measurement = measurement_of(parameters, kind, groups_of(q), frame=frame)
    from ..problem import guessed_fixtures, linearised, problem_of

    problem = problem_of(parameters, [measurement])
    none = np.zeros(len(parameters))
    (found,) = linearised(problem, none, guessed_fixtures(problem, none))
    worst = np.abs(found.residual).max(axis=1).reshape(len(q), -1).max(axis=1)
    bad = np.flatnonzero(worst > _MEETING)
    if len(bad):
        raise InvalidValueError(
            f"candidates: {len(bad)} of {len(q)} groups do not meet on this robot (group {bad[0]} "
            f"misses by {worst[bad[0]]:.2g}); give postures of the same contact, or none to have "
            "them drawn."
        )


def _identifiable(
    parameters: GeometricParameters,
    kind: Kind,
    pool: Array,
    known_lengths: Iterable[str],
    frame: Frame,
    rng: np.random.Generator,
) -> GeometricParameters:
    """Parameters that the candidates tell."""
    some = np.sort(rng.permutation(len(pool))[:_JUDGED])
    measured = measurement_of(parameters, kind, groups_of(pool[some]), frame=frame)
    found = identifiable_on(parameters, [measured], known_lengths)
    if not found.count:
        raise InvalidValueError(
            f"kind: the candidates tell none of the {len(parameters)} parameters by {kind.word}."
        )
    return found.kept


def _best(
    rows: Array,
    count: int,
    criterion: Criterion,
    starts: int,
    rng: np.random.Generator,
    progress: Progress | None,
) -> NDArray[np.int64]:
    """The best of several sets, each a local optimum."""
    best, value = np.zeros(0, dtype=np.int64), -np.inf
    for k in range(starts):
        start = (
            greedy(rows, count, criterion)
            if k == 0
            else rng.permutation(len(rows))[:count].astype(np.int64)
        )
        found = exchanged(rows, start, criterion, _part(progress, k, starts))
        R = rows[found].reshape(-1, rows.shape[-1])
        after = float(index_of(R.T @ R, criterion))
        if after > value or not len(best):
            best, value = found, after
    return best


def _part(progress: Progress | None, k: int, starts: int) -> Progress | None:
    if progress is None:
        return None
    return lambda done, total: progress(k * total + done, starts * total)


def _observability(rows: Array) -> Observability:
    R = rows.reshape(-1, rows.shape[-1])
    s = np.zeros(R.shape[1])
    found = np.linalg.svd(R, compute_uv=False)
    s[: len(found)] = found
    s[s <= 1e-14 * s[0]] = 0.0
    return of_singular_values(s, len(rows))


def _curve(rows: Array, criterion: Criterion) -> tuple[NDArray[np.int64], Array, Array]:
    """Counts, criterion and expected standard deviations of the first parts of a set."""
    counts, values, deviations = [], [], []
    for c in range(1, len(rows) + 1):
        found = _observability(rows[:c])
        if found.o3 <= 1e-9 * found.singular_values[0]:
            continue
        R = np.linalg.qr(rows[:c].reshape(-1, rows.shape[-1]), mode="r")
        counts.append(c)
        values.append(found.value(criterion))
        deviations.append(np.linalg.norm(np.linalg.inv(R), axis=1))
    if not counts:
        raise InvalidValueError(
            "count: the chosen configurations do not tell all parameters; choose more, or other "
            "candidates."
        )
    return np.array(counts, dtype=np.int64), np.array(values), np.array(deviations)


def _whole(value: Any, name: str) -> int:
    if isinstance(value, bool) or int(value) != value or value < 1:
        raise InvalidValueError(f"{name}: expected a whole number from 1, got {value!r:.60}.")
    return int(value)


def _progress(progress: bool | Callable[[int, int], None] | None) -> Progress | None:
    if progress is False or progress is None:
        return None
    if progress is True:
        return lambda done, total: _LOG.info("looked at %d of at most %d members", done, total)
    if callable(progress):
        return progress
    raise InvalidValueError(
        f"progress: expected a flag or a function of (done, total), got {progress!r:.60}."
    )

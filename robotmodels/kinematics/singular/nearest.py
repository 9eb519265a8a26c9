"""Search of singular configurations near a given one.

Book section 1.3.2.3: solutions near singular positions depend on their location.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Rebuilt, as_count, as_exact, as_flag, read_only
from ..._outcomes import Outcome
from ...errors import InvalidValueError
from ...geometry import PRISMATIC
from ...model import RobotModel
from ...table_text import boxed
from .events import SingularityKind
from .frames import frame_words
from .names import arm_geometry, names_at, singular_sets
from .rank import operational_dimension
from .search import FoundPoints, SearchSpace, nearest_points, slope_along
from .task import (
    MaskAxes,
    SingularTask,
    counting_lines,
    deciding_mask,
    generator_of,
    singular_task,
)

_ON_SET = 1e-10
_STATIONARY = 1e-7
_SAME = 1e-5
_BESIDE = 8
_ALREADY, _ASIDE, _FLAT = 1e-9, 1e-4, 3e-6


class NearestStatus(Outcome):
    """Status of one found configuration; fits int8. Each member has a ``sentence``."""

    NEAREST = 0, "Singular, and none of the same kind in its neighbourhood is nearer."
    AT_LIMIT = 1, "Singular, and none that respects the joint limits is nearer there."
    NOT_STATIONARY = 2, "Singular, but a nearer one in its neighbourhood is not excluded."
    CROSSING = (
        3, "Singular in another way than the given configuration, and the nearest to within 1e-4.",
    )  # fmt: skip


class SearchOutcome(Outcome):
    """Outcome of a search; each member has a ``sentence``."""

    FOUND = 0, "Singular configurations were found."
    ALREADY_SINGULAR = 1, "The given configuration is singular itself."
    NONE_FOUND = 2, "No singular configuration was found from any start."


@dataclass(frozen=True, slots=True, eq=False)
class NearestSingularities(Rebuilt):
    """Singular configurations by their distance from a given one. Read-only; `print` it.

    S rows, the nearest first; none twice, also not by whole turns of a joint unless limits were
    requested.

    Parameters
    ----------
    start, q : ndarray, shapes (n,) and (S, n)
        The given configuration, and singular ones, rad or m.
    distance : ndarray, shape (S,)
        From ``start``, weighted: ``sqrt(sum of w (dq)^2)``, strokes in units of ``length``.
    direction : ndarray, shape (S, n)
        ``(q - start) / distance``, rad or m per unit of distance; zero where the distance is.
    escape, slope : ndarray, shapes (S, n) and (S,)
        Joint direction normal to the singular set there, rad or m per unit of distance, towards
        ``start``, and the slope of the weakest singular value along it: nearly 0 where the set is
        touched twice, or where two sets cross.
    codimension : ndarray of int, shape (S,)
        Number of conditions on the joints that the set makes there: 1 is a surface.
    kind, words : tuples, one for each row, of tuples of SingularityKind and of str
        Names and sentences.
    residual, stationarity : ndarray, shape (S,)
        Weakest singular value over the largest, and the part of the difference to ``start`` that
        lies along the set, in units of distance (infinite where sets cross): 0 is exact.
    status : ndarray of int8, shape (S,)
        Codes of `NearestStatus`.
    outcome : SearchOutcome
        Of the whole search.
    length : float
        Characteristic length, metres.
    mask, frame : ndarray of bool, shape (6,), and str
        Components that count, and what the frame is called.
    """

    start: Array
    q: Array
    distance: Array
    direction: Array
    escape: Array
    slope: Array
    codimension: NDArray[np.int64]
    kind: tuple[tuple[SingularityKind, ...], ...]
    words: tuple[tuple[str, ...], ...]
    residual: Array
    stationarity: Array
    status: NDArray[np.int8]
    outcome: SearchOutcome
    length: float
    mask: NDArray[np.bool_]
    frame: str

    @property
    def count(self) -> int:
        """Number of configurations found."""
        return len(self.q)

    def of(self, kind: SingularityKind) -> int | None:
        """Row of the nearest configuration of a kind; None if there is none."""
        return next((i for i, kinds in enumerate(self.kind) if kind in kinds), None)

    def reason(self, i: int = 0) -> str:
        """Sentence of the status of row i."""
        return NearestStatus(int(self.status[i])).sentence

    def __str__(self) -> str:
        """Table of the configurations that were found, and the meaning of the kinds below it."""
        lines = [self.outcome.sentence, *counting_lines(self.mask, self.frame)]
        if not self.count:
            return "\n".join(lines)
        columns = [
            ("distance", [f"{d:.4g}" for d in self.distance]),
            ("kind", [", ".join(kind.value for kind in row) for row in self.kind]),
        ]
        columns += [
            (f"q{j}", [f"{round(float(x), 5) + 0.0:.5g}" for x in column])
            for j, column in enumerate(self.q.T, start=1)
        ]
        words = dict.fromkeys(text for row in self.words for text in row)
        return "\n".join([*lines, boxed(columns), *words])

    def __repr__(self) -> str:
        return f"<NearestSingularities {self.outcome.name}: {self.count} found>"


def nearest_singularity(
    model: RobotModel,
    q: ArrayLike,
    frame: str | int | None = None,
    limits: bool = False,
    weights: ArrayLike | None = None,
    length: float | None = None,
    mask: ArrayLike | str | None = None,
    mask_axes: MaskAxes = "world",
    starts: int = 48,
    most: int = 16,
    rng: np.random.Generator | int | None = None,
) -> NearestSingularities:
    """Singular configurations nearest to a given one, in joint space.

    From several starts, Newton's iteration goes to where the rank drops below the dimension of
    the operational space, then along that set to the point nearest to the given configuration.
    The results are local minima of the distance, the nearest first: usually one or two for
    each kind of singularity. That none was missed is not proven.

    Parameters
    ----------
    q : array_like, shape (n,)
        The given configuration, rad or m.
    limits : bool
        Whether only configurations inside the joint limits count.
    weights : array_like, shape (n,), optional
        Of the squares of the joint differences, above 0; default 1. Strokes are in units of the
        characteristic length.
    starts, most : int
        Number of starts, the given configuration included, and of configurations to keep.
    rng : numpy.random.Generator or int, optional
        Generator or seed of the other starts; default a fixed seed.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> found = nearest_singularity(load("rx90"), [0.1, 0.2, -1.2, 0.4, 0.5, 0.6])
    >>> [found.words[i][0].split(":")[0] for i in range(2)], found.distance[:2]
    (['elbow', 'wrist'], array([0.3708, 0.5 ]))
    """
    mask = deciding_mask(model, frame, mask)
    task = singular_task(model, frame, mask, mask_axes, length)
    start = as_exact(q, (model.n,), "q")
    limits = as_flag(limits, "limits")
    w = np.ones(model.n) if weights is None else as_exact(weights, (model.n,), "weights")
    if not (w > 0.0).all():
        raise InvalidValueError(f"weights: expected numbers above 0, got {w.tolist()}.")
    count, most = as_count(starts, "starts", 1), as_count(most, "most", 1)
    whole = operational_dimension(model, frame, None, task.length, mask=mask, mask_axes=mask_axes)
    unit = task.joint_scale / np.sqrt(w)
    free = np.full(model.n, np.inf)
    space = SearchSpace(
        task=task,
        dimension=whole.dimension,
        unit=unit,
        start=start / unit,
        lower=model.lower / unit if limits else -free,
        upper=model.upper / unit if limits else free,
    )
    first = _starts(task, start, count, bool(limits), generator_of(rng)) / unit
    if not task.moving.any() or whole.dimension == 0:  # it never moves: nothing to lose
        return _result(space, start, None, [])
    found = _confirmed(space, nearest_points(space, first), bool(limits), most)
    rows = _distinct(space, found, bool(limits), most)
    if rows and np.linalg.norm(found.x[rows[0]] - space.start) < _ALREADY:
        found, rows = _with_crossings(space, first, found, rows, bool(limits), most)
    return _result(space, start, found, rows)


def _with_crossings(
    space: SearchSpace, first: Array, found: FoundPoints, rows: list[int], limits: bool, most: int
) -> tuple[FoundPoints, list[int]]:
    """The points, and those of other sets that meet the set of the given configuration.

    Their nearest points are likely to be where they meet it, and there they have no tangent.
    Seen from a little beside the set they are ordinary.
    """
    seen_from = replace(space, start=space.start + _ASIDE * found.escape[rows[0]])
    others = _confirmed(seen_from, nearest_points(seen_from, first), limits, most)
    away = np.linalg.norm(others.x[:, None] - found.x[rows][None], axis=2)
    others = _picked(others, away.min(axis=1) > 10.0 * _ASIDE)
    # points that are not exactly stationary are marked by infinity, as these are
    others = replace(others, tangential=np.full(len(others.x), np.inf))
    both = (np.concatenate([getattr(x, f.name) for x in (found, others)]) for f in fields(found))
    found = FoundPoints(*both)
    return found, _distinct(space, found, limits, most)


def _starts(
    task: SingularTask, start: Array, count: int, limits: bool, rng: np.random.Generator
) -> Array:
    """The given configuration, others around it, and others anywhere."""
    model, n = task.model, task.model.n
    prismatic = model.table.sigma[model.table.joint_rows] == PRISMATIC
    reach = np.where(prismatic, task.length, pi)
    far = np.where(np.arange(count) % 2, 1.0, 0.2)
    starts = start + reach * far[:, None] * rng.uniform(-1.0, 1.0, size=(count, n))
    starts[0] = start
    if limits:
        starts = np.clip(starts, model.lower, model.upper)
    return starts


def _distinct(space: SearchSpace, found: FoundPoints, limits: bool, most: int) -> list[int]:
    """Rows of points that are on the set, each once, the nearest first."""
    model = space.task.model
    turning = model.table.sigma[model.table.joint_rows] != PRISMATIC
    turn = np.where(turning, 2.0 * pi / space.unit, np.inf)
    distance = np.linalg.norm(found.x - space.start, axis=1)
    # converged ones come first among equals, so that an inaccurate copy does not replace them
    order = np.lexsort((found.tangential, distance.round(6)))
    kept: list[int] = []
    for i in order:
        if not found.weakest[i] <= _ON_SET:
            continue
        away = found.x[kept] - found.x[i]
        if not limits:
            whole = np.where(turning, np.round(away / turn), 0.0)
            away = away - np.where(turning, whole * np.where(turning, turn, 0.0), 0.0)
        if not (np.linalg.norm(away, axis=1) < _SAME).any():
            kept.append(int(i))
        if len(kept) == most:
            break
    return kept


def _confirmed(space: SearchSpace, found: FoundPoints, limits: bool, most: int) -> FoundPoints:
    """The points to which starts beside them converge.

    Where two sets cross, neither has a tangent and the gradients vanish, so that the conditions
    of a nearest point hold trivially: starts beside such a point move away along one of them.
    """
    rows = _distinct(space, found, limits, most)
    n = found.x.shape[1]
    aside = np.random.default_rng(0).normal(size=(len(rows), _BESIDE, n))
    aside *= 2e-3 / np.linalg.norm(aside, axis=2, keepdims=True)
    starts = found.x[rows][:, None] + aside
    around = nearest_points(space, starts.reshape(-1, n))
    away = around.x.reshape(starts.shape) - found.x[rows][:, None]
    back = np.linalg.norm(away, axis=2) < _SAME
    keep = np.zeros(len(found.x), dtype=bool)
    # a set that is touched twice has no slope either, but all starts come back to it
    flat = found.slope[rows] < _FLAT
    keep[rows] = np.where(flat, back.all(axis=1), back.any(axis=1))
    return _picked(found, keep)


def _picked(found: FoundPoints, keep: NDArray[np.bool_]) -> FoundPoints:
    return FoundPoints(*(getattr(found, field.name)[keep] for field in fields(FoundPoints)))


def _result(
    space: SearchSpace, start: Array, found: FoundPoints | None, rows: list[int]
) -> NearestSingularities:
    """Names and statuses; a point that is not stationary is kept only if its kind has no other."""
    task, n = space.task, len(start)
    if found is None:
        none, number = np.zeros((0, n)), np.zeros(0)
        found = FoundPoints(none, number, number, number, number.astype(int), none, none > 0.0)
    named = {}
    if rows:
        arm = arm_geometry(task)
        sets = (singular_sets(task, found.x[i] * space.unit, space.dimension, arm) for i in rows)
        named = {i: names_at(each, 1e-9) for i, each in zip(rows, sets, strict=True)}
    stationary = found.tangential <= _STATIONARY
    known = {name for i in rows if stationary[i] for name in named[i]}
    crossing = np.isinf(found.tangential)
    rows = [i for i in rows if stationary[i] or crossing[i] or not known.issuperset(named[i])]
    x = found.x[rows]
    distance = np.linalg.norm(x - space.start, axis=1)
    apart = distance > 1e-9
    size = np.where(apart, distance, 1.0)[:, None]
    direction = np.where(apart[:, None], (x - space.start) / size, 0.0) * space.unit
    status = np.where(
        stationary[rows],
        np.where(found.held[rows].any(axis=1), NearestStatus.AT_LIMIT, NearestStatus.NEAREST),
        np.where(crossing[rows], NearestStatus.CROSSING, NearestStatus.NOT_STATIONARY),
    )
    outcome = SearchOutcome.NONE_FOUND
    if rows:
        there = distance[0] < _ALREADY
        outcome = SearchOutcome.ALREADY_SINGULAR if there else SearchOutcome.FOUND
    return NearestSingularities(
        start=read_only(start),
        q=read_only(x * space.unit),
        distance=read_only(distance),
        direction=read_only(direction),
        escape=read_only(found.escape[rows] * space.unit),
        slope=read_only([slope_along(space, found.x[i], found.escape[i]) for i in rows]),
        codimension=read_only(found.codimension[rows], np.int64),
        kind=tuple(tuple(dict.fromkeys(kind for kind, _ in named[i])) for i in rows),
        words=tuple(tuple(text for _, text in named[i]) for i in rows),
        residual=read_only(found.weakest[rows]),
        stationarity=read_only(found.tangential[rows]),
        status=read_only(status, np.int8),
        outcome=outcome,
        length=task.length,
        mask=task.mask,
        frame=frame_words(task.frame),
    )

"""Selection of configurations that identify the parameters best (optimal experiment design)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, as_count, as_floats
from .._arrays.tasks import Progress, Workers
from .._choices import chosen
from ..errors import InvalidValueError, ShapeError
from ..geometry import REVOLUTE
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel, check_model
from ..obstacles.clearance import checked_obstacles, clearance, links
from ..obstacles.shapes import Obstacle
from .candidates import chosen_candidates
from .extended_table import Frame
from .identifiable import identifiable_on
from .measurements import whitened
from .measurements.fields import as_sigma
from .measurements.kinds import Kind, as_kind, drawn_groups, groups_of, measurement_of
from .observability import (
    Criterion,
    Observability,
    exchanged,
    greedy,
    index_of,
    information,
    observability,
)
from .parameters import GeometricParameters
from .problem import guessed_fixtures, linearised, problem_of

_LENGTH_NOISE = 1e-4  # standard error of a length where none is given, m
_RANKED = 150  # number of candidate configurations used for the rank test
_DRAWS = 12
_CONTACT_TOLERANCE = 1e-6  # m and rad up to which given postures of a contact count as meeting
_CHUNK = 32
_STEPS, _NEARBY = (0.3, 0.1, 0.03, 0.01), 20
"""Sizes of random steps of a selected configuration, by the joint ranges, and their number."""


@dataclass(frozen=True, slots=True, eq=False)
class SelectedConfigurations(Frozen):
    """Configurations selected for a calibration, the most useful ones first.

    The first c of them are a good set of c for every c.

    Parameters
    ----------
    kind, criterion, parameters
        The kind of measurement, the index that was maximised, p parameters that are identified.
    groups : ndarray, shape (count, m, n)
        Postures of each configuration: one, or several of a contact; rad, m.
    candidates : ndarray of int, shape (count,)
        Number of each among the ``pool`` candidates; -1 for those that were moved afterwards.
    observability : Observability
        Of the set; columns of unit root mean square over all candidates, rows of unit noise.
    counts, values, errors : ndarray, shape (C,)
        Sizes of first parts that identify all parameters; their criterion, and root mean square of
        the standard errors times the effects of the parameters, in those of the measurement.
    standard_errors : ndarray, shape (C, p)
        Expected standard errors of the parameters (their units) for each.
    left_out : tuple of str
        Candidates that were left out and why, in sentences.
    """

    kind: Kind
    groups: Array
    candidates: NDArray[np.int64]
    parameters: GeometricParameters
    criterion: Criterion
    observability: Observability
    counts: NDArray[np.int64]
    values: Array
    standard_errors: Array
    errors: Array
    pool: int
    left_out: tuple[str, ...]

    @property
    def count(self) -> int:
        """Number of selected configurations or contacts."""
        return len(self.groups)

    @property
    def q(self) -> Array:
        """All postures as rows, shape (count * m, n)."""
        return self.groups.reshape(-1, self.groups.shape[-1])

    @property
    def labels(self) -> NDArray[np.int64]:
        """Number of the contact that each row of ``q`` belongs to."""
        return np.repeat(np.arange(self.count), self.groups.shape[1])

    @property
    def gains(self) -> Array:
        """Part by which each added one lowers the expected error, shape (C - 1,)."""
        return 1.0 - self.errors[1:] / self.errors[:-1]

    def enough(self, gain: float = 0.02) -> int | None:
        """Count from which each further one lowers the expected error by less than a part.

        Similar configurations lower it as 1 / sqrt(count): parts below 1 / (2 count) stay out of
        reach. None if the selected ones are not that many.
        """
        if not 0.0 < gain < 1.0:
            raise InvalidValueError(f"gain: expected a fraction between 0 and 1, got {gain!r}.")
        large = np.flatnonzero(self.gains >= gain)
        first = int(large[-1]) + 1 if len(large) else 0
        return int(self.counts[first]) if first < len(self.counts) - 1 else None

    def enough_sentence(self, gain: float = 0.02) -> str:
        """The count of `enough` in a sentence."""
        count, part = self.enough(gain), f"{100.0 * gain:g} %"
        if count is None:
            return f"{self.count} are not yet enough for a gain below {part}."
        return f"From {count} on, each further one lowers the expected error by less than {part}."

    def __str__(self) -> str:
        chosen = (
            f"{self.count} chosen of {self.pool} candidates for {self.kind.word}, "
            f"{self.groups.shape[1]} postures each: {self.criterion.name} "
            f"{self.observability.value(self.criterion):.4g} for {len(self.parameters)} parameters."
        )
        return "\n".join([chosen, f"{self.observability}.", *self.left_out, self.enough_sentence()])


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
    rng: np.random.Generator | int | None = None,
    progress: Progress = False,
) -> SelectedConfigurations:
    """Select configurations for a calibration (optimal experiment design).

    An exchange algorithm takes the best set out of candidates: a greedy set and random ones are
    improved member by member until no single exchange makes them better, and the best is kept.
    Contacts are exchanged as whole groups of postures that meet on the nominal robot, each with its
    own unknown target. Configurations stay within the joint limits and clear of obstacles, which
    are tested against straight links (see `obstacles.clearance`); paths between are not tested.

    Parameters
    ----------
    model, parameters, known_lengths, frame, rng, progress
        See `robotmodels.calibration`. The identifiable ones among the parameters count.
    kind : class or str
        The kind of measurement: `Pose`, `PointContact`, ... or ``"point_contact"``, ...
    count : int
        How many configurations, or contacts.
    candidates : array_like, shape (N, n) or (N, m, n), optional
        To choose from: configurations, or groups of m postures; default ``drawn`` random ones.
    drawn : int
        How many candidates to draw.
    criterion : Criterion
        Observability index to maximise; default O1, the determinant.
    sigma : float or array_like, shape (k,), optional
        Standard errors of the rows of a measurement, m or rad; default 0.1 mm, and the angle that
        turns the end by as much at the robot's reach.
    postures : int, optional
        Postures of a contact; default by the kind.
    obstacles, radius
        Sphere, Box, Plane, Capsule of `obstacles`; radius of the links, metres.
    optimise : bool
        Whether the selected configurations are then exchanged for random ones near them. Not for
        contacts.
    starts : int
        Sets to start from: a greedy one, the others random.

    Returns
    -------
    SelectedConfigurations
        The set, its indices, and the expected error for each count.

    References
    ----------
    Book section 1.4.4; V. V. Fedorov, "Theory of optimal experiments", 1972.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> found = select_configurations(load("rx90"), "pose", 20, drawn=200, rng=0)
    >>> found.q.shape, len(found.parameters)
    ((20, 6), 30)
    """
    check_model(model)
    kind = as_kind(kind)
    criterion = chosen(Criterion, criterion, "criterion")
    count, starts = as_count(count, "count"), as_count(starts, "starts")
    rng = np.random.default_rng(rng)
    work = Workers(progress=progress)
    if optimise and kind.is_constraint:
        raise InvalidValueError(
            "optimise: the postures of a contact cannot be moved one by one; draw more candidates."
        )
    parameters = chosen_candidates(parameters, model, (frame,))
    bodies = checked_obstacles(obstacles)

    def is_clear(q: Array) -> NDArray[np.bool_]:
        if not bodies:
            return np.ones(len(q), dtype=bool)
        far = clearance(model, q, bodies, radius, segments=links(model, frame))
        return np.asarray((far > 0.0).all(axis=1))

    if candidates is None:
        size = kind.postures if postures is None else as_count(postures, "postures")
        wanted = as_count(drawn, "drawn")
        rounds = (_drawn(parameters, kind, wanted, size, rng, frame) for _ in range(_DRAWS))
    else:
        given = _given(parameters, kind, candidates, frame)
        wanted, rounds = len(given), iter([given])
    parts, numbers, seen = [], [], 0
    left_out = {"beyond the limits": 0, "at an obstacle": 0}
    for groups in rounds:
        within, clear = _within_limits(model, groups), is_clear(groups)
        left_out["beyond the limits"] += int((~within).sum())
        left_out["at an obstacle"] += int((~clear).sum())
        parts.append(groups[within & clear])
        numbers.append(seen + np.flatnonzero(within & clear))
        seen += len(groups)
        if sum(map(len, parts)) >= wanted:
            break
    pool, numbers = np.concatenate(parts)[:wanted], np.concatenate(numbers)[:wanted]
    notes = tuple(f"{n} candidates are {why}." for why, n in left_out.items() if n)
    if len(pool) < count:
        raise InvalidValueError(
            f"count: expected at most {len(pool)}, the number of usable candidates (within the "
            "limits, clear of obstacles, contacts satisfied), got "
            f"{count}. {' '.join(notes)} Draw more (drawn)."
        )
    ranked = groups_of(pool[np.sort(rng.permutation(len(pool))[:_RANKED])])
    measured = measurement_of(parameters, kind, ranked, frame=frame)
    kept = identifiable_on(parameters, [measured], known_lengths).kept
    rows = group_rows(kept, kind, pool, sigma, frame)
    least = ceil(len(kept) / rows.shape[1])
    if not 0 < least <= count:
        raise InvalidValueError(
            f"count: the {len(kept)} parameters that {kind.word} identifies at the candidates need "
            f"at least {least}, got {count}."
        )
    effect = np.sqrt((rows**2).sum(axis=(0, 1)) / len(rows))
    scaled = rows / effect
    best, value = np.zeros(0, dtype=np.int64), -np.inf
    for k in range(starts):  # the best of several local optima
        start = rng.permutation(len(rows))[:count] if k else greedy(scaled, count, criterion)
        members = exchanged(scaled, start, criterion, work.part(k / starts, (k + 1) / starts))
        after = float(index_of(information(scaled[members]), criterion))
        if after > value or not len(best):
            best, value = members, after
    groups, numbers, part = pool[best], numbers[best], scaled[best]
    for size in _STEPS if optimise else ():
        step = size * _ranges(model) * rng.normal(size=(_NEARBY, *groups.shape))
        near = np.clip(groups + step, model.lower, model.upper).reshape(-1, *groups.shape[1:])
        near = near[is_clear(near)]
        rows = np.concatenate([part, group_rows(kept, kind, near, sigma, frame) / effect])
        members = exchanged(rows, np.arange(count), criterion, Workers())
        groups, part = np.concatenate([groups, near])[members], rows[members]
        numbers = np.where(members < count, numbers[members % count], -1)
    order = greedy(part, count, criterion)  # so that first parts are good sets, too
    part = part[order]
    counts, values, errors = _curve(part, criterion)
    return SelectedConfigurations(
        kind=kind,
        groups=groups[order],
        candidates=numbers[order],
        parameters=kept,
        criterion=criterion,
        observability=observability(part),
        counts=counts,
        values=values,
        standard_errors=errors / effect,
        errors=np.sqrt((errors**2).mean(axis=1)),
        pool=len(pool),
        left_out=notes,
    )


def group_rows(
    parameters: GeometricParameters,
    kind: Kind | str,
    q: Array,
    sigma: ArrayLike | None = None,
    frame: Frame = None,
) -> Array:
    """Whitened rows of each group with its fixtures eliminated.

    Shapes: q (G, m, n), sigma (k,) -> (G, k', P).
    """
    parts = []
    xi = np.zeros(len(parameters))
    for first in range(0, len(q), _CHUNK):
        part = q[first : first + _CHUNK]
        G = len(part)
        measurement = measurement_of(parameters, kind, groups_of(part), frame=frame)
        problem = problem_of(parameters, [measurement])
        units = measurement.units
        if sigma is None:
            turn = _LENGTH_NOISE / characteristic_length(parameters.model, frame)
            scale = np.array([_LENGTH_NOISE if unit == "m" else turn for unit in units])
        else:
            scale = as_sigma(sigma, 1, len(units))[0]
        (rows,) = linearised(problem, xi, guessed_fixtures(problem, xi))
        count = part.shape[1] * len(units)
        A = whitened(measurement, rows.by_parameters, scale).reshape(G, count, len(parameters))
        if problem.F:
            F = whitened(measurement, rows.by_fixtures, scale)
            F = F.reshape(G, count, G, -1)[np.arange(G), :, np.arange(G)]
            Q = np.linalg.qr(F, mode="complete")[0]
            A = Q[:, :, F.shape[-1] :].swapaxes(-1, -2) @ A
        parts.append(A)
    return np.concatenate(parts)


def _within_limits(model: RobotModel, q: Array) -> NDArray[np.bool_]:
    """Groups (G, m, n) within the joint limits."""
    within = (q >= model.lower - 1e-9) & (q <= model.upper + 1e-9)
    return np.asarray(within.all(axis=(1, 2)))


def _ranges(model: RobotModel) -> Array:
    """Widths of the joint ranges (n,); 0 for endless strokes: longer levers are always better."""
    width = model.upper - model.lower
    turns = model.table.sigma[model.table.joint_rows] == REVOLUTE
    return np.where(np.isfinite(width), width, 2.0 * np.pi * turns)


def _drawn(
    parameters: GeometricParameters,
    kind: Kind,
    wanted: int,
    postures: int,
    rng: np.random.Generator,
    frame: Frame,
) -> Array:
    """Random groups (G, m, n) with all their postures within the limits."""
    q, label = drawn_groups(parameters, kind, wanted, postures, rng, frame=frame)
    whole = np.bincount(label, minlength=1)[label] == postures
    return q[whole].reshape(-1, postures, q.shape[1])


def _given(
    parameters: GeometricParameters, kind: Kind, candidates: ArrayLike, frame: Frame
) -> Array:
    """Given candidates as groups, shape (G, m, n); contacts must meet."""
    q = as_floats(candidates, "candidates")
    n = parameters.model.n
    expected = f"(N, m, {n})" if kind.postures > 1 else f"(N, {n})"
    if q.ndim == 2 and kind.postures == 1:
        q = q[:, None]
    if q.ndim != 3 or q.shape[2] != n or q.shape[1] < min(kind.postures, 2):
        raise ShapeError(f"candidates: expected shape {expected}, got {q.shape}.")
    if not kind.is_constraint or not len(q):
        return q
    problem = problem_of(parameters, [measurement_of(parameters, kind, groups_of(q), frame=frame)])
    xi = np.zeros(len(parameters))
    (rows,) = linearised(problem, xi, guessed_fixtures(problem, xi))
    worst = np.abs(rows.residual).max(axis=1).reshape(len(q), -1).max(axis=1)
    bad = np.flatnonzero(worst > _CONTACT_TOLERANCE)
    if len(bad):
        raise InvalidValueError(
            f"candidates: {len(bad)} of {len(q)} groups do not meet on this robot (group {bad[0]} "
            f"is off by {worst[bad[0]]:.2g}); give postures of the same contact, or none to have "
            "them drawn."
        )
    return q


def _curve(rows: Array, criterion: Criterion) -> tuple[NDArray[np.int64], Array, Array]:
    """Counts, criterion and expected standard errors of the first parts of a set."""
    counts, values, errors = [], [], []
    for c in range(1, len(rows) + 1):
        indices = observability(rows[:c])
        if indices.o3 <= 1e-9 * indices.singular_values[0]:
            continue
        R = np.linalg.qr(rows[:c].reshape(-1, rows.shape[-1]), mode="r")
        counts.append(c)
        values.append(indices.value(criterion))
        errors.append(np.linalg.norm(np.linalg.inv(R), axis=1))
    if not counts:
        raise InvalidValueError(
            "count: the selected configurations do not identify all parameters; select more, or "
            "other candidates."
        )
    return np.array(counts, dtype=np.int64), np.array(values), np.array(errors)

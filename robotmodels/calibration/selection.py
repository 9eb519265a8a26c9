"""How well a set of configurations shows the parameters: five indices of singular values."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_exact, as_floats, read_only
from .._choices import chosen
from ..errors import InvalidValueError, ShapeError
from ..geometry import PRISMATIC
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel, check_model
from ..obstacles.clearance import checked_obstacles, clearance, links
from ..obstacles.shapes import Obstacle
from .candidates import candidate_parameters
from .extended_table import Frame
from .identifiable import IdentifiableParameters, identifiable_on
from .measurements import Measurement
from .measurements.kinds import Groups, Kind, as_kind, drawn_groups, groups_of, measurement_of
from .measurements.noise import whitened
from .parameters import GeometricParameters
from .problem import linearised, problem_of

_NONE = 1e-14
"""A singular value below this part of the largest is zero: the parameters are not all seen."""


class Criterion(Enum):
    """Which index is made as large as possible; the value is its formula.

    Examples
    --------
    >>> Criterion.O2.value
    's_L / s_1'
    """

    O1 = "(s_1 ... s_L)^(1/L) / sqrt(m)"
    O2 = "s_L / s_1"
    O3 = "s_L"
    O4 = "s_L^2 / s_1"
    O5 = "1 / (1/s_1 + ... + 1/s_L)"


@dataclass(frozen=True, slots=True, eq=False)
class Observability(Rebuilt):
    """The five observability indices; larger is better for all.

    Parameters
    ----------
    o1 : float
        ``(s_1 ... s_L)^(1/L) / sqrt(m)``: volume of the ellipsoid of what deviations do.
    o2 : float
        ``s_L / s_1``: its inverse condition, its shape.
    o3 : float
        ``s_L``: its shortest axis, the worst seen combination.
    o4 : float
        ``s_L^2 / s_1``: noise amplification index.
    o5 : float
        ``1 / (1/s_1 + ... + 1/s_L)``: the harmonic mean of the axes, divided by L.
    singular_values : ndarray, shape (L,)
        s_1 >= ... >= s_L, of the scaled matrix.
    configurations : int
        m.
    """

    o1: float
    o2: float
    o3: float
    o4: float
    o5: float
    singular_values: Array
    configurations: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "singular_values", read_only(self.singular_values))

    @property
    def condition(self) -> float:
        """``s_1 / s_L``; infinite if a combination is not seen."""
        return 1.0 / self.o2 if self.o2 > 0.0 else np.inf

    def value(self, criterion: Criterion) -> float:
        """One of the indices.

        Parameters
        ----------
        criterion : Criterion
            Which.

        Returns
        -------
        float
            Its value.
        """
        return {
            Criterion.O1: self.o1, Criterion.O2: self.o2, Criterion.O3: self.o3,
            Criterion.O4: self.o4, Criterion.O5: self.o5,
        }[criterion]  # fmt: skip

    def __str__(self) -> str:
        return ", ".join(f"{c.name} {self.value(c):.4g}" for c in Criterion) + (
            f" ({len(self.singular_values)} parameters, {self.configurations} configurations)"
        )


def observability(
    psi: ArrayLike | IdentifiableParameters,
    configurations: int | None = None,
    *,
    scales: ArrayLike | None = None,
) -> Observability:
    """Observability indices O1 to O5 of an identification matrix (also: excitation indices).

    All five are functions of the singular values s_1 >= ... >= s_L of the matrix whose rows are
    measured and whose L columns are parameters. O1 orders sets of configurations in the same way
    whatever the units of the parameters; the others do not, so give comparable columns: ``scales``
    are the sizes of the parameters that count as equally large (their expected errors, for
    instance), by which columns are multiplied. Rows of different units should be divided by their
    standard deviations before.

    Parameters
    ----------
    psi : array_like, shape (m, k, L) or (M, L), or IdentifiableParameters
        Rows of m configurations, k each; or all rows together, and ``configurations`` says of how
        many. For identifiable parameters: those kept, fixtures eliminated.
    configurations : int, optional
        m; default the first axis of ``psi`` (M rows count as M configurations).
    scales : array_like, shape (L,), optional
        Sizes of the parameters; default 1.

    Returns
    -------
    Observability
        The indices.

    Raises
    ------
    ShapeError, InvalidValueError
        No matrix, no column, NaN; scales that are not positive; no configuration.

    References
    ----------
    O1: J.-H. Borm, C.-H. Menq, "Determination of optimal measurement configurations for robot
    calibration based on observability measure", Int. J. Robotics Research 10(1), 1991. O2:
    M. R. Driels, U. S. Pathre, "Significance of observation strategy on the design of robot
    calibration experiments", J. Robotic Systems 7(2), 1990. O3, O4: A. Nahvi,
    J. M. Hollerbach, "The noise amplification index for optimal pose selection in robot
    calibration", IEEE ICRA 1996. O5: Y. Sun, J. M. Hollerbach, "Observability index selection for
    robot calibration", IEEE ICRA 2008. Seed book section 1.4.4.

    Examples
    --------
    >>> found = observability(np.diag([4.0, 2.0, 1.0]), 1)
    >>> found.o1, found.o2, found.o3, found.o4
    (2.0, 0.25, 1.0, 0.25)
    >>> round(found.o5, 4)
    0.5714
    """
    if isinstance(psi, IdentifiableParameters):
        configurations = psi.configurations if configurations is None else configurations
        psi = psi.factor
    W = as_floats(psi, "psi")
    if W.ndim not in (2, 3) or not W.size:
        raise ShapeError(f"psi: expected shape (M, L) or (m, k, L), none of them 0, got {W.shape}.")
    m = len(W) if configurations is None else configurations
    if isinstance(m, bool) or int(m) != m or m < 1:
        raise InvalidValueError(f"configurations: expected a whole number from 1, got {m!r}.")
    W = W.reshape(-1, W.shape[-1])
    if scales is not None:
        sizes = as_exact(scales, (W.shape[1],), "scales")
        if not (sizes > 0.0).all():
            raise InvalidValueError("scales: expected positive sizes of the parameters.")
        W = W * sizes
    return of_singular_values(_singular_values(W), int(m))


def of_singular_values(s: Array, configurations: int) -> Observability:
    """Observability indices of given singular values. Shapes: s (L,)."""
    first, last = float(s[0]), float(s[-1])
    seen = last > 0.0
    return Observability(
        o1=float(np.exp(np.log(s).mean()) / np.sqrt(configurations)) if seen else 0.0,
        o2=last / first if seen else 0.0,
        o3=last,
        o4=last**2 / first if seen else 0.0,
        o5=float(1.0 / (1.0 / s).sum()) if seen else 0.0,
        singular_values=s,
        configurations=configurations,
    )


def _singular_values(W: Array) -> Array:
    L = W.shape[1]
    s = np.zeros(L)
    found = np.linalg.svd(W, compute_uv=False)
    s[: len(found)] = found
    s[s <= _NONE * s[0]] = 0.0
    return s


Progress = Callable[[int, int], None]
_RIDGE = 1e-12
"""Added to the information, relative to its mean, so that sets that are too small compare too."""
_GAIN = 1e-10
_SWEEPS = 50
_CHUNK = 4096


def index_of(information: Array, criterion: Criterion) -> Array:
    """Observability criterion of information matrices, up to a constant.

    Shapes: information (..., p, p).
    """
    if criterion is Criterion.O1:
        sign, value = np.linalg.slogdet(information)
        return np.where(sign > 0.0, 0.5 * value / information.shape[-1], -np.inf)
    s = np.sqrt(np.maximum(np.linalg.eigvalsh(information), 1e-300))
    first, last = np.log(s[..., -1]), np.log(s[..., 0])
    if criterion is Criterion.O2:
        return last - first
    if criterion is Criterion.O3:
        return last
    if criterion is Criterion.O4:
        return 2.0 * last - first
    return -np.log((1.0 / s).sum(axis=-1))


def added(base: Array, rows: Array, criterion: Criterion) -> Array:
    """Criterion of an information matrix after adding each candidate.

    Shapes: base (p, p), rows (N, k, p) -> (N,).
    """
    N, k, p = rows.shape
    if criterion is Criterion.O1 and k < p:
        # det(M + R^T R) = det(M) det(1 + R M^-1 R^T): small determinants only
        L = np.linalg.cholesky(base)
        Y = np.linalg.solve(L, rows.reshape(-1, p).T).T.reshape(N, k, p)
        gain = np.linalg.slogdet(np.eye(k) + Y @ Y.swapaxes(-1, -2))[1]
        return (np.log(np.diag(L)).sum() + 0.5 * gain) / p
    parts = [
        index_of(base + (part := rows[a : a + _CHUNK]).swapaxes(-1, -2) @ part, criterion)
        for a in range(0, N, _CHUNK)
    ]
    return np.concatenate(parts)


def greedy(rows: Array, count: int, criterion: Criterion) -> NDArray[np.int64]:
    """Greedy forward selection of candidates. Shapes: rows (N, k, p) -> (count,)."""
    M = _floor(rows)
    left = np.ones(len(rows), dtype=bool)
    chosen = []
    p = rows.shape[-1]
    for _ in range(count):
        # until all parameters are seen every set's worst combination is the ridge: volume then
        seen = len(chosen) * rows.shape[1] >= p
        value = added(M, rows, criterion if seen else Criterion.O1)
        best = int(np.argmax(np.where(left, value, -np.inf)))
        left[best] = False
        chosen.append(best)
        M = M + rows[best].T @ rows[best]
    return np.array(chosen, dtype=np.int64)


def exchanged(
    rows: Array,
    start: NDArray[np.int64],
    criterion: Criterion,
    progress: Progress | None = None,
    fixed: int = 0,
) -> NDArray[np.int64]:
    """Exchange algorithm: swap members while the criterion improves.

    Shapes: rows (N, k, p), start (count,) -> (count,).
    """
    chosen = np.array(start, dtype=np.int64)
    floor = _floor(rows)
    free = np.ones(len(rows), dtype=bool)
    free[chosen] = False
    value = float(index_of(floor + _information(rows, chosen), criterion))
    members = range(fixed, len(chosen))
    unchanged, done, total = 0, 0, _SWEEPS * len(members)
    while unchanged < len(members) and done < total:
        k = members[done % len(members)]
        done += 1
        # summed anew: what is taken away again and again leaves rounding
        rest = floor + _information(rows, np.delete(chosen, k))
        values = np.where(free, added(rest, rows, criterion), -np.inf)
        best = int(np.argmax(values))
        unchanged += 1
        if values[best] > value + _GAIN:
            after = float(index_of(rest + rows[best].T @ rows[best], criterion))
            if after > value + _GAIN:
                free[chosen[k]], free[best] = True, False
                chosen[k], value, unchanged = best, after, 0
        if progress is not None:
            progress(done, total)
    if progress is not None and done < total:
        progress(total, total)
    return chosen


def nested(rows: Array, chosen: NDArray[np.int64], criterion: Criterion) -> NDArray[np.int64]:
    """Order a set so that its leading subsets are good sets.

    Shapes: rows (N, k, p), chosen (count,) -> (count,).
    """
    floor = _floor(rows)
    members, last = [int(c) for c in chosen], []
    while len(members) > 1:
        whole = floor + _information(rows, np.array(members))
        part = rows[members]
        value = index_of(whole - part.swapaxes(-1, -2) @ part, criterion)
        last.append(members.pop(int(np.argmax(value))))
    return np.array([*members, *last[::-1]], dtype=np.int64)


def _information(rows: Array, chosen: NDArray[np.int64]) -> Array:
    R = rows[chosen].reshape(-1, rows.shape[-1])
    return R.T @ R


def _floor(rows: Array) -> Array:
    p = rows.shape[-1]
    size = float((rows**2).sum()) / max(len(rows), 1) / p
    return (_RIDGE * size or 1e-300) * np.eye(p)


LENGTH_NOISE = 1e-4
"""Standard deviation of a length where none is given, m."""
_GROUPS = 32


def group_rows(
    parameters: GeometricParameters,
    kind: Kind,
    q: Array,
    sigma: ArrayLike | None = None,
    frame: Frame = None,
) -> Array:
    """Whitened rows of each group with its own fixtures eliminated.

    Shapes: q (G, m, n), sigma (k,) -> (G, k', P).
    """
    parts = []
    none = np.zeros(len(parameters))
    for first in range(0, len(q), _GROUPS):
        part = q[first : first + _GROUPS]
        G = len(part)
        measurement = measurement_of(parameters, kind, groups_of(part), frame=frame)
        problem = problem_of(parameters, [measurement])
        fixtures = measurement.guess(_seen(problem, none)) if problem.F else np.zeros(0)
        if fixtures is None:
            raise InvalidValueError(f"kind: the fixtures of {kind.name} cannot be guessed.")
        scale = _noise(measurement, sigma, parameters, frame)
        (found,) = linearised(problem, none, fixtures)
        A = whitened(measurement, found.by_parameters, scale).reshape(G, -1, len(parameters))
        if problem.F:
            F = whitened(measurement, found.by_fixtures, scale)
            F = F.reshape(G, A.shape[1], G, -1)[np.arange(G), :, np.arange(G)]
            Q = np.linalg.qr(F, mode="complete")[0]
            A = Q[:, :, F.shape[-1] :].swapaxes(-1, -2) @ A
        parts.append(A)
    return np.concatenate(parts)


def _seen(problem: Any, xi: Array) -> Any:
    from .problem import evaluations

    return evaluations(problem, xi)[0]


def _noise(
    measurement: Measurement,
    sigma: ArrayLike | None,
    parameters: GeometricParameters,
    frame: Frame,
) -> Array:
    """Standard deviations of the rows of a block."""
    units = measurement.units
    if sigma is None:
        turn = LENGTH_NOISE / characteristic_length(parameters.model, frame)
        return np.array([LENGTH_NOISE if unit == "m" else turn for unit in units])
    values = as_floats(sigma, "sigma")
    if values.shape not in ((), (len(units),)):
        raise ShapeError(
            f"sigma: expected a number or one for each of {measurement.axes}, got shape "
            f"{values.shape}."
        )
    if not (values > 0.0).all():
        raise InvalidValueError(f"sigma: expected positive numbers, got {sigma!r:.80}.")
    return np.broadcast_to(values, (len(units),))


_STEP = 1e-6
_MOVING_SWEEPS = 3
_ITERATIONS = 15
_WORTH = 1e-4
"""Gain of a whole sweep (of a logarithm) below which no other follows."""


def moved_configurations(
    groups: Array,
    rows: Array,
    criterion: Criterion,
    rows_of: Callable[[Array], Array],
    inside: Callable[[Array], NDArray[np.bool_]],
    model: RobotModel,
    progress: Progress | None = None,
) -> Array:
    """Coordinate-wise local optimisation of the configurations.

    Shapes: groups (count, m, n), rows (count, k, p) -> (count, m, n).
    """
    from scipy.optimize import minimize

    groups, rows = groups.copy(), rows.copy()
    count, m, n = groups.shape
    lower, upper = np.tile(model.lower, m), np.tile(model.upper, m)
    kinds = np.tile(model.table.sigma[model.table.joint_rows], m)
    # a stroke without limits would run away, as longer levers always show more
    endless = (kinds == PRISMATIC) & ~(np.isfinite(lower) & np.isfinite(upper))
    p = rows.shape[-1]
    information = np.einsum("gki,gkj->ij", rows, rows)
    value = float(index_of(information, criterion))
    total = _MOVING_SWEEPS * count
    for sweep in range(_MOVING_SWEEPS):
        before = value
        for g in range(count):
            others = rows[np.arange(count) != g].reshape(-1, p)
            rest = others.T @ others + 1e-12 * np.trace(information) / p * np.eye(p)
            x0 = groups[g].ravel()
            low = np.where(endless, x0, lower)
            high = np.where(endless, x0, upper)

            def cost(x: Array, rest: Array = rest, high: Array = high) -> tuple[float, Array]:
                # a step back from an upper limit, as rows beyond it mean nothing
                h = np.where(x + _STEP > high, -_STEP, _STEP)
                points = np.vstack([x, x + np.diag(h)]).reshape(-1, m, n)
                found = added(rest, rows_of(points), criterion)
                return -float(found[0]), -(found[1:] - found[0]) / h

            bounds = list(zip(low, high, strict=True))
            x = minimize(
                cost, np.clip(x0, low, high), jac=True, method="L-BFGS-B", bounds=bounds,
                options={"maxiter": _ITERATIONS},
            ).x  # fmt: skip
            for share in (1.0, 0.5, 0.25, 0.1):
                tried = np.clip(x0 + share * (x - x0), lower, upper).reshape(1, m, n)
                if not inside(tried)[0]:
                    continue
                new = rows_of(tried)[0]
                after = float(index_of(others.T @ others + new.T @ new, criterion))
                if after > value:
                    groups[g], rows[g], value = tried[0], new, after
                    information = others.T @ others + new.T @ new
                    break
            if progress is not None:
                progress(sweep * count + g + 1, total)
        if value - before < _WORTH:
            break
    if progress is not None:
        progress(total, total)
    return groups


@dataclass(frozen=True, slots=True, eq=False)
class SelectedConfigurations(Rebuilt):
    """Configurations chosen for a calibration, the most useful ones first.

    The first c of them are a good set of c for every c: the order is that in which they would be
    missed, the last one least.

    Parameters
    ----------
    kind : Kind
        What shall be measured there.
    groups : ndarray, shape (count, m, n)
        Postures of each chosen configuration: one for measurements from outside, several for
        contacts (rad, m).
    candidates : ndarray of int, shape (count,)
        Number of each among the candidates; -1 for those that were moved afterwards.
    parameters : GeometricParameters
        p parameters that the candidates tell.
    criterion : Criterion
        What was made as large as possible.
    observability : Observability
        Of the chosen set. Columns are scaled by the root mean square of their lengths over all
        candidates, rows are in standard deviations of the measurement.
    counts : ndarray of int, shape (C,)
        Sizes of first parts that show all parameters.
    values : ndarray, shape (C,)
        The criterion of each.
    deviations : ndarray, shape (C, p)
        Expected standard deviations of the parameters (their units) for each.
    errors : ndarray, shape (C,)
        Root mean square of the deviations, each multiplied by the effect of its parameter: in
        standard deviations of the measurement.
    pool : int
        Number of candidates that were looked at.
    left_out : tuple of str
        What was not looked at and why, in sentences.
    """

    kind: Kind
    groups: Array
    candidates: NDArray[np.int64]
    parameters: GeometricParameters
    criterion: Criterion
    observability: Observability
    counts: NDArray[np.int64]
    values: Array
    deviations: Array
    errors: Array
    pool: int
    left_out: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("candidates", "counts"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.int64))
        for name in ("groups", "values", "deviations", "errors"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def count(self) -> int:
        """Number of chosen configurations or contacts."""
        return len(self.groups)

    @property
    def q(self) -> Array:
        """All postures as rows, shape (count * m, n)."""
        return read_only(self.groups.reshape(-1, self.groups.shape[-1]))

    @property
    def labels(self) -> NDArray[np.int64]:
        """Number of the contact that each row of ``q`` belongs to."""
        return np.repeat(np.arange(self.count), self.groups.shape[1])

    @property
    def gains(self) -> Array:
        """Part by which the expected error falls with each added one, shape (C - 1,)."""
        return 1.0 - self.errors[1:] / self.errors[:-1]

    def enough(self, gain: float = 0.02) -> int | None:
        """From how many on each further one lowers the expected error by less than a part.

        The error falls at least as 1 / sqrt(count) when similar configurations are added, so
        parts below 1 / (2 count) are not reached.

        Parameters
        ----------
        gain : float
            Such as 0.02 for 2 %.

        Returns
        -------
        int or None
            The count; None if the chosen ones are not that many.

        Raises
        ------
        InvalidValueError
            Not between 0 and 1.
        """
        if not 0.0 < gain < 1.0:
            raise InvalidValueError(f"gain: expected a part between 0 and 1, got {gain!r}.")
        large = np.flatnonzero(self.gains >= gain)
        first = int(large[-1]) + 1 if len(large) else 0
        return int(self.counts[first]) if first < len(self.counts) - 1 else None

    def enough_sentence(self, gain: float = 0.02) -> str:
        """The same in words.

        Parameters
        ----------
        gain : float
            As for `enough`.

        Returns
        -------
        str
            A sentence.
        """
        found = self.enough(gain)
        if found is None:
            last = f"{100.0 * self.gains[-1]:.2g} %" if len(self.gains) else "an unknown part"
            return (
                f"{self.count} are not yet enough for a gain below {100.0 * gain:g} %: the last "
                f"one still lowers the expected error by {last}."
            )
        return (
            f"From {found} on each further one lowers the expected error of the parameters by "
            f"less than {100.0 * gain:g} %."
        )

    def __str__(self) -> str:
        size = self.groups.shape[1]
        each = "" if size == 1 else f", {size} postures each"
        lines = [
            f"{self.count} chosen of {self.pool} candidates for {self.kind.value}{each}: "
            f"{self.criterion.name} {self.observability.value(self.criterion):.4g} for "
            f"{len(self.parameters)} parameters.",
            str(self.observability) + ".",
            *self.left_out,
            self.enough_sentence(),
        ]
        return "\n".join(lines)


_LOG = logging.getLogger(__name__)
_JUDGED = 150
"""Candidates at which it is judged what can be told."""
_DRAWS = 12
_MEETING = 1e-6
"""Distance (m) and angle (rad) up to which given postures of a contact count as meeting."""


def select_configurations(
    model: RobotModel,
    kind: Kind | str | type[Measurement],
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
    kind : Kind
        What shall be measured; also its name or class.
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
    ...     load("rx90"), Kind.POSE, 20, drawn=200, rng=np.random.default_rng(0))
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
    if optimise and kind.is_contact:
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
            f"count: {p} parameters need at least {least} for {kind.name}, got {count}."
        )
    effect = np.sqrt((rows**2).sum(axis=(0, 1)) / len(rows))
    scaled = rows / effect
    best = _best(scaled, count, criterion, starts, rng, told)
    groups, members, own = pool[best], numbers[best], scaled[best]
    if optimise:
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
    if kind.is_contact and len(q):
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
    from .problem import guessed_fixtures, linearised, problem_of

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
            f"kind: the candidates tell none of the {len(parameters)} parameters by {kind.name}."
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

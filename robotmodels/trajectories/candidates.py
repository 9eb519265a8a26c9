"""Candidates of the kinodynamic planner: paths through free nodes, their timing and their cost.

References
----------
Book sections 4.4.2.2 and 4.4.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_count, as_number
from .._choices import chosen
from ..errors import InvalidValueError
from ..kinematics.singular.task import generator_of
from ..obstacles.clearance import link_distances
from ..obstacles.shapes import Obstacle
from .blends import blended_lines
from .limits import joint_vectors, ranges_of
from .path_limits import PathLimits
from .splines import SplineEnds, cubic_spline, quintic_spline
from .time_scaling import windows_of
from .trajectory import Trajectory

_GRID = 60  # intervals
_SHORTEST = 0.05  # share of the parameter of a leg
_PENALTY = 20.0  # of the duration, for each unit of violation
_SLOWER, _TRIED = 20.0, 600  # durations beside the least, where torques cost something
_LEAST_RAMP = 0.1  # of the time between two points


@dataclass(frozen=True, slots=True)
class Cost:
    """Objective of the planner: ``time * T + torque * integral of sum (tau / limit)^2 dt``.

    Parameters
    ----------
    time, torque : float
        Weights of the duration and of the squared torques, 1/s.
    """

    time: float = 1.0
    torque: float = 0.0

    def __post_init__(self) -> None:
        for name in ("time", "torque"):
            object.__setattr__(self, name, as_number(getattr(self, name), name, least=0.0))
        if not self.time + self.torque > 0.0:
            raise InvalidValueError("time, torque: expected at least one weight above zero.")


class Evaluated(NamedTuple):
    """Result of a candidate; its duration is infinite where it has no timing."""

    cost: float
    duration: float
    violation: float

    @property
    def penalized(self) -> float:
        """Cost with a penalty, for the search."""
        return self.cost * (1.0 + _PENALTY * self.violation)


class Candidates:
    """Paths through stations that are given and nodes between them that are free.

    With ``optimal`` a path is timed exactly; else it is a profile at rest at its ends, over a
    parameter that is the time divided by the duration.
    """

    def __init__(
        self, limits: PathLimits, stations: Array, at: tuple[Array, NDArray[np.intp]],
        bodies: tuple[Obstacle, ...], clearance: float, cost: Cost, optimal: bool,
    ) -> None:  # fmt: skip
        from scipy.interpolate import CubicSpline

        self.limits, self.stations, (self.knots, self.fixed) = limits, stations, at
        self.bodies, self.clearance, self.cost, self.optimal = bodies, clearance, cost, optimal
        self.margin = 0.0
        self.free = np.setdiff1d(np.arange(len(self.knots)), self.fixed)
        self.grid = np.linspace(0.0, 1.0, max(_GRID, 4 * len(self.knots)) + 1)
        ends = "not-a-knot" if optimal else "clamped"
        spline = CubicSpline(self.knots, np.eye(len(self.knots)), bc_type=ends)
        self.basis = np.stack([spline(self.grid, k) for k in range(3)])
        along = [np.interp(self.knots, self.knots[self.fixed], x) for x in self.stations.T]
        self.straight = np.stack(along, axis=-1)[self.free]
        self.width = half_width(stations.min(axis=0), stations.max(axis=0))

    def as_profile(self, at: Array, nodes: int) -> Candidates:
        """The same task for profiles with more nodes between stations at fractions of the time."""
        more = (self.limits, self.stations, spread(at, nodes), self.bodies, self.clearance)
        return Candidates(*more, self.cost, optimal=False)

    def points(self, free: Array) -> Array:
        """Stations and nodes (K, n) in the order of the path."""
        points = np.empty((len(self.knots), self.stations.shape[1]))
        points[self.fixed], points[self.free] = self.stations, free
        return points

    def path(self, free: Array) -> Trajectory:
        """The path, over a parameter from 0 to 1."""
        ends = SplineEnds.NOT_A_KNOT if self.optimal else SplineEnds.CLAMPED
        return cubic_spline(self.points(free), self.knots, ends=ends)

    def sampled(self, free: Array) -> tuple[Array, Array, Array]:
        """Positions on the grid and their derivatives by the parameter, each (G + 1, n)."""
        q, rate, bend = self.basis @ self.points(free)
        return q, rate, bend

    def evaluated(self, free: Array) -> Evaluated:
        """Timing, cost and violation of a candidate."""
        points = self.sampled(free)
        T, cost = self._by_passes(*points) if self.optimal else self._by_windows(*points)
        return Evaluated(cost, T, self.violation(points[0], self.margin))

    def violation(self, q: Array, margin: float = 0.0) -> float:
        """Violation of the limits of position and of the clearance by postures (N, n)."""
        limits = self.limits.limits
        over = np.maximum(q - limits.upper, limits.lower - q).max(initial=-np.inf)
        over = max(float(over) + margin, 0.0)
        if self.bodies and self.limits.model is not None:
            distances, _ = link_distances(self.limits.model, q, self.bodies)
            over += max(self.clearance + margin - float(distances.min(initial=np.inf)), 0.0)
        return over

    def _by_passes(self, q: Array, rate: Array, bend: Array) -> tuple[float, float]:
        found = self.limits.passes(self.grid, q, rate, bend, sweeps=2)
        T = found.duration
        if not self.cost.torque or not np.isfinite(T):
            return T, self.cost.time * T
        x, u = found.found[:, :1], found.found[:, 1:2]
        rows, k = found.rows, self.limits.acceleration.size
        speed = np.sqrt(np.maximum(x[:, 0], 0.0))
        h = 2.0 * np.diff(self.grid) / (speed[1:] + speed[:-1])
        share = 0.5 * (np.append(h, 0.0) + np.append(0.0, h)) / T
        C = rows.c[:, k:]
        A = (rows.a[:, k:] * u + rows.b[:, k:] * x) * T * T
        return self._slowed(share, A, np.zeros(A.shape), C, T, np.inf)

    def _by_windows(self, q: Array, rate: Array, bend: Array) -> tuple[float, float]:
        """Least duration of the profile itself, from the windows at the points of the grid."""
        limits = self.limits
        load, unit = limits.loaded, limits.scale[limits.acceleration.size :]
        with np.errstate(divide="ignore", invalid="ignore"):
            ranges = zip((rate, bend), ranges_of(limits.limits)[1:3], strict=True)
            pace, rise = (
                np.nanmax(np.where(x > 0.0, x / most, x / low), initial=0.0)
                for x, (_, low, most) in ranges
            )
        least = max(float(pace), float(np.sqrt(rise)))
        if not load.size:
            return least, self.cost.time * least
        A, B, C = (x[:, load] / unit for x in limits.parts(q, rate, bend))
        T, most = windows_of((A.ravel(), B.ravel(), C.ravel()), np.ones(A.size), least)
        if not np.isfinite(T):
            return np.inf, np.inf
        share = np.full(len(q), 1.0 / (len(q) - 1))
        share[[0, -1]] *= 0.5
        return self._slowed(share, A, B, C, float(T), float(most))

    def _slowed(
        self, share: Array, A: Array, B: Array, C: Array, T: float, most: float
    ) -> tuple[float, float]:
        """Duration between T and the most with the least cost, and that cost."""
        time, torque = self.cost.time, self.cost.torque
        if not torque:
            return T, time * T
        if most == np.inf and (np.abs(C) > 1.0).any():
            most = T
        squares = [(A, A), (A, 2.0 * B), (A, 2.0 * C), (B, B), (B, 2.0 * C), (C, C)]
        aa, ab, ac, bb, bc, cc = (float(share @ (x * y).sum(axis=1)) for x, y in squares)
        # the mean square of the torques is a polynomial of 1 / T
        tried = np.geomspace(T, min(most, _SLOWER * T), _TRIED)
        costs = tried * (time + torque * np.polyval([aa, ab, ac + bb, bc, cc], 1.0 / tried))
        k = int(np.argmin(costs))
        return float(tried[k]), float(costs[k])


def spread(at: Array, nodes: int) -> tuple[Array, NDArray[np.intp]]:
    """Knots (K,), nodes spread evenly between stations at given parameters; which are stations."""
    share = np.diff(at)
    parts = np.ones(len(share), dtype=int)
    for _ in range(nodes):
        parts[(share / parts).argmax()] += 1
    inner = [np.linspace(at[i], at[i + 1], k + 1)[:-1] for i, k in enumerate(parts.tolist())]
    fixed = np.concatenate((np.zeros(1, np.intp), np.cumsum(parts)))
    return np.append(np.concatenate(inner), at[-1]), fixed


def shares(stations: Array) -> Array:
    """Parameters of the stations of a path whose legs share it as their lengths."""
    length = np.linalg.norm(np.diff(stations, axis=0), axis=1)
    share = np.maximum(length / length.sum(), _SHORTEST)
    return np.concatenate(((0.0,), np.cumsum(share / share.sum())))


class ProfileLaw(Enum):
    """Laws of random profiles; the value describes the law."""

    SPLINE = "cubic spline through the nodes, at rest at the ends"
    TRAPEZOID = "constant velocities between the nodes, constant accelerations near them"
    QUINTIC = "fifth-order spline through the nodes, at rest without acceleration at the ends"


def random_profile(
    q0: ArrayLike,
    q1: ArrayLike,
    nodes: int = 4,
    law: ProfileLaw | str = ProfileLaw.SPLINE,
    rng: np.random.Generator | int | None = None,
) -> Trajectory:
    """Random motion from rest to rest between two configurations, in one second.

    The nodes are evenly spaced in time and drawn uniformly around the straight line: by up to half
    of the way of their joint, and at least a tenth of the longest way of all joints.

    Parameters
    ----------
    nodes : int
        Number of free configurations between the ends.
    law : ProfileLaw or str
        ``"spline"``, ``"trapezoid"`` (which passes the nodes at a distance) or ``"quintic"``.

    Examples
    --------
    >>> from robotmodels.trajectories import random_profile
    >>> profile = random_profile([0.0, 0.0], [1.0, 0.5], nodes=3, rng=1)
    >>> profile.duration, profile.q([0.0, 1.0]).round(9).tolist()
    (1.0, [[0.0, 0.0], [1.0, 0.5]])
    """
    law = chosen(ProfileLaw, law, "law")
    count, generator = as_count(nodes, "nodes", 0), generator_of(rng)
    ends, scalar = joint_vectors(q0=q0, q1=q1)
    start, end = ends["q0"], ends["q1"]
    if not np.any(start != end):
        raise InvalidValueError("q0, q1: the ends are the same, so there is no path between them.")
    points = start + np.linspace(0.0, 1.0, count + 2)[:, None] * (end - start)
    points[1:-1] += half_width(start, end) * generator.uniform(-1.0, 1.0, (count, start.size))
    given = points[:, 0] if scalar else points
    times = np.linspace(0.0, 1.0, count + 2)
    if law is ProfileLaw.SPLINE:
        return cubic_spline(given, times)
    if law is ProfileLaw.QUINTIC:
        return quintic_spline(given, times)
    # the ramps at both ends of a line fill at most its time; the first and last begin half before
    share = generator.uniform(_LEAST_RAMP, 1.0, count + 2)
    step = 1.0 / (count + 1 + 0.5 * (share[0] + share[-1]))
    return blended_lines(
        given, duration=1.0, segment_times=np.full(count + 1, step), blend_times=share * step
    )


def half_width(start: Array, end: Array) -> Array:
    """Largest distance of drawn nodes from the straight line (n,)."""
    way = np.abs(end - start)
    return np.maximum(0.5 * way, 0.1 * way.max())

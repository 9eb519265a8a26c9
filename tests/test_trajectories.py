"""Joint motions: laws of time by their properties, ruckig, SciPy, and refusals."""

import pickle
import re
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.optimize import brentq

from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.trajectories import (
    MotionLimits,
    SplineEnds,
    Synchronisation,
    TimeLaw,
    along_line,
    blended_lines,
    cubic,
    cubic_spline,
    fourier,
    fourier_basis,
    jerk_limited,
    joint_trajectory,
    linear,
    quintic,
    quintic_spline,
    smoothed_trapezoidal,
    straight_line,
    trapezoidal,
)
from robotmodels.trajectories.motions import PiecewisePolynomial

LAWS = list(TimeLaw)
SAME = Synchronisation.SAME_TIME
# the highest derivative that is continuous inside the motion, and the highest that ends at zero
CONTINUOUS = dict(zip(LAWS, (4, 4, 4, 1, 1, 2, 2), strict=True))
AT_REST = dict(zip(LAWS, (0, 1, 2, 1, 1, 2, 2), strict=True))


def jumping(law):
    return law in (TimeLaw.TRAPEZOIDAL, TimeLaw.BANG_BANG)


def random_limits(rng, law, n, same_jerk=False):
    jerk_lower = -rng.uniform(2.0, 100.0, n)
    return MotionLimits(
        velocity=rng.uniform(0.3, 3.0, n),
        acceleration=rng.uniform(0.5, 10.0, n),
        jerk=np.inf if jumping(law) else rng.uniform(2.0, 100.0, n),
        velocity_lower=-rng.uniform(0.3, 3.0, n),
        acceleration_lower=-rng.uniform(0.5, 10.0, n),
        jerk_lower=-np.inf if jumping(law) else None if same_jerk else jerk_lower,
    )


def named(error, words):
    """The number that a message gives after the words."""
    return float(re.search(words + r" ([0-9.e+-]*[0-9])", str(error.value)).group(1))


# --- laws of time from rest to rest --------------------------------------------------------------


@pytest.mark.parametrize("law", LAWS)
def test_limits_hold_and_ends_are_met_on_random_motions(law, rng):
    """Not one bit above a limit; some limit is used in full, of every joint that is alone."""
    for k in range(120):
        how = list(Synchronisation)[k % (2 if law in (TimeLaw.LINEAR, TimeLaw.CUBIC) else 3)]
        n, size = int(rng.integers(1, 5)), 10.0 ** rng.uniform(-5.0, 2.0)
        limits = random_limits(rng, law, n)
        q0, q1 = rng.normal(size=(2, n)) * (size if k > 11 else (1e-40, 1e-9, 1e9, 1e40)[k // 3])
        q1 = np.where(rng.random(n) < 0.2, q0, q1)
        move, used = along_line(law, q0, q1, None, limits, how), np.zeros(n)
        for order, name in enumerate(("velocity", "acceleration", "jerk"), 1):
            low, high = move.motion.extremes(order)
            least, most = getattr(limits, f"{name}_lower"), getattr(limits, name)
            if np.isfinite(most).all():
                assert (high <= most).all()
                assert (low >= least).all()
                used = np.maximum(used, np.maximum(high / most, low / least))
        alone = how is Synchronisation.INDEPENDENT
        used = used[q0 != q1]
        full = used.min(initial=1.0) if alone else used.max(initial=0.0)
        assert full > 1.0 - 1e-12 if used.size else move.duration == 0.0
        ends = move.at([0.0, move.duration])
        assert np.abs(ends.q - [q0, q1]).max() < 1e-12 * np.abs([q0, q1]).max()
        if AT_REST[law] and used.size:
            assert np.abs(ends.v).max() < 1e-12 * np.abs(move.motion.extremes(1)).max()


@pytest.mark.parametrize("how", [Synchronisation.COORDINATED, SAME])
@pytest.mark.parametrize("law", LAWS)
def test_derivatives_are_difference_quotients_and_jump_only_where_they_may(law, how, rng):
    q0, q1 = rng.normal(size=(2, 3))
    q1[2] = q0[2]
    move = along_line(law, q0, q1, None, random_limits(rng, law, 3), how)
    T, h, breaks = move.duration, 1e-5, np.unique(move.motion.breaks)
    t = np.linspace(0.01, 0.99, 57) * T
    t = t[np.abs(t[:, None] - breaks).min(axis=-1) > 2 * h]
    parts = (move.q, move.v, move.a, move.jerk)
    for low, high in pairwise(parts):
        numeric = (low(t + h) - low(t - h)) / (2 * h)
        assert np.abs(numeric - high(t)).max() < 1e-6 * max(1.0, np.abs(high(t)).max())
    inner = breaks[(breaks > 2e-10) & (breaks < T - 2e-10)]
    for order in range(min(CONTINUOUS[law], 3) + 1):
        jump = parts[order](inner + 1e-10) - parts[order](inner - 1e-10)
        steep = np.abs(parts[min(order + 1, 3)](t)).max() + 1.0
        assert np.abs(jump).max(initial=0.0) < 1e-8 * steep
    for order in range(1, AT_REST[law] + 1):
        assert np.abs(parts[order]([0.0, T])).max() < 1e-12 * np.abs(parts[order](t)).max()
    if how is not SAME:
        way = (move.q(t) - q0) @ (q1 - q0) / ((q1 - q0) @ (q1 - q0))
        assert np.abs(move.q(t) - q0 - way[:, None] * (q1 - q0)).max() < 1e-12
        assert (np.diff(way) > -1e-15).all()


def smoothed_ramp(V, A, J, K):
    """Time and distance of a ramp from rest to V whose acceleration is a parabola."""
    T = max(1.5 * V / A, (6 * V / min(J, K)) ** 0.5)
    return T, 0.5 * V * T


def jerk_limited_ramp(V, A, J, K):
    """Time and distance of a ramp of three phases, by its velocities at their ends."""
    a = min(A, (2 * V / (1 / J + 1 / K)) ** 0.5)
    v1, v2 = 0.5 * a * a / J, V - 0.5 * a * a / K
    t1, t2, t3 = a / J, (v2 - v1) / a, a / K
    return t1 + t2 + t3, J * t1**3 / 6 + 0.5 * (v1 + v2) * t2 + V * t3 - K * t3**3 / 6


def least_time(law, L, V, A, B, J, K):
    """Closed forms, written independently of the package; smooth ramps cruise if they fit."""
    ramp = {TimeLaw.SMOOTHED_TRAPEZOIDAL: smoothed_ramp, TimeLaw.JERK_LIMITED: jerk_limited_ramp}
    if law in ramp:

        def left(v):
            return L - ramp[law](v, A, J, K)[1] - ramp[law](v, B, J, K)[1]

        v = V if left(V) >= 0.0 else brentq(left, 1e-12 * V, V, xtol=1e-300, rtol=1e-15)
        return ramp[law](v, A, J, K)[0] + ramp[law](v, B, J, K)[0] + left(v) / v
    full, low = np.sqrt(2 * L / (1 / A + 1 / B)), min(A, B)
    by_a = (10 / 3**0.5 * L / low) ** 0.5
    return {
        TimeLaw.LINEAR: L / V,
        TimeLaw.CUBIC: max(1.5 * L / V, (6 * L / low) ** 0.5, (12 * L / K) ** (1 / 3)),
        TimeLaw.QUINTIC: max(1.875 * L / V, by_a, np.cbrt(60 * L / J), np.cbrt(30 * L / K)),
        TimeLaw.BANG_BANG: max(2 * L / V, np.sqrt(2 * L * (1 / A + 1 / B))),
        TimeLaw.TRAPEZOIDAL: L / V + V / 2 * (1 / A + 1 / B) if full > V else 2 * L / full,
    }[law]


@pytest.mark.parametrize("law", LAWS)
def test_least_times_are_the_closed_forms(law, rng):
    for _ in range(60):
        L, V, A, B, J, K = 10.0 ** rng.uniform(-2.0, 2.0, 6)
        limits = MotionLimits(V, A, J, acceleration_lower=-B, jerk_lower=-K)
        mirrored = MotionLimits(V, B, K, acceleration_lower=-A, jerk_lower=-J)
        if jumping(law):
            limits, mirrored = limits.without_jerk(), mirrored.without_jerk()
        T = along_line(law, 0.0, L, None, limits).duration
        assert pytest.approx(least_time(law, L, V, A, B, J, K), rel=1e-12) == T
        if AT_REST[law] == 2 and law is not TimeLaw.QUINTIC:  # the way back is the mirror image
            assert along_line(law, 0.0, -L, None, mirrored).duration == pytest.approx(T, rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_longer_durations_are_kept_and_the_least_of_a_message_is_accepted(law, rng):
    for _ in range(15):
        n = int(rng.integers(1, 5))
        limits, how = random_limits(rng, law, n), list(Synchronisation)[rng.integers(3)]
        q0, q1 = rng.uniform(-2.0, 2.0, (2, n))
        ask = partial(along_line, law, q0, q1, limits=limits, synchronisation=how)
        # of the same duration, but laws that end with a jump are refused where a joint waits
        waits = how is Synchronisation.INDEPENDENT
        quickest = ask(None, synchronisation=SAME) if waits else ask(None)
        slow = ask(1.7 * quickest.duration)
        assert slow.duration == 1.7 * quickest.duration
        assert slow.check(limits).stretch < 0.7
        with pytest.raises(InvalidValueError) as refusal:
            ask(quickest.duration * rng.uniform(0.1, 0.9999))
        least = named(refusal, "the least is")
        assert ask(least).duration == least
        assert ask(least).check(limits).kept
    if law is not TimeLaw.JERK_LIMITED:
        alone = along_line(law, [0.0], [2.0], 3.0, None)
        assert np.abs(alone.q([0.0, 1.5, 3.0]).ravel() - [0.0, 1.0, 2.0]).max() < 1e-15


def test_motions_that_stay_or_hardly_move():
    limits = MotionLimits(1.0, 1.0, 1.0)
    for make in (linear, cubic, quintic, smoothed_trapezoidal, jerk_limited):
        stay, wait = (make([1.0, 2.0], [1.0, 2.0], T, limits) for T in (None, 5.0))
        assert np.array_equal(stay.q([-1.0, 0.0, 1.0]), [[1.0, 2.0]] * 3)
        assert (stay.duration, wait.duration) == (0.0, 5.0)
        assert np.isfinite(make([0.0, 0.0], [1e-300, -1e-305], limits=limits).q(0.0)).all()
    # zero limits of joints that stay do not matter
    move = trapezoidal([0.0, 1.0], [1.0, 1.0], limits=MotionLimits([1.0, 0.0], [1.0, 0.0]))
    assert move.duration == pytest.approx(2.0, rel=1e-12)


# --- polynomials between states ------------------------------------------------------------------


@pytest.mark.parametrize(("make", "order"), [(cubic, 3), (quintic, 5)])
def test_polynomials_meet_their_end_states_in_the_least_duration(make, order, rng):
    """Beside a dense scan of durations: none that is shorter keeps the limits."""
    limits, checked = MotionLimits(1.5, 4.0, 30.0), 0
    for _ in range(10):
        q1, v0, v1, a0, a1 = rng.uniform(-1.0, 1.0, (5, 2)) * [[2.0], [1.0], [1.0], [1.0], [1.0]]
        states = {"v0": v0, "v1": v1} | ({} if order == 3 else {"a0": a0, "a1": a1})
        free = make([0.0, 0.0], q1, 1.3, **states)
        for name, values in zip("qva", (free.q, free.v, free.a), strict=True):
            want = [states.get(name + end, q1 if end == "1" else 0.0 * q1) for end in "01"]
            if name != "a" or order == 5:
                assert np.abs(values([0.0, 1.3]) - want).max() < 1e-11
        try:
            move = make([0.0, 0.0], q1, limits=limits, **states)
        except InvalidValueError:  # no duration keeps them
            trials = np.geomspace(1e-2, 1e2, 60)
        else:
            checked += 1
            assert move.check(limits, 1e-12).kept
            trials = move.duration * np.linspace(0.02, 0.9999, 60)
        reports = [make([0.0, 0.0], q1, T, **states).check(limits, -1e-9) for T in trials]
        assert not any(report.kept for report in reports)
    assert checked >= 4
    with pytest.raises(InvalidValueError, match="least duration") as refusal:
        make(0.0, 1.0, 0.1, limits, v0=0.5)
    least = named(refusal, "that keeps them is")
    assert make(0.0, 1.0, least, limits, v0=0.5).duration == least
    for v, V in rng.uniform(0.1, 1.0, (10, 2)) * [1.0, 5.0] + [0.0, 1.0]:
        # the velocity of a cubic that keeps v at both ends is v + 1.5 (D / T - v) in the middle
        T = cubic(0.0, 1.0, limits=MotionLimits(V), v0=v, v1=v).duration
        assert pytest.approx(1.5 / (V + 0.5 * v), rel=1e-9) == T


def test_joint_trajectory_is_a_quintic():
    x = np.linspace(0.0, 1.0, 5)
    s = 10 * x**3 - 15 * x**4 + 6 * x**5
    one = joint_trajectory([0.0, 1.0], [2.0, 4.0], 5)
    assert np.abs(one.q - [0.0, 1.0] - s[:, None] * [2.0, 3.0]).max() < 1e-14
    moved = joint_trajectory([0.0], [1.0], t := np.array([2.0, 2.5, 4.0]), v0=[0.5])
    assert np.array_equal(moved.t, t)
    assert (moved.v[0, 0], moved.q[-1, 0]) == (pytest.approx(0.5), 1.0)
    assert joint_trajectory([0.0], [1.0], 0).q.shape == (0, 1)
    assert joint_trajectory([3.0], [1.0], [2.0, 2.0]).t.tolist() == [2.0, 2.0]


# --- jerk-limited motions ------------------------------------------------------------------------


def test_the_motion_of_one_joint_is_that_of_ruckig(rng):
    ruckig = pytest.importorskip("ruckig")
    for _ in range(60):
        V, A, J = rng.uniform(0.5, 3.0, 3) * [1.0, 3.0, 20.0]
        state = dict(zip(("q0", "q1"), rng.normal(size=2), strict=True))
        state |= {name: rng.uniform(-0.25, 0.25) for name in ("v0", "v1", "a0", "a1")}
        move = jerk_limited(**state, limits=MotionLimits(V, A, J))
        given, found = ruckig.InputParameter(1), ruckig.Trajectory(1)
        for side, end in (("current", "0"), ("target", "1")):
            for word, letter in (("position", "q"), ("velocity", "v"), ("acceleration", "a")):
                setattr(given, f"{side}_{word}", [state[letter + end]])
        given.max_velocity, given.max_acceleration, given.max_jerk = [V], [A], [J]
        ruckig.Ruckig(1).calculate(given, found)
        assert abs(move.duration - found.duration) < 1e-8 * max(1.0, found.duration)
        s = move.at(np.linspace(0.0, move.duration, 17))
        assert np.abs(s.q - [found.at_time(x)[0][0] for x in s.t]).max() < 1e-8
        for name in "qva":
            ends = getattr(s, name)[[0, -1]]
            assert np.abs(ends - [state[name + "0"], state[name + "1"]]).max() < 1e-12


def test_coordinated_states_stay_on_their_line(rng):
    for _ in range(30):
        q0, u = rng.normal(size=(2, 4))
        u[1] = 0.0
        u /= np.abs(u).max()
        L, v0, v1, a0 = rng.uniform(-0.4, 0.4, 4) * [5.0, 0.5, 0.5, 1.0]
        limits = random_limits(rng, TimeLaw.JERK_LIMITED, 4)
        move = jerk_limited(q0, q0 + L * u, limits=limits, v0=v0 * u, v1=v1 * u, a0=a0 * u)
        s = move.at(np.linspace(0.0, move.duration, 101))
        way = (s.q - q0) @ u / (u @ u)
        assert np.abs(s.q - q0 - way[:, None] * u).max() < 1e-12
        assert np.abs(s.v[[0, -1]] - np.outer([v0, v1], u)).max() < 1e-12
        assert np.abs(s.q[-1] - q0 - L * u).max() < 1e-12
        assert move.check(limits, 1e-8).kept


def test_jerk_that_is_limited_one_way_only():
    """The acceleration may then fall at once; between moving states the smaller limit holds."""
    limits = MotionLimits(10.0, 10.0, 2.0, jerk_lower=-np.inf)
    move = jerk_limited(0.0, 1.0, limits=limits)
    # each half of the way takes the time t with 2 t^3 / 6 = 1 / 2
    assert move.duration == pytest.approx(2.0 * 1.5 ** (1.0 / 3.0), rel=1e-12)
    assert move.check(limits, 0.0).kept
    wide, narrow = (MotionLimits(1.0, 2.0, J, jerk_lower=-5.0) for J in (9.0, 5.0))
    moving, smaller = (jerk_limited(0.0, 1.0, limits=x, v0=0.3) for x in (wide, narrow))
    assert moving.duration == pytest.approx(smaller.duration, rel=1e-12)


def test_states_of_any_size_and_many_joints(rng):
    """ruckig alone fails far from 1, and with joints that have little in common."""
    refused = 0
    for k in range(32):
        n, (size, time) = (1, 2, 6, 20)[k % 4], 10.0 ** rng.uniform(-6.0, 6.0, 2)
        V, A, J = rng.uniform(0.3, 3.0, (3, n)) * size / time ** np.arange(1.0, 4.0)[:, None]
        limits = MotionLimits(V, A, J, velocity_lower=-0.5 * V, jerk_lower=-0.7 * J)
        q0, q1 = rng.normal(size=(2, n)) * size * 10.0 ** rng.uniform(-2.0, 2.0, n)
        more = {"v0": V * rng.uniform(-0.2, 0.2, n), "a0": A * rng.uniform(-0.05, 0.05, n)}
        T = None
        for _ in range(2):
            try:
                move = jerk_limited(q0, q1, T, limits, synchronisation=SAME, **more)
            except InvalidValueError as error:
                refused += 1
                assert "least" in str(error)  # noqa: PT017
                continue
            assert move.check(limits, 1e-8).kept
            ends = np.abs(move.q([0.0, move.duration]) - [q0, q1]).max()
            assert ends < 1e-11 * np.abs(move.motion.extremes(0)).max()
            assert T is None or move.duration == T
            T = 1.7 * move.duration
    assert refused <= 4


# --- splines, blends, series ---------------------------------------------------------------------


def test_splines_meet_points_and_end_states_as_those_of_scipy(rng):
    for _ in range(40):
        points = rng.normal(size=(7, 3))
        times = np.cumsum(np.concatenate(((0.0,), 10.0 ** rng.uniform(-1.0, 1.0, 6))))
        v0, v1, a0, a1 = rng.normal(size=(4, 3))
        three = cubic_spline(points, times, v0=v0, v1=v1)
        five = quintic_spline(points, times, v0=v0, v1=v1, a0=a0, a1=a1)
        ends = [[(1, v), (2, a)] for v, a in ((v0, a0), (v1, a1))]
        t = np.sort(np.append(times, np.linspace(0.0, times[-1], 90)))
        for path, theirs, most in (
            (three, CubicSpline(times, points, bc_type=((1, v0), (1, v1))), 1e-11),
            (five, make_interp_spline(times, points, k=5, bc_type=ends), 1e-8),
        ):
            assert np.array_equal(path.q(times[:-1]), points[:-1])
            for order, mine in enumerate((path.q, path.v, path.a)):  # both sides of every knot
                for x in (t, np.nextafter(t[1:], 0.0)):
                    want = theirs(x, order)
                    assert np.abs(mine(x) - want).max() < most * np.abs(want).max()
        # a polynomial of its own order is given back
        p = np.polynomial.Polynomial(rng.normal(size=6))
        ends = {
            f"{x}{end}": p.deriv(k)(times[-(end == "1")])
            for k, x in enumerate("va", 1)
            for end in "01"
        }
        exact = quintic_spline(p(times), times, **ends)
        assert np.abs((exact.q(t) - p(t)) / np.maximum(1.0, np.abs(p(t)))).max() < 1e-7


@pytest.mark.parametrize("size", [1e-9, 1e3])
def test_ends_of_cubic_splines(size, rng):
    points, times = size * rng.normal(size=(5, 2)), np.arange(6.0)
    natural = cubic_spline(points, times[:5], ends="natural")
    assert np.abs(natural.a([0.0, 4.0])).max() < 1e-12 * size
    nearly = np.vstack((points, points[:1] + 0.5e-9 * np.ptp(points, axis=0)))
    loop = cubic_spline(nearly, times, ends=SplineEnds.PERIODIC)
    for part in (loop.q, loop.v, loop.a):
        assert np.abs(part(0.0) - part(5.0)).max() < 1e-11 * size
    nearly[-1, 1] += 2e-9 * np.ptp(points, axis=0)[1]
    with pytest.raises(InvalidValueError, match=r"joint 2 ends .* beside its start"):
        cubic_spline(nearly, times, ends=SplineEnds.PERIODIC)
    t = np.array([0.0, 0.7, 1.1, 2.0])
    path = cubic_spline(np.stack((t**3 - t, 2 * t**3 + t**2), -1), t, ends="not_a_knot")
    x = np.linspace(0, 2, 21)
    assert path.q(x) == pytest.approx(np.stack((x**3 - x, 2 * x**3 + x**2), -1), abs=1e-12)


@pytest.mark.parametrize("make", [cubic_spline, quintic_spline])
def test_splines_are_as_quick_as_their_limits_allow(make, rng):
    for _ in range(6):
        points = rng.normal(size=(6, 3))
        limits = MotionLimits([1.0, 2.0, 3.0], 4.0, 40.0, acceleration_lower=-2.0)
        path = make(points, limits=limits)
        report = path.check(limits, 1e-12)
        assert report.kept
        assert report.stretch > 1.0 - 1e-9  # some limit is used in full
        times = path.motion.breaks[0]
        assert np.abs(path.q(times) - points).max() < 1e-12
        with pytest.raises(InvalidValueError, match=r"least factor on the times is 1\.11") as least:
            make(points, times * 0.9, limits)
        make(points, times * 0.9 * named(least, "factor on the times is"), limits)


@pytest.mark.parametrize("smooth", [False, True])
def test_blends_keep_limits_and_pass_beside_the_points(smooth, rng):
    for _ in range(20):
        points = rng.normal(size=(int(rng.integers(2, 8)), 3))
        limits = MotionLimits(
            rng.uniform(0.5, 2.0, 3),
            rng.uniform(0.5, 8.0, 3),
            rng.uniform(5.0, 50.0, 3) if smooth else np.inf,
            acceleration_lower=-rng.uniform(0.5, 8.0, 3),
        )
        path = blended_lines(points, limits=limits, smooth=smooth)
        assert path.check(limits, 1e-10).kept
        T, breaks, lengths = path.duration, path.motion.breaks[0], path.motion.lengths[0]
        assert np.abs(path.q([0.0, T]) - points[[0, -1]]).max() < 1e-12
        assert np.abs(path.v([0.0, T])).max() < 1e-12
        # the middles of the blends, and the formula of their distance from the points
        tb = lengths[2:-2:2, None]
        change = path.v(breaks[3:-2:2]) - path.v(breaks[2:-3:2])
        away = path.q(breaks[2:-3:2] + 0.5 * tb[:, 0]) - points[1:-1]
        assert np.abs(away - (3 / 32 if smooth else 1 / 8) * change * tb).max(initial=0.0) < 1e-9
        for part in (path.q, path.v, path.a)[: 3 if smooth else 2]:
            inner = breaks[1:-1]
            assert np.abs(part(inner + 1e-11) - part(inner - 1e-11)).max() < 1e-7
        with pytest.raises(InvalidValueError) as refusal:
            blended_lines(points, 0.9 * T, limits, smooth=smooth)
        for t in (1.3 * T, named(refusal, "the least is")):
            assert blended_lines(points, t, limits, smooth=smooth).duration == pytest.approx(t)


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("x", [(0, 2.5), (0, 0, 1), (0, 1, 1), (0, 1, 1, 2), (0, 0, 1, 1, 1, 0)])
@pytest.mark.parametrize("a", [0.6, 3.0])
def test_blends_of_two_points_and_of_points_given_twice_are_trapezoids(x, a, smooth):
    limits = MotionLimits(velocity=1.0, acceleration=a)
    path = blended_lines(np.array(x, float), limits=limits, smooth=smooth)
    make = smoothed_trapezoidal if smooth else trapezoidal
    moves = [make(0.0, abs(d), limits=limits).duration for d in np.diff(x) if d]
    assert path.duration == pytest.approx(sum(moves), rel=1e-9)


def test_blends_of_given_times():
    path = blended_lines([[0.0], [1.0], [3.0]], segment_times=[1.0, 2.0], blend_times=0.5)
    assert path.duration == 3.5
    assert np.abs(path.q(1.25) - 1.0).max() < 1e-12  # equal velocities: no corner, no blend
    lines = partial(blended_lines, [0.0, 1.0, 0.0], blend_times=1.2)
    with pytest.raises(InvalidValueError, match="overlap") as refusal:
        lines(segment_times=[1.0, 9.0])
    assert lines(segment_times=[named(refusal, "needs at least"), 9.0]).duration > 9.0
    limits = MotionLimits(0.5, 9.0)
    with pytest.raises(InvalidValueError, match="not kept") as refusal:
        blended_lines([0.0, 1.0], limits=limits, segment_times=1.0, blend_times=0.3)
    k = named(refusal, "factor on the times is")
    blended_lines([0.0, 1.0], limits=limits, segment_times=k, blend_times=0.3 * k)
    assert path.check(MotionLimits(jerk=1e9)).jerk.min() == -np.inf
    report = path.check(MotionLimits(0.5, 2.0))
    assert any("joint 1: velocity 1, allowed 0.5" in line for line in report.violations())
    assert report.stretch == pytest.approx(2.0)


def test_fourier_series_and_its_derivatives(rng):
    a, b, mean = rng.normal(size=(5, 3)), rng.normal(size=(5, 3)), rng.normal(size=3)
    move = fourier(a, b, mean, period=7.0, periods=2.0)
    t = rng.uniform(-20.0, 40.0, 60)
    k, w = np.arange(1, 6), 2 * np.pi / 7.0
    S, C = np.sin(t[:, None] * k * w), np.cos(t[:, None] * k * w)
    assert np.abs(move.q(t) - mean - (S / (k * w)) @ a + (C / (k * w)) @ b).max() < 1e-12
    parts = (move.q, move.v, move.a, move.jerk)
    for order, part in enumerate(parts):
        if order:
            below = parts[order - 1]
            numeric = (below(t + 1e-5) - below(t - 1e-5)) / 2e-5
            assert np.abs(numeric - part(t)).max() < 1e-7 * (5 * w) ** 4
        basis = fourier_basis(t, 5, 7.0, order)
        assert np.abs(basis @ np.vstack((mean, a, b)) - part(t)).max() < 1e-12 * (5 * w) ** order
    assert move.duration == 14.0
    assert fourier([1.0], [0.5], 0.2).q(0.0).shape == ()


@pytest.mark.parametrize("small", [0.0, 1e-16, 1.0])
def test_extremes_of_a_series_whose_last_harmonics_vanish(rng, small):
    t = np.linspace(0.0, 2.0, 20001)
    for H, vanishing in ((2, 1), (5, 1), (5, 3), (5, 5)):
        size = np.where(np.arange(H) < H - vanishing, 1, small)[:, None]
        motion = fourier(*rng.normal(size=(2, H, 2)) * size, period=2.0).motion
        for order in range(4):
            x, curve = motion.derivatives(t, (order, order + 2))
            scale = np.abs(x).max(axis=0)
            # the extreme is at most half a step from a sample
            beyond = np.abs(curve).max(axis=0) * t[1] ** 2 / 8.0 + 1e-13 * scale
            low, high = motion.extremes(order)
            for over in (x.min(axis=0) - low, high - x.max(axis=0)):
                assert ((-1e-14 * scale <= over) & (over <= beyond)).all()


# --- the type ------------------------------------------------------------------------------------


def test_shapes_samples_and_values():
    move, number = quintic([0.0, 1.0], [1.0, 0.0], 2.0), quintic(0.0, 1.0, 2.0)
    assert move.v(np.zeros((3, 4))).shape == (3, 4, 2)
    assert move.a([]).shape == (0, 2)
    assert number.q(0.5).shape == ()
    s = move.resample(11)
    assert np.array_equal(np.asarray(s), s.q)
    assert len(s) == 11
    assert not s.q.flags.writeable
    limits = MotionLimits([1.0, 2.0], 2.0, 3.0, lower=-0.3)
    series, pose = fourier(np.ones((2, 3)), np.ones((2, 3))), straight_line(np.eye(4), np.eye(4), 1)
    values = (limits, move, number, s, move.check(limits), pose, pose.resample(3), series)
    for value in values:
        copy = pickle.loads(pickle.dumps(value))
        assert copy == value
        assert hash(copy) == hash(value)
    assert limits != MotionLimits([1.0, 2.0], 2.0, 3.0)


def test_before_and_after():
    move = trapezoidal([0.0], [1.0], 2.0)
    assert np.array_equal(move.q([-1.0, 3.0]), [[0.0], [1.0]])
    assert not move.a([-1.0, 3.0]).any()
    passing = quintic(0.0, 1.0, 1.0, v1=0.5)
    for motion, t, side in (
        (passing, 1.1, "after the end"),
        (linear(0.0, 1.0, 1.0), -0.1, "before the start"),
    ):
        with pytest.raises(InvalidValueError, match=side):
            motion.q(t)
    assert passing.resample(period=0.3).t[-1] == pytest.approx(0.9)
    assert move.resample(period=0.5).t.size == 5
    for T in (1e-3, 1e3):  # a rounding beside an end is the end
        move = cubic_spline([[0.0], [1.0], [3.0]], [0.0, 0.4 * T, T], v0=1.0, v1=2.0)
        for t, end in ((np.nextafter(T, np.inf), T), (-1e-20, 0.0)):
            for part in (move.q, move.v, move.a, move.jerk):
                assert np.array_equal(part([t, 0.2 * T]), part([end, 0.2 * T]))
        with pytest.raises(InvalidValueError, match="does not rest"):
            move.q(T * (1.0 + 1e-14))


def test_extremes_are_exact(rng):
    """Beside a dense sampling, on polynomials of every order, with leading zeros."""
    t = np.linspace(0.0, 2.0, 4001)
    for order in range(1, 7):
        for k in range(20):
            c = rng.normal(size=(1, order + 1, 3))
            c[:, -1] *= (0.0, 1e-13, 1.0, 1.0)[k % 4]
            motion = PiecewisePolynomial(np.array([[0.0, 2.0]]), c)
            (q,) = motion.derivatives(t, (0,))
            # between two samples a polynomial rises above both by its curvature only
            tight = 1e-6 * np.abs(c).sum(axis=(0, 1)) * order**2
            low, high = motion.extremes(0)
            for over in (q.min(axis=0) - low, high - q.max(axis=0)):
                assert ((over >= -1e-13) & (over <= tight)).all()


UNIT, SLOW = MotionLimits(1.0, 1.0, 1.0), MotionLimits(1.0, 2.0, 5.0)
NARROW = MotionLimits(1.0, 2.0, 5.0, upper=0.1)
TINY = MotionLimits(1.0, 1.0, 1e-200)  # its cube is no float: the motion would end anywhere
BAD = [
    (lambda: trapezoidal(0.0, 1.0), "duration, limits or both"),
    (
        lambda: along_line("cubic", [0, 0.0], [1, 3.0], None, UNIT, "independent"),
        r"CUBIC ends .* waits.*joint 1: jerk",
    ),
    (lambda: trapezoidal(0.0, 1.0, limits=MotionLimits(1.0, 0.0)), "is 0"),
    (lambda: trapezoidal(0.0, 1.0, limits=UNIT), "without_jerk"),
    (lambda: quintic(0.0, 1.0, limits=MotionLimits()), "needs a limit"),
    (lambda: jerk_limited(0.0, 1.0, limits=MotionLimits(1.0, 1.0)), "jerk"),
    (lambda: quintic(0.0, np.nan, 1.0), "finite"),
    (lambda: quintic(0.0, 1.0, 0.0), "positive time"),
    (lambda: quintic([0.0, 1.0], [1.0, 2.0, 3.0], 1.0), "same joints"),
    (lambda: quintic(np.zeros((2, 3)), 1.0, 1.0), "one motion"),
    (lambda: cubic([0.0, 0.0], [1, 1.0], None, SLOW, v0=[0, 2.0]), "joint 2 is 2.*do is 2"),
    (lambda: trapezoidal([0.0] * 3, [1.0] * 3, limits=MotionLimits([1.0, 2.0], 1.0)), "joints"),
    (lambda: trapezoidal(0.0, 3.0, limits=MotionLimits(1.0, 1.0, upper=2.0)), "outside"),
    (lambda: trapezoidal(0.0, 3.0, limits=1.0), "MotionLimits"),
    (lambda: MotionLimits(np.nan), "NaN"),
    (lambda: MotionLimits(1.0, lower=1.0, upper=0.0), "at most upper"),
    (lambda: MotionLimits([1.0, 2.0], [1.0, 2.0, 3.0]), "different numbers"),
    (lambda: along_line("trapeze", 0.0, 1.0, 1.0, None), "'trapezoidal'.*TimeLaw"),
    (lambda: joint_trajectory(0.0, 1.0, 2.5), "whole number"),
    (lambda: joint_trajectory(0.0, 1.0, [0.0, 1.0, 0.5]), "ascend"),
    (lambda: jerk_limited([0.0, 0.0], [1.0, 1.0], None, UNIT, v0=[0.1, 0.2]), "SAME_TIME"),
    (lambda: jerk_limited(0.0, 1.0, limits=SLOW, v0=0.9, a0=2.0), r"velocity of 1\.3"),
    (lambda: jerk_limited(0.0, 1.0, None, SLOW, v1=0.5, synchronisation="independent"), "be 0"),
    (lambda: jerk_limited(0.0, 0.0, None, NARROW, v0=0.9), "moves from"),
    (lambda: jerk_limited(0.0, 1.0, 0.5, SLOW, v0=0.5), "least"),
    (lambda: jerk_limited(0.0, 1.0, None, TINY, v0=0.5), "jerk.*check the units"),
    (lambda: cubic_spline([0.0, 1.0, 1.0], limits=UNIT), "same"),
    (lambda: cubic_spline([0.0, 1.0, 2.0], [0, 1, 2.0], v0=1.0, ends="natural"), "clamped"),
    (lambda: quintic_spline([0.0, 1.0, 2.0], limits=UNIT, v0=0.5), "times"),
    (lambda: cubic_spline([0.0, 1.0, 2.0], [0.0, 1.0, 1.0]), "ascend"),
    (lambda: cubic_spline([0.0, 1.0]), "times, limits"),
    (lambda: blended_lines([0.0, 1.0], segment_times=1.0), "blend_times"),
    (lambda: blended_lines([0.0, 1.0], limits=UNIT), "smooth=True"),
    (lambda: fourier(np.ones((5, 3)), np.ones((4, 3))), "H, n"),
    (lambda: quintic(0.0, 1.0, 1.0).resample(), "either"),
    (lambda: cubic_spline(np.zeros((3, 0)), [0.0, 1.0, 2.0]), "at least one joint, got none"),
]


@pytest.mark.parametrize(("call", "message"), BAD)
def test_infeasible_requests_are_refused(call, message):
    with pytest.raises((InvalidValueError, ShapeError), match=message):
        call()

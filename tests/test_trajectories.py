"""Joint motions: limits kept, least times, continuity, ratios, ends, and refusals."""

import pickle
import re
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from identities.random_robots import random_pose
from scipy.optimize import linprog

from robotmodels import se3
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.trajectories import (
    MotionLimits,
    SplineEnds,
    Synchronisation,
    TimeLaw,
    Trajectory,
    along_line,
    bang_bang,
    blended_lines,
    blended_poses,
    cartesian_trajectory,
    circle,
    cubic,
    cubic_spline,
    fourier,
    jerk_limited,
    joint_trajectory,
    linear,
    quintic,
    quintic_spline,
    smoothed_trapezoidal,
    straight_line,
    trapezoidal,
)
from robotmodels.trajectories.checks import least_shown
from robotmodels.trajectories.motions import PiecewisePolynomial

LAWS = list(TimeLaw)
# the highest derivative that is continuous inside the motion
CONTINUOUS = {
    TimeLaw.LINEAR: 4,
    TimeLaw.CUBIC: 4,
    TimeLaw.QUINTIC: 4,
    TimeLaw.BANG_BANG: 1,
    TimeLaw.TRAPEZOIDAL: 1,
    TimeLaw.SMOOTHED_TRAPEZOIDAL: 2,
    TimeLaw.JERK_LIMITED: 2,
}
# and the highest that is zero at both ends
AT_REST = {
    TimeLaw.LINEAR: 0,
    TimeLaw.CUBIC: 1,
    TimeLaw.QUINTIC: 2,
    TimeLaw.BANG_BANG: 1,
    TimeLaw.TRAPEZOIDAL: 1,
    TimeLaw.SMOOTHED_TRAPEZOIDAL: 2,
    TimeLaw.JERK_LIMITED: 2,
}


def random_limits(rng, law, n, same_jerk=False):
    jumps = law in (TimeLaw.TRAPEZOIDAL, TimeLaw.BANG_BANG)
    jerk_lower = -rng.uniform(2.0, 100.0, n)
    return MotionLimits(
        velocity=rng.uniform(0.3, 3.0, n),
        acceleration=rng.uniform(0.5, 10.0, n),
        jerk=np.inf if jumps else rng.uniform(2.0, 100.0, n),
        velocity_lower=-rng.uniform(0.3, 3.0, n),
        acceleration_lower=-rng.uniform(0.5, 10.0, n),
        jerk_lower=-np.inf if jumps else None if same_jerk else jerk_lower,
    )


@pytest.mark.parametrize("law", LAWS)
def test_limits_hold_and_ends_are_met_on_10000_random_motions(law, rng):
    """Not one bit above a limit, anywhere on the motion; some limit is used in full."""
    for _ in range(20):
        n = int(rng.integers(1, 5))
        limits = random_limits(rng, law, n)
        q0, q1 = rng.normal(size=(2, 500, n)) * 10.0 ** rng.uniform(-5.0, 2.0, (1, 500, 1))
        q1 = np.where(rng.random((500, n)) < 0.2, q0, q1)
        move = along_line(law, q0, q1, None, limits)
        peaks = [move.motion.extremes(order) for order in (1, 2, 3)]
        bounds = [
            (limits.velocity_lower, limits.velocity),
            (limits.acceleration_lower, limits.acceleration),
            (limits.jerk_lower, limits.jerk),
        ]
        used = np.zeros(500)
        for (low, high), (least, most) in zip(peaks, bounds, strict=True):
            if np.isinf(most).any():
                continue
            assert (high <= most).all()
            assert (low >= least).all()
            used = np.maximum(used, np.maximum(high / most, low / least).max(axis=-1))
        moving = (q0 != q1).any(axis=-1)
        assert (used[moving] > 1.0 - 1e-12).all()
        assert (move.duration[~moving] == 0.0).all()
        times = np.stack((np.zeros(500), move.duration), axis=-1)
        (ends,) = move.motion.derivatives(times, (0,))
        size = np.abs([q0, q1]).max(axis=(0, 2))
        off = np.abs(ends - np.stack((q0, q1), axis=1)).max(axis=(1, 2))
        assert (off < 1e-12 * np.maximum(1.0, size)).all()
        one = along_line(law, q0[0], q1[0], None, limits)
        assert one.duration == pytest.approx(move.duration[0], rel=1e-15)


@pytest.mark.parametrize("law", LAWS)
def test_ratio_is_kept_along_the_whole_path(law, rng):
    q0, q1 = rng.normal(size=(2, 6))
    q1[2] = q0[2]
    move = along_line(law, q0, q1, None, random_limits(rng, law, 6))
    s = move.at(np.linspace(0.0, move.duration, 301))
    way = (s.q - q0) @ (q1 - q0) / ((q1 - q0) @ (q1 - q0))
    assert np.abs(s.q - q0 - way[:, None] * (q1 - q0)).max() < 1e-12
    assert (np.diff(way) > -1e-15).all()
    assert (s.q[:, 2] == q0[2]).all()
    assert not s.v[:, 2].any()


@pytest.mark.parametrize("law", LAWS)
def test_derivatives_and_continuity(law, rng):
    """Each derivative is that of the one below (central differences); jumps only where they may."""
    q0, q1 = rng.normal(size=(2, 3))
    move = along_line(law, q0, q1, None, random_limits(rng, law, 3))
    T, h = move.duration, 1e-5
    breaks = move.motion.breaks[0]
    t = np.linspace(0.01, 0.99, 57) * T
    t = t[np.abs(t[:, None] - breaks).min(axis=-1) > 2 * h]
    parts = (move.q, move.v, move.a, move.jerk)
    for low, high in pairwise(parts):
        numeric = (low(t + h) - low(t - h)) / (2 * h)
        assert np.abs(numeric - high(t)).max() < 1e-6 * max(1.0, np.abs(high(t)).max())
    inner = breaks[1:-1]
    for order in range(min(CONTINUOUS[law], 3) + 1):
        for at in inner:
            jump = parts[order](at + 1e-10) - parts[order](at - 1e-10)
            steep = np.abs(parts[min(order + 1, 3)](t)).max() + 1.0
            assert np.abs(jump).max() < 1e-8 * steep
    for order in range(1, AT_REST[law] + 1):
        assert (
            np.abs(parts[order](np.array([0.0, T]))).max() < 1e-12 * np.abs(parts[order](t)).max()
        )


def least_times(L, V, A, B, J, K):
    """Closed forms, written independently of the package."""
    full = np.sqrt(2 * L / (1 / A + 1 / B))
    trapezoid = L / V + V / 2 * (1 / A + 1 / B) if full > V else 2 * L / full
    bang = max(2 * L / V, np.sqrt(2 * L * (1 / A + 1 / B)))
    low = min(A, B)
    return {
        TimeLaw.LINEAR: L / V,
        TimeLaw.CUBIC: max(1.5 * L / V, (6 * L / low) ** 0.5, (12 * L / K) ** (1 / 3)),
        TimeLaw.QUINTIC: max(
            1.875 * L / V,
            (10 / 3**0.5 * L / low) ** 0.5,
            (60 * L / J) ** (1 / 3),
            (30 * L / K) ** (1 / 3),
        ),
        TimeLaw.BANG_BANG: bang,
        TimeLaw.TRAPEZOIDAL: trapezoid,
    }


@pytest.mark.parametrize("law", [law for law in LAWS if law in least_times(1, 1, 1, 1, 1, 1)])
def test_least_times_are_the_closed_forms(law, rng):
    for _ in range(300):
        L, V, A, B, J, K = 10.0 ** rng.uniform(-2.0, 2.0, 6)
        limits = MotionLimits(V, A, J, acceleration_lower=-B, jerk_lower=-K)
        if law in (TimeLaw.TRAPEZOIDAL, TimeLaw.BANG_BANG):
            limits = limits.without_jerk()
        T = along_line(law, 0.3, 0.3 + L, None, limits).duration
        assert abs(T / least_times(0.3 + L - 0.3, V, A, B, J, K)[law] - 1.0) < 1e-12


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


@pytest.mark.parametrize(
    ("law", "ramp"),
    [(TimeLaw.SMOOTHED_TRAPEZOIDAL, smoothed_ramp), (TimeLaw.JERK_LIMITED, jerk_limited_ramp)],
)
@pytest.mark.nightly
def test_least_times_of_smooth_ramps_by_bisection(law, ramp, rng):
    """The greatest velocity whose ramps fit, found by bisection; no other velocity is quicker."""
    for _ in range(200):
        L, V, A, B, J, K = 10.0 ** rng.uniform(-2.0, 2.0, 6)

        def time(v, A=A, B=B, J=J, K=K, L=L):
            (t0, d0), (t1, d1) = ramp(v, A, J, K), ramp(v, B, J, K)
            return t0 + t1 + (L - d0 - d1) / v

        def fits(v, A=A, B=B, J=J, K=K, L=L):
            return ramp(v, A, J, K)[1] + ramp(v, B, J, K)[1] <= L

        low, high = 0.0, V
        if fits(V):
            low = V
        for _ in range(200):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if fits(middle) else (low, middle)
        limits = MotionLimits(V, A, J, acceleration_lower=-B, jerk_lower=-K)
        T = along_line(law, 0.0, L, None, limits).duration
        assert abs(T / time(low) - 1.0) < 1e-12
        assert all(time(v) * (1 + 1e-12) >= T for v in low * rng.uniform(0.2, 1.0, 20))
        # forth and back are each other's mirror images
        mirrored = MotionLimits(V, B, K, acceleration_lower=-A, jerk_lower=-J)
        assert along_line(law, 0.0, -L, None, mirrored).duration == pytest.approx(T, rel=1e-12)


@pytest.mark.parametrize("jerk", [False, True])
def test_no_motion_is_quicker_by_linear_programming(jerk, rng):
    """The farthest that any motion gets in 2 % less than the least time falls short, and in 2 %
    more it gets there: the inputs on the cells of a grid are the unknowns of a linear program.

    For limited acceleration the first half is rigorous: the averages over the cells of any motion
    are a point of the program, and its distance differs by no more than the error that is added.
    """
    N = 100 if jerk else 200
    for _ in range(8):
        V, A, B = rng.uniform(0.5, 2.0, 3)
        L, J, K = rng.uniform(0.5, 3.0), *rng.uniform(3.0, 20.0, 2)
        limits = MotionLimits(V, A, J, acceleration_lower=-B, jerk_lower=-K)
        limits = limits if jerk else limits.without_jerk()
        T = (jerk_limited if jerk else trapezoidal)(0.0, L, limits=limits).duration

        def farthest(T, V=V, A=A, B=B, J=J, K=K):
            h, none = T / N, np.zeros((1, N))
            cell = np.tri(N)  # cell i acts on all nodes after it
            if jerk:
                a = np.vstack((none, cell * h))
                v = np.vstack((none, np.cumsum(h * a[:-1] + 0.5 * h * h * np.eye(N), axis=0)))
                way = (h * v[:-1] + 0.5 * h * h * a[:-1] + h**3 / 6.0 * np.eye(N)).sum(axis=0)
                rows, room = [a[1:], -a[1:], v[1:], -v[1:]], [A, B, V, V]
                rest, bounds, error = np.vstack((a[-1:], v[-1:])), (-K, J), 0.0
            else:
                v = np.vstack((none, cell * h))
                way = 0.5 * h * (v[1:] + v[:-1]).sum(axis=0)
                rows, room = [v[1:], -v[1:]], [V, V]
                rest, bounds, error = v[-1:], (-B, A), (A + B) * h * T / 8.0
            found = linprog(-way, np.vstack(rows), np.repeat(room, N), rest, [0.0] * len(rest),
                            [bounds] * N)  # fmt: skip
            assert found.status == 0
            return -found.fun, error

        reach, error = farthest(0.98 * T)
        assert reach + error < L
        assert farthest(1.02 * T)[0] > L


def test_given_duration_slows_down_and_refuses_too_short(rng):
    limits = MotionLimits([1.0, 2.0], [2.0, 1.0], [10.0, 5.0])
    for law in LAWS:
        own = MotionLimits(1.0, 2.0) if law in (TimeLaw.TRAPEZOIDAL, TimeLaw.BANG_BANG) else limits
        least = along_line(law, [0.0, 1.0], [1.0, 0.5], None, own).duration
        slow = along_line(law, [0.0, 1.0], [1.0, 0.5], 1.7 * least, own)
        assert slow.duration == 1.7 * least
        assert slow.check(own).stretch < 0.7
        assert np.abs(slow.q(1.7 * least) - [1.0, 0.5]).max() < 1e-15
        with pytest.raises(InvalidValueError, match=f"least is {least:.9g}"[:18]):
            along_line(law, [0.0, 1.0], [1.0, 0.5], 0.99 * least, own)
        # the least itself is accepted
        assert along_line(law, [0.0, 1.0], [1.0, 0.5], least, own).duration == least


def named(error, words):
    """The number that a message tells after the words."""
    return float(re.search(words + r" ([0-9.e+-]*[0-9])", str(error.value)).group(1))


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.nightly
def test_the_least_duration_of_a_message_is_accepted(law, rng):
    for k in range(60):
        n = int(rng.integers(1, 5))
        limits, how = random_limits(rng, law, n), list(Synchronisation)[rng.integers(3)]
        q0, q1 = rng.uniform(-2.0, 2.0, (2, n))
        ask = partial(along_line, law, q0, q1, limits=limits, synchronisation=how)
        # of the same duration, but laws that end with a jump are refused where a joint waits
        waits = how is Synchronisation.INDEPENDENT
        quickest = ask(None, synchronisation=Synchronisation.SAME_TIME) if waits else ask(None)
        with pytest.raises(InvalidValueError) as refusal:
            ask(quickest.duration * rng.uniform(0.1, 0.9999))
        least = named(refusal, "the least is")
        assert ask(least).duration == least
        assert ask(least).check(limits).kept
        own = MotionLimits(limits.velocity[:1], limits.acceleration[:1], limits.jerk[:1])
        A, B = random_pose(rng), random_pose(rng)
        pose = partial(straight_line, A, B, limits=own, law=law)
        if k % 30 == 0:
            pose = partial(circle, A, rng.normal(size=3), rng.normal(size=3), limits=own, law=law)
        with pytest.raises(InvalidValueError) as refusal:
            pose(duration=pose().duration * 0.7)
        least = named(refusal, "the least is")
        assert pose(duration=least).duration == least


@pytest.mark.nightly
def test_the_least_durations_between_states_are_accepted(rng):
    refused = 0
    for k in range(60):
        n = int(rng.integers(1, 4))
        limits = random_limits(rng, TimeLaw.JERK_LIMITED, n, same_jerk=True)
        q0, q1 = rng.uniform(-2.0, 2.0, (2, n))
        room = np.minimum(limits.velocity, -limits.velocity_lower)
        ends = {name: rng.uniform(-0.3, 0.3, n) * room for name in ("v0", "v1")}
        make = (cubic, quintic, jerk_limited)[k % 3]
        if make is jerk_limited:
            make = partial(make, synchronisation=Synchronisation.SAME_TIME)
        try:
            least = make(q0, q1, limits=limits, **ends).duration
        except InvalidValueError:
            continue  # these states have none
        with pytest.raises(InvalidValueError) as refusal:
            make(q0, q1, least * rng.uniform(0.3, 0.99), limits, **ends)
        # ruckig tells the next from there on, the others the least of all
        told = named(refusal, "(?:that keeps them|they are|least duration) is")
        assert make(q0, q1, told, limits, **ends).duration == told
        refused += 1
    assert refused > 40
    for make in (quintic, jerk_limited):
        for v0 in rng.uniform(0.3, 1.0, 20):
            with pytest.raises(InvalidValueError) as refusal:
                make(0.0, 3.0, limits=MotionLimits(0.2, 5.0, 50.0), v0=v0)
            told = named(refusal, "least limit that will do is")
            assert make(0.0, 3.0, limits=MotionLimits(told, 5.0, 50.0), v0=v0).duration > 3.0


def test_factors_and_blends_of_messages_are_accepted(rng):
    for smooth in (False, True):
        for _ in range(15):
            points = rng.uniform(-2.0, 2.0, (5, 3))
            limits = MotionLimits(rng.uniform(0.5, 2.0, 3), rng.uniform(1.0, 5.0, 3))
            ask = partial(blended_lines, points, limits=limits, smooth=smooth)
            with pytest.raises(InvalidValueError) as refusal:
                ask(0.9 * ask().duration)
            told = named(refusal, "the least is")
            assert ask(told).duration == pytest.approx(told, rel=1e-15)
            poses = np.stack([random_pose(rng) for _ in range(4)])
            own = MotionLimits(limits.velocity[:2], limits.acceleration[:2])
            ask = partial(blended_poses, poses, own, smooth=smooth)
            with pytest.raises(InvalidValueError) as refusal:
                ask(0.9 * ask().duration)
            told = named(refusal, "the least is")
            assert ask(told).duration == pytest.approx(told, rel=1e-15)
            times, blends = rng.uniform(0.3, 0.4, 4), rng.uniform(0.1, 0.2, 5)
            ask = partial(blended_lines, points, limits=limits, smooth=smooth)
            with pytest.raises(InvalidValueError) as refusal:
                ask(segment_times=times, blend_times=blends)
            told = named(refusal, "factor on the times is")
            assert ask(segment_times=told * times, blend_times=told * blends).check(limits).kept
            lines = partial(blended_lines, points[:3], smooth=smooth, blend_times=blends[:3])
            with pytest.raises(InvalidValueError) as refusal:
                lines(segment_times=[0.01, 9.0])
            assert lines(segment_times=[named(refusal, "needs at least"), 9.0]).duration > 9.0
            knots = np.concatenate(((0.0,), np.cumsum(rng.uniform(0.01, 0.02, 4))))
            for make in (cubic_spline, quintic_spline):
                with pytest.raises(InvalidValueError) as refusal:
                    make(points, knots, limits)
                assert make(points, knots * named(refusal, "factor on the times is"), limits)


def test_laws_of_a_duration_alone():
    for law in LAWS[:-1]:
        move = along_line(law, [0.0], [2.0], 3.0, None)
        assert move.duration == 3.0
        assert np.abs(move.q([0.0, 1.5, 3.0]).ravel() - [0.0, 1.0, 2.0]).max() < 1e-15
    assert abs(trapezoidal(0.0, 1.0, 3.0).v(1.5) - 0.5) < 1e-15
    assert abs(bang_bang(0.0, 1.0, 1.0).v(0.5) - 2.0) < 1e-15
    with pytest.raises(InvalidValueError, match="limits"):
        along_line(TimeLaw.JERK_LIMITED, 0.0, 1.0, 1.0, None)


def test_joints_may_share_only_the_time_or_nothing(rng):
    limits = MotionLimits([1.0, 1.0, 1.0], [1.0, 8.0, 1.0])
    q0, q1 = np.zeros(3), np.array([4.0, -1.0, 0.0])
    alone = [trapezoidal(0.0, w, limits=MotionLimits(1.0, a)).duration
             for w, a in ((4.0, 1.0), (-1.0, 8.0))]  # fmt: skip
    together = trapezoidal(q0, q1, limits=limits)
    same = trapezoidal(q0, q1, limits=limits, synchronisation=Synchronisation.SAME_TIME)
    free = trapezoidal(q0, q1, limits=limits, synchronisation=Synchronisation.INDEPENDENT)
    assert abs(same.duration - max(alone)) < 1e-12
    assert abs(free.duration - max(alone)) < 1e-12
    assert together.duration >= same.duration
    assert abs(free.q(alone[1])[1] - q1[1]) < 1e-12
    assert abs(same.q(alone[1])[1] - q1[1]) > 0.1
    for move in (together, same, free):
        assert move.check(limits, 0.0).kept
        assert np.abs(move.q([0.0, move.duration]) - [q0, q1]).max() < 1e-12
        assert not move.a(np.linspace(0.0, move.duration, 50))[:, 2].any()
    slow = trapezoidal(q0, q1, 9.0, limits, Synchronisation.SAME_TIME)
    assert slow.duration == 9.0
    assert slow.check(limits).kept


def test_motions_that_stay_or_hardly_move():
    limits = MotionLimits(1.0, 1.0, 1.0)
    for make in (linear, cubic, quintic, smoothed_trapezoidal, jerk_limited):
        stay = make([1.0, 2.0], [1.0, 2.0], limits=limits)
        assert stay.duration == 0.0
        assert np.array_equal(stay.q([-1.0, 0.0, 1.0]), [[1.0, 2.0]] * 3)
        assert stay.check(limits).kept
        wait = make([1.0, 2.0], [1.0, 2.0], 5.0, limits)
        assert wait.duration == 5.0
        assert not wait.v([0.0, 2.0, 5.0]).any()
        tiny = make([0.0, 0.0], [1e-300, -1e-305], limits=limits)
        assert np.isfinite(tiny.q(tiny.duration / 2)).all()
    with pytest.raises(InvalidValueError, match="positive time"):
        quintic(0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: trapezoidal(0.0, 1.0), "duration, limits or both"),
        (lambda: trapezoidal(0.0, 1.0, limits=MotionLimits(0.0, 1.0)), "is 0"),
        (lambda: trapezoidal(0.0, 1.0, limits=MotionLimits(1.0, 0.0)), "is 0"),
        (lambda: trapezoidal(0.0, 1.0, limits=MotionLimits(1.0)), "acceleration"),
        (lambda: trapezoidal(0.0, 1.0, limits=MotionLimits(1.0, 1.0, 1.0)), "jerk"),
        (lambda: bang_bang(0.0, 1.0, limits=MotionLimits(1.0, 1.0, 1.0)), "jerk"),
        (lambda: linear(0.0, 1.0, limits=MotionLimits(acceleration=1.0)), "velocity"),
        (lambda: quintic(0.0, 1.0, limits=MotionLimits()), "needs a limit"),
        (lambda: jerk_limited(0.0, 1.0, limits=MotionLimits(1.0, 1.0)), "jerk"),
        (lambda: jerk_limited(0.0, 1.0), "limits"),
        (lambda: quintic(0.0, np.nan, 1.0), "finite"),
        (lambda: quintic(0.0, 1.0, -1.0), "at least 0"),
        (lambda: quintic([0.0, 1.0], [1.0, 2.0, 3.0], 1.0), "same joints"),
        (lambda: quintic(0.0, 1.0, [1.0, 2.0]), "duration"),
        (lambda: trapezoidal([0.0] * 3, [1.0] * 3, limits=MotionLimits([1.0, 2.0], 1.0)), "joints"),
        (lambda: trapezoidal(0.0, 3.0, limits=MotionLimits(1.0, 1.0, upper=2.0)), "outside"),
        (lambda: trapezoidal(0.0, 3.0, limits=1.0), "MotionLimits"),
        (lambda: MotionLimits(np.nan), "NaN"),
        (lambda: MotionLimits(-1.0), "at least 0"),
        (lambda: MotionLimits(1.0, velocity_lower=0.5), "at most 0"),
        (lambda: MotionLimits(1.0, lower=1.0, upper=0.0), "at most upper"),
        (lambda: MotionLimits([1.0, 2.0], [1.0, 2.0, 3.0]), "different numbers"),
        (lambda: along_line("trapeze", 0.0, 1.0, 1.0, None), "'trapezoidal'.*TimeLaw"),
        (lambda: straight_line(np.eye(4), np.eye(4), 1.0, law=3), "member of TimeLaw"),
        (lambda: cubic_spline([0.0, 1.0], [0.0, 1.0], ends="loose"), "'natural'.*SplineEnds"),
        (
            lambda: jerk_limited(0.0, 1.0, None, MotionLimits(jerk=1.0), synchronisation="all"),
            "'same_time'.*Synchronisation",
        ),
        (lambda: trapezoidal(0.0, 1.0, 1.0, synchronisation=True), "Synchronisation"),
        (lambda: joint_trajectory(0.0, 1.0, 2.5), "whole number"),
        (lambda: joint_trajectory(0.0, 1.0, [0.0, 1.0, 0.5]), "ascend"),
    ],
)
def test_infeasible_requests_are_refused(call, message):
    with pytest.raises((InvalidValueError, ShapeError), match=message):
        call()


def test_laws_and_ways_are_given_by_their_names_too():
    limits = MotionLimits(1.0, 2.0, 10.0)
    ends, A, t = ([0.0, 1.0], [1.0, -2.0]), se3.translation(0.4, 0.2, 0.0), np.linspace(0.0, 1.0, 7)
    for law in LAWS[:-1]:
        for name in (law.name, law.name.lower(), law.name.lower().replace("_", "-")):
            assert along_line(name, *ends, 1.0, None) == along_line(law, *ends, 1.0, None)
            assert straight_line(np.eye(4), A, 1.0, law=name) == straight_line(
                np.eye(4), A, 1.0, law=law
            )
            one, same = (cartesian_trajectory(np.eye(4), A, 9, law=x) for x in (law, name))
            assert np.array_equal(one, same)
    for how in Synchronisation:
        name = how.name.lower().replace("_", " ")
        for make in (smoothed_trapezoidal, jerk_limited):
            assert make(*ends, limits=limits, synchronisation=name) == make(
                *ends, limits=limits, synchronisation=how
            )
    for kind in SplineEnds:
        one, same = (cubic_spline([0.0, 1.0, 0.0], t[[0, 2, 6]], ends=x) for x in (kind, kind.name))
        assert one == same


def test_zero_limits_of_joints_that_stay_do_not_matter():
    move = trapezoidal([0.0, 1.0], [1.0, 1.0], limits=MotionLimits([1.0, 0.0], [1.0, 0.0]))
    assert abs(move.duration - 2.0) < 1e-12


def test_batch_is_the_motions_one_by_one(rng):
    limits = MotionLimits(1.0, 2.0, 9.0)
    q0, q1 = rng.normal(size=(2, 3, 4, 5))
    q1[0, 1] = q0[0, 1]
    for how in Synchronisation:
        many = smoothed_trapezoidal(q0, q1, limits=limits, synchronisation=how)
        assert many.duration.shape == (3, 4)
        t = np.linspace(-0.1, many.duration.max() + 0.1, 23)
        s = many.at(t)
        assert s.q.shape == (3, 4, 23, 5)
        for i in np.ndindex(3, 4):
            one = smoothed_trapezoidal(q0[i], q1[i], limits=limits, synchronisation=how)
            assert abs(one.duration - many.duration[i]) < 1e-13
            for name in ("q", "v", "a", "jerk"):
                alone, row = getattr(one.at(t), name), getattr(s, name)[i]
                same = np.abs(alone - row) < 1e-10
                # a sample at a jump of the jerk may fall on either side of it
                assert same.all() or (name == "jerk" and same.mean() > 0.95)
    empty = trapezoidal(np.zeros((0, 3)), np.ones((0, 3)), limits=MotionLimits(1.0, 1.0))
    assert empty.duration.shape == (0,)
    assert empty.q([0.0, 1.0]).shape == (0, 2, 3)
    times = quintic(np.zeros((2, 3)), np.ones((2, 3)), [1.0, 2.0])
    assert np.array_equal(times.duration, [1.0, 2.0])


# --- polynomials between states ------------------------------------------------------------------


@pytest.mark.parametrize(("make", "order"), [(cubic, 3), (quintic, 5)])
def test_polynomials_meet_their_end_states(make, order, rng):
    for _ in range(50):
        q0, q1, v0, v1, a0, a1 = rng.normal(size=(6, 4))
        T = rng.uniform(0.3, 5.0)
        more = {} if order == 3 else {"a0": a0, "a1": a1}
        s = make(q0, q1, T, v0=v0, v1=v1, **more).at([0.0, T])
        assert np.abs(s.q - [q0, q1]).max() < 1e-12
        assert np.abs(s.v - [v0, v1]).max() < 1e-12
        if more:
            assert np.abs(s.a - [a0, a1]).max() < 1e-11


@pytest.mark.parametrize(("make", "order"), [(cubic, 3), (quintic, 5)])
def test_least_duration_of_polynomials_with_end_states(make, order, rng):
    """Beside a dense scan of durations: none that is shorter keeps the limits."""
    limits = MotionLimits(1.5, 4.0, 30.0)
    checked = 0
    for _ in range(14):
        q1, v0, v1 = rng.uniform(-1.0, 1.0, (3, 2)) * [[2.0], [1.0], [1.0]]
        more = (
            {} if order == 3 else dict(zip(("a0", "a1"), rng.uniform(-1, 1, (2, 2)), strict=True))
        )
        try:
            move = make([0.0, 0.0], q1, limits=limits, v0=v0, v1=v1, **more)
        except InvalidValueError:  # no duration keeps them
            trials = np.geomspace(1e-2, 1e2, 300)
        else:
            checked += 1
            assert move.check(limits, 1e-12).kept
            trials = move.duration * np.linspace(0.02, 0.9999, 300)
        many = make(np.zeros((300, 2)), q1, trials, v0=v0, v1=v1, **more).motion
        kept = np.ones(300, np.bool_)
        for k, most in ((1, 1.5), (2, 4.0), (3, 30.0)):
            kept &= np.abs(many.extremes(k)).max(axis=(0, -1)) < most * (1 - 1e-9)
        assert not kept.any()
    assert checked >= 6
    with pytest.raises(InvalidValueError, match="least duration"):
        make(0.0, 1.0, 0.1, limits, v0=0.5)
    assert make(0.0, 1.0, 3.0, limits, v0=0.5).duration == 3.0


@pytest.mark.parametrize("order", [3, 5])
def test_least_durations_to_the_last_digits(order, rng):
    """Beside closed forms, where there are any; and just below it a limit is exceeded."""
    make, law = ((cubic, TimeLaw.CUBIC), (quintic, TimeLaw.QUINTIC))[order == 5]
    for _ in range(20):  # from rest, one limit after the other
        L, bound = 10.0 ** rng.uniform(-2.0, 2.0, 2)
        name = ("velocity", "acceleration", "jerk")[int(rng.integers(3))]
        limits = MotionLimits(**{name: bound})
        found = make(0.0, L, limits=limits).duration
        assert found == pytest.approx(along_line(law, 0.0, L, None, limits).duration, rel=1e-12)
    for v, V in rng.uniform(0.1, 1.0, (10, 2)) * [1.0, 5.0] + [0.0, 1.0]:
        # the velocity of a cubic that keeps v at both ends is v + 1.5 (D / T - v) in the middle
        T = cubic(0.0, 1.0, limits=MotionLimits(V), v0=v, v1=v).duration
        assert pytest.approx(1.5 / (V + 0.5 * v), rel=1e-12) == T
    for _ in range(12):  # states on their limits, and all limits at once
        V, A, J = rng.uniform(0.5, 2.0, 3) * [1.0, 4.0, 30.0]
        low, high = -rng.uniform(0.0, 0.3, 2)
        limits = MotionLimits(V, A, J, lower=low, upper=1.0 - high)
        states = {"v0": rng.choice([0.0, V, 0.3]), "v1": rng.choice([0.0, -0.2, 0.1])}
        q0 = low if rng.random() < 0.5 else 0.0
        try:
            T = make(q0, 1.0, limits=limits, **states).duration
        except InvalidValueError as error:
            assert "no duration" in str(error)  # noqa: PT017
            continue
        with pytest.raises(InvalidValueError, match=r"the least"):
            make(q0, 1.0, T * 0.8, limits, **states)


def test_durations_that_are_too_long_for_polynomials():
    """A start that accelerates carries the joint away when there is too much time."""
    limits = MotionLimits(1.5, 4.0, 30.0)
    least = quintic(0.0, 1.0, limits=limits, a0=0.5).duration
    with pytest.raises(
        InvalidValueError, match=rf"keeps them is {least_shown(least)} s\. No longer one"
    ):
        quintic(0.0, 1.0, 50.0, limits, a0=0.5)
    with pytest.raises(
        InvalidValueError, match=r"v0 of joint 2 is 2.*least limit that will do is 2"
    ):
        quintic([0.0, 0.0], [1.0, 1.0], limits=limits, v0=[0.0, 2.0])
    with pytest.raises(InvalidValueError, match="however short"):
        cubic(0.0, 0.0, limits=MotionLimits(1.0), v0=0.1, v1=-0.1)
    # two intervals of durations: between them a limit of position is exceeded
    two = MotionLimits(3.0, 6.0, 40.0, lower=-0.5, upper=0.1)
    state = {"v0": -1.1, "v1": -1.4, "a0": 0.2, "a1": -1.1}
    least = quintic(0.0, -0.4, limits=two, **state).duration
    with pytest.raises(InvalidValueError, match=r"longer than that given is 1\.0[56]") as refusal:
        quintic(0.0, -0.4, 0.5, two, **state)
    assert f"keeps them is {least_shown(least)} s" in str(refusal.value)
    second = named(refusal, "longer than that given is")
    assert quintic(0.0, -0.4, second, two, **state).duration == second
    trials = np.linspace(least * 1.001, second * 0.9999, 200)
    kept = [quintic(0.0, -0.4, T, **state).check(two).kept for T in trials]
    assert np.count_nonzero(np.diff(kept)) == 1
    assert kept[0]


# --- jerk-limited motions ------------------------------------------------------------------------


def by_ruckig(state, limits, n, T=None):
    ruckig = pytest.importorskip("ruckig")
    given = ruckig.InputParameter(n)
    for side, end in (("current", "0"), ("target", "1")):
        for word, letter in (("position", "q"), ("velocity", "v"), ("acceleration", "a")):
            setattr(given, f"{side}_{word}", list(state[letter + end]))
    bounds = limits.for_joints(n)
    given.max_velocity, given.min_velocity = list(bounds.velocity), list(bounds.velocity_lower)
    given.max_acceleration = list(bounds.acceleration)
    given.min_acceleration = list(bounds.acceleration_lower)
    given.max_jerk = list(bounds.jerk)
    if T is not None:
        given.minimum_duration = T
    found = ruckig.Trajectory(n)
    ruckig.Ruckig(n).calculate(given, found)
    return found


def random_states(rng, n):
    state = {"q0": rng.normal(size=n), "q1": rng.normal(size=n)}
    return state | {k: rng.uniform(-0.25, 0.25, n) for k in ("v0", "v1", "a0", "a1")}


def test_rest_to_rest_is_as_quick_as_ruckig(rng):
    for _ in range(200):
        limits = random_limits(rng, TimeLaw.JERK_LIMITED, 1, same_jerk=True)
        L = float(rng.normal() * 10.0 ** rng.uniform(-3.0, 1.0))
        rest = {k: np.zeros(1) for k in ("q0", "v0", "v1", "a0", "a1")} | {"q1": [L]}
        theirs = by_ruckig(rest, limits, 1)
        ours = jerk_limited([0.0], [L], limits=limits)
        assert abs(ours.duration - theirs.duration) < 1e-8 * theirs.duration
        t = np.linspace(0.0, min(ours.duration, theirs.duration), 9)
        assert np.abs(ours.q(t)[:, 0] - [theirs.at_time(x)[0][0] for x in t]).max() < 1e-8


@pytest.mark.parametrize("longer", [None, 1.6])
def test_any_states_equal_ruckig(longer, rng):
    for _ in range(120):
        n = int(rng.integers(1, 4))
        limits = random_limits(rng, TimeLaw.JERK_LIMITED, n, same_jerk=True)
        state = random_states(rng, n)
        theirs = by_ruckig(state, limits, n)
        T = None if longer is None else theirs.duration * longer
        if T is not None:
            theirs = by_ruckig(state, limits, n, T)
            if abs(theirs.duration - T) > 1e-9:  # this time cannot be had with these states
                with pytest.raises(InvalidValueError, match="least"):
                    jerk_limited(**state, duration=T, limits=limits,
                                 synchronisation=Synchronisation.SAME_TIME)  # fmt: skip
                continue
        move = jerk_limited(
            **state, duration=T, limits=limits, synchronisation=Synchronisation.SAME_TIME
        )
        assert abs(move.duration - theirs.duration) < 1e-8
        t = np.linspace(0.0, move.duration, 17)
        s = move.at(t)
        want = np.array([theirs.at_time(x) for x in t])
        assert np.abs(s.q - want[:, 0]).max() < 1e-8
        assert np.abs(s.v - want[:, 1]).max() < 1e-7
        for k, name in enumerate("qva"):
            ends = getattr(s, name)[[0, -1]]
            assert np.abs(ends - [state[name + "0"], state[name + "1"]]).max() < 1e-12, k
        assert move.check(limits, 1e-8).kept


def test_limits_hold_between_random_states(rng):
    """As from rest to rest, but ruckig's phases: limits to rounding, ends to 1e-12."""
    for _ in range(15):
        limits = random_limits(rng, TimeLaw.JERK_LIMITED, 3, same_jerk=True)
        state = {k: rng.normal(size=(100, 3)) for k in ("q0", "q1")}
        state |= {k: rng.uniform(-0.25, 0.25, (100, 3)) for k in ("v0", "v1", "a0", "a1")}
        move = jerk_limited(**state, limits=limits, synchronisation=Synchronisation.SAME_TIME)
        assert move.check(limits, 1e-12).kept
        times = np.stack((np.zeros(100), move.duration), axis=-1)
        for name, values in zip("qva", move.motion.derivatives(times, (0, 1, 2)), strict=True):
            want = np.stack((state[name + "0"], state[name + "1"]), axis=1)
            assert np.abs(values - want).max() < 1e-12


def test_coordinated_states_stay_on_their_line(rng):
    for _ in range(40):
        q0, u = rng.normal(size=(2, 4))
        u[1] = 0.0
        u /= np.abs(u).max()
        L, v0, v1, a0 = rng.uniform(-0.4, 0.4, 4)
        limits = random_limits(rng, TimeLaw.JERK_LIMITED, 4)
        move = jerk_limited(
            q0, q0 + 5 * L * u, limits=limits, v0=v0 * u * 0.5, v1=v1 * u * 0.5, a0=a0 * u
        )
        s = move.at(np.linspace(0.0, move.duration, 101))
        way = (s.q - q0) @ u / (u @ u)
        assert np.abs(s.q - q0 - way[:, None] * u).max() < 1e-12
        assert np.abs(s.v[[0, -1]] - 0.5 * np.outer([v0, v1], u)).max() < 1e-12
        assert np.abs(s.q[-1] - q0 - 5 * L * u).max() < 1e-12
        assert move.check(limits, 1e-8).kept
    with pytest.raises(InvalidValueError, match="SAME_TIME"):
        jerk_limited([0.0, 0.0], [1.0, 1.0], limits=MotionLimits(1, 1, 1), v0=[0.1, 0.2])


def test_states_that_the_limits_do_not_allow():
    limits = MotionLimits(1.0, 2.0, 5.0)
    same = {"limits": limits, "synchronisation": Synchronisation.SAME_TIME}
    with pytest.raises(InvalidValueError, match=r"velocity of 1\.5"):
        jerk_limited(0.0, 1.0, **same, v0=1.5)
    with pytest.raises(InvalidValueError, match=r"velocity of 1\.3"):
        jerk_limited(0.0, 1.0, **same, v0=0.9, a0=2.0)
    with pytest.raises(InvalidValueError, match="acceleration of -3"):
        jerk_limited(0.0, 1.0, **same, a1=-3.0)
    with pytest.raises(InvalidValueError, match="must be 0"):
        jerk_limited(0.0, 1.0, limits=limits, v1=0.5, synchronisation=Synchronisation.INDEPENDENT)
    with pytest.raises(InvalidValueError, match="swings"):
        jerk_limited(0.0, 0.0, limits=MotionLimits(1.0, 2.0, 5.0, lower=0.0, upper=0.1), v0=0.9)
    with pytest.raises(InvalidValueError, match="least"):
        jerk_limited(0.0, 1.0, 0.5, **same, v0=0.5)


def test_independent_joints_start_moving_and_wait(rng):
    limits = MotionLimits(1.0, 2.0, 5.0)
    move = jerk_limited([0.0, 0.0, 3.0], [1.0, 4.0, 3.0], limits=limits, v0=[0.5, 0.0, 0.0],
                        synchronisation=Synchronisation.INDEPENDENT)  # fmt: skip
    alone = jerk_limited(0.0, 1.0, limits=limits, v0=0.5)
    assert move.duration > alone.duration + 1.0
    assert abs(move.q(alone.duration + 0.1)[0] - 1.0) < 1e-12
    assert np.abs(move.q(move.duration) - [1.0, 4.0, 3.0]).max() < 1e-12


# --- the type ------------------------------------------------------------------------------------


def test_shapes_scalars_and_samples():
    move = quintic([0.0, 1.0], [1.0, 0.0], 2.0)
    assert move.q(0.5).shape == (2,)
    assert move.v(np.zeros((3, 4))).shape == (3, 4, 2)
    assert move.a([]).shape == (0, 2)
    number = quintic(0.0, 1.0, 2.0)
    assert number.q(0.5).shape == ()
    assert number.jerk([0.0, 1.0]).shape == (2,)
    s = move.resample(11)
    assert np.array_equal(np.asarray(s), s.q)
    assert len(s) == 11
    assert not s.q.flags.writeable
    shuffled = np.array([1.5, 0.2, 1.0, 0.7, 2.0, 0.0])
    assert np.abs(move.q(shuffled) - [move.q(t) for t in shuffled]).max() < 1e-15


def test_values_are_equal_to_their_copies_and_print_in_six_lines():
    limits = MotionLimits(np.arange(1.0, 9.0) / 7.0, 2.0, 3.0, lower=-0.3)
    move = quintic(np.zeros(8), np.ones(8), 0.5)
    pose = straight_line(np.eye(4), se3.translation(1.0, 2.0, 3.0), duration=1.0)
    series = fourier(1.0 / np.arange(1.0, 17.0).reshape(2, 8), np.ones((2, 8)), 3.0)
    values = [limits, move, move.resample(3), move.check(limits), pose, pose.resample(3), series]
    for value in [*values, series.motion, linear(np.zeros((0, 2)), 1.0, 1.0).at([0.0, 1.0])]:
        copy = pickle.loads(pickle.dumps(value))
        assert copy == value
        assert hash(copy) == hash(value)
        assert len(repr(value).splitlines()) <= 6
    assert limits != MotionLimits(np.arange(1.0, 9.0) / 7.0, 2.0, 3.0)
    assert "and 36 more" in repr(move.check(limits))


def test_before_and_after():
    move = trapezoidal([0.0], [1.0], 2.0)
    assert np.array_equal(move.q([-1.0, 3.0]), [[0.0], [1.0]])
    assert not move.a([-1.0, 3.0]).any()
    passing = quintic(0.0, 1.0, 1.0, v1=0.5)
    assert passing.q(-1.0) == 0.0
    with pytest.raises(InvalidValueError, match="after the end"):
        passing.q(1.1)
    with pytest.raises(InvalidValueError, match="before the start"):
        linear(0.0, 1.0, 1.0).q(-0.1)
    with pytest.raises(InvalidValueError, match="finite"):
        move.q(np.nan)
    assert passing.resample(period=0.3).t[-1] == pytest.approx(0.9)
    assert move.resample(period=0.5).t.size == 5
    with pytest.raises(InvalidValueError, match="either"):
        move.resample()
    with pytest.raises(InvalidValueError, match="samples"):
        move.resample(10**12)
    for limits in (None, 3.0):
        with pytest.raises(InvalidValueError, match="MotionLimits"):
            move.check(limits)
    with pytest.raises(InvalidValueError, match="angle"):
        circle(np.eye(4), [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 2.0])


def test_extremes_are_exact(rng):
    """Beside a dense sampling, on polynomials of every order, with leading zeros."""
    for order in range(1, 7):
        c = rng.normal(size=(30, 1, order + 1, 3))
        c[:10, :, -1] = 0.0
        c[10:15, :, -1] *= 1e-13
        motion = PiecewisePolynomial(np.broadcast_to([[0.0, 2.0]], (30, 1, 2)), c)
        t = np.broadcast_to(np.linspace(0.0, 2.0, 4001), (30, 4001))
        (q,) = motion.derivatives(t, (0,))
        low, high = motion.extremes(0)
        # between two samples a polynomial rises above both by its curvature only
        tight = 1e-6 * np.abs(c).sum(axis=(1, 2)) * order**2
        assert (low <= q.min(axis=1) + 1e-13).all()
        assert (high >= q.max(axis=1) - 1e-13).all()
        assert (low >= q.min(axis=1) - tight).all()
        assert (high <= q.max(axis=1) + tight).all()


def test_no_joints_are_refused():
    none = np.zeros(0)
    for call in (
        lambda: joint_trajectory(none, none, 5),
        lambda: trapezoidal(none, none, 1.0),
        lambda: quintic(none, none, 1.0, v0=none),
        lambda: jerk_limited(none, none, limits=MotionLimits(1.0, 1.0, 1.0)),
        lambda: cubic_spline(np.zeros((3, 0)), [0.0, 1.0, 2.0]),
        lambda: quintic_spline(np.zeros((3, 0)), [0.0, 1.0, 2.0]),
        lambda: blended_lines(np.zeros((3, 0)), limits=MotionLimits(1.0, 1.0)),
    ):
        with pytest.raises(InvalidValueError, match="at least one joint, got none"):
            call()
    # no motions of some joints are no error
    assert trapezoidal(np.zeros((0, 2)), np.ones(2), 1.0).q(0.5).shape == (0, 2)


def test_seconds_between_samples_are_a_period():
    move = quintic(0.0, 1.0, duration=1.0)
    for wrong in (0.1, 2.5, 0, -3, np.nan, np.inf, "ten"):
        with pytest.raises(InvalidValueError, match=r"whole number from 1 to 1e9, got .*period="):
            move.resample(wrong)
    assert len(move.resample(3)) == len(move.resample(3.0)) == 3


def test_motions_are_shown_in_two_lines():
    move = quintic([0.0, 1.0, 2.0], [1.0, 3.0, -5.0], 2.0)
    assert repr(move).startswith("<Trajectory: 3 joints, 2 s\n  greatest velocity 6.562 (joint 3)")
    many = trapezoidal(np.zeros((4, 2)), np.ones((4, 2)), np.arange(1.0, 5.0))
    assert "2 joints, 1 to 4 s, batch of motions (4,)" in repr(many)
    assert "3 samples from 0 s to 1 s, 2 joints, batch of motions (4,)" in repr(
        many.at([0.0, 0.5, 1.0])
    )
    stay = quintic([1.0], [1.0], limits=MotionLimits(1.0))
    shown = [move, move.at([]), move.at(0.1), many, many.at(1.0), stay, stay.at([[0.0], [1.0]])]
    shown += [fourier([[1.0, 0.0]], [[0.0, 2.0]]), trapezoidal(np.zeros((0, 2)), np.ones(2), 1.0)]
    line = straight_line(np.eye(4), se3.translation(0.3, 0.4, 0) @ se3.rotation("z", 1.0), 2.0)
    shown += [line, line.resample(7), line.at([]), straight_line(np.eye(4), np.eye(4), 0.0)]
    for one in shown:
        assert repr(one).count("\n") == 1
        assert "array" not in repr(one)


def test_report_names_what_is_exceeded():
    move = blended_lines([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], segment_times=1.0, blend_times=0.2)
    report = move.check(MotionLimits([2.0, 0.5], 2.0))
    assert not report.kept
    assert any("joint 2: velocity 1, allowed 0.5" in line for line in report.violations())
    assert report.stretch == pytest.approx(2.0)
    assert move.check(MotionLimits(jerk=1e9)).jerk.max() == np.inf
    assert isinstance(move, Trajectory)


def test_joint_trajectory_is_a_quintic():
    path = joint_trajectory([0.0, 0.0], [1.0, 2.0], 5)
    x = np.linspace(0.0, 1.0, 5)
    s = 10 * x**3 - 15 * x**4 + 6 * x**5
    assert np.abs(path.q - s[:, None] * [1.0, 2.0]).max() < 1e-15
    t = np.array([2.0, 2.5, 4.0])
    moved = joint_trajectory([0.0], [1.0], t, v0=[0.5])
    assert np.array_equal(moved.t, t)
    assert moved.v[0, 0] == pytest.approx(0.5)
    assert moved.q[-1, 0] == 1.0
    assert joint_trajectory([0.0], [1.0], 0).q.shape == (0, 1)
    assert joint_trajectory([0.0], [1.0], 1).q[0, 0] == 0.0
    assert joint_trajectory(np.zeros((4, 2)), np.ones((4, 2)), 7).q.shape == (4, 7, 2)


@pytest.mark.parametrize("together", [True, False])
def test_pieces_are_evaluated_at_any_order_of_times(together, rng):
    """Beside the sum of powers written out; pieces without a length, one joint and twenty."""
    for n in (1, 2, 20):
        K, c = 6, 1 if together else n
        lengths = rng.uniform(0.1, 1.0, (c, K)) * (rng.random((c, K)) < 0.7)
        lengths[:, 2] = 0.5
        breaks = np.concatenate((np.zeros((c, 1)), np.cumsum(lengths, axis=-1)), axis=-1)
        motion = PiecewisePolynomial(breaks, rng.normal(size=(K, 5, n)), lengths)
        end = breaks[:, -1].min()
        t = np.concatenate((rng.uniform(0.0, end, 60), breaks[breaks <= end], [0.0, end, 0.0]))
        found = motion.derivatives(t, (3, 0, 7, 1))
        for i, j in np.ndindex(t.size, n):
            g = 0 if together else j
            live = np.flatnonzero(lengths[g] > 0.0)
            k = max([k for k in live if breaks[g, k] <= t[i]] or [live[0]])
            p = np.polynomial.Polynomial(motion.coefficients[k, :, j])
            x, h = (t[i] - breaks[g, k]) / lengths[g, k], lengths[g, k]
            for values, order in zip(found, (3, 0, 7, 1), strict=True):
                want = p.deriv(order)(x) / h**order
                assert abs(values[i, j] - want) < 1e-12 * max(1.0, h**-order)


def test_jerk_that_is_limited_one_way_only():
    """The acceleration may then fall at once, and the closed form still keeps what is limited."""
    limits = MotionLimits(10.0, 10.0, 2.0, jerk_lower=-np.inf)
    move = jerk_limited(0.0, 1.0, limits=limits)
    # each half of the way takes the time t with 2 t^3 / 6 = 1 / 2
    half = (6.0 * 0.5 / 2.0) ** (1.0 / 3.0)
    assert move.duration == pytest.approx(2.0 * half, rel=1e-12)
    assert move.check(limits, 0.0).kept
    assert limits.without_jerk().jerk_lower == -np.inf
    assert limits.jerk_lower == -np.inf
    with pytest.raises(InvalidValueError, match="at most 0"):
        MotionLimits(1.0, 1.0, 1.0, jerk_lower=1.0)
    with pytest.raises(InvalidValueError, match="without_jerk"):
        trapezoidal(0.0, 1.0, limits=MotionLimits(1.0, 1.0, 1.0))
    assert trapezoidal(0.0, 1.0, limits=MotionLimits(1.0, 1.0, 1.0).without_jerk()).duration > 1.0
    # between moving states the smaller limit holds both ways
    limits = MotionLimits(1.0, 2.0, 9.0, jerk_lower=-5.0)
    moving = jerk_limited(0.0, 1.0, limits=limits, v0=0.3)
    assert moving.duration == pytest.approx(
        jerk_limited(0.0, 1.0, limits=MotionLimits(1.0, 2.0, 5.0), v0=0.3).duration, rel=1e-12
    )
    assert moving.check(limits).kept


def test_states_of_any_size_and_many_joints(rng):
    """ruckig alone fails far from 1, and with joints that have little in common."""
    refused = 0
    for k in range(60):
        n = (1, 2, 6, 20)[k % 4]
        size, time = 10.0 ** rng.uniform(-6.0, 6.0, 2)
        V, A, J = rng.uniform(0.3, 3.0, (3, n)) * [
            [size / time],
            [size / time**2],
            [size / time**3],
        ]
        limits = MotionLimits(V, A, J, velocity_lower=-0.5 * V, jerk_lower=-0.7 * J)
        q0, q1 = rng.normal(size=(2, n)) * size * 10.0 ** rng.uniform(-2.0, 2.0, n)
        more = {"v0": V * rng.uniform(-0.2, 0.2, n), "a0": A * rng.uniform(-0.05, 0.05, n)}
        more |= {"limits": limits, "synchronisation": Synchronisation.SAME_TIME}
        T = None
        for _ in range(2):
            try:
                move = jerk_limited(q0, q1, T, **more)
            except InvalidValueError as error:
                refused += 1
                assert "least" in str(error)  # noqa: PT017
                continue
            assert move.check(limits, 1e-8).kept
            ends = np.abs(move.q([0.0, move.duration]) - [q0, q1]).max()
            assert ends < 1e-11 * np.abs(move.motion.extremes(0)).max()
            assert T is None or move.duration == T
            T = 1.7 * move.duration
    assert refused <= 6


def test_twenty_points_of_huge_and_tiny_motions(rng):
    for law in LAWS:
        for scale in (1e-40, 1e-9, 1e9, 1e40):
            limits = random_limits(rng, law, 20)
            q0, q1 = rng.normal(size=(2, 20)) * scale
            move = along_line(law, q0, q1, None, limits)
            assert np.isfinite(move.duration)
            assert np.abs(move.q(move.duration) - q1).max() <= 1e-12 * np.abs(q1).max()
            assert move.check(limits, 1e-12).kept

"""Strict priorities between tasks, and the tasks themselves, by differences of poses."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from identities.random_robots import models, random_state, seeds
from scipy.optimize import linprog, nnls

import robotmodels as rm
from robotmodels.kinematics import (
    DampedInverse,
    Damping,
    DistanceTask,
    FilteredInverse,
    FunctionTask,
    JointTask,
    PositionTask,
    PseudoInverse,
    Task,
    TwistTask,
)
from robotmodels.kinematics.inverse.solver import by_levels
from robotmodels.kinematics.inverse.tasks import Level

EXACT = PseudoInverse()
METHODS = [
    PseudoInverse(),
    FilteredInverse(0.3),
    DampedInverse(0.3, 0.1),
    DampedInverse(damping=Damping.CONSTANT, largest=0.2),
    DampedInverse(0.3, 0.1, Damping.SMALLEST_SINGULAR_VALUE),
    DampedInverse(0.3, 0.1, Damping.MANIPULABILITY),
    DampedInverse(0.3, 0.1, largest_speed=0.5),
]


def equations(J, rate, drift=None, weights=None):
    """A level without drift, of rows of the same weight."""
    drift = np.zeros(rate.shape) if drift is None else drift
    return Level(J, rate, drift, np.ones(J.shape[1]) if weights is None else weights)


def least(levels, wish=None, lower=None, upper=None, joint_weights=None, method=EXACT):
    """`by_levels` with defaults, bounds and wishes for one configuration or for all."""
    N, _, n = levels[0].J.shape
    wish = np.broadcast_to(np.zeros(n) if wish is None else wish, (N, n))
    bounds = None if lower is None else [np.broadcast_to(x, (N, n)) for x in (lower, upper)]
    weights = np.ones(n) if joint_weights is None else joint_weights
    v, scale, mixed, error = by_levels(levels, wish, bounds, weights**-0.5, method)
    return SimpleNamespace(v=v, scale=scale, mixed=mixed > 0.0, error=error)


def a_level(rng, N, m, n):
    return equations(rng.normal(size=(N, m, n)), rng.normal(size=(N, m)))


def done(level, v):
    return np.einsum("kij,kj->ki", level.J, v)


# --- priorities --------------------------------------------------------------------------------


def difficult_levels(rng, N, n):
    """Levels of which later ones repeat, contradict and nearly repeat earlier ones."""
    first, second = a_level(rng, N, 3, n), a_level(rng, N, 2, n)
    same = equations(first.J[:, ::-1], rng.normal(size=(N, 3)))
    nearly = equations(first.J[:, :1] + 1e-7 * rng.normal(size=(N, 1, n)), rng.normal(size=(N, 1)))
    mixture = equations(first.J[:, :2] + second.J, rng.normal(size=(N, 2)))
    return [first, nearly, same, second, mixture, a_level(rng, N, 6, n)]


@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("n", [4, 7, 9])
def test_lower_levels_never_disturb_higher_ones(rng, method, n):
    levels = difficult_levels(rng, 30, n)
    z = rng.normal(size=(30, n))
    whole = least(levels, z, method=method)
    for k in range(1, len(levels)):
        part = least(levels[:k], method=method)
        for level, error, expected in zip(levels, whole.error, part.error, strict=False):
            tolerance = 1e-12 * (1.0 + np.abs(whole.v).max(axis=1, keepdims=True))
            assert (np.abs(error - expected) <= tolerance).all()
            assert level.rate.shape == error.shape


@pytest.mark.parametrize(
    ("sizes", "n"), [((6,), 3), ((3,), 7), ((6,), 6), ((8,), 5), ((2, 9), 9), ((2, 3, 1, 4), 7)]
)
def test_each_level_is_met_as_well_as_the_higher_ones_let_it(rng, sizes, n):
    """Against nested weighted least squares: the error of each level is the least possible."""
    levels = [a_level(rng, 20, m, n) for m in sizes]
    root, z = np.sqrt(rng.uniform(0.2, 5.0, size=n)), rng.normal(size=(20, n))
    found = least(levels, z, joint_weights=root**2)
    for i in range(20):
        y, free = np.zeros(n), np.eye(n)
        tolerance = 1e-12 * np.linalg.cond(levels[0].J[i]) ** 2 if len(levels) == 1 else 1e-9
        for level, error in zip(levels, found.error, strict=True):
            A, rate = level.J[i] / root, level.rate[i]
            y = y + free @ np.linalg.lstsq(A @ free, rate - A @ y, rcond=1e-10)[0]
            np.testing.assert_allclose(error[i], rate - A @ y, atol=tolerance)
            free = free @ null_space(A @ free)
        y = y + free @ (free.T @ (root * z[i]))
        np.testing.assert_allclose(found.v[i], y / root, atol=tolerance)
    assert (found.scale == 1.0).all()
    assert not found.mixed.any()


# --- bounds ------------------------------------------------------------------------------------


def largest_scale(A, start, way, lower, upper):
    """Largest s in [0, 1] with ``A v = start + s way`` inside bounds, by a simplex; None: none."""
    n = A.shape[1]
    if not len(A):
        return 1.0
    found = linprog(
        np.r_[np.zeros(n), -1.0],
        A_eq=np.c_[A, -way],
        b_eq=start,
        bounds=[*zip(lower, upper, strict=True), (0.0, 1.0)],
        method="highs-ds",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    assert found.status in (0, 2)
    return found.x[-1] if found.status == 0 else None


def optimality_error(A, v, wish, lower, upper, weights=1.0):
    """How far v is from the least ``|v - wish|`` with its A v inside the bounds (multipliers)."""
    n = v.size
    above = np.eye(n)[v >= upper - 1e-11]
    below = -np.eye(n)[v <= lower + 1e-11]
    # wish - v = A^T y + (upper bounds) - (lower bounds), multipliers of bounds not negative
    columns = np.concatenate([A, -A, above, below]).T
    if not columns.size:
        return np.linalg.norm(wish - v)
    return nnls(columns, weights * (wish - v), maxiter=10000)[1]


def influenced(J, free=None):
    """Orthonormal combinations of the rows of J that motions in the free space change."""
    U, S, _ = np.linalg.svd(J if free is None else J @ free)
    return U[:, : int((1e-10 * max(np.abs(J).max(), 1e-300) < S).sum())].T


def null_space(J):
    _, S, Vt = np.linalg.svd(J)
    return Vt[int((S > 1e-10).sum()) :].T


KINDS = ["regular", "singular", "integers", "some stopped", "integers and zeros", "half open",
         "on the border", "a joint that does nothing"]  # fmt: skip


def a_case(rng, kind, m, n):
    J, rate = rng.normal(size=(m, n)), rng.normal(size=m) * 10.0 ** rng.uniform(-2, 1)
    lower, upper = -rng.uniform(0.0, 1.0, size=n), rng.uniform(0.0, 1.0, size=n)
    if kind == "singular" and m > 1:
        J[-1] = J[0] + (J[1] if m > 2 else 0.0)
        rate = J @ rng.normal(size=n)
    elif kind in ("integers", "integers and zeros"):
        J = np.round(J)
        rate = J @ np.round(rng.normal(size=n))
        if kind == "integers and zeros":
            lower, upper = np.round(2 * lower), np.round(2 * upper)
    elif kind == "some stopped":
        lower, upper = (np.where(rng.random(n) < 0.4, 0.0, x) for x in (lower, upper))
    elif kind == "half open":
        lower = np.where(rng.random(n) < 0.5, -np.inf, lower)
        upper = np.where(rng.random(n) < 0.5, np.inf, upper)
    elif kind == "on the border":
        rate = J @ np.where(rng.random(n) < 0.5, lower, upper)
    elif kind == "a joint that does nothing":
        J[:, rng.integers(n)] = 0.0
    wish = rng.normal(size=n) * rng.choice([0.0, 1.0, 5.0])
    return J, rate, lower, upper, wish


ONE = [(6, 6), (6, 7), (6, 9), (3, 7), (3, 3), (1, 8), (2, 1)]
SEVERAL = [(3, 3), (3, 2, 2), (2, 6), (6, 3)]
CASES = [(kind, (m,), n) for m, n in ONE for kind in KINDS]
CASES += [("regular", sizes, n) for n in (7, 9) for sizes in SEVERAL]


@pytest.mark.sampled(24)
@pytest.mark.parametrize(
    ("kind", "sizes", "n"), CASES, ids=[f"{n}-{'-'.join(map(str, m))}-{k}" for k, m, n in CASES]
)
def test_the_largest_scale_and_the_least_motion(kind, sizes, n):
    """Lower levels leave higher ones as they are and take the largest part that is left."""
    rng = np.random.default_rng([*sizes, n, KINDS.index(kind)])
    parts = []
    for _ in range(9):
        J, rate, lower, upper, wish = a_case(rng, kind, sizes[0], n)
        levels = [equations(J[None], rate[None]), *(a_level(rng, 1, m, n) for m in sizes[1:])]
        fixed, told = np.empty((0, n)), np.empty(0)
        for k, level in enumerate(levels, start=1):
            found = least(levels[:k], wish, lower, upper)
            v, s = found.v[0], found.scale[0, -1]
            assert ((lower <= v) & (v <= upper)).all()
            np.testing.assert_allclose(fixed @ v, told, rtol=0, atol=1e-10)
            # joints that the higher levels hold at a bound
            stuck = held_joints(fixed, told, lower, upper)
            U = influenced(level.J[0], null_space(np.concatenate([fixed, np.eye(n)[stuck]])))
            A, rate = U @ level.J[0], U @ level.rate[0]
            whole, start = np.concatenate([fixed, A]), np.zeros(len(U))
            way = np.r_[0 * told, rate]
            expected = largest_scale(whole, np.r_[told, start], way, lower, upper)
            assert found.mixed[0, -1] == (expected is None)
            if expected is None:
                start = A @ least(levels[: k - 1], None, lower, upper).v[0]
                way = np.r_[0 * told, rate - start]
                expected = largest_scale(whole, np.r_[told, start], way, lower, upper)
            assert s == pytest.approx(expected, rel=0, abs=1e-9 if k == 1 else 1e-8)
            tolerance = 1e-11 * (1 + np.abs(rate).max(initial=0.0)) if k == 1 else 1e-10
            np.testing.assert_allclose(A @ v, start + s * way[len(told) :], rtol=0, atol=tolerance)
            parts.append(s)
            fixed = np.concatenate([fixed, level.J[0]])
            told = fixed @ v
        # of all motions that do this it is the nearest to the wish
        assert optimality_error(fixed, v, wish, lower, upper) < 1e-8 * (1 + np.abs(wish).max())
    if kind == "regular" and max(sizes) == 6:
        assert min(parts) < 1.0 - 1e-9
    if len(sizes) > 1:
        assert max(parts) == 1.0


def held_joints(A, b, lower, upper):
    """Joints that cannot move where ``A v = b`` and the bounds hold, by two programmes each."""
    n = lower.size
    if not len(A):
        return np.zeros(n, bool)
    widths = []
    for j in range(n):
        ends = []
        for sign in (1.0, -1.0):
            # the equations hold but for rounding
            found = linprog(
                sign * np.eye(n)[j],
                A_ub=np.concatenate([A, -A]),
                b_ub=np.concatenate([b, -b]) + 1e-9,
                bounds=[*zip(lower, upper, strict=True)],
                method="highs-ds",
                options={"primal_feasibility_tolerance": 1e-10, "presolve": False},
            )
            assert found.status == 0
            ends.append(found.x[j])
        widths.append(ends[1] - ends[0])
    return np.array(widths) < 1e-6


def test_a_drift_that_cannot_be_held_is_met_in_part(rng):
    J, rate = rng.normal(size=(1, 6, 7)), np.zeros((1, 6))
    drift = 100.0 * rng.normal(size=(1, 6))
    bound = np.ones(7)
    found = least([equations(J, rate, drift)], None, -bound, bound)
    assert found.mixed[0, 0]
    assert 0.0 < found.scale[0, 0] < 1.0
    s = largest_scale(J[0], np.zeros(6), -drift[0], -bound, bound)
    assert found.scale[0, 0] == pytest.approx(s, rel=0, abs=1e-10)
    np.testing.assert_allclose(J[0] @ found.v[0], -s * drift[0], atol=1e-10)
    np.testing.assert_allclose(found.error[0], rate - drift - (J @ found.v[0]), atol=1e-12)


# --- tasks -------------------------------------------------------------------------------------


def elbow(q):
    """Gradients of sin(q1) q2 and of the sum of squares."""
    first = np.zeros_like(q)
    first[:, 0] = np.cos(q[:, 0]) * q[:, 1]
    first[:, 1] = np.sin(q[:, 0])
    return np.stack([first, 2.0 * q], axis=1)


def some_tasks(model, rng):
    frame = int(rng.integers(1, model.f + 1))
    other = int(rng.integers(0, model.f + 1))
    point = rng.normal(size=3)

    def position(q):
        T = rm.dgm(model, q, frame)
        return T[..., :3, :3] @ point + T[..., :3, 3]

    def distance(q):
        apart = rm.dgm(model, q)[..., :3, 3] - rm.dgm(model, q, other)[..., :3, 3]
        return np.linalg.norm(apart, axis=-1, keepdims=True)

    yield PositionTask(np.zeros(3), frame, point), position
    yield PositionTask(np.zeros(3), frame, point, mask=[0, 1, 1]), lambda q: position(q)[..., 1:]
    yield DistanceTask(0.0, first=other), distance
    yield JointTask([0.0], joints=[model.n - 1]), lambda q: q[..., -1:]
    squares = FunctionTask(lambda q: 2 * q, [0.0], lambda q, v: 2 * v)
    yield squares, lambda q: (q**2).sum(axis=-1, keepdims=True)
    if model.n >= 2:
        yield (
            FunctionTask(elbow, [0.0, 0.0]),
            lambda q: np.stack([np.sin(q[..., 0]) * q[..., 1], (q**2).sum(axis=-1)], axis=-1),
        )


def derivatives(f, q, v, a, h):
    """First and second time derivative of f along q + v t + a t^2 / 2, of fourth order."""
    values = [f(q + v * t + 0.5 * a * t * t) for t in (-2 * h, -h, 0.0, h, 2 * h)]
    first = np.dot([1.0, -8.0, 0.0, 8.0, -1.0], np.moveaxis(values, 0, -2)) / (12 * h)
    second = np.dot([-1.0, 16.0, -30.0, 16.0, -1.0], np.moveaxis(values, 0, -2)) / (12 * h * h)
    return first, second


@given(model=models(), seed=seeds)
def test_tasks_are_derivatives_of_what_they_name(model, seed):
    rng = np.random.default_rng(seed)
    q, v, a = random_state(model, rng, 3)
    v, a = v / (1.0 + np.abs(v).max()), a / (1.0 + np.abs(a).max())
    for task, function in some_tasks(model, rng):
        assert isinstance(task, Task)
        if function.__name__ == "distance" and (function(q) < 0.2).any():
            continue  # differences of a distance near zero say nothing
        first, _ = derivatives(function, q, v, a, 1e-3)
        _, second = derivatives(function, q, v, a, 1e-2)
        level, above = task.level(model, q), task.level(model, q, v)
        size = 1.0 + np.abs(level.J).max() ** 2
        np.testing.assert_allclose(done(level, v), first, rtol=0, atol=1e-8 * size)
        np.testing.assert_allclose(done(above, a) + above.drift, second, rtol=0, atol=2e-5 * size)
        np.testing.assert_array_equal(level.J, above.J)


@given(model=models(), seed=seeds, reference=st.sampled_from(["world_aligned", "local", "world"]))
def test_twist_tasks_are_rows_of_the_jacobian(model, seed, reference):
    rng = np.random.default_rng(seed)
    q, v, _ = random_state(model, rng, 2, 3)
    mask = rng.integers(0, 2, size=6)
    mask[rng.integers(6)] = 1
    frame, rows = int(rng.integers(0, model.f + 1)), np.flatnonzero(mask)
    task = TwistTask(np.arange(6.0), frame, reference, mask, length=0.5)
    level, above = task.level(model, q), task.level(model, q, v)
    J = rm.jacobian(model, q, frame, reference).reshape(6, 6, model.n)[:, rows]
    rate = rm.jacobian_rate(model, q, v, frame, reference)
    np.testing.assert_allclose(level.J, J, atol=1e-14)
    np.testing.assert_array_equal(level.rate, np.tile(np.arange(6.0)[rows], (6, 1)))
    np.testing.assert_array_equal(level.weights, np.array([2.0] * 3 + [1.0] * 3)[rows])
    drift = np.einsum("abij,abj->abi", rate, v)[..., rows].reshape(6, -1)
    np.testing.assert_allclose(above.drift, drift, atol=1e-12)
    assert not level.drift.any()

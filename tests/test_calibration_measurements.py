"""Every kind of measurement: derivatives, truth, parts of it, and the lengths that it knows."""

import pickle

import numpy as np
import pytest
from identities.random_robots import random_model, random_pose, random_state

import robotmodels as rm
from robotmodels.calibration import Reason, candidate_parameters, differential_model, problem_of
from robotmodels.calibration.identifiable import identifiable_on, identifiable_parameters
from robotmodels.calibration.joined import side_by_side
from robotmodels.calibration.measurements import (
    AxisPosition,
    CameraPose,
    Distance,
    Evaluation,
    FrameContact,
    KnownDistance,
    LaserLine,
    LinkedFrames,
    PlaneContact,
    PointContact,
    Pose,
    Position,
    RelativePose,
    length_is_known,
    lonely_labels,
)
from robotmodels.calibration.measurements.noise import whitened
from robotmodels.calibration.measurements.pivots import pivot_of
from robotmodels.calibration.problem import guessed_fixtures, linearised, satisfying
from robotmodels.errors import InvalidValueError, NotARotationError, ShapeError

B = 12
LABELS = ["u", "v", "w"] * 4
SIGMA = np.linspace(1.0, 2.0, 3 * B).reshape(B, 3)


def poses(rng, count):
    return np.array([random_pose(rng) for _ in range(count)])


def unit(rng):
    u = rng.normal(size=3)
    return u / np.linalg.norm(u)


def line(rng):
    return [rng.normal(size=3), rng.normal(size=3)]


def all_kinds(rng, n, ends):
    """One or more of every kind with random data, known and unknown fixtures, sigma and not."""
    q, q_other = rng.normal(size=(2, B, n))
    e, f = ends
    S = np.diag([1e-6, 2e-6, 3e-6])
    return {
        "pose": Pose(q, poses(rng, B), [1, 0, 1, 1, 0, 1], frame=e),
        "orientation": Pose.of_orientations(q, poses(rng, B)[:, :3, :3], sigma=1e-3, frame=e),
        "position": Position(q, rng.normal(size=(B, 3)), covariance=S, frame=f),
        "gauge": AxisPosition(q, rng.normal(size=B), unit(rng), zero=0.2, frame=e),
        "gauge_zero": AxisPosition(q, rng.normal(size=B), [0, 0, -2.0], frame=e, sigma=1e-6),
        "gauge_axis": AxisPosition(q, rng.normal(size=B), unit(rng), axis_is_known=False, frame=e),
        "gauge_down": AxisPosition(
            q, rng.normal(size=B), [0, 0, -1], zero=0.0, axis_is_known=False, frame=e
        ),
        "line": LaserLine(q, LABELS, {"v": line(rng)}, sigma=[1e-4, 2e-4], frame=e),
        "line_down": LaserLine(q, known={0: [[0.1, 0.2, 0.3], [0, 0, -1]]}, frame=e),
        "pivot": Distance(
            q, rng.uniform(0.1, 1.0, B), pivot=LABELS, known={"u": [1, 2, 3]}, frame=e
        ),
        "pair": Distance(q, rng.uniform(0.1, 1.0, B), q_other, sigma=1e-5, frame=e),
        "dead_path": Distance(q, rng.normal(size=B), pivot=LABELS, offset=True, frame=e),
        "dead_pair": Distance(q, rng.normal(size=B), q_other, offset=True, frame=e),
        "frame": FrameContact(q, LABELS, {"w": random_pose(rng)}, frame=e),
        "point": PointContact(q, LABELS, {"w": [0.1, 0.2, 0.3]}, frame=e, sigma=SIGMA),
        "plane": PlaneContact(q, LABELS, {"u": [*unit(rng), 0.4]}, frame=f, sigma=1e-4),
        "relative": RelativePose(q, q_other, poses(rng, B), frame=e),
        "relative_position": RelativePose(q, q_other, poses(rng, B), [1, 1, 1, 0, 0, 0], frame=e),
        "linked": LinkedFrames(q, e, f, LABELS, {"v": random_pose(rng)}),
        "linked_point": LinkedFrames(q, e, f, orientation=False, covariance=S),
        "camera": CameraPose(q, poses(rng, B), LABELS, {"v": random_pose(rng)}, frame=e),
        "camera_target": CameraPose(q, poses(rng, B), rows=[1, 1, 0, 0, 0, 0], frame=f),
        "camera_turns": CameraPose(q, poses(rng, B), rows=[0, 0, 0, 0, 1, 1], frame=f),
    }


KINDS = tuple(all_kinds(np.random.default_rng(0), 3, (None, 1)))
CONSTRAINTS = ("line", "frame", "point", "plane", "linked", "linked_point")


def robot(seed, **options):
    rng = np.random.default_rng(seed)
    options = {"f": 6, "tree": True, "fixed": True, "inertia": None, **options}
    return random_model(rng, **options), rng


def problem_with(model, measurement, ends):
    candidates = candidate_parameters(model, ends, gains=True, eccentricity=True)
    return problem_of(candidates, [measurement])


def slope(function, x, k, h=1e-3):
    """Central difference with two steps of extrapolation: errors of the order of h^6."""
    d = np.zeros_like(x)
    d[k] = 1.0
    table = [(function(x + s * d) - function(x - s * d)) / (2 * s) for s in (h, h / 2, h / 4)]
    first = [(4 * table[1] - table[0]) / 3, (4 * table[2] - table[1]) / 3]
    return (16 * first[1] - first[0]) / 15


# --- derivatives -------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [2, 3])
def test_derivatives_by_parameters_and_fixtures_are_those_of_finite_differences(kind, seed):
    model, rng = robot(seed, tip="any")
    ends = (None, 0 if seed == 3 else 2)
    m = all_kinds(rng, model.n, ends)[kind]
    problem = problem_with(model, m, ends)
    P = problem.P
    x = np.concatenate([0.03 * rng.normal(size=P), rng.normal(size=problem.F)])

    def residual(x):
        return linearised(problem, x[:P], x[P:])[0].residual

    part = linearised(problem, x[:P], x[P:])[0]
    assert part.residual.shape == (B, len(m.axes))
    assert len(m.units) == len(m.axes)
    assert part.by_parameters.shape == (B, len(m.axes), P)
    assert part.by_fixtures.shape == (B, len(m.axes), len(m.fixtures))
    J = np.concatenate([part.by_parameters, part.by_fixtures], axis=-1)
    if "rad" in m.units:  # a turn of half a turn has two rotation vectors
        turns = part.residual[:, [u == "rad" for u in m.units]]
        good = np.linalg.norm(turns, axis=1) < 3.0
        assert good.sum() >= B // 2
    elif isinstance(m, Distance) and not m.offset:  # a short length bends too much for differences
        good = (part.residual[:, 0] + m.length) > 0.1
        assert good.sum() >= 3
    else:
        good = np.ones(B, dtype=bool)
    worst = 0.0
    for k in range(len(x)):
        found = slope(residual, x, k)
        size = max(1.0, float(np.abs(found[good]).max()))
        worst = max(worst, float(np.abs(found - J[..., k])[good].max()) / size)
    assert worst < 1e-7


# --- the truth -----------------------------------------------------------------------------------


def truth(model, xi, kind, ends, rng):
    """Measurements without noise of a robot, its fixtures, and its candidates."""
    candidates = candidate_parameters(model, ends)
    deviation = xi * rng.normal(size=len(candidates))
    q = random_state(model, rng, B)[0]
    q_other = random_state(model, rng, B)[0]

    def T(readings, frame):
        return differential_model(candidates, readings, deviation, frame).T

    e, f = ends
    at, at_other, others = T(q, e), T(q_other, e), T(q, f)
    board, point, axis = random_pose(rng), rng.normal(size=3), unit(rng)
    far = np.linalg.norm(at[:, :3, 3] - point, axis=1)
    apart = np.linalg.norm(at[:, :3, 3] - at_other[:, :3, 3], axis=1)
    inverse = np.linalg.inv(at)
    measured = {
        "pose": (Pose(q, at, frame=e), []),
        "orientation": (Pose.of_orientations(q, at[:, :3, :3], frame=e), []),
        "position": (Position(q, others[:, :3, 3], frame=f), []),
        "gauge": (AxisPosition(q, at[:, :3, 3] @ axis - 0.3, axis, frame=e), [0.3]),
        "pivot": (Distance(q, far, frame=e), point),
        "known_pivot": (Distance(q, far, known={0: point}, frame=e), []),
        "dead_path": (Distance(q, far + 0.1, offset=True, frame=e), [*point, 0.1]),
        "pair": (Distance(q, apart, q_other, frame=e), []),
        "relative": (RelativePose(q, q_other, inverse @ at_other, frame=e), []),
        "camera": (CameraPose(q, inverse @ board, frame=e), None),
        "known_camera": (CameraPose(q, inverse @ board, known={0: board}, frame=e), []),
    }  # fmt: skip
    return candidates, deviation, *measured[kind]


@pytest.mark.parametrize(
    "kind",
    [
        "pose", "orientation", "position", "gauge", "pivot", "known_pivot", "dead_path", "pair",
        "relative", "camera", "known_camera",
    ],
)  # fmt: skip
@pytest.mark.parametrize("seed", [4, 5])
def test_residuals_vanish_for_the_robot_that_was_measured_and_the_guess_finds_its_fixtures(
    kind, seed
):
    model, rng = robot(seed, f=7)
    candidates, deviation, m, fixtures = truth(model, 0.02, kind, (None, 3), rng)
    problem = problem_of(candidates, [m])
    guess = guessed_fixtures(problem, deviation)
    if fixtures is not None:
        np.testing.assert_allclose(guess, fixtures, atol=1e-7)
    part = linearised(problem, deviation, guess)[0]
    assert np.abs(part.residual).max() < 1e-8
    assert np.abs(linearised(problem, deviation * 0, guess)[0].residual).max() > 1e-3


@pytest.mark.parametrize("kind", CONSTRAINTS)
def test_readings_are_moved_to_where_a_constraint_holds(kind):
    rng = np.random.default_rng(8)
    pair = side_by_side(rm.load("ur10e"), rm.load("rx90"), random_pose(rng))
    ends = ("a_tool", "b_tool")
    q0 = rng.uniform(-1.5, 1.5, 12)
    candidates = candidate_parameters(pair, ends)
    xi = 1e-3 * rng.normal(size=len(candidates))
    at, other = (differential_model(candidates, q0[None], xi, end).T[0] for end in ends)
    p = at[:3, 3]
    readings = q0 + 0.02 * rng.normal(size=(6, 12))
    X = np.linalg.inv(at) @ other
    m, fixtures = {
        "line": (LaserLine(readings, known={0: [p, unit(rng)]}, frame=ends[0]), []),
        "frame": (FrameContact(readings, known={0: at}, frame=ends[0]), []),
        "point": (PointContact(readings, frame=ends[0]), p),
        "plane": (PlaneContact(readings, known={0: [0.6, 0, 0.8, 0.6 * p[0] + 0.8 * p[2]]},
                               frame=ends[0]), []),
        "linked": (LinkedFrames(readings, *ends, known={0: X}), []),
        "linked_point": (LinkedFrames(readings, *ends, orientation=False), X[:3, 3]),
    }[kind]  # fmt: skip
    problem = problem_of(candidates, [m])
    assert np.abs(linearised(problem, xi, np.array(fixtures))[0].residual).max() > 1e-3
    there = satisfying(problem, xi, np.array(fixtures))
    moved = there.measurements[0]
    assert moved.is_constraint
    assert moved.blocks == 6
    assert np.abs(linearised(there, xi, np.array(fixtures))[0].residual).max() < 1e-12
    assert 1e-6 < np.abs(moved.q - readings).max() < 0.5


def test_two_arms_on_a_common_turning_trunk_are_moved_together():
    table = rm.DHTable(
        antecedent=[0, 1, 2, 3, 1, 5, 6],
        sigma=[0] * 7,
        alpha=[0, np.pi / 2, 0.3, -np.pi / 2, -np.pi / 2, 0.4, np.pi / 2],
        d=[0, 0.3, 0.4, 0.1, -0.3, 0.4, 0.1],
        b=[0, 0, 0, 0, 0.2, 0, 0],
        r=[0.5, 0.1, 0.0, 0.2, 0.1, 0.2, 0.1],
    )
    model = rm.RobotModel.from_table(table)
    candidates = candidate_parameters(model, (4, 7))
    rng = np.random.default_rng(3)
    q0 = rng.uniform(-1, 1, 7)
    m = LinkedFrames(q0 + 0.03 * rng.normal(size=(5, 7)), 4, 7, orientation=False)
    a, b = (differential_model(candidates, q0[None], None, end).T[0] for end in (4, 7))
    x = (np.linalg.inv(a) @ b)[:3, 3]
    problem = problem_of(candidates, [m])
    there = satisfying(problem, np.zeros(problem.P), x)
    assert there.measurements[0].blocks == 5
    assert np.abs(linearised(there, np.zeros(problem.P), x)[0].residual).max() < 1e-12


# --- parts, copies, names ------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_subsets_and_copies_keep_everything(kind):
    model, rng = robot(11)
    m = all_kinds(rng, model.n, (None, 2))[kind]
    problem = problem_with(model, m, (None, 2))
    xi, values = 0.01 * rng.normal(size=problem.P), rng.normal(size=problem.F)
    value = dict(zip([f.name for f in m.fixtures], values, strict=True))

    def rows(part):
        own = problem_of(problem.parameters, [part])
        fixtures = np.array([value[f.name] for f in own.fixtures])
        found = linearised(own, xi, fixtures)[0]
        return whitened(part, found.residual, np.full(len(m.axes), 2.0))

    whole = rows(m)
    again = pickle.loads(pickle.dumps(m))
    assert type(again) is type(m)
    assert again.name == m.name
    np.testing.assert_array_equal(rows(again), whole)
    for view in again.views:
        assert not view.q.flags.writeable
    blocks = np.array([7, 1, 4])
    part = m.subset(blocks)
    np.testing.assert_array_equal(rows(part), whole[blocks])
    assert part.blocks == 3
    assert set(part.fixtures) <= set(m.fixtures)
    same = m.with_configurations([view.q for view in m.views])
    np.testing.assert_array_equal(rows(same), whole)
    assert m.groups.shape == (B,)
    if m.groups.any():
        np.testing.assert_array_equal(m.groups, [0, 1, 2] * 4)


def test_whitened_rows_have_the_length_that_a_covariance_gives_them(rng):
    A = rng.normal(size=(B, 3, 3))
    C = A @ A.swapaxes(-1, -2) + np.eye(3)
    q, r, psi = np.zeros((B, 6)), rng.normal(size=(B, 3)), rng.normal(size=(B, 3, 5))
    m = Position(q, np.zeros((B, 3)), covariance=C)
    inverse = np.linalg.inv(C)
    rows, slopes = (whitened(m, x, np.ones(3)) for x in (r, psi))
    np.testing.assert_allclose((rows**2).sum(axis=1), np.einsum("bi,bij,bj->b", r, inverse, r))
    np.testing.assert_allclose(
        np.einsum("bip,bi->bp", slopes, rows), np.einsum("bip,bij,bj->bp", psi, inverse, r)
    )


def test_the_same_name_and_label_is_the_same_unknown():
    q = np.zeros((4, 6))
    arm = candidate_parameters(rm.load("rx90"))
    touched = PointContact(q, [0, 0, 1, 1], name="ball")
    bar = Distance(q, 0.3, pivot=[0, 0, 2, 2], name="ball")
    apart = KnownDistance("ball:0", "ball:2", 0.2)
    problem = problem_of(arm, [touched, bar, apart])
    assert [f.name for f in problem.fixtures] == [f"ball:{k}.{c}" for k in (0, 1, 2) for c in "xyz"]
    table = PlaneContact(q, name="table")
    again = PlaneContact(q + 1, name="table")
    assert problem_of(arm, [table, again]).F == 3


# --- lengths -------------------------------------------------------------------------------------


def test_only_what_a_shrunk_robot_would_violate_knows_a_length():
    q, z = np.zeros((4, 6)), np.eye(4)
    at = rm.se3.translation(0.1, 0.2, 0.3)
    two = [0, 0, 1, 1]
    assert not PointContact(q).knows_length
    assert not PointContact(q, known={0: [0.5, 0.1, 0.2]}).knows_length
    assert not PointContact(q, two, {0: [0.5, 0.1, 0.2]}).knows_length
    assert PointContact(q, two, {0: [0.5, 0.1, 0.2], 1: [0.5, 0.1, 0.3]}).knows_length
    assert not FrameContact(q, known={0: at}).knows_length
    assert FrameContact(q, two, {0: at, 1: z}).knows_length
    assert not PlaneContact(q, two, {0: [0, 0, 1, 0.2], 1: [1, 0, 0, 0.5]}).knows_length
    assert PlaneContact(q, two, {0: [0, 0, 1, 0.2], 1: [0, 0, -1, 0.5]}).knows_length
    crossing = {0: [[1, 0, 0], [1, 0, 0]], 1: [[0, 2, 0], [0, 1, 0]]}
    skew = {0: [[1, 0, 0], [1, 0, 0]], 1: [[0, 2, 0.1], [0, 1, 0]]}
    assert not LaserLine(q, two, crossing).knows_length
    assert LaserLine(q, two, skew).knows_length
    assert not LinkedFrames(q, 1, 2, known={0: z}).knows_length
    assert LinkedFrames(q, 1, 2, known={0: at}).knows_length
    assert Distance(q, 0.3).knows_length
    assert Distance(q, 0.3, q + 1).knows_length
    assert not Distance(q, 0.3, offset=True).knows_length
    assert Distance(q, [0.1, 0.2, 0.2, 0.2], offset=True).knows_length
    assert not Distance(q, [0.1, 0.1, 0.2, 0.2], pivot=two, offset=True).knows_length
    assert not AxisPosition(q, 0.4, [1, 0, 0]).knows_length
    assert AxisPosition(q, [0.4, 0.4, 0.4, 0.5], [1, 0, 0]).knows_length
    still, moving = np.tile(z, (4, 1, 1)), np.tile(at, (4, 1, 1))
    assert RelativePose(q, q, moving).knows_length
    assert not RelativePose(q, q, still).knows_length
    assert not RelativePose(q, q, moving, [0, 0, 0, 1, 1, 1]).knows_length
    assert CameraPose(q, moving).knows_length
    assert not CameraPose(q, moving, rows=[0, 0, 0, 1, 1, 1]).knows_length
    assert not Pose.of_orientations(q, still[:, :3, :3]).knows_length


def test_lengths_of_several_measurements_together():
    q = np.zeros((4, 6))
    one = PointContact(q, known={0: [0.5, 0.0, 0.2]})
    other = PointContact(q, known={0: [0.5, 0.0, 0.3]}, name="other")
    floor = PlaneContact(q, known={0: [0, 0, 1, 0.0]})
    same_height = PlaneContact(q, known={0: [0, 0, 1, 0.2]})
    assert length_is_known([one, other])
    assert length_is_known([one, floor])
    assert not length_is_known([one, same_height])
    assert not length_is_known([one])
    assert length_is_known([one], [0.0, 0.0, 0.0])
    assert not length_is_known([one], [0.5, 0.0, 0.2])
    assert not length_is_known([PointContact(q)], [0.0, 0.0, 0.0])


@pytest.mark.parametrize("kind", ["point", "frame", "plane", "line"])
def test_a_robot_dilated_from_a_known_place_touches_as_before(kind):
    rng = np.random.default_rng(5)
    model, c, s = rm.load("rx90"), rng.normal(size=3), 0.7
    q = rng.uniform(-1, 1, (B, 6))
    T = rm.dgm(model, q)
    dilated = T.copy()
    dilated[:, :3, 3] = c + s * (T[:, :3, 3] - c)
    n = unit(rng)
    m = {
        "point": PointContact(q, known={0: c}),
        "frame": FrameContact(q, known={0: rm.se3.translation(*c)}),
        "plane": PlaneContact(q, known={0: [*n, n @ c]}),
        "line": LaserLine(q, known={0: [c, n]}),
    }[kind]
    psi = np.zeros((B, 6, 0))
    lengths = [u == "m" for u in m.units]
    there, small = (
        m.linearise([Evaluation(at, psi)], np.zeros(0)).residual[:, lengths] for at in (T, dilated)
    )
    np.testing.assert_allclose(small, s * there, atol=1e-12)
    A, b = m.dilation_centres
    np.testing.assert_allclose(A @ c, b, atol=1e-12)


# --- what they tell ------------------------------------------------------------------------------


def touched_planes(normals, rng, count=30):
    """Postures of an arm whose tip is on planes through a reachable place, exactly."""
    model = rm.load("rx90").with_tool(rm.se3.translation(0.05, 0.03, 0.1))
    candidates = candidate_parameters(model)
    centre = np.array([0.5, 0.1, 0.3])
    q, labels = [], []
    for g, normal in enumerate(normals):
        start = rng.uniform(-1.2, 1.2, (count, 6))
        m = PlaneContact(start, known={0: [*normal, normal @ centre]})
        moved = satisfying(problem_of(candidates, [m]), np.zeros(len(candidates)), np.zeros(0))
        found = moved.measurements[0].q
        q.append(found)
        labels += [g] * len(found)
    return candidates, PlaneContact(np.concatenate(q), labels)


def test_planes_touched_from_too_few_directions_tell_less_and_it_is_said():
    rng = np.random.default_rng(2)
    level, wall, slope_ = np.eye(3)[2:], np.eye(3)[:1], np.array([[0.6, 0.0, 0.8]])
    told = {}
    for name, normals in (
        ("level", level), ("slope", slope_), ("corner", np.vstack([level, wall])),
        ("parallel", np.vstack([level, level])),
    ):  # fmt: skip
        candidates, touched = touched_planes(normals, rng, 60)
        told[name] = identifiable_on(candidates, [touched], known_lengths=["d3"])
        assert told[name].gap[1] < 1e-9 < 1e-3 < told[name].gap[0]
    lost = set(told["slope"].names) - set(told["level"].names)
    assert lost == {"d2", "r2"}  # d2 moves the arm along the table, r2 is along a parallel axis
    assert lost <= set(told["level"].of_reason(Reason.NO_EFFECT))
    assert "theta1" in told["level"].of_reason(Reason.NO_EFFECT)
    assert told["corner"].names == told["slope"].names
    assert told["parallel"].names == told["level"].names
    points = identifiable_parameters(candidates.model, "point_contact", known_lengths=["d3"])
    assert set(points.names) == set(told["slope"].names)


def test_a_plane_touched_along_a_line_does_not_know_its_normal():
    candidates, touched = touched_planes(np.array([[0.6, 0.0, 0.8]]), np.random.default_rng(2), 60)
    few = touched.subset(np.arange(2))
    found = identifiable_on(candidates, [few], known_lengths=["d3"])
    assert found.count == 0  # three unknowns of the plane take all that two touches say


def test_what_is_touched_too_seldom_is_named_with_what_to_do():
    q = np.zeros((4, 6))
    alone = PointContact(q, [0, 0, 0, 1])
    assert [found.label for found in lonely_labels([alone])] == ["point:1"]
    assert "point:1 is measured once: 3 rows" in str(lonely_labels([alone])[0])
    assert lonely_labels([alone, PointContact(q[:1], [1])]) == ()
    assert lonely_labels([alone, KnownDistance("point:0", "point:1", 0.1)]) == ()
    assert [found.label for found in lonely_labels([PlaneContact(q, [0, 0, 0, 1])])] == [
        "plane:0", "plane:1",
    ]  # fmt: skip
    assert lonely_labels([PlaneContact(q)]) == ()
    assert lonely_labels([LaserLine(q)]) == ()
    assert len(lonely_labels([LaserLine(q, [0, 0, 1, 1])])) == 2
    assert len(lonely_labels([FrameContact(q, [0, 0, 0, 1])])) == 1
    assert len(lonely_labels([Distance(q, 0.1, offset=True)])) == 1
    assert lonely_labels([Distance(q, 0.1), AxisPosition(q, 0.1, [0, 0, 1])]) == ()
    assert lonely_labels([FrameContact(q, [0, 1, 2, 3], {k: np.eye(4) for k in range(4)})]) == ()


@pytest.mark.parametrize("kind", ["linked", "linked_point", "camera"])
def test_what_two_arms_or_a_camera_on_the_arm_tell_is_judged(kind):
    rng = np.random.default_rng(6)
    if kind == "camera":
        model = rm.load("ur10e")
        q = rng.uniform(-2, 2, (40, 6))
        board = random_pose(rng)
        seen = CameraPose(q, np.linalg.inv(rm.dgm(model, q)) @ board)
        found = identifiable_on(candidate_parameters(model), [seen])
        # of 4 R + 6 parameters the six of the base are the board's instead
        assert found.count == 4 * 6 + 6 - 6
        assert set(found.of_reason(Reason.GAUGE)) >= {"b0", "d0", "r0"}
        return
    pair = side_by_side(rm.load("ur10e"), rm.load("rx90"), rm.se3.translation(0.9, 0.1, 0.0))
    ends = ("a_tool", "b_tool")
    q0 = np.array([0.2, -1.0, 1.4, 0.3, 1.0, 0.1, 2.8, -0.9, 1.2, 0.4, 0.9, -0.2])
    candidates = candidate_parameters(pair, ends)
    a, b = (differential_model(candidates, q0[None], None, end).T[0] for end in ends)
    X = np.linalg.inv(a) @ b
    readings = q0 + rng.uniform(-0.5, 0.5, (60, 12))
    full = kind == "linked"
    start = LinkedFrames(readings, *ends, known={0: X}, orientation=full)
    moved = satisfying(problem_of(candidates, [start]), np.zeros(len(candidates)), np.zeros(0))
    m = LinkedFrames(moved.measurements[0].q, *ends, orientation=full)
    assert m.blocks > 50
    found = identifiable_on(candidates, [m], known_lengths=["d3"])
    problem, nominal = problem_of(candidates, [m]), np.zeros(len(candidates))
    part = linearised(problem, nominal, guessed_fixtures(problem, nominal))[0]
    assert np.abs(part.residual).max() < 1e-9
    assert found.gap[1] < 1e-9 < 1e-4 < found.gap[0]
    # a loop of twelve revolute joints has 4 parameters for each, less the scale; a point that is
    # shared leaves the six turns of its two sides open
    assert found.count + problem.F == (47 if full else 41)
    W = np.concatenate([part.by_fixtures, part.by_parameters], axis=-1).reshape(
        -1, problem.F + problem.P
    )
    base = [k for k, e in enumerate(candidates.entries) if e.row == 0 or e.name == "d3"]
    W = np.delete(W, [problem.F + k for k in base], axis=1)
    length = np.linalg.norm(W, axis=0)
    s = np.linalg.svd(W[:, length > 1e-9] / length[length > 1e-9], compute_uv=False)
    assert int((s > 1e-9 * s[0]).sum()) == found.count + problem.F


def test_pivots_are_found_from_lengths():
    rng = np.random.default_rng(9)
    for _ in range(20):
        p, c = rng.normal(size=(9, 3)), 2 * rng.normal(size=3)
        length = np.linalg.norm(p - c, axis=1)
        np.testing.assert_allclose(pivot_of(p, length, False), c, atol=1e-8)
        np.testing.assert_allclose(pivot_of(p, length - 0.7, True), c, atol=1e-6)
    # a bar about a pivot: lengths are all the same, positions on a sphere
    u = rng.normal(size=(9, 3))
    p = c + 0.4 * u / np.linalg.norm(u, axis=1)[:, None]
    np.testing.assert_allclose(pivot_of(p, np.full(9, 0.4), False), c, atol=1e-8)
    np.testing.assert_allclose(pivot_of(p, np.full(9, 0.1), True), c, atol=1e-8)
    # positions in a level plane: the pivot below them
    p = np.column_stack([rng.normal(size=(9, 2)), np.full(9, 0.5)])
    below = np.array([0.1, 0.2, 0.1])
    np.testing.assert_allclose(
        pivot_of(p, np.linalg.norm(p - below, axis=1), False), below, atol=1e-8
    )


# --- mistakes ------------------------------------------------------------------------------------


def test_mistakes_are_named():
    q, T = np.zeros((3, 6)), np.tile(np.eye(4), (3, 1, 1))
    nan = np.full((3, 6), np.nan)
    with pytest.raises(InvalidValueError, match="q: expected finite"):
        FrameContact(nan)
    with pytest.raises(ShapeError, match="a row for each measurement"):
        PlaneContact(q[0])
    with pytest.raises(ShapeError, match="pose: expected a label for each of the 3 rows"):
        FrameContact(q, [0, 1])
    with pytest.raises(ShapeError, match="line: expected a label for each"):
        LaserLine(q, "abc")
    with pytest.raises(InvalidValueError, match="no row of q has the plane '2'; there are 0, 1"):
        PlaneContact(q, [0, 0, 1], {2: [0, 0, 1, 0]})
    with pytest.raises(InvalidValueError, match="expected a mapping of labels"):
        PointContact(q, known=[0.1, 0.2, 0.3])
    with pytest.raises(InvalidValueError, match=r"normal of length 2\. Divide"):
        PlaneContact(q, known={0: [0, 0, 2, 0.4]})
    with pytest.raises(InvalidValueError, match="expected a direction in the second row"):
        LaserLine(q, known={0: np.zeros((2, 3))})
    with pytest.raises(ShapeError, match="known"):
        LaserLine(q, known={0: np.zeros(3)})
    with pytest.raises(InvalidValueError, match="axis: expected a direction"):
        AxisPosition(q, 0.0, [0, 0, 0])
    with pytest.raises(ShapeError, match="value: expected a number for each row"):
        AxisPosition(q, [0.0, 1.0], [0, 0, 1])
    with pytest.raises(InvalidValueError, match=r"positive lengths .* offset=True"):
        Distance(q, [0.1, 0.2, -0.1])
    with pytest.raises(InvalidValueError, match="not both"):
        Distance(q, 0.1, q + 1, pivot=[0, 0, 0])
    with pytest.raises(ShapeError, match="q_other: expected the shape of q"):
        RelativePose(q, q[:2], T)
    with pytest.raises(ShapeError, match="a pose for each row of q"):
        CameraPose(q, T[:2])
    with pytest.raises(NotARotationError):
        RelativePose(q, q, 2 * T)
    with pytest.raises(InvalidValueError, match="rows: expected 6 numbers 0 or 1"):
        CameraPose(q, T, rows=[0] * 6)
    with pytest.raises(InvalidValueError, match="rows: expected 3 numbers 0 or 1"):
        Position(q, np.zeros((3, 3)), [2, 0, 0])
    with pytest.raises(InvalidValueError, match="expected two or more configurations"):
        RelativePose.successive(q[:1], T[:0])
    with pytest.raises(InvalidValueError, match="another end than 'a'"):
        LinkedFrames(q, "a", "a")
    with pytest.raises(ShapeError, match="sigma"):
        FrameContact(q, sigma=np.ones(3))
    with pytest.raises(InvalidValueError, match="positive definite"):
        LaserLine(q, covariance=np.diag([1.0, 0.0]))
    with pytest.raises(ShapeError, match="R: expected"):
        Pose.of_orientations(q, np.eye(3))

"""Calibration end to end: truths that are known, statistics that hold, mistakes that are named."""

import dataclasses
import pickle

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.calibration import (
    KnownDistance,
    ParameterPrior,
    PointContact,
    Pose,
    Position,
    Reason,
    candidate_parameters,
    differential_model,
    fit,
    joint_offsets,
)
from robotmodels.calibration.measurements import (
    AxisPosition,
    CameraPose,
    Distance,
    FrameContact,
    LaserLine,
    PlaneContact,
    RelativePose,
)
from robotmodels.calibration.robot import calibrated_pose
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.estimation import FitStatus, confidence_intervals

ALONE = {"folds": 0, "held_out": 0}
"""A fit without its fits on part of the data."""
EXACT = 1e-9


def erroneous(model, rng, length=1e-3, angle=2e-3, keep=()):
    """A robot whose table is off everywhere, told in the table's own columns."""
    table, f = model.table, model.f
    parallel = np.abs(np.sin(table.alpha)) < 1e-6
    columns = {
        "alpha": table.alpha + angle * rng.normal(size=f),
        "beta": table.beta + np.where(parallel, angle * rng.normal(size=f), 0.0),
        "d": table.d + length * rng.normal(size=f),
        "theta": table.theta + angle * rng.normal(size=f),
        "r": table.r + length * rng.normal(size=f),
    }
    for name, row in keep:
        columns[name][row - 1] = getattr(table, name)[row - 1]
    return model.with_table(dataclasses.replace(table, **columns))


def readings(model, rng, count):
    """Random readings, two thirds of the limits where there are some."""
    low, high = model.lower, model.upper
    slides = model.table.sigma[model.table.joint_rows] == 1
    low = np.where(np.isfinite(low), low, np.where(slides, -0.4, -2.5))
    high = np.where(np.isfinite(high), high, np.where(slides, 0.5, 2.5))
    return rng.uniform(np.maximum(low, -2.5), np.minimum(high, 2.5), (count, model.n))


def reaching(model, points, rng, near=2.0):
    """Readings at which the tool is at each of some points, wherever the search begins."""
    q = np.empty((len(points), model.n))
    left = np.arange(len(points))
    for _ in range(20):
        T = np.tile(np.eye(4), (len(left), 1, 1))
        T[:, :3, 3] = points[left]
        found = rm.igm_numeric(
            model, T, q0=rng.uniform(-near, near, (len(left), model.n)), mask=[1, 1, 1, 0, 0, 0],
            position_tolerance=1e-13, rng=rng,
        )  # fmt: skip
        done = found.valid[:, 0]
        q[left[done]] = found.q[done, 0]
        left = left[~done]
        if not len(left):
            return q
    raise AssertionError("points out of reach")


def touching(model, points, count, rng):
    """Readings at which the tool is at points, many configurations each; and which point."""
    labels = np.repeat(np.arange(len(points)), count)
    return reaching(model, points[labels], rng), labels.tolist()


def shape_error(a, b, q):
    """Largest distance of two robots' positions, where one may stand anywhere."""
    p, s = (rm.dgm(model, q)[:, :3, 3] for model in (a, b))
    p, s = p - p.mean(axis=0), s - s.mean(axis=0)
    U, _, V = np.linalg.svd(p.T @ s)
    R = (U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V).T
    return np.abs(p @ R.T - s).max()


class Scene:
    """An RX-90 with a tool off its last axis, its real brother, and readings."""

    def __init__(self, seed=0, count=60, **options):
        self.rng = np.random.default_rng(seed)
        nominal = rm.load("rx90")
        self.real = erroneous(nominal, self.rng, **options).with_tool(
            rm.se3.from_rpy([0.2, -0.1, 0.3], [0.05, -0.03, 0.12])
        )
        self.nominal = nominal.with_tool(rm.se3.translation(0.05, -0.03, 0.11))
        self.q = readings(nominal, self.rng, count)
        self.fresh = readings(nominal, self.rng, 20)
        self.T = rm.dgm(self.real, self.q)

    def noisy(self, length=1e-4, angle=2e-4):
        """Poses with noise."""
        T = self.T.copy()
        T[:, :3, 3] += length * self.rng.normal(size=(len(T), 3))
        turn = angle * self.rng.normal(size=(len(T), 3))
        for k, (x, y, z) in enumerate(turn):
            T[k, :3, :3] = rm.se3.from_rpy([x, y, z])[:3, :3] @ T[k, :3, :3]
        return T


@pytest.fixture(scope="module")
def scene():
    return Scene()


@pytest.fixture(scope="module")
def contacts():
    """The robot touches three points; the length r4 is right."""
    s = Scene(seed=3, keep=[("r", 4)])
    points = np.array([[0.5, 0.1, 0.1], [0.1, -0.45, 0.3], [0.4, -0.3, 0.35]])
    q, labels = touching(s.real, points, 20, s.rng)
    return s, points, q, labels


# --- the same truth by every method, on what it can see -------------------------------------------


def test_poses_tell_all_of_the_robot(scene):
    result = fit(scene.nominal, Pose(scene.q, scene.T), **ALONE)
    assert len(result.names) == 30  # 4 R + 2 P + 6
    assert result.status is FitStatus.CONVERGED
    assert np.abs(rm.dgm(result.model, scene.fresh) - rm.dgm(scene.real, scene.fresh)).max() < EXACT
    assert result.given.summary("m").rms > 5e-3
    assert result.after.summary("m").largest < EXACT
    assert result.after.summary("rad").largest < EXACT


def test_positions_tell_all_but_the_tool_s_orientation(scene):
    result = fit(scene.nominal, Position(scene.q, scene.T[:, :3, 3]), **ALONE)
    assert len(result.names) == 27
    error = rm.dgm(result.model, scene.fresh) - rm.dgm(scene.real, scene.fresh)
    assert np.abs(error[:, :3, 3]).max() < EXACT


@pytest.mark.parametrize("row", [0, 1, 2])
def test_one_axis_tells_that_coordinate(scene, row):
    rows = np.eye(6, dtype=int)[row]
    result = fit(scene.nominal, Pose(scene.q, scene.T, rows=rows), **ALONE)
    error = rm.dgm(result.model, scene.fresh) - rm.dgm(scene.real, scene.fresh)
    assert np.abs(error[:, row, 3]).max() < EXACT


def test_orientations_tell_the_angles(scene):
    result = fit(scene.nominal, Pose(scene.q, scene.T, rows=[0, 0, 0, 1, 1, 1]), **ALONE)
    assert set(result.units) == {"rad"}
    error = rm.dgm(result.model, scene.fresh) - rm.dgm(scene.real, scene.fresh)
    assert np.abs(error[:, :3, :3]).max() < EXACT


def test_contacts_with_a_known_distance_tell_the_shape(contacts):
    s, points, q, labels = contacts
    apart = np.linalg.norm(points[0] - points[1])
    measured = [PointContact(q, labels), KnownDistance("point:0", "point:1", apart, sigma=1e-9)]
    result = fit(s.nominal, measured, **ALONE)
    assert len(result.names) == 21  # 27 less the six of a base that nobody sees
    assert shape_error(result.model, s.real, s.fresh) < EXACT
    found = np.array([[result.fixtures[f"point:{k}.{a}"] for a in "xyz"] for k in range(3)])
    between = np.linalg.norm(found[[0, 1, 0]] - found[[1, 2, 2]], axis=1)
    assert between == pytest.approx(np.linalg.norm(points[[0, 1, 0]] - points[[1, 2, 2]], axis=1))


def test_contacts_with_a_known_parameter_tell_the_shape(contacts):
    s, _, q, labels = contacts
    result = fit(s.nominal, PointContact(q, labels), known_lengths=["r4"], **ALONE)
    assert shape_error(result.model, s.real, s.fresh) < EXACT
    assert result.known == ("r4",)
    assert "r4" not in result.names


def test_contacts_of_known_points_tell_where_the_robot_stands(contacts):
    s, points, q, labels = contacts
    known = dict(enumerate(points))
    real = s.real
    result = fit(s.nominal, PointContact(q, labels, known=known), **ALONE)
    assert len(result.names) == 27
    error = rm.dgm(result.model, s.fresh) - rm.dgm(real, s.fresh)
    assert np.abs(error[:, :3, 3]).max() < EXACT


def test_lengths_between_positions_tell_the_shape(scene):
    other = np.roll(scene.q, 1, axis=0)
    p = scene.T[:, :3, 3]
    length = np.linalg.norm(p - np.roll(p, 1, axis=0), axis=1)
    result = fit(scene.nominal, Distance(scene.q, length, q_other=other), **ALONE)
    assert shape_error(result.model, scene.real, scene.fresh) < EXACT


def test_lengths_from_pivots_tell_the_shape(scene):
    pivots = np.array([[1.5, 0.2, -0.5], [-0.4, 1.6, 0.3], [0.1, -1.2, 1.4]])
    label = np.arange(60) % 3
    length = np.linalg.norm(scene.T[:, :3, 3] - pivots[label], axis=1)
    known = dict(enumerate(pivots))
    stands = fit(scene.nominal, Distance(scene.q, length, pivot=label, known=known), **ALONE)
    error = rm.dgm(stands.model, scene.fresh) - rm.dgm(scene.real, scene.fresh)
    assert np.abs(error[:, :3, 3]).max() < EXACT
    unknown = fit(scene.nominal, Distance(scene.q, length, pivot=label), **ALONE)
    assert shape_error(unknown.model, scene.real, scene.fresh) < EXACT


def test_steps_between_successive_poses_tell_the_shape(scene):
    T = np.linalg.inv(scene.T[:-1]) @ scene.T[1:]
    result = fit(scene.nominal, RelativePose.successive(scene.q, T), **ALONE)
    assert len(result.names) == 24  # 30 less the six of a base that nobody sees
    step = np.linalg.inv(rm.dgm(result.model, scene.fresh[:-1])) @ rm.dgm(
        result.model, scene.fresh[1:]
    )
    real = rm.dgm(scene.real, scene.fresh)
    assert np.abs(step - np.linalg.inv(real[:-1]) @ real[1:]).max() < EXACT


def test_a_camera_on_the_arm_that_looks_at_a_target_tells_the_shape(scene):
    target = rm.se3.from_rpy([0.3, -0.4, 1.0], [0.8, 0.1, -0.2])
    seen = np.linalg.inv(scene.T) @ target
    result = fit(scene.nominal, CameraPose(scene.q, seen), **ALONE)
    step = np.linalg.inv(rm.dgm(result.model, scene.fresh[:-1])) @ rm.dgm(
        result.model, scene.fresh[1:]
    )
    real = rm.dgm(scene.real, scene.fresh)
    assert np.abs(step - np.linalg.inv(real[:-1]) @ real[1:]).max() < EXACT


def test_a_pose_reached_in_many_postures_tells_the_shape(contacts):
    s, *_ = contacts
    T = rm.dgm(s.real, readings(s.nominal, s.rng, 12))
    found = rm.igm(s.real, T)
    q, label = found.q[found.valid], np.nonzero(found.valid)[0]
    assert len(q) >= 40
    result = fit(s.nominal, FrameContact(q, label), known_lengths=["r4"], **ALONE)
    # the calibrated robot brings every posture of a pose to one pose
    for k in np.unique(label):
        assert np.abs(np.ptp(rm.dgm(result.model, q[label == k]), axis=0)).max() < EXACT
    assert "r4" not in result.names


def plane_touches(s, count):
    """Readings at which the tool is on one of four planes that are not parallel."""
    normals = np.array([[0.0, 0.0, 1.0], [0.8, 0.0, 0.6], [0.0, 0.8, 0.6], [-0.6, -0.48, 0.64]])
    offsets = np.array([0.1, 0.2, 0.15, 0.1])
    label = np.arange(count) % 4
    there = np.empty((count, 3))
    for k in range(count):
        n = normals[label[k]]
        x = s.rng.uniform(-0.45, 0.45, 3)
        there[k] = x + (offsets[label[k]] - n @ x) * n
    return reaching(s.real, there, s.rng), label, normals, offsets


def test_planes_touched_with_a_known_length_tell_the_shape(contacts):
    s, *_ = contacts
    q, label, normals, offsets = plane_touches(s, 160)
    result = fit(s.nominal, PlaneContact(q, label), known_lengths=["r4"], **ALONE)
    assert shape_error(result.model, s.real, s.fresh) < 10.0 * EXACT
    known = {k: [*n, o] for k, (n, o) in enumerate(zip(normals, offsets, strict=True))}
    result = fit(s.nominal, PlaneContact(q, label, known=known), **ALONE)
    error = rm.dgm(result.model, s.fresh) - rm.dgm(s.real, s.fresh)
    assert np.abs(error[:, :3, 3]).max() < 10.0 * EXACT


def test_lines_and_gauges_tell_their_part(contacts):
    s, *_ = contacts
    at = np.array([[0.4, 0.1, 0.0], [0.1, 0.4, 0.2], [-0.3, 0.1, 0.3]])
    along = np.array([[0.0, 0.6, 0.8], [0.8, 0.0, 0.6], [0.0, 1.0, 0.0]])
    label = np.arange(75) % 3
    there = at[label] + s.rng.uniform(-0.3, 0.3, (75, 1)) * along[label]
    q = reaching(s.real, there, s.rng)
    known = {k: [at[k], along[k]] for k in range(3)}
    gauge = AxisPosition(s.q, s.T[:, :3, 3] @ [0.0, 0.6, 0.8], [0.0, 0.6, 0.8])
    result = fit(s.nominal, [LaserLine(q, label, known=known), gauge], **ALONE)
    error = rm.dgm(result.model, s.fresh) - rm.dgm(s.real, s.fresh)
    assert np.abs(error[:, :3, 3]).max() < EXACT


def test_kinds_mix_in_one_fit(contacts):
    s, _, q, labels = contacts
    measured = [
        PointContact(q, labels),
        Position(s.q[:10], s.T[:10, :3, 3]),
        Pose(s.q[10:14], s.T[10:14]),
        Pose(s.q[14:20], s.T[14:20], rows=[0, 0, 1, 0, 0, 0], name="height"),
    ]
    result = fit(s.nominal, measured, **ALONE)
    assert len(result.names) == 30
    assert np.abs(rm.dgm(result.model, s.fresh) - rm.dgm(s.real, s.fresh)).max() < EXACT


@pytest.mark.parametrize("name", ["stanford_arm", "cobra_s600", "iiwa14", "lab_rrt"])
def test_other_structures_are_recovered(name):
    # a prismatic joint, parallel axes, a redundant arm, a short one with a base of its own
    rng = np.random.default_rng(1)
    nominal = rm.load(name).with_base(rm.se3.from_rpy([0.4, 0.2, -1.0], [1.0, -2.0, 0.5]))
    nominal = nominal.with_tool(rm.se3.translation(0.04, 0.03, 0.1))
    real = erroneous(nominal, rng)
    q, fresh = readings(nominal, rng, 60), readings(nominal, rng, 20)
    result = fit(nominal, Pose(q, rm.dgm(real, q)), **ALONE)
    assert np.abs(rm.dgm(result.model, fresh) - rm.dgm(real, fresh)).max() < EXACT


def test_two_ends_of_a_robot_are_calibrated_together(scene):
    elbow = rm.dgm(scene.real, scene.q[:20], frame=4)
    measured = [Pose(scene.q, scene.T), Position(scene.q[:20], elbow[:, :3, 3], frame=4)]
    result = fit(scene.nominal, measured, **ALONE)
    robot = result.robot
    found = calibrated_pose(robot, scene.fresh, frame=4)[:, :3, 3]
    assert np.abs(found - rm.dgm(scene.real, scene.fresh, frame=4)[:, :3, 3]).max() < EXACT


# --- where the robot stands -----------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["pose", "position"])
def test_a_base_three_metres_away_and_turned_is_found(scene, kind):
    away = rm.se3.from_rpy([0.3, -0.2, 2.5], [3.0, -1.0, 0.7])
    real = scene.real.with_base(away)
    T = rm.dgm(real, scene.q)
    measured = Pose(scene.q, T) if kind == "pose" else Position(scene.q, T[:, :3, 3])
    result = fit(scene.nominal, measured, **ALONE)
    error = rm.dgm(result.model, scene.fresh) - rm.dgm(real, scene.fresh)
    assert np.abs(error[:, :3, 3]).max() < EXACT
    # errors before are those of the table, not of where the robot stands
    assert result.given.summary("m").mean > 1.0
    assert result.before.summary("m").mean < 0.02


def test_a_tool_that_is_not_known_is_found(scene):
    bare = scene.nominal.with_tool(np.eye(4))
    result = fit(bare, Pose(scene.q, scene.T), **ALONE)
    assert np.abs(rm.dgm(result.model, scene.fresh) - rm.dgm(scene.real, scene.fresh)).max() < EXACT


# --- statistics -----------------------------------------------------------------------------------


@pytest.mark.parametrize("states_noise", [True, False])
def test_truth_is_inside_its_interval_as_often_as_stated(states_noise):
    rng = np.random.default_rng(5)
    nominal = rm.load("planar_3r")
    names = ["theta1", "d2", "theta2", "d3", "theta3"]
    sigma = 3e-4
    candidates = candidate_parameters(nominal, base=False, tool=False).subset(names)
    inside = []
    for _ in range(500):
        change = np.array([2e-3, 1e-3, 2e-3, 1e-3, 2e-3]) * rng.normal(size=5)
        d, theta = nominal.table.d.copy(), nominal.table.theta.copy()
        theta += change[[0, 2, 4]]
        d[1:] += change[[1, 3]]
        real = nominal.with_table(dataclasses.replace(nominal.table, d=d, theta=theta))
        q = rng.uniform(-2.0, 2.0, (8, 3))
        p = rm.dgm(real, q)[:, :3, 3] + sigma * rng.normal(size=(8, 3))
        measured = Position(q, p, sigma=sigma if states_noise else None)
        result = fit(nominal, measured, parameters=candidates, **ALONE)
        truth = change[[names.index(name) for name in result.names]]
        low, high = confidence_intervals(result.solution.fit)[:5].T
        inside.append((low <= truth) & (truth <= high))
    share = np.mean(inside, axis=0)
    assert len(share) == 5
    assert (share > 0.92).all(), share
    assert (share < 0.97).all(), share


def test_stated_deviations_are_those_of_many_repeats():
    errors, stated = [], []
    for seed in range(30):
        s = Scene(seed=seed, count=40)
        result = fit(s.nominal, Pose(s.q, s.noisy()), **ALONE)
        k = result.names.index("d3")
        errors.append(result.values[k] - s.real.table.d[2])
        stated.append(result.standard_deviation[k])
    # d3 is told by itself: the length between two parallel axes
    size = np.sqrt(np.mean((np.array(errors) / stated) ** 2))
    assert 0.7 < size < 1.35  # chi squared of 30, 99 %


def test_noise_of_lengths_and_of_angles_is_told_apart(scene):
    s = Scene(seed=2, count=300)
    result = fit(s.nominal, Pose(s.q, s.noisy(length=3e-4, angle=1e-4)), **ALONE)
    scale = result.solution.scales[0]
    assert scale[:3] == pytest.approx(3e-4, rel=0.1)
    assert scale[3:] == pytest.approx(1e-4, rel=0.1)


def test_outliers_do_not_move_a_robust_fit():
    s = Scene(seed=4, count=150)
    T = s.noisy()
    clean = fit(s.nominal, Position(s.q, T[:, :3, 3]), loss="tukey", **ALONE)
    p = T[:, :3, 3].copy()
    bad = s.rng.choice(150, 15, replace=False)
    turn = s.rng.normal(size=(15, 3))
    p[bad] += 0.02 * turn / np.linalg.norm(turn, axis=1, keepdims=True)
    robust = fit(s.nominal, Position(s.q, p), loss="tukey", **ALONE)
    plain = fit(s.nominal, Position(s.q, p), **ALONE)
    assert robust.names == clean.names
    moved = np.abs(robust.values - clean.values) / robust.standard_deviation
    assert moved.max() < 1.0
    assert set(bad) <= set(robust.solution.fit.outliers)
    # while least squares is moved by many times the deviation of clean data
    assert (np.abs(plain.values - clean.values) / clean.standard_deviation).max() > 5.0


@pytest.mark.parametrize("states_noise", [True, False])
def test_millimetres_and_metres_give_the_same_answer(states_noise):
    s = Scene(seed=6, count=40)
    T = s.noisy()
    unit = 1000.0
    large = s.nominal.table
    large = dataclasses.replace(large, d=unit * large.d, r=unit * large.r, b=unit * large.b)
    tool = s.nominal.tool.copy()
    tool[:3, 3] *= unit
    big = T.copy()
    big[:, :3, 3] *= unit
    sigma = np.array([1e-4] * 3 + [2e-4] * 3)
    factor = np.array([unit] * 3 + [1.0] * 3)
    options = ({"sigma": sigma}, {"sigma": sigma * factor}) if states_noise else ({}, {})
    metres = fit(s.nominal, Pose(s.q, T, **options[0]), **ALONE)
    millimetres = fit(
        s.nominal.with_table(large).with_tool(tool), Pose(s.q, big, **options[1]),
        prior=ParameterPrior(length=unit * 1e-3), **ALONE,
    )  # fmt: skip
    assert millimetres.names == metres.names
    scale = np.where(np.array(metres.units) == "m", unit, 1.0)
    for one, other in (
        (metres.values, millimetres.values),
        (metres.standard_deviation, millimetres.standard_deviation),
    ):
        assert np.abs(one - other / scale).max() < EXACT


# --- what did not take part -----------------------------------------------------------------------


def with_row_off(measured, block, by=0.02):
    p = measured.p.copy()
    p[block, 0] += by
    return Position(measured.q, p)


def test_measurements_kept_aside_have_no_say():
    s = Scene(seed=7, count=50)
    p = s.noisy()[:, :3, 3]
    train, aside = Position(s.q[:40], p[:40]), Position(s.q[40:], p[40:])
    one = fit(s.nominal, train, held_out=aside, folds=0)
    other = fit(s.nominal, train, held_out=with_row_off(aside, 3), folds=0)
    assert np.array_equal(one.values, other.values)
    assert np.array_equal(one.standard_deviation, other.standard_deviation)
    truth = p[40:] - rm.dgm(one.model, s.q[40:])[:, :3, 3]
    assert one.held_out.after.position == pytest.approx(np.linalg.norm(truth, axis=1), abs=1e-12)
    changed = np.flatnonzero(one.held_out.after.position != other.held_out.after.position)
    assert changed.tolist() == [3]


@pytest.mark.parametrize("way", ["folds", "share"])
def test_errors_aside_are_of_fits_without_them(way):
    s = Scene(seed=8, count=50)
    measured = Position(s.q, s.noisy()[:, :3, 3])
    options = {"folds": 5, "held_out": 0} if way == "folds" else {"folds": 0, "held_out": 0.2}
    result = fit(s.nominal, measured, rng=3, **options)
    aside = result.cross_validation if way == "folds" else result.held_out
    assert sorted(aside.blocks) == list(range(50)) if way == "folds" else len(aside.blocks) == 10
    first = np.sort(aside.blocks[:10])
    near = np.arange(first[0] - 3, first[-1] + 4)  # what is next to a run resembles it
    assert np.array_equal(first, np.arange(first[0], first[0] + 10))
    kept = np.setdiff1d(np.arange(50), near)
    alone = fit(s.nominal, measured.subset(kept), **ALONE)
    gap = measured.p[first] - rm.dgm(alone.model, s.q[first])[:, :3, 3]
    found = aside.after.position[:10][np.argsort(aside.blocks[:10])]
    assert found == pytest.approx(np.linalg.norm(gap, axis=1), abs=1e-8)


def test_an_outlier_aside_does_not_reach_its_own_prediction():
    s = Scene(seed=9, count=50)
    measured = Position(s.q, s.noisy()[:, :3, 3])
    good = fit(s.nominal, measured, rng=3, folds=5, held_out=0).cross_validation
    bad = fit(s.nominal, with_row_off(measured, 17), rng=3, folds=5, held_out=0).cross_validation
    at = int(np.flatnonzero(good.blocks == 17)[0])
    fold = np.arange(10 * (at // 10), 10 * (at // 10) + 10)
    others = fold[fold != at]
    assert bad.after.position[others] == pytest.approx(good.after.position[others], abs=1e-8)
    assert bad.after.position[at] == pytest.approx(0.02, abs=1e-3)
    # and every other fold is spoilt by it
    rest = np.setdiff1d(np.arange(50), fold)
    assert bad.after.position[rest].mean() > 2.0 * good.after.position[rest].mean()


def test_errors_aside_are_larger_than_those_of_what_was_fitted():
    s = Scene(seed=10, count=25)
    result = fit(s.nominal, Pose(s.q, s.noisy()))
    inside, aside = result.after.summary("m").rms, result.cross_validation.after.summary("m").rms
    assert inside < 1.8e-4 < aside
    assert result.cross_validation.before.summary("m").rms > 1e-3
    assert result.cross_validation.folds == 5
    assert result.held_out is not None


# --- more than a table ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def heavy():
    """An arm with masses, so that it bends; its tool is off the last axis."""
    return rm.load("rx90").with_tool(rm.se3.translation(0.05, -0.03, 0.12))


def predicted(result, q):
    return differential_model(result.parameters, q, result.deviation)[0]


def test_gains_and_couplings_are_recovered(heavy):
    rng = np.random.default_rng(1)
    real = erroneous(heavy, rng)
    K = np.eye(6) + np.diag(1e-3 * rng.normal(size=6))
    K[5, 4] = 2e-3
    q, fresh = readings(heavy, rng, 80), readings(heavy, rng, 20)
    T = rm.dgm(real, q @ K.T)
    result = fit(heavy, Pose(q, T), gains=True, couplings=[(6, 5)], **ALONE)
    assert np.abs(calibrated_pose(result.robot, fresh) - rm.dgm(real, fresh @ K.T)).max() < EXACT
    found = dict(zip(result.names, result.values, strict=True))
    assert found["gain6_5"] == pytest.approx(2e-3, abs=EXACT)
    assert found["gain2"] == pytest.approx(K[1, 1] - 1.0, abs=EXACT)


def test_eccentricity_is_recovered(heavy):
    rng = np.random.default_rng(2)
    real = erroneous(heavy, rng)
    sine, cosine, sine_2, cosine_2 = 1e-3 * rng.normal(size=(4, 6))

    def actual(q):
        return (
            q + sine * np.sin(q) + cosine * np.cos(q)
            + sine_2 * np.sin(2 * q) + cosine_2 * np.cos(2 * q)
        )  # fmt: skip

    q, fresh = readings(heavy, rng, 120), readings(heavy, rng, 20)
    result = fit(heavy, Pose(q, rm.dgm(real, actual(q))), eccentricity=True, **ALONE)
    error = calibrated_pose(result.robot, fresh) - rm.dgm(real, actual(fresh))
    assert np.abs(error).max() < EXACT


def test_compliance_is_recovered(heavy):
    rng = np.random.default_rng(3)
    real = erroneous(heavy, rng)
    compliance = np.array([0.0, 2e-5, 3e-5, 2e-5, 4e-5, 1e-5])

    def actual(q):
        return q - compliance * rm.gravity_torque(heavy, q)

    q, fresh = readings(heavy, rng, 100), readings(heavy, rng, 20)
    result = fit(heavy, Pose(q, rm.dgm(real, actual(q))), compliance="joints", **ALONE)
    error = calibrated_pose(result.robot, fresh) - rm.dgm(real, actual(fresh))
    assert np.abs(error).max() < EXACT
    found = dict(zip(result.names, result.values, strict=True))
    assert found["compliance2"] == pytest.approx(2e-5, abs=EXACT)


def moments_of_gravity(model, q):
    """Moment of gravity of all that each joint carries about its origin, in its axes."""
    T, M = rm.link_poses(model, q), model.inertia.values
    weight = M[:, 9, None] * model.gravity
    centre = T[..., :3, 3] + np.einsum(
        "...ij,...j->...i", T[..., :3, :3], M[:, 6:9] / np.maximum(M[:, 9:], 1e-12)
    )
    moments = [
        np.cross(centre[..., j:, :] - T[..., j : j + 1, :3, 3], weight[j:]).sum(axis=-2)
        for j in range(model.f)
    ]
    return np.einsum("...ji,...j->...i", T[..., :3, :3], np.stack(moments, axis=-2))


def giving_way(nominal, real, q, about_x, about_y, about_z):
    """Poses of a serial arm whose joints turn a little under the moments of gravity there.

    About x and y: compliances of all joints but the last, rad/(N m); about z: of all.
    """
    moments = moments_of_gravity(nominal, q)
    poses = []
    for row, m in zip(q, moments, strict=True):
        columns = {name: getattr(real.table, name).copy() for name in ("alpha", "beta")}
        columns["alpha"][1:] += about_x * m[:-1, 0]
        columns["beta"][1:] += about_y * m[:-1, 1]
        arm = real.with_table(dataclasses.replace(real.table, **columns))
        poses.append(rm.dgm(arm, row + about_z * m[:, 2]))
    return np.array(poses)


def test_bending_of_links_is_recovered(heavy):
    # an independent arm: each configuration has a table of its own
    rng = np.random.default_rng(4)
    real = erroneous(heavy, rng)
    about_x, about_y = 1e-5 * np.abs(rng.normal(size=(2, 5)))
    about_z = 1e-5 * np.abs(rng.normal(size=6))
    # what acts like others to first order stays rigid, so that the second order is no matter
    about_x[:2] = about_y[[0, 2]] = 0.0
    q, fresh = readings(heavy, rng, 100), readings(heavy, rng, 20)

    def bent(q):
        return giving_way(heavy, real, q, about_x, about_y, about_z)

    result = fit(heavy, Pose(q, bent(q)), compliance="links", **ALONE)
    assert np.abs(predicted(result, fresh) - bent(fresh)).max() < EXACT
    rigid = fit(heavy, Pose(q, bent(q)), **ALONE)
    assert rigid.after.summary("m").rms > 1e-4


@pytest.mark.parametrize("kind", ["isotropic", "uniform"])
def test_compliance_that_is_the_same_about_all_axes_is_recovered(heavy, kind):
    rng = np.random.default_rng(5)
    real = erroneous(heavy, rng)
    give = np.array([0.0, 0.0, 3e-5, 2e-5, 1e-5, 0.0])  # joints 1 and 2 act like the mount
    if kind == "uniform":
        # the last joint's tilt is the tool's, which this arm does not have: it carries nothing
        give[:] = 2e-5
    inertia = heavy.inertia.values.copy()
    inertia[5] = 0.0
    light = heavy.with_inertia(rm.InertialParameters(inertia))
    q, fresh = readings(heavy, rng, 100), readings(heavy, rng, 20)

    def bent(q):
        return giving_way(light, real, q, give[:5], give[:5], give)

    result = fit(light, Pose(q, bent(q)), compliance=kind, **ALONE)
    assert np.abs(predicted(result, fresh) - bent(fresh)).max() < EXACT
    found = dict(zip(result.names, result.values, strict=True))
    name = "compliance3" if kind == "isotropic" else "compliance_joints"
    assert found[name] == pytest.approx(give[2], abs=EXACT)


def test_compliance_needs_masses():
    with pytest.raises(InvalidValueError, match="masses"):
        fit(
            rm.load("stanford_arm"),
            Pose(np.zeros((4, 6)), np.tile(np.eye(4), (4, 1, 1))),
            compliance="joints",
        )


# --- known, chosen, prior, truncation -------------------------------------------------------------


def test_known_parameters_stay_and_others_do_their_work(scene):
    real = scene.nominal.with_table(
        dataclasses.replace(scene.nominal.table, d=scene.nominal.table.d + np.eye(6)[2] * 1e-3)
    )
    result = fit(scene.nominal, Pose(scene.q, rm.dgm(real, scene.q)), known=["r4"], **ALONE)
    assert "r4" not in result.names
    assert len(result.names) == 29
    assert result.model.table.r[3] == scene.nominal.table.r[3]
    assert result.values[result.names.index("d3")] == pytest.approx(0.451, abs=EXACT)


def test_only_named_parameters_are_estimated(scene):
    names = ["theta2", "theta3", "d3"]
    theta = scene.nominal.table.theta + np.array([0.0, 0.002, -0.003, 0.0, 0.0, 0.0])
    real = scene.nominal.with_table(dataclasses.replace(scene.nominal.table, theta=theta))
    T = rm.dgm(real, scene.q)
    for given in (names, candidate_parameters(scene.nominal).subset(names)):
        result = fit(scene.nominal, Pose(scene.q, T), parameters=given, **ALONE)
        assert result.names == ("theta2", "theta3", "d3")
        assert result.deviation == pytest.approx([0.002, -0.003, 0.0], abs=EXACT)
        assert np.array_equal(result.model.tool, scene.nominal.tool)


def test_an_unknown_name_is_told_with_its_neighbours(scene):
    with pytest.raises(InvalidValueError, match=r"'theta9'.*near it: theta"):
        fit(scene.nominal, Pose(scene.q, scene.T), parameters=["theta9"])
    with pytest.raises(InvalidValueError, match="known"):
        fit(scene.nominal, Pose(scene.q, scene.T), known=["alpha77"])
    with pytest.raises(InvalidValueError, match="alpha77"):
        fit(scene.nominal, Pose(scene.q, scene.T), prior=ParameterPrior(named={"alpha77": 1.0}))


def test_a_prior_pulls_to_the_nominal_robot_where_data_say_little():
    s = Scene(seed=11, count=9, length=2e-4, angle=4e-4)
    measured = Pose(s.q, s.noisy(length=5e-4, angle=1e-3))
    plain = fit(s.nominal, measured, prior=None, **ALONE)
    prior = ParameterPrior(length=2e-4, angle=4e-4)
    pulled = fit(s.nominal, measured, prior=prior, **ALONE)
    real = rm.dgm(s.real, s.fresh)
    error = [
        np.linalg.norm((rm.dgm(r.model, s.fresh) - real)[:, :3, 3], axis=1).mean()
        for r in (plain, pulled)
    ]
    assert error[1] < 0.7 * error[0]
    assert pulled.after.summary("m").rms > plain.after.summary("m").rms
    tight = fit(s.nominal, measured, prior=ParameterPrior(1e-12, 1e-12), **ALONE)
    of_table = [k for k, e in enumerate(tight.parameters.entries) if 0 < e.row <= 6]
    assert np.abs(tight.deviation[of_table]).max() < 1e-9


def test_the_strength_of_a_prior_follows_the_data():
    # a prior that is ten times too narrow is weakened where there are many data
    s = Scene(seed=12, count=120)
    narrow = ParameterPrior(length=1e-5, angle=2e-5, strength=None)
    result = fit(s.nominal, Pose(s.q, s.noisy()), prior=narrow, **ALONE)
    error = rm.dgm(result.model, s.fresh) - rm.dgm(s.real, s.fresh)
    stuck = fit(s.nominal, Pose(s.q, s.noisy()),
                prior=dataclasses.replace(narrow, strength=1e4), **ALONE)  # fmt: skip
    kept = rm.dgm(stuck.model, s.fresh) - rm.dgm(s.real, s.fresh)
    assert np.abs(error[:, :3, 3]).max() < 4e-4
    assert np.abs(kept[:, :3, 3]).max() > 1e-3


def test_truncation_leaves_out_what_is_hardly_seen():
    s = Scene(seed=13, count=40)
    q = s.q.copy()
    q[:, 4] = 0.3 + 1e-3 * s.rng.normal(size=len(q))  # joint 5 hardly moves
    T = rm.dgm(s.real, q)
    T[:, :3, 3] += 1e-4 * s.rng.normal(size=(len(q), 3))
    seen = Position(q, T[:, :3, 3])
    cut = fit(s.nominal, seen, truncation=1e-3, prior=None, **ALONE)
    assert cut.solution.fit.rank == len(cut.names) - 4
    assert np.abs(cut.deviation).max() < 0.01
    # without it, as many parameters stay where they are by name
    named = fit(s.nominal, seen, prior=None, **ALONE)
    assert len(named.identifiable.of_reason(Reason.NOISE)) == 4


# --- mistakes -------------------------------------------------------------------------------------


def test_contacts_without_a_length_cannot_shrink_the_robot(contacts):
    s, _, q, labels = contacts
    with pytest.raises(InvalidValueError, match=r"know no length.*known_lengths"):
        fit(s.nominal, PointContact(q, labels))
    # a length that is zero is no length, and neither is an angle
    for name in ("r1", "alpha3", "b0"):
        with pytest.raises(InvalidValueError, match="know no length"):
            fit(s.nominal, PointContact(q, labels), known_lengths=[name])


def test_a_wrong_length_scales_the_robot_and_no_more(contacts):
    s, points, q, labels = contacts
    apart = np.linalg.norm(points[0] - points[1])
    wrong = KnownDistance("point:0", "point:1", 1.01 * apart)
    long = fit(s.nominal, [PointContact(q, labels), wrong], prior=None, **ALONE)
    assert long.model.table.r[3] == pytest.approx(1.01 * s.real.table.r[3], rel=1e-9)


def test_too_few_configurations_are_counted(scene):
    with pytest.raises(InvalidValueError, match=r"at least \d+ more configurations"):
        fit(scene.nominal, Pose(scene.q[:5], scene.T[:5]))
    with pytest.raises(InvalidValueError, match="more configurations"):
        fit(scene.nominal, Position(scene.q[:9], scene.T[:9, :3, 3]))


def test_a_joint_that_does_not_move_is_named(scene):
    q = scene.q.copy()
    q[:, 2] = 0.7
    result = fit(scene.nominal, Pose(q, rm.dgm(scene.real, q)), **ALONE)
    assert any("Joint 3" in note for note in result.notes)
    assert result.identifiable.count < 30
    fresh = scene.fresh.copy()
    fresh[:, 2] = 0.7
    assert np.abs(rm.dgm(result.model, fresh) - rm.dgm(scene.real, fresh)).max() < EXACT


def test_repeated_rows_are_named(scene):
    twice = np.r_[np.arange(60), [3, 3, 7]]
    result = fit(scene.nominal, Pose(scene.q[twice], scene.T[twice]), **ALONE)
    assert any("3 of 63 rows repeat" in note for note in result.notes)
    assert not fit(scene.nominal, Pose(scene.q, scene.T), **ALONE).notes


def test_not_a_number_is_refused(scene):
    q = scene.q.copy()
    q[4, 2] = np.nan
    with pytest.raises(InvalidValueError, match="q"):
        Pose(q, scene.T)
    p = scene.T[:, :3, 3].copy()
    p[7, 0] = np.inf
    with pytest.raises(InvalidValueError, match="p"):
        Position(scene.q, p)


def test_degrees_and_millimetres_are_recognised(scene):
    p = scene.T[:, :3, 3]
    with pytest.raises(InvalidValueError, match="degrees"):
        fit(scene.nominal, Position(np.rad2deg(scene.q), p))
    with pytest.raises(InvalidValueError, match="millimetres"):
        fit(scene.nominal, Position(scene.q, 1000.0 * p))
    T = scene.T.copy()
    T[:, :3, 3] *= 1000.0
    with pytest.raises(InvalidValueError, match="millimetres"):
        fit(scene.nominal, Pose(scene.q, T))


def test_residuals_far_beyond_the_stated_noise_are_named():
    s = Scene(seed=14, count=60)
    result = fit(s.nominal, Position(s.q, s.noisy(length=1e-3)[:, :3, 3], sigma=1e-6), **ALONE)
    assert any("times the stated standard deviations" in note for note in result.notes)


def test_readings_of_another_robot_are_refused(scene):
    with pytest.raises(ShapeError, match="6 joints"):
        fit(scene.nominal, Position(np.zeros((4, 7)), np.zeros((4, 3))))
    with pytest.raises(InvalidValueError, match="expected one or more"):
        fit(scene.nominal, [])


def test_what_is_no_measurement_is_refused(scene):
    measured = Pose(scene.q, scene.T)
    with pytest.raises(InvalidValueError, match="Pose, Position"):
        fit(scene.nominal, [scene.T])
    with pytest.raises(InvalidValueError, match="held_out"):
        fit(scene.nominal, measured, held_out=scene.T)
    with pytest.raises(InvalidValueError, match="held_out"):
        fit(scene.nominal, measured, held_out=1.5)
    with pytest.raises(InvalidValueError, match="folds"):
        fit(scene.nominal, measured, folds=1)


def test_readings_that_do_not_belong_to_their_measurements_are_named(scene):
    # no noise is stated, so that only its size tells
    mixed = scene.q[np.random.default_rng(0).permutation(60)]
    result = fit(scene.nominal, Pose(mixed, scene.T), **ALONE)
    assert any("belong" in note for note in result.notes)


def test_results_pickle(contacts):
    s, points, q, labels = contacts
    apart = np.linalg.norm(points[0] - points[1])
    result = fit(s.nominal, [PointContact(q, labels), KnownDistance("point:0", "point:1", apart)])
    again = pickle.loads(pickle.dumps(result))
    assert again.names == result.names
    assert np.array_equal(again.values, result.values)
    assert np.array_equal(again.covariance, result.covariance)
    assert again.fixtures == result.fixtures
    assert not again.solution.fit.x.flags.writeable
    assert np.array_equal(rm.dgm(again.model, s.fresh), rm.dgm(result.model, s.fresh))


def test_progress_is_told(scene):
    said = []
    fit(scene.nominal, Pose(scene.q, scene.T), folds=3, progress=lambda *x: said.append(x))
    assert [done for done, _, _ in said] == [1, 2, 3, 4, 5]
    assert {total for _, total, _ in said} == {5}


def test_what_noise_hides_stays_as_it_is():
    """The wrist of an arm whose target is its centre: a tool moved by noise tells nothing of it."""
    arm = rm.load("rx90")
    q = np.random.default_rng(1).uniform(-2, 2, (60, 6))
    seen = rm.dgm(arm, q)[:, :3, 3] + 5e-5 * np.random.default_rng(2).normal(size=(60, 3))
    hidden = {"theta4", "theta5", "alpha5", "alpha6"}
    with_prior, without = (fit(arm, Position(q, seen), prior=p, **ALONE)
                           for p in (ParameterPrior(), None))  # fmt: skip
    assert hidden <= set(without.identifiable.of_reason(Reason.NOISE))
    assert hidden <= set(with_prior.names)
    for result in (with_prior, without):
        turned = rm.dgm(result.model, q)[:, :3, :3].swapaxes(1, 2) @ rm.dgm(arm, q)[:, :3, :3]
        assert np.trace(turned, axis1=1, axis2=2).min() > 1 + 2 * np.cos(2e-3)


def test_no_gain_on_data_kept_aside_is_told():
    arm = rm.load("rx90")
    rng = np.random.default_rng(3)
    q = rng.uniform(-2, 2, (14, 6))
    T = rm.dgm(arm, q)
    T[:, :3, 3] += 2e-3 * rng.normal(size=(14, 3))  # noise alone
    result = fit(arm, Pose(q, T))
    assert any("does not lower the position error" in note for note in result.notes)


def test_joint_offsets_of_a_result_count_what_was_measured():
    arm = rm.load("rx90")
    candidates = candidate_parameters(arm)
    xi = 1e-3 * np.random.default_rng(5).normal(size=len(candidates))
    q = np.random.default_rng(6).uniform(-2, 2, (60, 6))
    seen = differential_model(candidates, q, xi).T[:, :3, 3]
    result = fit(arm, Position(q, seen), **ALONE)
    assert result.measured_mask == (1, 1, 1, 0, 0, 0)
    found = joint_offsets(result, q)
    assert np.array_equal(
        found.offset, joint_offsets(result.robot, q, mask=[1, 1, 1, 0, 0, 0]).offset
    )


def test_a_result_prints_one_line(scene):
    result = fit(scene.nominal, Pose(scene.q, scene.T), **ALONE)
    assert "\n" not in repr(result)
    assert len(repr(result)) < 300
    assert len(repr(result.parameters)) < 500

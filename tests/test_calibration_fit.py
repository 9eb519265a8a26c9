"""Calibration end to end: known truths are recovered, statistics hold, mistakes are named."""

import dataclasses
import pickle

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.calibration import (
    AxisPosition,
    CameraPose,
    Distance,
    FrameContact,
    KnownDistance,
    LaserLine,
    ParameterPrior,
    PlaneContact,
    PointContact,
    Pose,
    Position,
    Reason,
    RelativePose,
    calibrated_pose,
    candidate_parameters,
    differential_model,
    fit,
    joint_offsets,
)
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.estimation import FitStatus, confidence_intervals

ALONE = {"folds": 0, "held_out": 0}
"""A fit without its fits on part of the data."""
EXACT = 1e-9


def erroneous(model, rng, length=1e-3, angle=2e-3, keep=()):
    """A robot with errors everywhere in its table."""
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
    """Random readings within the limits, where there are some."""
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


class Scene:
    """An RX-90 with a tool off its last axis, the real one with errors, and readings."""

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

    @property
    def p(self):
        return self.T[:, :3, 3]

    def noisy(self, length=1e-4, angle=2e-4):
        """Poses with noise."""
        T = self.T.copy()
        T[:, :3, 3] += length * self.rng.normal(size=(len(T), 3))
        turns = np.array([rm.se3.from_rpy(x) for x in angle * self.rng.normal(size=(len(T), 3))])
        T[:, :3, :3] = turns[:, :3, :3] @ T[:, :3, :3]
        return T

    def gap(self, model):
        return rm.dgm(model, self.fresh) - rm.dgm(self.real, self.fresh)


@pytest.fixture(scope="module")
def scene():
    return Scene()


POINTS = np.array([[0.5, 0.1, 0.1], [0.1, -0.45, 0.3], [0.4, -0.3, 0.35]])


@pytest.fixture(scope="module")
def contacts():
    """The robot touches three points; the length r4 is right."""
    s = Scene(seed=3, keep=[("r", 4)])
    return s, *touching(s.real, POINTS, 20, s.rng)


# --- exact measurements, by every method, determine what they can ---------------------------------


def pose_error(s, model):
    return np.abs(s.gap(model)).max()


def position_error(s, model):
    return np.abs(s.gap(model)[:, :3, 3]).max()


def height_error(s, model):
    return np.abs(s.gap(model)[:, 2, 3]).max()


def angle_error(s, model):
    return np.abs(s.gap(model)[:, :3, :3]).max()


def step_error(s, model):
    """Largest error of the steps between successive poses, which do not depend on the base."""
    T, real = rm.dgm(model, s.fresh), rm.dgm(s.real, s.fresh)
    return np.abs(rm.se3.inverse(T[:-1]) @ T[1:] - rm.se3.inverse(real[:-1]) @ real[1:]).max()


def shape_error(s, model):
    """Largest distance of two robots' positions, where one may stand anywhere."""
    p, goal = (rm.dgm(x, s.fresh)[:, :3, 3] for x in (model, s.real))
    apart = [np.linalg.norm(x[:, None] - x[None], axis=2) for x in (p, goal)]
    return np.abs(apart[0] - apart[1]).max()


PIVOTS = np.array([[1.5, 0.2, -0.5], [-0.4, 1.6, 0.3], [0.1, -1.2, 1.4]])
LABEL = np.arange(60) % 3
EXPECTED = {
    "pose": (30, pose_error), "position": (27, position_error), "height": (None, height_error),
    "orientation": (None, angle_error), "pair": (None, shape_error), "pivot": (None, shape_error),
    "known pivot": (27, position_error), "steps": (24, step_error), "camera": (None, step_error),
}  # fmt: skip


def seen(kind, s):
    """Exact measurements of a kind."""
    far = np.linalg.norm(s.p - PIVOTS[LABEL], axis=1)
    known = dict(enumerate(PIVOTS))
    target = rm.se3.from_rpy([0.3, -0.4, 1.0], [0.8, 0.1, -0.2])
    apart = np.linalg.norm(s.p - np.roll(s.p, 1, axis=0), axis=1)
    return {
        "pose": lambda: Pose(s.q, s.T), "position": lambda: Position(s.q, s.p),
        "height": lambda: Pose(s.q, s.T, rows=[0, 0, 1, 0, 0, 0]),
        "orientation": lambda: Pose(s.q, s.T, rows=[0, 0, 0, 1, 1, 1]),
        "pair": lambda: Distance(s.q, apart, q_other=np.roll(s.q, 1, axis=0)),
        "pivot": lambda: Distance(s.q, far, pivot=LABEL),
        "known pivot": lambda: Distance(s.q, far, pivot=LABEL, known=known),
        "steps": lambda: RelativePose.successive(s.q, rm.se3.inverse(s.T[:-1]) @ s.T[1:]),
        "camera": lambda: CameraPose(s.q, rm.se3.inverse(s.T) @ target),
    }[kind]()  # fmt: skip


@pytest.mark.parametrize("kind", EXPECTED)
def test_exact_measurements_determine_the_robot(scene, kind):
    result = fit(scene.nominal, seen(kind, scene), **ALONE)
    count, error = EXPECTED[kind]
    assert result.status is FitStatus.CONVERGED
    assert count is None or len(result.names) == count
    assert error(scene, result.model) < EXACT
    assert set(result.units) == ({"rad"} if kind == "orientation" else {"m", "rad"})
    errors = result.validation
    assert errors.folds is errors.held_out is None
    assert max(errors.in_sample.max.values()) < EXACT < max(errors.given.rms.values())


def test_contacts_with_a_known_length_determine_the_shape(contacts):
    s, q, labels = contacts
    apart = np.linalg.norm(POINTS[0] - POINTS[1])
    known = KnownDistance("point:0", "point:1", apart, sigma=1e-9)
    result = fit(s.nominal, [PointContact(q, labels), known], **ALONE)
    assert len(result.names) == 21  # 27 less the six of a base that nobody sees
    assert shape_error(s, result.model) < EXACT
    found = np.array([[result.fixtures[f"point:{k}.{a}"] for a in "xyz"] for k in range(3)])
    between = np.linalg.norm(found[[0, 1, 0]] - found[[1, 2, 2]], axis=1)
    assert between == pytest.approx(np.linalg.norm(POINTS[[0, 1, 0]] - POINTS[[1, 2, 2]], axis=1))
    result = fit(s.nominal, PointContact(q, labels), known_lengths=["r4"], **ALONE)
    assert shape_error(s, result.model) < EXACT
    assert result.known == ("r4",)
    assert "r4" not in result.names
    known = PointContact(q, labels, known=dict(enumerate(POINTS)))
    assert position_error(s, fit(s.nominal, known, **ALONE).model) < EXACT
    wrong = KnownDistance("point:0", "point:1", 1.01 * apart)
    long = fit(s.nominal, [PointContact(q, labels), wrong], prior=None, **ALONE)
    assert long.model.table.r[3] == pytest.approx(1.01 * s.real.table.r[3], rel=1e-9)
    with pytest.raises(InvalidValueError, match=r"contain no length.*known_lengths"):
        fit(s.nominal, PointContact(q, labels))
    for name in ("r1", "alpha3", "b0"):  # zero is no length, and neither is an angle
        with pytest.raises(InvalidValueError, match="contain no length"):
            fit(s.nominal, PointContact(q, labels), known_lengths=[name])


def test_planes_lines_and_configurations_of_one_pose_determine_the_shape(contacts):
    s, *_ = contacts
    normals = np.array([[0.0, 0.0, 1.0], [0.8, 0.0, 0.6], [0.0, 0.8, 0.6], [-0.6, -0.48, 0.64]])
    offsets, label = np.array([0.1, 0.2, 0.15, 0.1]), np.arange(120) % 4
    n, x = normals[label], s.rng.uniform(-0.45, 0.45, (120, 3))
    there = x + (offsets[label] - (n * x).sum(axis=1))[:, None] * n
    planes = PlaneContact(reaching(s.real, there, s.rng), label)
    assert shape_error(s, fit(s.nominal, planes, known_lengths=["r4"], **ALONE).model) < 1e-8
    at = np.array([[0.4, 0.1, 0.0], [0.1, 0.4, 0.2], [-0.3, 0.1, 0.3]])
    along = np.array([[0.0, 0.6, 0.8], [0.8, 0.0, 0.6], [0.0, 1.0, 0.0]])
    there = at[LABEL] + s.rng.uniform(-0.3, 0.3, (60, 1)) * along[LABEL]
    known = {k: [at[k], along[k]] for k in range(3)}
    lines = LaserLine(reaching(s.real, there, s.rng), LABEL, known=known)
    gauge = AxisPosition(s.q, s.p @ along[0], along[0])
    assert position_error(s, fit(s.nominal, [lines, gauge], **ALONE).model) < EXACT
    found = rm.igm(s.real, rm.dgm(s.real, readings(s.nominal, s.rng, 12)))
    q, label = found.q[found.valid], np.nonzero(found.valid)[0]
    result = fit(s.nominal, FrameContact(q, label), known_lengths=["r4"], **ALONE)
    for k in np.unique(label):  # the calibrated robot brings each to one pose
        assert np.abs(np.ptp(rm.dgm(result.model, q[label == k]), axis=0)).max() < EXACT


def test_kinds_and_ends_mix_in_one_fit(contacts):
    s, q, labels = contacts
    elbow = rm.dgm(s.real, s.q[:20], frame=4)[:, :3, 3]
    measured = [
        PointContact(q, labels), Position(s.q[:10], s.p[:10]), Pose(s.q[10:14], s.T[10:14]),
        Pose(s.q[14:20], s.T[14:20], rows=[0, 0, 1, 0, 0, 0], name="height"),
        Position(s.q[:20], elbow, frame=4, name="elbow"),
    ]  # fmt: skip
    result = fit(s.nominal, measured, **ALONE)
    assert pose_error(s, result.model) < EXACT
    found = calibrated_pose(result.robot, s.fresh, frame=4)[:, :3, 3]
    assert np.abs(found - rm.dgm(s.real, s.fresh, frame=4)[:, :3, 3]).max() < EXACT


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


@pytest.mark.parametrize("kind", ["pose", "position"])
def test_a_base_far_away_and_an_unknown_tool_are_found(scene, kind):
    away = rm.se3.from_rpy([0.3, -0.2, 2.5], [3.0, -1.0, 0.7])
    real = scene.real.with_base(away)
    T = rm.dgm(real, scene.q)
    nominal = scene.nominal.with_tool(np.eye(4)) if kind == "pose" else scene.nominal
    measured = Pose(scene.q, T) if kind == "pose" else Position(scene.q, T[:, :3, 3])
    result = fit(nominal, measured, **ALONE)
    error = rm.dgm(result.model, scene.fresh) - rm.dgm(real, scene.fresh)
    assert np.abs(error[:, :3, 3]).max() < EXACT
    assert result.validation.given.mean["m"] > 1.0
    assert result.validation.nominal.mean["m"] < 0.02  # errors of the table alone


# --- more than a table ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def heavy():
    """An arm with masses, so that it bends; its tool is off the last axis."""
    return rm.load("rx90").with_tool(rm.se3.translation(0.05, -0.03, 0.12))


@pytest.mark.parametrize("law", ["gains", "eccentricity", "compliance"])
def test_errors_of_the_joints_are_recovered(heavy, law):
    rng = np.random.default_rng(1)
    real = erroneous(heavy, rng)
    K = np.eye(6) + np.diag(1e-3 * rng.normal(size=6))
    K[5, 4] = 2e-3
    waves = 1e-3 * rng.normal(size=(4, 6))
    give = np.array([0.0, 2e-5, 3e-5, 2e-5, 4e-5, 1e-5])
    actual, options = {
        "gains": (lambda q: q @ K.T, {"gains": True, "couplings": [(6, 5)]}),
        "eccentricity": (
            lambda q: q + waves[0] * np.sin(q) + waves[1] * np.cos(q)
            + waves[2] * np.sin(2 * q) + waves[3] * np.cos(2 * q), {"eccentricity": True}),
        "compliance": (
            lambda q: q - give * rm.gravity_torque(heavy, q), {"compliance": "joints"}),
    }[law]  # fmt: skip
    q, fresh = readings(heavy, rng, 120), readings(heavy, rng, 20)
    result = fit(heavy, Pose(q, rm.dgm(real, actual(q))), **options, **ALONE)
    error = calibrated_pose(result.robot, fresh) - rm.dgm(real, actual(fresh))
    assert np.abs(error).max() < EXACT
    if law == "gains":
        assert result.value("gain6_5") == pytest.approx(2e-3, abs=EXACT)
        assert result.value("gain2") == pytest.approx(K[1, 1] - 1.0, abs=EXACT)
    if law == "compliance":
        assert result.value("compliance2") == pytest.approx(2e-5, abs=EXACT)


def giving_way(nominal, real, q, about_x, about_y, about_z):
    """Poses of a serial arm whose joints turn a little under the moments of gravity there.

    About x and y: compliances of all joints but the last, rad/(N m); about z: of all.
    """
    T, M = rm.link_poses(nominal, q), nominal.inertia.values
    centre = M[:, 6:9] / np.maximum(M[:, 9:], 1e-12)
    centre = T[..., :3, 3] + np.einsum("...ij,...j->...i", T[..., :3, :3], centre)
    weight, poses = M[:, 9, None] * nominal.gravity, []
    arms = [centre[:, j:] - T[:, j : j + 1, :3, 3] for j in range(nominal.f)]
    moments = np.stack([np.cross(a, weight[j:]).sum(axis=-2) for j, a in enumerate(arms)], axis=-2)
    moments = np.einsum("...ji,...j->...i", T[..., :3, :3], moments)
    for row, m in zip(q, moments, strict=True):
        columns = {name: getattr(real.table, name).copy() for name in ("alpha", "beta")}
        columns["alpha"][1:] += about_x * m[:-1, 0]
        columns["beta"][1:] += about_y * m[:-1, 1]
        arm = real.with_table(dataclasses.replace(real.table, **columns))
        poses.append(rm.dgm(arm, row + about_z * m[:, 2]))
    return np.array(poses)


@pytest.mark.parametrize("kind", ["links", "isotropic", "uniform"])
def test_bending_under_gravity_is_recovered(heavy, kind):
    # an independent arm: each configuration has a table of its own
    rng = np.random.default_rng(4)
    real = erroneous(heavy, rng)
    give = np.full(6, 2e-5)
    about_x, about_y, about_z = give[:5], give[:5], give
    if kind == "links":
        about_x, about_y = 1e-5 * np.abs(rng.normal(size=(2, 5)))
        # what acts like others to first order stays rigid, so that the second order is no matter
        about_x[:2] = about_y[[0, 2]] = 0.0
    else:  # the last joint's tilt is the tool's, which this arm does not have: it carries nothing
        inertia = heavy.inertia.values.copy()
        inertia[5] = 0.0
        heavy = heavy.with_inertia(rm.InertialParameters(inertia))
        if kind == "isotropic":
            give[[0, 1, 5]] = 0.0  # joints 1 and 2 act like the mount
    q, fresh = readings(heavy, rng, 80), readings(heavy, rng, 20)
    T = giving_way(heavy, real, q, about_x, about_y, about_z)
    result = fit(heavy, Pose(q, T), compliance=kind, **ALONE)
    predicted = differential_model(result.parameters, fresh, result.corrections)[0]
    wanted = giving_way(heavy, real, fresh, about_x, about_y, about_z)
    assert np.abs(predicted - wanted).max() < EXACT
    if kind != "links":
        name = "compliance3" if kind == "isotropic" else "compliance_joints"
        assert result.value(name) == pytest.approx(2e-5, abs=EXACT)


# --- statistics -----------------------------------------------------------------------------------


@pytest.mark.parametrize("states_noise", [True, False])
@pytest.mark.nightly
def test_truth_is_inside_its_interval_as_often_as_stated(states_noise):
    rng = np.random.default_rng(5)
    nominal = rm.load("planar_3r")
    names = ["theta1", "d2", "theta2", "d3", "theta3"]
    candidates = candidate_parameters(nominal, base=False, tool=False).subset(names)
    inside = []
    for _ in range(150):
        change = np.array([2e-3, 1e-3, 2e-3, 1e-3, 2e-3]) * rng.normal(size=5)
        d, theta = nominal.table.d.copy(), nominal.table.theta.copy()
        theta += change[[0, 2, 4]]
        d[1:] += change[[1, 3]]
        real = nominal.with_table(dataclasses.replace(nominal.table, d=d, theta=theta))
        q = rng.uniform(-2.0, 2.0, (8, 3))
        p = rm.dgm(real, q)[:, :3, 3] + 3e-4 * rng.normal(size=(8, 3))
        measured = Position(q, p, sigma=3e-4 if states_noise else None)
        result = fit(nominal, measured, parameters=candidates, **ALONE)
        truth = change[[names.index(name) for name in result.names]]
        assert len(truth) == 5
        low, high = confidence_intervals(result.solution.fit)[:5].T
        inside.append((low <= truth) & (truth <= high))
    assert 0.92 < np.mean(inside) < 0.975


def test_noise_of_lengths_and_of_angles_is_estimated():
    s = Scene(seed=2, count=300)
    scale = fit(s.nominal, Pose(s.q, s.noisy(3e-4, 1e-4)), **ALONE).solution.scales[0]
    assert scale[:3] == pytest.approx(3e-4, rel=0.1)
    assert scale[3:] == pytest.approx(1e-4, rel=0.1)


def test_outliers_do_not_move_a_robust_fit():
    s = Scene(seed=4, count=150)
    p = s.noisy()[:, :3, 3]
    clean = fit(s.nominal, Position(s.q, p), loss="tukey", **ALONE)
    bad, turn = s.rng.choice(150, 15, replace=False), s.rng.normal(size=(15, 3))
    p[bad] += 0.02 * turn / np.linalg.norm(turn, axis=1, keepdims=True)
    robust, plain = (fit(s.nominal, Position(s.q, p), loss=x, **ALONE) for x in ("tukey", None))
    moved = [np.abs(r.values - clean.values) / clean.standard_errors for r in (robust, plain)]
    assert moved[0].max() < 1.0
    assert moved[1].max() > 5.0
    assert set(bad) <= set(robust.solution.fit.outliers)


@pytest.mark.parametrize("states_noise", [True, False])
def test_millimetres_and_metres_give_the_same_answer(states_noise):
    s = Scene(seed=6, count=40)
    T, unit = s.noisy(), 1000.0
    table, tool, big = s.nominal.table, s.nominal.tool.copy(), T.copy()
    large = dataclasses.replace(table, d=unit * table.d, r=unit * table.r, b=unit * table.b)
    tool[:3, 3] *= unit
    big[:, :3, 3] *= unit
    sigma = np.array([1e-4] * 3 + [2e-4] * 3)
    noise = [sigma, sigma * ([unit] * 3 + [1.0] * 3)] if states_noise else [None, None]
    metres = fit(s.nominal, Pose(s.q, T, sigma=noise[0]), **ALONE)
    millimetres = fit(
        s.nominal.with_table(large).with_tool(tool), Pose(s.q, big, sigma=noise[1]),
        prior=ParameterPrior(length=unit * 1e-3), **ALONE,
    )  # fmt: skip
    assert millimetres.names == metres.names
    scale = np.where(np.array(metres.units) == "m", unit, 1.0)
    assert np.abs(metres.values - millimetres.values / scale).max() < EXACT
    assert np.abs(metres.standard_errors - millimetres.standard_errors / scale).max() < EXACT


# --- data held out --------------------------------------------------------------------------------


def with_row_off(measured, block, by=0.02):
    p = measured.p.copy()
    p[block, 0] += by
    return Position(measured.q, p)


def test_held_out_measurements_have_no_effect():
    s = Scene(seed=7, count=50)
    p = s.noisy()[:, :3, 3]
    train, test = Position(s.q[:40], p[:40]), Position(s.q[40:], p[40:])
    one = fit(s.nominal, train, held_out=test, folds=0)
    other = fit(s.nominal, train, held_out=with_row_off(test, 3), folds=0)
    assert np.array_equal(one.values, other.values)
    truth = p[40:] - rm.dgm(one.model, s.q[40:])[:, :3, 3]
    here, there = (r.validation.held_out.position for r in (one, other))
    assert here == pytest.approx(np.linalg.norm(truth, axis=1), abs=1e-12)
    assert np.flatnonzero(here != there).tolist() == [3]


@pytest.mark.parametrize("way", ["folds", "share"])
def test_errors_held_out_are_of_fits_without_them(way):
    s = Scene(seed=8, count=50)
    measured = Position(s.q, s.noisy()[:, :3, 3])
    options = {"folds": 5, "held_out": 0} if way == "folds" else {"folds": 0, "held_out": 0.2}
    validation = fit(s.nominal, measured, rng=3, **options).validation
    errors = validation.folds if way == "folds" else validation.held_out
    assert sorted(errors.blocks) == list(range(50)) if way == "folds" else len(errors.blocks) == 10
    first = np.sort(errors.blocks[:10])
    near = np.arange(first[0] - 3, first[-1] + 4)  # what is next to a run resembles it
    assert np.array_equal(first, np.arange(first[0], first[0] + 10))
    alone = fit(s.nominal, measured.subset(np.setdiff1d(np.arange(50), near)), **ALONE)
    gap = measured.p[first] - rm.dgm(alone.model, s.q[first])[:, :3, 3]
    found = errors.position[:10][np.argsort(errors.blocks[:10])]
    assert found == pytest.approx(np.linalg.norm(gap, axis=1), abs=1e-8)
    assert validation.in_sample.rms["m"] < errors.rms["m"] < errors.nominal.rms["m"]


# --- known, chosen, prior, truncation -------------------------------------------------------------


def test_known_and_chosen_parameters(scene):
    table = scene.nominal.table
    theta = table.theta + np.array([0.0, 0.002, -0.003, 0.0, 0.0, 0.0])
    T = rm.dgm(scene.nominal.with_table(dataclasses.replace(table, theta=theta)), scene.q)
    names = ("theta2", "theta3", "d3")
    for given in (names, candidate_parameters(scene.nominal).subset(names)):
        result = fit(scene.nominal, Pose(scene.q, T), parameters=given, **ALONE)
        assert result.names == names
        assert result.corrections == pytest.approx([0.002, -0.003, 0.0], abs=EXACT)
        assert result.value("d3") == pytest.approx(0.45, abs=EXACT)
        assert result.standard_error("d3") == result.standard_errors[2]
    known = fit(scene.nominal, Pose(scene.q, T), known=["r4"], **ALONE)
    assert len(known.names) == 29
    assert known.model.table.r[3] == table.r[3]
    with pytest.raises(InvalidValueError, match=r"'theta1' was not estimated; near it: theta"):
        result.value("theta1")
    for options in ({"parameters": ["theta9"]}, {"known": ["theta9"]},
                    {"prior": ParameterPrior(named={"theta9": 1.0})}):  # fmt: skip
        with pytest.raises(InvalidValueError, match=r"theta9.*near it: theta"):
            fit(scene.nominal, Pose(scene.q, scene.T), **options)


def test_a_prior_pulls_to_the_nominal_robot_where_data_are_few():
    s = Scene(seed=11, count=9, length=2e-4, angle=4e-4)
    measured = Pose(s.q, s.noisy(length=5e-4, angle=1e-3))
    priors = None, ParameterPrior(2e-4, 4e-4), ParameterPrior(1e-12, 1e-12)
    plain, pulled, tight = (fit(s.nominal, measured, prior=p, **ALONE) for p in priors)
    error = [np.linalg.norm(s.gap(r.model)[:, :3, 3], axis=1).mean() for r in (plain, pulled)]
    assert error[1] < 0.7 * error[0]
    assert pulled.validation.in_sample.rms["m"] > plain.validation.in_sample.rms["m"]
    of_table = [k for k, e in enumerate(tight.parameters.entries) if 0 < e.row <= 6]
    assert np.abs(tight.corrections[of_table]).max() < 1e-9


@pytest.mark.nightly
def test_the_strength_of_a_prior_follows_the_data():
    # a prior that is ten times too narrow is weakened where there are many data
    s = Scene(seed=12, count=60)
    measured, narrow = Pose(s.q, s.noisy()), ParameterPrior(length=1e-5, angle=2e-5, strength=None)
    stuck = fit(s.nominal, measured, prior=dataclasses.replace(narrow, strength=1e4), **ALONE)
    result = fit(s.nominal, measured, prior=narrow, **ALONE)
    assert result.solution.fit.prior.strength < 0.1
    assert position_error(s, result.model) < 4e-4
    assert position_error(s, stuck.model) > 1e-3


def test_truncation_leaves_out_directions_without_effect():
    s = Scene(seed=13, count=40)
    q = s.q.copy()
    q[:, 4] = 0.3 + 1e-3 * s.rng.normal(size=len(q))  # joint 5 hardly moves
    p = rm.dgm(s.real, q)[:, :3, 3] + 1e-4 * s.rng.normal(size=(len(q), 3))
    cut = fit(s.nominal, Position(q, p), truncation=1e-3, prior=None, **ALONE)
    assert cut.solution.fit.rank == len(cut.names) - 4
    assert np.abs(cut.corrections).max() < 0.01
    # without it, as many parameters stay nominal by name
    named = fit(s.nominal, Position(q, p), prior=None, **ALONE)
    assert len(named.identifiable.of_reason(Reason.NOISE)) == 4


def test_parameters_that_noise_hides_stay_nominal():
    """The wrist of an arm whose target is its centre: a tool moved by noise is no information."""
    arm = rm.load("rx90")
    q = np.random.default_rng(1).uniform(-2, 2, (60, 6))
    p = rm.dgm(arm, q)[:, :3, 3] + 5e-5 * np.random.default_rng(2).normal(size=(60, 3))
    hidden = {"theta4", "theta5", "alpha5", "alpha6"}
    with_prior, without = (fit(arm, Position(q, p), prior=x, **ALONE)
                           for x in (ParameterPrior(), None))  # fmt: skip
    assert hidden <= set(without.identifiable.of_reason(Reason.NOISE))
    assert hidden <= set(with_prior.names)
    for result in (with_prior, without):
        turned = rm.dgm(result.model, q)[:, :3, :3].swapaxes(1, 2) @ rm.dgm(arm, q)[:, :3, :3]
        assert np.trace(turned, axis1=1, axis2=2).min() > 1 + 2 * np.cos(2e-3)


# --- mistakes and notes ---------------------------------------------------------------------------


def test_mistakes_are_named(scene):
    measured, nan = Pose(scene.q, scene.T), scene.q.copy()
    nan[4, 2] = np.nan
    T = scene.T.copy()
    T[:, :3, 3] *= 1000.0
    still, T_still = (np.repeat(x[:1], 12, axis=0) for x in (scene.q, scene.T))
    for error, match, call in (
        (InvalidValueError, "masses", lambda: fit(
            rm.load("stanford_arm"), Pose(np.zeros((4, 6)), T[:4]), compliance="joints")),
        (InvalidValueError, r"at least \d+ more configurations", lambda: fit(
            scene.nominal, Position(scene.q[:9], scene.p[:9]))),
        (InvalidValueError, "q", lambda: Pose(nan, scene.T)),
        (InvalidValueError, "degrees", lambda: fit(
            scene.nominal, Position(np.rad2deg(scene.q), scene.p))),
        (InvalidValueError, "millimetres", lambda: fit(scene.nominal, Pose(scene.q, T))),
        (ShapeError, "6 joints", lambda: fit(
            scene.nominal, Position(np.zeros((4, 7)), np.zeros((4, 3))))),
        (InvalidValueError, "expected one or more", lambda: fit(scene.nominal, [])),
        (InvalidValueError, "Pose, Position", lambda: fit(scene.nominal, [scene.T])),
        (InvalidValueError, "held_out", lambda: fit(scene.nominal, measured, held_out=scene.T)),
        (InvalidValueError, "held_out", lambda: fit(scene.nominal, measured, held_out=1.5)),
        (InvalidValueError, "folds", lambda: fit(scene.nominal, measured, folds=1)),
        (InvalidValueError, "ParameterPrior or None, got 'none'", lambda: fit(
            scene.nominal, measured, prior="none")),
        (InvalidValueError, "give a number for the strength", lambda: fit(
            scene.nominal, Pose(still, T_still), prior=ParameterPrior(strength=None))),
    ):  # fmt: skip
        with pytest.raises(error, match=match):
            call()


def test_notes_name_what_is_strange(scene):
    still, twice = scene.q.copy(), np.r_[np.arange(60), [3, 3, 7]]
    still[:, 2] = 0.7
    noisy = Scene(seed=14).noisy(length=1e-3)[:, :3, 3]
    mixed = scene.q[np.random.default_rng(0).permutation(60)]
    for measured, words in (
        (Pose(still, rm.dgm(scene.real, still)), "Joint 3"),
        (Pose(scene.q[twice], scene.T[twice]), "3 of 63 rows repeat"),
        (Position(Scene(seed=14).q, noisy, sigma=1e-6), "times the stated standard deviations"),
        (Pose(mixed, scene.T), "belong"),
    ):
        assert any(words in note for note in fit(scene.nominal, measured, **ALONE).notes)
    assert not fit(scene.nominal, Pose(scene.q, scene.T), **ALONE).notes
    T = scene.T[:14].copy()  # a nominal robot, and noise alone
    T[:, :3, 3] = rm.dgm(scene.nominal, scene.q[:14])[:, :3, 3]
    T[:, :3, 3] += 2e-3 * np.random.default_rng(3).normal(size=(14, 3))
    result = fit(scene.nominal, Position(scene.q[:14], T[:, :3, 3]))
    assert any("does not lower the position error" in note for note in result.notes)


def test_a_result_pickles_prints_and_counts_its_fits(scene):
    steps = []
    result = fit(scene.nominal, Position(scene.q, scene.p), folds=3, progress=steps.append)
    assert steps == [0.2, 0.4, 0.6, 0.8, 1.0]
    again = pickle.loads(pickle.dumps(result))
    assert again.names == result.names
    assert np.array_equal(again.covariance, result.covariance)
    assert again.validation.folds.rms == result.validation.folds.rms
    assert not again.solution.fit.x.flags.writeable
    assert "\n" not in repr(result)
    assert len(repr(result)) < 300
    assert repr(result).endswith("; see report(result)>")
    assert result.reason() == result.status.sentence
    offsets = joint_offsets(result, scene.q).offset  # of the measured coordinates
    masked = joint_offsets(result.robot, scene.q, mask=[1, 1, 1, 0, 0, 0])
    assert np.array_equal(offsets, masked.offset)

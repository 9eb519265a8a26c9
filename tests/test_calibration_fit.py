"""Calibration end to end: known truths are recovered, statistics hold, mistakes are named."""

import dataclasses
import pickle

import numpy as np
import pytest
from calibration_arms import ALONE, erroneous

import robotmodels as rm
from robotmodels.calibration import (
    CameraPose,
    Distance,
    KnownDistance,
    ParameterPrior,
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

EXACT = 1e-9


def readings(model, rng, count):
    """Random readings within the limits, where there are some."""
    slides = model.table.sigma[model.table.joint_rows] == 1
    low = np.where(np.isfinite(model.lower), model.lower, np.where(slides, -0.4, -2.5))
    high = np.where(np.isfinite(model.upper), model.upper, np.where(slides, 0.5, 2.5))
    return rng.uniform(np.maximum(low, -2.5), np.minimum(high, 2.5), (count, model.n))


def touching(model, points, count, rng):
    """Readings at which the tool is at points, many configurations each; and which point."""
    labels = np.repeat(np.arange(len(points)), count)
    T = np.tile(np.eye(4), (len(labels), 1, 1))
    T[:, :3, 3] = points[labels]
    q = rng.uniform(-2.0, 2.0, (len(labels), model.n))
    found = rm.igm_numeric(model, T, q0=q, mask="position", position_tolerance=1e-13, rng=rng)
    assert found.valid.all()
    return found.q[:, 0], labels.tolist()


class Scene:
    """An RX-90 with a tool off its last axis, the real one with errors, and readings."""

    def __init__(self, seed=0, count=60, **options):
        self.rng = np.random.default_rng(seed)
        nominal = rm.load("rx90")
        tool = rm.se3.from_rpy([0.2, -0.1, 0.3], [0.05, -0.03, 0.12])
        self.real = erroneous(nominal, self.rng, **options).with_tool(tool)
        self.nominal = nominal.with_tool(rm.se3.translation(0.05, -0.03, 0.11))
        self.q = readings(nominal, self.rng, count)
        self.fresh = readings(nominal, self.rng, 20)
        self.T = rm.dgm(self.real, self.q)
        self.p = self.T[:, :3, 3]

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
    "pose": (30, pose_error),
    "position": (27, position_error),
    "pair": (None, shape_error),
    "pivot": (None, shape_error),
    "known pivot": (27, position_error),
    "steps": (24, step_error),
    "camera": (None, step_error),
}


def seen(kind, s):
    """Exact measurements of a kind."""
    far = np.linalg.norm(s.p - PIVOTS[LABEL], axis=1)
    target = rm.se3.from_rpy([0.3, -0.4, 1.0], [0.8, 0.1, -0.2])
    apart = np.linalg.norm(s.p - np.roll(s.p, 1, axis=0), axis=1)
    return {
        "pose": lambda: Pose(s.q, s.T),
        "position": lambda: Position(s.q, s.p),
        "pair": lambda: Distance(s.q, apart, q_other=np.roll(s.q, 1, axis=0)),
        "pivot": lambda: Distance(s.q, far, pivot=LABEL),
        "known pivot": lambda: Distance(s.q, far, pivot=LABEL, known=dict(enumerate(PIVOTS))),
        "steps": lambda: RelativePose.successive(s.q, rm.se3.inverse(s.T[:-1]) @ s.T[1:]),
        "camera": lambda: CameraPose(s.q, rm.se3.inverse(s.T) @ target),
    }[kind]()


@pytest.mark.parametrize("kind", EXPECTED)
def test_exact_measurements_determine_the_robot(scene, kind):
    result = fit(scene.nominal, seen(kind, scene), **ALONE)
    count, error = EXPECTED[kind]
    assert result.status is FitStatus.CONVERGED
    assert count is None or len(result.names) == count
    assert error(scene, result.model) < EXACT
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
    a, b, c, d = 1e-3 * rng.normal(size=(4, 6))
    give = np.array([0.0, 2e-5, 3e-5, 2e-5, 4e-5, 1e-5])

    def actual(q):
        if law == "gains":
            return q @ K.T
        if law == "eccentricity":
            return q + a * np.sin(q) + b * np.cos(q) + c * np.sin(2 * q) + d * np.cos(2 * q)
        return q - give * rm.gravity_torque(heavy, q)

    options = {
        "gains": {"gains": True, "couplings": [(6, 5)]},
        "eccentricity": {"eccentricity": True},
        "compliance": {"compliance": "joints"},
    }[law]
    q, fresh = readings(heavy, rng, 120), readings(heavy, rng, 20)
    result = fit(heavy, Pose(q, rm.dgm(real, actual(q))), **options, **ALONE)
    error = calibrated_pose(result.robot, fresh) - rm.dgm(real, actual(fresh))
    assert np.abs(error).max() < EXACT
    if law == "gains":
        assert result.value("gain6_5") == pytest.approx(2e-3, abs=EXACT)
    if law == "compliance":
        assert result.value("compliance2") == pytest.approx(2e-5, abs=EXACT)


def giving_way(nominal, real, q, give):
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
        columns["alpha"][1:] += give[:-1] * m[:-1, 0]
        columns["beta"][1:] += give[:-1] * m[:-1, 1]
        arm = real.with_table(dataclasses.replace(real.table, **columns))
        poses.append(rm.dgm(arm, row + give * m[:, 2]))
    return np.array(poses)


@pytest.mark.parametrize("kind", ["isotropic", "uniform"])
def test_bending_under_gravity_is_recovered(heavy, kind):
    # an independent arm: each configuration has a table of its own; its last joint carries nothing
    rng = np.random.default_rng(4)
    real = erroneous(heavy, rng)
    inertia = heavy.inertia.values.copy()
    inertia[5] = 0.0
    heavy = heavy.with_inertia(rm.InertialParameters(inertia))
    give = np.full(6, 2e-5)
    if kind == "isotropic":
        give[[0, 1, 5]] = 0.0  # joints 1 and 2 act like the mount
    q, fresh = readings(heavy, rng, 80), readings(heavy, rng, 20)
    result = fit(heavy, Pose(q, giving_way(heavy, real, q, give)), compliance=kind, **ALONE)
    predicted = differential_model(result.parameters, fresh, result.corrections)[0]
    assert np.abs(predicted - giving_way(heavy, real, fresh, give)).max() < EXACT
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
        low, high = confidence_intervals(result.solution.fit)[:5].T
        inside.append((low <= truth) & (truth <= high))
    assert 0.92 < np.mean(inside) < 0.975


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
    for options in ({"parameters": ["theta9"]}, {"prior": ParameterPrior(named={"theta9": 1.0})}):
        with pytest.raises(InvalidValueError, match=r"theta9.*near it: theta"):
            fit(scene.nominal, Pose(scene.q, scene.T), **options)


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


def test_parameters_that_noise_hides_stay_nominal():
    """The wrist of an arm whose target is its centre: a tool moved by noise is no information."""
    arm = rm.load("rx90")
    q = np.random.default_rng(1).uniform(-2, 2, (60, 6))
    p = rm.dgm(arm, q)[:, :3, 3] + 5e-5 * np.random.default_rng(2).normal(size=(60, 3))
    hidden = {"theta4", "theta5", "alpha5", "alpha6"}
    priors = ParameterPrior(), None
    with_prior, without = (fit(arm, Position(q, p), prior=x, **ALONE) for x in priors)
    assert hidden <= set(without.identifiable.of_reason(Reason.NOISE))
    assert hidden <= set(with_prior.names)
    for result in (with_prior, without):
        turned = rm.dgm(result.model, q)[:, :3, :3].swapaxes(1, 2) @ rm.dgm(arm, q)[:, :3, :3]
        assert np.trace(turned, axis1=1, axis2=2).min() > 1 + 2 * np.cos(2e-3)


def test_truncation_leaves_out_directions_without_effect():
    s = Scene(seed=13, count=40)
    q = s.q.copy()
    q[:, 4] = 0.3 + 1e-3 * s.rng.normal(size=len(q))  # joint 5 hardly moves
    p = rm.dgm(s.real, q)[:, :3, 3] + 1e-4 * s.rng.normal(size=(len(q), 3))
    cut = fit(s.nominal, Position(q, p), truncation=1e-3, prior=None, **ALONE)
    assert cut.solution.fit.rank == len(cut.names) - 4
    assert np.abs(cut.corrections).max() < 0.01


# --- mistakes and notes ---------------------------------------------------------------------------


def test_mistakes_are_named(scene):
    measured = Pose(scene.q, scene.T)
    still, T_still = (np.repeat(x[:1], 12, axis=0) for x in (scene.q, scene.T))
    light, seven = rm.load("stanford_arm"), Position(np.zeros((4, 7)), np.zeros((4, 3)))
    wrong = Position(np.rad2deg(scene.q), scene.p)
    choose = ParameterPrior(strength=None)
    for error, match, model, measurements, options in (
        (InvalidValueError, "masses", light, Pose(still, T_still), {"compliance": "joints"}),
        (InvalidValueError, "degrees", scene.nominal, wrong, {}),
        (ShapeError, "6 joints", scene.nominal, seven, {}),
        (InvalidValueError, "expected one or more", scene.nominal, [], {}),
        (InvalidValueError, "Pose, Position", scene.nominal, [scene.T], {}),
        (InvalidValueError, "held_out", scene.nominal, measured, {"held_out": 1.5}),
        (InvalidValueError, "folds", scene.nominal, measured, {"folds": 1}),
        (InvalidValueError, "ParameterPrior or None", scene.nominal, measured, {"prior": "none"}),
        (InvalidValueError, "strength", scene.nominal, Pose(still, T_still), {"prior": choose}),
    ):
        with pytest.raises(error, match=match):
            fit(model, measurements, **options)


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


def test_a_result_pickles_prints_and_counts_its_fits(scene):
    steps = []
    result = fit(scene.nominal, Position(scene.q, scene.p), folds=3, progress=steps.append)
    assert steps == [0.2, 0.4, 0.6, 0.8, 1.0]
    again = pickle.loads(pickle.dumps(result))
    assert np.array_equal(again.covariance, result.covariance)
    assert again.validation.folds.rms == result.validation.folds.rms
    assert not again.solution.fit.x.flags.writeable
    assert "\n" not in repr(result)
    offsets = joint_offsets(result, scene.q).offset  # of the measured coordinates
    masked = joint_offsets(result.robot, scene.q, mask=[1, 1, 1, 0, 0, 0])
    assert np.array_equal(offsets, masked.offset)

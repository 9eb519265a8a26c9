"""The calibrated robot, its inverse model, and what a fixed controller can do with it."""

import pickle
import warnings

import numpy as np
import pytest
from identities.random_robots import random_model, random_pose, robot_size

import robotmodels as rm
from robotmodels.calibration import candidate_parameters, differential_model
from robotmodels.calibration.extended_table import Element
from robotmodels.calibration.inverse import CorrectionStatus, corrected_igm
from robotmodels.calibration.offsets import joint_offsets, pose_offsets
from robotmodels.calibration.parameters import (
    Compliance,
    ErrorLaw,
    GeometricParameter,
    GeometricParameters,
)
from robotmodels.calibration.reporting.write import calibrated_urdf
from robotmodels.calibration.robot import (
    calibrated_model,
    calibrated_pose,
    encoder_transmission,
    joint_errors_of,
    missing_of_pose,
    reading_jacobian,
)
from robotmodels.errors import InvalidValueError, ShapeError, UrdfWarning


def every_law(model, frames=(None,), couplings=(), compliance=Compliance.JOINTS):
    return candidate_parameters(
        model, frames, gains=True, eccentricity=True, couplings=couplings, compliance=compliance
    )


def with_frames(model, rng):
    """The robot with two named frames, one of them fixed to the base."""
    from dataclasses import replace

    frames = (
        rm.NamedFrame("camera", int(rng.integers(1, model.f + 1)), random_pose(rng, 0.2)),
        rm.NamedFrame("plate", 0, random_pose(rng, 0.5)),
    )
    return replace(model, frames=frames)


def deviations(parameters, rng, size=1e-3):
    xi = size * rng.normal(size=len(parameters))
    # a compliance of 1 mrad at full torque
    soft = [name.startswith("compliance") for name in parameters.names]
    xi[soft] *= 0.02
    return xi


def couplings_of(model):
    rows = (model.table.joint_rows + 1).tolist()
    return [(rows[-1], rows[0])] if len(rows) > 1 else []


def on_path(parameters, pairs):
    moving = {e.row for e in parameters.entries if e.law is ErrorLaw.GAIN}
    return [pair for pair in pairs if set(pair) <= moving]


# --- the calibrated robot ---------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(40))
def test_the_calibrated_model_is_the_generalised_differential_model(seed):
    rng = np.random.default_rng(seed)
    model = random_model(
        rng, f=int(rng.integers(1, 8)), tree=seed % 2 == 1, fixed=seed % 3 == 0, tip="any",
        transmission=seed % 4 == 0,
    )  # fmt: skip
    model = with_frames(model, rng)
    frames = (None, "camera", "plate", 0, model.f)[: 1 + seed // 5 % 5]
    mode = tuple(Compliance)[seed % 5]
    first = every_law(model, frames, compliance=mode)
    parameters = every_law(model, frames, on_path(first, couplings_of(model)), compliance=mode)
    # far more than errors: the laws are exact, not linearised
    xi = deviations(parameters, rng, 0.1)
    robot = calibrated_model(parameters, xi)
    q = rng.uniform(-2.0, 2.0, size=(5, model.n))
    for frame in frames:
        T = differential_model(parameters, q, xi, frame).T
        close = 1e-12 * robot_size(robot.model, q[0])
        np.testing.assert_allclose(calibrated_pose(robot, q, frame), T, rtol=0, atol=close)
        end = robot.end(frame)
        if end.parent >= 1:
            moved = robot.with_tool_at(frame)
            np.testing.assert_allclose(calibrated_pose(moved, q), T, rtol=0, atol=close)
    if "camera" in frames and robot.bending.is_zero:  # the model's own frame is off as well
        q_actual = robot.joint_errors.actual(q)
        np.testing.assert_allclose(
            rm.dgm(robot.model, q_actual, "camera"),
            differential_model(parameters, q, xi, "camera").T,
            rtol=0, atol=1e-12 * robot_size(robot.model, q[0]),
        )  # fmt: skip


def test_no_deviation_changes_nothing(rng):
    model = with_frames(random_model(rng, tree=True, fixed=True), rng)
    parameters = every_law(model, (None, "camera"), compliance=Compliance.LINKS)
    robot = calibrated_model(parameters, np.zeros(len(parameters)))
    assert robot.model == model == robot.structured
    assert robot.joint_errors.is_zero
    assert robot.bending.is_zero
    assert robot.notes == ()
    q = rng.normal(size=(3, model.n))
    np.testing.assert_array_equal(robot.joint_errors.actual(q), q)
    np.testing.assert_array_equal(robot.joint_errors.reading(q), q)


@pytest.mark.parametrize("seed", range(12))
def test_readings_are_found_again(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, f=6)
    first = every_law(model)
    parameters = every_law(model, couplings=on_path(first, couplings_of(model)))
    # up to errors of 5 %, a fixed point that contracts slowly
    errors = joint_errors_of(parameters, deviations(parameters, rng, (1e-3, 5e-2)[seed % 2]))
    q = rng.uniform(-3.0, 3.0, size=(4, 5, model.n))
    np.testing.assert_allclose(errors.reading(errors.actual(q)), q, rtol=0, atol=1e-14 * 10)
    assert errors.reading(np.zeros((0, model.n))).shape == (0, model.n)


def test_readings_where_the_fixed_point_does_not_settle(rng):
    """Slopes of the law between 0.2 and 1.8: Newton's steps find what the iteration does not."""
    model = rm.load("rx90")
    parameters = candidate_parameters(model, eccentricity=True)
    xi = 0.8 * np.array([name in ("sine2", "cosine3") for name in parameters.names])
    errors = joint_errors_of(parameters, xi)
    q = rng.uniform(-3.0, 3.0, size=(50, 6))
    np.testing.assert_allclose(errors.reading(errors.actual(q)), q, rtol=0, atol=1e-13)
    h = 1e-6
    for j in range(6):
        step = h * np.eye(6)[j]
        difference = (errors.actual(q + step) - errors.actual(q - step)) / (2 * h)
        np.testing.assert_allclose(errors.slope(q)[..., j], difference, rtol=0, atol=1e-8)


def test_joints_that_no_reading_brings_there_are_told():
    """Twice the sine goes up and down: joint 2 has values with three readings, none is refused,
    and a law that ends has values with none."""
    model = rm.load("lab_rr")
    parameters = candidate_parameters(model, gains=True, eccentricity=True)
    names = np.array(parameters.names)
    flat = -1.0 * (names == "gain2") + 0.3 * (names == "sine2")
    with pytest.raises(InvalidValueError, match="singular"):
        joint_errors_of(parameters, flat).reading([0.0, 0.2])
    nearly = -0.999 * (names == "gain2") + 0.3 * (names == "sine2")
    errors = joint_errors_of(parameters, nearly)
    found = errors.reading(np.array([[0.0, 0.2], [0.0, 0.0]]))
    hit = np.isfinite(found).all(axis=-1)
    assert hit[1]
    np.testing.assert_allclose(
        errors.actual(found[hit]), np.array([[0.0, 0.2], [0.0, 0.0]])[hit], rtol=0, atol=1e-13
    )


def test_gains_compose_with_the_transmission(rng):
    model = random_model(rng, f=4, transmission=True)
    parameters = candidate_parameters(model, gains=True)
    robot = calibrated_model(parameters, deviations(parameters, rng, 0.01))
    q_c = rng.normal(size=(5, model.n))
    together = encoder_transmission(robot.joint_errors).to_joint(q_c)
    apart = robot.joint_errors.actual(model.transmission.to_joint(q_c))
    np.testing.assert_allclose(together, apart, rtol=0, atol=1e-14)
    bent = candidate_parameters(model, eccentricity=True)
    with pytest.raises(InvalidValueError, match="linear law"):
        encoder_transmission(joint_errors_of(bent, np.full(len(bent), 1e-3)))


def test_laws_that_no_joint_has_are_refused():
    skeleton = candidate_parameters(rm.load("rx90")).skeleton
    odd = GeometricParameters(skeleton, (GeometricParameter(3, Element.D, ErrorLaw.GAIN, 3),))
    with pytest.raises(InvalidValueError, match="variable of a joint"):
        calibrated_model(odd, [1e-3])
    with pytest.raises(ShapeError):
        calibrated_model(candidate_parameters(rm.load("rx90")), [1e-3])


@pytest.mark.parametrize("seed", range(8))
def test_a_calibrated_robot_comes_back_from_its_urdf(seed):
    rng = np.random.default_rng(seed)
    model = with_frames(
        random_model(rng, f=6, tree=seed % 2 == 1, fixed=seed % 3 == 0, gravity=False), rng
    )
    if seed == 0:
        model = rm.load("rx90")  # parallel axes: beta
    frames = (None,) if seed == 0 else (None, "camera")
    parameters = candidate_parameters(model, frames)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message="A URDF has no place")
        back = rm.RobotModel.from_urdf(calibrated_urdf(robot))
    order = [back.table.joint_names.index(name) for name in model.table.joint_names]
    q = rng.uniform(-2.0, 2.0, size=(10, model.n))
    there = np.empty_like(q)
    there[:, order] = q
    for frame in frames:
        np.testing.assert_allclose(
            rm.dgm(back, there, frame), calibrated_pose(robot, q, frame),
            rtol=0, atol=1e-12 * robot_size(robot.model, q[0]),
        )  # fmt: skip


def test_what_a_urdf_cannot_hold_is_told(rng):
    parameters = every_law(
        random_model(rng, f=4, gravity=False), (None, 2), compliance=Compliance.LINKS
    )
    robot = calibrated_model(parameters, deviations(parameters, rng))
    text = " ".join(robot.notes)
    for word in ("Gains", "Eccentricity", "Compliance", "end 2", "mount", "bending"):
        assert word in text
    with pytest.warns(UrdfWarning, match="Eccentricity"):
        calibrated_urdf(robot)


def test_a_calibrated_robot_is_a_value(rng):
    parameters = every_law(random_model(rng, f=4), compliance=Compliance.ISOTROPIC)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    copy = pickle.loads(pickle.dumps(robot))
    q = rng.normal(size=4)
    np.testing.assert_array_equal(calibrated_pose(copy, q[: robot.model.n]),
                                  calibrated_pose(robot, q[: robot.model.n]))  # fmt: skip
    assert not copy.deviation.flags.writeable
    assert not copy.joint_errors.gain.flags.writeable
    with pytest.raises(InvalidValueError, match="measured ends"):
        robot.with_tool_at("elsewhere")


# --- the inverse model of the calibrated robot --------------------------------------------------


def readings_of(model, rng, N):
    low = np.where(np.isfinite(model.lower), np.maximum(model.lower, -3.0), -2.0)
    high = np.where(np.isfinite(model.upper), np.minimum(model.upper, 3.0), 2.0)
    return rng.uniform(low, high, size=(N, model.n))


def missed(robot, q, T, mask=None):
    """Largest element that is missing of the poses, for whole poses; of positions with a mask."""
    P = calibrated_pose(robot, q)
    return np.abs(P - T).max() if mask is None else np.abs(P[..., :3, 3] - T[..., :3, 3]).max()


CASES = {
    "rx90": {}, "erd:ur10": {}, "puma560": {}, "stanford_arm": {}, "panda": {}, "gantry": {},
    "cobra_s600": {"mask": [1, 1, 1, 0, 0, 1]},
}  # fmt: skip


@pytest.mark.parametrize("laws", [{}, {"gains": True, "eccentricity": True}])
@pytest.mark.parametrize("name", CASES)
def test_every_posture_of_the_calibrated_robot(name, laws):
    rng = np.random.default_rng(3)
    model, asked = rm.load(name), CASES[name]
    parameters = candidate_parameters(model, **laws)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    q = readings_of(model, rng, 10 if name == "cobra_s600" else 60)
    T = calibrated_pose(robot, q)
    found = corrected_igm(robot, T, q_ref=q, **asked)
    assert (found.residual[found.valid] < 1e-12).all()
    # an independent forward pass, from the readings
    there = found.valid.nonzero()
    assert missed(robot, found.q[there], T[there[0]], asked.get("mask")) < 3e-12
    turns = model.table.sigma[model.table.joint_rows] == 0
    way = np.abs(found.nearest(q) - q)
    way[:, turns] = np.minimum(way[:, turns], 2 * np.pi - way[:, turns])
    assert way.max() < 1e-7
    # as many as the calibrated table's own inverse model finds; each is told of
    own = rm.igm(robot.model, T, q_ref=robot.joint_errors.actual(q), **asked)
    assert (found.count >= own.count).mean() > 0.98
    assert (found.correction == CorrectionStatus.ARRIVED).any(axis=-1).mean() > 0.9
    arrived = found.correction == CorrectionStatus.ARRIVED
    assert (found.row[arrived] >= 0).all()
    if not laws:
        for i in range(len(q)):
            theirs = own.q[i][own.valid[i]]
            mine = found.q[i][found.valid[i]]
            gap = np.abs(theirs[:, None] - mine[None])
            gap[..., turns] = np.minimum(gap[..., turns], 2 * np.pi - gap[..., turns])
            # the same postures, save at double roots, which two methods place differently
            assert (gap.max(axis=-1).min(axis=1) < 1e-5).mean() > 0.85


def test_compliance_counts_in_the_inverse_model(rng):
    model = rm.load("panda")
    parameters = candidate_parameters(model, compliance="joints", gains=True)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    q = readings_of(model, rng, 20)
    T = calibrated_pose(robot, q)
    found = corrected_igm(robot, T, q_ref=q)
    assert np.abs(found.nearest(q) - q).max() < 1e-7
    assert missed(robot, found.nearest(q), T) < 1e-11


def test_a_locked_joint_reads_what_it_is_locked_at(rng):
    model = rm.load("panda")
    parameters = candidate_parameters(model, gains=True, couplings=[(7, 2)])
    robot = calibrated_model(parameters, deviations(parameters, rng))
    q = readings_of(model, rng, 10)
    q[:, 6] = 0.4
    T = calibrated_pose(robot, q)
    found = corrected_igm(robot, T, q_ref=q, lock={6: 0.4})
    assert np.abs(found.q[found.valid][:, 6] - 0.4).max() < 1e-12
    assert np.abs(found.nearest(q) - q).max() < 1e-7


def test_limits_are_those_of_the_readings(rng):
    model = rm.load("puma560")
    parameters = candidate_parameters(model, gains=True)
    robot = calibrated_model(parameters, deviations(parameters, rng, 5e-3))
    q = rng.uniform(model.lower, model.upper, size=(100, 6))
    T = calibrated_pose(robot, q)
    found = corrected_igm(robot, T, q_ref=q, limits=True)
    rows = found.q[found.valid]
    assert ((rows >= model.lower) & (rows <= model.upper)).all()
    assert np.abs(found.nearest(q) - q).max() < 1e-7
    assert (found.correction == CorrectionStatus.OUTSIDE_LIMITS).any()


def test_a_tip_on_a_tree(rng):
    model = random_model(rng, f=9, tree=True, prismatic=False, fixed=True, tip="any")
    model = with_frames(model, rng)
    parameters = candidate_parameters(model, (None, "camera"), gains=True)
    robot = calibrated_model(parameters, deviations(parameters, rng)).with_tool_at("camera")
    q = rng.uniform(-1.5, 1.5, size=(5, model.n))
    T = differential_model(parameters, q, robot.deviation, "camera").T
    found = corrected_igm(robot, T, q_ref=q)
    assert found.valid.any(axis=-1).all()
    assert missed(robot, found.q[:, 0], T) < 1e-11 * robot_size(robot.model, q[0])


@pytest.mark.parametrize("name", ["rx90", "erd:ur10", "puma560"])
def test_at_and_beyond_the_edge_of_reach(name, rng):
    """Targets pulled out of the calibrated robot's reach: solutions are true ones or none."""
    model = rm.load(name)
    parameters = candidate_parameters(model, gains=True)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    # the elbow that takes the wrist farthest from the shoulder
    elbow = np.linspace(-np.pi, np.pi, 200001)
    postures = np.tile([0.2, 0.3, 0.0, 0.4, 0.5, 0.6], (len(elbow), 1))
    postures[:, 2] = elbow
    wrist = 5 if name != "erd:ur10" else 4
    shoulder = rm.dgm(robot.model, postures[0], 2)[:3, 3]
    arm = rm.dgm(robot.model, robot.joint_errors.actual(postures), wrist)[:, :3, 3] - shoulder
    straight = np.linalg.norm(arm, axis=1).argmax()
    away = arm[straight]
    T = np.repeat(calibrated_pose(robot, postures[straight])[None], 9, axis=0)
    pull = np.array([-1e-2, -1e-3, -1e-4, 0.0, 1e-4, 1e-3, 1e-2, 0.1, 1.0])
    T[:, :3, 3] += pull[:, None] * away / np.linalg.norm(away)
    found = corrected_igm(robot, T)
    at = found.valid.nonzero()
    assert missed(robot, found.q[at], T[at[0]]) < 3e-12
    assert found.count[0] >= 2
    assert found.count[-1] == 0
    assert found.status[-1] == rm.IGMStatus.TOO_FAR
    reached = np.isin(found.status, (rm.IGMStatus.REACHED, rm.IGMStatus.REACHED_FAMILY))
    np.testing.assert_array_equal(reached, found.count > 0)
    # the posture it was made from is found at the edge itself
    assert found.count[3] >= 1
    gone = np.isin(found.correction, (CorrectionStatus.VANISHED, CorrectionStatus.MERGED))
    assert (gone.any(axis=-1) | (found.count >= found.row.max(axis=-1) + 1)).all()
    assert found.reason(8).startswith("The position is out of reach")


@pytest.mark.parametrize("name", ["rx90", "puma560"])
def test_singular_wrists(name, rng):
    model = rm.load(name)
    parameters = candidate_parameters(model, gains=True)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    q = readings_of(model, rng, 12)
    q[:, 4] = np.repeat([0.0, 1e-4, -1e-3], 4)
    T = calibrated_pose(robot, q)
    found = corrected_igm(robot, T, q_ref=q)
    assert found.valid.any(axis=-1).all()
    at = found.valid.nonzero()
    assert missed(robot, found.q[at], T[at[0]]) < 3e-12
    nominal = corrected_igm(robot, rm.dgm(robot.structured, q), q_ref=q)
    at = nominal.valid.nonzero()
    assert missed(robot, nominal.q[at], rm.dgm(robot.structured, q)[at[0]]) < 3e-12
    told = nominal.correction[np.isfinite(nominal.nominal).all(axis=-1)]
    assert (told != CorrectionStatus.NO_POSTURE).all()


def test_a_batch_is_its_poses_one_by_one(rng):
    model = rm.load("puma560")
    parameters = candidate_parameters(model, gains=True)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    q = readings_of(model, rng, 6).reshape(2, 3, 6)
    T = calibrated_pose(robot, q)
    together = corrected_igm(robot, T)
    for i in np.ndindex(2, 3):
        alone = corrected_igm(robot, T[i])
        assert alone.count == together.count[i]
        np.testing.assert_allclose(
            alone.q, together.q[i][together.valid[i]], rtol=0, atol=1e-10
        )  # fmt: skip
    empty = corrected_igm(robot, np.empty((0, 4, 4)))
    assert empty.q.shape[0] == empty.status.size == 0
    with pytest.raises(InvalidValueError, match="CalibratedRobot"):
        corrected_igm(model, T)


def test_without_the_second_look_nothing_false_is_said(rng):
    model = rm.load("rx90")
    parameters = candidate_parameters(model)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    T = calibrated_pose(robot, readings_of(model, rng, 100))
    quick, whole = corrected_igm(robot, T, complete=False), corrected_igm(robot, T)
    assert (quick.count <= whole.count).all()
    assert quick.count.mean() > 7.0
    assert (quick.residual[quick.valid] < 1e-12).all()


# --- controllers that keep their model ----------------------------------------------------------


@pytest.mark.parametrize("name", ["rx90", "erd:ur10", "puma560", "gantry"])
def test_false_targets_lead_to_the_true_ones(name, rng):
    model = rm.load(name)
    parameters = candidate_parameters(model, gains=True, eccentricity=True)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    q = readings_of(model, rng, 30)
    q[:, 4] = np.where(np.abs(q[:, 4]) < 0.2, 0.5, q[:, 4])
    T = calibrated_pose(robot, q)
    false = pose_offsets(robot, T, q_ref=q).nearest(q)
    commanded = rm.igm(model, false, q_ref=q).nearest(q)
    assert missed(robot, commanded, T) < 1e-11
    # and without them it misses by what is off
    naive = rm.igm(model, T, q_ref=q).nearest(q)
    reached = np.isfinite(naive).all(axis=-1)
    assert reached.sum() > 20
    assert missed(robot, naive[reached], T[reached]) > 1e-4


def test_offsets_alone_are_cancelled(rng):
    model = rm.load("rx90")
    full = candidate_parameters(model, base=False, tool=False)
    own = [f"{'r' if s == 1 else 'theta'}{j + 1}" for j, s in enumerate(model.table.sigma)]
    parameters = full.subset(own)
    xi = 1e-2 * rng.normal(size=6)
    robot = calibrated_model(parameters, xi)
    found = joint_offsets(robot, rng.uniform(-2.0, 2.0, size=(30, 6)))
    assert found.worst[0] < 1e-11
    assert found.rank == 6
    np.testing.assert_allclose(found.offset, -xi, rtol=0, atol=1e-10)


def test_constant_offsets_are_the_best_in_least_squares(rng):
    model = rm.load("rx90")
    parameters = candidate_parameters(model, gains=True)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    q = readings_of(model, rng, 40)
    found = joint_offsets(robot, q, mask=[1, 1, 1, 0, 0, 0])
    assert found.position[1] < found.position[0]
    wanted = rm.dgm(model, q)[:, :3, 3]

    def cost(offset):
        return ((calibrated_pose(robot, q + offset)[:, :3, 3] - wanted) ** 2).sum()

    least = cost(found.offset)
    np.testing.assert_allclose(least, (found.after[:, :3] ** 2).sum(), rtol=1e-9)
    for step in 1e-5 * np.vstack([np.eye(6), -np.eye(6)]):
        assert cost(found.offset + step) >= least * (1 - 1e-9)
    # whole poses, whose rotations weigh: the gradient vanishes as well
    both = joint_offsets(robot, q, length=0.5)

    def whole(offset):
        P, W = calibrated_pose(robot, q + offset), rm.dgm(model, q)
        turn = W[:, :3, :3] @ P[:, :3, :3].swapaxes(-1, -2)
        angle = np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1, 1))
        return ((P[:, :3, 3] - W[:, :3, 3]) ** 2).sum() + 0.25 * (angle**2).sum()

    best = whole(both.offset)
    for step in 1e-4 * np.vstack([np.eye(6), -np.eye(6)]):
        assert whole(both.offset + step) >= best * (1 - 1e-6)
    with pytest.raises(InvalidValueError, match="none"):
        joint_offsets(robot, np.empty((0, 6)))


# --- links that bend and a mount that tilts -----------------------------------------------------


def bent(model, mode, rng, **laws):
    """A robot that gives way by about 1 mrad in each element, and is off by 1 mm and 1 mrad."""
    parameters = candidate_parameters(model, compliance=mode, **laws)
    return calibrated_model(parameters, deviations(parameters, rng))


@pytest.mark.parametrize("mode", [Compliance.LINKS, Compliance.ISOTROPIC, Compliance.UNIFORM])
@pytest.mark.parametrize("name", ["erd:ur10", "panda"])
def test_bending_counts_in_the_inverse_model(name, mode, rng):
    model = rm.load(name)
    robot = bent(model, mode, rng, gains=True)
    assert not robot.bending.is_zero
    q = readings_of(model, rng, 12)
    T = calibrated_pose(robot, q)
    # it is more than rounding, and an inverse model without it would miss by that
    rigid = rm.dgm(robot.model, robot.joint_errors.actual(q))
    assert np.abs(rigid - T)[:, :3, 3].max() > 1e-5
    found = corrected_igm(robot, T, q_ref=q)
    assert (found.residual[found.valid] < 1e-12).all()
    at = found.valid.nonzero()
    assert missed(robot, found.q[at], T[at[0]]) < 3e-12
    way = np.abs(found.nearest(q) - q)
    assert np.minimum(way, 2 * np.pi - way).max() < 1e-7
    false = pose_offsets(robot, T, q_ref=q)
    np.testing.assert_array_equal(false.solutions.q, found.q)
    np.testing.assert_allclose(
        false.command[found.valid], rm.dgm(model, found.q[found.valid]), rtol=0, atol=1e-15
    )


@pytest.mark.parametrize("axes", ["world", "tool"])
def test_parts_of_poses_are_met_by_robots_that_bend(axes, rng):
    mask = [1, 1, 1, 0, 1, 1]
    model = rm.load("erd:ur10")
    robot = bent(model, Compliance.UNIFORM, rng)
    q = readings_of(model, rng, 2)
    q[:, 5] = 0.4
    T = calibrated_pose(robot, q)
    found = corrected_igm(robot, T, q_ref=q, mask=mask, mask_axes=axes, lock={5: 0.4})
    assert found.valid.any(axis=-1).all()
    i, s = found.valid.nonzero()
    P = calibrated_pose(robot, found.q[i, s])
    np.testing.assert_allclose(P[:, :3, 3], T[i, :3, 3], rtol=0, atol=3e-12)
    # the rotation that is left is about the one axis that is not asked for
    turn = missing_of_pose(P, T[i])[:, 3:]
    if axes == "tool":
        turn = np.einsum("nij,ni->nj", T[i, :3, :3], turn)
    assert np.abs(turn[:, 1:]).max() < 3e-12


def test_the_slope_of_a_robot_that_bends(rng):
    model = random_model(rng, f=6, tip="any")
    robot = bent(model, Compliance.LINKS, rng, gains=True, eccentricity=True)
    q = rng.uniform(-2.0, 2.0, size=(4, model.n))
    J = reading_jacobian(robot, q)
    h = 1e-5
    for j in range(model.n):
        step = h * np.eye(model.n)[j]
        high, low = calibrated_pose(robot, q + step), calibrated_pose(robot, q - step)
        moved = missing_of_pose(low, high) / (2 * h)
        np.testing.assert_allclose(J[..., j], moved, rtol=0, atol=1e-7 * robot_size(model, q[0]))


def test_constant_offsets_of_a_robot_that_bends(rng):
    model = rm.load("erd:ur10")
    robot = bent(model, Compliance.LINKS, rng)
    q = readings_of(model, rng, 20)
    found = joint_offsets(robot, q, mask=[1, 1, 1, 0, 0, 0])
    wanted = rm.dgm(model, q)[:, :3, 3]

    def cost(offset):
        return ((calibrated_pose(robot, q + offset)[:, :3, 3] - wanted) ** 2).sum()

    least = cost(found.offset)
    assert least < cost(np.zeros(6))
    for step in 1e-5 * np.vstack([np.eye(6), -np.eye(6)]):
        assert cost(found.offset + step) >= least * (1 - 1e-9)

"""The numeric inverse geometric model: poses met, limits, masks, and what is said when not."""

import numpy as np
import pytest
from identities.random_robots import random_model, random_pose, random_rotation, random_state
from scipy.spatial.transform import Rotation

import robotmodels as rm
from robotmodels import se3
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.igm import IGMStatus, igm_numeric
from robotmodels.igm.constraints import Components, constraints
from robotmodels.igm.loop import joint_chain

POSITION = [1, 1, 1, 0, 0, 0]
POINTING = [1, 1, 1, 1, 1, 0]


def at(x, y, z):
    return se3.translation(x, y, z)


def postures(model, rng, count):
    """Postures inside the limits; angles without limits anywhere, strokes within a metre."""
    revolute = model.table.sigma[model.table.joint_rows] == 0
    reach = np.where(revolute, np.pi, 1.0)
    lower = np.where(np.isfinite(model.lower), model.lower, -reach)
    upper = np.where(np.isfinite(model.upper), model.upper, reach)
    return rng.uniform(lower, upper, (count, model.n))


def pose_error(model, q, T, axes):
    """What is missing at q, by the definition in the docstring."""
    P = rm.dgm(model, q)
    R = T[..., :3, :3]
    turn = R if axes == "tool" else np.broadcast_to(np.eye(3), R.shape)
    away = np.einsum("...ji,...j->...i", turn, T[..., :3, 3] - P[..., :3, 3])
    phi = Rotation.from_matrix(R @ np.swapaxes(P[..., :3, :3], -1, -2)).as_rotvec()
    return np.concatenate([away, np.einsum("...ji,...j->...i", turn, phi)], axis=-1)


def check_met(model, T, found):
    """Everything marked valid meets its pose, by an independent forward pass."""
    valid = found.valid[..., 0]
    T = np.broadcast_to(T, (*valid.shape, 4, 4))[valid]
    missing = pose_error(model, found.q[..., 0, :][valid], T, "world").reshape(-1, 2, 3)
    assert np.linalg.norm(missing, axis=-1).max(initial=0.0) <= 1.001e-6


# --- the derivative ------------------------------------------------------------------------------


def error_at(model, q, T, axes):
    """Error (6,) of a configuration and minus its derivative (6, n), from the compiled search."""
    chain = joint_chain(model)
    wanted = constraints(chain, Components(in_tool_axes=axes == "tool"))
    columns = chain.columns
    _, e, J = wanted.descents((se3.inverse(model.base) @ T)[None], q[None, None, columns], 0, 1.0)
    whole = np.zeros((6, model.n))
    whole[:, columns] = J[0]
    return e[0], whole


@pytest.mark.parametrize("axes", ["world", "tool"])
@pytest.mark.parametrize("angle", [0.0, 1e-6, 2.0, np.pi - 1e-4])
def test_error_and_its_derivative(axes, angle, rng):
    """The analytic derivative of all six components is that of finite differences."""
    for seed in range(2):
        model = random_model(np.random.default_rng(seed), f=7, tree=True, fixed=True, tip=7)
        q = random_state(model, rng)[0]
        T = rm.dgm(model, q)
        axis = rng.normal(size=3)
        T[:3, :3] = (
            Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix() @ T[:3, :3]
        )
        T[:3, 3] += rng.normal(size=3)
        e, J = error_at(model, q, T, axes)
        assert np.linalg.norm(e[3:]) == pytest.approx(angle, abs=1e-9)
        np.testing.assert_allclose(e, pose_error(model, q, T, axes), atol=1e-9)
        for i, step in enumerate(1e-6 * np.eye(model.n)):
            ahead, behind = (error_at(model, q + s, T, axes)[0] for s in (step, -step))
            numeric = (behind - ahead) / 2e-6
            np.testing.assert_allclose(J[:, i], numeric, atol=2e-8 * (1 + np.abs(J[:, i]).max()))


# --- reachable poses ------------------------------------------------------------------------------


@pytest.mark.sampled(8)
@pytest.mark.parametrize("name", [n for n in rm.robots() if not n.startswith("erd:")])
def test_catalogue_reaches_its_poses(name, rng):
    """Poses of postures inside the limits are reached, in full, by every robot."""
    model = rm.load(name)
    T = rm.dgm(model, postures(model, rng, 60))
    for limits in (False, True):
        found = igm_numeric(model, T, limits=limits)
        check_met(model, T, found)
        assert found.valid.mean() >= 0.98
    q = found.q[found.valid]
    assert ((q >= model.lower) & (q <= model.upper)).all()
    assert (found.within_limits == found.valid).all()


def test_random_structures_reach_their_poses():
    """Any structure: prismatic joints, fixed frames, branches, any tip, base and tool."""
    reached = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        model = random_model(rng, f=1 + seed % 9, tree=seed % 2 == 0, fixed=True, tip="any")
        T = rm.dgm(model, random_state(model, rng, 5)[0])
        found = igm_numeric(model, T)
        check_met(model, T, found)
        reached += found.valid.ravel().tolist()
    assert np.mean(reached) >= 0.97


# --- poses that cannot be met ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("robot", "position", "status", "gap"),
    [
        ("lab_rr", (0.5, 0, 0.5), IGMStatus.TOO_FAR, 0.3),
        ("lab_rr", (0.0, 0, 0.71), IGMStatus.TOO_FAR, 0.01),
        ("lab_rr", (0.1, 0, 0.5), IGMStatus.TOO_NEAR, 0.1),
        ("rx90", (0.0, 0, 2.5), IGMStatus.TOO_FAR, 1.6),
        ("rx90", (0.0, 3.0, 0), IGMStatus.TOO_FAR, 2.1),
        ("kr6_r900", (0.0, 0, 2.5), IGMStatus.TOO_FAR, None),
        ("ur5", (0.0, 0, 0.35), IGMStatus.TOO_NEAR, None),
    ],
)
@pytest.mark.parametrize("mask", [None, POSITION])
def test_out_of_reach(robot, position, status, gap, mask):
    """Never valid; which side, and by how much, is said."""
    found = igm_numeric(rm.load(robot), at(*position), mask=mask)
    assert found.count == 0
    assert found.status == status
    if gap:
        assert np.linalg.norm(found.error[0, :3]) == pytest.approx(gap, abs=1e-4)
        assert f"misses it by {gap:g} m" in found.reason()


@pytest.mark.parametrize("distance", [1e3, 1e300])
def test_far_beyond(distance):
    """However far, a target is too far, also in two of its coordinates only."""
    for mask in (None, POSITION, [1, 1, 0, 0, 0, 0]):
        found = igm_numeric(rm.load("puma560"), at(distance, 0, 0), mask=mask, restarts=10)
        assert found.count == 0
        if distance < 1e100 or mask != [1, 1, 0, 0, 0, 0]:
            assert found.status == IGMStatus.TOO_FAR


def test_structures_of_few_joints():
    """No joint at all, one slide, a joint that its limits hold."""
    fixed = rm.RobotModel.from_table(rm.DHTable(antecedent=[0], sigma=[2], d=[0.3]))
    found = igm_numeric(fixed, [at(0.3, 0, 0), at(0.5, 0, 0)])
    assert found.status.tolist() == [IGMStatus.REACHED, IGMStatus.TOO_FAR]
    assert found.q.shape == (2, 1, 0)
    slide = rm.RobotModel.from_table(rm.DHTable(antecedent=[0], sigma=[1]))
    assert igm_numeric(slide, at(0, 0, 0.5)).q[0] == pytest.approx(0.5)
    assert igm_numeric(slide, at(0.5, 0, 1e4)).status == IGMStatus.TOO_FAR
    held = rm.RobotModel.from_table(rm.DHTable(
        antecedent=[0, 1], sigma=[0, 0], d=[0, 0.5], lower=[0.3, -np.inf], upper=[0.3, np.inf]
    ))  # fmt: skip
    T = rm.dgm(held, [[0.3, 1.0], [0.4, 1.0]])
    found = igm_numeric(held, T, limits=True)
    assert found.status.tolist() == [IGMStatus.REACHED, IGMStatus.OUTSIDE_LIMITS]


def test_no_false_success_on_wild_poses(rng):
    """Poses drawn at random are either met or refused; refused ones carry a true error."""
    for name in ("rx90", "lab_trr", "xarm5", "panda"):
        model = rm.load(name)
        T = np.array([random_pose(rng, 0.5) for _ in range(40)])
        found = igm_numeric(model, T, limits=True)
        check_met(model, T, found)
        assert np.isnan(found.q[~found.valid]).all()
        assert not found.within_limits[~found.valid].any()
        one = igm_numeric(model, T[7], limits=True)
        assert np.array_equal(one.q, found.q[7], equal_nan=True)
        assert np.array_equal(one.error, found.error[7])
        P = rm.dgm(model, found.closest)
        np.testing.assert_allclose(found.error[:, 0, :3], T[:, :3, 3] - P[:, :3, 3], atol=1e-12)


# --- limits ---------------------------------------------------------------------------------------


def test_limits_are_said_to_be_the_reason():
    """A pose that only a posture outside the limits reaches."""
    table = rm.DHTable.from_rows(
        [{"sigma": 0, "lower": -0.5, "upper": 0.5}, {"sigma": 0, "d": 0.5}]
    )
    model = rm.RobotModel.from_table(table, tool=at(0.5, 0, 0))
    T = rm.dgm(model, [2.0, 0.3])
    inside = igm_numeric(model, T, limits=True)
    assert inside.status == IGMStatus.OUTSIDE_LIMITS
    assert inside.count == 0
    np.testing.assert_allclose(rm.dgm(model, inside.closest), T, atol=1e-6)
    outside = igm_numeric(model, T)
    assert outside.valid.all()
    assert not outside.within_limits.any()


def test_whole_turns():
    """Angles in (-pi, pi], or with limits nearest to q0 inside them, or to mid-range."""
    model = rm.load("ur5")
    q = np.array([1.0, -1.2, 1.4, 0.3, 1.0, 0.5])
    T = rm.dgm(model, q)
    far = q + 2 * np.pi * np.array([-1, 0, 0, 0, -1, 1])
    near = igm_numeric(model, T, q0=far + 0.01)
    assert (np.abs(near.q) <= np.pi).all()
    np.testing.assert_allclose(near.q[0], q, atol=1e-6)
    far[3] += 0.2  # near enough for the same whole turns
    shifted = igm_numeric(model, T, q0=far, limits=True)
    inside = q + 2 * np.pi * np.array([-1, 0, 0, 0, -1, 0])
    np.testing.assert_allclose(shifted.q[0], inside, atol=1e-6)
    assert shifted.within_limits.all()


# --- masks ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("axes", ["world", "tool"])
@pytest.mark.parametrize(
    "mask", [[1, 0, 0, 0, 0, 0], [0, 1, 1, 0, 0, 0], [0, 0, 0, 1, 0, 1], [1, 1, 0, 0, 0, 1],
             [1, 0, 1, 1, 1, 1], POINTING],
)  # fmt: skip
def test_components_are_those_of_the_axes(axes, mask, rng):
    """The asked-for components of the independently computed error vanish, the others are told."""
    model = rm.load("puma560")
    T = rm.dgm(model, postures(model, rng, 10))
    T[:, :3, :3] = T[:, :3, :3] @ [random_rotation(rng) for _ in T]
    found = igm_numeric(model, T, mask=mask, mask_axes=axes, restarts=100)
    valid = found.valid[:, 0]
    assert valid.mean() > 0.7
    error = pose_error(model, found.q[valid, 0], T[valid], axes)
    assert np.abs(error * mask).max() < 2e-6
    np.testing.assert_allclose(found.error[valid, 0], error, atol=1e-6)
    parts = np.linalg.norm((error * mask).reshape(-1, 2, 3), axis=-1).max(axis=-1)
    np.testing.assert_allclose(found.residual[valid, 0], parts, atol=1e-8)


# --- infinite families ----------------------------------------------------------------------------


def test_redundant_arms_are_members_of_a_family(rng):
    """Seven joints: all move along the self-motion, unless the arm is built otherwise."""
    model = rm.load("panda")
    found = igm_numeric(model, rm.dgm(model, postures(model, rng, 5)))
    assert (found.status == IGMStatus.REACHED_FAMILY).all()
    assert found.family_joints.any(axis=-1).all()
    assert not found.free_joints.any()
    J = rm.jacobian(model, found.q[:, 0])
    null = np.linalg.svd(J)[2][:, -1]
    assert (found.family_joints[:, 0] == (np.abs(null) > 1e-5)).all()


def test_joints_off_the_path_keep_the_start():
    """The other arm of a tree stays where it is; it is no redundancy, so it is not marked."""
    table = rm.DHTable(antecedent=[0, 1, 0, 3], sigma=[0, 0, 0, 1], d=[0, 0.5, 0, 0.2])
    model = rm.RobotModel.from_table(table, tool=at(0.5, 0, 0), tip=2)
    T = rm.dgm(model, [0.4, 0.8, 0, 0])
    found = igm_numeric(model, T, q0=[2.0, -1.0, 0.7, 0.1])
    assert found.valid.all()
    assert found.q[0, 2:].tolist() == [0.7, 0.1]
    assert not (found.free_joints | found.family_joints).any()
    assert found.status == IGMStatus.REACHED
    assert igm_numeric(model, T).q[0, 2:].tolist() == [0, 0]


# --- mistakes in the input ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"T": np.eye(3)}, ShapeError, r"\(\.\.\., 4, 4\)"),
        ({"q0": [0, 0]}, ShapeError, "q0"),
        ({"q0": [np.inf] * 6}, InvalidValueError, "q0"),
        ({"mask": "111000"}, InvalidValueError, "mask"),
        ({"mask_axes": "local"}, InvalidValueError, "'world' or 'tool'"),
        ({"orientation_tolerance": np.nan}, InvalidValueError, "orientation_tolerance"),
        ({"restarts": -1}, InvalidValueError, "restarts"),
        ({"restarts": 2.5}, InvalidValueError, "restarts"),
        ({"restarts": 0}, InvalidValueError, "q0"),
        ({"iterations": 0}, InvalidValueError, "iterations"),
        ({"limits": "yes"}, InvalidValueError, "limits"),
        ({"rng": "seed"}, InvalidValueError, "rng"),
    ],
)
def test_mistakes_raise(options, error, words):
    with pytest.raises(error, match=words):
        igm_numeric(rm.load("rx90"), **{"T": np.eye(4), **options})

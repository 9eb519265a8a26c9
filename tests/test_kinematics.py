"""The border of the kinematic models: leading axes, few joints, frames, and what is refused."""

import numpy as np
import pytest
from identities.random_robots import random_model, random_state, table_poses

import robotmodels as rm
from robotmodels import kinematics as rk
from robotmodels.errors import FrameNotFoundError, InvalidValueError, RobotModelsError
from robotmodels.obstacles import Sphere


def task(m):
    return [rk.LinearTask(np.ones((1, m.n)), [0.1])]


# function of a model, q, v and six numbers; shape of one result
FUNCTIONS = {
    "dgm": (lambda m, q, v, x: rm.dgm(m, q), (4, 4)),
    "dgm of a frame": (lambda m, q, v, x: rm.dgm(m, q, 1), (4, 4)),
    "link_poses": (lambda m, q, v, x: rm.link_poses(m, q), ("f", 4, 4)),
    "jacobian": (lambda m, q, v, x: rm.jacobian(m, q), (6, "n")),
    "local jacobian": (lambda m, q, v, x: rm.jacobian(m, q, 1, "local"), (6, "n")),
    "spatial jacobian": (lambda m, q, v, x: rm.jacobian(m, q, reference="world"), (6, "n")),
    "jacobian_rate": (lambda m, q, v, x: rm.jacobian_rate(m, q, v), (6, "n")),
    "dkm": (lambda m, q, v, x: rm.dkm(m, q, v), (6,)),
    "dkm_second_order": (lambda m, q, v, x: rk.dkm_second_order(m, q, v, v), (6,)),
    "ikm": (lambda m, q, v, x: rm.ikm(m, q, x, secondary=v).v, ("n",)),
    "error of ikm": (lambda m, q, v, x: rm.ikm(m, q, x).error, (6,)),
    "second order": (lambda m, q, v, x: rk.ikm_second_order(m, q, v, x).a, ("n",)),
    "tasks and limits": (
        lambda m, q, v, x: rm.ikm(m, q, x, mask="position", tasks=task(m), limits=True).v,
        ("n",),
    ),
    "augmented": (
        lambda m, q, v, x: rm.ikm(m, q, x, mask="position", augmented=task(m)).v,
        ("n",),
    ),
    "second order with a task": (
        lambda m, q, v, x: rk.ikm_second_order(m, q, v, x, mask="position", tasks=task(m)).a,
        ("n",),
    ),
    "coordinates": (
        lambda m, q, v, x: rm.pose_from_coordinates(
            rm.operational_coordinates(rm.dgm(m, q), "euler"), "euler"
        ),
        (4, 4),
    ),
    "static_torque": (lambda m, q, v, x: rk.static_torque(m, q, x, gravity=True), ("n",)),
    "static_wrench": (lambda m, q, v, x: rk.static_wrench(m, q, v).wrench, (6,)),
    "transported_wrench": (lambda m, q, v, x: rk.transported_wrench(x, rm.dgm(m, q)), (6,)),
    "velocity_ellipsoid": (lambda m, q, v, x: rk.velocity_ellipsoid(m, q).radii, (3,)),
    "force_ellipsoid": (lambda m, q, v, x: rk.force_ellipsoid(m, q, other="free").radii, (3,)),
    "manipulability": (lambda m, q, v, x: rk.manipulability(m, q).singular_values, (6,)),
    "weakest": (lambda m, q, v, x: rk.singularity_flags(m, q).weakest, ()),
} | {
    f"{kind} rate": (
        lambda m, q, v, x, kind=kind: rk.coordinate_jacobian_rate(m, q, v, kind),
        (kind.dimension, "n"),
    )
    for kind in rk.OrientationKind
}
BATCHES = ((), (3,), (2, 3), (0,), (2, 0, 3))


@pytest.fixture(params=FUNCTIONS)
def case(request):
    return FUNCTIONS[request.param]


@pytest.fixture(scope="module")
def model():
    """A tree that Pinocchio orders otherwise, with fixed frames."""
    model = random_model(np.random.default_rng(3), f=7, tree=True, fixed=True, drive=True)
    assert model.n >= 3
    assert not model.twin.in_table_order
    return model


def check_batches(case, model, batches):
    function, core = case
    core = tuple({"n": model.n, "f": model.f}.get(k, k) for k in core)
    for batch in batches:
        rng = np.random.default_rng(5)
        arrays = (*random_state(model, rng, *batch)[:2], rng.normal(size=(*batch, 6)))
        result = function(model, *arrays)
        assert result.shape == (*batch, *core)
        assert result.dtype == np.float64
        assert result.flags.c_contiguous
        for index in np.ndindex(*batch):
            single = function(model, *(x[index] for x in arrays))
            np.testing.assert_allclose(result[index], single, rtol=1e-9, atol=1e-12)


def test_leading_axes_are_the_batch(case, model):
    check_batches(case, model, BATCHES)


@pytest.mark.parametrize("sigma", [[0], [1], [2, 0, 2], [2]], ids=str)
def test_one_joint_and_none(case, sigma):
    rows = [{"sigma": s, "d": 0.2, "alpha": 0.3, "r": 0.1} for s in [*sigma, 2]]
    check_batches(case, rm.RobotModel.from_table(rm.DHTable.from_rows(rows)), ((), (3,)))


def test_frames_by_name_by_number_and_the_tool(model):
    q, v, _ = random_state(model, np.random.default_rng(5))
    poses = np.concatenate([[model.base], table_poses(model, q)])
    np.testing.assert_allclose(rm.dgm(model, q, "base"), model.base, atol=1e-15)
    np.testing.assert_array_equal(rm.dgm(model, q, "tool"), rm.dgm(model, q))
    for j, name in enumerate(["base", *model.table.names]):
        for frame in (j, np.int64(j), name):
            np.testing.assert_allclose(rm.dgm(model, q, frame), poses[j], atol=1e-12)
    # whatever has been asked before
    for frame in ("J99", "", -1, 8, True, 1.0, 2.5, ["tool"], np.nan):
        for call in (
            lambda frame: rm.dgm(model, q, frame),
            lambda frame: rm.dgm(model, [q], frame),
            lambda frame: rm.jacobian(model, q, frame),
            lambda frame: rm.jacobian_rate(model, q, v, frame),
            lambda frame: rm.ikm(model, q, np.zeros(6), frame),
        ):
            with pytest.raises(FrameNotFoundError, match="Known"):
                call(frame)
    for reference in ("LOCAL", "", None, 0, ["local"]):
        for call in (
            lambda reference: rm.jacobian(model, q, reference=reference),
            lambda reference: rm.jacobian(model, [q], reference=reference),
            lambda reference: rm.jacobian_rate(model, q, v, reference=reference),
            lambda reference: rm.ikm(model, q, np.zeros(6), reference=reference),
        ):
            with pytest.raises(InvalidValueError, match="world_aligned"):
                call(reference)


# --- what is refused ---------------------------------------------------------------------------


def test_a_bad_vector_is_named(case, model):
    v, x = np.zeros(model.n), np.ones(6)
    for bad in (np.zeros(model.n + 1), np.full(model.n, np.nan), ["0"] * model.n, None):
        with pytest.raises(RobotModelsError, match=r"^q"):
            case[0](model, bad, v, x)


class Short:
    """A criterion whose gradient lacks a joint."""

    def gradient(self, model, q):
        return q[..., :-1]


def refused(arm, seven):
    """Calls with one mistake each, and what their message names."""
    q, x, p = np.zeros(6), np.zeros(6), np.zeros(7)
    two, three, six = np.zeros((2, 7)), np.zeros((3, 7)), np.eye(6)
    ball, here = Sphere([0, 0, 0], 0.1), [1, 1, 1, 0, 0, 0]
    disc = rk.velocity_ellipsoid(arm, q)
    # the inverse model
    yield "model", lambda: rm.ikm("rx90", q, x)
    yield "mask", lambda: rm.ikm(arm, q, x, mask=[0] * 6)
    yield "method", lambda: rm.ikm(arm, q, x, method="dls")
    yield "parentheses", lambda: rm.ikm(arm, q, x, method=rk.DampedInverse)
    yield "joint_weights", lambda: rm.ikm(arm, q, x, joint_weights=[0.0] * 6)
    yield "length", lambda: rm.ikm(arm, q, x, length=np.inf)
    yield "gradient", lambda: rm.ikm(arm, q, x, secondary=Short())
    yield "parentheses", lambda: rm.ikm(arm, q, x, secondary=Short)
    yield "tasks", lambda: rm.ikm(arm, q, x, tasks=[1.0])
    yield "augmented", lambda: rm.ikm(arm, q, x, augmented=[rk.JointTask])
    yield "limits", lambda: rm.ikm(arm, q, x, limits=3.0)
    yield "check the units", lambda: rm.ikm(arm, q, x + 1e160)
    yield "v: ", lambda: rm.dkm(arm, q, x[:5])
    yield "v: ", lambda: rm.jacobian_rate(arm, q, x * np.nan)
    yield "threshold", lambda: rk.FilteredInverse(0.0)
    yield "threshold", lambda: rk.DampedInverse(0.0, damping=rk.Damping.MANIPULABILITY)
    yield "a member of Damping", lambda: rk.DampedInverse(damping="none")
    # bounds
    yield "NaN", lambda: rk.JointBounds(velocity=np.nan)
    yield "upper", lambda: rk.JointBounds(upper=two)
    yield r"\(7,\)", lambda: rk.JointBounds(velocity=[1.0, 2.0]).velocity_bounds(seven, p)
    yield "lower <= upper", lambda: rk.JointBounds(lower=2, upper=1).velocity_bounds(seven, p)
    yield "step", lambda: rk.JointBounds().acceleration_bounds(seven, p, p)
    yield "acceleration", lambda: rk.JointBounds().velocity_bounds(seven, p, p)
    yield "v:", lambda: rk.JointBounds(step=0.1).conflicts(seven, p, accelerations=True)
    both = rk.JointBounds(acceleration=1.0, step=0.1)
    yield "broadcast", lambda: both.velocity_bounds(seven, two, three)
    # criteria
    yield "q_ref", lambda: rk.PostureCriterion(two)
    yield "weights", lambda: rk.PostureCriterion(p, p - 1.0)
    yield "lower <= upper", lambda: rk.JointLimitCriterion(lower=1, upper=0).value(seven, p)
    yield "load", lambda: rk.JointLimitCriterion().value("panda", p)
    yield "margin", lambda: rk.NearLimitCriterion(margin=1.5)
    yield "'x'", lambda: rk.ManipulabilityCriterion(frame="x").value(seven, p)
    yield "at least one", lambda: rk.ObstacleCriterion([])
    yield "expected Sphere", lambda: rk.ObstacleCriterion([(0, 0, 0)])
    yield "pairs", lambda: rk.ObstacleCriterion([ball], segments=[3])
    yield "99", lambda: rk.ObstacleCriterion([ball], segments=[(0, 99)]).value(seven, p)
    # tasks
    yield "reference", lambda: rk.TwistTask(x, reference="tool")
    yield "no", lambda: rk.TwistTask(x, frame="no").level(seven, p)
    yield "shape of q", lambda: rk.TwistTask(x).level(seven, p, two)
    yield "sequence", lambda: rk.JointTask([0.0], joints="panda_joint1")
    yield "different", lambda: rk.JointTask([0.0, 0.0], joints=[1, 1])
    yield "columns", lambda: rk.JointTask([0.0], joints=[0.5]).level(seven, p)
    yield "0 to 6", lambda: rk.JointTask([0.0], joints=[-1]).level(seven, p)
    same = [0, seven.table.joint_names[0]]
    yield "different", lambda: rk.JointTask([0, 0], joints=same).level(seven, p)
    yield "m, n", lambda: rk.LinearTask([1.0], [1.0])
    yield "7 columns", lambda: rk.LinearTask(six[:1], [1.0]).level(seven, p)
    yield "of the 3", lambda: rk.LinearTask(two[:, None], [1.0]).level(seven, three)
    yield "LinearTask", lambda: rk.FunctionTask(p, [0.0])
    yield r"\.\.\., m", lambda: rk.FunctionTask(np.sin, 0.0)
    yield "gradient", lambda: rk.FunctionTask(lambda q: q[:, :3], [0.0]).level(seven, p)
    yield "gradient_rate", lambda: rk.FunctionTask(np.sin, [0.0], 3.0)
    # coordinates
    yield "kind", lambda: rm.operational_coordinates(np.eye(4), "zxz")
    yield "psi", lambda: rm.pose_from_coordinates(p, "rpy")
    yield "psi", lambda: rk.coordinate_jacobian(arm, q, "rpy", near=p)
    yield "length 1", lambda: rm.pose_from_coordinates([0, 0, 0, 1, 1, 0, 0], "quaternion")
    yield "sequence", lambda: rk.continuous_coordinates(np.eye(4), "rpy")
    yield "each sequence", lambda: rk.continuous_coordinates([np.eye(4)], "rpy", near=two[:, :6])
    # statics
    yield "broadcast", lambda: rk.static_torque(seven, two, np.zeros((3, 6)))
    yield "last row", lambda: rk.transported_wrench(x, np.ones((4, 4)))
    # ellipsoids
    yield "TwistPart", lambda: rk.velocity_ellipsoid(arm, q, "sideways")
    yield "6 joints", lambda: rk.velocity_ellipsoid(arm, q, joint_velocity=[1.0, 2.0])
    yield "joint_2", lambda: rk.velocity_ellipsoid(arm, q, joint_velocity=1 - 2 * six[1])
    yield "joint_2", lambda: rk.force_ellipsoid(arm, q, joint_torque=1 - six[1])
    yield "direction", lambda: disc.radius_along([0, 0, 0])
    yield "axes", lambda: rk.Ellipsoid(disc.quantity, p[:3], np.eye(2), p[:3], np.int64(3))
    yield "wrench", lambda: rk.manipulability(arm, q).force_transmission(np.zeros(6))
    # singular configurations
    yield "9", lambda: rk.classify_singularity(arm, q, axes=9)
    yield "5", lambda: rk.classify_singularity(arm, q, frame=3, axes=5)
    yield "point", lambda: rk.classify_singularity(arm, q, mask=here, point=4)
    yield "axes", lambda: rk.classify_singularity(arm, q, mask=[1, 1, 0, 0, 0, 0], axes=4)
    yield "weights", lambda: rk.nearest_singularity(arm, q, weights=1 - six[5])
    yield "limits", lambda: rk.nearest_singularity(arm, q, limits="yes")


def test_mistakes_are_named():
    for words, call in refused(rm.load("rx90"), rm.load("panda")):
        with pytest.raises(RobotModelsError, match=words):
            call()

"""Velocity and force ellipsoids and manipulability: definition, duality, invariance, flat ones."""

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import (
    any_models,
    models,
    random_model,
    random_state,
    robot_size,
    seeds,
)

import robotmodels as rm
from robotmodels import se3
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.kinematics import (
    Ellipsoid,
    EllipsoidQuantity,
    ManipulabilityCriterion,
    OtherPart,
    TwistPart,
    force_ellipsoid,
    manipulability,
    velocity_ellipsoid,
)

H = np.pi / 2
PARTS = list(TwistPart)
OTHERS = list(OtherPart)
ROWS = {TwistPart.LINEAR: slice(0, 3), TwistPart.ANGULAR: slice(3, 6)}


def close(actual, expected, tolerance):
    assert np.shape(actual) == np.shape(expected)
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance)


def planar(*lengths):
    """Revolute joints about parallel axes, the last length is the tool's."""
    rows = [{"sigma": 0, "d": d} for d in (0.0, *lengths[:-1])]
    tool = se3.translation(lengths[-1], 0.0, 0.0)
    return rm.RobotModel.from_table(rm.DHTable.from_rows(rows), tool=tool, name="planar")


def matrix(ellipsoid):
    """``U diag(r^2) U^T``: the same for every choice of axes."""
    return (ellipsoid.axes * ellipsoid.radii[..., None, :] ** 2) @ np.swapaxes(
        ellipsoid.axes, -1, -2
    )


# ---------------------------------------------------------------- what it is


@pytest.mark.parametrize("part", PARTS)
@given(model=any_models(), seed=seeds)
def test_it_is_the_image_of_the_ball(part, model, seed):
    """With the other half free: J S S J^T. Its axes are a rotation, its radii are sorted."""
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng, 2)
    scale = rng.uniform(0.1, 3.0, size=model.n)
    for frame in (None, 1):
        found = velocity_ellipsoid(model, q, part, frame, scale)
        J = rm.jacobian(model, q, frame)[:, ROWS[part]] * scale
        size = max(robot_size(model, x) for x in q) * np.linalg.norm(scale)
        close(matrix(found), J @ np.swapaxes(J, -1, -2), 1e-13 * size**2)
        close(found.centre, rm.dgm(model, q, frame)[:, :3, 3], 0)
        close(np.linalg.det(found.axes), np.ones(2), 1e-12)
        close(np.swapaxes(found.axes, -1, -2) @ found.axes, np.tile(np.eye(3), (2, 1, 1)), 1e-13)
        assert (np.diff(found.radii) <= 0).all()
        close(found.rank, (found.radii > 0).sum(axis=-1), 0)
        # no joint velocity of the ball leaves it, and some reach its boundary
        x = rng.normal(size=(50, model.n))
        v = (x / np.linalg.norm(x, axis=-1, keepdims=True)) @ np.swapaxes(J, -1, -2)
        for direction in rng.normal(size=(3, 3)):
            unit = direction / np.linalg.norm(direction)
            extent = found.extent_along(direction)
            assert ((v @ unit).max(axis=-1) <= extent + 1e-8 * size).all()
            close(extent, np.linalg.norm(unit @ J, axis=-1), 1e-8 * size)


@given(model=models(max_frames=8, fixed=False), seed=seeds)
def test_other_half_at_zero_is_a_cut(model, seed):
    """Joint velocities that leave the other half at rest: by an independent null space."""
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng)
    size = robot_size(model, q)
    for part, other in (PARTS, PARTS[::-1]):
        J = rm.jacobian(model, q)
        hidden = J[ROWS[other]]
        _, s, Vt = np.linalg.svd(hidden)
        largest = max(np.linalg.norm(J), 1.0)
        rank = int((s > 1e-7 * largest).sum())
        if rank < len(s) and s[rank] > 1e-12 * largest:
            continue  # neither singular nor regular: the two rules may differ
        cut = J[ROWS[part]] @ Vt[rank:].T
        found = velocity_ellipsoid(model, q, part, other=OtherPart.ZERO)
        free = velocity_ellipsoid(model, q, part)
        close(matrix(found), cut @ cut.T, 1e-8 * size**2)
        # a part of the whole
        for direction in rng.normal(size=(5, 3)):
            assert found.extent_along(direction) <= free.extent_along(direction) + 1e-9 * size
        assert found.volume <= free.volume * (1 + 1e-9) + 1e-12


def test_a_planar_arm_by_hand():
    """Right angle between links of 0.3 and 0.2 m; and stretched out, where it is a segment."""
    arm = planar(0.3, 0.2)
    bent = velocity_ellipsoid(arm, [0.0, H])
    J = np.array([[-0.2, -0.2], [0.3, 0.0]])
    radii = np.linalg.svd(J, compute_uv=False)
    close(bent.radii, [*radii, 0.0], 1e-15)
    close(np.abs(bent.axes[:, 2]), [0, 0, 1], 1e-15)
    close(bent.centre, [0.3, 0.2, 0.0], 1e-15)
    assert bent.quantity is EllipsoidQuantity.LINEAR_VELOCITY
    assert bent.quantity.unit == "m/s"
    assert (int(bent.rank), float(bent.volume), float(bent.isotropy)) == (2, 0.0, 0.0)
    straight = velocity_ellipsoid(arm, [H, 0.0])
    close(straight.radii, [np.hypot(0.5, 0.2), 0.0, 0.0], 1e-15)
    close(np.abs(straight.axes[:, 0]), [1, 0, 0], 1e-15)
    turning = velocity_ellipsoid(arm, [H, 0.0], TwistPart.ANGULAR)
    close(turning.radii, [np.sqrt(2), 0, 0], 1e-15)
    assert turning.quantity.unit == "rad/s"
    # its forces: any along the arm, any across the plane
    force = force_ellipsoid(arm, [H, 0.0])
    assert force.radii[:2].tolist() == [np.inf, np.inf]
    close(force.radii[2], 1 / np.hypot(0.5, 0.2), 1e-14)
    close(force.radius_along([0, 1, 0]), np.inf, 0)
    close(force.radius_along([1, 0, 0]), 1 / np.hypot(0.5, 0.2), 1e-14)
    assert np.isinf(force.volume)
    assert (force.quantity.unit, int(force.rank), float(force.isotropy)) == ("N", 1, 0.0)
    assert force_ellipsoid(arm, [H, 0.0], TwistPart.ANGULAR).quantity.unit == "N m"


# ---------------------------------------------------------------- duality


@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("part", PARTS)
@given(model=any_models(), seed=seeds)
def test_forces_are_dual_to_velocities(part, other, model, seed):
    """Same axes, reciprocal radii; widths and radii along any direction are reciprocal."""
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng, 2)
    torque = rng.uniform(0.5, 2.0, size=model.n)
    force = force_ellipsoid(model, q, part, None, torque, other)
    opposite = OtherPart.FREE if other is OtherPart.ZERO else OtherPart.ZERO
    velocity = velocity_ellipsoid(model, q, part, None, 1 / torque, opposite)
    with np.errstate(divide="ignore"):
        np.testing.assert_allclose(force.radii, 1 / velocity.radii[:, ::-1], rtol=1e-12)
    close(force.rank, velocity.rank, 0)
    close(np.abs(np.einsum("...ij,...ij->...j", force.axes, velocity.axes[..., ::-1])),
          np.ones((2, 3)), 1e-12)  # fmt: skip
    close(np.linalg.det(force.axes), np.ones(2), 1e-12)
    # along the axes too, where flat ellipsoids have no velocity and forces no bound
    for direction in (*rng.normal(size=(3, 3)), *np.moveaxis(force.axes, -1, 0)):
        with np.errstate(divide="ignore"):
            np.testing.assert_allclose(
                force.radius_along(direction), 1 / velocity.extent_along(direction), rtol=1e-9
            )
            np.testing.assert_allclose(
                velocity.radius_along(direction), 1 / force.extent_along(direction), rtol=1e-9
            )


# ---------------------------------------------------------------- batches and mistakes


@pytest.mark.parametrize("function", [velocity_ellipsoid, force_ellipsoid])
@pytest.mark.parametrize("batch", [(), (1,), (2, 3), (0,), (2, 0)], ids=str)
def test_leading_axes_are_the_batch(function, batch, rng):
    model = random_model(rng, f=7, tree=True, fixed=True)
    q, _, _ = random_state(model, rng, *batch)
    for other in OTHERS:
        found = function(model, q, other=other)
        assert found.radii.shape == (*batch, 3)
        assert found.volume.shape == found.isotropy.shape == found.rank.shape == batch
        assert found.radius_along([1.0, 0.0, 0.0]).shape == batch
        assert not found.radii.flags.writeable
        for i in np.ndindex(*batch):
            single, row = function(model, q[i], other=other), found.at(i)
            assert row.radii.shape == (3,)
            assert row.quantity is found.quantity
            np.testing.assert_allclose(row.radii, single.radii, rtol=1e-9, atol=1e-14)
            close(row.centre, single.centre, 1e-13)
    found = manipulability(model, q)
    assert found.measure.shape == found.condition.shape == found.rank.shape == batch
    assert found.velocity_transmission(np.eye(6)[0]).shape == batch


@pytest.mark.parametrize(
    ("function", "name"),
    [(velocity_ellipsoid, "joint_velocity"), (force_ellipsoid, "joint_torque")],
)
def test_mistakes_are_named(function, name):
    arm, q = rm.load("rx90"), np.zeros(6)
    found = velocity_ellipsoid(arm, q)
    for call, words in (
        (lambda: function(arm, q[:5]), "^q: "),
        (lambda: function(arm, q, "sideways"), "TwistPart"),
        (lambda: function(arm, q, other="nothing"), "OtherPart"),
        (lambda: function(arm, q, **{name: [1.0, 2.0]}), f"{name}.*6 joints"),
        (lambda: function(arm, q, **{name: [1, -1.0, 1, 1, 1, 1]}), f"{name}.*'joint_2'"),
        (lambda: function(arm, q, **{name: [1, np.inf, 1, 1, 1, 1]}), f"{name}.*'joint_2'"),
        (lambda: function(arm, q, length=0.0), "length"),
        (lambda: function(arm, q, tolerance=0.0), "tolerance"),
        (lambda: force_ellipsoid(arm, q, joint_torque=[1, 0, 1, 1, 1, 1]), "above 0"),
        (lambda: found.radius_along([0, 0, 0]), "direction"),
        (lambda: found.extent_along([1, 0]), "direction"),
        (lambda: function(arm, np.zeros((3, 6))).radius_along(np.eye(3)[:2]), "broadcast"),
        (lambda: found.boundary(2, 10), "boundary"),
        (
            lambda: Ellipsoid(found.quantity, np.zeros(3), np.eye(2), np.ones(3), np.int64(3)),
            "axes",
        ),
        (lambda: manipulability(arm, q, mask=[0] * 6), "mask"),
        (lambda: manipulability(arm, q, mask=[1, 1, 1]), "mask"),
        (lambda: manipulability(arm, q, length=-1.0), "length"),
        (lambda: manipulability(arm, q).velocity_transmission(np.ones(5)), "twist"),
        (lambda: manipulability(arm, q).force_transmission(np.zeros(6)), "wrench"),
    ):
        with pytest.raises((InvalidValueError, ShapeError), match=words):
            call()


# ---------------------------------------------------------------- manipulability


@given(model=any_models(), seed=seeds)
def test_singular_values_are_those_of_the_rows(model, seed):
    rng = np.random.default_rng(seed)
    q, _, _ = random_state(model, rng, 2)
    mask = rng.integers(0, 2, size=6)
    mask[rng.integers(6)] = 1
    keep = mask == 1
    m = int(keep.sum())
    length, scale = rng.uniform(0.3, 2.0), rng.uniform(0.5, 2.0, size=model.n)
    found = manipulability(model, q, None, "local", mask, scale, length)
    mixed = keep[:3].any() and keep[3:].any()
    weights = np.repeat((1 / length if mixed else 1.0, 1.0), 3)[keep]
    A = weights[:, None] * rm.jacobian(model, q, None, "local")[:, keep] * scale
    size = max(robot_size(model, x) for x in q) * 10
    s = np.zeros((2, m))
    s[:, : min(m, model.n)] = np.linalg.svd(A, compute_uv=False)
    close(found.singular_values, s, 1e-8 * size)
    wide, tall = A @ np.swapaxes(A, -1, -2), np.swapaxes(A, -1, -2) @ A
    gram = wide if m <= model.n else tall
    close(found.measure**2, np.linalg.det(gram), 1e-8 * size ** (2 * min(m, model.n)))


@pytest.mark.parametrize("name", ["planar_2r", "lab_trr", "cobra_s600", "xarm5", "rx90", "iiwa14"])
def test_measure_is_that_of_the_criterion(name):
    """Whatever the number of joints: the product of the min(rows, joints) singular values."""
    arm = rm.load(name)
    q = np.random.default_rng(3).uniform(0.2, 1.0, size=(20, arm.n))
    for length in (1.0, 0.4):
        criterion = ManipulabilityCriterion(length=length)
        found = manipulability(arm, q, length=length)
        np.testing.assert_allclose(found.measure, criterion.value(arm, q), rtol=1e-12)
        values = np.linalg.svd(found.weights[:, None] * found.jacobian, compute_uv=False)
        np.testing.assert_allclose(found.condition, values[:, 0] / values[:, -1], rtol=1e-12)
    mask = [1, 1, 0, 0, 0, 1]
    criterion = ManipulabilityCriterion(mask=mask)
    np.testing.assert_allclose(
        manipulability(arm, q, mask=mask).measure, criterion.value(arm, q), rtol=1e-12, atol=1e-16
    )


@given(model=models(max_frames=8, prismatic=True), seed=seeds)
def test_ratios_along_twists_and_wrenches(model, seed):
    """By least squares: joint velocities of a twist, torques of a wrench; the length is no part."""
    rng = np.random.default_rng(seed)
    q, v, _ = random_state(model, rng)
    J = rm.jacobian(model, q)
    s = np.linalg.svd(J, compute_uv=False)
    if not s.size or s[0] < 1e-6 or ((s < 1e-6 * s[0]) & (s > 1e-13 * s[0])).any():
        return
    twist, w = J @ v, rng.normal(size=6)
    least = np.linalg.lstsq(J, twist, rcond=1e-9)[0]
    for length in (0.2, 1.0, 3.0):
        found = manipulability(model, q, length=length)
        np.testing.assert_allclose(
            found.velocity_transmission(twist), 1 / np.linalg.norm(least), rtol=1e-6
        )
        np.testing.assert_allclose(
            found.force_transmission(w), 1 / np.linalg.norm(J.T @ w), rtol=1e-6
        )
        # both along the same six numbers: what is easy to move is hard to push
        both = found.velocity_transmission(w) * found.force_transmission(w)
        assert found.rank < 6 or both * (w @ w) <= 1 + 1e-9

"""Velocity and force ellipsoids and manipulability: definition, duality, invariance, flat ones."""

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import any_models, models, random_state, robot_size, seeds, within

import robotmodels as rm
from robotmodels import se3
from robotmodels.kinematics import (
    EllipsoidQuantity,
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
        within(matrix(found), J @ np.swapaxes(J, -1, -2), 1e-13 * size**2)
        within(found.centre, rm.dgm(model, q, frame)[:, :3, 3], 0)
        within(np.linalg.det(found.axes), np.ones(2), 1e-12)
        within(np.swapaxes(found.axes, -1, -2) @ found.axes, np.tile(np.eye(3), (2, 1, 1)), 1e-13)
        assert (np.diff(found.radii) <= 0).all()
        within(found.rank, (found.radii > 0).sum(axis=-1), 0)
        # no joint velocity of the ball leaves it, and some reach its boundary
        x = rng.normal(size=(50, model.n))
        v = (x / np.linalg.norm(x, axis=-1, keepdims=True)) @ np.swapaxes(J, -1, -2)
        for direction in rng.normal(size=(3, 3)):
            unit = direction / np.linalg.norm(direction)
            extent = found.extent_along(direction)
            assert ((v @ unit).max(axis=-1) <= extent + 1e-8 * size).all()
            within(extent, np.linalg.norm(unit @ J, axis=-1), 1e-8 * size)


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
        within(matrix(found), cut @ cut.T, 1e-8 * size**2)
        # a part of the whole
        for direction in rng.normal(size=(5, 3)):
            assert found.extent_along(direction) <= free.extent_along(direction) + 1e-9 * size
        assert found.volume <= free.volume * (1 + 1e-9) + 1e-12


def test_a_planar_arm_by_hand():
    """Right angle between links of 0.3 and 0.2 m; and stretched out, where it is a segment."""
    table = rm.DHTable.from_rows([{}, {"d": 0.3}])
    arm = rm.RobotModel.from_table(table, tool=se3.translation(0.2, 0.0, 0.0))
    bent = velocity_ellipsoid(arm, [0.0, H])
    J = np.array([[-0.2, -0.2], [0.3, 0.0]])
    within(bent.radii, [*np.linalg.svd(J, compute_uv=False), 0.0], 1e-15)
    within(np.abs(bent.axes[:, 2]), [0, 0, 1], 1e-15)
    assert bent.quantity is EllipsoidQuantity.LINEAR_VELOCITY
    assert (int(bent.rank), float(bent.volume), float(bent.isotropy)) == (2, 0.0, 0.0)
    straight = velocity_ellipsoid(arm, [H, 0.0])
    within(straight.radii, [np.hypot(0.5, 0.2), 0.0, 0.0], 1e-15)
    turning = velocity_ellipsoid(arm, [H, 0.0], TwistPart.ANGULAR)
    within(turning.radii, [np.sqrt(2), 0, 0], 1e-15)
    assert [each.quantity.unit for each in (bent, turning)] == ["m/s", "rad/s"]
    # its forces: any along the arm, any across the plane
    force = force_ellipsoid(arm, [H, 0.0])
    assert force.radii[:2].tolist() == [np.inf, np.inf]
    within(force.radii[2], 1 / np.hypot(0.5, 0.2), 1e-14)
    within(force.radius_along([1, 0, 0]), 1 / np.hypot(0.5, 0.2), 1e-14)
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
    within(force.rank, velocity.rank, 0)
    within(np.abs(np.einsum("...ij,...ij->...j", force.axes, velocity.axes[..., ::-1])),
          np.ones((2, 3)), 1e-12)  # fmt: skip
    within(np.linalg.det(force.axes), np.ones(2), 1e-12)
    # along the axes too, where flat ellipsoids have no velocity and forces no bound
    for direction in (*rng.normal(size=(3, 3)), *np.moveaxis(force.axes, -1, 0)):
        with np.errstate(divide="ignore"):
            np.testing.assert_allclose(
                force.radius_along(direction), 1 / velocity.extent_along(direction), rtol=1e-9
            )
            np.testing.assert_allclose(
                velocity.radius_along(direction), 1 / force.extent_along(direction), rtol=1e-9
            )


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
    within(found.singular_values, s, 1e-8 * size)
    wide, tall = A @ np.swapaxes(A, -1, -2), np.swapaxes(A, -1, -2) @ A
    gram = wide if m <= model.n else tall
    within(found.measure**2, np.linalg.det(gram), 1e-8 * size ** (2 * min(m, model.n)))
    top, last = found.singular_values[:, [0, min(m, model.n) - 1]].T
    expected = np.divide(top, last, out=np.full(2, np.inf), where=last > 0)
    np.testing.assert_allclose(found.condition, expected)


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

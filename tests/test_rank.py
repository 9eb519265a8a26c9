"""Ranks and dimensions of operational spaces: known arms, and invariance on random robots."""

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import models, random_pose, random_state

import robotmodels as rm
from robotmodels.errors import FrameNotFoundError, InvalidValueError, ShapeError
from robotmodels.kinematics import jacobian_rank, operational_dimension
from robotmodels.kinematics.lengths import characteristic_length
from robotmodels.kinematics.singular.task import singular_task, task_derivatives, task_jacobians

# robot: dimension, of position, of orientation, joints, what is never produced in world axes
KNOWN = {
    "rx90": (6, 3, 3, 6, ""),
    "gantry": (6, 3, 3, 6, ""),
    "iiwa14": (6, 3, 3, 7, ""),
    "cobra_s600": (4, 3, 1, 4, "wx, wy"),
    "planar_3r": (3, 2, 1, 3, "vz, wx, wy"),
    "lab_trr": (3, 3, 1, 3, "wx, wz"),
    "xarm5": (5, 3, 3, 5, ""),
}


@pytest.mark.parametrize("name", KNOWN)
def test_dimension_of_known_robots(name):
    arm = rm.load(name)
    found = operational_dimension(arm)
    M, position, orientation, joints, never = KNOWN[name]
    assert found.dimension == M
    assert (found.position_dimension, found.orientation_dimension) == (position, orientation)
    assert (found.joints, found.redundancy) == (joints, joints - M)
    assert found.never_in_world == never
    assert found.gap > 1e6
    assert found.singular_values[M - 1] > 1e-2
    q = np.random.default_rng(1).uniform(-2, 2, size=(20, arm.n))
    for row in found.missing_in_world:
        assert np.abs(row @ rm.jacobian(arm, q)).max() < 1e-12


@given(case=models(max_frames=8))
def test_invariance_under_base_frame_and_units(case):
    """Rank and singular values see neither where the robot stands nor its unit of length."""
    rng = np.random.default_rng(7)
    q = random_state(case, rng, 3)[0]
    found = jacobian_rank(case, q)
    moved = jacobian_rank(case.with_base(random_pose(rng)), q)
    assert moved.length == found.length
    np.testing.assert_array_equal(moved.rank, found.rank)
    np.testing.assert_allclose(moved.singular_values, found.singular_values, atol=1e-12)
    # another point of the last body: other singular values, the same rank
    tool = case.with_tool(random_pose(rng), tip=case.tip)
    np.testing.assert_array_equal(jacobian_rank(tool, q).rank, found.rank)
    table, k = case.table, 1000.0
    prismatic = table.sigma[table.joint_rows] == 1
    stretch = np.where(prismatic, k, 1.0)
    big = table.replace(b=k * table.b, d=k * table.d, r=k * table.r,
                        lower=stretch * table.lower, upper=stretch * table.upper)  # fmt: skip
    E = case.tool.copy()
    E[:3, 3] *= k
    large = jacobian_rank(case.with_table(big).with_tool(E, tip=case.tip), q * stretch)
    np.testing.assert_array_equal(large.rank, found.rank)
    if found.length != 1.0:
        np.testing.assert_allclose(large.length, k * found.length, rtol=1e-12)
        np.testing.assert_allclose(large.singular_values, found.singular_values, atol=1e-11)


@given(case=models(max_frames=8))
def test_dimension_on_random_robots(case):
    """The dimension is the rank of the screws at a random configuration, in any frame."""
    found = operational_dimension(case)
    q = np.random.default_rng(11).uniform(-1, 1, size=case.n)
    lower, upper = np.maximum(case.lower, -3.0), np.minimum(case.upper, 3.0)
    q = 0.5 * (lower + upper) + 0.5 * q * (upper - lower)
    if found.gap > 1e3:  # joints that are nearly but not quite parallel have ranks of a size
        for reference in ("world_aligned", "local", "world"):
            J = rm.jacobian(case, q, reference=reference)
            assert np.linalg.matrix_rank(J, tol=1e-9 * max(1.0, np.abs(J).max())) <= found.dimension
    path = case.twin.frame(None).path
    assert found.joints == sum(case.table.sigma[j - 1] != 2 for j in path)
    assert found.dimension <= min(6, found.joints)
    J = rm.jacobian(case, q)
    assert np.abs(found.missing_in_world @ J).max(initial=0.0) < 1e-9
    J = rm.jacobian(case, q, reference="local")
    assert np.abs(found.missing_in_frame @ J).max(initial=0.0) < 1e-9


@given(case=models(max_frames=7))
def test_derivatives_by_finite_differences(case):
    for mask, axes in ((None, "world"), ([1, 0, 1, 1, 1, 0], "tool")):
        task = singular_task(case, mask=mask, mask_axes=axes)
        q = random_state(case, np.random.default_rng(2))[0]
        found = task_derivatives(task, q)
        assert found.shape == (case.n, task.rows, case.n)
        scale = max(1.0, float(np.abs(task_jacobians(task, q)).max()))
        for i in range(case.n):
            h = np.eye(case.n)[i] * task.joint_scale
            steps = [
                (task_jacobians(task, q + e * h) - task_jacobians(task, q - e * h)) / (2 * e)
                for e in (1e-3, 5e-4)
            ]
            limit = (4 * steps[1] - steps[0]) / 3
            np.testing.assert_allclose(found[i], limit, rtol=0, atol=1e-9 * scale)


def test_characteristic_length():
    assert characteristic_length(rm.load("rx90")) == 0.9
    assert characteristic_length(rm.load("gantry")) == 1.0  # no axis is at a distance
    limited = rm.load("rx90")
    free = limited.with_table(limited.table.replace(lower=[-9.0] * 6, upper=[9.0] * 6))
    assert characteristic_length(free) == characteristic_length(limited)


def test_mistakes_are_refused():
    arm, q = rm.load("rx90"), np.zeros(6)
    for call, error, words in (
        (lambda: jacobian_rank(arm, q, mask=[1, 1, 1]), ShapeError, "mask"),
        (lambda: jacobian_rank(arm, q, mask=[0] * 6), InvalidValueError, "mask"),
        (lambda: jacobian_rank(arm, q, length=np.nan), InvalidValueError, "length"),
        (lambda: jacobian_rank(arm, q, tolerance=0.0), InvalidValueError, "tolerance"),
        (lambda: jacobian_rank(arm, q, mask_axes="base"), InvalidValueError, "mask_axes"),
        (lambda: jacobian_rank(arm, q, frame="nope"), FrameNotFoundError, "nope"),
        (lambda: jacobian_rank(arm, np.zeros(5)), ShapeError, "q"),
        (lambda: operational_dimension(arm, samples=0), InvalidValueError, "samples"),
        (lambda: operational_dimension(arm, rng="seed"), InvalidValueError, "rng"),
        (lambda: operational_dimension("rx90"), InvalidValueError, "model"),
    ):
        with pytest.raises(error, match=words):
            call()

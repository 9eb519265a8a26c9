"""Following poses by joint velocities."""

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.errors import InvalidValueError
from robotmodels.kinematics import IKMStatus, JointBounds, JointLimitCriterion, NearLimitCriterion
from robotmodels.se3 import rotation
from robotmodels.trajectories import straight_line
from robotmodels.trajectories.resolved_motion import resolved_motion

PANDA = [1.45, -0.74, -1.41, -0.72, 0.58, 2.38, 0.22]
LINES = [
    (PANDA, [0.2, 0.19, -0.53]),
    ([1.54, -0.82, 0.94, -2.44, -0.92, 2.71, -0.52], [-0.04, 0.18, -0.57]),
    ([1.49, -0.37, -0.63, -2.42, 0.7, 0.98, -1.57], [-0.11, -0.2, -0.56]),
]


@pytest.fixture(scope="module")
def panda():
    return rm.load("panda")


def line_of(model, q, way, duration=4.0, turn=None):
    start = rm.dgm(model, q)
    goal = start.copy()
    goal[:3, 3] += way
    if turn is not None:
        goal[:3, :3] = rotation("z", turn)[:3, :3] @ goal[:3, :3]
    return straight_line(start, goal, duration=duration)


def margin(model, q):
    return np.minimum(q - model.lower, model.upper - q).min()


def test_the_error_falls_with_the_square_of_the_step(panda):
    q = np.array([0.1, -0.3, 0.2, -2.0, 0.1, 1.8, 0.5])
    line = line_of(panda, q, [0.1, 0.2, -0.1], turn=0.6)
    errors = [
        max(motion.position_error.max(), motion.orientation_error.max())
        for motion in (resolved_motion(panda, line, q, samples=k) for k in (101, 201, 401))
    ]
    assert errors[0] > 3.4 * errors[1] > 3.4**2 * errors[2]
    assert errors[2] < 1e-5


@pytest.mark.parametrize(("start", "way"), LINES)
def test_criteria_and_bounds_keep_the_limits_and_the_line(panda, start, way):
    line = line_of(panda, start, way)
    plain = resolved_motion(panda, line, start)
    kept = [
        resolved_motion(panda, line, start, secondary=criterion)
        for criterion in (JointLimitCriterion(gain=10.0), NearLimitCriterion(0.5, gain=5.0))
    ]
    bounded = resolved_motion(panda, line, start, limits=True)
    assert margin(panda, plain.q) < -0.04
    assert all(margin(panda, motion.q) > 0.04 for motion in kept)
    assert -1e-12 <= margin(panda, bounded.q) < 1e-6  # to the limit and along it
    for motion in (plain, *kept):
        error = max(motion.position_error.max(), motion.orientation_error.max())
        assert error < (1e-5 if start == PANDA else 1e-3)
    # while joints are held the tool falls behind, and then catches up
    assert (bounded.status == IKMStatus.LIMITED).any() == (start == PANDA)
    assert bounded.position_error.max() < 5e-3
    assert bounded.position_error[-1] < 1e-5


@pytest.mark.parametrize("samples", [50, 400])
def test_no_sample_passes_a_limit(panda, samples):
    """Also with limits that do not know how long a step takes."""
    q0 = 0.5 * (panda.lower + panda.upper)
    q0[5] = panda.upper[5] - 0.02
    q1 = q0.copy()
    q1[5] += 1.5
    line = straight_line(rm.dgm(panda, q0), rm.dgm(panda, q1), duration=1.0)
    for limits in (True, JointBounds()):
        motion = resolved_motion(panda, line, q0, samples=samples, limits=limits, feedback=5.0)
        assert margin(panda, motion.q) >= -1e-12
        assert (abs(motion.v) <= panda.table.velocity * (1 + 1e-12)).all()
    with pytest.raises(InvalidValueError, match=r"step of 0\.001 s is shorter"):
        resolved_motion(panda, line, q0, samples=samples, limits=JointBounds(step=1e-3))


def test_an_error_at_the_start_dies_out(panda):
    q = np.array([0.1, -0.3, 0.2, -2.0, 0.1, 1.8, 0.5])
    line = line_of(panda, q, [0.1, 0.1, 0.0])
    motion = resolved_motion(panda, line, q + 0.02, feedback=5.0)
    assert motion.position_error[0] > 1e-3
    assert motion.position_error[-1] < 1e-5


def test_a_mask_leaves_the_rest_free(panda):
    trr = rm.load("lab_trr")
    q = np.array([-0.3, -0.8, -0.9])
    line = line_of(trr, q, [0.1, 0.2, -0.1])
    motion = resolved_motion(trr, line, q, mask=[1, 1, 1, 0, 0, 0])
    assert motion.position_error.max() < 1e-5
    assert motion.orientation_error.max() == 0.0
    assert (motion.status == 0).all()


def test_mistakes_are_named(panda):
    line = line_of(panda, PANDA, [0.0, 0.0, 0.05])
    for path, options, words in (
        (np.eye(4)[None], {}, "joint_path follows arrays"),
        (line, {"feedback": 200.0}, r"feedback: expected between 0 and 99\.75"),
        (line, {"samples": 1}, "samples"),
    ):
        with pytest.raises(InvalidValueError, match=words):
            resolved_motion(panda, path, PANDA, **options)

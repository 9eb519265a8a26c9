"""The calibrated robot, its inverse model, and the correction of controllers that keep theirs."""

from dataclasses import replace

import numpy as np
import pytest
from identities.random_robots import random_model, random_pose, robot_size

import robotmodels as rm
from robotmodels.calibration import (
    Compliance,
    calibrated_model,
    calibrated_pose,
    candidate_parameters,
    corrected_igm,
    differential_model,
    joint_offsets,
    pose_offsets,
)
from robotmodels.calibration.inverse import pose_errors
from robotmodels.calibration.parameters import ErrorLaw
from robotmodels.calibration.robot import joint_errors_of
from robotmodels.errors import InvalidValueError

LAWS = {"gains": True, "eccentricity": True}


def corrections(parameters, rng, size=1e-3):
    xi = size * rng.normal(size=len(parameters))
    # a compliance of 1 mrad at full torque
    xi[[name.startswith("compliance") for name in parameters.names]] *= 0.02
    return xi


def off(model, rng, size=1e-3, **options):
    """A robot with random errors in all candidates."""
    parameters = candidate_parameters(model, **options)
    return calibrated_model(parameters, corrections(parameters, rng, size))


def readings_of(model, rng, N):
    low = np.where(np.isfinite(model.lower), np.maximum(model.lower, -3.0), -2.0)
    high = np.where(np.isfinite(model.upper), np.minimum(model.upper, 3.0), 2.0)
    return rng.uniform(low, high, size=(N, model.n))


def assert_reached(robot, solutions, T, q=None, mask=None):
    """An independent forward pass from all readings meets the poses, and q is among them."""
    assert (solutions.residual[solutions.valid] < 1e-12).all()
    i = np.nonzero(np.atleast_2d(solutions.valid))[0]
    difference = np.abs(calibrated_pose(robot, solutions.q[solutions.valid]) - T[i])
    assert (difference if mask is None else difference[:, :3, 3]).max(initial=0.0) < 3e-12
    if q is not None:
        gap = np.abs(solutions.nearest(q) - q)
        turns = robot.model.table.sigma[robot.model.table.joint_rows] == 0
        assert np.where(turns, np.minimum(gap, 2 * np.pi - gap), gap).max() < 1e-7


# --- the calibrated robot ---------------------------------------------------------------------


@pytest.mark.sampled(7)
@pytest.mark.parametrize("seed", range(20))
def test_the_calibrated_model_is_the_generalised_differential_model(seed):
    rng = np.random.default_rng(seed)
    model = random_model(
        rng, f=int(rng.integers(1, 8)), tree=seed % 2 == 1, fixed=seed % 3 == 0, tip="any",
        transmission=seed % 4 == 0,
    )  # fmt: skip
    camera = rm.NamedFrame("camera", int(rng.integers(1, model.f + 1)), random_pose(rng, 0.2))
    model = replace(model, frames=(camera, rm.NamedFrame("plate", 0, random_pose(rng, 0.5))))
    frames = (None, "camera", "plate", 0, model.f)[: 1 + seed // 5 % 5]
    options = {**LAWS, "compliance": tuple(Compliance)[seed % 5]}
    entries = candidate_parameters(model, frames, **options).entries
    moving = [e.row for e in entries if e.law is ErrorLaw.GAIN]
    couplings = [(moving[-1], moving[0])] if len(moving) > 1 else []
    parameters = candidate_parameters(model, frames, couplings=couplings, **options)
    # far more than errors: the laws are exact, not linearised
    xi = corrections(parameters, rng, 0.1)
    robot = calibrated_model(parameters, xi)
    q = rng.uniform(-2.0, 2.0, size=(5, model.n))
    close = {"rtol": 0, "atol": 1e-12 * robot_size(robot.model, q[0])}
    actual = robot.joint_errors.actual(q)
    for frame in frames:
        T, end = differential_model(parameters, q, xi, frame).T, robot.end(frame)
        np.testing.assert_allclose(calibrated_pose(robot, q, frame), T, **close)
        if end.parent >= 1:
            moved = robot.with_tool_at(frame)
            np.testing.assert_allclose(calibrated_pose(moved, q), T, **close)
        if not robot.bent_rows:
            there = rm.dgm(robot.model, actual, end.parent) @ end.pose
            np.testing.assert_allclose(there, T, **close)
            if frame == "camera":  # the model's own frame is off as well
                np.testing.assert_allclose(rm.dgm(robot.model, actual, frame), T, **close)


@pytest.mark.parametrize("size", [1e-3, 5e-2])
def test_readings_are_found_again(size, rng):
    robot = off(random_model(rng, f=6), rng, size, compliance="joints", couplings=[(4, 2)], **LAWS)
    q = rng.uniform(-3.0, 3.0, size=(4, 5, robot.model.n))
    errors = robot.joint_errors
    np.testing.assert_allclose(errors.reading(errors.actual(q)), q, rtol=0, atol=1e-13)
    assert errors.reading(q[:0]).shape == (0, *q.shape[1:])


def test_readings_of_strong_laws_and_joint_variables_without_any():
    # q_2 = 0.3 sin(reading) is never 0.4
    parameters = candidate_parameters(rm.load("lab_rr"), **LAWS)
    names = np.array(parameters.names)
    errors = joint_errors_of(parameters, 0.3 * (names == "sine2") - (names == "gain2"))
    wanted = np.array([[0.0, 0.4], [0.0, 0.0], [0.3, 0.2]])
    readings = errors.reading(wanted)
    np.testing.assert_array_equal(np.isnan(readings).any(axis=1), [True, False, False])
    np.testing.assert_allclose(errors.actual(readings[1:]), wanted[1:], rtol=0, atol=1e-13)


# --- the inverse model of the calibrated robot --------------------------------------------------

CASES = [(name, laws) for name in ("rx90", "erd:ur10", "gantry", "panda") for laws in ({}, LAWS)]
CASES += [("puma560", LAWS), ("stanford_arm", {}), ("cobra_s600", LAWS)]
CASES += [("panda", {"compliance": "joints", "gains": True})]


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("name", "laws"), CASES)
def test_every_posture_of_the_calibrated_robot(name, laws):
    rng = np.random.default_rng(3)
    model = rm.load(name)
    mask = [1, 1, 1, 0, 0, 1] if name == "cobra_s600" else None
    robot = off(model, rng, **laws)
    q = readings_of(model, rng, 10 if mask else 60)
    T = calibrated_pose(robot, q)
    found = corrected_igm(robot, T, q_ref=q, mask=mask)
    assert_reached(robot, found, T, q, mask)
    # as many as the calibrated table's own inverse model finds
    own = rm.igm(robot.model, T, q_ref=robot.joint_errors.actual(q), mask=mask)
    assert (found.count >= own.count).mean() > 0.98


def test_a_locked_joint_reads_what_it_is_locked_at(rng):
    model = rm.load("panda")
    robot = off(model, rng, gains=True, couplings=[(7, 2)])
    q = readings_of(model, rng, 10)
    q[:, 6] = 0.4
    T = calibrated_pose(robot, q)
    found = corrected_igm(robot, T, q_ref=q, lock={6: 0.4})
    assert np.abs(found.q[found.valid][:, 6] - 0.4).max() < 1e-12
    assert_reached(robot, found, T, q)


def test_limits_are_those_of_the_readings(rng):
    model = rm.load("puma560")
    robot = off(model, rng, 5e-3, gains=True)
    q = rng.uniform(model.lower, model.upper, size=(50, 6))
    found = corrected_igm(robot, calibrated_pose(robot, q), q_ref=q, limits=True)
    rows = found.q[found.valid]
    assert ((rows >= model.lower) & (rows <= model.upper)).all()
    assert np.abs(found.nearest(q) - q).max() < 1e-7
    every = corrected_igm(robot, calibrated_pose(robot, q), q_ref=q)
    assert (found.count < every.count).any()


def test_a_batch_is_its_poses_one_by_one_also_at_singular_wrists(rng):
    model = rm.load("puma560")
    robot = off(model, rng, gains=True)
    q = readings_of(model, rng, 12)
    q[:, 4] = np.repeat([0.0, 1e-4, -1e-3], 4)
    T = calibrated_pose(robot, q).reshape(2, 6, 4, 4)
    together = corrected_igm(robot, T)
    assert together.valid.any(axis=-1).all()
    for i in np.ndindex(2, 6):
        alone = corrected_igm(robot, T[i])
        assert_reached(robot, alone, T[i][None])
        there = together.q[i][together.valid[i]]
        np.testing.assert_allclose(alone.q, there, rtol=0, atol=1e-10)
    empty = corrected_igm(robot, np.empty((0, 4, 4)))
    assert empty.q.shape[0] == empty.status.size == 0


@pytest.mark.parametrize(
    ("name", "mode"),
    [("erd:ur10", "links"), ("erd:ur10", "isotropic"), ("panda", "links"), ("panda", "uniform")],
)
def test_bending_counts_in_the_inverse_model(name, mode, rng):
    model = rm.load(name)
    robot = off(model, rng, compliance=mode, gains=True)
    assert robot.bent_rows
    q = readings_of(model, rng, 8)
    T = calibrated_pose(robot, q)
    # it is more than rounding, and an inverse model without it would be off by that
    rigid = rm.dgm(robot.model, robot.joint_errors.actual(q))
    assert np.abs(rigid - T)[:, :3, 3].max() > 1e-5
    found = corrected_igm(robot, T, q_ref=q)
    assert_reached(robot, found, T, q)
    command = pose_offsets(robot, T, q_ref=q).command[found.valid]
    there = rm.dgm(model, found.q[found.valid])
    np.testing.assert_allclose(command, there, rtol=0, atol=1e-15)


@pytest.mark.parametrize("axes", ["world", "tool"])
def test_parts_of_poses_are_met_by_robots_that_bend(axes, rng):
    model = rm.load("erd:ur10")
    robot = off(model, rng, compliance="uniform")
    q = readings_of(model, rng, 2)
    q[:, 5] = 0.4
    T = calibrated_pose(robot, q)
    mask = [1, 1, 1, 0, 1, 1]
    found = corrected_igm(robot, T, q_ref=q, mask=mask, mask_axes=axes, lock={5: 0.4})
    assert found.valid.any(axis=-1).all()
    assert_reached(robot, found, T, None, mask)
    i, s = found.valid.nonzero()
    # the rotation that is left is about the one axis that is not requested
    turn = pose_errors(calibrated_pose(robot, found.q[i, s]), T[i])[:, 3:]
    if axes == "tool":
        turn = np.einsum("nij,ni->nj", T[i, :3, :3], turn)
    assert np.abs(turn[:, 1:]).max() < 3e-12


# --- controllers that keep their model ----------------------------------------------------------


@pytest.mark.parametrize("name", ["rx90", "erd:ur10", "gantry"])
def test_false_targets_lead_to_the_true_ones(name, rng):
    model = rm.load(name)
    robot = off(model, rng, **LAWS)
    q = readings_of(model, rng, 30)
    q[:, 4] = np.where(np.abs(q[:, 4]) < 0.2, 0.5, q[:, 4])
    T = calibrated_pose(robot, q)
    false = pose_offsets(robot, T, q_ref=q).nearest(q)
    commanded = rm.igm(model, false, q_ref=q).nearest(q)
    np.testing.assert_allclose(calibrated_pose(robot, commanded), T, rtol=0, atol=1e-11)
    # and without them it is off by the errors of the robot
    naive = rm.igm(model, T, q_ref=q).nearest(q)
    reached = np.isfinite(naive).all(axis=-1)
    assert reached.sum() > 20
    assert np.abs(calibrated_pose(robot, naive[reached]) - T[reached]).max() > 1e-4


@pytest.mark.parametrize(
    ("name", "laws", "mask"),
    [("rx90", {"gains": True}, [1, 1, 1, 0, 0, 0]), ("erd:ur10", {"compliance": "links"}, None)],
)
def test_constant_offsets_are_the_best_in_least_squares(name, laws, mask, rng):
    model = rm.load(name)
    robot = off(model, rng, **laws)
    q = readings_of(model, rng, 30)
    found = joint_offsets(robot, q, mask=mask, length=0.5)
    weight = np.array([1.0] * 3 + [0.5 if mask is None else 0.0] * 3)

    def cost(offset):
        return ((weight * pose_errors(calibrated_pose(robot, q + offset), wanted)) ** 2).sum()

    wanted = rm.dgm(model, q)
    least = cost(found.offset)
    assert least < cost(np.zeros(6))
    np.testing.assert_allclose(least, ((weight * found.after) ** 2).sum(), rtol=1e-9)
    np.testing.assert_allclose(cost(np.zeros(6)), ((weight * found.before) ** 2).sum(), rtol=1e-9)
    for step in 1e-5 * np.vstack([np.eye(6), -np.eye(6)]):
        assert cost(found.offset + step) >= least * (1 - 1e-9)
    for call, error in (
        (lambda: joint_offsets(robot, np.empty((0, 6))), "none"),
        (lambda: corrected_igm(model, wanted), "CalibratedRobot"),
    ):
        with pytest.raises(InvalidValueError, match=error):
            call()

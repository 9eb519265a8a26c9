"""The differential model, the calibrated robot, its inverse model, and controllers with theirs."""

from dataclasses import replace

import numpy as np
import pytest
from calibration_arms import slope
from identities.random_robots import random_model, random_pose, random_state, robot_size

import robotmodels as rm
from robotmodels.calibration import (
    Compliance,
    GeometricParameters,
    calibrated_model,
    calibrated_pose,
    candidate_parameters,
    combine_arms,
    corrected_igm,
    differential_model,
    joint_offsets,
    pose_offsets,
)
from robotmodels.calibration.extended_table import Element, extend_table
from robotmodels.calibration.inverse import pose_errors
from robotmodels.calibration.parameters import ErrorLaw, GeometricParameter
from robotmodels.calibration.robot import joint_errors_of
from robotmodels.errors import InvalidValueError
from robotmodels.geometry import FIXED, PRISMATIC

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


# --- the differential model ----------------------------------------------------------------------

STRUCTURES = {
    "serial": {"f": 6},
    "one_joint": {"f": 1},
    "tree": {"f": 7, "tree": True},
    "everything": {"f": 8, "tree": True, "fixed": True, "tip": "any"},
    "plain_base_and_tool": {"f": 5, "base": False, "tool": False},
}


def every_parameter(model, frames):
    """Every element of every row, and every law of every joint, couplings included."""
    table = extend_table(model, frames)
    entries = [
        GeometricParameter(row, element, source=row)
        for row in range(table.rows)
        for element in Element
    ]
    moving = [r for r in range(table.rows) if table.sigma[r] != FIXED]
    for law in set(ErrorLaw) - {ErrorLaw.CONSTANT}:
        for r in moving:
            variable = Element.R if table.sigma[r] == PRISMATIC else Element.THETA
            sources = moving if law is ErrorLaw.GAIN else [r]
            entries += [GeometricParameter(r, variable, law, s) for s in sources]
    return GeometricParameters(table, tuple(entries))


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("structure", "corrected"), [*((name, True) for name in STRUCTURES), ("tree", False)]
)
def test_psi_is_the_derivative_of_the_pose(structure, corrected):
    rng = np.random.default_rng(len(structure) + corrected)
    model = random_model(rng, **STRUCTURES[structure])
    frames = (None, int(rng.integers(0, model.f + 1)))
    parameters = every_parameter(model, frames)
    torque = rm.gravity_torque(model, random_state(model, rng, 20)[0])
    # a compliance of 1 rad/(N m) would turn a joint round many times
    soft = 1.0 / max(1.0, float(np.abs(torque).max()))
    unit = np.array([soft if e.law is ErrorLaw.COMPLIANCE else 1.0 for e in parameters.entries])
    x = 0.05 * corrected * rng.normal(size=len(parameters))
    q = random_state(model, rng, 1)[0]
    for frame in frames:
        T, psi = differential_model(parameters, q, x * unit, frame)
        for k in range(len(parameters)):
            rate = slope(lambda x, f=frame: differential_model(parameters, q, x * unit, f).T, x, k)
            W = rate[0, :3, :3] @ T[0, :3, :3].T
            w = np.array([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]]) / 2
            column = psi[0, :, k] * unit[k]
            close = 1e-7 * max(1.0, np.abs(column).max())
            np.testing.assert_allclose(np.r_[rate[0, :3, 3], w], column, rtol=0, atol=close)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_corrections_are_a_changed_table_and_laws_changes_of_the_joint_variables(structure):
    rng = np.random.default_rng(23)
    model = random_model(rng, **STRUCTURES[structure])
    parameters = every_parameter(model, (None,))
    q = random_state(model, rng, 4)[0]
    factors = {
        ErrorLaw.GAIN: q, ErrorLaw.COMPLIANCE: -rm.gravity_torque(model, q),
        ErrorLaw.SINE: np.sin(q), ErrorLaw.COSINE: np.cos(q),
        ErrorLaw.SINE_2: np.sin(2 * q), ErrorLaw.COSINE_2: np.cos(2 * q),
    }  # fmt: skip
    assert set(factors) == set(ErrorLaw) - {ErrorLaw.CONSTANT}
    (table, laws), moved = np.zeros((2, len(parameters))), q.copy()
    columns = {e.word: getattr(model.table, e.word).copy() for e in Element}
    joint = parameters.table.joint
    for k, entry in enumerate(parameters.entries):
        if entry.law is not ErrorLaw.CONSTANT:
            laws[k] = 0.02 * rng.normal()
            moved[:, joint[entry.row]] += laws[k] * factors[entry.law][:, joint[entry.source]]
        elif 1 <= entry.row <= model.f:
            table[k] = 0.1 * rng.normal()
            columns[entry.element.word][entry.row - 1] += table[k]
    changed = model.with_table(model.table.replace(**columns))
    T = differential_model(parameters, q, table).T
    np.testing.assert_allclose(T, rm.dgm(changed, q), atol=1e-12)
    T = differential_model(parameters, q, laws).T
    np.testing.assert_allclose(T, rm.dgm(model, moved), atol=1e-11)


# --- two robots ----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_two_robots_side_by_side_move_as_they_did(seed):
    rng = np.random.default_rng(seed)
    a = random_model(rng, f=4, tree=seed % 2 == 0, fixed=True, drive=True, transmission=seed > 3)
    b = random_model(rng, f=5, fixed=seed % 2 == 0, drive=True, tip="any").with_gravity(a.gravity)
    place = [None, np.eye(4), a.base, b.base, a.base @ rm.se3.translation(1, 0, 0), a.base][seed]
    pair = combine_arms(a, b, place)
    b = b if place is None else b.with_base(place)
    q, v, acceleration = random_state(pair, rng, 5)
    parts = (("a", a, slice(None, a.n)), ("b", b, slice(a.n, None)))
    np.testing.assert_allclose(rm.dgm(pair, q), rm.dgm(a, q[:, : a.n]), atol=1e-12)
    for prefix, robot, columns in parts:
        for name in ("tool", *robot.table.names):
            there = rm.dgm(robot, q[:, columns], None if name == "tool" else name)
            np.testing.assert_allclose(rm.dgm(pair, q, f"{prefix}_{name}"), there, atol=1e-12)
        np.testing.assert_allclose(rm.dgm(pair, q, f"{prefix}_base")[0], robot.base, atol=1e-12)
    torque = np.hstack([rm.idm(m, q[:, c], v[:, c], acceleration[:, c]) for _, m, c in parts])
    np.testing.assert_allclose(rm.idm(pair, q, v, acceleration), torque, atol=1e-9)
    np.testing.assert_array_equal(pair.lower, np.r_[a.lower, b.lower])
    np.testing.assert_array_equal(pair.table.effort, np.r_[a.table.effort, b.table.effort])


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

"""The differential model, the calibrated robot, its inverse model, and controllers with theirs."""

from dataclasses import replace

import numpy as np
import pytest
from calibration_arms import corrections, off, readings, slope
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
from robotmodels.geometry import FIXED, PRISMATIC

LAWS = {"gains": True, "eccentricity": True}


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


# --- the differential model, and two robots -------------------------------------------------------


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


# --- the calibrated robot and its inverse model ---------------------------------------------------


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


def test_readings_are_found_again(rng):
    arm = random_model(rng, f=6)
    for size in (1e-3, 5e-2):
        robot = off(arm, rng, size, compliance="joints", couplings=[(4, 2)], **LAWS)
        q = rng.uniform(-3.0, 3.0, size=(4, 5, arm.n))
        errors = robot.joint_errors
        np.testing.assert_allclose(errors.reading(errors.actual(q)), q, rtol=0, atol=1e-13)
        assert errors.reading(q[:0]).shape == (0, *q.shape[1:])
    # strong laws: q_2 = 0.3 sin(reading) is never 0.4
    parameters = candidate_parameters(rm.load("lab_rr"), **LAWS)
    names = np.array(parameters.names)
    errors = joint_errors_of(parameters, 0.3 * (names == "sine2") - (names == "gain2"))
    wanted = np.array([[0.0, 0.4], [0.0, 0.0], [0.3, 0.2]])
    found = errors.reading(wanted)
    np.testing.assert_array_equal(np.isnan(found).any(axis=1), [True, False, False])
    np.testing.assert_allclose(errors.actual(found[1:]), wanted[1:], rtol=0, atol=1e-13)


REACHED = {
    "serial": ("rx90", LAWS, 60, {}),
    "prismatic": ("gantry", {}, 60, {}),
    "spherical": ("stanford_arm", LAWS, 60, {}),
    "redundant": ("panda", LAWS, 60, {}),
    "compliance": ("panda", {"compliance": "joints", "gains": True}, 60, {}),
    "four_axes": ("cobra_s600", LAWS, 10, {"mask": [1, 1, 1, 0, 0, 1]}),
    "locked": ("panda", {"gains": True, "couplings": [(7, 2)]}, 10, {"lock": {6: 0.4}}),
    "bending_links": ("erd:ur10", {"compliance": "links", "gains": True}, 8, {}),
    "bending_isotropic": ("erd:ur10", {"compliance": "isotropic", "gains": True}, 8, {}),
    "bending_redundant": ("panda", {"compliance": "links", "gains": True}, 8, {}),
    "bending_uniform": ("panda", {"compliance": "uniform", "gains": True}, 8, {}),
    **{
        f"parts_{axes}": ("erd:ur10", {"compliance": "uniform"}, 2, {
            "mask": [1, 1, 1, 0, 1, 1], "mask_axes": axes, "lock": {5: 0.4},
        }) for axes in ("world", "tool")
    },
}  # fmt: skip
"""Robot, errors of its joints, number of poses, and options of the inverse model."""


@pytest.mark.parametrize("case", REACHED)
def test_readings_that_reach_poses(case, rng):
    name, laws, count, options = REACHED[case]
    model, mask = rm.load(name), options.get("mask")
    robot = off(model, rng, **laws)
    q = readings(model, rng, count, 3.0)
    for j, value in options.get("lock", {}).items():
        q[:, j] = value
    T = calibrated_pose(robot, q)
    found = corrected_igm(robot, T, q_ref=q, **options)
    assert found.valid.any(axis=-1).all()
    assert_reached(robot, found, T, None if "mask_axes" in options else q, mask)
    i, reading = found.valid.nonzero()[0], found.q[found.valid]
    for j, value in options.get("lock", {}).items():
        assert np.abs(reading[:, j] - value).max() < 1e-12
    if "mask_axes" in options:  # the rotation that is left is about the axis not requested
        turn = pose_errors(calibrated_pose(robot, reading), T[i])[:, 3:]
        if options["mask_axes"] == "tool":
            turn = np.einsum("nij,ni->nj", T[i, :3, :3], turn)
        assert np.abs(turn[:, 1:]).max() < 3e-12
    elif robot.bent_rows:  # more than rounding; commands are poses of the nominal robot
        rigid = rm.dgm(robot.model, robot.joint_errors.actual(q))
        assert np.abs(rigid - T)[:, :3, 3].max() > 1e-5
        command = pose_offsets(robot, T, q_ref=q).command[found.valid]
        np.testing.assert_allclose(command, rm.dgm(model, reading), rtol=0, atol=1e-15)
    elif "lock" not in options:  # as many as the calibrated table's own inverse model finds
        own = rm.igm(robot.model, T, q_ref=robot.joint_errors.actual(q), mask=mask)
        assert (found.count >= own.count).mean() > 0.98


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
    q = readings(model, rng, 12, 3.0)
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


# --- controllers that keep their model ----------------------------------------------------------


@pytest.mark.parametrize("name", ["rx90", "erd:ur10", "gantry"])
def test_false_targets_lead_to_the_true_ones(name, rng):
    model = rm.load(name)
    robot = off(model, rng, **LAWS)
    q = readings(model, rng, 30, 3.0)
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
    q = readings(model, rng, 30, 3.0)
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

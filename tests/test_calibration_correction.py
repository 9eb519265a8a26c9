"""The calibrated robot, its inverse model, and what a fixed controller can do with it."""

import pickle
import warnings

import numpy as np
import pytest
from identities.random_robots import random_model, random_pose, robot_size

import robotmodels as rm
from robotmodels.calibration import candidate_parameters, differential_model
from robotmodels.calibration.calibrated import (
    calibrated_model,
    calibrated_pose,
    calibrated_urdf,
)
from robotmodels.calibration.elements import Element, ErrorLaw
from robotmodels.calibration.joint_errors import encoder_transmission, joint_errors_of
from robotmodels.calibration.parameters import GeometricParameter, GeometricParameters
from robotmodels.errors import InvalidValueError, ShapeError, UrdfWarning

EVERY_LAW = {"gains": True, "compliance": True, "eccentricity": True}


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
    frames = (None, "camera", "plate", 0, model.f)[: 1 + seed % 5]
    first = candidate_parameters(model, frames, **EVERY_LAW)
    parameters = candidate_parameters(
        model, frames, couplings=on_path(first, couplings_of(model)), **EVERY_LAW
    )
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
    if "camera" in frames:  # the model's own frame is off as well
        q_actual = robot.joint_errors.actual(q)
        np.testing.assert_allclose(
            rm.dgm(robot.model, q_actual, "camera"),
            differential_model(parameters, q, xi, "camera").T,
            rtol=0, atol=1e-12 * robot_size(robot.model, q[0]),
        )  # fmt: skip


def test_no_deviation_changes_nothing(rng):
    model = with_frames(random_model(rng, tree=True, fixed=True), rng)
    parameters = candidate_parameters(model, (None, "camera"), **EVERY_LAW)
    robot = calibrated_model(parameters, np.zeros(len(parameters)))
    assert robot.model == model == robot.structured
    assert robot.joint_errors.is_zero
    assert robot.notes == ()
    q = rng.normal(size=(3, model.n))
    np.testing.assert_array_equal(robot.joint_errors.actual(q), q)
    np.testing.assert_array_equal(robot.joint_errors.reading(q), q)


@pytest.mark.parametrize("seed", range(12))
def test_readings_are_found_again(seed):
    rng = np.random.default_rng(seed)
    model = random_model(rng, f=6)
    first = candidate_parameters(model, **EVERY_LAW)
    parameters = candidate_parameters(
        model, couplings=on_path(first, couplings_of(model)), **EVERY_LAW
    )
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
    parameters = candidate_parameters(random_model(rng, f=4, gravity=False), (None, 2), **EVERY_LAW)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    text = " ".join(robot.notes)
    for word in ("Gains", "Eccentricity", "Compliance", "end 2"):
        assert word in text
    with pytest.warns(UrdfWarning, match="Eccentricity"):
        calibrated_urdf(robot)


def test_a_calibrated_robot_is_a_value(rng):
    parameters = candidate_parameters(random_model(rng, f=4), **EVERY_LAW)
    robot = calibrated_model(parameters, deviations(parameters, rng))
    copy = pickle.loads(pickle.dumps(robot))
    q = rng.normal(size=4)
    np.testing.assert_array_equal(calibrated_pose(copy, q[: robot.model.n]),
                                  calibrated_pose(robot, q[: robot.model.n]))  # fmt: skip
    assert not copy.deviation.flags.writeable
    assert not copy.joint_errors.gain.flags.writeable
    with pytest.raises(InvalidValueError, match="measured ends"):
        robot.with_tool_at("elsewhere")

"""Mistakes at the doors of several rooms: what was expected, what came, what to do."""

import numpy as np
import pytest
from identification_logs import clean_log
from identities.random_robots import random_model

import robotmodels as rm
from robotmodels import calibration
from robotmodels.cli.program import main
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.identification import Log, fit
from robotmodels.logs import read_log
from robotmodels.trajectories import MotionLimits, blended_lines

STEP = [[0.0, 0.0], [1.0, 0.5], [1.0, 1.0]]


@pytest.mark.parametrize(
    ("points", "options", "words"),
    [
        ([[0.0]], {"limits": MotionLimits(1.0, 1.0)}, "points: expected at least two"),
        (STEP, {}, "limits"),
        (STEP, {"segment_times": 1.0}, "blend_times: give them, or limits of acceleration"),
        (STEP, {"segment_times": [0.0, 1.0], "blend_times": 0.1}, "a positive time for every line"),
        (STEP, {"segment_times": [1.0] * 3, "blend_times": 0.1}, r"segment_times: .* got \(3,\)"),
        (STEP, {"segment_times": -1.0, "blend_times": 0.1}, "segment_times: .* at least 0, got -1"),
        (STEP, {"limits": MotionLimits([0.0, 1.0], 1.0)}, "velocity of joint 1 is 0"),
        (STEP, {"limits": MotionLimits(1.0, [1.0, 0.0])}, "acceleration of joint 2 is 0"),
        (STEP, {"limits": MotionLimits(1.0)}, "limits"),
        (STEP, {"limits": MotionLimits(1.0, 1.0), "duration": 0.0}, "duration: 0 s is too short"),
        (
            STEP,
            {"limits": MotionLimits(1.0, 1.0), "segment_times": 9.0, "duration": 0.1},
            "duration: .*least",
        ),
    ],
)
def test_lines_with_blends(points, options, words):
    with pytest.raises((InvalidValueError, ShapeError), match=words):
        blended_lines(points, **options)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: calibration.KnownDistance("a", "a", 0.1), "other: expected another point"),
        (lambda: calibration.KnownDistance("a", "b", -0.1), "length: expected a positive length"),
        (lambda: calibration.ParameterPrior(length=0.0), "length: expected a positive standard"),
        (lambda: calibration.ParameterPrior(angle=-1.0), "angle: expected a positive standard"),
    ],
)
def test_measurements_and_what_is_thought_before(call, words):
    with pytest.raises(InvalidValueError, match=words):
        call()


def test_a_prior_of_unknown_strength_needs_many_measurements(rng):
    arm = rm.load("planar_2r")
    q = rng.uniform(-1.0, 1.0, (6, 2))
    measured = calibration.Position(q, rm.dgm(arm, q)[:, :3, 3])
    with pytest.raises(InvalidValueError, match="strength: choosing it needs 10 measurements"):
        calibration.fit(arm, measured, prior=calibration.ParameterPrior(1e-3, 1e-3, strength=None))


@pytest.fixture(scope="module")
def swings():
    arm = random_model(np.random.default_rng(7), 2, prismatic=False, drive=True)
    return arm, clean_log(arm, np.random.default_rng(1), samples=2000)


def test_a_log_kept_aside_is_another_one_of_the_same_robot(swings):
    arm, log = swings
    aside = Log(2.0 * log.dt, log.q.copy(), log.tau.copy())
    dead = Log(log.dt, log.q.copy(), np.zeros_like(log.tau))
    mistakes = {
        "test: expected a log of 2 joints, got 1": Log(log.dt, log.q[:, :1], log.tau[:, :1]),
        "test: expected the sampling period of the log": aside,
        "test: it has rows of the log that is fitted": log[500:1500],
    }
    for words, test in mistakes.items():
        with pytest.raises(InvalidValueError, match=words):
            fit(arm, log, test=test)
    with pytest.raises(InvalidValueError, match="test: "):
        fit(arm, log, test=dead)


@pytest.mark.parametrize(
    ("header", "options", "words"),
    [
        (False, {"positions": ["q1"]}, "has no header, so that 'q1' names none"),
        (True, {"positions": ["q1", "q2", "q2"]}, "several columns 'q2'"),
        (True, {"positions": [True, 2]}, "numbers or names of columns, got True"),
        (True, {"positions": ["q1", "q9"]}, "q9"),
        (False, {"positions": [1, 2]}, "."),
    ],
)
def test_columns_that_are_not_there(tmp_path, header, options, words):
    names = "t,q1,q2,q2,tau1,tau2\n" if header else ""
    rows = np.random.default_rng(0).normal(size=(20, 6))
    rows[:, 0] = 0.01 * np.arange(20)
    body = "\n".join(",".join(map(repr, row)) for row in rows.tolist())
    (tmp_path / "run.csv").write_text(f"{names}{body}\n", encoding="utf-8")
    with pytest.raises(InvalidValueError, match=words):
        read_log(tmp_path / "run.csv", **options)


def test_info_shows_coupled_motors_and_bodies_that_cannot_be(capsys, tmp_path):
    assert main(["info", "tx40"]) == 0
    out = capsys.readouterr().out
    assert "Transmission, q = K q_motor + q_0" in out
    (tmp_path / "arm.urdf").write_text(
        """<robot name="arm"><link name="base"/><link name="one"><inertial><mass value="1"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="9"/></inertial></link>
        <joint name="turn" type="continuous"><parent link="base"/><child link="one"/>
        <axis xyz="0 0 1"/></joint></robot>""",
        encoding="utf-8",
    )
    assert main(["info", str(tmp_path / "arm.urdf")]) == 0
    assert "Physical consistency:" in capsys.readouterr().out


@pytest.mark.parametrize("size", [1e-200, 1e-155, 1e60, 1e152, 1e300])
def test_logs_whose_squares_are_no_numbers(size):
    rows = torques = np.sin(np.linspace(0.0, 20.0, 500))[:, None] * [1.0, 0.3]
    with pytest.raises(InvalidValueError, match=r"tau: expected .*check the units"):
        Log(0.01, rows, torques * size)
    with pytest.raises(InvalidValueError, match=r"q: expected .*check the units"):
        Log(0.01, rows * size, torques)
    with pytest.raises(InvalidValueError, match=r"dt: expected .*check the units"):
        Log(size, rows, torques)
    assert Log(0.01, rows, 0.0 * torques).n == 2


def test_positions_of_joints_without_limits_are_named():
    arm = rm.load("planar_2r")
    q = np.sin(np.linspace(0.0, 20.0, 500))[:, None] * [1e40, 1.0]
    with pytest.raises(InvalidValueError, match="limits unknown") as caught:
        fit(arm, Log(0.01, q, q))
    assert "inf" not in str(caught.value)


@pytest.mark.parametrize("size", [1e60, 1e160, 1e308])
def test_models_whose_products_are_no_numbers(size):
    rows = [{"sigma": 0}, {"sigma": 1, "d": size}]
    for call in (
        lambda: rm.DHTable.from_rows(rows),
        lambda: rm.InertialParameters([[0, 0, 0, 0, 0, 0, 0, 0, 0, size]]),
        lambda: rm.InertialParameters.from_com([size], np.zeros((1, 3)), np.zeros((1, 3, 3))),
        lambda: rm.DriveParameters(Fv=[1.0, size]),
        lambda: rm.load("planar_2r").with_gravity([0.0, 0.0, -size]),
        lambda: rm.load("planar_2r").with_base(
            np.block([[np.eye(3), np.full((3, 1), size)], [np.zeros((1, 3)), np.ones((1, 1))]])
        ),
    ):
        with pytest.raises(InvalidValueError, match=r"expected entries up to 1e\+50"):
            call()


def test_torques_in_a_wrong_unit_end_with_a_status():
    com, tensor = [[0.5, 0.0, 0.0]] * 2, [0.083 * np.eye(3)] * 2
    arm = rm.RobotModel.from_table(
        rm.DHTable.from_rows([{"sigma": 0, "alpha": np.pi / 2}, {"sigma": 0, "d": 1.0}]),
        inertia=rm.InertialParameters.from_com([1.0, 1.0], com, tensor),
    )
    wild = rm.simulate(arm, [0.0, 0.0], [0.0, 0.0], [1e5, 1e5], t=1.0)
    assert "evaluations of the model were used up" in wild.reason()
    assert 100_000 <= wild.evaluations < 112_000

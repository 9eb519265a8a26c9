"""First steps and usual mistakes: each gives an answer, or the sentence that mends it."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import robotmodels as rm

URDF = Path(__file__).parents[1] / "urdf"


@pytest.fixture(scope="module")
def rx90():
    return rm.load("rx90")


@pytest.mark.parametrize(
    ("name", "words"),
    [("fkine", r"rm\.dgm\(robot, q\)"), ("rne", r"rm\.idm"), ("teach", r"rm\.viz\.jog"),
     ("qz", "configurations"), ("dof", r"robot\.n")],
)  # fmt: skip
def test_names_of_other_programs_are_answered_with_ours(rx90, name, words):
    with pytest.raises(AttributeError, match=words):
        getattr(rx90, name)
    assert not hasattr(rx90, "nothing_at_all")


@pytest.mark.parametrize("as_path", [str, Path], ids=["text", "path"])
def test_a_file_is_loaded_like_a_name(as_path, tmp_path):
    loaded = rm.load(as_path(URDF / "rx90.urdf"))
    q = np.linspace(0.1, 0.6, 6)
    np.testing.assert_allclose(rm.dgm(loaded, q), rm.dgm(rm.load("rx90"), q), atol=1e-12)
    par = Path(__file__).parent / "oracles"
    for path in sorted(par.rglob("*.par"))[:1]:
        assert rm.load(as_path(path)).n == rm.read_par(path).n
    with pytest.raises(rm.errors.UrdfError, match=r"none\.urdf"):
        rm.load(as_path(tmp_path / "none.urdf"))


@pytest.mark.parametrize("torque", [rm.idm, rm.gravity_torque], ids=["idm", "gravity"])
def test_torques_without_masses_warn_once(torque):
    arm = rm.load("lab_rr")
    with pytest.warns(rm.InertiaWarning, match="no masses"):
        torque(arm, [0.1, 0.2])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        torque(arm, [0.1, 0.2])


def test_degrees_warn_once():
    arm, slide = rm.load("rx90"), rm.load("stanford_arm")
    with pytest.warns(
        rm.errors.RobotModelsWarning, match=r"joint 2 is at 45 rad.*np\.deg2rad\(q\)"
    ):
        rm.dgm(arm, [3.0, 45.0, -60.0, 0.0, 0.0, 0.0])
    rm.dgm(arm, [30.0, 45.0, -60.0, 0.0, 0.0, 0.0])
    rm.idm(rm.load("puma560"), np.full((5, 6), 12.0))
    rm.jacobian(slide, np.where(slide.table.sigma[slide.table.joint_rows] == 1, 90.0, 1.0))
    with pytest.warns(rm.errors.RobotModelsWarning, match="joint 1"):
        rm.idm(rm.load("puma560"), np.full((5, 6), -90.0))


def test_a_position_or_a_transposed_matrix_for_a_pose_is_named(rx90):
    T = rm.dgm(rx90, np.full(6, 0.3))
    with pytest.raises(rm.errors.ShapeError, match=r"se3\.translation\(x, y, z\) and mask='pos"):
        rm.igm(rx90, [0.3, 0.2, 0.5])
    with pytest.raises(rm.errors.ShapeError, match=r"se3\.translation\(x, y, z\)\.$"):
        rx90.with_tool([0.0, 0.0, 0.1])
    with pytest.raises(rm.errors.NotARotationError, match="looks transposed"):
        rm.igm(rx90, T.T)
    with pytest.raises(rm.errors.NotARotationError, match=r"must be 0 0 0 1\.$"):
        rm.igm(rx90, T + np.eye(4)[3])


def test_every_motion_of_joints_is_animated_and_named_postures_are_drawn(rx90):
    q = np.linspace(np.full(6, 0.1), np.full(6, 0.5), 5)
    found = rm.igm_numeric(rx90, rm.dgm(rx90, q), q0=q).q
    path = rm.trajectories.joint_path(rx90, rm.dgm(rx90, q), q_start=q[0])
    track = rm.viz.animate(rx90, q).motion.tracks[2].values
    for motion in (q[:, None], found, path):
        np.testing.assert_allclose(
            rm.viz.animate(rx90, motion).motion.tracks[2].values, track, atol=1e-6
        )
    law = rm.trajectories.quintic(q[0], q[-1], duration=1.5)
    assert rm.viz.animate(rx90, law).motion.duration == 1.5
    arm = rx90.with_configurations({"ready": q[2]})
    np.testing.assert_array_equal(rm.viz.jog(arm, "ready").sliders.q, q[2])
    for drawn in (rm.viz.show(arm, "ready"), rm.viz.show([arm, arm], "ready")):
        assert drawn.pose(drawn.paths[-1]).shape == (4, 4)
    for draw in (rm.viz.show, rm.viz.jog):
        with pytest.raises(rm.errors.InvalidValueError, match=r"'zero', 'ready'.*got 'redy'"):
            draw(arm, "redy")


@pytest.mark.parametrize("size", [1e60, 1e308])
def test_numbers_whose_squares_are_none_are_refused(size):
    rows = torques = np.sin(np.linspace(0.0, 20.0, 500))[:, None] * [1.0, 0.3]
    for words, log in (("tau", (0.01, rows, torques * size)), ("q", (0.01, rows * size, torques))):
        with pytest.raises(rm.errors.InvalidValueError, match=f"{words}: .*check the units"):
            rm.identification.Log(*log)
    arm = rm.load("planar_2r")
    for call in (
        lambda: rm.DHTable.from_rows([{"sigma": 0}, {"sigma": 1, "d": size}]),
        lambda: rm.InertialParameters([[0, 0, 0, 0, 0, 0, 0, 0, 0, size]]),
        lambda: rm.DriveParameters(Fv=[1.0, size]),
        lambda: arm.with_gravity([0.0, 0.0, -size]),
        lambda: arm.with_base(np.eye(4) + size * np.eye(4, k=3)),
    ):
        with pytest.raises(rm.errors.InvalidValueError, match=r"expected entries up to 1e\+50"):
            call()


@pytest.mark.nightly
def test_torques_in_a_wrong_unit_end_with_a_status():
    com, tensor = [[0.5, 0.0, 0.0]] * 2, [0.083 * np.eye(3)] * 2
    arm = rm.RobotModel.from_table(
        rm.DHTable.from_rows([{"sigma": 0, "alpha": np.pi / 2}, {"sigma": 0, "d": 1.0}]),
        inertia=rm.InertialParameters.from_com([1.0, 1.0], com, tensor),
    )
    wild = rm.simulate(arm, [0.0, 0.0], [0.0, 0.0], [1e5, 1e5], t=1.0)
    assert "evaluations of the model were used up" in wild.reason()
    assert 100_000 <= wild.evaluations < 112_000

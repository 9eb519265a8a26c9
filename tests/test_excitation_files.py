"""Files and the figure of exciting trajectories, and the command that makes them."""

import json

import numpy as np
import pytest
import yaml

import robotmodels as rm
from robotmodels.cli import main
from robotmodels.identification import exciting_trajectory, write_trajectory
from robotmodels.trajectories import quintic

QUICK = {"harmonics": 3, "starts": 1, "baseline": 2, "iterations": 5, "rng": 0}


@pytest.fixture(scope="module")
def found():
    return exciting_trajectory(rm.load("stanford_arm"), **QUICK)


@pytest.mark.parametrize("degrees", [False, True])
def test_csv_holds_samples_and_their_units(found, tmp_path, degrees):
    path = tmp_path / "a.csv"
    write_trajectory(found, path, rate=50.0, degrees=degrees)
    header = path.read_text(encoding="utf-8").splitlines()[0].split(",")
    angle = "deg" if degrees else "rad"
    assert header[:4] == ["t (s)", f"q joint_1 ({angle})", f"q joint_2 ({angle})", "q joint_3 (m)"]
    assert header[18] == f"a joint_6 ({angle}/s^2)"
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    assert np.allclose(rows[:, 0], np.arange(501) / 50.0)
    factor = np.where(np.arange(6) == 2, 1.0, 180.0 / np.pi if degrees else 1.0)
    for k, values in enumerate((found.trajectory.q, found.trajectory.v, found.trajectory.a)):
        expected = values(rows[:, 0]) * factor
        assert np.allclose(rows[:, 1 + 6 * k : 7 + 6 * k], expected, rtol=1e-10, atol=1e-10)


def test_npz_ros_and_other_trajectories(found, tmp_path):
    write_trajectory(found, tmp_path / "a.npz", rate=30.0)
    with np.load(tmp_path / "a.npz") as data:
        assert np.array_equal(data["q"], found.trajectory.q(data["t"]))
        assert data["units"].tolist() == ["rad", "rad", "m", "rad", "rad", "rad"]
    write_trajectory(found, tmp_path / "a.yaml", rate=30.0)
    message = yaml.safe_load((tmp_path / "a.yaml").read_text(encoding="utf-8"))
    assert message["joint_names"] == list(found.model.table.joint_names)
    assert len(message["points"]) == 301
    point = message["points"][100]
    assert point["time_from_start"] == {"sec": 3, "nanosec": 333333333}
    assert np.allclose(point["accelerations"], found.trajectory.a(100 / 30.0), atol=1e-10)
    assert set(point) == {"positions", "velocities", "accelerations", "time_from_start"}
    move = quintic([0.0, 1.0], [1.0, 2.0], duration=0.35)
    write_trajectory(move, tmp_path / "b.csv", rate=10.0, names=["x", "y"], turns=[True, False])
    rows = np.loadtxt(tmp_path / "b.csv", delimiter=",", skiprows=1)
    assert rows[:, 0].tolist() == [0.0, 0.1, 0.2, 0.3]


@pytest.mark.parametrize("kind", ["fourier", "spline"])
def test_json_makes_the_same_motion_bit_by_bit(kind, tmp_path):
    result = exciting_trajectory(rm.load("planar_2r"), kind=kind, **QUICK)
    write_trajectory(result, tmp_path / "a.json")
    data = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    again = getattr(rm.trajectories, data["motion"]["generator"])(**data["motion"]["arguments"])
    t = np.linspace(0.0, 10.0, 77)
    assert np.array_equal(again.q(t), result.trajectory.q(t))
    assert np.array_equal(again.a(t), result.trajectory.a(t))
    assert data["condition"] == result.condition
    assert data["limits"]["torque"] == [None, None]


# --- the command ----------------------------------------------------------------------------------

FEW = ["--starts", "1", "--random", "2", "--iterations", "5", "--harmonics", "3", "--seed", "4"]


def run(capsys, *words):
    try:
        code = main(["excite", *FEW, "--robot", *map(str, words)])
    except SystemExit as stop:
        code = stop.code
    return code, *capsys.readouterr()


def test_excite_writes_what_a_controller_needs(capsys, tmp_path):
    folder = tmp_path / "motion"
    code, out, err = run(
        capsys, "rx90", "--duration", 8, "--criterion", "log-det", "--acceleration",
        "3", "3", "4", "5", "5", "6", "--velocity", 1.5, "--box", "-inf", "-inf", "-1e1", "inf",
        "inf", "inf", "--box", "-9 -9 -9 9 9 9", "--keep-out", "2,2,-1,3,3,1", "--rate", 100,
        "--out", folder,
    )  # fmt: skip
    assert (code, err) == (0, "")
    names = {"trajectory.csv", "trajectory.json", "trajectory.png", "summary.txt"}
    assert {path.name for path in folder.iterdir()} == names
    assert all(f"wrote {folder / name}" in out for name in names)
    rows = np.loadtxt(folder / "trajectory.csv", delimiter=",", skiprows=1)
    assert rows.shape == (801, 19)
    assert (np.abs(rows[:, 13:]).max(axis=0) <= [3, 3, 4, 5, 5, 6]).all()
    assert np.abs(rows[:, 7:13]).max() <= 1.5
    assert "every limit is kept" in (folder / "summary.txt").read_text(encoding="utf-8")

"""Measurements from files and results into files: units, columns, and cells that are no numbers."""

import json

import numpy as np
import pytest

from robotmodels import se3
from robotmodels.calibration import KnownDistance, PointContact, Pose, Position, fit
from robotmodels.calibration.measurements import (
    Distance,
    FrameContact,
    LaserLine,
    PlaneContact,
    RelativePose,
)
from robotmodels.calibration.read import read_measurements
from robotmodels.calibration.robot import calibrated_pose
from robotmodels.calibration.write import result_data, write_result
from robotmodels.errors import InvalidValueError
from robotmodels.kinematics import dgm, operational_coordinates
from robotmodels.model import RobotModel
from robotmodels.robots import load

RX90 = load("rx90")
Q = np.random.default_rng(3).uniform(-1.8, 1.8, (12, 6))
T = dgm(RX90.with_tool(se3.translation(0.02, 0.01, 0.1)), Q)
NAMES = list(RX90.table.joint_names)


def written(path, header, rows, delimiter=",", **more):
    rows = [*([] if header is None else [header]), *rows]
    lines = [delimiter.join(map(str, row)) for row in rows]
    path.write_text("\n".join(lines) + "\n", **{"encoding": "utf-8", **more})
    return path


def rows_of(*parts):
    return [[float(v) for v in row] for row in np.column_stack(parts)]


# --- columns and units ----------------------------------------------------------------------------


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_positions_by_the_names_of_the_joints(tmp_path, delimiter):
    names = ["time", *reversed(NAMES), "Z", "y", "x"]  # any order, any capitals
    rows = rows_of(np.arange(12.0), Q[:, ::-1], T[:, 2, 3], T[:, 1, 3], T[:, 0, 3])
    file = written(tmp_path / "a.csv", names, rows, delimiter)
    found = read_measurements(file, "position", RX90, sigma=1e-4, rows=[1, 0, 1])
    assert isinstance(found, Position)
    assert found.axes == ("x", "z")
    assert found.sigma[0, 0] == 1e-4
    np.testing.assert_allclose(found.q, Q, rtol=1e-11)
    np.testing.assert_allclose(found.p, T[:, :3, 3], rtol=1e-10)


def test_columns_by_argument_and_by_number(tmp_path):
    header = [f"q{j + 1}" for j in range(6)] + ["px", "py", "pz"]
    named = written(tmp_path / "a.csv", header, rows_of(Q, T[:, :3, 3]), encoding="utf-8-sig")
    bare = written(tmp_path / "a.txt", None, rows_of(T[:, :3, 3], Q), " ")
    for file, more in (
        (named, {"columns": ["px", "py", "pz"]}),
        (bare, {"joints": range(3, 9), "columns": [0, 1, 2]}),
    ):
        found = read_measurements(file, Position, RX90, **more)
        np.testing.assert_allclose(found.q, Q, rtol=1e-11)
        np.testing.assert_allclose(found.p, T[:, :3, 3], rtol=1e-10)
    for file, more, message in (
        (named, {}, r"expected columns x, y, z; the header is q1"),
        (named, {"columns": ["pu", "py", "pz"]}, r"no column 'pu'; near it: p"),
        (named, {"joints": ["q1"]}, r"joints: expected 6 columns \(joint_1"),
        (bare, {"columns": [0, 1, 2]}, "expected columns joint_1.* or q1, .*no header"),
        (bare, {"joints": range(3, 9), "columns": [0, 1, 9]}, "columns 0 to 8, got 9"),
        (written(tmp_path / "b.csv", ["a", "b"], [[1.0, 2.0]]), {}, "expected columns joint_1"),
    ):
        with pytest.raises(InvalidValueError, match=message):
            read_measurements(file, "position", RX90, **more)


@pytest.mark.parametrize(
    ("scale", "options", "message"),
    [
        ((180.0 / np.pi, 1.0), {}, "look like degrees. Use angles='deg'"),
        ((1.0, 1.0), {"angles": "deg"}, "look like radians. Use angles='rad'"),
        ((1.0, 1.0), {"angles": "rad", "joint_angles": "deg"}, "Use joint_angles='rad'"),
        ((1.0, 1e3), {}, "look like millimetres. Use lengths='mm'"),
        ((1.0, 1.0), {"lengths": "mm"}, "as if metres had been converted as millimetres"),
        ((1.0, 1.0), {"label": "x"}, "label: position does not use it"),
    ],
)
def test_units_and_arguments_that_cannot_be_right_are_named(tmp_path, scale, options, message):
    rows = rows_of(scale[0] * Q, scale[1] * T[:, :3, 3])
    file = written(tmp_path / "a.csv", [*NAMES, "x", "y", "z"], rows)
    with pytest.raises(InvalidValueError, match=message):
        read_measurements(file, "position", RX90, **options)


# --- orientations ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "written_as",
    ["rpy_urdf", "rpy", "quaternion", "angle_axis", "euler", "direction_cosines", "two_axes"],
)
def test_poses_in_every_way_to_write_them(tmp_path, written_as):
    x = operational_coordinates(T, written_as)
    numbers = [*range(6, 6 + x.shape[1])]
    file = written(tmp_path / "a.csv", None, rows_of(Q, x))
    more = {"joints": range(6), "orientation": written_as}
    for kind in (Pose, "camera_pose"):
        pose = read_measurements(file, kind, RX90, columns=numbers, **more)
        np.testing.assert_allclose(pose.T, T, atol=1e-10)
    turned = read_measurements(file, "orientation", RX90, columns=numbers[3:], **more)
    assert turned.axes == ("rx", "ry", "rz")
    np.testing.assert_allclose(turned.T[:, :3, :3], T[:, :3, :3], atol=1e-10)


# --- contacts and pairs ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "built", "field"),
    [
        ("point_contact", PointContact, "point"),
        ("frame_contact", FrameContact, "pose"),
        ("plane-contact", PlaneContact, "plane"),
        (LaserLine, LaserLine, "line"),
    ],
)
def test_contacts_with_labels_of_a_column_or_of_files(tmp_path, kind, built, field):
    labels = ["left", "right hand"] * 6
    rows = [[*row, label] for row, label in zip(rows_of(Q), labels, strict=True)]
    file = written(tmp_path / "all.csv", [*NAMES, "touched"], rows)
    found = read_measurements(file, kind, RX90, label="touched")
    assert isinstance(found, built)
    assert getattr(found, field) == tuple(labels)
    for option in ({"columns": ["touched"]}, {"rows": [1, 1, 0]}):
        with pytest.raises(InvalidValueError, match="does not use it here"):
            read_measurements(file, kind, RX90, **option)
    folder = tmp_path / "place"
    folder.mkdir()
    for name, q in (("hole_1", Q[5:]), ("hole_0", Q[:5]), ("other", Q)):
        written(folder / f"{name}.csv", None, rows_of(q))
    found = read_measurements(folder, kind, RX90, pattern="hole_?.csv")
    assert found.name == "place"
    assert getattr(found, field) == ("hole_0",) * 5 + ("hole_1",) * 7
    np.testing.assert_allclose(found.q, Q, rtol=1e-11)


def test_distances_and_relative_poses(tmp_path):
    other = Q[::-1]
    length = np.linalg.norm(T[:, :3, 3] - T[::-1, :3, 3], axis=1)
    to = [f"{name}_b" for name in NAMES]
    file = written(tmp_path / "a.csv", [*NAMES, *to, "distance"], rows_of(Q, other, 1e3 * length))
    found = read_measurements(file, "distance", RX90, other_joints=to, lengths="mm")
    assert isinstance(found, Distance)
    np.testing.assert_allclose(found.length, length, rtol=1e-10)
    np.testing.assert_allclose(found.views[1].q, other, rtol=1e-11)
    ball = read_measurements(file, "distance", RX90, lengths="mm", name="ball")
    assert [fixture.name for fixture in ball.fixtures] == ["ball:0.x", "ball:0.y", "ball:0.z"]
    between = se3.inverse(T) @ T[::-1]
    x = operational_coordinates(between, "rpy_urdf")
    file = written(tmp_path / "b.csv", None, rows_of(Q, other, x))
    more = {"joints": range(6), "columns": range(12, 18), "orientation": "rpy_urdf"}
    found = read_measurements(file, RelativePose, RX90, other_joints=range(6, 12), **more)
    np.testing.assert_allclose(found.T, between, atol=1e-10)
    with pytest.raises(InvalidValueError, match="two ends need two readings"):
        read_measurements(file, RelativePose, RX90, **more)


# --- mistakes in a file ---------------------------------------------------------------------------


# --- results --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def result():
    rng = np.random.default_rng(1)
    q = rng.uniform(-1.8, 1.8, (40, 6))
    real = RX90.with_tool(se3.translation(0.03, 0.02, 0.1))
    touched = [PointContact(q[:1], [0]), PointContact(q[1:2], [1])]
    p = [dgm(real, m.q)[0, :3, 3] for m in touched]
    far = float(np.linalg.norm(p[0] - p[1]))
    measured = [
        Pose(q, dgm(real, q) @ se3.translation(*(1e-5 * rng.normal(size=3)))),
        *touched, KnownDistance("point:0", "point:1", far),
    ]  # fmt: skip
    return fit(RX90, measured, folds=0, held_out=0.0)


def test_json_and_yaml_hold_the_result(result, tmp_path):
    import yaml

    write_result(result, tmp_path / "a.json")
    write_result(result, tmp_path / "a.YML")
    data = json.loads((tmp_path / "a.json").read_text())
    assert data == yaml.safe_load((tmp_path / "a.YML").read_text())
    assert data == json.loads(json.dumps(result_data(result), allow_nan=False))
    assert [p["name"] for p in data["parameters"]] == list(result.names)
    np.testing.assert_allclose([p["value"] for p in data["parameters"]], result.values)
    np.testing.assert_allclose(
        [p["standard_error"] for p in data["parameters"]], result.standard_errors
    )
    np.testing.assert_allclose(data["covariance"], result.covariance)
    assert {f["name"]: f["value"] for f in data["fixtures"]} == result.fixtures
    assert len(data["fixtures"]) == 6
    assert data["errors"]["in_sample"]["m"]["rms"] == result.validation.in_sample.rms["m"]
    assert data["errors"]["folds"] is None
    assert data["measurements"][-1]["kind"] == "KnownDistance"
    np.testing.assert_allclose(data["tool"], result.model.tool)
    np.testing.assert_allclose(data["table"]["alpha"], result.model.table.alpha)


@pytest.mark.filterwarnings("ignore::robotmodels.errors.UrdfWarning")
def test_the_urdf_is_the_calibrated_robot(result, tmp_path):
    write_result(result, tmp_path / "a.urdf")
    again = RobotModel.from_urdf(tmp_path / "a.urdf")
    q = np.random.default_rng(5).uniform(-2.0, 2.0, (20, 6))
    np.testing.assert_allclose(dgm(again, q), calibrated_pose(result.robot, q), atol=1e-11)
    with pytest.raises(InvalidValueError, match=r"expected a file named \.json"):
        write_result(result, tmp_path / "a.txt")

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
from robotmodels.csv_table import open_table
from robotmodels.errors import InvalidValueError, NotARotationError
from robotmodels.geometry import DHTable
from robotmodels.kinematics import dgm, operational_coordinates
from robotmodels.model import RobotModel
from robotmodels.robots import load

RX90 = load("rx90")
SCARA = RobotModel.from_table(
    DHTable.from_rows([
        {"sigma": 0, "name": "waist"}, {"sigma": 0, "d": 0.35, "name": "elbow"},
        {"sigma": 1, "d": 0.3, "alpha": np.pi, "name": "lift"},
    ]),
    name="scara",
)  # fmt: skip
Q = np.random.default_rng(3).uniform(-1.8, 1.8, (12, 6))
T = dgm(RX90.with_tool(se3.translation(0.02, 0.01, 0.1)), Q)
NAMES = list(RX90.table.joint_names)


def written(path, header, rows, delimiter=",", **more):
    lines = [] if header is None else [delimiter.join(header)]
    lines += [delimiter.join(f"{v:.12g}" if isinstance(v, float) else str(v) for v in row)
              for row in rows]  # fmt: skip
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
    for file, model, more, message in (
        (named, RX90, {}, r"expected columns x, y, z; the header is q1"),
        (named, RX90, {"columns": ["pu", "py", "pz"]}, r"no column 'pu'; near it: p"),
        (named, RX90, {"columns": ["px", "py"]}, "expected 3 columns"),
        (named, SCARA, {"joints": ["q1"]}, "a column for each of the 3 joints"),
        (bare, RX90, {"columns": [0, 1, 2]}, "no header says which of its 9 columns"),
        (bare, RX90, {"joints": range(3, 9), "columns": [0, 1, 9]}, "columns 0 to 8, got 9"),
        (bare, RX90, {"joints": range(3, 9), "columns": list("xyz")}, "has no header, so that 'x'"),
        (written(tmp_path / "b.csv", ["a", "b"], [[1.0, 2.0]]), SCARA, {}, "joints of scara"),
    ):
        with pytest.raises(InvalidValueError, match=message):
            read_measurements(file, "position", model, **more)


def test_millimetres_and_degrees_give_the_same_as_metres_and_radians(tmp_path):
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (9, 3))
    p = dgm(SCARA, q)[:, :3, 3]
    header = ["waist", "elbow", "lift", "x", "y", "z"]
    # a prismatic joint is read in the unit of lengths
    rows = rows_of(np.rad2deg(q[:, :2]), 1e3 * q[:, 2], 1e3 * p)
    file = written(tmp_path / "mm.csv", header, rows)
    found = read_measurements(file, "position", SCARA, lengths="mm", angles="deg")
    np.testing.assert_allclose(found.q, q, rtol=1e-10)
    np.testing.assert_allclose(found.p, p, rtol=1e-10, atol=1e-15)


@pytest.mark.parametrize(
    ("scale", "options", "message"),
    [
        ((180.0 / np.pi, 1.0), {}, "look like degrees. Use angles='deg'"),
        ((1.0, 1.0), {"angles": "deg"}, "look like radians. Use angles='rad'"),
        ((1.0, 1.0), {"angles": "rad", "joint_angles": "deg"}, "Use joint_angles='rad'"),
        ((1.0, 1e3), {}, "look like millimetres. Use lengths='mm'"),
        ((1.0, 1.0), {"lengths": "mm"}, "look like metres. Use lengths='m'"),
        ((1.0, 1.0), {"lengths": "inch"}, "lengths: expected 'm' or 'mm', got 'inch'"),
        ((1.0, 1.0), {"label": "x"}, "label: position does not use it"),
        ((1.0, 1.0), {"other_joints": NAMES}, "other_joints: position does not use it"),
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


def test_quaternions_of_few_digits_scalar_last_and_angles_in_degrees(tmp_path):
    x = operational_coordinates(T, "quaternion").round(5)
    header = [*NAMES, "x", "y", "z", "qx", "qy", "qz", "qw"]
    file = written(tmp_path / "a.csv", header, rows_of(Q, x[:, :3], x[:, 4:], x[:, 3]))
    pose = read_measurements(file, "pose", RX90, orientation="quaternion")
    np.testing.assert_allclose(pose.T, T, atol=5e-5)
    wrong = {"orientation": "quaternion", "columns": ["x", "y", "z", "x", "qx", "qy", "qz"]}
    with pytest.raises(InvalidValueError, match="quaternion of row 1 has length"):
        read_measurements(file, "pose", RX90, **wrong)
    with pytest.raises(InvalidValueError, match="orientation: expected 'rpy_urdf'"):
        read_measurements(file, "pose", RX90)
    y = operational_coordinates(T, "rpy_urdf")
    header = [*NAMES, "x", "y", "z", "roll", "pitch", "yaw"]
    file = written(tmp_path / "b.csv", header, rows_of(Q, y[:, :3], np.rad2deg(y[:, 3:])))
    units = {"angles": "deg", "joint_angles": "rad"}
    pose = read_measurements(file, "pose", RX90, orientation="rpy_urdf", **units)
    np.testing.assert_allclose(pose.T, T, atol=1e-10)
    cosines = 1.1 * operational_coordinates(T, "direction_cosines")
    file = written(tmp_path / "c.csv", None, rows_of(Q, cosines))
    numbers = {"joints": range(6), "columns": range(6, 18)}
    with pytest.raises(NotARotationError):
        read_measurements(file, "pose", RX90, orientation="direction_cosines", **numbers)


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
    bare = written(tmp_path / "bare.csv", None, [[row[-1], *row[:-1]] for row in rows])
    found = read_measurements(bare, kind, RX90, joints=range(1, 7), label=0)
    assert getattr(found, field) == tuple(labels)
    folder = tmp_path / "place"
    folder.mkdir()
    for name, q in (("hole_1", Q[5:]), ("hole_0", Q[:5]), ("other", Q)):
        written(folder / f"{name}.csv", None, rows_of(q))
    found = read_measurements(folder, kind, RX90, pattern="hole_?.csv")
    assert found.name == "place"
    assert getattr(found, field) == ("hole_0",) * 5 + ("hole_1",) * 7
    np.testing.assert_allclose(found.q, Q, rtol=1e-11)
    with pytest.raises(InvalidValueError, match=r"no file 'pin_\*'"):
        read_measurements(folder, kind, RX90, pattern="pin_*")


def test_the_same_file_name_in_two_folders_is_two_points(tmp_path):
    files = []
    for name in ("front", "back"):
        (tmp_path / name).mkdir()
        files.append(written(tmp_path / name / "hole.csv", None, rows_of(Q)))
    found = read_measurements(files, "point_contact", RX90)
    assert set(found.point) == {"front/hole", "back/hole"}


def test_files_of_a_folder_with_other_contents_are_refused(tmp_path):
    written(tmp_path / "a.csv", None, rows_of(Q))
    for other, message in (
        (np.hstack([Q, Q]), "do not have the same columns"),
        (np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0], (9, 1)), "unit quaternions: poses"),
    ):
        written(tmp_path / "b.csv", None, rows_of(other))
        with pytest.raises(InvalidValueError, match=message):
            read_measurements(tmp_path, "point_contact", RX90, joints=range(6))


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


def test_kinds_that_files_cannot_hold_are_refused(tmp_path):
    for kind in ("positions", "known_distance", KnownDistance, "linked_frames", "axis_position"):
        with pytest.raises(InvalidValueError, match=r"expected one of .*'camera_pose', 'distance'"):
            read_measurements(tmp_path, kind, RX90)


# --- mistakes in a file ---------------------------------------------------------------------------

HEADER = ",".join(NAMES)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            f"# a comment\n{HEADER}\n\n1,1,nan,1,1,1",
            r"line 4: column 2 \(joint_3\) is 'nan'. A row",
        ),
        (f"{HEADER}\n1,1,inf,1,1,1", r"line 2: column 2 \(joint_3\) is 'inf'"),
        (f"{HEADER}\n1,1,,1,1,1", r"line 2: column 2 \(joint_3\) is empty"),
        (f"{HEADER}\n1,1,n/a,1,1,1", r"line 2: column 2 \(joint_3\) is 'n/a', not a number"),
        (f"{HEADER}\n1,1,1,1,1,1\n1,2,3", "line 3: expected 6 columns as in the first"),
        (HEADER.replace(",", ";") + "\n0,5;1;1;1;1;1", r"is '0,5', not a number\. Write a point"),
        ("# nothing\n\n", "the file is empty"),
        (HEADER, "no line of numbers"),
        ("\xff\xfe\x00\x81", "expected a text file"),
    ],
)
def test_mistakes_in_a_file_are_named_with_their_line(tmp_path, text, message):
    (tmp_path / "a.csv").write_bytes(text.encode("latin-1"))
    with pytest.raises(InvalidValueError, match=message):
        read_measurements(tmp_path / "a.csv", "point_contact", RX90)


def test_missing_files_and_labels(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_measurements(tmp_path / "missing.csv", "point_contact", RX90)
    with pytest.raises(InvalidValueError, match="several files, got none"):
        read_measurements([], "point_contact", RX90)
    file = tmp_path / "a.csv"
    file.write_text(f"{HEADER},label\n1,1,1,1,1,1,a\n1,1,1,1,1,1,\n")
    with pytest.raises(InvalidValueError, match=r"line 3: column 6 \(label\) is empty"):
        read_measurements(file, "point_contact", RX90, label="label")
    file.write_text("hole a,1,2,3\n")
    assert open_table(file).names == ()
    file.write_text("hole,q1,q2,q3\nhole a,1,2,3\n")
    assert open_table(file).names == ("hole", "q1", "q2", "q3")


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
    inside = [p["interval_95"][0] < p["correction"] < p["interval_95"][1]
              for p in data["parameters"]]  # fmt: skip
    assert all(inside)
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

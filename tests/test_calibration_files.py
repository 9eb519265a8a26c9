"""Measurements from files and results into files: units, columns, and cells that are no numbers."""

import json

import numpy as np
import pytest

from robotmodels import se3
from robotmodels.calibration import KnownDistance, PointContact, Pose, Position, fit
from robotmodels.calibration.measurements import (
    Distance,
    FrameContact,
    PlaneContact,
    RelativePose,
)
from robotmodels.calibration.read import read_measurements
from robotmodels.calibration.reporting.write import result_data, write_result
from robotmodels.calibration.robot import calibrated_pose
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


# --- columns --------------------------------------------------------------------------------------


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_positions_by_the_names_of_the_joints(tmp_path, delimiter):
    names = ["time", *reversed(NAMES), "Z", "y", "x"]  # any order, any capitals
    rows = rows_of(np.arange(12.0), Q[:, ::-1], T[:, 2, 3], T[:, 1, 3], T[:, 0, 3])
    file = written(tmp_path / "a.csv", names, rows, delimiter)
    found = read_measurements(file, "position", RX90, sigma=1e-4)
    assert isinstance(found, Position)
    np.testing.assert_allclose(found.q, Q, rtol=1e-11)
    np.testing.assert_allclose(found.p, T[:, :3, 3], rtol=1e-10)
    assert found.sigma is not None
    assert found.sigma[0, 0] == 1e-4


def test_joints_called_q1_to_qn_columns_by_argument_and_a_mark_at_the_beginning(tmp_path):
    header = [f"q{j + 1}" for j in range(6)] + ["px", "py", "pz"]
    file = written(tmp_path / "a.csv", header, rows_of(Q, T[:, :3, 3]), encoding="utf-8-sig")
    found = read_measurements(file, Position, RX90, columns=["px", "py", "pz"])
    np.testing.assert_allclose(found.p, T[:, :3, 3], rtol=1e-10)
    with pytest.raises(InvalidValueError, match=r"expected columns x, y, z; the header is q1"):
        read_measurements(file, Position, RX90)
    with pytest.raises(InvalidValueError, match=r"no column 'pu'; near it: p"):
        read_measurements(file, Position, RX90, columns=["pu", "py", "pz"])
    with pytest.raises(InvalidValueError, match="neither the joints of scara"):
        read_measurements(
            written(tmp_path / "b.csv", ["a", "b", "c"], rows_of(Q[:, :3])), "point_contact", SCARA
        )


def test_columns_by_number_without_a_header(tmp_path):
    file = written(tmp_path / "a.txt", None, rows_of(T[:, :3, 3], Q), " ")
    found = read_measurements(file, "position", RX90, joints=range(3, 9), columns=[0, 1, 2])
    np.testing.assert_allclose(found.q, Q, rtol=1e-11)
    np.testing.assert_allclose(found.p, T[:, :3, 3], rtol=1e-10)
    with pytest.raises(InvalidValueError, match="no header says which of its 9 columns"):
        read_measurements(file, "position", RX90, columns=[0, 1, 2])
    with pytest.raises(InvalidValueError, match="has columns 0 to 8, got 9"):
        read_measurements(file, "position", RX90, joints=range(3, 9), columns=[0, 1, 9])
    with pytest.raises(InvalidValueError, match="has no header, so that 'x' names none"):
        read_measurements(file, "position", RX90, joints=range(3, 9), columns=["x", "y", "z"])
    with pytest.raises(InvalidValueError, match="a column for each of the 6 joints"):
        read_measurements(file, "position", RX90, joints=range(3, 8), columns=[0, 1, 2])


def test_only_some_coordinates_count(tmp_path):
    file = written(tmp_path / "a.csv", [*NAMES, "x", "y", "z"], rows_of(Q, T[:, :3, 3]))
    assert read_measurements(file, "position", RX90, rows=[1, 0, 1]).axes == ("x", "z")


# --- units ----------------------------------------------------------------------------------------


def test_millimetres_and_degrees_give_the_same_as_metres_and_radians(tmp_path):
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (9, 3))
    p = dgm(SCARA, q)[:, :3, 3]
    header = ["waist", "elbow", "lift", "x", "y", "z"]
    si = written(tmp_path / "si.csv", header, rows_of(q, p))
    # a prismatic joint is read in the unit of lengths
    shop = written(
        tmp_path / "mm.csv", header, rows_of(np.rad2deg(q[:, :2]), 1e3 * q[:, 2], 1e3 * p)
    )
    a = read_measurements(si, "position", SCARA)
    b = read_measurements(shop, "position", SCARA, lengths="mm", angles="deg")
    np.testing.assert_allclose(b.q, a.q, rtol=1e-10)
    np.testing.assert_allclose(b.p, a.p, rtol=1e-10, atol=1e-15)


@pytest.mark.parametrize(
    ("scale", "options", "message"),
    [
        ((180.0 / np.pi, 1.0), {}, "look like degrees. Say angles='deg'"),
        ((1.0, 1.0), {"angles": "deg"}, "look like radians. Say angles='rad'"),
        ((1.0, 1.0), {"angles": "rad", "joint_angles": "deg"}, "Say joint_angles='rad'"),
        ((1.0, 1e3), {}, "look like millimetres. Say lengths='mm'"),
        ((1.0, 1.0), {"lengths": "mm"}, "look like metres. Say lengths='m'"),
        ((1.0, 1.0), {"lengths": "inch"}, "lengths: expected 'm' or 'mm', got 'inch'"),
    ],
)
def test_a_unit_error_of_units_is_named_with_the_argument_that_repairs_it(
    tmp_path, scale, options, message
):
    rows = rows_of(scale[0] * Q, scale[1] * T[:, :3, 3])
    file = written(tmp_path / "a.csv", [*NAMES, "x", "y", "z"], rows)
    with pytest.raises(InvalidValueError, match=message):
        read_measurements(file, "position", RX90, **options)


# --- orientations ---------------------------------------------------------------------------------

KINDS = [
    "rpy_urdf", "rpy", "quaternion", "angle_axis", "euler", "direction_cosines", "two_axes",
]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_poses_in_every_way_to_write_them(tmp_path, kind):
    x = operational_coordinates(T, kind)
    numbers = [*range(6, 6 + x.shape[1])]
    file = written(tmp_path / "a.csv", None, rows_of(Q, x))
    more = {"joints": range(6), "orientation": kind}
    pose = read_measurements(file, "pose", RX90, columns=numbers, **more)
    assert isinstance(pose, Pose)
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
    with pytest.raises(InvalidValueError, match="quaternion of row 1 has length"):
        read_measurements(file, "pose", RX90, orientation="quaternion",
                          columns=["x", "y", "z", "x", "qx", "qy", "qz"])  # fmt: skip
    y = operational_coordinates(T, "rpy_urdf")
    header = [*NAMES, "x", "y", "z", "roll", "pitch", "yaw"]
    file = written(tmp_path / "b.csv", header, rows_of(Q, y[:, :3], np.rad2deg(y[:, 3:])))
    pose = read_measurements(
        file, "pose", RX90, orientation="rpy_urdf", angles="deg", joint_angles="rad"
    )
    np.testing.assert_allclose(pose.T, T, atol=1e-10)
    with pytest.raises(InvalidValueError, match="orientation: say how orientations are written"):
        read_measurements(file, "pose", RX90)
    cosines = operational_coordinates(T, "direction_cosines") * np.r_[np.ones(3), 1.1 * np.ones(9)]
    file = written(tmp_path / "c.csv", None, rows_of(Q, cosines))
    with pytest.raises(NotARotationError):
        read_measurements(file, "pose", RX90, joints=range(6), columns=range(6, 18),
                          orientation="direction_cosines")  # fmt: skip


# --- contacts and pairs ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "built", "field"),
    [
        ("point_contact", PointContact, "point"),
        ("frame_contact", FrameContact, "pose"),
        ("plane-contact", PlaneContact, "plane"),
    ],
)
def test_contacts_with_labels_of_a_column_or_of_files(tmp_path, kind, built, field):
    labels = ["left", "right hand"] * 6
    rows = [[*row, label] for row, label in zip(rows_of(Q), labels, strict=True)]
    file = written(tmp_path / "all.csv", [*NAMES, "touched"], rows)
    found = read_measurements(file, kind, RX90, label="touched")
    assert isinstance(found, built)
    assert getattr(found, field) == tuple(labels)
    bare = written(tmp_path / "bare.csv", None, [[row[-1], *row[:-1]] for row in rows])
    found = read_measurements(bare, kind, RX90, joints=range(1, 7), label=0)
    assert getattr(found, field) == tuple(labels)
    folder = tmp_path / "place"
    folder.mkdir()
    written(folder / "hole_1.csv", None, rows_of(Q[5:]))
    written(folder / "hole_0.csv", None, rows_of(Q[:5]))
    written(folder / "other.csv", None, rows_of(Q))
    found = read_measurements(folder, kind, RX90, pattern="hole_?.csv")
    assert found.name == "place"
    assert getattr(found, field) == ("hole_0",) * 5 + ("hole_1",) * 7
    np.testing.assert_allclose(found.views[0].q, Q, rtol=1e-11)
    with pytest.raises(InvalidValueError, match=r"no file 'pin_\*'"):
        read_measurements(folder, kind, RX90, pattern="pin_*")


def test_the_same_file_name_in_two_folders_is_two_points(tmp_path):
    files = []
    for name in ("front", "back"):
        (tmp_path / name).mkdir()
        files.append(written(tmp_path / name / "hole.csv", None, rows_of(Q)))
    found = read_measurements(files, "point_contact", RX90)
    assert set(found.point) == {"front/hole", "back/hole"}


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


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        ("position", {"label": "x"}, "label: position has no labels"),
        ("position", {"other_joints": NAMES}, "other_joints: position has one end"),
        ("point_contact", {"rows": [1, 1, 0]}, "rows: point_contact has no rows"),
        ("point_contact", {"columns": ["x"]}, "columns: a contact measures nothing"),
        ("position", {"columns": ["x", "y"]}, "expected 3 columns"),
        ("positions", {}, "expected one of 'position', 'pose'"),
    ],
)
def test_arguments_that_do_not_belong_to_a_kind(tmp_path, kind, options, message):
    file = written(tmp_path / "a.csv", [*NAMES, "x", "y", "z"], rows_of(Q, T[:, :3, 3]))
    with pytest.raises(InvalidValueError, match=message):
        read_measurements(file, kind, RX90, **options)


# --- what is wrong in a file ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("nan", r"line 6: column 2 \(joint_3\) is 'nan'. A row that was not measured is left out"),
        ("inf", r"line 6: column 2 \(joint_3\) is 'inf'"),
        ("", r"line 6: column 2 \(joint_3\) is empty"),
        ("  ", r"line 6: column 2 \(joint_3\) is empty"),
        ("n/a", r"line 6: column 2 \(joint_3\) is 'n/a', not a number"),
    ],
)
def test_a_bad_cell_is_named_with_its_line(tmp_path, cell, message):
    rows = [[f"{v:.6f}" for v in row] for row in np.column_stack([Q, T[:, :3, 3]])]
    rows[2][2] = cell
    lines = ["# a tracker", ",".join([*NAMES, "x", "y", "z"]), "", *(",".join(r) for r in rows)]
    file = tmp_path / "a.csv"
    file.write_text("\n".join(lines))
    with pytest.raises(InvalidValueError, match=message):
        read_measurements(file, "position", RX90)


def test_short_lines_decimal_commas_empty_files_and_files_of_bytes(tmp_path):
    file = written(tmp_path / "a.csv", [*NAMES, "x", "y", "z"], rows_of(Q, T[:, :3, 3]))
    file.write_text(file.read_text() + "1,2,3\n")
    with pytest.raises(InvalidValueError, match="line 14: expected 9 columns as in the first"):
        read_measurements(file, "position", RX90)
    file.write_text(";".join(NAMES) + "\n" + ";".join(["0,5"] * 6) + "\n")
    with pytest.raises(InvalidValueError, match=r"is '0,5', not a number\. Write a point"):
        read_measurements(file, "point_contact", RX90)
    file.write_text("# nothing\n\n")
    with pytest.raises(InvalidValueError, match="the file is empty"):
        read_measurements(file, "point_contact", RX90)
    file.write_text(",".join(NAMES) + "\n")
    with pytest.raises(InvalidValueError, match="no line of numbers"):
        read_measurements(file, "point_contact", RX90)
    file.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InvalidValueError, match="expected a text file"):
        read_measurements(file, "point_contact", RX90)
    with pytest.raises(FileNotFoundError):
        read_measurements(tmp_path / "missing.csv", "point_contact", RX90)
    with pytest.raises(InvalidValueError, match="several files, got none"):
        read_measurements([], "point_contact", RX90)
    file.write_text(",".join([*NAMES, "label"]) + "\n" + "1,1,1,1,1,1,a\n1,1,1,1,1,1,\n")
    with pytest.raises(InvalidValueError, match=r"line 3: column 6 \(label\) is empty"):
        read_measurements(file, "point_contact", RX90, label="label")


def test_a_header_is_told_from_labels(tmp_path):
    file = tmp_path / "a.csv"
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
    np.testing.assert_allclose([p["std"] for p in data["parameters"]], result.standard_deviation)
    inside = [p["interval_95"][0] < p["deviation"] < p["interval_95"][1]
              for p in data["parameters"]]  # fmt: skip
    assert all(inside)
    np.testing.assert_allclose(data["covariance"], result.covariance)
    assert {f["name"]: f["value"] for f in data["fixtures"]} == result.fixtures
    assert len(data["fixtures"]) == 6
    assert data["errors"]["after"]["m"]["rms"] == result.after.summary("m").rms
    assert data["errors"]["folds"] is None
    assert data["measurements"][-1]["kind"] == "KnownDistance"
    np.testing.assert_allclose(data["tool"], result.model.tool)
    np.testing.assert_allclose([row["alpha"] for row in data["table"]], result.model.table.alpha)


@pytest.mark.filterwarnings("ignore::robotmodels.errors.UrdfWarning")
def test_the_urdf_is_the_calibrated_robot(result, tmp_path):
    write_result(result, tmp_path / "a.urdf")
    again = RobotModel.from_urdf(tmp_path / "a.urdf")
    q = np.random.default_rng(5).uniform(-2.0, 2.0, (20, 6))
    np.testing.assert_allclose(dgm(again, q), calibrated_pose(result.robot, q), atol=1e-11)
    with pytest.raises(InvalidValueError, match=r"expected a file named \.json"):
        write_result(result, tmp_path / "a.txt")

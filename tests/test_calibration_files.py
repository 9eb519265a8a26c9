"""Measurements from files and results into files: columns, units, orientations, labels."""

import json

import numpy as np
import pytest

import robotmodels as rm
from robotmodels import se3
from robotmodels.calibration import calibrated_pose, fit, read_measurements
from robotmodels.calibration.measurements import LaserLine, RelativePose
from robotmodels.calibration.write import result_data, write_result
from robotmodels.errors import InvalidValueError

RX90 = rm.load("rx90")
Q = np.random.default_rng(3).uniform(-1.8, 1.8, (12, 6))
T = rm.dgm(RX90.with_tool(se3.translation(0.02, 0.01, 0.1)), Q)
P, APART = T[:, :3, 3], np.linalg.norm(T[:, :3, 3] - T[::-1, :3, 3], axis=1)
NAMES = list(RX90.table.joint_names)
XYZ, NUMBERS = ["x", "y", "z"], range(6)


def written(path, header, *parts, delimiter=",", **more):
    """A file with a header, or none, and columns of numbers or words."""
    rows = [row.tolist() for row in np.column_stack([np.asarray(p, object) for p in parts])]
    lines = [
        delimiter.join(map(str, row)) for row in [*([] if header is None else [header]), *rows]
    ]
    path.write_text("\n".join(lines) + "\n", **{"encoding": "utf-8", **more})
    return path


@pytest.mark.parametrize(
    ("delimiter", "header", "parts", "options"),
    [
        *(  # any order, any capitals
            (d, [*reversed(NAMES), "t", "Z", "y", "x"], (Q[:, ::-1], np.arange(12), P[:, ::-1]), {})
            for d in ",;\t "
        ),
        (",", [f"q{j + 1}" for j in range(6)] + ["px", "py", "pz"], (Q, P),
         {"columns": ["px", "py", "pz"]}),
        (" ", None, (P, Q), {"joints": range(3, 9), "columns": [0, 1, 2]}),
        (",", [*NAMES, *XYZ], (np.rad2deg(Q), 1e3 * P), {"angles": "deg", "lengths": "mm"}),
    ],
)  # fmt: skip
def test_positions_by_names_and_numbers_of_columns(tmp_path, delimiter, header, parts, options):
    encoding = "utf-8-sig" if options else "utf-8"
    file = written(tmp_path / "a.csv", header, *parts, delimiter=delimiter, encoding=encoding)
    found = read_measurements(file, "position", RX90, sigma=1e-4, rows=[1, 0, 1], **options)
    assert found.axes == ("x", "z")
    assert found.sigma[0, 0] == 1e-4
    np.testing.assert_allclose(found.q, Q, rtol=1e-11)
    np.testing.assert_allclose(found.p, P, rtol=1e-10)


@pytest.mark.parametrize(
    ("header", "scale", "options", "message"),
    [
        ([*NAMES, "px", "py", "pz"], (1, 1), {}, "expected columns x, y, z; the header is joint_1"),
        ([*NAMES, *XYZ], (1, 1), {"columns": ["xx", "y", "z"]}, r"no column 'xx'; near it: x"),
        ([*NAMES, *XYZ], (1, 1), {"joints": ["q1"]}, r"joints: expected 6 columns \(joint_1"),
        (None, (1, 1), {"columns": [6, 7, 8]}, "expected columns joint_1.* or q1, .*no header"),
        (None, (1, 1), {"joints": NUMBERS, "columns": [6, 7, 9]}, "columns 0 to 8, got 9"),
        ([*NAMES, *XYZ], (180 / np.pi, 1), {}, "look like degrees. Use angles='deg'"),
        ([*NAMES, *XYZ], (1, 1), {"angles": "deg"}, "look like radians. Use angles='rad'"),
        ([*NAMES, *XYZ], (1, 1), {"joint_angles": "deg"}, "Use joint_angles='rad'"),
        ([*NAMES, *XYZ], (1, 1e3), {}, "look like millimetres. Use lengths='mm'"),
        ([*NAMES, *XYZ], (1, 1), {"lengths": "mm"}, "as if metres had been converted as millim"),
        ([*NAMES, *XYZ], (1, 1), {"label": "x"}, "label: position does not use it"),
    ],
)  # fmt: skip
def test_columns_and_units_that_cannot_be_right_are_named(
    tmp_path, header, scale, options, message
):
    file = written(tmp_path / "a.csv", header, scale[0] * Q, scale[1] * P)
    with pytest.raises(InvalidValueError, match=message):
        read_measurements(file, "position", RX90, **options)


@pytest.mark.parametrize(
    "written_as",
    ["rpy_urdf", "rpy", "quaternion", "angle_axis", "euler", "direction_cosines", "two_axes"],
)
def test_poses_in_every_way_to_write_them(tmp_path, written_as):
    x = rm.operational_coordinates(T, written_as)
    numbers = [*range(6, 6 + x.shape[1])]
    file = written(tmp_path / "a.csv", None, Q, x)
    more = {"joints": NUMBERS, "orientation": written_as}
    for kind in ("pose", "camera_pose"):
        pose = read_measurements(file, kind, RX90, columns=numbers, **more)
        np.testing.assert_allclose(pose.T, T, atol=1e-10)
    turned = read_measurements(file, "orientation", RX90, columns=numbers[3:], **more)
    assert turned.axes == ("rx", "ry", "rz")
    np.testing.assert_allclose(turned.T[:, :3, :3], T[:, :3, :3], atol=1e-10)


@pytest.mark.parametrize("kind", ["point_contact", "frame_contact", "plane-contact", LaserLine])
def test_contacts_with_labels_of_a_column_or_of_files(tmp_path, kind):
    labels = ["left", "right hand"] * 6
    file = written(tmp_path / "all.csv", [*NAMES, "touched"], Q, labels)
    found = read_measurements(file, kind, RX90, label="touched")
    word = kind if isinstance(kind, str) else kind.word
    assert type(found).word == word.replace("-", "_")
    assert found.label == tuple(labels)
    for option in ({"columns": ["touched"]}, {"rows": [1, 1, 0]}):
        with pytest.raises(InvalidValueError, match="does not use it here"):
            read_measurements(file, kind, RX90, **option)
    folder = tmp_path / "place"
    folder.mkdir()
    for name, q in (("hole_1", Q[5:]), ("hole_0", Q[:5]), ("other", Q)):
        written(folder / f"{name}.csv", None, q)
    found = read_measurements(folder, kind, RX90, pattern="hole_?.csv")
    assert found.name == "place"
    assert found.label == ("hole_0",) * 5 + ("hole_1",) * 7
    np.testing.assert_allclose(found.q, Q, rtol=1e-11)


def test_distances_and_relative_poses(tmp_path):
    to = [f"{name}_b" for name in NAMES]
    file = written(tmp_path / "a.csv", [*NAMES, *to, "distance"], Q, Q[::-1], 1e3 * APART)
    found = read_measurements(file, "distance", RX90, other_joints=to, lengths="mm")
    np.testing.assert_allclose(found.length, APART, rtol=1e-10)
    np.testing.assert_allclose(found.views[1].q, Q[::-1], rtol=1e-11)
    ball = read_measurements(file, "distance", RX90, lengths="mm", name="ball")
    assert [fixture.name for fixture in ball.fixtures] == ["ball:0.x", "ball:0.y", "ball:0.z"]
    between = se3.inverse(T) @ T[::-1]
    x = rm.operational_coordinates(between, "rpy_urdf")
    file = written(tmp_path / "b.csv", None, Q, Q[::-1], x)
    more = {"joints": NUMBERS, "columns": range(12, 18), "orientation": "rpy_urdf"}
    found = read_measurements(file, RelativePose, RX90, other_joints=range(6, 12), **more)
    np.testing.assert_allclose(found.T, between, atol=1e-10)
    with pytest.raises(InvalidValueError, match="two measured ends need the readings"):
        read_measurements(file, RelativePose, RX90, **more)


@pytest.mark.filterwarnings("ignore::robotmodels.errors.UrdfWarning")
def test_files_hold_the_result_and_the_calibrated_robot(tmp_path):
    import yaml

    from robotmodels.calibration import KnownDistance, PointContact, Pose

    real = RX90.with_tool(se3.translation(0.03, 0.02, 0.1))
    q = np.random.default_rng(1).uniform(-1.8, 1.8, (40, 6))
    T = rm.dgm(real, q)
    touched = [PointContact(q[:1], [0]), PointContact(q[1:2], [1])]
    far = float(np.linalg.norm(T[0, :3, 3] - T[1, :3, 3]))
    noise = se3.translation(*(1e-5 * np.random.default_rng(2).normal(size=3)))
    seen = [Pose(q, T @ noise), *touched, KnownDistance("point:0", "point:1", far)]
    result = fit(RX90, seen, folds=0, held_out=0.0)
    for name in ("a.json", "a.YML", "a.urdf"):
        write_result(result, tmp_path / name)
    data = json.loads((tmp_path / "a.json").read_text())
    assert data == yaml.safe_load((tmp_path / "a.YML").read_text())
    assert data == json.loads(json.dumps(result_data(result), allow_nan=False))
    assert [p["name"] for p in data["parameters"]] == list(result.names)
    for word, expected in (("value", result.values), ("standard_error", result.standard_errors)):
        np.testing.assert_allclose([p[word] for p in data["parameters"]], expected)
    np.testing.assert_allclose(data["covariance"], result.covariance)
    assert {f["name"]: f["value"] for f in data["fixtures"]} == result.fixtures
    np.testing.assert_allclose(data["table"]["alpha"], result.model.table.alpha)
    again = rm.RobotModel.from_urdf(tmp_path / "a.urdf")
    np.testing.assert_allclose(rm.dgm(again, Q), calibrated_pose(result.robot, Q), atol=1e-11)
    with pytest.raises(InvalidValueError, match=r"expected a file named \.json"):
        write_result(result, tmp_path / "a.txt")

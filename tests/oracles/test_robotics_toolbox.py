"""Direct models against the Robotics Toolbox for Python: PUMA 560 and two laboratory arms.

Each robot is built from the published table in its own convention.
"""

import json
from pathlib import Path

import numpy as np
import pytest

import robotmodels as rm

ROBOTS = ("puma560_dh", "lab_RR", "lab_TRR")


def read(name):
    return json.loads((Path(__file__).parent / f"{name}.json").read_text(encoding="utf-8"))


def drive_of(rows):
    """Coulomb friction that differs with the direction is a symmetric one and an offset."""
    positive, negative = (np.array([row[key] for row in rows]) for key in ("FS_pos", "FS_neg"))
    return rm.DriveParameters(
        Ia=[row["IA"] for row in rows],
        Fv=[row["FV"] for row in rows],
        Fc=(positive - negative) / 2,
        offset=(positive + negative) / 2,
    )


def column(rows, key):
    return [row[key] for row in rows]


def from_published_table(data):
    rows = data["table"]
    bodies = column(rows, "m"), column(rows, "r"), column(rows, "I_com")
    if data["convention"] == "standard":
        keys = ("sigma", "theta", "d", "a", "alpha", "offset")
        standard = [{key: row[key] for key in keys} for row in rows]
        table, last = rm.DHTable.from_standard(standard)
        inertia = rm.InertialParameters.from_standard(standard, *bodies)
    else:
        table = rm.DHTable.from_rows(
            {
                "sigma": row["sigma"],
                "alpha": row["alpha"],
                "d": row["a"],
                "theta": row["theta"] + (row["offset"] if row["sigma"] == 0 else 0.0),
                "r": row["d"] + (row["offset"] if row["sigma"] == 1 else 0.0),
            }
            for row in rows
        )
        last = np.eye(4)
        inertia = rm.InertialParameters.from_com(*bodies)
    model = rm.RobotModel.from_table(
        table, inertia, drive_of(data["kk"]["rows"]), data["base"], last @ data["tool"],
        gravity=data["gravity"], name=data["name"],
    )  # fmt: skip
    return model, last


@pytest.fixture(params=ROBOTS, scope="module")
def data(request):
    return read(request.param)


@pytest.fixture(scope="module")
def robot(data):
    """A model, and the pose of the toolbox's last link frame in R_n."""
    return from_published_table(data)


@pytest.fixture(params=["single", "batch"], scope="module")
def batch(request):
    """Single calls go through Pinocchio, batches through the kernels: both meet the numbers."""
    return request.param == "batch"


def check(function, data, key, inputs, batch, tolerance=1e-12):
    samples = data["samples"]
    expected = np.array([s[key] for s in samples])
    arguments = [np.array([s[i] for s in samples]) for i in inputs]
    if batch:
        actual = function(*arguments)
    else:
        actual = np.array([function(*sample) for sample in zip(*arguments, strict=True)])
    assert actual.shape == expected.shape
    scale = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale, err_msg=key)


def test_inertia_about_the_origins(data, robot):
    keys = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
    values = [[row[key] for key in keys] for row in data["kk"]["rows"]]
    np.testing.assert_allclose(robot[0].inertia.values, values, rtol=0, atol=1e-14)


def test_poses(data, robot, batch):
    model, _ = robot
    check(lambda q: rm.dgm(model, q), data, "fkine", ["q"], batch)


def test_poses_of_all_frames(data, robot, batch):
    model, last = robot
    expected = np.array([s["fkine_all"] for s in data["samples"]])
    q = np.array([s["q"] for s in data["samples"]])
    poses = rm.link_poses(model, q) if batch else np.array([rm.link_poses(model, x) for x in q])
    if data["convention"] == "standard":
        # a classical frame stands at the far end of its link
        ends = []
        for row in data["table"]:
            end = np.eye(4)
            c, s = np.cos(row["alpha"]), np.sin(row["alpha"])
            end[0, 3] = row["a"]
            end[1:3, 1:3] = [[c, -s], [s, c]]
            ends.append(end)
        np.testing.assert_allclose(last, ends[-1], atol=1e-15)
        poses = poses @ np.array(ends)
    np.testing.assert_allclose(poses, expected[:, 1:], rtol=0, atol=1e-12)
    np.testing.assert_allclose(expected[:, 0], np.tile(model.base, (len(q), 1, 1)), atol=0)


def test_the_catalogue_has_these_robots(data, batch):
    model = rm.load(data["name"].lower().removesuffix("_dh"))
    check(lambda q: rm.dgm(model, q), data, "fkine", ["q"], batch)
    check(lambda q: rm.jacobian(model, q), data, "jacob0", ["q"], batch)
    if model.name == "puma560":
        check(lambda *x: rm.idm(model, *x), data, "tau", ["q", "qd", "qdd"], batch)
        check(lambda q: rm.mass_matrix(model, q), data, "inertia", ["q"], batch)


def test_jacobians(data, robot, batch):
    model, _ = robot
    check(lambda q: rm.jacobian(model, q), data, "jacob0", ["q"], batch)
    check(lambda q: rm.jacobian(model, q, reference="local"), data, "jacobe", ["q"], batch)


def test_jacobian_rate(data, robot, batch):
    model, _ = robot
    check(lambda q, v: rm.jacobian_rate(model, q, v), data, "jacob0_dot", ["q", "qd"], batch)


def test_torques(data, robot, batch):
    model, _ = robot
    rotors = model.with_drive(rm.DriveParameters(Ia=model.drive.Ia))
    state = ["q", "qd", "qdd"]
    check(lambda *x: rm.idm(model, *x), data, "tau", state, batch)
    check(lambda *x: rm.idm(rotors, *x), data, "tau_nofriction", state, batch)
    check(lambda *x: rm.idm(model, *x, drive=False), data, "tau_rigid", state, batch)
    check(lambda q: rm.gravity_torque(model, q), data, "gravload", ["q"], batch)


def test_friction(data, robot, batch):
    model, _ = robot
    weightless = model.with_inertia(None).with_drive(
        rm.DriveParameters(Fv=model.drive.Fv, Fc=model.drive.Fc, offset=model.drive.offset)
    )
    state = ["q", "qd", "qdd"]
    check(lambda *x: -rm.idm(weightless, *x), data, "friction", state, batch)


def test_matrices(data, robot, batch):
    model, _ = robot
    check(lambda q: rm.mass_matrix(model, q), data, "inertia", ["q"], batch)
    check(lambda q: rm.mass_matrix(model, q, drive=False), data, "inertia_rigid", ["q"], batch)
    check(lambda q, v: rm.coriolis_matrix(model, q, v), data, "coriolis", ["q", "qd"], batch)


def test_accelerations(data, robot, batch):
    model, _ = robot
    state = ["q", "qd", "tau"]
    check(lambda *x: rm.ddm(model, *x), data, "accel_of_tau", state, batch, 1e-11)
    check(lambda *x: rm.ddm(model, *x), data, "qdd", state, batch, 1e-11)


def test_external_wrench(data, robot, batch):
    model, last = robot
    at_link_end = model.with_tool(last)

    def torque(q, v, a, wrench):
        # theirs is in the axes of the link, ours in those of the world
        R = rm.dgm(at_link_end, q)[..., :3, :3]
        ours = np.einsum("...ij,...kj->...ki", R, wrench.reshape(*wrench.shape[:-1], 2, 3))
        return rm.idm(at_link_end, q, v, a, ours.reshape(wrench.shape), drive=False)

    check(torque, data, "tau_rigid_fext", ["q", "qd", "qdd", "fext"], batch)


def test_the_first_joint_may_be_prismatic():
    """The toolbox's compiled recursion fails here; its wrong numbers are far from ours."""
    data = read("lab_TRR")
    model, _ = from_published_table(data)
    for s in data["samples"]:
        tau = rm.idm(model, s["q"], s["qd"], s["qdd"], drive=False)
        np.testing.assert_allclose(tau, s["tau_rigid"], rtol=1e-12, atol=1e-12)
        assert np.abs(tau - s["tau_rigid_C_rne_WRONG"]).max() > 1.0

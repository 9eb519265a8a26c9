"""Direct models against OpenSYMORO, which prints twelve digits of Khalil's own formulas."""

import json
from pathlib import Path

import numpy as np
import pytest

import robotmodels as rm

ROBOTS = ("symoro_two_arm_tree", "symoro_rx90", "symoro_scara")
INERTIA = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
# twelve digits of numbers of order ten, and what they lost on the way
DIGITS = 2e-11


class Oracle:
    def __init__(self, name):
        path = Path(__file__).parent / f"{name}.json"
        data = json.loads(path.read_text(encoding="utf-8"))
        keys = [{"j": "number", "ant": "antecedent"}.get(k, k) for k in data["table"]["columns"]]
        rows = []
        for values in data["table"]["rows"]:
            # null is the joint variable
            row = dict(zip(keys, [0.0 if x is None else x for x in values], strict=True))
            del row["number"]
            rows.append(row)
        links = [data["links"][str(j + 1)] for j in range(len(rows))]
        self.name, self.data, self.samples = name.removeprefix("symoro_"), data, data["samples"]
        self.model = rm.RobotModel.from_table(
            rm.DHTable.from_rows(rows),
            rm.InertialParameters([[link[key] for key in INERTIA] for link in links]),
            rm.DriveParameters(
                Ia=[link["IA"] for link in links],
                Fv=[link["FV"] for link in links],
                Fc=[link["FS"] for link in links],
            ),
            gravity=data["gravity"],
            name=data["name"],
        )

    def states(self, *keys):
        n = self.model.n
        return [
            np.array([[s[k][str(j + 1)] for j in range(n)] for s in self.samples]) for k in keys
        ]


@pytest.fixture(params=ROBOTS, scope="module")
def oracle(request):
    return Oracle(request.param)


@pytest.fixture(params=["single", "batch"], scope="module")
def batch(request):
    return request.param == "batch"


def call(function, batch, *arguments):
    if batch:
        return function(*arguments)
    return np.array([function(*sample) for sample in zip(*arguments, strict=True)])


def close(actual, expected, tolerance=DIGITS):
    expected = np.asarray(expected)
    assert actual.shape == expected.shape
    scale = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(actual, expected, rtol=0, atol=tolerance * scale)


def solved(model, q):
    """Tolerance of accelerations: the digits of the torques, times what the solution magnifies."""
    return DIGITS * np.linalg.cond(rm.mass_matrix(model, q)).max()


def test_poses_of_every_tip(oracle, batch):
    (q,) = oracle.states("q")
    for name in oracle.samples[0]["T"]:
        frame = int(name.removeprefix("0T"))
        poses = call(lambda x, j=frame: rm.dgm(oracle.model, x, j), batch, q)
        close(poses, [s["T"][name] for s in oracle.samples])


def test_jacobians_in_every_projection(oracle, batch):
    """The first factor brings the point, the second the axes of an intermediate frame."""
    model = oracle.model
    (q,) = oracle.states("q")
    cases = [(J["frame"], J["projection_frame"]) for J in oracle.samples[0]["J"]]
    assert {p for _, p in cases} >= {0, model.f}
    for i, (frame, projection) in enumerate(cases):
        expected = [s["J"][i] for s in oracle.samples]
        columns = np.array(expected[0]["columns"]) - 1
        others = np.setdiff1d(np.arange(model.n), columns)
        J = call(lambda x, j=frame: rm.jacobian(model, x, j), batch, q)
        assert not J[..., others].any()
        J = J[..., columns]
        R = rm.dgm(model, q, projection)[:, None, :3, :3].swapaxes(-1, -2)
        projected = (R @ J.reshape(len(q), 2, 3, -1)).reshape(J.shape)
        close(projected, [e["J"] for e in expected])
        if projection == frame:
            local = call(lambda x, j=frame: rm.jacobian(model, x, j, "local"), batch, q)
            close(local[..., columns], [e["J"] for e in expected])
        product = np.tile(np.eye(6), (len(q), 1, 1))
        product[:, :3, 3:] = [e["L"] for e in expected]
        intermediate = np.array([e["J_intermediate"] for e in expected])
        close(product @ intermediate, projected)


def test_velocities_and_accelerations_of_every_link(oracle, batch):
    model = oracle.model
    q, v, a = oracle.states("q", "qp", "qpp")
    for j in range(1, model.f + 1):
        expected = [s["link_velocity"][str(j)] for s in oracle.samples]
        twist = call(lambda x, dx, j=j: rm.dkm(model, x, dx, j, "local"), batch, q, v)
        close(twist, [e["v"] + e["w"] for e in expected])
        J = call(lambda x, j=j: rm.jacobian(model, x, j), batch, q)
        dJ = call(lambda x, dx, j=j: rm.jacobian_rate(model, x, dx, j), batch, q, v)
        acceleration = np.einsum("kij,kj->ki", J, a) + np.einsum("kij,kj->ki", dJ, v)
        R = rm.dgm(model, q, j)[:, :3, :3]
        local = np.einsum("kji,ksj->ksi", R, acceleration.reshape(-1, 2, 3)).reshape(-1, 6)
        close(local, [e["vdot"] + e["wdot"] for e in expected])


def test_torques(oracle, batch):
    model = oracle.model
    q, v, a = oracle.states("q", "qp", "qpp")
    close(call(lambda *x: rm.idm(model, *x), batch, q, v, a), [s["tau"] for s in oracle.samples])
    bias = call(lambda *x: rm.idm(model, *x), batch, q, v, 0 * a)
    close(bias, [s["h_ccg_friction"] for s in oracle.samples])
    gravity = call(lambda x: rm.gravity_torque(model, x), batch, q)
    close(gravity, [s["tau_gravity_numpy"] for s in oracle.samples])


def test_torques_with_an_external_wrench(oracle, batch):
    """SYMORO's is in the axes of the last link, ours in those of the world."""
    model = oracle.model
    given = oracle.data["external_wrench_last_link"]
    assert given["link"] == model.tip
    local = np.array([given[key] for key in ("FX", "FY", "FZ", "CX", "CY", "CZ")]).reshape(2, 3)
    q, v, a = oracle.states("q", "qp", "qpp")
    R = rm.dgm(model, q)[:, :3, :3]
    wrench = np.einsum("kij,sj->ksi", R, local).reshape(-1, 6)
    expected = [s["tau_with_external_wrench"] for s in oracle.samples]
    tau = call(lambda *x: rm.idm(model, *x), batch, q, v, a, wrench)
    close(tau, expected)
    found = call(lambda *x: rm.ddm(model, *x), batch, q, v, np.array(expected), wrench)
    close(found, a, solved(model, q))


def test_mass_matrix_and_direct_dynamics(oracle, batch):
    model = oracle.model
    q, v = oracle.states("q", "qp")
    M = call(lambda x: rm.mass_matrix(model, x), batch, q)
    close(M, [s["M"] for s in oracle.samples])
    tau = np.array([s["tau"] for s in oracle.samples])
    expected = [s["ddm_qpp_from_tau"] for s in oracle.samples]
    close(call(lambda *x: rm.ddm(model, *x), batch, q, v, tau), expected, solved(model, q))


def test_regressor_in_khalils_order(oracle):
    model = oracle.model
    q, v, a = oracle.states("q", "qp", "qpp")
    links = [oracle.data["links"][str(j + 1)] for j in range(model.f)]
    standard = [link[key] for link in links for key in INERTIA]
    for key in ("IA", "FV", "FS"):
        standard += [link[key] for link in links]
    W = rm.torque_regressor(model, q, v, a)
    close(W[..., : len(standard)] @ standard, [s["tau"] for s in oracle.samples])


@pytest.mark.parametrize("method", ["symbolic", "numeric"])
def test_base_parameters(oracle, method):
    path = Path(__file__).parent / "symoro_base_parameters.json"
    theirs = json.loads(path.read_text("utf-8"))[oracle.name]
    base = rm.base_parameters(oracle.model, method, drive=("Ia",))
    assert len(base) == theirs["dimension"]
    assert base.regrouping.keys() == {name.replace("IA", "Ia") for name in theirs["grouping"]}
    for kept, parts in theirs["grouping"].items():
        expected = {name.replace("IA", "Ia"): value for name, value in parts.items()}
        own = base.regrouping[kept.replace("IA", "Ia")]
        assert dict(own) == pytest.approx(expected, abs=1e-9)
    assert list(base.no_effect) == [name.replace("IA", "Ia") for name in theirs["no_effect"]]

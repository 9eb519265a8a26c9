"""The data sets that the package ships: complete, licensed, small, read-only, and what they say."""

import hashlib
import lzma
import pickle
from importlib.resources import files

import numpy as np
import pytest

import robotmodels as rm
from robotmodels import calibration
from robotmodels.datasets import load_tx40, panda_double_socket, ur10_camera
from robotmodels.errors import InvalidValueError

LIMIT = 1_500_000
POSITION_SUMS = [
    219493.748722345,
    1676192.3150742827,
    -2677940.9767097957,
    2395494.736123584,
    523756.04227606254,
    -1104534.8181496228,
]
TORQUE_SUMS = [
    1476.7921263303622,
    -27080.066948092983,
    83.06179579912973,
    185.26527387799896,
    163.48264339729593,
    -554.9814843220033,
]


def every_file(folder):
    for entry in folder.iterdir():
        if entry.is_dir():
            yield from every_file(entry)
        else:
            yield entry


@pytest.mark.parametrize(("robot", "places", "rows"), [("panda_1", 3, 182), ("panda_2", 9, 559)])
def test_sockets_have_all_their_readings(robot, places, rows):
    data = panda_double_socket(robot)
    assert len(data.places) == places
    assert data.blocks == rows
    low, high = data.model.lower, data.model.upper
    for sockets in data.places.values():
        assert len(sockets) == 2
        for q in sockets:
            assert q.shape[1] == 7
            assert not q.flags.writeable
            assert ((low - 0.01 < q) & (q < high + 0.01)).all()


@pytest.mark.parametrize("robot", ["panda_1", "panda_2"])
def test_the_ball_is_in_its_socket_within_a_centimetre(robot):
    # unlike columns, joints or sockets that were mixed up
    data = panda_double_socket(robot)
    for sockets in data.places.values():
        p = [rm.dgm(data.model, q)[:, :3, 3] for q in sockets]
        spread = np.concatenate([x - x.mean(axis=0) for x in p])
        assert 0.003 < np.linalg.norm(spread, axis=1).mean() < 0.012
        apart = np.linalg.norm(p[0].mean(axis=0) - p[1].mean(axis=0))
        assert apart == pytest.approx(data.distance, abs=0.004)


def test_the_ball_is_the_tool_of_the_panda():
    model = panda_double_socket().model
    q = np.linspace(-0.5, 0.5, 7)
    assert np.array_equal(rm.dgm(model, q), rm.dgm(model, q, frame="ball_link"))


@pytest.mark.parametrize("robot", ["panda_1", "panda_2"])
def test_masses_of_the_panda_are_those_of_the_catalogue(robot):
    model = panda_double_socket(robot).model
    catalogue = rm.load("panda").inertia
    assert np.array_equal(model.inertia.values[:6], catalogue.values[:6])
    assert model.inertia.is_physical.all()
    bare = model.with_inertia(catalogue)
    carrying = rm.with_payload(
        bare, 0.73, [-0.01, 0.0, 0.03], inertia=np.diag((0.001, 0.0025, 0.0017)),
        frame="panda_hand",
    )  # fmt: skip
    np.testing.assert_allclose(model.inertia.values, carrying.inertia.values, atol=1e-15)


def test_panda_hangs_as_the_one_of_example_robot_data():
    # whose frame 7 is turned by 45 degrees, and which has fingers
    model, heavy = panda_double_socket().model, rm.load("erd:panda")
    q = np.array([0.3, -0.7, 0.4, -2.0, 0.6, 1.2, 0.9])
    values = heavy.inertia.values.copy()
    values[7:] = 0.0
    full = rm.gravity_torque(heavy.with_inertia(rm.InertialParameters(values)), [*q, 0.0, 0.0])
    np.testing.assert_allclose(rm.gravity_torque(model, q), full[:7], rtol=1e-9, atol=1e-9)


def test_compliance_of_the_panda_can_be_asked():
    data = panda_double_socket()
    q = np.concatenate(data.places["front"])
    label = np.repeat([0, 1], [len(x) for x in data.places["front"]])
    measured = [
        calibration.PointContact(q, label, name="front"),
        calibration.KnownDistance("front:0", "front:1", data.distance),
    ]
    prior = calibration.ParameterPrior(length=3e-4, angle=6e-3, compliance=6e-5)
    some = {"prior": prior, "folds": 0, "held_out": 0.0}
    stiff = calibration.fit(data.model, measured, **some)
    soft = calibration.fit(data.model, measured, compliance="isotropic", **some)
    assert any(name.startswith("compliance") for name in soft.names)
    assert not any(name.startswith("compliance") for name in stiff.names)
    assert soft.validation.in_sample.rms["m"] < stiff.validation.in_sample.rms["m"]


def test_an_unknown_panda_is_named():
    with pytest.raises(InvalidValueError, match=r"panda_1.*got 'panda'"):
        panda_double_socket("panda")


def test_the_camera_moves_with_the_wrist():
    # distances between poses of a rigid body on the wrist do not depend on Z; those of the angle
    # depend on E no more
    data = ur10_camera()
    for q, T in (data.measured, data.simulated):
        assert not q.flags.writeable
        assert not T.flags.writeable
        R = rm.dgm(data.model, q)[:, :3, :3]
        turned = np.trace(R[:-1].swapaxes(1, 2) @ R[1:], axis1=1, axis2=2)
        seen = T[:, :3, :3]
        measured = np.trace(seen[:-1].swapaxes(1, 2) @ seen[1:], axis1=1, axis2=2)
        assert np.abs(turned - measured).max() < 0.04
    assert len(data.measured.q) == 23
    assert len(data.simulated.q) == 29


def test_robot_of_the_camera_stands_on_its_support():
    data = ur10_camera()
    assert data.model.base[2, 3] == pytest.approx(0.9 + 0.1807)
    assert data.model.inertia.values[:, 9].sum() > 25.0


@pytest.mark.parametrize("data", [panda_double_socket("panda_1"), ur10_camera()])
def test_data_pickle_and_stay_read_only(data):
    again = pickle.loads(pickle.dumps(data))
    assert again.urdf == data.urdf
    assert again.licence == data.licence
    if hasattr(data, "places"):
        first, *_ = again.places.values()
        assert not first[0].flags.writeable
        with pytest.raises(TypeError):
            again.places["elsewhere"] = first
    else:
        assert np.array_equal(again.measured.T, data.measured.T)
        assert not again.measured.T.flags.writeable


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("panda_double_socket", "Copyright (c) 2024 platonics"),
        ("ur10_camera", "Apache License"),
        ("tx40_log", "Copyright [2021-2025] Thanh Nguyen"),
    ],
)
def test_licence_and_provenance_are_beside_the_data(name, words):
    folder = files("robotmodels.datasets") / name
    assert words in (folder / "LICENSE").read_text(encoding="utf-8")
    assert "commit" in (folder / "PROVENANCE.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def tx40():
    return load_tx40()


@pytest.mark.parametrize(
    ("name", "sha256"),
    [
        ("pos_read_data.csv", "5cc1cecc1024ef0e331d0caba06f689456ab789ec3f1e904599c0a8be5c27bc8"),
        ("curr_data.csv", "f4592f4ba4db42f5d7625688986be25b575ca34d0504b27979ca6b0276bd3af9"),
        ("TX40_bp_5.csv", "00dc377866e792e7dad787eaa719def4cc428aa0735c00216526a60f8df0dec6"),
        ("TX40_ep_5.csv", "fe09197df7390990643a0f6e8742e787acd2c4071becd68b3e82d320a6cc9572"),
    ],
)
def test_files_of_the_tx40_are_those_of_their_source(tx40, name, sha256):
    folder = files("robotmodels.datasets") / "tx40_log"
    packed = folder / f"{name}.xz"
    data = lzma.decompress(packed.read_bytes()) if packed.is_file() else None
    data = (folder / name).read_bytes() if data is None else data
    assert hashlib.sha256(data).hexdigest() == sha256
    said = {source.name: source.sha256 for source in tx40.log.sources}
    assert said.get(name, sha256) == sha256


def test_numbers_of_the_tx40_are_those_of_its_text(tx40):
    folder = files("robotmodels.datasets") / "tx40_log"
    for name, values in (
        ("pos_read_data.csv.xz", tx40.motor_positions),
        ("curr_data.csv.xz", tx40.motor_torques),
    ):
        lines = lzma.decompress((folder / name).read_bytes()).decode().splitlines()
        assert len(lines) == 45001
        for row in (0, 1, 12345, 44999):
            assert [float(cell) for cell in lines[row + 1].split(",")] == values[row].tolist()
        assert not values.flags.writeable
    # frozen: sums of the columns of the source's files
    np.testing.assert_allclose(tx40.motor_positions.sum(axis=0), POSITION_SUMS, rtol=1e-13)
    np.testing.assert_allclose(tx40.motor_torques.sum(axis=0), TORQUE_SUMS, rtol=1e-13)


def test_the_tx40_moves_within_its_limits_and_does_the_work_of_its_motors(tx40):
    log, model = tx40.log, tx40.model
    assert log.dt == 2e-4
    assert log.names == model.table.joint_names
    assert ((model.lower < log.q) & (log.q < model.upper)).all()
    assert (np.abs(log.tau) < model.table.effort).mean() > 0.99
    work = (log.tau[:-1] * np.diff(log.q, axis=0)).sum()
    motors = (tx40.motor_torques[:-1] * np.diff(tx40.motor_positions, axis=0)).sum()
    assert work == pytest.approx(motors, rel=1e-12)
    np.testing.assert_allclose(log.tau[:, 4:], tx40.motor_torques[:, 4:] @ [[45, 0], [32, 32]])
    np.testing.assert_allclose(log.q[:, 3], tx40.motor_positions[:, 3] / -48)


def test_published_parameters_of_the_tx40_are_grouped_as_those_of_the_model(tx40):
    base = rm.base_parameters(tx40.model, drive=True)
    ours = {name.removesuffix("R") for name in base.names}
    assert ours - {p.name for p in tx40.published} == {"Ia6"}
    assert {p.name for p in tx40.published} < ours
    assert {p.name for p in tx40.essential} < {p.name for p in tx40.published}
    assert len(tx40.published) == 60
    by_name = {p.name: p for p in tx40.published}
    assert by_name["Fcm6"].expression == "fsm6"
    assert by_name["offset3"].wls_deviation == pytest.approx(0.3476 * 0.5902)
    assert by_name["Fv1"].ols == 8.107054
    assert by_name["Fv1"].ols_deviation == pytest.approx(0.041346, rel=1e-4)


def test_the_tx40_gives_its_published_parameters_again(tx40):
    # which it does not with a zero, a sign, a ratio or a coupling that is wrong
    from scipy.signal import butter, filtfilt

    log = tx40.log
    q = filtfilt(*butter(4, 50 * 2 * log.dt), log.q, axis=0)
    v = np.gradient(q, log.dt, axis=0)
    a = np.gradient(v, log.dt, axis=0)
    base = rm.base_parameters(tx40.model, drive=True)
    W = rm.torque_regressor(tx40.model, q[::5], v[::5], a[::5], columns=base)
    slow = butter(4, 40 * 2 * 5 * log.dt)
    rows = slice(100, -100, 10)
    W = filtfilt(*slow, W, axis=0)[rows]
    tau = filtfilt(*slow, filtfilt(*butter(4, 200 * 2 * log.dt), log.tau, axis=0)[::5], axis=0)
    moving = np.abs(v[::5][rows]) > 0.1
    moving[:, 4:] &= np.abs(v[::5][rows][:, 4:].sum(axis=1, keepdims=True)) > 0.12
    A, y = W[moving], tau[rows][moving]
    x = np.linalg.lstsq(A, y, rcond=None)[0]
    rest = y - A @ x
    assert np.linalg.norm(rest) < 0.06 * np.linalg.norm(y)
    joint = np.nonzero(moving)[1]
    weights = np.array([1.0 / rest[joint == j].std() for j in range(6)])[joint]
    x = np.linalg.lstsq(A * weights[:, None], y * weights, rcond=None)[0]
    found = dict(zip((name.removesuffix("R") for name in base.names), x.tolist(), strict=True))
    seen = [p for p in tx40.published if p.wls_percent < 3.0]
    assert len(seen) == 16
    for p in seen:
        assert found[p.name] == pytest.approx(p.wls, abs=3.0 * p.wls_deviation), p.name


def test_the_tx40_pickles(tx40):
    again = pickle.loads(pickle.dumps(tx40))
    assert np.array_equal(again.log.tau, tx40.log.tau)
    assert not again.motor_torques.flags.writeable
    assert again.published == tx40.published
    assert again.training == slice(0, 24750)
    assert again.held_out == slice(29250, 45000)


def test_no_file_is_large():
    sizes = [len(entry.read_bytes()) for entry in every_file(files("robotmodels.datasets"))]
    assert max(sizes) < LIMIT
    assert sum(sizes) < LIMIT

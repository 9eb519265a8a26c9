"""The data sets that the package ships: complete, licensed, small, read-only, and what they say."""

import hashlib
import lzma
from importlib.resources import files

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.datasets import load_tx40, panda_double_socket, ur10_camera


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

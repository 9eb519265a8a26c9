"""The data sets that the package ships: complete, licensed, small, read-only, and what they say."""

import pickle
from importlib.resources import files

import numpy as np
import pytest

import robotmodels as rm
from robotmodels import calibration
from robotmodels.datasets import panda_double_socket, ur10_camera
from robotmodels.errors import InvalidValueError

LIMIT = 1_500_000


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
    assert soft.after.summary("m").rms < stiff.after.summary("m").rms


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
    ],
)
def test_licence_and_provenance_are_beside_the_data(name, words):
    folder = files("robotmodels.datasets") / name
    assert words in (folder / "LICENSE").read_text(encoding="utf-8")
    assert "commit" in (folder / "PROVENANCE.md").read_text(encoding="utf-8")


def test_no_file_is_large():
    sizes = [len(entry.read_bytes()) for entry in every_file(files("robotmodels.datasets"))]
    assert max(sizes) < LIMIT
    assert sum(sizes) < LIMIT

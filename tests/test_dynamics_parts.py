"""Christoffel blocks, payloads, coupled rotors, base parameters: by hand, and at the border."""

import numpy as np
import pytest
from identities.random_robots import random_model, random_state

import robotmodels as rm
from robotmodels.dynamics import (
    base_model,
    idm_from_base,
    with_payload,
    without_payload,
)
from robotmodels.errors import InvalidValueError
from robotmodels.friction import AsymmetricFriction
from robotmodels.inertia import InertiaWarning
from robotmodels.minimal_parameters import base_parameters, uniform_bodies


def planar(l1=0.5, m=(1.0, 2.0), c=(0.2, 0.1)):
    links = rm.InertialParameters.from_com(m, [[x, 0, 0] for x in c], np.zeros((2, 3, 3)))
    table = rm.DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, l1])
    return rm.RobotModel.from_table(table, links, gravity=(0, -9.81, 0))


def test_rotors_of_a_tx40_wrist_turn_with_two_joints():
    """Rotor energies in motor speeds: Ia and Iam make up R^T Jm R, and torques follow."""
    R = np.diag([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
    R[5, 4] = 32.0
    Jm = 1e-4 * np.arange(1.0, 7.0)
    whole = R.T @ np.diag(Jm) @ R
    wrist = rm.Transmission(np.linalg.inv(R), Iam=Jm[5] * 32.0**2 * np.eye(6)[5])
    model = rm.load("tx40")
    model = model.with_inertia(uniform_bodies(model, 30.0))
    robot = model.with_drive(rm.DriveParameters(Ia=np.diag(whole))).with_transmission(wrist)
    q, v, a = random_state(model, np.random.default_rng(0), 4)
    rigid = model.with_drive(None).with_transmission(None)
    M = rm.mass_matrix(rigid, q)
    np.testing.assert_allclose(rm.mass_matrix(robot, q) - M, np.tile(whole, (4, 1, 1)), atol=1e-13)
    energy = rm.kinetic_energy(robot, q, v) - rm.kinetic_energy(rigid, q, v)
    np.testing.assert_allclose(energy, 0.5 * (Jm * (v @ R.T) ** 2).sum(axis=1), rtol=1e-12)
    tau = rm.idm(robot, q, v, a)
    np.testing.assert_allclose(tau - rm.idm(rigid, q, v, a), (Jm * (a @ R.T)) @ R, atol=1e-11)
    base = base_parameters(robot)
    assert "Iam6" in base.names
    found = idm_from_base(robot, base, base.values(robot), q, v, a)
    np.testing.assert_allclose(found, tau, atol=1e-11)


# --- payloads ----------------------------------------------------------------------------------


def test_what_is_taken_off_leaves_nothing_behind():
    bare = planar().with_inertia(None)
    payload = 0.7, [0.1, 0.3, -0.2], np.diag([0.3, 0.2, 0.11])
    loaded = with_payload(bare, *payload)
    np.testing.assert_array_equal(without_payload(loaded, *payload).inertia.values, 0.0)
    assert with_payload(bare, 0.0, [1.0, 0.0, 0.0]).inertia == bare.inertia
    # point masses are on the border of what bodies have: rounding gives no warning
    for mass in (1e-9, 1e6):
        for com in np.random.default_rng(0).normal(size=(10, 3)):
            left = without_payload(with_payload(planar(), mass, com), mass, com).inertia.values
            atol = 1e-14 * max(1.0, mass)
            np.testing.assert_allclose(left, planar().inertia.values, atol=atol)


@pytest.mark.parametrize(
    ("payload", "words"),
    [
        ((5.0, [0, 0, 0]), "link 2 .*'robot'.*negative mass -3 kg"),
        ((2.0, [0.3, 0, 0]), "first moments without mass"),
        ((1.0, [0.1, 0.0, 0], 0.2 * np.eye(3), 1), "link 1 "),
    ],
)
def test_a_body_that_was_not_there_is_reported(payload, words):
    """The link is warned of by name; the numbers are those of the subtraction."""
    with pytest.warns(InertiaWarning, match=words) as caught:
        left = without_payload(planar(), *payload)
    assert caught[0].filename == __file__
    assert not left.inertia.is_physical.all()
    # a link that was no body before is not the payload's fault
    identified = planar().with_inertia(rm.InertialParameters(-np.ones((2, 10))))
    without_payload(identified, *payload)


# --- base parameters ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["stanford_arm", "gantry"])
@pytest.mark.parametrize("drive", [True, ("Ia",)])
def test_base_parameters_give_the_torques_of_the_catalogue(name, drive):
    model = rm.load(name)
    rng = np.random.default_rng(0)
    model = model.with_inertia(uniform_bodies(model, 60.0)).with_drive(
        rm.DriveParameters(*rng.uniform(0.1, 3.0, (4, model.n)))
    )
    q, v, a = random_state(model, rng, 50)
    base = base_parameters(model, drive=drive)
    values = base.values(model)
    tau, M = rm.idm(model, q, v, a), rm.mass_matrix(model, q)
    atol = 1e-12 * np.abs(tau).max()
    found = idm_from_base(model, base, values, q, v, a)
    np.testing.assert_allclose(found, tau, rtol=0, atol=atol)
    robot = base_model(model, base, values)
    np.testing.assert_allclose(rm.ddm(robot, q, v, tau), a, atol=1e-9)
    np.testing.assert_allclose(rm.mass_matrix(robot, q), M, rtol=0, atol=1e-12 * np.abs(M).max())
    assert np.count_nonzero(robot.inertia.values) < np.count_nonzero(model.inertia.values)
    single = idm_from_base(model, base, values, q[0], v[0], a[0])
    np.testing.assert_allclose(single, tau[0], rtol=0, atol=atol)
    assert idm_from_base(model, base, values, q[:0], v[:0], a[:0]).shape == (0, model.n)


@pytest.mark.parametrize("drive", [True, False])
def test_base_parameters_with_a_friction_model(drive):
    model = random_model(np.random.default_rng(8), f=4, drive=True)
    n = model.n
    rng = np.random.default_rng(1)
    friction = AsymmetricFriction(*rng.uniform(0.5, 2.0, (4, n)))
    if drive:
        model = model.with_drive(rm.DriveParameters(Ia=model.drive.Ia))
    q, v, a = random_state(model, rng, 20)
    base = base_parameters(model, "numeric", drive=drive, friction=friction)
    values = base.values(model)
    tau = rm.idm(model, q, v, a, friction=friction)
    found = idm_from_base(model, base, values, q, v, a)
    np.testing.assert_allclose(found, tau, rtol=0, atol=1e-10 * np.abs(tau).max())
    with pytest.raises(InvalidValueError, match="AsymmetricFriction"):
        base_model(model, base, values)

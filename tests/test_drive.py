"""Drives and transmissions: the TX40 wrist, power through the gears, mimics, mistakes."""

import pickle
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from identities.random_robots import random_drive, random_parameters, random_transmission, seeds

import robotmodels as rm
from robotmodels.drive import drive_matrices
from robotmodels.errors import InertiaError, InvalidValueError, ShapeError
from robotmodels.friction import AsymmetricFriction, GravityCompensator

# joints from motors of the Staubli TX40: q = R^-1 q_motor, R diagonal but for R[6, 5] = 32
RATIOS = np.diag([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
RATIOS[5, 4] = 32.0


def tx40(**terms):
    return rm.Transmission(np.linalg.inv(RATIOS), **terms)


def test_tx40_wrist_couples_motor_6_only():
    wrist = tx40()
    assert wrist.coupled_motors == (6,)
    assert "coupled motors: 6." in str(wrist)
    wanted = np.eye(6)
    wanted[5, 4] = 1.0  # the shaft of motor 6 turns with joints 5 and 6 together
    assert np.allclose(wrist.weights, wanted, atol=1e-15)
    assert wrist.to_encoder([0, 0, 0, 0, 1.0, 0]) == pytest.approx([0, 0, 0, 0, 45, 32])
    turn, q = np.arange(6.0), np.linspace(-1.0, 1.0, 6)
    motors = rm.Transmission.from_motor(RATIOS, turn)
    np.testing.assert_allclose(motors.to_encoder(q), RATIOS @ q + turn, rtol=1e-13)


@given(seeds)
def test_power_is_the_same_on_both_sides_of_the_gears(seed):
    """tau . v = tau_c . v_c: torques go through the transpose of what velocities go through."""
    rng = np.random.default_rng(seed)
    gears = random_transmission(rng, 6)
    q_c, v_c, tau = rng.normal(size=(3, 4, 6))
    v = gears.to_joint(v_c) - gears.offset
    assert np.allclose(
        np.sum(tau * v, axis=-1), np.sum(gears.to_motor_torque(tau) * v_c, axis=-1), atol=1e-12
    )
    assert np.allclose(gears.to_encoder(gears.to_joint(q_c)), q_c, atol=1e-10)
    assert np.allclose(gears.to_joint(q_c[0]), gears.matrix @ q_c[0] + gears.offset, atol=1e-14)


@given(seeds)
def test_drive_matrices_state_the_formula_of_the_docstring(seed):
    rng = np.random.default_rng(seed)
    n = 5
    drive, gears = random_drive(rng, n), random_transmission(rng, n)
    v, a = rng.normal(size=(2, 3, n))
    wanted = drive.Ia * a + drive.Fv * v + drive.Fc * np.sign(v) + drive.offset
    W = np.linalg.inv(gears.matrix)
    for m in range(n):
        w = np.where(np.abs(W[m]) > 1e-9, W[m], 0.0) / W[m, m]
        if np.count_nonzero(w) < 2:
            continue
        for j in range(n):
            for k in set(range(n)) - {j}:
                wanted[:, j] += w[j] * w[k] * (gears.Iam[m] * a[:, k] + gears.Fvm[m] * v[:, k])
            wanted[:, j] += w[j] * gears.Fcm[m] * np.sign(v @ w)
    matrices = drive_matrices(drive, gears)
    assert np.allclose(matrices.torque(v, a), wanted, atol=1e-12)
    assert np.allclose(matrices.torque(v, None), matrices.torque(v, 0 * a), atol=1e-12)
    assert np.allclose(matrices.rotor, matrices.rotor.T)
    assert np.allclose(matrices.viscous, matrices.viscous.T)


def test_mimic_joints_are_singular_and_ranks_do_not_depend_on_units():
    """Joint 2 follows joint 1: q has no unique encoder variables, but torques still go over."""
    gripper = rm.Transmission([[1, 0], [-1, 0]], offset=[0, 0.1])
    assert gripper.coupled_motors == ()
    assert "joints mimic others" in str(gripper)
    assert gripper.to_joint([0.3, 7.0]) == pytest.approx([0.3, -0.2])
    assert gripper.to_motor_torque([2.0, 0.5]) == pytest.approx([1.5, 0.0])
    with pytest.raises(InvalidValueError, match="a joint mimics another one"):
        gripper.to_encoder([0.3, -0.2])
    for size in (1e-20, 1e20):
        gears = rm.Transmission([[size, 0.0], [-size, 1.0]])
        assert (gears.is_invertible, gears.is_mimicry, gears.coupled_motors) == (True, False, (2,))
    fingers = rm.Transmission([[1e-20, 0, 0], [1e-20, 0, 0], [0, 0, 1.0]])
    assert (fingers.rank, fingers.is_mimicry) == (2, True)
    np.testing.assert_array_equal(fingers.free, [[1e-20, 0], [1e-20, 0], [0, 1]])
    for matrix in (np.ones((3, 3)), np.zeros((3, 3))):
        assert not rm.Transmission(matrix).is_mimicry


PARTS = {
    "drive": lambda rng: random_drive(rng, 4),
    "transmission": lambda rng: random_transmission(rng, 4),
    "inertia": lambda rng: random_parameters(rng, 4),
    "friction": lambda rng: AsymmetricFriction(*rng.uniform(size=(4, 3))),
    "compensator": lambda rng: GravityCompensator(3, [2, 3], values=rng.normal(size=(4, 2))),
}


@pytest.mark.parametrize("make", PARTS.values(), ids=PARTS)
def test_parts_of_a_robot_are_values(make):
    part = make(np.random.default_rng(1))
    assert part != make(np.random.default_rng(2))
    for copied in (make(np.random.default_rng(1)), pickle.loads(pickle.dumps(part))):
        assert copied == part
        assert hash(copied) == hash(part)
        values = [getattr(copied, f.name) for f in fields(copied)]
        assert not any(x.flags.writeable for x in values if isinstance(x, np.ndarray))
    with pytest.raises(AttributeError):
        setattr(part, fields(part)[0].name, np.zeros(4))


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: rm.DriveParameters(), InertiaError, "at least one of Ia, Fv, Fc, offset"),
        (lambda: rm.DriveParameters([1.0], [1.0, 2.0]), ShapeError, r"Ia \(1,\), Fv \(2,\)"),
        (lambda: rm.DriveParameters(Fc=[np.nan]), InvalidValueError, "Fc: .* got nan"),
        (lambda: rm.Transmission(np.ones((2, 3))), ShapeError, r"square \(n, n\) .* \(2, 3\)"),
        (lambda: rm.Transmission(np.eye(2), Iam=[0.1, 0]), InertiaError, "Motor 1 turns one joint"),
        (lambda: rm.Transmission(np.ones((2, 2)), Fvm=[1, 0]), InertiaError, "rank 1 of 2"),
        (lambda: tx40(Fcm=np.eye(6)[0]), InertiaError, r"the motors \[6\]"),
        (lambda: rm.Transmission.from_motor(np.ones((2, 2))), InvalidValueError, "R has rank 1 of"),
    ],
)
def test_mistakes_in_drives_and_transmissions(make, error, words):
    with pytest.raises(error, match=words):
        make()

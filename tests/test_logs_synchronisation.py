"""Delay between positions and torques, on simulated and real logs."""

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.identification import synchronisation
from robotmodels.identification.checks import check_joints
from robotmodels.identification.delay import SynchronisationStatus
from robotmodels.logs import FindingKind, Log, with_delay


@pytest.fixture(scope="module")
def robot():
    drive = rm.DriveParameters(Ia=np.full(6, 0.3), Fv=np.full(6, 2.0), Fc=np.full(6, 1.5))
    return rm.load("rx90").with_drive(drive)


def simulated(model, rate=1000.0, late=0.0, seed=3):
    """Noisy log of a robot on sums of sines, its torques late."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 6.0, 1.0 / rate)[:, None]
    f = rng.uniform(0.15, 0.9, (4, model.n))
    A, phase = rng.uniform(0.1, 0.4, (4, model.n)), rng.uniform(0.0, 6.0, (4, model.n))

    def motion(t):
        w = 2.0 * np.pi * f
        angle = w * t[:, None] + phase
        q = (A * np.sin(angle)).sum(axis=1)
        return q, (A * w * np.cos(angle)).sum(axis=1), -(A * w**2 * np.sin(angle)).sum(axis=1)

    q, tau = motion(t)[0], rm.idm(model, *motion(t - late))
    noise = rng.normal(size=(2, *q.shape))
    return Log(1.0 / rate, q + 1e-4 * noise[0], tau + 0.05 * noise[1])


@pytest.mark.parametrize(("rate", "late"), [(1000.0, -0.004), (5000.0, 0.0013)])
def test_delays_of_simulated_logs_are_found_within_a_part_of_a_sample(robot, rate, late):
    found = synchronisation(simulated(robot, rate, late), robot)
    assert found.status is SynchronisationStatus.FOUND
    assert found.delay == pytest.approx(late, abs=0.2e-3)
    assert found.delay == pytest.approx(late, abs=5.0 * found.standard_error)
    assert found.is_out_of_step
    known = np.isfinite(found.joint_delays)
    assert known.sum() >= 3
    assert np.median(found.joint_delays[known]) == pytest.approx(late, abs=1e-3)


def test_a_delay_that_is_removed_is_not_found_again(robot):
    log = simulated(robot, late=0.0036)
    again = synchronisation(with_delay(log, synchronisation(log, robot).delay), robot)
    assert again.status.is_success
    assert not again.is_out_of_step
    assert abs(again.delay) < 0.05e-3


def test_delays_beyond_those_that_are_tried_are_reported(robot):
    log = simulated(robot, late=0.06)
    found = synchronisation(log, robot)
    assert found.status is SynchronisationStatus.AT_THE_END
    assert not found.is_out_of_step
    assert synchronisation(log, robot, within=0.1).delay == pytest.approx(0.06, abs=0.5e-3)
    (finding,) = check_joints(log, robot)
    assert finding.kind is FindingKind.OUT_OF_STEP


def test_a_single_sine_determines_no_delay():
    one = rm.RobotModel.from_table(rm.DHTable(antecedent=[0], sigma=[0]))
    t = np.arange(0.0, 10.0, 0.001)[:, None]
    found = synchronisation(Log(0.001, np.sin(t), np.cos(t - 0.3)), one)
    assert not found.is_out_of_step
    assert not found.status.is_success


def test_motion_that_excites_little_is_named(robot):
    log = simulated(robot)
    q = np.where(np.arange(6) == 0, log.q, 0.3)
    found = {f.kind: f for f in check_joints(Log(log.dt, q, log.tau), robot)}
    assert "base parameters" in found[FindingKind.NOT_EXCITING].sentence

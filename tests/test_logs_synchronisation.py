"""Delay between positions and torques, swapped joints and signs, on simulated and real logs."""

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.datasets import load_tx40
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.identification import synchronisation
from robotmodels.identification.checks import check_joints
from robotmodels.identification.delay import SynchronisationStatus
from robotmodels.logs import FindingKind, Log, Severity, with_delay


@pytest.fixture(scope="module")
def tx40():
    return load_tx40()


def simulated(model, rate, late=0.0, noise=True, seconds=6.0, seed=3):
    """Noisy log of a robot on sums of sines, its torques late."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)[:, None]
    n = model.n
    f = rng.uniform(0.15, 0.9, (4, n))
    A, phase = rng.uniform(0.1, 0.4, (4, n)), rng.uniform(0.0, 6.0, (4, n))

    def motion(t):
        w = 2.0 * np.pi * f
        angle = w * t[:, None] + phase
        q = (A * np.sin(angle)).sum(axis=1)
        return q, (A * w * np.cos(angle)).sum(axis=1), -(A * w**2 * np.sin(angle)).sum(axis=1)

    q = motion(t)[0]
    tau = rm.idm(model, *motion(t - late))
    if noise:
        q = q + rng.normal(0.0, 1e-4, q.shape)
        tau = tau + rng.normal(0.0, 0.05, tau.shape)
    return Log(1.0 / rate, q, tau)


@pytest.fixture(scope="module")
def robot():
    bare = rm.load("rx90")
    n = bare.n
    return bare.with_drive(
        rm.DriveParameters(Ia=np.full(n, 0.3), Fv=np.full(n, 2.0), Fc=np.full(n, 1.5))
    )


@pytest.mark.parametrize(("rate", "late"), [(1000.0, 0.004), (1000.0, -0.004), (5000.0, 0.0013)])
def test_delays_of_simulated_logs_are_found_within_a_part_of_a_sample(robot, rate, late):
    found = synchronisation(simulated(robot, rate, late), robot)
    assert found.status is SynchronisationStatus.FOUND
    assert found.delay == pytest.approx(late, abs=0.2e-3)
    assert found.delay == pytest.approx(late, abs=5.0 * found.standard_error)
    assert found.is_out_of_step
    assert f"{1e3 * found.delay:.3f} ms" in str(found)
    seen = np.isfinite(found.joint_delays)
    assert seen.sum() >= 3
    assert np.median(found.joint_delays[seen]) == pytest.approx(late, abs=1e-3)


def test_a_delay_that_is_removed_is_not_found_again(robot):
    log = simulated(robot, 1000.0, 0.0036)
    again = synchronisation(with_delay(log, synchronisation(log, robot).delay), robot)
    assert again.status.is_success
    assert not again.is_out_of_step
    assert abs(again.delay) < 0.05e-3
    assert abs(again.delays[int(np.argmin(again.residuals))]) < 2.5e-3


@pytest.mark.parametrize("samples", [20, -13.4])
def test_delays_of_the_tx40_are_found(tx40, samples):
    before = synchronisation(tx40.log, tx40.model)
    assert not before.is_out_of_step
    found = synchronisation(with_delay(tx40.log, -samples * tx40.log.dt), tx40.model)
    assert found.delay - before.delay == pytest.approx(samples * tx40.log.dt, abs=0.5e-3)
    assert found.is_out_of_step


def test_recordings_are_not_filtered_over(robot):
    a, b = (simulated(robot, 1000.0, 0.004, seed=k) for k in (3, 4))
    both = Log(a.dt, np.concatenate([a.q, b.q]), np.concatenate([a.tau, b.tau]), starts=(0, len(a)))
    assert synchronisation(both, robot).delay == pytest.approx(0.004, abs=0.15e-3)


def test_delays_beyond_those_that_are_tried_are_reported(robot):
    log = simulated(robot, 1000.0, 0.06)
    found = synchronisation(log, robot)
    assert found.status is SynchronisationStatus.AT_THE_END
    assert not found.is_out_of_step
    assert "within=" in str(found)
    assert synchronisation(log, robot, within=0.1).delay == pytest.approx(0.06, abs=0.5e-3)
    (finding,) = check_joints(log, robot)
    assert finding.kind is FindingKind.OUT_OF_STEP
    assert "ms late, the largest delay tried" in finding.sentence
    assert "within=" in finding.sentence


def test_a_single_sine_determines_no_delay():
    one = rm.RobotModel.from_table(rm.DHTable(antecedent=[0], sigma=[0]))
    t = np.arange(0.0, 10.0, 0.001)[:, None]
    found = synchronisation(Log(0.001, np.sin(t), np.cos(t - 0.3)), one)
    assert not found.is_out_of_step
    assert not found.status.is_success


def test_logs_without_a_delay_to_find_are_refused(robot, tx40):
    log = simulated(robot, 1000.0)
    for check in (check_joints, synchronisation):
        with pytest.raises(ShapeError, match="6 joints, the model panda has 7"):
            check(log, rm.load("panda"))
        with pytest.raises(InvalidValueError, match=r"give its \.log"):
            check(tx40, tx40.model)
    with pytest.raises(InvalidValueError, match="no recording is longer"):
        synchronisation(log.rows(0, 100), robot)
    with pytest.raises(InvalidValueError, match="cutoff"):
        synchronisation(log, robot, cutoff=600.0)
    with pytest.raises(InvalidValueError, match="within"):
        synchronisation(log, robot, within=1e-5)
    with pytest.raises(InvalidValueError, match="enough samples in motion"):
        synchronisation(tx40.log.rows(0, 3000), tx40.model)


# --- joints --------------------------------------------------------------------------------------


def changed(tx40, order, sign, which):
    """Every fifth sample of the TX40's log, columns of positions or torques changed."""
    log = tx40.log
    q, tau = (x[::5, order] * sign if name == which else x[::5]
              for name, x in (("q", log.q), ("tau", log.tau)))  # fmt: skip
    return Log(5 * log.dt, q, tau, names=log.names)


@pytest.mark.parametrize(
    ("pair", "which"), [((0, 1), "q"), ((1, 2), "tau"), ((3, 4), "q"), ((3, 5), "tau")]
)
def test_swapped_joints_are_named(tx40, pair, which):
    order = np.arange(6)
    order[list(pair)] = pair[::-1]
    log = changed(tx40, order, np.ones(6), which)
    found = {finding.kind: finding for finding in check_joints(log, tx40.model)}
    finding = found[FindingKind.SWAPPED_JOINTS]
    assert finding.joints == tuple(f"joint_{j + 1}" for j in pair)
    assert finding.severity is Severity.USELESS


@pytest.mark.parametrize(("joint", "which"), [(j, ("q", "tau")[j % 2]) for j in range(6)])
def test_wrong_signs_are_named(tx40, joint, which):
    log = changed(tx40, np.arange(6), 1.0 - 2.0 * np.eye(6)[joint], which)
    found = [f for f in check_joints(log, tx40.model) if f.kind is FindingKind.WRONG_SIGN]
    assert [finding.joints for finding in found] == [(f"joint_{joint + 1}",)]
    assert "signs=" in found[0].sentence


def test_the_log_of_the_tx40_is_correct_and_shifted_torques_are_named(tx40):
    assert check_joints(tx40.log, tx40.model) == ()
    found = check_joints(with_delay(tx40.log, -0.004), tx40.model)
    assert [finding.kind for finding in found] == [FindingKind.OUT_OF_STEP]
    assert "with_delay(log, 0.004" in found[0].sentence


def test_motion_that_excites_little_is_named(robot):
    log = simulated(robot, 1000.0, noise=False)
    assert check_joints(log, robot) == ()
    q = np.where(np.arange(6) == 0, log.q, 0.3)
    found = {f.kind: f for f in check_joints(Log(log.dt, q, log.tau), robot)}
    assert "base parameters" in found[FindingKind.NOT_EXCITING].sentence

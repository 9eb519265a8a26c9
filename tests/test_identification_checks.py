"""A correct log is never refused, and mistakes in a log are named: on random arms and motions."""

import re
from itertools import combinations

import numpy as np
import pytest
from identification_fleet import case, pair, recorded, swinging

import robotmodels as rm
from robotmodels.errors import InvalidValueError
from robotmodels.identification import Log, fit, synchronisation
from robotmodels.identification.checks import check_joints
from robotmodels.identification.delay import SynchronisationStatus
from robotmodels.identification.signals import zero_phase
from robotmodels.logs import FindingKind, Severity, check_log, with_delay
from robotmodels.logs.channels import stretches


def mistakes(n):
    """Joints that are flipped or swapped, with the matrices of positions and torques."""
    unit = np.eye(n)
    for joints in [(j,) for j in range(n)] + list(combinations(range(n), 2)):
        change = unit.copy()
        if len(joints) == 1:
            change[joints[0], joints[0]] = -1.0
        else:
            change[list(joints)] = change[list(joints[::-1])]
        yield from ((joints, change, unit), (joints, unit, change), (joints, change, change))


def useless(found):
    return [finding for finding in found if finding.severity is Severity.USELESS]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.nightly
def test_correct_logs_are_not_refused_and_wrong_ones_are_named(seed):
    """Half of them with friction and springs that the model lacks, others with coarse encoders."""
    if seed % 2:
        one = case(seed // 2)
        model, log, bad = one.model, one.log, one.kind == "badly exciting"
    else:
        model, (log, _) = pair(seed)
        bad = False
    found = (*check_log(log, model), *check_joints(log, model))
    assert not useless(found)
    assert not any(f.kind is FindingKind.SPIKES for f in found)
    every = list(mistakes(model.n))
    for k in np.random.default_rng(seed).choice(len(every), 0 if bad else 2, replace=False):
        joints, position, torque = every[k]
        wrong = check_joints(Log(log.dt, log.q @ position.T, log.tau @ torque.T), model)
        kinds = FindingKind.WRONG_SIGN, FindingKind.SWAPPED_JOINTS
        names = [finding.joints for finding in wrong if finding.kind in kinds]
        assert tuple(str(j + 1) for j in joints) in names


# --- one robot, every mistake ------------------------------------------------------------------


@pytest.fixture(scope="module")
def good():
    """An arm of five joints and a correct log of it, 250 Hz."""
    model, (log, _) = pair(36)
    return model, log.rows(0, 5000)


def flipped(joint):
    return 1.0 - 2.0 * np.eye(5)[joint]


ORDER = [0, 2, 1, 3, 4]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda q, tau: (q[:, ORDER], tau[:, ORDER]),
         ["Joints 2 and 3 look swapped in positions and torques"]),
        (lambda q, tau: (q[:, ORDER], tau), ["Joints 2 and 3 look swapped in positions:"]),
        (lambda q, tau: (q, tau[:, ORDER]), ["Joints 2 and 3 look swapped in torques:"]),
        (lambda q, tau: (q * flipped(2), tau * flipped(2)),
         ["oint 3 looks flipped (wrong sign of position and torque)"]),
        (lambda q, tau: (q * flipped(1), tau), ["The position of joint 2 has the wrong sign"]),
        (lambda q, tau: (q, tau * flipped(3)), ["The torque of joint 4 has the wrong sign"]),
        (lambda q, tau: (q, -tau), ["The torques of all joints have the wrong sign"]),
        (lambda q, tau: (np.degrees(q), tau), ["Positions look like degrees", "angles='deg'"]),
        (lambda q, tau: (q, (tau * flipped(3))[:, ORDER]),
         ["torque of joint 4", "oints 2 and 3 look swapped in torques"]),
    ],
)  # fmt: skip
def test_flips_swaps_and_degrees_are_refused_by_name(good, change, words):
    model, log = good
    with pytest.raises(InvalidValueError) as error:
        fit(model, Log(log.dt, *change(log.q, log.tau)))
    assert all(some in str(error.value) for some in words)


@pytest.mark.filterwarnings("ignore:q. joint")
def test_a_joint_that_turns_on_and_on_is_no_motor(good):
    model, log = good
    q = np.array(log.q)
    q[:, 0] = 40.0 * np.sin(0.1 * log.t)  # six turns either way
    smooth = zero_phase(q, 5.0, log.dt)
    v = np.gradient(smooth, log.dt, axis=0)
    turning = Log(log.dt, smooth, rm.idm(model, smooth, v, np.gradient(v, log.dt, axis=0)))
    assert not useless((*check_log(turning, model), *check_joints(turning, model)))
    far = Log(log.dt, 100.0 * smooth, turning.tau)  # motor angles beyond any joint
    assert "motor angles" in useless(check_log(far, model))[0].sentence


@pytest.mark.parametrize(
    ("factor", "joints", "words"),
    [
        (1000.0, "12345", "much larger than .*may be in mN m.*drive_gains=0.001"),
        (0.01, "12345", "much smaller than .*motor torques or in kN m.*gears="),
        (1.0 / np.array([50.0, 80.0, 100.0, 120.0, 160.0]), "12345", "1/[4-6].*motor torques"),
        (1.0 / np.array([1.0, 100.0, 1.0, 1.0, 1.0]), "2", "motor torques at these joints only"),
    ],
)
@pytest.mark.filterwarnings("ignore:Poor prediction")  # on purpose
@pytest.mark.nightly
def test_torques_beside_the_models_own_inertia(good, factor, joints, words):
    model, log = good
    wrong = Log(log.dt, log.q, factor * log.tau)
    (finding,) = [f for f in check_joints(wrong, model) if f.kind.name == "TORQUE_OFF_INERTIA"]
    assert set(finding.joints) <= set(joints)
    assert len(finding.joints) >= (len(joints) + 1) // 2
    assert finding.severity is Severity.DOUBTFUL
    assert re.search(words, finding.sentence)
    assert any(finding.sentence in note for note in fit(model, wrong).notes)
    bare = rm.RobotModel.from_table(model.table)  # without masses nothing is compared
    assert not any(f.kind.name == "TORQUE_OFF_INERTIA" for f in check_joints(wrong, bare))
    # catalogues may be off by a factor of three
    rough = model.with_inertia(rm.InertialParameters(3.0 * model.inertia.values))
    assert check_joints(log, rough) == ()


@pytest.mark.filterwarnings("ignore:Poor prediction")  # on purpose
def test_spikes_and_channels_that_stop_are_left_out(good):
    model, log = good
    clean = fit(model, log)
    q, tau = np.array(log.q), np.array(log.tau)
    q[[700, 2100, 3900], 1] += [0.3, -0.2, 0.1]
    tau[[1000, 3000], 2] += 3.0 * np.ptp(tau[:, 2])
    v = np.abs(np.gradient(log.q[:, 3]))
    stop = 1200 + int(v[1200:1700].argmax())
    q[stop : stop + 250, 3] = q[stop, 3]
    tau[2400:2640, 0] = tau[2400, 0]
    bad = Log(log.dt, q, tau)
    choices = clean.equations.processing  # residuals have as much noise as the cutoff passes
    found = fit(model, bad, processing=choices)
    sentences = " ".join(found.notes)
    for words in (
        "Joint 2: outliers of its position: 3, the first at row 700",
        "Joint 3: outliers of its torque: 2, the first at row 1000",
        f"Joint 4: 249 samples of its position repeat, from row {stop}",
        "Joint 1: 239 samples of its torque repeat, from row 2400",
        "5 samples interpolated and 488 rows left",
    ):
        assert words in sentences
    # what is interpolated or left out is no jump as well
    assert "jumps" not in sentences
    both = np.hypot(found.standard_errors, clean.standard_errors)
    errors = np.abs(found.values - clean.values) / both
    assert np.sqrt((errors**2).mean()) < 1.0
    fitted = fit(model, bad, processing=choices, checked=False)  # the log unchanged
    rms = [np.sqrt((r.validation.in_sample.rmse**2).sum()) for r in (clean, found, fitted)]
    assert rms[1] < 1.1 * rms[0] < rms[2]


def test_what_cannot_be_judged_is_no_mistake(good):
    model, log = good
    t = log.dt * np.arange(4000)[:, None]
    moves = np.where((t > 7.9) & (t < 8.1), 0.1 * np.sin(10.0 * np.pi * (t - 7.9)) ** 4, 0.0)
    rest = Log(log.dt, log.q[:1] + moves, log.tau[:1] + moves)
    for part in (rest, log.rows(0, 30)):
        assert not useless(check_joints(part, model))
    (short,) = check_joints(log.rows(0, 30), model)
    assert "were not checked: log: no recording is longer than" in short.sentence


# --- delay between positions and torques ---------------------------------------------------------


DRIVE = rm.DriveParameters(Ia=np.full(6, 0.3), Fv=np.full(6, 2.0), Fc=np.full(6, 1.5))
ROBOT = rm.load("rx90").with_drive(DRIVE)


def simulated(rate=1000.0, late=0.0):
    """Noisy log of a robot, its torques late."""
    options = {"samples": round(6.0 * rate), "dt": 1.0 / rate, "period": 5.0, "size": 1.2}
    moves, moved = (swinging(ROBOT, 3, late=x, **options) for x in (0.0, late))
    noise = np.random.default_rng(3).normal(size=(2, *moves[0].shape))
    tau = rm.idm(ROBOT, *moved)
    return Log(1.0 / rate, moves[0] + 1e-4 * noise[0], tau + 0.05 * noise[1])


@pytest.mark.parametrize(("rate", "late"), [(1000.0, -0.004), (5000.0, 0.0013)])
def test_a_delay_is_found_within_a_part_of_a_sample_and_not_again_where_it_is_removed(rate, late):
    log = simulated(rate, late)
    found = synchronisation(log, ROBOT)
    assert found.status is SynchronisationStatus.FOUND
    assert found.delay == pytest.approx(late, abs=0.2e-3)
    assert found.delay == pytest.approx(late, abs=5.0 * found.standard_error)
    assert found.is_out_of_step
    known = np.isfinite(found.joint_delays)
    assert known.sum() >= 3
    assert np.median(found.joint_delays[known]) == pytest.approx(late, abs=1e-3)
    again = synchronisation(with_delay(log, found.delay), ROBOT)
    assert again.status.is_success
    assert not again.is_out_of_step
    assert abs(again.delay) < 0.05e-3


def test_delays_that_the_log_or_the_range_does_not_determine_are_reported():
    log = simulated(late=0.06)
    found = synchronisation(log, ROBOT)
    assert found.status is SynchronisationStatus.AT_THE_END
    assert not found.is_out_of_step
    assert synchronisation(log, ROBOT, within=0.1).delay == pytest.approx(0.06, abs=0.5e-3)
    (finding,) = check_joints(log, ROBOT)
    assert finding.kind is FindingKind.OUT_OF_STEP
    one = rm.RobotModel.from_table(rm.DHTable(antecedent=[0], sigma=[0]))
    t = np.arange(0.0, 10.0, 0.001)[:, None]
    found = synchronisation(Log(0.001, np.sin(t), np.cos(t - 0.3)), one)  # a single sine
    assert not found.is_out_of_step
    assert not found.status.is_success
    q = np.where(np.arange(6) == 0, log.q, 0.3)
    kinds = {f.kind: f for f in check_joints(Log(log.dt, q, log.tau), ROBOT)}
    assert "base parameters" in kinds[FindingKind.NOT_EXCITING].sentence


# --- long logs -----------------------------------------------------------------------------------


def test_stretches_cover_a_log_and_keep_its_recordings():
    q = np.arange(1000.0)[:, None]
    log = Log(0.01, q, -q, q + 1.0, q + 2.0, starts=(0, 430, 435))
    part = stretches(log, 50, 300)
    assert np.array_equal(part.v, part.q + 1.0)
    assert np.array_equal(part.a, part.q + 2.0)
    assert len(part) <= 300
    assert part.q[0, 0] == 0.0
    assert part.q[-1, 0] == 984.0  # the 15 samples after it are no stretch
    assert np.array_equal(part.tau, -part.q)
    for rows in part.recordings():
        inside = part.q[rows, 0]
        assert (np.diff(inside) == 1.0).all()
        assert inside[-1] < 430.0 or inside[0] >= 435.0
    short = Log(0.01, q, q, starts=tuple(range(0, 1000, 4)))
    assert 0 < len(stretches(short, 50, 300)) <= 300


def test_what_a_long_log_hides_is_found_in_stretches_and_said():
    model, whole = rm.load("planar_2r"), recorded("planar_2r", 120_000, noise=0.01)
    assert check_joints(whole, model) == ()
    wrong = Log(whole.dt, whole.q, whole.tau * [-1.0, 1.0])
    (found,) = [f for f in check_joints(wrong, model) if f.joints == ("1",)]
    assert "of 120000 samples" in found.sentence


def test_what_happens_once_in_a_long_log_is_found():
    q = np.sin(1e-3 * np.arange(250_000))[:, None] * [1.0, 0.7]
    q[99_950:100_060, 1] = q[99_950, 1]  # a sensor that stops, over the end of a piece
    q[230_000:, 0] += 0.5
    tau = np.cos(q) + 1e-3 * np.random.default_rng(0).normal(size=q.shape)
    q[150_000, 0] += 2.0
    log = Log(1e-3, q, tau)
    found = {(f.kind, f.joints): f.sentence for f in check_log(log)}
    assert "repeat, from row 99950" in found[FindingKind.STUCK, ("2",)]
    assert "the first at row 150000" in found[FindingKind.SPIKES, ("1",)]
    assert "at row 230000" in found[FindingKind.JUMP, ("1",)]
    assert (FindingKind.JUMP, ("2",)) not in found

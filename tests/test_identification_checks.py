"""A correct log is never refused, and mistakes in a log are named: on random arms and motions."""

import re
from itertools import combinations

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.errors import InvalidValueError
from robotmodels.identification import Log, check_joints, fit
from robotmodels.identification.preparation.filters import zero_phase
from robotmodels.logs import FindingKind, Severity, check_log

KINDS = ("slow", "fast", "little", "loop")


def arm(rng, n):
    """A serial arm of real bodies, light or heavy, with rotors and friction; sizes of torques."""
    alpha = np.r_[0.0, np.pi / 2, rng.choice([0.0, np.pi / 2, -np.pi / 2], n - 2)]
    table = rm.DHTable(
        antecedent=np.arange(n), sigma=np.zeros(n, int), alpha=alpha,
        d=np.r_[0.0, rng.choice([0.0, 0.3, 0.5], n - 1)], r=rng.choice([0.0, 0.2, -0.3], n),
    )  # fmt: skip
    masses = 10.0 ** rng.uniform(-0.3, 1.7) * rng.uniform(0.4, 1.0, n) * 0.6 ** np.arange(n)
    com = 0.08 * rng.normal(size=(n, 3)) + 0.1 * np.eye(3)[rng.integers(3, size=n)]
    points = rng.normal(0.0, 0.08, (n, 12, 3))
    spread = np.einsum("nki,nkj->nij", points, points) / 12.0
    tensor = np.trace(spread, axis1=1, axis2=2)[:, None, None] * np.eye(3) - spread
    inertia = rm.InertialParameters.from_com(masses, com, masses[:, None, None] * tensor)
    bare = rm.RobotModel.from_table(table, inertia=inertia)
    q = rng.uniform(-2.0, 2.0, (200, n))
    rotor = np.einsum("kjj->j", rm.mass_matrix(bare, q)) / 200.0
    size = np.maximum(np.abs(rm.gravity_torque(bare, q)).max(axis=0), 5.0 * rotor)
    size = size + 0.02 * size.max()
    drive = rm.DriveParameters(
        Ia=rotor * rng.uniform(0.2, 1.5, n) + 0.01 * rotor.max() * 0.6 ** np.arange(n),
        Fv=size * rng.uniform(0.02, 0.2, n), Fc=size * rng.uniform(0.03, 0.25, n),
        offset=0.05 * size * rng.normal(size=n),
    )  # fmt: skip
    return bare.with_drive(drive), size


def recorded(seed):
    """An arm and a log of it that is correct, with what its model lacks."""
    rng, kind = np.random.default_rng(seed), KINDS[seed % 4]
    n = int(rng.integers(4, 8))
    model, size = arm(rng, n)
    dt, seconds = rng.choice([0.002, 0.004, 0.01]), rng.choice([10.0, 20.0])
    t = dt * np.arange(int(seconds / dt))
    w = 2.0 * np.pi * {"slow": 0.1, "fast": 0.4}.get(kind, 0.2) * np.arange(1, 6)
    range_ = 10.0 ** rng.uniform(-2.0, 0.0, n) if kind == "little" else np.ones(n)
    a = 0.5 * range_ * rng.normal(size=(5, n)) / np.arange(1, 6)[:, None]
    phase = t[:, None, None] * w[:, None] + rng.uniform(0.0, 6.0, (5, n))
    q = rng.uniform(-1.0, 1.0, n) + (a * np.sin(phase)).sum(axis=1)
    v, acc = (a * w[:, None] * np.cos(phase)).sum(axis=1), -(a * w[:, None] ** 2 * np.sin(phase))
    acc = acc.sum(axis=1)
    tau = rm.idm(model, q, v, acc)
    spring, ripple, load, stribeck, coarse = rng.random(5) < 0.5
    if spring:  # a counterbalance of axis 2
        tau[:, 1] -= 0.5 * size[1] * (np.sin(q[:, 1] + 0.3) + np.abs(q[:, 1]))
    if ripple:
        tau += 0.1 * size * np.sin(rng.uniform(30.0, 100.0, n) * q)
        tau += 0.05 * size * np.sin(2.0 * np.pi * 111.0 * t)[:, None]
    if load:
        tau += 0.2 * np.abs(rm.idm(model, q, v, acc, drive=False)) * np.tanh(v / 0.01)
    if stribeck:
        tau += 0.1 * size * np.sign(v) * np.exp(-((v / 0.1) ** 2))
        tau += 0.25 * size * zero_phase(rng.normal(size=tau.shape), 2.0, dt)
    if kind == "loop":  # noise that the controller follows
        error = 3e-3 * zero_phase(rng.normal(size=q.shape), 10.0, dt)
        q, tau = q + error, tau + 20.0 * size * error
    tau = tau + 10.0 ** rng.uniform(-3.0, -1.0) * size * rng.normal(size=tau.shape)
    q = np.round(q, 3) if coarse else q + 5e-5 * rng.normal(size=q.shape)
    return model, Log(dt, q, tau), kind


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


def test_correct_logs_are_not_refused_and_wrong_ones_are_named():
    seen, named, tried = 0, 0, 0
    for seed in range(32):
        model, log, kind = recorded(seed)
        found = (*check_log(log, model), *check_joints(log, model))
        assert not useless(found), (seed, found)
        assert not any(f.kind is FindingKind.SPIKES for f in found), (seed, found)
        if kind == "little":
            continue
        every = list(mistakes(model.n))
        for k in np.random.default_rng(seed).choice(len(every), 2, replace=False):
            joints, position, torque = every[k]
            wrong = Log(log.dt, log.q @ position.T, log.tau @ torque.T)
            said = [f for f in check_joints(wrong, model)
                    if f.kind in (FindingKind.WRONG_SIGN, FindingKind.SWAPPED_JOINTS)]  # fmt: skip
            tried += 1
            seen += bool(said)
            words = {tuple(str(j + 1) for j in joints)} & {finding.joints for finding in said}
            named += bool(words)
    assert tried == 48
    assert seen >= 44
    assert named >= 43


# --- one robot, every mistake ------------------------------------------------------------------


@pytest.fixture(scope="module")
def good():
    """An arm without limits and a correct log of it, 250 Hz."""
    rng = np.random.default_rng(5)
    model, size = arm(rng, 5)
    t = 0.004 * np.arange(5000)
    w = 2.0 * np.pi * np.array([0.15, 0.31, 0.47])[:, None]
    a, phase = rng.uniform(0.3, 0.6, (3, 5)), rng.uniform(0.0, 6.0, (3, 5))
    angle = w * t[:, None, None] + phase
    q = (a * np.sin(angle)).sum(axis=1)
    v, acc = (a * w * np.cos(angle)).sum(axis=1), -(a * w**2 * np.sin(angle)).sum(axis=1)
    tau = rm.idm(model, q, v, acc) + 0.01 * size * rng.normal(size=q.shape)
    return model, Log(0.004, q + 2e-5 * rng.normal(size=q.shape), tau)


def flipped(*joints):
    sign = np.ones(5)
    sign[list(joints)] = -1.0
    return sign


ORDER = [0, 2, 1, 3, 4]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda q, tau: (q[:, ORDER], tau[:, ORDER]),
         "Joints 2 and 3 look swapped in positions and torques"),
        (lambda q, tau: (q[:, ORDER], tau), "Joints 2 and 3 look swapped in positions:"),
        (lambda q, tau: (q, tau[:, ORDER]), "Joints 2 and 3 look swapped in torques:"),
        (lambda q, tau: (q * flipped(2), tau * flipped(2)),
         r"oint 3 looks flipped \(wrong sign of position and torque\)"),
        (lambda q, tau: (q * flipped(1), tau), "The position of joint 2 has the wrong sign"),
        (lambda q, tau: (q, tau * flipped(3)), "The torque of joint 4 has the wrong sign"),
        (lambda q, tau: (q, -tau), "The torques of all joints have the wrong sign"),
        (lambda q, tau: (np.degrees(q), tau), r"(?s)Positions look like degrees.*angles='deg'"),
    ],
)  # fmt: skip
def test_flips_swaps_and_degrees_are_refused_by_name(good, change, words):
    model, log = good
    with pytest.raises(InvalidValueError, match=words):
        fit(model, Log(log.dt, *change(log.q, log.tau)))


def test_two_mistakes_are_both_named(good):
    model, log = good
    tau = (log.tau * flipped(3))[:, ORDER]
    sentences = " ".join(map(str, check_joints(Log(log.dt, log.q, tau), model)))
    assert "torque of joint 4" in sentences
    assert "joints 2 and 3 look swapped in torques" in sentences.replace("Joints", "joints")


def test_a_joint_that_turns_on_and_on_is_no_motor(good):
    model, log = good
    t = log.t[:, None]
    q = np.array(log.q)
    q[:, [0]] = 40.0 * np.sin(0.1 * t)  # six turns either way
    smooth = zero_phase(q, 5.0, log.dt)
    v = np.gradient(smooth, log.dt, axis=0)
    a = np.gradient(v, log.dt, axis=0)
    turning = Log(log.dt, smooth, rm.idm(model, smooth, v, a))
    found = (*check_log(turning, model), *check_joints(turning, model))
    assert not useless(found)
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
def test_torques_beside_the_models_own_inertia(good, factor, joints, words):
    model, log = good
    wrong = Log(log.dt, log.q, factor * log.tau)
    (finding,) = [f for f in check_joints(wrong, model) if f.kind.name == "TORQUE_OFF_INERTIA"]
    assert set(finding.joints) <= set(joints)
    assert len(finding.joints) >= (len(joints) + 1) // 2
    assert finding.severity is Severity.DOUBTFUL
    assert any(finding.sentence in note for note in fit(model, wrong).notes)
    assert re.search(words, finding.sentence)
    # catalogues are off by three, and say nothing without masses
    for scale in (3.0, 1.0 / 3.0):
        rough = model.with_inertia(rm.InertialParameters(scale * model.inertia.values))
        assert check_joints(log, rough) == ()
    bare = rm.RobotModel.from_table(model.table)
    assert not any(f.kind.name == "TORQUE_OFF_INERTIA" for f in check_joints(wrong, bare))


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
    choices = clean.system.processing  # residuals have as much noise as the cutoff passes
    found = fit(model, bad, processing=choices)
    sentences = " ".join(found.notes)
    assert "Joint 2: 3 samples of its position are outliers (the first at row 700)" in sentences
    assert "Joint 3: 2 samples of its torque are outliers (the first at row 1000)" in sentences
    assert f"Joint 4: its position repeats for 250 samples from row {stop} while" in sentences
    assert "Joint 1: its torque repeats for 240 samples from row 2400 while the joint" in sentences
    assert "where the gap is short and leaves the rows out where it is long" in sentences
    assert (
        "5 outliers and 488 frozen samples: 5 samples interpolated and 488 rows left" in sentences
    )
    # what is interpolated or left out is no jump as well
    assert "jumps" not in sentences
    errors = np.abs(found.values - clean.values) / np.hypot(found.deviations, clean.deviations)
    assert np.sqrt((errors**2).mean()) < 1.0
    # the same rows fitted are what they were before
    fitted = fit(model, bad, processing=choices, checked=False)
    assert not any("outlier" in note for note in fitted.notes)
    rms = [np.sqrt((r.fitted.rmse**2).sum()) for r in (clean, found, fitted)]
    assert rms[1] < 1.1 * rms[0] < rms[2]
    # a log kept aside is cleaned as well
    half = len(log) // 2
    tested = fit(model, log.rows(0, half), test=bad.rows(half, len(log)))
    assert any("Of the log kept aside: Joint 2" in note for note in tested.notes)
    assert (tested.held_out.rmse < 3.0 * tested.fitted.rmse).all()


def test_what_cannot_be_judged_is_no_mistake(good):
    model, log = good
    t = log.dt * np.arange(4000)[:, None]
    moves = np.where((t > 7.9) & (t < 8.1), 0.1 * np.sin(10.0 * np.pi * (t - 7.9)) ** 4, 0.0)
    rest = Log(log.dt, log.q[:1] + moves, log.tau[:1] + moves)
    for part in (rest, log.rows(0, 30)):
        assert not useless(check_joints(part, model))
    (short,) = check_joints(log.rows(0, 30), model)
    assert "were not checked: log: no recording is longer than" in short.sentence

"""Logs as values: the time base, joining, shifting in time, and checks that name mistakes."""

from itertools import pairwise

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.datasets import load_tx40
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.logs import FindingKind, Log, Severity, check_log, join_logs, with_delay
from robotmodels.logs.log import RefusedRows
from robotmodels.logs.time_base import regular_rows

DT = 0.01


def smooth_log(n=2, N=2000, **more):
    t = DT * np.arange(N)[:, None]
    j = np.arange(1, n + 1)
    q = np.sin(0.7 * j * t) + 0.3 * np.cos(1.1 * j * t)
    return Log(DT, q, 3.0 * np.cos(0.7 * j * t + 1.0), **more)


def test_slices_are_rows():
    log = smooth_log(starts=(0, 700))
    part = log[600:-100]
    assert np.array_equal(part.q, log.q[600:1900])
    assert np.shares_memory(part.q, log.q)
    assert part.starts.tolist() == [0, 100]


# --- time base -----------------------------------------------------------------------------------


def values(t):
    return np.column_stack([np.sin(t), np.cos(3.0 * t)])


def test_gaps_and_jumps_back_split():
    t = DT * np.arange(100)
    t[40:] += 0.5
    t[70:] -= 10.0
    rows = regular_rows(t, values(t), "x")
    assert rows.starts.tolist() == [0, 40, 70]
    assert rows.dt == pytest.approx(DT)
    assert np.array_equal(rows.values, values(t))


def test_gaps_may_be_allowed():
    t = np.delete(DT * np.arange(200), [50, 51])
    split = regular_rows(t, values(t), "x", largest_gap=1.5)
    assert len(split.starts) == 2
    whole = regular_rows(t, values(t), "x", dt=DT, largest_gap=5.0)
    assert len(whole.starts) == 1
    np.testing.assert_allclose(whole.values, values(DT * np.arange(200)), atol=1e-6)


@pytest.mark.parametrize("stamped", [True, False])
def test_missing_samples_are_interpolated_up_to_a_tenth_of_the_shortest_period(stamped):
    rng = np.random.default_rng(1)
    dt, N = 0.004, 2500
    t = dt * np.arange(N)
    data = np.column_stack([np.sin(2.0 * np.pi * 0.9 * t), np.sin(2.0 * np.pi * 0.3 * t)])
    noisy = data + rng.normal(0.0, 1e-4, data.shape)
    lost = rng.random(N) < 0.03
    lost[[0, -1]] = False
    lost[500:515] = lost[1500:1540] = True  # 0.06 and 0.16 s
    lost[[499, 515, 1499, 1540]] = False
    rows = noisy[~lost] if stamped else np.where(lost[:, None], np.nan, noisy)
    found = regular_rows(t[~lost] if stamped else None, rows, "x", dt=None if stamped else dt)
    assert found.starts.tolist() == [0, 1500]
    assert found.dt == pytest.approx(dt, rel=1e-9)
    np.testing.assert_allclose(found.values, np.delete(data, slice(1500, 1540), axis=0), atol=1e-3)


def test_repeated_stamps_are_refused_and_listed():
    t = DT * np.arange(100)
    order = np.sort(np.concatenate([np.arange(100), [10, 30]]))
    rows = regular_rows(t[order], values(t[order]), "x")
    assert len(rows.values) == 100
    (refused,) = rows.refused
    assert refused.rows == (11, 32)
    # a break beside a repeated stamp stays
    t = DT * np.arange(30)
    t[11] = t[10]
    t[12:] -= DT
    data = values(t)
    data[9] = np.nan
    rows = regular_rows(t, data, "x")
    assert rows.starts.tolist() == [0, 9]
    assert [refused.rows for refused in rows.refused] == [(9,), (11,)]


@pytest.mark.parametrize(("size", "options"), [
    (0.1, {}), (0.45, {"largest_gap": 3.0, "largest_jitter": 1.0}), (0.0, {"dt": 0.004}),
])  # fmt: skip
def test_jitter_and_other_periods_are_interpolated_and_noted(size, options):
    rng = np.random.default_rng(0)
    t = DT * (np.arange(400) + rng.uniform(-size, size, 400))
    rows = regular_rows(t, values(t), "x", **options)
    grid = t[0] + rows.dt * np.arange(len(rows.values))
    assert grid[-1] > t[-1] - rows.dt
    np.testing.assert_allclose(rows.values, values(grid), atol=1e-6 if size < 0.4 else 1e-4)


def test_rows_without_neighbours_are_listed():
    data = values(DT * np.arange(10))
    data[[2, 4]] = np.nan
    rows = regular_rows(None, data, "x", dt=DT)
    assert [refused.rows for refused in rows.refused] == [(2, 4), (3,)]
    assert rows.starts.tolist() == [0, 2]
    assert len(rows.values) == 7


# --- joining and shifting ------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0.04, -0.0042])
def test_torques_are_moved_in_every_recording(delay):
    log = smooth_log(v=np.ones((2000, 2)), starts=(0, 700, 705))
    moved = with_delay(log, delay)
    cut = int(np.ceil(abs(delay) / DT - 1e-9))
    kept = [length - cut for length in (700, 5, 1295) if length > cut + 1]
    assert np.diff([*moved.starts, len(moved)]).tolist() == kept
    assert sum(len(rows.rows) for rows in moved.refused) == (5 if cut + 1 >= 5 else 0)
    # where a position of the log stands, its torque is of that time and the delay
    first = 0 if delay > 0 else cut
    t = DT * (first + np.arange(kept[0]))[:, None]
    assert np.array_equal(moved.q[: kept[0]], log.q[first : first + kept[0]])
    expected = 3.0 * np.cos(0.7 * np.array([1, 2]) * (t + delay) + 1.0)
    np.testing.assert_allclose(moved.tau[: kept[0]][5:-5], expected[5:-5], atol=1e-6)
    assert moved.v.shape == moved.q.shape
    assert with_delay(moved, delay).delay == 2.0 * delay
    assert with_delay(log, 0.0) is log


def test_joined_logs_keep_what_all_have():
    a, b = smooth_log(v=np.zeros((2000, 2)), notes=["a"]), smooth_log(N=100)
    log = join_logs([a, b])
    assert log.starts.tolist() == [0, 2000]
    assert log.v is None
    assert log.notes == ("a",)
    assert join_logs([a, a]).v.shape == (4000, 2)
    lost = [RefusedRows(name, (3,), "no number") for name in "ab"]
    refused = [smooth_log(N=100, refused=[rows]) for rows in lost]
    assert list(join_logs(refused).refused) == lost


T, LOST = DT * np.arange(10), np.where(np.arange(10)[:, None] % 2, np.nan, 1.0)
ROUGH = DT * (np.arange(400) + np.random.default_rng(0).uniform(-0.45, 0.45, 400))


def made(**fields):
    return Log(**{"dt": 0.1, "q": np.zeros((4, 2)), "tau": np.zeros((4, 2))} | fields)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: made(dt=0.0), "dt: expected a finite number"),
        (lambda: made(q=np.zeros(4)), r"q: expected samples of shape \(N, n\)"),
        (lambda: made(tau=np.zeros((3, 2))), r"tau: expected shape \(4, 2\) as q has it"),
        (lambda: made(names=("one",)), "names: expected 2 names of joints, got 1"),
        (lambda: made(starts=(0, 2, 2)), "starts: expected ascending numbers"),
        (lambda: smooth_log()[0:9000], "2000 rows"),
        (lambda: smooth_log()[3:3], "2000 rows"),
        (lambda: smooth_log()[::2], "single samples.*needs a filter"),
        (lambda: with_delay(smooth_log(), 20.0), "no recording is longer"),
        (lambda: with_delay(smooth_log(), [0.1, 0.2]), "delay: expected a finite number"),
        (lambda: join_logs([smooth_log(), with_delay(smooth_log(), 0.02)]), "use with_delay"),
        (lambda: regular_rows(None, LOST, "x", dt=DT), "the log is empty"),
        (lambda: regular_rows(-T, values(T), "x"), "right column"),
        (lambda: regular_rows(T, values(T), "x", dt=0.02), "without a filter"),
        (lambda: regular_rows(T, values(T), "x", dt=1e-6), "more than 100 of one"),
        (lambda: regular_rows(T, LOST * np.nan, "x"), "0 of its 10 rows have all numbers"),
        (lambda: regular_rows(ROUGH, values(ROUGH), "x", largest_gap=3.0), "largest_jitter="),
    ],
)
def test_what_is_no_log_is_refused(call, words):
    with pytest.raises((InvalidValueError, ShapeError), match=words):
        call()


# --- checks --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tx40():
    """Every fifth sample of the data set, whose check is quick."""
    data = load_tx40()
    log = data.log
    return data.model, Log(5 * log.dt, log.q[::5], log.tau[::5], names=log.names), data


def changed(log, **fields):
    return Log(**{"dt": log.dt, "q": log.q, "tau": log.tau, "names": log.names} | fields)


def rate(q, order):
    """Derivative of positions at the period of the thinned data set."""
    v = np.gradient(q, 1e-3, axis=0)
    return v if order == 1 else rate(v, 1)


def test_a_good_log_has_no_findings(tx40):
    model, log, data = tx40
    assert check_log(data.log, model) == ()
    assert check_log(smooth_log()) == ()
    # names that are not the model's are not compared
    assert check_log(changed(log, names="abcdef"), model) == ()


ORDER = [0, 2, 1, 3, 4, 5]


@pytest.mark.parametrize(
    ("kind", "severity", "words", "change"),
    [
        ("POSITIONS_IN_DEGREES", "USELESS", "angles='deg'", lambda q, tau: {"q": np.degrees(q)}),
        ("OUTSIDE_LIMITS", "DOUBTFUL", "joint_2", lambda q, tau: {"q": q + 2.5 * np.eye(6)[1]}),
        ("TORQUE_ABOVE_LIMITS", "USELESS", "gear ratios", lambda q, tau: {"tau": 1000.0 * tau}),
        ("CONSTANT_POSITION", "DOUBTFUL", "joint_3: it stays at",
         lambda q, tau: {"q": q * [1, 1, 0, 1, 1, 1]}),
        ("CONSTANT_TORQUE", "USELESS", "joint_4: its torque is 0",
         lambda q, tau: {"tau": tau * [1, 1, 1, 0, 1, 1]}),
        ("NOTHING_MOVES", "USELESS", "No joint moves", lambda q, tau: {"q": 0.0 * q}),
        ("SATURATED", "DOUBTFUL", "the largest one", lambda q, tau: {
            "tau": np.minimum(tau, np.quantile(tau, 0.93, axis=0))}),
        ("SATURATED", "DOUBTFUL", "the smallest one", lambda q, tau: {
            "tau": np.maximum(tau, np.quantile(tau, 0.07, axis=0))}),
        ("JUMP", "DOUBTFUL", "numpy.unwrap", lambda q, tau: {
            "q": np.where(np.arange(9000)[:, None] >= 4000, q + 2 * np.pi, q)}),
        ("STUCK", "DOUBTFUL", "recorder is faster", lambda q, tau: {
            "q": np.repeat(q[:1800], 5, axis=0), "tau": np.repeat(tau[:1800], 5, axis=0)}),
        ("IMPLAUSIBLE_PERIOD", "USELESS", "milliseconds", lambda q, tau: {"dt": 1.0}),
        ("IMPLAUSIBLE_PERIOD", "USELESS", "in seconds", lambda q, tau: {"dt": 2e-6}),
        ("WRONG_JOINT_ORDER", "USELESS", "model= to read_log", lambda q, tau: {
            "q": q[:, ORDER], "tau": tau[:, ORDER],
            "names": [f"joint_{j + 1}" for j in ORDER]}),
        ("RATES_OFF_POSITIONS", "USELESS", "are 57.3 times the derivatives of the positions",
         lambda q, tau: {"v": np.degrees(rate(q, 1))}),
        ("RATES_OFF_POSITIONS", "USELESS", "Joints joint_3: accelerations are -1 times",
         lambda q, tau: {"a": rate(q, 2) * [1, 1, -1, 1, 1, 1]}),
        ("RATES_OFF_POSITIONS", "DOUBTFUL", "Joints joint_1, joint_2: velocities do not follow",
         lambda q, tau: {"v": rate(q, 1)[:, [1, 0, 2, 3, 4, 5]]}),
        ("TOO_SHORT", "USELESS", "10 samples", lambda q, tau: {"q": q[:10], "tau": tau[:10]}),
        ("TOO_SHORT", "DOUBTFUL", "60 samples", lambda q, tau: {"q": q[:60], "tau": tau[:60]}),
    ],
)  # fmt: skip
def test_mistakes_are_named(tx40, kind, severity, words, change):
    model, log, _ = tx40
    found = check_log(changed(log, **change(log.q, log.tau)), model)
    order = [list(Severity)[::-1].index(finding.severity) for finding in found]
    assert order == sorted(order)  # the most severe first
    finding = {finding.kind: finding for finding in found}[FindingKind[kind]]
    assert finding.severity is Severity[severity]
    assert words in str(finding)


def test_other_robots_and_motor_angles_are_named(tx40):
    model, log, data = tx40
    (finding,) = check_log(log, rm.load("panda"))
    assert finding.kind is FindingKind.WRONG_JOINT_COUNT
    motors = changed(log, q=data.motor_positions[::5])
    plain = rm.RobotModel.from_table(model.table)
    for robot, given, words in (
        (model, motors, "transmission=model.transmission"),
        (plain, changed(log, q=20.0 * motors.q), "gears= or transmission="),
    ):
        kinds = {finding.kind: finding for finding in check_log(given, robot)}
        assert words in kinds[FindingKind.MOTOR_SIDE_POSITIONS].sentence


def test_joints_that_rest_between_moves_have_not_stopped():
    rng = np.random.default_rng(2)
    corners = np.cumsum(rng.normal(size=(9, 3)), axis=0)
    for dt, step in ((0.001, 0.0), (0.004, 1e-3), (0.004, 1e-5)):
        parts = []
        for a, b in pairwise(corners):  # as long at rest as in motion
            s = np.clip(np.arange(0.0, 2.0, dt), 0.0, 1.0)[:, None]
            ramp = np.where(s < 0.5, 2.0 * s**2, 1.0 - 2.0 * (1.0 - s) ** 2)
            parts.append(a + (b - a) * ramp)
        q = np.concatenate(parts)
        q = np.round(q / step) * step if step else q
        tau = np.gradient(np.gradient(q, dt, axis=0), dt, axis=0) + rng.normal(size=q.shape)
        kinds = {finding.kind for finding in check_log(Log(dt, q, tau))}
        assert not {FindingKind.STUCK, FindingKind.SPIKES} & kinds
        row = int(0.5 / dt) + 7
        q[row:, 1] = q[row, 1]  # for good
        if step < 1e-3:
            stuck = [f for f in check_log(Log(dt, q, tau)) if f.kind is FindingKind.STUCK]
            assert stuck[0].joints == ("2",)
            assert f"from row {row}" in stuck[0].sentence


def off(log):
    return [f for f in check_log(log) if f.kind is FindingKind.RATES_OFF_POSITIONS]


def test_derivatives_of_the_positions_are_accepted(tx40):
    _, log, _ = tx40
    v, a = (rate(log.q, order) for order in (1, 2))
    rng = np.random.default_rng(0)
    for q, w in ((log.q, v), (log.q + rng.normal(0, 1e-4, v.shape), v),
                 (log.q, v + rng.normal(0, 0.1, v.shape))):  # fmt: skip
        assert off(Log(log.dt, q, log.tau, w, a, starts=(0, 3, 5, 40, 4000))) == []
    still = np.full((500, 1), 0.3) + rng.normal(0, 1e-6, (500, 1))
    assert off(Log(DT, still, still, rng.normal(0, 1e-3, (500, 1)))) == []
    assert off(Log(DT, *np.ones((4, 2, 1)))) == []

"""Logs as values: the time base, joining, moving in time, and checks that name what is wrong."""

from itertools import pairwise

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.datasets import load_tx40
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.logs import (
    FindingKind,
    Log,
    RefusedRows,
    Severity,
    check_log,
    join_logs,
    with_delay,
)  # fmt: skip
from robotmodels.logs.time_base import regular_rows

DT = 0.01


def values(t):
    return np.column_stack([np.sin(t), np.cos(3.0 * t)])


def test_regular_stamps_are_kept_as_they_are():
    t = 1.6e9 + DT * np.arange(100)
    rows = regular_rows(t, values(t - 1.6e9), "x")
    assert rows.dt == pytest.approx(DT, rel=1e-7)
    assert np.array_equal(rows.values, values(t - 1.6e9))
    assert rows.starts.tolist() == [0]
    assert not rows.refused


def test_gaps_and_jumps_back_split():
    t = DT * np.arange(100)
    t[40:] += 0.5
    t[70:] -= 10.0
    rows = regular_rows(t, values(t), "x")
    assert rows.starts.tolist() == [0, 40, 70]
    assert rows.dt == pytest.approx(DT)
    assert np.array_equal(rows.values, values(t))
    text = " ".join(rows.notes)
    assert "time goes back once (before row 70" in text
    assert "time has one gap (before row 40" in text


def test_several_gaps_are_counted():
    t = DT * np.arange(100)
    t[40:] += 0.5
    t[70:] += 0.5
    assert "time has 2 gaps (the first before row 40" in regular_rows(t, values(t), "x").notes[0]


def test_rows_are_not_left_out_without_a_filter():
    t = DT * np.arange(300)
    with pytest.raises(InvalidValueError, match="folds what is fast"):
        regular_rows(t, values(t), "x", dt=0.02)
    assert regular_rows(t, values(t), "x", dt=0.012).dt == 0.012


def test_gaps_may_be_allowed():
    t = np.delete(DT * np.arange(200), [50, 51])
    split = regular_rows(t, values(t), "x", largest_gap=1.5)
    assert len(split.starts) == 2
    whole = regular_rows(t, values(t), "x", dt=DT, largest_gap=5.0)
    assert len(whole.starts) == 1
    assert len(whole.values) == 200
    np.testing.assert_allclose(whole.values, values(DT * np.arange(200)), atol=1e-4)


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
    truth = np.delete(data, slice(1500, 1540), axis=0)
    np.testing.assert_allclose(found.values, truth, atol=1e-3)
    (note,) = [note for note in found.notes if "interpolated" in note]
    inserted = len(found.values) - int((~lost).sum())
    assert f"x: {inserted} missing samples were interpolated (gaps up to 0.064 s; " in note
    shortest = float(note.split("motion ")[1].split()[0])
    assert 0.7 < shortest < 1.12


def test_repeated_stamps_are_refused_and_listed():
    t = DT * np.arange(100)
    order = np.sort(np.concatenate([np.arange(100), [10, 30]]))
    rows = regular_rows(t[order], values(t[order]), "x")
    assert len(rows.values) == 100
    (refused,) = rows.refused
    assert refused.rows == (11, 32)
    assert "time is that of the row before" in refused.reason
    with pytest.raises(InvalidValueError, match="coarser than the sampling"):
        regular_rows(np.repeat(t, 3), values(np.repeat(t, 3)), "x")


def test_a_break_beside_a_repeated_stamp_stays():
    t = DT * np.arange(30)
    t[11] = t[10]
    t[12:] -= DT
    data = values(t)
    data[9] = np.nan
    rows = regular_rows(t, data, "x")
    assert rows.starts.tolist() == [0, 9]
    assert [refused.rows for refused in rows.refused] == [(9,), (11,)]


def test_jitter_is_interpolated_over_and_said():
    rng = np.random.default_rng(0)
    t = DT * (np.arange(400) + rng.uniform(-0.1, 0.1, 400))
    rows = regular_rows(t, values(t), "x")
    grid = t[0] + rows.dt * np.arange(len(rows.values))
    np.testing.assert_allclose(rows.values, values(grid), atol=1e-6)
    assert abs(rows.values - values(t)[: len(rows.values)]).max() > 1e-4  # which it was not before
    assert any("cubic splines" in note for note in rows.notes)


def test_jitter_that_is_too_large_is_an_error():
    rng = np.random.default_rng(0)
    t = DT * (np.arange(400) + rng.uniform(-0.45, 0.45, 400))
    with pytest.raises(InvalidValueError, match=r"largest_jitter="):
        regular_rows(t, values(t), "x", largest_gap=3.0)
    rows = regular_rows(t, values(t), "x", largest_gap=3.0, largest_jitter=1.0)
    grid = t[0] + rows.dt * np.arange(len(rows.values))
    np.testing.assert_allclose(rows.values, values(grid), atol=1e-4)


def test_another_period_may_be_asked_for():
    t = DT * np.arange(300)
    rows = regular_rows(t, values(t), "x", dt=0.004)
    assert rows.dt == 0.004
    assert len(rows.values) == 1 + int(2.99 / 0.004)
    np.testing.assert_allclose(rows.values, values(0.004 * np.arange(len(rows.values))), atol=1e-6)


def test_rows_without_neighbours_are_listed():
    data = values(DT * np.arange(10))
    data[[2, 4]] = np.nan
    rows = regular_rows(None, data, "x", dt=DT)
    assert [refused.rows for refused in rows.refused] == [(2, 4), (3,)]
    assert rows.starts.tolist() == [0, 2]
    assert len(rows.values) == 7
    data[1::2] = np.nan
    with pytest.raises(InvalidValueError, match="nothing is left"):
        regular_rows(None, data, "x", dt=DT)
    with pytest.raises(InvalidValueError, match="say dt="):
        regular_rows(None, data, "x")
    with pytest.raises(InvalidValueError, match="right column"):
        regular_rows(-DT * np.arange(10), values(DT * np.arange(10)), "x")


def smooth_log(n=2, N=2000, **more):
    t = DT * np.arange(N)[:, None]
    j = np.arange(1, n + 1)
    q = np.sin(0.7 * j * t) + 0.3 * np.cos(1.1 * j * t)
    return Log(DT, q, 3.0 * np.cos(0.7 * j * t + 1.0), **more)


@pytest.mark.parametrize("delay", [0.04, -0.03, 0.0137, -0.0042])
def test_torques_are_moved_in_every_recording(delay):
    log = smooth_log(v=np.ones((2000, 2)), starts=(0, 700, 705))
    moved = with_delay(log, delay)
    cut = int(np.ceil(abs(delay) / DT - 1e-9))
    assert moved.delay == delay
    lengths = [700, 5, 1295]
    kept = [length - cut for length in lengths if length > cut + 1]
    assert np.diff([*moved.starts, len(moved)]).tolist() == kept
    lost = 5 if cut + 1 >= 5 else 0
    assert sum(len(rows.rows) for rows in moved.refused) == lost
    # where a position of the log stands, its torque is of that time and the delay
    first = 0 if delay > 0 else cut
    t = DT * (first + np.arange(kept[0]))[:, None]
    assert np.array_equal(moved.q[: kept[0]], log.q[first : first + kept[0]])
    expected = 3.0 * np.cos(0.7 * np.array([1, 2]) * (t + delay) + 1.0)
    inner = slice(5, -5)
    np.testing.assert_allclose(moved.tau[: kept[0]][inner], expected[inner], atol=1e-6)
    assert "delay were taken out" in moved.notes[-1]
    assert moved.v.shape == moved.q.shape
    assert with_delay(moved, delay).delay == 2.0 * delay


def test_delays_that_leave_nothing_are_refused():
    log = smooth_log(N=50)
    assert with_delay(log, 0.0) is log
    with pytest.raises(InvalidValueError, match="no recording is longer"):
        with_delay(log, 1.0)
    with pytest.raises(InvalidValueError, match="one number"):
        with_delay(log, [0.1, 0.2])
    with pytest.raises(InvalidValueError, match="delay"):
        with_delay(log, np.nan)


def test_slices_are_rows():
    log = smooth_log(starts=(0, 700))
    part = log[600:-100]
    assert np.array_equal(part.q, log.q[600:1900])
    assert part.starts.tolist() == [0, 100]
    assert len(log[:]) == len(log)
    assert len(log[slice(5, 10, 1)]) == 5
    for rows in (slice(0, 9000), slice(-9000, 10), slice(9000, 9001)):
        with pytest.raises(InvalidValueError, match="2000 rows"):
            log[rows]
    with pytest.raises(InvalidValueError, match="2000 rows"):
        log.rows(0, 2001)
    with pytest.raises(InvalidValueError, match="a step of 2"):
        log[::2]
    with pytest.raises(InvalidValueError, match="single samples"):
        log[3]


def test_joined_logs_keep_what_all_have():
    a, b = smooth_log(v=np.zeros((2000, 2)), notes=["a"]), smooth_log(N=100)
    log = join_logs([a, b])
    assert log.starts.tolist() == [0, 2000]
    assert log.v is None
    assert log.notes[0] == "a"
    assert "1 of 2 logs" in log.notes[1]
    assert join_logs([a, a]).v.shape == (4000, 2)
    lost = [RefusedRows(name, (3,), "no number") for name in "ab"]
    refused = [smooth_log(N=100, refused=[rows]) for rows in lost]
    assert list(join_logs(refused).refused) == lost
    with pytest.raises(InvalidValueError, match="delay were taken out"):
        join_logs([a, with_delay(a, 0.02)])
    with pytest.raises(ShapeError, match="joints"):
        join_logs([a, smooth_log(n=1)])


# --- checks --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def tx40():
    return load_tx40()


def kinds(log, model=None):
    return {finding.kind: finding for finding in check_log(log, model)}


def changed(log, **fields):
    arrays = {"q": np.array(log.q), "tau": np.array(log.tau)} | fields
    return Log(log.dt, **arrays, names=log.names)


def test_a_good_log_has_no_findings(tx40):
    assert check_log(tx40.log, tx40.model) == ()
    assert check_log(smooth_log()) == ()


@pytest.mark.parametrize(
    ("kind", "severity", "words", "change"),
    [
        ("POSITIONS_IN_DEGREES", "USELESS", "angles='deg'", lambda d: {"q": np.degrees(d.log.q)}),
        ("MOTOR_SIDE_POSITIONS", "USELESS", "transmission=model.transmission",
         lambda d: {"q": d.motor_positions}),
        ("OUTSIDE_LIMITS", "DOUBTFUL", "joint_2",
         lambda d: {"q": d.log.q + np.array([0, 2.5, 0, 0, 0, 0])}),
        ("TORQUE_ABOVE_LIMITS", "USELESS", "gear ratios", lambda d: {"tau": 1000.0 * d.log.tau}),
        ("TORQUE_BELOW_USE", "DOUBTFUL", "kN m", lambda d: {"tau": 1e-6 * d.log.tau}),
        ("CONSTANT_POSITION", "DOUBTFUL", "joint_3: it stays at",
         lambda d: {"q": d.log.q * [1, 1, 0, 1, 1, 1]}),
        ("CONSTANT_TORQUE", "USELESS", "joint_4: its torque is 0",
         lambda d: {"tau": d.log.tau * [1, 1, 1, 0, 1, 1]}),
        ("NOTHING_MOVES", "USELESS", "No joint moves", lambda d: {"q": 0.0 * d.log.q}),
        ("SATURATED", "DOUBTFUL", "the largest one", lambda d: {"tau": np.minimum(
            d.log.tau, np.quantile(d.log.tau, 0.93, axis=0))}),
        ("QUANTISED", "DOUBTFUL", "steps of 0.1", lambda d: {"q": np.round(d.log.q, 1)}),
        ("JUMP", "DOUBTFUL", "numpy.unwrap", lambda d: {"q": np.where(
            np.arange(45000)[:, None] >= 20000, d.log.q + 2 * np.pi, d.log.q)}),
        ("TOO_FAST", "DOUBTFUL", "velocities", lambda d: {
            "q": d.log.q + np.random.default_rng(0).normal(0, 0.01, (45000, 6))}),
        ("STUCK", "DOUBTFUL", "recorder is faster", lambda d: {
            "q": np.repeat(d.log.q[:9000], 5, axis=0),
            "tau": np.repeat(d.log.tau[:9000], 5, axis=0)}),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(tx40, kind, severity, words, change):
    found = kinds(changed(tx40.log, **change(tx40)), tx40.model)
    finding = found[FindingKind[kind]]
    assert finding.severity is Severity[severity]
    assert words in finding.sentence
    assert str(finding) == finding.sentence


def test_motor_angles_of_a_robot_without_transmission_are_named(tx40):
    model = rm.RobotModel.from_table(tx40.model.table)
    log = changed(tx40.log, q=20.0 * tx40.motor_positions)
    assert "gears= or transmission=" in kinds(log, model)[FindingKind.MOTOR_SIDE_POSITIONS].sentence


def test_a_sensor_that_stops_is_named(tx40):
    v = np.abs(np.diff(tx40.log.q[:, 0]))
    row = int(np.argmax(v[1000:40000])) + 1000
    q = np.array(tx40.log.q)
    q[row : row + 120, 0] = q[row, 0]
    finding = kinds(changed(tx40.log, q=q))[FindingKind.STUCK]
    assert finding.joints == ("joint_1",)
    assert f"for 120 samples from row {row}" in finding.sentence


def test_joints_that_rest_between_moves_have_not_stopped():
    rng = np.random.default_rng(2)
    corners = np.cumsum(rng.normal(size=(9, 3)), axis=0)
    for dt, step in ((0.001, 0.0), (0.01, 0.0), (0.004, 1e-3), (0.004, 1e-5)):
        parts = []
        for a, b in pairwise(corners):  # as long at rest as in motion
            s = np.clip(np.arange(0.0, 2.0, dt), 0.0, 1.0)[:, None]
            ramp = np.where(s < 0.5, 2.0 * s**2, 1.0 - 2.0 * (1.0 - s) ** 2)
            parts.append(a + (b - a) * ramp)
        q = np.concatenate(parts)
        q = np.round(q / step) * step if step else q
        tau = np.gradient(np.gradient(q, dt, axis=0), dt, axis=0) + rng.normal(size=q.shape)
        assert not {FindingKind.STUCK, FindingKind.SPIKES} & set(kinds(Log(dt, q, tau)))
        stopped = np.array(q)
        row = int(0.5 / dt) + 7
        stopped[row:, 1] = stopped[row, 1]  # for good
        if step < 1e-3:
            assert kinds(Log(dt, stopped, tau))[FindingKind.STUCK].joints == ("2",)


def test_short_and_one_way_logs_are_named(tx40):
    some = kinds(tx40.log.rows(0, 10), tx40.model)
    assert some[FindingKind.TOO_SHORT].severity is Severity.USELESS
    assert (
        kinds(tx40.log.rows(0, 60), tx40.model)[FindingKind.TOO_SHORT].severity is Severity.DOUBTFUL
    )
    t = np.linspace(0.0, 1.0, 500)[:, None]
    rng = np.random.default_rng(0)
    one_way = kinds(Log(0.002, t + rng.normal(0, 1e-4, (500, 1)), t))
    assert "one way only" in one_way[FindingKind.SLOWER_THAN_LOG].sentence
    assert FindingKind.SLOWER_THAN_LOG not in kinds(Log(0.002, np.sin(7 * t), t))


def test_other_robots_are_named(tx40):
    found = check_log(tx40.log, rm.load("panda"))
    assert [finding.kind for finding in found] == [FindingKind.WRONG_JOINT_COUNT]
    assert "6 joints, panda has 7" in found[0].sentence


def test_the_worst_is_said_first(tx40):
    log = changed(
        tx40.log, q=tx40.log.q * [1, 1, 0, 1, 1, 1], tau=tx40.log.tau * [1, 1, 1, 0, 1, 1]
    )
    severities = [finding.severity for finding in check_log(log, tx40.model)]
    assert severities[0] is Severity.USELESS
    assert severities[-1] is Severity.DOUBTFUL


def test_what_is_no_log_is_said(tx40):
    with pytest.raises(InvalidValueError, match=r"got Tx40Log; give its \.log"):
        check_log(tx40, tx40.model)
    with pytest.raises(InvalidValueError, match="got ndarray; make one"):
        check_log(tx40.log.q)


def test_joints_in_another_order_are_named(tx40):
    order = [0, 2, 1, 3, 4, 5]
    names = [tx40.log.names[j] for j in order]
    log = Log(tx40.log.dt, tx40.log.q[:, order], tx40.log.tau[:, order], names=names)
    finding = kinds(log, tx40.model)[FindingKind.WRONG_JOINT_ORDER]
    assert finding.severity is Severity.USELESS
    assert finding.joints == ("joint_3", "joint_2")
    assert "model= to read_log" in finding.sentence
    # names that are not the model's say nothing
    other = Log(tx40.log.dt, tx40.log.q, tx40.log.tau, names="abcdef")
    assert check_log(other, tx40.model) == ()


def test_milliseconds_as_seconds_are_named(tx40):
    log = Log(1.0, tx40.log.q, tx40.log.tau)
    finding = kinds(log)[FindingKind.IMPLAUSIBLE_PERIOD]
    assert finding.severity is Severity.USELESS
    assert "milliseconds" in finding.sentence


def rates(log):
    v = np.gradient(log.q, log.dt, axis=0)
    return v, np.gradient(v, log.dt, axis=0)


def off(log):
    return [f for f in check_log(log) if f.kind is FindingKind.RATES_OFF_POSITIONS]


def test_rates_of_the_positions_are_not_named(tx40):
    v, a = rates(tx40.log)
    rng = np.random.default_rng(0)
    for q, w in ((tx40.log.q, v), (tx40.log.q + rng.normal(0, 1e-4, v.shape), v),
                 (tx40.log.q, v + rng.normal(0, 0.1, v.shape))):  # fmt: skip
        log = Log(tx40.log.dt, q, tx40.log.tau, w, a, starts=(0, 3, 5, 200, 20000))
        assert off(log) == []
    still = np.full((500, 1), 0.3) + rng.normal(0, 1e-6, (500, 1))
    assert off(Log(DT, still, still, rng.normal(0, 1e-3, (500, 1)))) == []
    assert off(Log(DT, np.ones((2, 1)), np.ones((2, 1)), np.ones((2, 1)), np.ones((2, 1)))) == []


@pytest.mark.parametrize("name", ["v", "a"])
@pytest.mark.parametrize(
    ("factor", "joints", "words"),
    [
        ([180 / np.pi] * 6, 6, "57.3 times what their positions say, that is degrees"),
        ([1, 1, -1, 1, 1, 1], 1, "of the other sign"),
        ([1, 48, 1, 1, 1, 1], 1, "may be a gear ratio"),
        ([1, 1, 1, 1, 1, 1.2], 1, "1.2 times"),
    ],
)
def test_rates_by_a_factor_are_named(tx40, name, factor, joints, words):
    both = dict(zip("va", rates(tx40.log), strict=True))
    both[name] = both[name] * factor
    (finding,) = off(Log(tx40.log.dt, tx40.log.q, tx40.log.tau, **both))
    assert finding.severity is Severity.USELESS
    assert len(finding.joints) == joints
    assert words in finding.sentence


def test_rates_of_another_period_and_of_other_joints_are_named(tx40):
    v, a = rates(tx40.log)
    found = off(Log(2.0 * tx40.log.dt, tx40.log.q, tx40.log.tau, v, a))
    assert [len(finding.joints) for finding in found] == [6, 6]
    assert all("period may be 2 times the true one" in finding.sentence for finding in found)
    (finding,) = off(Log(tx40.log.dt, tx40.log.q, tx40.log.tau, v[:, [1, 0, 2, 3, 4, 5]]))
    assert finding.severity is Severity.DOUBTFUL
    assert finding.joints == ("1", "2")
    assert "do not follow" in finding.sentence

"""Logs from files: every format, unit and shape of table, and every refusal."""

import hashlib
import sys

import numpy as np
import pytest
from scipy.io import savemat

import robotmodels as rm
from robotmodels.datasets import load_tx40
from robotmodels.errors import InvalidValueError, MissingExtraError, ShapeError
from robotmodels.logs import read_log

N, n = 60, 3
DT = 0.01


def samples(seed=0):
    rng = np.random.default_rng(seed)
    return DT * np.arange(N), rng.normal(size=(N, n)), rng.normal(size=(N, n))


def write(path, header, *columns, delimiter=","):
    rows = np.column_stack(columns)
    lines = [delimiter.join(repr(float(x)) for x in row) for row in rows]
    head = [delimiter.join(header)] if header else []
    path.write_text("\n".join([*head, *lines]) + "\n", encoding="utf-8")
    return path


NUMBERED = ["t", *(f"q{j + 1}" for j in range(n)), *(f"tau{j + 1}" for j in range(n))]


@pytest.fixture
def file(tmp_path):
    return write(tmp_path / "run.csv", NUMBERED, *samples())


@pytest.mark.parametrize("seed", range(4))
def test_any_table_of_numbers_is_read_as_it_is(tmp_path, seed):
    # delimiters, shuffled columns, other columns, with and without a header, odd magnitudes
    rng = np.random.default_rng(seed)
    delimiter = [",", ";", "\t", " "][seed % 4]
    joints = int(rng.integers(1, 8))
    rows = int(rng.integers(2, 40))
    columns = {"clock": np.arange(rows) * DT}
    for j in range(joints):
        columns[f"q{j}"] = rng.normal(size=rows) * 10.0 ** rng.integers(-12, 1)
        columns[f"tau{j}"] = rng.normal(size=rows) * 10.0 ** rng.integers(-12, 13)
    columns["other"] = rng.normal(size=rows)
    order = rng.permutation(list(columns)).tolist()
    header = order if rng.integers(2) else None
    path = write(tmp_path / "x.txt", header, *(columns[key] for key in order), delimiter=delimiter)
    given = (lambda key: key) if header else order.index
    log = read_log(
        path, positions=[given(f"q{j}") for j in range(joints)],
        torques=[given(f"tau{j}") for j in range(joints)], time=given("clock"),
    )  # fmt: skip
    assert np.array_equal(log.q, np.column_stack([columns[f"q{j}"] for j in range(joints)]))
    assert np.array_equal(log.tau, np.column_stack([columns[f"tau{j}"] for j in range(joints)]))
    if header and rows > 1:
        found = read_log(path, time="clock")
        assert np.array_equal(found.q, log.q)
        assert np.array_equal(found.tau, log.tau)


def same(log, q, tau):
    return np.array_equal(log.q, q) and np.array_equal(log.tau, tau)


def test_npz_round_trip_with_all_quantities(tmp_path):
    t, q, tau = samples()
    names = ("v", "a", "q_ref", "v_ref")
    more = {name: np.random.default_rng(k).normal(size=(N, n)) for k, name in enumerate(names, 1)}
    np.savez(tmp_path / "run.npz", t=t, q=q, tau=tau, unrelated=np.arange(4), **more)
    log = read_log(tmp_path / "run.npz")
    assert same(log, q, tau)
    for name, values in more.items():
        assert np.array_equal(getattr(log, name), values)
    assert read_log(tmp_path / "run.npz", velocities=False).v is None
    other = read_log(tmp_path / "run.npz", positions="q", torques="v", velocities=False)
    assert np.array_equal(other.tau, more["v"])


@pytest.mark.parametrize("turned", [False, True])
def test_mat_files_and_structures_beside_other_arrays(tmp_path, turned):
    t, q, tau = samples()
    cells = np.empty((1, 2), dtype=object)
    cells[0] = [np.eye(3), "note"]
    other = {
        "settings": {"gains": np.eye(4), "axes": cells, "deep": {"map": np.ones((7, 5 * N))}},
        "several": np.array([(1.0,), (2.0,)], dtype=[("q", "f8")]),
        "cube": np.ones((2, 3, 4)),
        "table": np.ones((9 * N, 2)),
        "wide": np.ones((4, 3 * N)),
    }
    file = tmp_path / "run.mat"
    x, y = (q.T, tau.T) if turned else (q, tau)
    savemat(file, {"run": {"arm": {"q": x, "tau": y}, "time": t}, **other})
    asked = {"positions": "run.arm.q", "torques": "run.arm.tau", "time": "run.time"}
    log = read_log(file, **asked)
    assert same(log, q, tau)
    assert log.dt == pytest.approx(DT)
    with pytest.raises(InvalidValueError, match=f"have {N}, {9 * N} samples; give times"):
        read_log(file, **asked | {"time": "table[0]"})
    # by their usual names, within a structure and beside arrays of other lengths
    savemat(file, {"log": {"q": x, "tau": y}, "time": t, **other})
    assert same(read_log(file), q, tau)


def test_mappings_of_columns_are_read_like_files():
    t, q, tau = samples()
    columns = {"t": t} | {f"q{j}": x for j, x in enumerate(q.T)}
    log = read_log(columns | {f"tau{j}": x for j, x in enumerate(tau.T)})
    assert same(log, q, tau)
    (source,) = log.sources
    assert (source.name, source.rows, len(source.sha256)) == ("arrays", N, 64)


def test_parquet_round_trip_with_columns_lists_and_stamps(tmp_path, monkeypatch):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    t, q, tau = samples()
    flat = {f"q{j}": q[:, j] for j in range(n)} | {f"effort_{j}": tau[:, j] for j in range(n)}
    pq.write_table(pa.table({"time": t, "on": [True] * N, **flat}), tmp_path / "flat.parquet")
    assert same(read_log(tmp_path / "flat.parquet"), q, tau)
    stamps = pa.array((t * 1e9).round().astype("int64")).cast(pa.timestamp("ns"))
    lists = {"stamp": stamps, "name": [["a", "b", "c"]] * N, "position": q.tolist()}
    pq.write_table(pa.table({**lists, "effort": tau.tolist()}), tmp_path / "ros.parquet")
    log = read_log(tmp_path / "ros.parquet", times="ns")
    assert same(log, q, tau)
    assert log.names == ("a", "b", "c")
    assert log.dt == pytest.approx(DT, rel=1e-9)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'robotmodels\[logs\]'"):
        read_log(tmp_path / "flat.parquet")


JOINTS = ("j1", "j2", "j3")


def ros_table(path, shape):
    """A CSV file as a tool of ROS writes it."""
    t, q, tau = samples()
    stamps = (1_600_000_000_000_000_000 + (t * 1e9).round().astype(np.int64)).tolist()
    if shape == "rostopic":
        head = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
        head += [f"field.{k}{j}" for k in ("name", "position", "effort") for j in range(n)]
        rows = [[s + 777, i, s, "base", *JOINTS, *q[i], *tau[i]] for i, s in enumerate(stamps)]
    elif shape == "lists":
        head = ["Time", "header.stamp.secs", "header.stamp.nsecs", "name", "position", "velocity"]
        head += ["effort"]
        rows = [
            [s / 1e9, s // 10**9, s % 10**9, f'"{list(JOINTS)}"', f'"{q[i].tolist()}"', '"()"',
             f'"{tuple(tau[i].tolist())}"']
            for i, s in enumerate(stamps)
        ]  # fmt: skip
    elif shape == "plotjuggler":
        head = [f"/joint_states/{j}/{k}" for k in ("effort", "position") for j in JOINTS]
        rows = np.column_stack((t, tau, q)).tolist()
        head = ["__time", *head]
    else:
        head = [f"/joint_states/{k}[{j}]" for k in ("position", "effort") for j in range(n)]
        rows = np.column_stack((t, q, tau)).tolist()
        head = ["__time", *head]
    path.write_text("\n".join(",".join(map(str, row)) for row in [head, *rows]) + "\n")
    return path, q, tau


@pytest.mark.parametrize("shape", ["rostopic", "lists", "plotjuggler", "plotjuggler arrays"])
def test_tables_of_ros(tmp_path, shape):
    path, q, tau = ros_table(tmp_path / "ros.csv", shape)
    log = read_log(path)
    assert same(log, q, tau)
    assert log.dt == pytest.approx(DT, rel=1e-6)
    assert len(log.starts) == 1
    assert not log.refused
    if shape != "plotjuggler arrays":
        assert log.names == JOINTS


def test_joints_of_ros_are_put_in_the_order_asked_for(tmp_path):
    path, q, tau = ros_table(tmp_path / "ros.csv", "rostopic")
    log = read_log(path, joints=["j3", "j1"])
    assert log.names == ("j3", "j1")
    assert same(log, q[:, [2, 0]], tau[:, [2, 0]])
    other, q, _ = ros_table(tmp_path / "pj.csv", "plotjuggler")
    assert np.array_equal(read_log(other, joints=["j2", "j3", "j1"]).q, q[:, [1, 2, 0]])
    for name in (other, path):
        with pytest.raises(InvalidValueError, match=r"expected j1, j2, j9; .*joints are j1, j2"):
            read_log(name, joints=["j1", "j2", "j9"])


def test_torques_whose_joints_stand_in_another_order_are_put_in_that_of_the_positions(tmp_path):
    t, q, tau = samples()
    order = [1, 2, 0]
    head = [f"position/{j}" for j in JOINTS] + [f"effort/{JOINTS[k]}" for k in order]
    log = read_log(write(tmp_path / "log.csv", ["time", *head], t, q, tau[:, order]))
    assert log.names == JOINTS
    assert same(log, q, tau)


def test_units_gears_signs_gains_and_offsets(file):
    _, q, tau = samples()
    log = read_log(
        file, angles="deg", signs=[1, -1, 1], gears=[10.0, 20.0, -30.0], drive_gains=0.5,
        offsets=[0.0, 0.1, 0.0],
    )  # fmt: skip
    expected = np.radians(q) * [1, -1, 1] / [10.0, 20.0, -30.0] + [0.0, 0.1, 0.0]
    np.testing.assert_allclose(log.q, expected, rtol=1e-14, atol=1e-16)
    np.testing.assert_allclose(log.tau, 0.5 * tau * [1, -1, 1] * [10.0, 20.0, -30.0], rtol=1e-14)


def test_transmission_keeps_the_work_and_moves_references_with_its_zero(tmp_path):
    t, q, tau = samples()
    path = write(
        tmp_path / "x.csv", [*NUMBERED, "dq1", "dq2", "dq3", "q_ref1", "q_ref2", "q_ref3"],
        t, q, tau, q + 1.0, q + 2.0,
    )  # fmt: skip
    K = rm.Transmission([[0.5, 0, 0], [0.1, 0.2, 0], [0, 0, -1]], [0.3, 0.0, 0.0])
    log = read_log(path, transmission=K)
    np.testing.assert_allclose(log.q, K.to_joint(q))
    np.testing.assert_allclose(log.tau @ K.matrix, tau)
    np.testing.assert_allclose(log.v, (q + 1.0) @ K.matrix.T)
    np.testing.assert_allclose(log.q_ref, K.to_joint(q + 2.0))
    with pytest.raises(InvalidValueError, match="gears, transmission"):
        read_log(path, transmission=K, gears=2.0)


def test_lengths_are_of_prismatic_joints(file):
    table = rm.DHTable(antecedent=[0, 1, 2], sigma=[0, 1, 0])
    model = rm.RobotModel.from_table(table)
    log = read_log(file, model=model, angles="deg", lengths="mm")
    _, q, _ = samples()
    np.testing.assert_allclose(log.q, q * [np.pi / 180, 1e-3, np.pi / 180])
    assert log.names == model.table.joint_names


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)])
def test_units_of_time(tmp_path, unit, factor):
    t, q, tau = samples()
    path = write(tmp_path / "a.csv", NUMBERED, t / factor, q, tau)
    assert read_log(path, times=unit).dt == pytest.approx(DT)
    header = write(tmp_path / "b.csv", [f"time [{unit}]", *NUMBERED[1:]], t / factor, q, tau)
    assert read_log(header).dt == pytest.approx(DT)
    with pytest.raises(InvalidValueError, match=f"header has times in '{unit}'"):
        read_log(header, times="s" if unit == "ms" else "ms")


@pytest.mark.parametrize(
    ("position", "torque", "reference"),
    [
        ("joint_positions[{}]", "joint_torques[{}]", "desired_positions[{}]"),
        ("actual_q_{}", "actual_current_{}", "target_q_{}"),
        ("Q_meas{}", "Tau_meas{}", "Q_ref{}"),
        ("arm_{}_pos", "effort_arm_{}", "arm_{}_pos_ref"),
    ],
)
def test_usual_names_are_found(tmp_path, position, torque, reference):
    t, q, tau = samples()
    head = [name.format(j) for name in (reference, torque, position) for j in (1, 2, 3)]
    path = write(tmp_path / "run.csv", [*head, "Time [ms]"], q + 1.0, tau, q, 1e3 * t)
    names = [f"arm_{j}" for j in (1, 2, 3)] if "arm" in position else None
    log = read_log(path, drive_gains=1.0, joints=names)
    assert same(log, q, tau)
    assert np.array_equal(log.q_ref, q + 1.0)
    if names is not None:
        turned = read_log(path, drive_gains=1.0, joints=names[::-1])
        assert same(turned, q[:, ::-1], tau[:, ::-1])
    else:  # by patterns, in the order of their numbers
        stars = {"positions": position.format("*"), "torques": torque.format("*")}
        assert same(read_log(path, time="Time [ms]", drive_gains=1.0, **stars), q, tau)


@pytest.mark.parametrize(
    ("name", "factor"), [("time_ms", 1e3), ("t_us", 1e6), ("Timestamp_ns", 1e9), ("elapsed_sec", 1)]
)
def test_a_unit_at_the_end_of_the_name_of_the_time_is_its_unit(tmp_path, name, factor):
    t, q, tau = samples()
    head = [f"{kind}{j}" for kind in ("q", "tau") for j in (1, 2, 3)]
    path = write(tmp_path / "run.csv", [*head, name], q, tau, factor * t)
    assert same(read_log(path), q, tau)
    assert same(read_log(path, time=name), q, tau)


def test_rows_that_lack_a_number_are_listed_and_split_the_log(tmp_path):
    lines = ["t,q1,tau1", *(f"{DT * i:.2f},{i},1" for i in range(20))]
    lines[6], lines[11], lines[12] = "0.05,nan,1", "0.10,10,", "0.11,11,inf"
    (tmp_path / "a.csv").write_text("\n".join(lines))
    log = read_log(tmp_path / "a.csv")
    (refused,) = log.refused
    assert refused.rows == (5, 10, 11)
    assert refused.source == "a.csv"
    assert log.starts.tolist() == [0, 5, 9]
    assert log.q.ravel().tolist() == [*range(5), *range(6, 10), *range(12, 20)]
    assert any("3 of 20 rows were left out" in note for note in log.notes)


def test_torques_of_another_file_by_time(tmp_path):
    t = np.arange(0.0, 2.0, DT)
    late = np.arange(0.1037, 1.9, 0.004)
    late = late[(late < 1.0) | (late > 1.1)]
    a = write(tmp_path / "a.csv", ["t", "q1"], t, t)
    b = write(tmp_path / "b.csv", ["t", "tau1"], late, np.sin(5.0 * late))
    log = read_log(a, torques_from=b)
    np.testing.assert_allclose(log.tau, np.sin(5.0 * log.q), atol=1e-7)
    assert len(log.starts) == 2
    (refused,) = log.refused
    lost = t[list(refused.rows)]
    assert ((lost < 0.1037) | (lost > 1.89) | ((lost > 0.99) & (lost < 1.11))).all()
    assert len(log) + len(lost) == len(t)
    c = write(tmp_path / "c.csv", ["t", "tau1"], late[::-1], late)
    with pytest.raises(InvalidValueError, match="go back or repeat"):
        read_log(a, torques_from=c)


def test_several_files_are_several_recordings(tmp_path):
    t, q, tau = samples()
    files = [write(tmp_path / f"{k}.csv", NUMBERED, t, q + k, tau) for k in range(3)]
    log = read_log(files)
    assert log.starts.tolist() == [0, N, 2 * N]
    assert [source.name for source in log.sources] == ["0.csv", "1.csv", "2.csv"]
    assert log.sources[0].sha256 == hashlib.sha256(files[0].read_bytes()).hexdigest()
    assert np.array_equal(log.q[N : 2 * N], q + 1)
    slower = write(tmp_path / "slow.csv", NUMBERED, 2 * t, q, tau)
    with pytest.raises(InvalidValueError, match=r"number 1 is sampled every 0\.02 s.*dt="):
        read_log([files[0], slower])
    assert len(read_log([files[0], slower], dt=DT)) == N + 2 * N - 1


def test_the_tx40_is_read_from_two_files_by_row(tmp_path):
    data = load_tx40()
    rows = slice(0, 200)
    head = [f"Joint_{j}" for j in range(1, 7)]
    a = write(tmp_path / "pos.csv", head, data.motor_positions[rows])
    b = write(tmp_path / "curr.csv", head, data.motor_torques[rows])
    given = {"torques_from": b, "dt": 2e-4, "model": data.model}
    log = read_log(a, transmission=data.model.transmission, **given)
    np.testing.assert_allclose(log.q, data.log.q[rows], rtol=0, atol=1e-15)
    np.testing.assert_allclose(log.tau, data.log.tau[rows], rtol=1e-14, atol=1e-13)
    assert (log.names, len(log.sources)) == (data.log.names, 2)
    assert any("give transmission=model" in note for note in read_log(a, **given).notes)


# --- mistakes ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"positions": "q*", "torques": "q*"}, "q1 of .* would be positions and torques at once"),
        ({"positions": ["t", "q1", "q2"]}, "t of .* would be time and positions at once"),
        ({"positions": ["q1", "q2", "nope"]}, "no column 'nope'. Its columns: t"),
        ({"positions": [1, 2]}, "3 columns.*for 2 columns of positions"),
        ({"signs": [1, 2, 1]}, "expected 1 or -1"),
        ({"gears": [1.0, 0.0, 1.0]}, "other than zero"),
        ({"dt": -1.0}, "dt: expected a finite number"),
        ({"joints": ["a"]}, "3 columns.*but 1 joints"),
        ({"time": False}, "no column of times"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(file, given, words):
    with pytest.raises((InvalidValueError, ShapeError), match=words):
        read_log(file, **given)


@pytest.mark.parametrize(
    ("head", "words"),
    [
        (["t", "u", "w", "x", *NUMBERED[4:]], "positions: no columns of .*usual name"),
        (["t", "q1", "q2", "q4", *NUMBERED[4:]], "without gaps"),
        (["t", "a.q1", "b.q1", "q2", *NUMBERED[4:]], "several candidates"),
        ([*NUMBERED[:4], "current1", "current2", "current3"], "has currents .* give drive_gains="),
        (["t", *(f"q{j} [deg]" for j in "123"), *NUMBERED[4:]], "'deg', the argument is angles="),
        (
            ["t", *(f"q{j} [rev]" for j in "123"), *NUMBERED[4:]],
            "'rev', the argument is angles='rad'; expected",
        ),
        ([*NUMBERED[:4], *(f"tau{j} (lbf-ft)" for j in "123")], "not in N m; give drive_gains="),
        ([*NUMBERED[:4], *(f"tau{j} (N*m)" for j in "123")], None),
    ],
)
def test_headers_that_cannot_be_read_are_refused(tmp_path, head, words):
    t, q, tau = samples()
    path = write(tmp_path / "odd.csv", head, t, q, tau)
    if words is not None:
        with pytest.raises(InvalidValueError, match=words):
            read_log(path)
        path = write(tmp_path / "bare.csv", None, t, q, tau)
    given = {"time": 0, "positions": [1, 2, 3], "torques": [4, 5, 6]}
    assert same(read_log(path, **given), q, tau)


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.npz", b"q1,tau1\n", r"a\.npz: this is no NPZ.*without objects"),
        ("a.mat", b"MATLAB 7.3 MAT-file" + b" " * 200, r"a\.mat: this is no MAT.*'-v7'"),
        ("a.parquet", b"PAR1 no", "no Parquet"),
        ("a.csv", b"t;q1;tau1\n0;0;1\n1;abc;1", "line 3.*'abc', not a number"),
        ("a.csv", b"t;q1;tau1\n0;0;1\n1;1", r"line 3: expected 3 columns.*got 2"),
    ],
)
def test_damaged_and_missing_files_are_refused(tmp_path, name, data, words):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InvalidValueError, match=words):
        read_log(tmp_path / name)
    for path, words in ((tmp_path, "is a folder"), ([], "got none")):
        with pytest.raises(InvalidValueError, match=words):
            read_log(path)
    with pytest.raises(FileNotFoundError, match=rf"there is no such file.*{name}"):
        read_log(tmp_path / f"x{name}")

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

N, n, DT = 60, 3, 0.01
NUMBERED = ["t", *(f"q{j + 1}" for j in range(n)), *(f"tau{j + 1}" for j in range(n))]


def samples(seed=0):
    rng = np.random.default_rng(seed)
    return DT * np.arange(N), rng.normal(size=(N, n)), rng.normal(size=(N, n))


def columns(header, *blocks):
    """Columns by name, as a mapping that `read_log` takes like a file."""
    return dict(zip(header, np.column_stack(blocks).T, strict=True))


def write(path, header, *blocks, delimiter=","):
    lines = [delimiter.join(repr(float(x)) for x in row) for row in np.column_stack(blocks)]
    head = [delimiter.join(header)] if header else []
    path.write_text("\n".join([*head, *lines]) + "\n", encoding="utf-8")
    return path


def same(log, q, tau):
    return np.array_equal(log.q, q) and np.array_equal(log.tau, tau)


# --- formats -------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_any_table_of_numbers_is_read_as_it_is(tmp_path, seed):
    # delimiters, shuffled columns, other columns, with and without a header, odd magnitudes
    rng = np.random.default_rng(seed)
    delimiter, joints, rows = [",", ";", "\t", " "][seed], rng.integers(1, 8), rng.integers(2, 40)
    q, tau = (rng.normal(size=(rows, joints)) * 10.0 ** rng.integers(-12, 9) for _ in range(2))
    order = rng.permutation(2 * joints + 2)
    names = [*(f"{kind}{j}" for kind in ("q", "tau") for j in range(joints)), "clock", "other"]
    header = [names[k] for k in order] if seed % 2 else None
    data = np.column_stack((q, tau, DT * np.arange(rows), rng.normal(size=rows)))[:, order]
    path = write(tmp_path / "x.txt", header, data, delimiter=delimiter)
    at = names if header else np.argsort(order).tolist()
    choice = {"positions": at[:joints], "torques": at[joints:-2], "time": at[-2]}
    assert same(read_log(path, **choice), q, tau)
    if header:
        assert same(read_log(path, time="clock"), q, tau)


@pytest.mark.parametrize("suffix", ["csv", "npz", "mat", "parquet", "mapping"])
def test_every_format_holds_every_quantity(tmp_path, monkeypatch, suffix):
    t, *blocks = samples()
    kinds = ("q", "tau", "v", "a", "q_ref", "v_ref")
    blocks += [np.random.default_rng(k).normal(size=(N, n)) for k in range(4)]
    header = ["t", *(f"{kind}{j}" for kind in kinds for j in range(n))]
    path, arrays = tmp_path / f"run.{suffix}", {"t": t} | dict(zip(kinds, blocks, strict=True))
    if suffix == "csv":
        write(path, header, t, *blocks)
    elif suffix == "npz":
        np.savez(path, unrelated=np.arange(4), **arrays)
    elif suffix == "mat":
        savemat(path, arrays)
    elif suffix == "parquet":
        pa = pytest.importorskip("pyarrow")
        import pyarrow.parquet as pq

        flat = columns(header, t, *blocks) | {"on": [True] * N}
        pq.write_table(pa.table(flat), path)
        stamps = pa.array((t * 1e9).round().astype("int64")).cast(pa.timestamp("ns"))
        lists = {"stamp": stamps, "name": [["a", "b", "c"]] * N, "position": blocks[0].tolist()}
        ros = tmp_path / "ros.parquet"
        pq.write_table(pa.table({**lists, "effort": blocks[1].tolist()}), ros)
        log = read_log(ros, times="ns")
        assert same(log, *blocks[:2])
        assert log.names == ("a", "b", "c")
        assert log.dt == pytest.approx(DT, rel=1e-9)
    source = columns(header, t, *blocks) if suffix == "mapping" else path
    log = read_log(source)
    for kind, block in zip(kinds, blocks, strict=True):
        assert np.array_equal(getattr(log, kind), block)
    assert read_log(source, velocities=False).v is None
    assert (log.sources[0].rows, len(log.sources[0].sha256)) == (N, 64)
    if suffix == "parquet":
        for module in ("pyarrow", "pyarrow.parquet"):
            monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(MissingExtraError, match=r"pip install 'robotmodels\[logs\]'"):
            read_log(path)


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
    assert same(read_log(file, **asked), q, tau)
    with pytest.raises(InvalidValueError, match=f"have {N}, {9 * N} samples; give times"):
        read_log(file, **asked | {"time": "table[0]"})
    # by their usual names, within a structure and beside arrays of other lengths
    savemat(file, {"log": {"q": x, "tau": y}, "time": t, **other})
    assert same(read_log(file), q, tau)


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
        head = ["__time"]
        head += [f"/joint_states/{j}/{k}" for k in ("effort", "position") for j in JOINTS]
        rows = np.column_stack((t, tau, q)).tolist()
    else:
        head = ["__time"]
        head += [f"/joint_states/{k}[{j}]" for k in ("position", "effort") for j in range(n)]
        rows = np.column_stack((t, q, tau)).tolist()
    path.write_text("\n".join(",".join(map(str, row)) for row in [head, *rows]) + "\n")
    return path, q, tau


@pytest.mark.parametrize("shape", ["rostopic", "lists", "plotjuggler", "plotjuggler arrays"])
def test_tables_of_ros(tmp_path, shape):
    path, q, tau = ros_table(tmp_path / "ros.csv", shape)
    log = read_log(path)
    assert same(log, q, tau)
    assert log.dt == pytest.approx(DT, rel=1e-6)
    assert (len(log.starts), log.refused) == (1, ())
    if shape == "plotjuggler arrays":
        return
    assert log.names == JOINTS
    order = ["j3", "j1"] if shape == "rostopic" else ["j2", "j3", "j1"]
    log, at = read_log(path, joints=order), [JOINTS.index(j) for j in order]
    assert log.names == tuple(order)
    assert same(log, q[:, at], tau[:, at])
    with pytest.raises(InvalidValueError, match=r"expected j1, j2, j9; .*joints are j1, j2"):
        read_log(path, joints=["j1", "j2", "j9"])


def test_torques_whose_joints_stand_in_another_order_are_put_in_that_of_the_positions():
    t, q, tau = samples()
    order = [1, 2, 0]
    head = [f"position/{j}" for j in JOINTS] + [f"effort/{JOINTS[k]}" for k in order]
    log = read_log(columns(["time", *head], t, q, tau[:, order]))
    assert log.names == JOINTS
    assert same(log, q, tau)


@pytest.mark.parametrize(
    ("position", "torque", "reference"),
    [
        ("joint_positions[{}]", "joint_torques[{}]", "desired_positions[{}]"),
        ("actual_q_{}", "actual_current_{}", "target_q_{}"),
        ("Q_meas{}", "Tau_meas{}", "Q_ref{}"),
        ("arm_{}_pos", "effort_arm_{}", "arm_{}_pos_ref"),
    ],
)
def test_usual_names_are_found(position, torque, reference):
    t, q, tau = samples()
    head = [name.format(j) for name in (reference, torque, position) for j in (1, 2, 3)]
    table = columns([*head, "Time [ms]"], q + 1.0, tau, q, 1e3 * t)
    names = [f"arm_{j}" for j in (1, 2, 3)] if "arm" in position else None
    log = read_log(table, drive_gains=1.0, joints=names)
    assert same(log, q, tau)
    assert np.array_equal(log.q_ref, q + 1.0)
    if names is not None:
        turned = read_log(table, drive_gains=1.0, joints=names[::-1])
        assert same(turned, q[:, ::-1], tau[:, ::-1])
    else:  # by patterns, in the order of their numbers
        stars = {"positions": position.format("*"), "torques": torque.format("*")}
        assert same(read_log(table, time="Time [ms]", drive_gains=1.0, **stars), q, tau)


# --- units and sides -----------------------------------------------------------------------------


def test_units_gears_signs_gains_and_offsets():
    t, q, tau = samples()
    table = columns(NUMBERED, t, q, tau)
    log = read_log(
        table, angles="deg", signs=[1, -1, 1], gears=[10.0, 20.0, -30.0], drive_gains=0.5,
        offsets=[0.0, 0.1, 0.0],
    )  # fmt: skip
    expected = np.radians(q) * [1, -1, 1] / [10.0, 20.0, -30.0] + [0.0, 0.1, 0.0]
    np.testing.assert_allclose(log.q, expected, rtol=1e-14, atol=1e-16)
    np.testing.assert_allclose(log.tau, 0.5 * tau * [1, -1, 1] * [10.0, 20.0, -30.0], rtol=1e-14)
    # lengths are of prismatic joints
    model = rm.RobotModel.from_table(rm.DHTable(antecedent=[0, 1, 2], sigma=[0, 1, 0]))
    log = read_log(table, model=model, angles="deg", lengths="mm")
    np.testing.assert_allclose(log.q, q * [np.pi / 180, 1e-3, np.pi / 180])
    assert log.names == model.table.joint_names


def test_transmission_keeps_the_work_and_moves_references_with_its_zero():
    t, q, tau = samples()
    head = [*NUMBERED, "dq1", "dq2", "dq3", "q_ref1", "q_ref2", "q_ref3"]
    table = columns(head, t, q, tau, q + 1.0, q + 2.0)
    K = rm.Transmission([[0.5, 0, 0], [0.1, 0.2, 0], [0, 0, -1]], [0.3, 0.0, 0.0])
    log = read_log(table, transmission=K)
    np.testing.assert_allclose(log.q, K.to_joint(q))
    np.testing.assert_allclose(log.tau @ K.matrix, tau)
    np.testing.assert_allclose(log.v, (q + 1.0) @ K.matrix.T)
    np.testing.assert_allclose(log.q_ref, K.to_joint(q + 2.0))
    with pytest.raises(InvalidValueError, match="gears, transmission"):
        read_log(table, transmission=K, gears=2.0)


@pytest.mark.parametrize(
    ("name", "factor"),
    [("time [ms]", 1e3), ("time [us]", 1e6), ("t [ns]", 1e9), ("time_ms", 1e3), ("t_us", 1e6),
     ("Timestamp_ns", 1e9), ("elapsed_sec", 1)],
)  # fmt: skip
def test_units_of_time(name, factor):
    t, q, tau = samples()
    table = columns([name, *NUMBERED[1:]], factor * t, q, tau)
    unit = {1: "s", 1e3: "ms", 1e6: "us", 1e9: "ns"}[factor]
    for log in (read_log(table), read_log(table, time=name), read_log(table, times=unit)):
        assert same(log, q, tau)
        assert log.dt == pytest.approx(DT)
    assert read_log(columns(NUMBERED, factor * t, q, tau), times=unit).dt == pytest.approx(DT)
    with pytest.raises(InvalidValueError, match=f"header has times in '{unit}'"):
        read_log(table, times="s" if unit == "ms" else "ms")


# --- rows and files ------------------------------------------------------------------------------


def test_rows_that_lack_a_number_are_listed_and_split_the_log(tmp_path):
    lines = ["t,q1,tau1", *(f"{DT * i:.2f},{i},1" for i in range(20))]
    lines[6], lines[11], lines[12] = "0.05,nan,1", "0.10,10,", "0.11,11,inf"
    (tmp_path / "a.csv").write_text("\n".join(lines))
    log = read_log(tmp_path / "a.csv")
    (refused,) = log.refused
    assert (refused.rows, refused.source) == ((5, 10, 11), "a.csv")
    assert log.starts.tolist() == [0, 5, 9]
    assert log.q.ravel().tolist() == [*range(5), *range(6, 10), *range(12, 20)]
    assert any("3 of 20 rows were left out" in note for note in log.notes)


def test_torques_of_another_file_by_time():
    t = np.arange(0.0, 2.0, DT)
    late = np.arange(0.1037, 1.9, 0.004)
    late = late[(late < 1.0) | (late > 1.1)]
    positions = {"t": t, "q1": t}
    log = read_log(positions, torques_from={"t": late, "tau1": np.sin(5.0 * late)})
    np.testing.assert_allclose(log.tau, np.sin(5.0 * log.q), atol=1e-7)
    assert len(log.starts) == 2
    (refused,) = log.refused
    lost = t[list(refused.rows)]
    assert ((lost < 0.1037) | (lost > 1.89) | ((lost > 0.99) & (lost < 1.11))).all()
    assert len(log) + len(lost) == len(t)
    with pytest.raises(InvalidValueError, match="go back or repeat"):
        read_log(positions, torques_from={"t": late[::-1], "tau1": late})


def test_several_files_are_several_recordings(tmp_path):
    t, q, tau = samples()
    files = [write(tmp_path / f"{k}.csv", NUMBERED, t, q + k, tau) for k in range(3)]
    log = read_log(files)
    assert log.starts.tolist() == [0, N, 2 * N]
    assert [source.name for source in log.sources] == ["0.csv", "1.csv", "2.csv"]
    assert log.sources[0].sha256 == hashlib.sha256(files[0].read_bytes()).hexdigest()
    assert np.array_equal(log.q[N : 2 * N], q + 1)
    slower = columns(NUMBERED, 2 * t, q, tau)
    with pytest.raises(InvalidValueError, match=r"number 1 is sampled every 0\.02 s.*dt="):
        read_log([files[0], slower])
    assert len(read_log([files[0], slower], dt=DT)) == N + 2 * N - 1


def test_the_tx40_is_read_from_two_files_by_row(tmp_path):
    data = load_tx40()
    rows, head = slice(0, 200), [f"Joint_{j}" for j in range(1, 7)]
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
    ("head", "given", "words"),
    [
        ({}, {"positions": "q*", "torques": "q*"}, "q1 of .* would be positions and torques at"),
        ({}, {"positions": ["t", "q1", "q2"]}, "t of .* would be time and positions at once"),
        ({}, {"positions": ["q1", "q2", "nope"]}, "no column 'nope'. Its columns: t"),
        ({}, {"positions": [1, 2]}, "3 columns.*for 2 columns of positions"),
        ({}, {"signs": [1, 2, 1]}, "expected 1 or -1"),
        ({}, {"gears": [1.0, 0.0, 1.0]}, "other than zero"),
        ({}, {"dt": -1.0}, "dt: expected a finite number"),
        ({}, {"joints": ["a"]}, "3 columns.*but 1 joints"),
        ({}, {"time": False}, "no column of times"),
        ({1: "u", 2: "w", 3: "x"}, {}, "positions: no columns of .*usual name"),
        ({3: "q4"}, {}, "without gaps"),
        ({1: "a.q1", 2: "b.q1", 3: "q2"}, {}, "several candidates"),
        ({4: "current1", 5: "current2", 6: "current3"}, {}, "has currents .* give drive_gains="),
        ({1: "q1 [deg]"}, {}, "'deg', the argument is angles="),
        ({1: "q1 [rev]"}, {}, "'rev', the argument is angles='rad'; expected"),
        ({4: "tau1 (lbf-ft)"}, {}, "not in N m; give drive_gains="),
        ({4: "tau1 (N*m)"}, {}, None),
    ],
)
def test_columns_and_arguments_that_do_not_fit_are_refused(tmp_path, head, given, words):
    t, q, tau = samples()
    header = [head.get(k, name) for k, name in enumerate(NUMBERED)]
    table = columns(header, t, q, tau)
    if words is None:
        assert same(read_log(table), q, tau)
        return
    with pytest.raises((InvalidValueError, ShapeError), match=words):
        read_log(table, **given)
    if head:
        bare = write(tmp_path / "bare.csv", None, t, q, tau)
        assert same(read_log(bare, time=0, positions=[1, 2, 3], torques=[4, 5, 6]), q, tau)


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
    for path, said in ((tmp_path / name, words), (tmp_path, "is a folder"), ([], "got none")):
        with pytest.raises(InvalidValueError, match=said):
            read_log(path)
    with pytest.raises(FileNotFoundError, match=rf"there is no such file.*{name}"):
        read_log(tmp_path / f"x{name}")

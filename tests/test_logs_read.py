"""Logs from files: every format, unit and shape of table, and every refusal."""

import hashlib

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.datasets import load_tx40
from robotmodels.errors import InvalidValueError, MissingExtraError, ShapeError
from robotmodels.logs import LogFormat, join_logs, read_log

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


def test_names_are_found_and_said(file):
    _, q, tau = samples()
    log = read_log(file)
    assert np.array_equal(log.q, q)
    assert np.array_equal(log.tau, tau)
    assert log.dt == pytest.approx(DT, rel=1e-12)
    assert log.v is None
    (source,) = log.sources
    assert source.name == "run.csv"
    assert source.rows == N
    assert source.sha256 == hashlib.sha256(file.read_bytes()).hexdigest()
    assert any("times were found in t, s by default" in note for note in log.notes)
    assert any("positions were found in q1, q2, q3" in note for note in log.notes)
    assert any("torques were found in tau1, tau2, tau3" in note for note in log.notes)


@pytest.mark.parametrize("delimiter", ["", ", ", "tab"])
def test_a_delimiter_is_one_character(file, delimiter):
    with pytest.raises(InvalidValueError, match="delimiter: expected one character"):
        read_log(file, delimiter=delimiter)


@pytest.mark.parametrize("seed", range(12))
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


def test_npz_round_trip_with_all_quantities(tmp_path):
    t, q, tau = samples()
    more = {name: np.random.default_rng(k).normal(size=(N, n)) for k, name in enumerate(
        ("v", "a", "q_ref", "v_ref"), 1)}  # fmt: skip
    np.savez(tmp_path / "run.npz", t=t, q=q, tau=tau, unrelated=np.arange(4), **more)
    log = read_log(tmp_path / "run.npz")
    assert np.array_equal(log.q, q)
    assert np.array_equal(log.tau, tau)
    for name, values in more.items():
        assert np.array_equal(getattr(log, name), values)
    bare = read_log(tmp_path / "run.npz", velocities=False, accelerations=False)
    assert bare.v is None
    assert bare.a is None
    assert bare.q_ref is not None
    other = read_log(tmp_path / "run.npz", positions="q", torques="v", velocities=False)
    assert np.array_equal(other.tau, more["v"])


def test_arrays_with_a_row_for_each_joint_are_turned_and_noted(tmp_path):
    t, q, tau = samples()
    np.savez(tmp_path / "run.npz", t=t, q=q.T, tau=tau)
    log = read_log(tmp_path / "run.npz")
    assert np.array_equal(log.q, q)
    assert np.array_equal(log.tau, tau)
    assert "run.npz: q has shape (joints, samples) and was transposed." in log.notes
    # fewer samples than joints
    np.savez(tmp_path / "short.npz", t=t[:2], q=q[:2], tau=tau[:2])
    assert np.array_equal(read_log(tmp_path / "short.npz").q, q[:2])


def test_objects_and_other_files_are_no_npz(tmp_path):
    np.savez(tmp_path / "run.npz", q=np.array([{}], dtype=object))
    with pytest.raises(InvalidValueError, match="without objects"):
        read_log(tmp_path / "run.npz")
    (tmp_path / "text.npz").write_text("q1,tau1\n")
    with pytest.raises(InvalidValueError, match=r"text\.npz"):
        read_log(tmp_path / "text.npz")


def test_mat_round_trip_also_of_structures(tmp_path):
    from scipy.io import savemat

    t, q, tau = samples()
    savemat(tmp_path / "flat.mat", {"time": t, "q": q, "torque": tau})
    savemat(tmp_path / "deep.mat", {"log": {"time": t, "q": q, "torque": tau}})
    log = read_log(tmp_path / "flat.mat")
    assert np.array_equal(log.q, q)
    deep = read_log(tmp_path / "deep.mat", time="log.time", positions="log.q", torques="log.torque")
    assert np.array_equal(deep.tau, tau)
    assert np.array_equal(read_log(tmp_path / "deep.mat", dt=DT, time=False).tau, tau)


@pytest.mark.parametrize("turned", [False, True])
def test_of_a_mat_file_only_what_is_asked_for_is_read(tmp_path, turned):
    from scipy.io import savemat

    t, q, tau = samples()
    cells = np.empty((1, 2), dtype=object)
    cells[0] = [np.eye(3), "note"]
    rows = np.random.default_rng(0)
    other = {
        "settings": {"gains": np.eye(4), "axes": cells, "deep": {"map": np.ones((7, 5 * N))}},
        "several": np.array([(1.0,), (2.0,)], dtype=[("q", "f8")]),
        "cube": np.ones((2, 3, 4)),
        "table": rows.normal(size=(9 * N, 2)),
        "wide": rows.normal(size=(4, 3 * N)),
    }
    file = tmp_path / "run.mat"
    x, y = (q.T, tau.T) if turned else (q, tau)
    savemat(file, {"run": {"arm": {"q": x, "tau": y}, "time": t}, **other})
    asked = {"positions": "run.arm.q", "torques": "run.arm.tau", "time": "run.time"}
    log = read_log(file, **asked)
    assert np.array_equal(log.q, q)
    assert np.array_equal(log.tau, tau)
    assert log.dt == pytest.approx(DT)
    said = [note for note in log.notes if "was transposed" in note]
    assert len(said) == 2 * turned
    assert not any("settings" in note or "wide" in note for note in log.notes)
    with pytest.raises(InvalidValueError, match=f"have {N}, {9 * N} samples; give times"):
        read_log(file, **asked | {"time": "table[0]"})
    # by their usual names, too, beside arrays of other lengths
    savemat(file, {"q": x, "tau": y, "time": t, **other})
    assert np.array_equal(read_log(file).tau, tau)


def test_mat_of_version_73_says_what_to_do(tmp_path):
    (tmp_path / "new.mat").write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + b" " * 200)
    with pytest.raises(InvalidValueError, match="'-v7'"):
        read_log(tmp_path / "new.mat")
    (tmp_path / "none.mat").write_bytes(b"nothing of the kind" * 20)
    with pytest.raises(InvalidValueError, match="no MAT file"):
        read_log(tmp_path / "none.mat")


def test_parquet_round_trip_with_columns_lists_and_stamps(tmp_path):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    t, q, tau = samples()
    flat = {f"q{j}": q[:, j] for j in range(n)} | {f"effort_{j}": tau[:, j] for j in range(n)}
    pq.write_table(pa.table({"time": t, **flat}), tmp_path / "flat.parquet")
    log = read_log(tmp_path / "flat.parquet")
    assert np.array_equal(log.q, q)
    assert np.array_equal(log.tau, tau)
    stamps = pa.array((t * 1e9).round().astype("int64")).cast(pa.timestamp("ns"))
    lists = pa.table(
        {
            "stamp": stamps, "name": [["a", "b", "c"]] * N, "position": q.tolist(),
            "effort": tau.tolist(),
        }
    )  # fmt: skip
    pq.write_table(lists, tmp_path / "ros.parquet")
    log = read_log(tmp_path / "ros.parquet", times="ns")
    assert np.array_equal(log.q, q)
    assert log.names == ("a", "b", "c")
    assert log.dt == pytest.approx(DT, rel=1e-9)
    (tmp_path / "bad.parquet").write_bytes(b"PAR1 no")
    with pytest.raises(InvalidValueError, match="no Parquet"):
        read_log(tmp_path / "bad.parquet")


def test_parquet_without_pyarrow_says_what_to_install(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pyarrow", None)
    (tmp_path / "x.parquet").write_bytes(b"PAR1")
    with pytest.raises(MissingExtraError, match=r"pip install 'robotmodels\[logs\]'"):
        read_log(tmp_path / "x.parquet")


def ros_lines(shape):
    t, q, tau = samples()
    stamp = 1_600_000_000_000_000_000 + (t * 1e9).round().astype(np.int64)
    if shape == "rostopic":
        names = [f"field.{k}{j}" for k in ("name", "position", "effort") for j in range(n)]
        head = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id", *names]
        rows = [
            [s + 777, i, s, "base", "j1", "j2", "j3", *map(repr, map(float, (*q[i], *tau[i])))]
            for i, s in enumerate(stamp.tolist())
        ]
    elif shape == "lists":
        head = ["Time", "header.stamp.secs", "header.stamp.nsecs", "name", "position", "velocity",
                "effort"]  # fmt: skip
        rows = [
            [s / 1e9, s // 10**9, s % 10**9, "\"['j1', 'j2', 'j3']\"", f'"{q[i].tolist()}"', '"()"',
             f'"{tuple(tau[i].tolist())}"']
            for i, s in enumerate(stamp.tolist())
        ]  # fmt: skip
    elif shape == "plotjuggler":
        head = ["__time", *(f"/joint_states/{j}/{k}" for j in ("j1", "j2", "j3")
                            for k in ("effort", "position"))]  # fmt: skip
        rows = [
            [repr(float(t[i])), *(repr(float(x)) for j in range(n) for x in (tau[i, j], q[i, j]))]
            for i in range(N)
        ]
    else:
        head = ["__time", *(f"/joint_states/{k}[{j}]" for k in ("position", "effort")
                            for j in range(n))]  # fmt: skip
        rows = [[repr(float(t[i])), *map(repr, map(float, (*q[i], *tau[i])))] for i in range(N)]
    return "\n".join(",".join(map(str, row)) for row in [head, *rows]) + "\n", q, tau


@pytest.mark.parametrize("shape", ["rostopic", "lists", "plotjuggler", "plotjuggler arrays"])
def test_tables_of_ros(tmp_path, shape):
    text, q, tau = ros_lines(shape)
    (tmp_path / "ros.csv").write_text(text)
    log = read_log(tmp_path / "ros.csv")
    assert np.array_equal(log.q, q)
    assert np.array_equal(log.tau, tau)
    assert log.dt == pytest.approx(DT, rel=1e-6)
    assert len(log.starts) == 1
    assert not log.refused
    if shape != "plotjuggler arrays":
        assert log.names == ("j1", "j2", "j3")


def test_joints_of_ros_are_put_in_the_order_asked_for(tmp_path):
    text, q, tau = ros_lines("rostopic")
    (tmp_path / "ros.csv").write_text(text)
    log = read_log(tmp_path / "ros.csv", joints=["j3", "j1"])
    assert log.names == ("j3", "j1")
    assert np.array_equal(log.q, q[:, [2, 0]])
    assert np.array_equal(log.tau, tau[:, [2, 0]])
    assert any("those of the model were taken" in note for note in log.notes)
    log = read_log(tmp_path / "ros.csv", joints=["a", "b", "c"])
    assert any("they were taken as a, b, c" in note for note in log.notes)
    text, q, tau = ros_lines("plotjuggler")
    (tmp_path / "pj.csv").write_text(text)
    assert np.array_equal(
        read_log(tmp_path / "pj.csv", joints=["j2", "j3", "j1"]).q, q[:, [1, 2, 0]]
    )
    for name, words in (("pj.csv", "no column for j9"), ("ros.csv", "no joint j9")):
        with pytest.raises(InvalidValueError, match=words):
            read_log(tmp_path / name, joints=["j1", "j2", "j9"])


def test_torques_whose_joints_stand_in_another_order_are_put_in_that_of_the_positions(tmp_path):
    _, q, tau = ros_lines("lists")
    names, order = ("j1", "j2", "j3"), [1, 2, 0]
    head = ["time", *(f"position/{j}" for j in names), *(f"effort/{names[k]}" for k in order)]
    rows = np.column_stack((DT * np.arange(len(q)), q, tau[:, order])).tolist()
    lines = [",".join(head), *(",".join(map(repr, row)) for row in rows)]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    log = read_log(tmp_path / "log.csv")
    assert log.names == names
    assert np.array_equal(log.q, q)
    assert np.array_equal(log.tau, tau)


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
    said = write(tmp_path / "b.csv", [f"time [{unit}]", *NUMBERED[1:]], t / factor, q, tau)
    assert read_log(said).dt == pytest.approx(DT)
    other = "s" if unit == "ms" else "ms"
    with pytest.raises(InvalidValueError, match=f"header says that times are in '{unit}'"):
        read_log(said, times=other)


def test_times_of_another_unit_are_refused(tmp_path):
    t, q, tau = samples()
    path = write(tmp_path / "a.csv", NUMBERED, t * 1e6, q, tau)
    with pytest.raises(InvalidValueError, match="times='ms', 'us' or 'ns'"):
        read_log(path)


def test_a_header_that_contradicts_the_unit_is_refused(tmp_path):
    t, q, tau = samples()
    head = ["t", "q1 [deg]", "q2 [deg]", "q3 [deg]", *NUMBERED[4:]]
    path = write(tmp_path / "a.csv", head, t, q, tau)
    with pytest.raises(InvalidValueError, match="header says 'deg'"):
        read_log(path)
    assert np.allclose(read_log(path, angles="deg").q, np.radians(q))


@pytest.mark.parametrize("unit", ["grad", "rev", "mrad", "counts"])
def test_positions_in_units_that_are_not_read_are_refused(tmp_path, unit):
    t, q, tau = samples()
    head = ["t", *(f"q{j} [{unit}]" for j in (1, 2, 3)), *NUMBERED[4:]]
    with pytest.raises(InvalidValueError, match=f"is in '{unit}', which is not read"):
        read_log(write(tmp_path / "a.csv", head, t, q, tau))
    head = [*NUMBERED, *(f"dq{j} (rpm)" for j in (1, 2, 3))]
    path = write(tmp_path / "b.csv", head, t, q, tau, q)
    with pytest.raises(InvalidValueError, match="'dq1 \\(rpm\\)' is in 'rpm'"):
        read_log(path)
    assert read_log(path, velocities=False).v is None


@pytest.mark.parametrize("unit", ["kNm", "mN m", "kN·m", "mN.m", "lbf-ft", "%", "A"])
def test_torques_in_other_units_need_gains(tmp_path, unit):
    t, q, tau = samples()
    head = [*NUMBERED[:4], *(f"tau{j} [{unit}]" for j in (1, 2, 3))]
    path = write(tmp_path / "a.csv", head, t, q, tau)
    with pytest.raises(InvalidValueError, match=r"not in N m; say drive_gains="):
        read_log(path)
    np.testing.assert_allclose(read_log(path, drive_gains=1e-3).tau, 1e-3 * tau)


@pytest.mark.parametrize("unit", ["Nm", "N m", "N·m", "N.m", "N*m", "N-m", "N"])
def test_torques_in_newton_metres_are_taken_as_they_are(tmp_path, unit):
    t, q, tau = samples()
    head = ["t", *(f"q{j} [rad]" for j in (1, 2, 3)), *(f"tau{j} [{unit}]" for j in (1, 2, 3))]
    log = read_log(write(tmp_path / "a.csv", head, t, q, tau))
    assert np.array_equal(log.tau, tau)
    assert not any("no unit that is known" in note for note in log.notes)


def test_brackets_that_are_no_units_are_noted(tmp_path):
    t, q, tau = samples()
    head = ["t", *(f"q{j} (meas)" for j in (1, 2, 3)), *(f"tau{j} (raw)" for j in (1, 2, 3))]
    log = read_log(write(tmp_path / "a.csv", head, t, q, tau))
    assert np.array_equal(log.q, q)
    odd = [note for note in log.notes if "no unit that is known" in note]
    assert ["'meas'" in note or "'raw'" in note for note in odd] == [True, True]


def test_a_column_is_one_thing(file):
    for given, words in (
        ({"positions": "q*", "torques": "q*"}, "torques: q1, q2, q3 of .* at once"),
        ({"positions": ["t", "q1", "q2"]}, "positions: t of .* positions and time at once"),
        ({"torques": ["t", "tau1", "tau2"]}, "torques: t of .* torques and time at once"),
        ({"velocities": "q*"}, "velocities: q1, q2, q3 of .* at once"),
    ):
        with pytest.raises(InvalidValueError, match=words):
            read_log(file, **given)


def test_currents_need_gains(tmp_path):
    t, q, tau = samples()
    path = write(tmp_path / "a.csv", [*NUMBERED[:4], "current1", "current2", "current3"], t, q, tau)
    with pytest.raises(InvalidValueError, match="drive_gains="):
        read_log(path)
    np.testing.assert_allclose(read_log(path, drive_gains=[1.0, 2.0, 3.0]).tau, tau * [1, 2, 3])


def test_patterns_go_by_their_numbers(tmp_path):
    t, q, tau = samples()
    head = ["t", "axis_10_x", "axis_2_x", "axis_1_x", "m3", "m1", "m2"]
    path = write(tmp_path / "a.csv", head, t, q, tau)
    log = read_log(path, positions="axis_*_x", torques="m*")
    assert np.array_equal(log.q, q[:, ::-1])
    assert np.array_equal(log.tau, tau[:, [1, 2, 0]])
    with pytest.raises(InvalidValueError, match="in place of the star"):
        read_log(path, positions="b*", torques="m*")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"positions": ["q1", "q2", "nope"]}, "no column 'nope'; near it"),
        ({"positions": [0, 1, 99]}, "columns 0 to 6, got 99"),
        ({"positions": [1, 1, 2]}, "is there twice"),
        ({"positions": []}, "got none"),
        ({"positions": [1, 2]}, "3 columns.*for 2 columns of positions"),
        ({"velocities": [1, 2]}, "velocities: 2 columns.*for 3 joints"),
        ({"signs": [1, 2, 1]}, "expected 1 or -1"),
        ({"gears": [1.0, 0.0, 1.0]}, "other than zero"),
        ({"gears": [1.0, 1.0]}, "gears"),
        ({"angles": "grad"}, "angles: expected 'rad' or 'deg'"),
        ({"times": "h"}, "times: expected"),
        ({"dt": -1.0}, "dt: expected the sampling period"),
        ({"format": "xls"}, "format: expected one of"),
        ({"time": [0, 1, 2]}, "expected one column, or two"),
        ({"joints": ["a"]}, "3 columns.*but 1 joints"),
        ({"time": False}, "no column of times"),
        ({"model": rm.load("rx90")}, "3 columns.*6 joints"),
    ],
)
def test_arguments_that_say_nothing_are_refused(file, given, words):
    with pytest.raises((InvalidValueError, ShapeError), match=words):
        read_log(file, **given)


def test_files_that_say_nothing_are_refused(tmp_path):
    t, q, tau = samples()
    odd = write(tmp_path / "odd.csv", ["t", "u", "w", "x", "tau1", "tau2", "tau3"], t, q, tau)
    with pytest.raises(InvalidValueError, match=r"positions: no columns of .*usual name"):
        read_log(odd)
    bare = write(tmp_path / "bare.csv", None, t, q, tau)
    with pytest.raises(InvalidValueError, match=r"positions=\[\.\.\.\]"):
        read_log(bare)
    gaps = write(tmp_path / "gap.csv", ["t", "q1", "q2", "q4", *NUMBERED[4:]], t, q, tau)
    with pytest.raises(InvalidValueError, match="without gaps"):
        read_log(gaps)
    two = write(tmp_path / "two.csv", ["a.q1", "b.q1", "tau1"], q)
    with pytest.raises(InvalidValueError, match="several that may be meant"):
        read_log(two, dt=DT)
    with pytest.raises(InvalidValueError, match="its suffix is none of"):
        read_log(tmp_path / "log.xyz")
    with pytest.raises(InvalidValueError, match="is a folder"):
        read_log(tmp_path)
    with pytest.raises(InvalidValueError, match="got none"):
        read_log([])
    with pytest.raises(FileNotFoundError):
        read_log(tmp_path / "absent.csv")
    with pytest.raises(InvalidValueError, match=r"absent\.csv: there is no such file"):
        read_log(tmp_path / "absent.csv")
    with pytest.raises(InvalidValueError, match=r"near it are bare\.csv"):
        read_log(tmp_path / "bar.csv")
    assert LogFormat.of(odd) is LogFormat.CSV


@pytest.mark.parametrize(
    ("cell", "words"), [("abc", "line 4.*'abc', not a number"), ("1,5", "line 4")]
)
def test_cells_that_cannot_be_read_are_named_by_line(tmp_path, cell, words):
    lines = ["t;q1;tau1", *(f"{DT * i:.2f};{i};1" for i in range(10))]
    lines[3] = f"0.02;{cell};1"
    (tmp_path / "a.csv").write_text("\n".join(lines))
    with pytest.raises(InvalidValueError, match=words):
        read_log(tmp_path / "a.csv")


def test_a_line_that_was_cut_off_is_named(tmp_path):
    lines = ["t,q1,tau1", *(f"{DT * i:.2f},{i},1" for i in range(10)), "0.1,1"]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    with pytest.raises(InvalidValueError, match=r"line 12: expected 3 columns.*got 2"):
        read_log(tmp_path / "a.csv")


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
    assert any("3 of 20 rows lack a number" in note for note in log.notes)
    (tmp_path / "b.csv").write_text("t,q1,tau1\n0,nan,1\n1,nan,1\n")
    with pytest.raises(InvalidValueError, match="every one of its 2 rows lacks"):
        read_log(tmp_path / "b.csv")


def test_several_files_are_several_recordings(tmp_path):
    t, q, tau = samples()
    files = [write(tmp_path / f"{k}.csv", NUMBERED, t, q + k, tau) for k in range(3)]
    log = read_log(files)
    assert log.starts.tolist() == [0, N, 2 * N]
    assert [source.name for source in log.sources] == ["0.csv", "1.csv", "2.csv"]
    assert np.array_equal(log.q[N : 2 * N], q + 1)
    slower = write(tmp_path / "slow.csv", NUMBERED, 2 * t, q, tau)
    with pytest.raises(InvalidValueError, match=r"number 1 is sampled every 0\.02 s.*dt="):
        read_log([files[0], slower])
    both = read_log([files[0], slower], dt=DT)
    assert len(both) == N + 2 * N - 1
    assert any("brought to it by cubic splines" in note for note in both.notes)


def test_torques_of_another_file_by_row(tmp_path):
    t, q, tau = samples()
    a = write(tmp_path / "a.csv", ["Joint_1", "Joint_2", "Joint_3"], q)
    b = write(tmp_path / "b.csv", ["Joint_1", "Joint_2", "Joint_3"], tau)
    log = read_log(a, torques_from=b, dt=DT)
    assert np.array_equal(log.q, q)
    assert np.array_equal(log.tau, tau)
    assert len(log.sources) == 2
    short = write(tmp_path / "c.csv", ["Joint_1", "Joint_2", "Joint_3"], tau[:-1])
    with pytest.raises(ShapeError, match=r"60 rows.*59"):
        read_log(a, torques_from=short, dt=DT)
    with pytest.raises(InvalidValueError, match="a file for each of the 1"):
        read_log(a, torques_from=[b, b], dt=DT)
    timed = write(tmp_path / "d.csv", ["t", "tau1", "tau2", "tau3"], t, tau)
    with pytest.raises(InvalidValueError, match=r"one of .* has times and the other has none"):
        read_log(a, torques_from=timed, dt=DT)


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


def test_the_tx40_is_read_as_the_data_set_has_it(tmp_path):
    data = load_tx40()
    rows = slice(0, 2000)
    head = [f"Joint_{j}" for j in range(1, 7)]
    a = write(tmp_path / "pos.csv", head, data.motor_positions[rows])
    b = write(tmp_path / "curr.csv", head, data.motor_torques[rows])
    log = read_log(
        a, torques_from=b, dt=2e-4, transmission=data.model.transmission, model=data.model
    )
    np.testing.assert_allclose(log.q, data.log.q[rows], rtol=0, atol=1e-15)
    np.testing.assert_allclose(log.tau, data.log.tau[rows], rtol=1e-14, atol=1e-13)
    assert log.names == data.log.names
    unsaid = read_log(a, torques_from=b, dt=2e-4, model=data.model)
    assert any("say transmission=model.transmission" in note for note in unsaid.notes)


def test_joined_logs_are_of_one_robot(file):
    log = read_log(file, joints=["a", "b", "c"])
    with pytest.raises(ShapeError, match="joints a, b, c, the first of 1, 2, 3"):
        join_logs([read_log(file), log])
    with pytest.raises(InvalidValueError, match="at least one"):
        join_logs([])

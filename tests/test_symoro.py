"""SYMORO's .par files: both spellings, symbols, SYMORO's own numbers, every kind of bad file."""

import json
import math
import pickle
import re
import warnings
from pathlib import Path

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.errors import (
    ParFileError,
    RobotModelsWarning,
)
from robotmodels.symoro import read_par

ORACLES = Path(__file__).parent / "oracles"
LINK_KEYS = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M", "IA", "FV", "FS")
WRENCH_KEYS = ("FX", "FY", "FZ", "CX", "CY", "CZ")
PI = math.pi

RX90 = {
    "name": "RX90",
    "ant": [0, 1, 2, 3, 4, 5],
    "sigma": [0, 0, 0, 0, 0, 0],
    "mu": [1, 1, 1, 1, 1, 1],
    "gamma": [0, 0, 0, 0, 0, 0],
    "b": [0, 0, 0, 0, 0, 0],
    "alpha": [0, "pi/2", 0, "-pi/2", "pi/2", "-pi/2"],
    "d": [0, 0, "D3", 0, 0, 0],
    "theta": ["th1", "th2", "th3", "th4", "th5", "th6"],
    "r": [0, 0, 0, "RL4", 0, 0],
}
RX90_VALUES = {"D3": 0.45, "RL4": 0.45}
TWO_JOINTS = {
    "name": "two",
    "ant": [0, 1],
    "sigma": [0, 1],
    "mu": [1, 1],
    "gamma": [0, 0],
    "b": [0, 0],
    "alpha": [0, "pi/2"],
    "d": [0, 0.2],
    "theta": ["th1", 0],
    "r": [0.5, "r2"],
}
COLUMNS = ("ant", "sigma", "b", "d", "r", "gamma", "alpha", "mu", "theta")


def listed(entries, between=","):
    return "{" + between.join(map(str, entries)) + "}"


def open_symoro(robot, counts=None, kind=0, extra=""):
    """As OpenSYMORO writes a robot."""
    n = len(robot["ant"])
    nl, nj, nf = counts or (n, n, n)
    lines = [f"(* Robotname = '{robot['name']}' *)", f"NL = {nl}", f"NJ = {nj}", f"NF = {nf}"]
    lines += [f"Type = {kind}", "is_floating = False", "is_mobile = 0", ""]
    lines += ["(* Geometric parameters *)"]
    lines += [f"{key} = {listed(robot[key])}" for key in COLUMNS if key in robot]
    return "\n".join([*lines, extra, "(* End of definition *)", ""])


def symoro_plus(robot, extra=""):
    """As SYMORO+ writes one: capitals, Pi, lists that begin on the next line, an accent."""
    text = open_symoro(robot, extra=extra).replace("pi", "Pi").replace("is_mobile = 0", "")
    text = text.replace("is_floating = False", "(* rue de la Noë *)")
    lists = re.compile(r"^(ant|sigma|b|r|alpha|mu|theta) = \{(.*?,)(.*)\}$", re.M)
    return lists.sub(lambda m: f"{m[1].capitalize()} = {{\n  {m[2]}\n  {m[3]}}}", text)


def dynamic_lists(links):
    return "\n".join(f"{key} = {listed([link[key] for link in links])}" for key in LINK_KEYS)


def symbolic_lists(n):
    keys = (*LINK_KEYS, *WRENCH_KEYS, "QP", "QDP")
    lines = [f"{key} = {listed([f'{key}{j}' for j in range(1, n + 1)])}" for key in keys]
    lines += [f"{key} = {{0,0,0}}" for key in ("W0", "WP0", "V0", "VP0")]
    return "\n".join([*lines, "G = {0,0,G3}", "Z = {1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1}"])


@pytest.fixture
def read(tmp_path):
    def read_text(text, *args, encoding="utf-8", file="robot.par", **kwargs):
        path = tmp_path / file
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        return read_par(path, *args, **kwargs)

    return read_text


@pytest.fixture
def two(read):
    """Read the two-joint robot with some of its columns changed."""

    def read_changed(values=None, extra="", **columns):
        return read(open_symoro({**TWO_JOINTS, **columns}, extra=extra), values)

    return read_changed


def oracle(name):
    return json.loads((ORACLES / f"par_{name}.json").read_text())


# --- both spellings ------------------------------------------------------------------------------


def test_both_spellings_give_equal_models(read):
    open_ = read(open_symoro(RX90), RX90_VALUES)
    assert read(symoro_plus(RX90), RX90_VALUES) == open_
    assert read(symoro_plus(RX90).replace("\n", "\r\n"), RX90_VALUES) == open_
    assert read(symoro_plus(RX90), RX90_VALUES, encoding="latin-1") == open_
    assert read(symoro_plus(RX90), RX90_VALUES, encoding="utf-8-sig") == open_


@pytest.mark.parametrize("write", [open_symoro, symoro_plus])
@pytest.mark.parametrize("name", ["rx90", "scara", "two_arm_tree"])
def test_poses_and_torques_are_symoros(read, name, write):
    data = oracle(name)
    G = f"G = {listed(data['gravity'])}"
    robot = {**data["table"], "name": data["name"]}
    model = read(write(robot, extra=f"{dynamic_lists(data['links'])}\n{G}"), data["values"])
    q, v, a, tau = (np.array([s[k] for s in data["samples"]]) for k in ("q", "qp", "qpp", "tau"))
    for frame in data["samples"][0]["T"]:
        expected = np.array([s["T"][frame] for s in data["samples"]])
        np.testing.assert_allclose(rm.dgm(model, q, int(frame)), expected, atol=1e-11)
    np.testing.assert_allclose(rm.idm(model, q, v, a), tau, rtol=1e-10, atol=1e-10)
    assert model.notes == ()


# --- symbols, offsets, expressions ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("entry", "offset"),
    [
        ("anything", 0.0),
        ("th1 + pi/2", PI / 2),
        ("PI/2+q1", PI / 2),
        ("theta1 - 2*(0.25 + 1.5e-3)", -0.503),
        ("2*th1 - th1 + sqrt(D^2)", 0.7),
        ("q1 + atan2(1, 1)", PI / 4),
        ("0.3", 0.3),
        ("-D + .7 + th1 + cos(pi)*sin(pi/2) + 2**0", 0.0),
    ],
)
def test_what_is_added_to_the_variable_is_the_offset(two, entry, offset):
    values = {"D": 0.7} if "D" in entry else None
    model = two(values, theta=[entry, 0])
    assert model.table.theta[0] == pytest.approx(offset, abs=1e-15)


@pytest.mark.parametrize(
    ("columns", "values", "message"),
    [
        ({"theta": ["pi/2 - th1", 0]}, None, "not its variable plus a constant"),
        ({"theta": ["th1**2", 0]}, None, "not its variable plus a constant"),
        ({"theta": ["phi + psi", 0]}, None, "which of phi, psi is the variable of joint 1"),
        ({"theta": ["th1", 0]}, {"th1": 0.3}, "take that one"),
        ({"theta": ["r2", 0]}, None, "already the variable of joint 1"),
        *(({"d": [0, entry]}, None, r"robot\.par, line 1[0-9]: d") for entry in (
            "", "__import__('os')", "[1]", "1 if 1 else 2", "exp(1)", "sqrt(1, 2)",
            "(" * 300 + "1", "1/0", "(-8)**(1/3)", "9.0**9**9**9")),
    ],
)  # fmt: skip
def test_entries_that_are_no_variables_and_no_numbers(two, columns, values, message):
    with pytest.raises(ParFileError, match=message):
        two(values, **columns)


# --- dynamic parameters, gravity, base -----------------------------------------------------------


def test_parameters_that_only_name_themselves_are_zero_with_one_warning(read):
    text = open_symoro(RX90, extra=symbolic_lists(6))
    with pytest.warns(RobotModelsWarning, match="XX1, XX2, .* have no numbers and are 0") as record:
        model = read(text, RX90_VALUES)
    assert len(record) == 1
    assert record[0].filename == __file__  # points at whoever called read_par
    assert not model.inertia.values.any()
    assert model.drive.is_zero
    assert "Gravity is symbolic" in model.notes[1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotModelsWarning)
        assert read(text, {**RX90_VALUES, "XX1": 0.0}) == model


def test_gravity_of_the_file_is_in_frame_0(two):
    turned = "Z = {0,0,1,0.1, 0,1,0,0.2, -1,0,0,0.3, 0,0,0,1}"
    model = two({"g": 9.8}, extra=f"G = {{g, 0, 0}}\n{turned}")
    np.testing.assert_allclose(model.base[:3, 3], [0.1, 0.2, 0.3])
    np.testing.assert_allclose(model.gravity, [0, 0, -9.8])
    assert two(extra="G = {0, 0, 0}").gravity.tolist() == [0, 0, 0]
    assert two({"G3": 9.81}, extra="G = {0, 0, -G3}").gravity.tolist() == [0, 0, -9.81]


# --- frames, trees, loops ------------------------------------------------------------------------


def test_fixed_frames_are_kept_also_after_the_links(read):
    robot = {**TWO_JOINTS, "sigma": [0, 1, 2], "ant": [0, 1, 2], "d": [0, 0.2, "L3"],
             "theta": ["q1", 0, 0], "r": [0.5, "q2", 0.1]}  # fmt: skip
    robot |= {key: [*TWO_JOINTS[key], 0] for key in ("gamma", "b", "alpha", "mu")}
    three = read(open_symoro(robot, extra="M = {1, 2, 3}"), {"L3": 0.3})
    # counted as a frame but not as a link: OpenSYMORO's planar2r.par
    end = read(open_symoro(robot, counts=(2, 2, 3), extra="M = {1, 2}"), {"L3": 0.3})
    assert (three.f, three.n, three.tip) == (3, 2, 3)
    assert three.table == end.table
    assert three.inertia.mass.tolist() == [1, 2, 3]
    assert end.inertia.mass.tolist() == [1, 2, 0]
    with pytest.raises(ParFileError, match="only fixed frames"):
        read(open_symoro({**robot, "sigma": [0, 1, 1]}, counts=(2, 2, 3)), {"L3": 0.3})


def test_loops_are_refused_by_name(read):
    # the SR400's structure: one parallelogram
    robot = {key: [0] * 10 for key in ("gamma", "b", "alpha", "d", "r", "mu")}
    robot |= {"name": "SR400", "ant": [0, 1, 2, 3, 4, 5, 1, 7, 8, 3], "sigma": [0] * 9 + [2]}
    robot |= {"theta": [*(f"th{j}" for j in range(1, 10)), 0]}
    with pytest.raises(ParFileError, match=r"'SR400' has closed loops.*joint 9 \(second: frame 10"):
        read(open_symoro(robot, counts=(8, 9, 10), kind=2))
    tree = {k: v[:8] if isinstance(v, list) else v for k, v in robot.items()}
    assert read(open_symoro(tree, kind=1)).n == 8
    with pytest.raises(ParFileError, match="Type = 2 says"):
        read(open_symoro(tree, kind=2))


# --- bad files -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("d = {0,0.2}", "d = {0}", "d: expected 2 entries .*NF = 2.*got 1"),
        ("d = {0,0.2}", "d = {0,\n\n oops(}", "line 15: d, entry 2"),
        ("d = {0,0.2}", "d = {0,0.2", "line 13: the list d has no end"),
        ("d = {0,0.2}", "d = 0.2", "expected a list in braces"),
        ("d = {0,0.2}", "d = {0,0.2}\nD = {0,0.3}", "d stands here again"),
        ("d = {0,0.2}", "", "expected the keywords d,"),
        ("alpha = {", "alhpa = {", "keywords alpha, .*'alhpa' is none"),
        ("NJ = 2", "", "expected the keywords NJ"),
        ("NL = 2", "NL = two", "NL: expected a whole number"),
        ("NL = 2", "NL = 3", "do not fit"),
        ("is_floating = False", "is_floating = True", "floating base is not supported"),
        ("is_mobile = 0", "is_mobile = 1", "mobile base is not supported"),
        ("sigma = {0,1}", "sigma = {0,3}", "sigma, entry 2: expected 0"),
        ("sigma = {0,1}", "sigma = {0,s2}", "no number for s2"),
        ("ant = {0,1}", "ant = {0,7}", "ant, entry 2: expected the number of a frame"),
        ("mu = {1,1}", "mu = {1,1e80}", "mu, entry 2: expected 1"),
        ("(* End", "M = {1}\n(* End", r"M: expected 2 entries \(NL = 2 links\)"),
        ("(* End", "Z = {1}\n(* End", "Z: expected 16 entries"),
        ("(* End", "VP0 = {0, 0, 9.81}\n(* End", "the base moves"),
        ("(* End", "eta = {0, 1}\n(* End", "flexible joints are not supported"),
        ("(* End of definition *)", "(* End", "line 20: a comment .* has no end"),
    ],
)
def test_bad_files_say_where_and_what(read, old, new, message):
    text = open_symoro(TWO_JOINTS)
    assert text.count(old) == 1
    with pytest.raises(ParFileError, match=message) as error:
        read(text.replace(old, new))
    assert str(error.value).startswith("robot.par")


def test_symbols_keep_their_names_in_tables_and_formulas(read):
    robot = {key: [0, 0, 0] for key in ("sigma", "gamma", "b")}
    robot |= {"name": "elbow", "ant": [0, 1, 2], "mu": [1, 1, 1], "alpha": [0, "pi/2", 0]}
    robot |= {"d": [0, "L1", "L1+L2"], "theta": ["t1", "t2 + pi/2", "t3"], "r": ["H1", 0, 0]}
    arm = read(open_symoro(robot), {"L1": 0.3, "L2": 0.2, "H1": 0.4})
    assert dict(arm.table.symbols) == {("d", 2): "L1", ("d", 3): "L1+L2", ("r", 1): "H1"}
    assert "0.3 (L1)" in str(arm.table)
    assert "0.5 (L1+L2)" in str(arm.table)
    text = rm.explain_dgm(arm).text
    assert "H1 = 0.4 m (r1)" in text
    assert "D3 = 0.5 m (d3 = L1+L2)" in text
    assert "C1*(L1 - S2*D3)" in text
    assert "atan2(Pz - H1, C1*Px + S1*Py - L1)" in rm.explain_igm(arm).text
    assert pickle.loads(pickle.dumps(arm)).table.symbols == arm.table.symbols
    # another length is no longer the one that had the name
    assert dict(arm.table.replace(d=[0, 0.1, 0.2]).symbols) == {("r", 1): "H1"}
    heavy = arm.with_inertia(rm.InertialParameters(np.ones((3, 10))))
    assert "L1" in str(rm.base_parameters(heavy, drive=False))
    for wrong in ({("d", 4): "L"}, {("x", 1): "L"}, {("d", 1): "1L"}, {("d", 1): ""}, ["L1"]):
        with pytest.raises(rm.errors.TableError, match="symbols"):
            rm.DHTable(antecedent=[0, 1, 2], sigma=[0, 0, 0], symbols=wrong)

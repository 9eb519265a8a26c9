"""Inputs made to hang or to fill the memory are refused soon; what was found stays found."""

import io
import tracemalloc

import numpy as np
import pytest
from robustness.inputs import LOG, LOG_CSV, PAR, URDF, planar
from robustness.outcomes import SECONDS, Outcome, check_log, check_model, outcome, time_limit

import robotmodels as rm
from robotmodels.calibration import read_measurements
from robotmodels.errors import InvalidValueError, ParFileError, UrdfError
from robotmodels.identification import read_log

pytestmark = pytest.mark.nightly

MOST = 400 * 2**20
"""Bytes that a refusal may hold."""


def refused(call, *words):
    """The call raises one of our errors with these words, in time and in little memory."""
    tracemalloc.start()
    try:
        with (
            pytest.raises((InvalidValueError, ParFileError, UrdfError)) as found,
            time_limit(4.0 * SECONDS),  # tracing memory costs time
        ):
            call()
        held = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert held < MOST
    for word in words:
        assert word in str(found.value)


# --- URDF ---------------------------------------------------------------------------------------


def test_entities_are_refused_before_they_are_expanded():
    laughs = "".join(f'<!ENTITY a{k + 1} "{f"&a{k};" * 10}">' for k in range(9))
    text = f'<!DOCTYPE r [<!ENTITY a0 "ha">{laughs}]><robot name="&a9;"/>'
    refused(lambda: rm.RobotModel.from_urdf(text), "DOCTYPE")
    outside = '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/hostname">]><robot name="&x;"/>'
    refused(lambda: rm.RobotModel.from_urdf(outside), "DOCTYPE")


def test_elements_within_elements_without_end():
    text = "<robot name='r'>" + "<a>" * 100_000 + "</a>" * 100_000 + "</robot>"
    refused(lambda: rm.RobotModel.from_urdf(text), "no <link>")
    refused(lambda: rm.RobotModel.from_urdf("<robot>" * 100_000))


def test_a_chain_of_many_joints_is_read_in_time():
    links = "".join(f'<link name="l{k}"/>' for k in range(1001))
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="0 0 0.1"/><axis xyz="0 {k % 2} 1"/></joint>' for k in range(1000)
    )  # fmt: skip
    text = f"<robot name='r'>{links}{joints}</robot>"
    assert outcome(lambda: rm.RobotModel.from_urdf(text), lambda m: None) is Outcome.ANSWERED


@pytest.mark.parametrize("number", ["1e999999", "-1e999999", "9" * 5000, "1e308", "nan"])
def test_numbers_that_are_none(number):
    for old in ('xyz="0.3 0 0"', 'value="3"', 'upper="2"', 'damping="0.1"', 'ixx="0.1"'):
        key, value = old.split("=", 1)
        text = URDF.replace(old, f'{key}="{number} 0 0"' if "0 0" in value else f'{key}="{number}"')
        assert text != URDF
        outcome(lambda text=text: rm.RobotModel.from_urdf(text, dynamics=True), check_model, ())


def test_a_mass_whose_inertia_is_no_number_at_its_joint():
    # found by damaged trees: NumPy warned, and the table said what was wrong of something else
    text = URDF.replace('mass value="3"/>', 'mass value="1e308"/><origin xyz="1e10 0 0"/>')
    refused(lambda: rm.RobotModel.from_urdf(text), "upper", "inertia")


# --- SYMORO -------------------------------------------------------------------------------------


def test_symoro_files_that_are_long(tmp_path):
    path = tmp_path / "long.par"
    for text in (
        PAR + "".join(f"w{k} = {k}\n" for k in range(200_000)),
        PAR.replace("d = {0, 0.2, D3}", "d = {" + "0," * 500_000 + "0}"),
        PAR + " " * 5_000_000,
        "(" * 1_000_000,
        "NL = " + "9" * 1_000_000,
    ):
        path.write_text(text)
        refused(lambda: rm.read_par(path, {"D3": 0.4}))


@pytest.mark.parametrize(
    "entry",
    ["9**9**9**9", "(" * 400 + "1" + ")" * 400, "-" * 1200 + "1", "1e200*1e200", "10**400",
     "sqrt(-1)", "1/0", "(-8)**0.5", "__import__('os')", "().__class__"],
)  # fmt: skip
def test_expressions_that_have_no_value(tmp_path, entry):
    path = tmp_path / "robot.par"
    path.write_text(PAR.replace("0.2, D3", f"{entry}, D3"))
    refused(lambda: rm.read_par(path, {"D3": 0.4}))


# --- logs and measurements ------------------------------------------------------------------------


def test_one_line_of_a_hundred_megabytes(tmp_path):
    path = tmp_path / "run.csv"
    path.write_bytes(b"1," * (50 * 2**20))
    refused(lambda: read_log(path, dt=0.01), "longer than")
    refused(lambda: read_measurements(path, "position", planar()), "longer than")


def test_a_grid_that_nobody_measured(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(LOG_CSV)
    refused(lambda: read_log(path, dt=1e-9), "dt=")
    assert len(read_log(path, dt=0.001)) == 231


def test_a_quotation_mark_without_end_loses_no_rows(tmp_path):
    # NumPy takes the lines up to the next one into the cell, and says nothing
    lines = LOG_CSV.split("\n")
    lines[0] += ",note"
    lines[1:] = [line + ",x" for line in lines[1:]]
    lines[4] = lines[4][:-1] + '"x'
    lines[9] = lines[9][:-1] + 'x"'
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines))
    refused(lambda: read_log(path), "quotation mark")


def test_lists_in_a_table_whose_first_row_is_short(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text('position,effort,t\n"[1, 2]"\n"[1, 2]","[1, 2]",0.1\n')
    assert outcome(lambda: read_log(path, dt=0.01), check_log) is Outcome.REFUSED


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04" + bytes(40), b"\x93NUMPY\x01\x00v\x00{'a': ("])
def test_npz_files_that_are_none(tmp_path, data):
    path = tmp_path / "run.npz"
    path.write_bytes(data)
    refused(lambda: read_log(path, dt=0.01), "NPZ")


def test_an_npz_whose_digits_were_changed(tmp_path):
    stream = io.BytesIO()
    np.savez(stream, **LOG)
    data = bytearray(stream.getvalue())
    data[len(data) // 2] ^= 1
    path = tmp_path / "run.npz"
    path.write_bytes(data)
    refused(lambda: read_log(path), "NPZ")


def test_numbers_that_have_no_square(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(LOG_CSV.replace("0.841470985", "1.7e308").replace("0.479425539", "-1.7e308"))
    assert outcome(lambda: read_log(path, angles="rad", dt=0.009), check_log) is Outcome.REFUSED


# --- JSON -----------------------------------------------------------------------------------------

"""Inputs made to hang or to fill the memory are refused soon; what was found stays found."""

import tracemalloc

import pytest
from robustness.inputs import LOG_CSV, PAR, URDF, planar
from robustness.outcomes import SECONDS, Outcome, outcome, time_limit

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


# --- logs and measurements ------------------------------------------------------------------------


def test_one_line_of_a_hundred_megabytes(tmp_path):
    path = tmp_path / "run.csv"
    path.write_bytes(b"1," * (50 * 2**20))
    refused(lambda: read_log(path, dt=0.01), "longer than")
    refused(lambda: read_measurements(path, "position", planar()), "longer than")


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

"""Notes and messages of calibration: each names its cause, and the next step of its reader."""

import re

import numpy as np
import pytest
from test_calibration_mistakes import ALONE, LOWER, UPPER, Arm, between, contacts, limited

import robotmodels as rm
from robotmodels.calibration import (
    KnownDistance,
    ParameterPrior,
    PointContact,
    Pose,
    Position,
    fit,
    report,
)
from robotmodels.calibration.read import read_measurements
from robotmodels.cli import main
from robotmodels.datasets import panda_double_socket
from robotmodels.errors import InvalidValueError

# --- limits of joints -----------------------------------------------------------------------------


def beyond(q, joint, count, by):
    """Readings of which some of a joint are beyond its upper limit."""
    q = q.copy()
    q[:count, joint] = UPPER[joint] + by
    return q


@pytest.mark.parametrize("count", [25, 24])
def test_readings_are_refused_by_their_number_beyond_the_limits(count):
    arm = Arm(0)
    q = arm.rng.uniform(LOWER, UPPER, (40, 6))
    measured = Position(q, arm.positions(q))
    q = beyond(q, 3, count, 0.1)
    model, measured = limited(arm, LOWER, UPPER), Position(q, measured.p)
    if count == 25:  # more than 60 %
        with pytest.raises(InvalidValueError, match=r"joint 4 .* in 25 of 40 readings"):
            fit(model, measured, progress=lambda *_: pytest.fail("a fit"), **ALONE)
    else:
        assert any("beyond the limits" in n for n in fit(model, measured, **ALONE).notes)


def test_the_columns_of_a_real_arm_in_reverse_are_refused():
    data = panda_double_socket()
    one, other = data.places["front"]
    q, labels = np.concatenate([one, other]), [0] * len(one) + [1] * len(other)
    fit(data.model, [PointContact(q, labels), between(data.distance)], **ALONE)
    message = r"joint 2 .* in 43 of 62 .* joint 6 .* in 44 of 62"
    with pytest.raises(InvalidValueError, match=message):
        fit(data.model, [PointContact(q[:, ::-1], labels), between(data.distance)], **ALONE)


# --- implausible residuals ------------------------------------------------------------------------


def test_implausible_residuals_are_the_first_note_and_end_the_search_for_their_cause():
    arm = Arm(0)
    q = arm.readings(40)
    p = arm.positions(q)
    wrong, right = fit(arm.nominal, Position(q, p[::-1])), fit(arm.nominal, Position(q, p))
    assert re.match(r"position: the residuals are \d+ % of the robot's size", wrong.notes[0])
    assert not any("depend on the posture" in note for note in wrong.notes)
    assert "another tool" not in report(wrong)
    assert not any("the residuals are" in note for note in right.notes)
    assert "Predicted standard error of another tool" in report(right)


# --- parameters -----------------------------------------------------------------------------------

NEARLY = (
    "nearly indistinguishable (standard errors over 50 times those with the other parameters known)"
)


def test_a_coordinate_of_the_tool_alone_is_not_called_indistinguishable():
    arm, touched = contacts(0)
    result = fit(arm.nominal, [touched, between(0.05)], prior=None, **ALONE)
    assert not any("indistinguishable" in note for note in result.notes)


def test_a_parameter_is_indistinguishable_from_another_one():
    arm = Arm(3)
    q = arm.readings(40)
    q[:, 2] = 0.3 + 0.1 * arm.rng.normal(size=40)
    result = fit(arm.nominal, Position(q, arm.positions(q)), prior=None, **ALONE)
    (note,) = (n for n in result.notes if "indistinguishable" in n)
    assert note.startswith(f"theta3, theta4: {NEARLY}")
    k, other = result.names.index("theta3"), result.names.index("theta4")
    among = np.abs(result.correlation[k])
    among[k] = 0.0
    assert among.argmax() == other


def test_parameters_identifiable_at_the_solution_alone_have_no_doubtful_estimate():
    arm = Arm(0)
    q = arm.readings(40)
    q[:, 2] = 0.3 + 0.01 * arm.rng.normal(size=40)
    result = fit(arm.nominal, Position(q, arm.positions(q)), prior=None, **ALONE)
    (note,) = (n for n in result.notes if n.startswith("At the solution"))
    assert note.endswith("Also: theta5; these were not estimated.")
    assert "theta5" not in result.names
    assert "doubtful" not in note


# --- data kept aside ------------------------------------------------------------------------------


@pytest.mark.parametrize(("prior", "advice"), [(None, "a prior"), (ParameterPrior(), "a narrower")])
def test_no_gain_is_one_note_in_the_units_of_the_report(prior, advice):
    arm = rm.load("rx90")
    rng = np.random.default_rng(3)
    q = rng.uniform(-2, 2, (14, 6))
    T = rm.dgm(arm, q)
    T[:, :3, 3] += 2e-3 * rng.normal(size=(14, 3))
    result = fit(arm, Pose(q, T), prior=prior)
    (note,) = (n for n in result.notes if "does not lower" in n)
    assert f"fewer parameters, {advice}" in note
    words = r"position error \(cross-validation ([\d.]+) to ([\d.]+), held out .* mm, rms\)"
    was, after = (float(number) for number in re.search(words, note).groups())
    assert was == pytest.approx(1e3 * result.validation.folds.nominal.rms["m"], abs=1e-4)
    assert after == pytest.approx(1e3 * result.validation.folds.rms["m"], abs=1e-4)


# --- files ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """Two sockets at two places of a real arm: its URDF and four files, one with a bad row."""
    data = panda_double_socket()
    folder = tmp_path_factory.mktemp("places")
    urdf = folder / "panda.urdf"
    urdf.write_text(rm.model.to_urdf(data.model))
    files = []
    for place in ("front", "right"):
        (folder / place).mkdir()
        for hole, q in enumerate(data.places[place]):
            bad = q.copy()
            bad[7, 3] += 0.04 * (place == "front" and hole == 1)
            files.append(folder / place / f"hole_{hole}.csv")
            np.savetxt(files[-1], bad, delimiter=",", header=",".join(f"q{j}" for j in range(1, 8)),
                       comments="")  # fmt: skip
    return data, urdf, files


def test_outliers_name_their_files_and_rows(places):
    data, _, files = places
    measured = read_measurements(files[:2], "point_contact", data.model)
    k = len(data.places["front"][0]) + 7
    for found, block in ((measured, k), (measured.subset(np.r_[k, :30, 40:60]), 0)):
        known = KnownDistance("point:hole_0", "point:hole_1", data.distance)
        result = fit(data.model, [found, known], **ALONE)
        assert result.solution.fit.outliers[0] == block
        (note,) = (n for n in result.notes if "outlier" in n)
        assert f"{block + 1} in front/hole_1.csv row 8" in note
        assert note.endswith("residuals are larger than noise explains.")
        text = report(result)
        table = text[text.index("\nOutliers\n") :]
        assert re.search(rf"│ +{block + 1} │ +front/hole_1\.csv │ +8 │", table)


# --- the command line -----------------------------------------------------------------------------

GARBLED = re.compile(r"--[a-z-]+(\.\S|\(|=|\.\.)")


def run(places, capsys, *words, of=2):
    """Status, output and error of calibrate on contacts with the first files."""
    _, urdf, files = places
    given = [
        "calibrate", "--robot", urdf, "--measurements", *files[:of], "--kind", "point-contact",
        "--folds", "0", "--held-out", "0", *words,
    ]  # fmt: skip
    code = main([str(word) for word in given])
    out, err = capsys.readouterr()
    assert not GARBLED.search(out + err)
    return code, " ".join(out.split()), err


def test_a_known_distance_in_another_unit_on_the_command_line(places, capsys):
    words = ("--lengths", "mm", "--known-distance", "hole_0", "hole_1")
    code, _, err = run(places, capsys, *words, "0.05")
    assert code == 2
    assert "known distance hole_0 to hole_1" in err
    assert "as if metres had been converted as millimetres" in err
    assert "Write 0.05 without --lengths mm, or 50 with it." in err
    code, out, _ = run(places, capsys, *words, "50", "--prior", "NONE")
    assert code == 0
    assert "Without a prior." in out
    code, _, err = run(places, capsys, *words, "50", "--prior", "1e-3")
    assert (code, err) == (
        2, "robotmodels: --prior: expected two positive numbers (m, rad) or none, got '1e-3'.\n",
    )  # fmt: skip


def test_unknown_points_are_listed_once_with_those_that_are_touched(places, capsys):
    code, _, err = run(places, capsys, "--known-distance", "hole_0", "hole_1", "0.05", of=4)
    assert code == 2
    assert (
        "No measurement touches hole_0, hole_1. Touched points: front/hole_0, front/hole_1, "
        "right/hole_0, right/hole_1." in err
    )
    arm, touched = contacts(0)
    message = r"touches point:7\. Touched points: point:0, point:1\.$"
    with pytest.raises(InvalidValueError, match=message):
        fit(arm.nominal, [touched, between(0.05, 7)], **ALONE)

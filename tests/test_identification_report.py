"""What an identification says of itself: residuals, signs, report, files, and the real robot."""

import json
from dataclasses import replace

import numpy as np
import pytest
from identification_fleet import clean_log, raw
from scipy.stats import chi2

import robotmodels as rm
from robotmodels.errors import InvalidValueError
from robotmodels.estimation.estimate import correlated_pairs
from robotmodels.identification import (
    consistent_robot,
    equations,
    fit,
    report,
    write_result,
)
from robotmodels.identification.report_tables import (
    CORRELATED,
    WEAK,
    correlated_estimates,
    group_names,
    group_units,
    negative_parameters,
    regrouped_text,
    standard_error_ratio,
    weak_parameters,
)
from robotmodels.identification.result_file import result_data
from robotmodels.identification.validation import residual_diagnostics
from robotmodels.logs.log import LogSource, RefusedRows
from robotmodels.minimal_parameters import uniform_bodies

DT = 0.005


def arm(name="lab_trr", mass=6.0):
    """A robot with bodies and drives; the first joint of the default slides."""
    model = rm.load(name)
    n = model.n
    drive = rm.DriveParameters(np.full(n, 0.3), np.full(n, 2.0), np.full(n, 1.5), np.zeros(n))
    return model.with_inertia(uniform_bodies(model, mass)).with_drive(drive)


def log_of(model, seed=0, seconds=20.0, **more):
    """A motion with exact velocities and accelerations, and noisy torques."""
    log = clean_log(model, seed, 0.05, samples=round(seconds / DT), dt=DT, size=0.5)
    return replace(log, **more)


@pytest.fixture(scope="module")
def found():
    model = arm()
    source = LogSource("run.csv", "ab" * 32, 4000)
    log = log_of(
        model, names=("lift", "shoulder", "elbow"), sources=[source],
        refused=[RefusedRows("run.csv", (3, 4, 5, 9), "not a number in column tau1")],
    )  # fmt: skip
    return fit(model, log, processing=raw(log), test=log_of(model, seed=1), checked=False)


# --- residuals ------------------------------------------------------------------------------------


def residuals(system, values):
    blocks = list(system.blocks())
    e = np.concatenate([b.y - b.W @ values for b in blocks])
    return e, np.concatenate([b.use for b in blocks])


def test_correlations_and_moments_are_those_of_the_residuals(found):
    e, _ = residuals(found.equations, found.values)
    seen = residual_diagnostics(found.equations, found.values)
    x = e - e.mean(axis=0)
    N = len(x)
    for lag in range(41):
        r = (x[lag:] * x[: N - lag]).sum(axis=0) / (N - lag) / (x * x).mean(axis=0)
        np.testing.assert_allclose(seen.autocorrelation[:, lag], r, atol=3e-6)
    s = x / x.std(axis=0)
    np.testing.assert_allclose(seen.skewness, (s**3).mean(axis=0), atol=1e-10)
    np.testing.assert_allclose(seen.kurtosis, (s**4).mean(axis=0) - 3.0, atol=1e-10)
    np.testing.assert_allclose(seen.mean, e.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(seen.std, e.std(axis=0), rtol=1e-10)
    rho = np.array([(x[k:] * x[: N - k]).sum(axis=0) for k in range(1, 41)]) / (x * x).sum(axis=0)
    Q = N * (N + 2) * (rho**2 / (N - np.arange(1, 41)[:, None])).sum(axis=0)  # Ljung and Box
    np.testing.assert_allclose(seen.white_p, chi2.sf(Q, 40), rtol=0.05)


def test_gaps_and_recordings_are_no_neighbours():
    model = arm()
    log = log_of(model, seconds=10.0, starts=[0, 700, 1300])
    base = rm.base_parameters(model)
    system = equations(base, log, raw(log, 1, 0.15))
    values = 0.9 * base.values(model)  # residuals that last
    e, use = residuals(system, values)
    assert 0 < use.sum() < use.size
    recording = np.searchsorted([700, 1300], np.arange(len(e)), side="right")
    seen = residual_diagnostics(system, values)
    for j in range(3):
        mu, gamma = e[use[:, j], j].mean(), e[use[:, j], j].var()
        for lag in range(1, 6):
            both = use[lag:, j] & use[:-lag, j] & (recording[lag:] == recording[:-lag])
            product = ((e[lag:, j] - mu) * (e[:-lag, j] - mu))[both].mean()
            assert seen.autocorrelation[j, lag] == pytest.approx(product / gamma, abs=1e-9)
            assert seen.bounds[j, lag] == pytest.approx(1.959964 / np.sqrt(both.sum()))


# --- parameters -----------------------------------------------------------------------------------


def test_a_negative_friction_is_named_with_its_certainty():
    model = arm()
    wrong = replace(model.drive, Fv=np.array([2.0, -2.0, 2.0]))
    log = log_of(model.with_drive(wrong))
    result = fit(model, log, processing=raw(log), checked=False)
    joint = int(model.table.joint_rows[1]) + 1
    signs = {one.name: one for one in negative_parameters(result.base, result.estimate)}
    assert signs[f"Fv{joint}"].certain
    assert f"Fv{joint} = -2 is negative" in report(result).replace("\n  ", " ")
    log = log_of(model)
    good = fit(model, log, processing=raw(log), checked=False)
    assert not any(one.certain for one in negative_parameters(good.base, good.estimate))


def test_lists_of_parameters_agree_with_the_covariance(found):
    relative = dict(zip(found.names, found.relative_errors, strict=True))
    assert set(weak_parameters(found.estimate)) == {x for x in relative if relative[x] > WEAK}
    C = found.estimate.correlation
    assert len(correlated_estimates(found.estimate)) == np.triu(np.abs(C) > CORRELATED, k=1).sum()
    both = correlated_pairs(C, found.names, 0.5)
    assert {c > 0.0 for *_, c in both} == {True, False}
    assert len(both) == np.triu(np.abs(C) > 0.5, k=1).sum()
    assert all(C[found.names.index(a), found.names.index(b)] == c for a, b, c in both)
    assert abs(both[0][2]) == max(abs(c) for *_, c in both)
    white = found.details.iid_standard_errors
    np.testing.assert_allclose(standard_error_ratio(found) * white, found.standard_errors)


def test_what_a_parameter_stands_for_fits_and_counts_its_terms():
    base = rm.base_parameters(rm.load("rx90"))
    for name, row in zip(base.names, base.matrix, strict=True):
        text = regrouped_text(base, name, 29)
        assert len(text) <= 29
        assert text.startswith(name)
        left = int(text.split("... ")[1].split()[0]) if "..." in text else 0
        shown = text.split(" ...")[0].replace(" - ", " + ").split(" + ")
        assert len(shown) + left == np.count_nonzero(row)


# --- report ---------------------------------------------------------------------------------------


def test_the_report_has_all_parameters_units_and_what_was_refused(found):
    text = report(found)
    rows = {}
    for line in text.split("Parameters\n---")[1].splitlines():
        cells = [cell.strip() for cell in line.split("│")[1:-1]]
        if len(cells) == 7:
            rows[cells[0].removesuffix("R")] = cells
    for k, name in enumerate(found.names):
        assert float(rows[name][2]) == pytest.approx(found.values[k], rel=1e-3)
        assert float(rows[name][3]) == pytest.approx(found.standard_errors[k], rel=0.06)
        assert float(rows[name][5]) < found.values[k] < float(rows[name][6])
    assert "4 rows were refused. run.csv: 4 (rows 3 to 9)" in text
    assert group_units(found) == ("N", "N m", "N m")
    assert "kg │" in text  # rotor inertia of the joint that slides
    assert "N s/m" in text
    log = found.equations.log
    whole = fit(found.model, log, form="power", processing=raw(log), checked=False)
    assert (group_names(whole), group_units(whole)) == (("whole robot",), ("W",))
    assert result_data(whole)["method"]["form"] == "POWER"


# --- files ----------------------------------------------------------------------------------------


def test_json_holds_everything_to_the_bit_and_no_nan(found, tmp_path):
    write_result(found, tmp_path / "result.json")

    def refuse(word):
        raise AssertionError(word)

    data = json.loads((tmp_path / "result.json").read_text(), parse_constant=refuse)
    rows = data["parameters"]
    assert [row["name"] for row in rows] == list(found.names)
    assert [row["value"] for row in rows] == found.values.tolist()
    assert [row["standard_error"] for row in rows] == found.standard_errors.tolist()
    assert data["covariance"] == found.covariance.tolist()
    assert data["status"] == {"name": "SOLVED", "sentence": found.reason()}
    assert data["method"]["name"] == "wls"
    assert data["data"]["refused"][0]["rows"] == [3, 4, 5, 9]
    assert data["data"]["sources"][0]["sha256"] == "ab" * 32
    assert data["errors"]["held_out"]["rmse"] == found.validation.held_out.rmse.tolist()
    with pytest.raises(InvalidValueError, match=r"\.json or \.urdf"):
        write_result(found, tmp_path / "result.txt")


@pytest.mark.filterwarnings("ignore::robotmodels.errors.UrdfWarning")
def test_the_urdf_is_of_real_bodies_and_has_the_torques(found, tmp_path):
    robot = consistent_robot(found)
    write_result(found, tmp_path / "robot.urdf", robot)
    again = rm.RobotModel.from_urdf(tmp_path / "robot.urdf")
    assert again.inertia.is_physical.all()
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-0.5, 0.5, (3, 20, 3))
    whole = robot.of(found.model)
    np.testing.assert_allclose(
        rm.idm(again, q, v, a, drive=False), rm.idm(whole, q, v, a, drive=False), atol=1e-8
    )
    # and these are those of the robot that moved, to the noise of its log
    error = rm.idm(whole, q, v, a) - rm.idm(found.model, q, v, a)
    assert np.abs(error).max() < 0.05
    text = report(found, robot)
    assert "Physically consistent robot" in text
    data = result_data(found, robot)["consistent"]
    assert list(data["base"]) == list(found.names)
    assert data["residual_increase_percent"] == robot.residual_increase

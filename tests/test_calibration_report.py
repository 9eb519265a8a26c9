"""The report on a calibration says what the result holds, as text and as a page."""

import re
from html import unescape

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robotmodels import se3
from robotmodels.calibration import KnownDistance, PointContact, Pose, Position, fit
from robotmodels.calibration.candidates import candidate_parameters
from robotmodels.calibration.differential import differential_model
from robotmodels.calibration.problem import linearised
from robotmodels.calibration.report import measured_residuals, report, report_sections
from robotmodels.errors import InvalidValueError
from robotmodels.estimation.correlation import correlated_pairs
from robotmodels.kinematics import dgm
from robotmodels.robots import load
from robotmodels.table_text import ReportTable, degrees, in_unit, millimetres
from robotmodels.viz import html_report

UR10 = load("erd:ur10")
CANDIDATES = candidate_parameters(UR10)
OUTLIERS = [7, 31]


@pytest.fixture(scope="module")
def poses():
    """Poses with two gross errors, by a robust fit."""
    rng = np.random.default_rng(0)
    xi = 1e-3 * rng.normal(size=len(CANDIDATES))
    q = rng.uniform(-2.5, 2.5, (60, 6))
    T = differential_model(CANDIDATES, q, xi).T.copy()
    T[:, :3, 3] += 1e-4 * rng.normal(size=(60, 3))
    turns = Rotation.from_rotvec(1e-4 * rng.normal(size=(60, 3)))
    T[:, :3, :3] = turns.as_matrix() @ T[:, :3, :3]
    T[OUTLIERS, :3, 3] += 0.02
    return fit(UR10, Pose(q, T, name="tracker"), loss="tukey")


@pytest.fixture(scope="module")
def contacts():
    """A point in two postures only and many of another, with a known distance."""
    rng = np.random.default_rng(2)
    arm = load("rx90")
    arm = arm.with_tool(se3.translation(0.05, 0.03, 0.1))
    q = rng.uniform(-1.8, 1.8, (40, 6))
    p = dgm(arm, q)[:, :3, 3] + 1e-4 * rng.normal(size=(40, 3))
    touched = PointContact(q[:2], [0, 1], name="ball")
    far = float(np.linalg.norm(p[0] - p[1]))
    return fit(arm, [Position(q, p, sigma=1e-4), touched, KnownDistance("ball:0", "ball:1", far)],
               known=["d3"], folds=0, held_out=0.0)  # fmt: skip


def tables(result, title):
    (section,) = [s for s in report_sections(result) if s.title == title]
    return [part for part in section.body if isinstance(part, ReportTable)]


def cells(table):
    """Rows by their first cell."""
    return {row[0]: row[1:] for row in zip(*(c for _, c in table.columns), strict=True)}


def test_the_errors_are_those_of_the_result(poses):
    (table,) = tables(poses, "Errors before and after")
    rows = cells(table)
    v = poses.validation
    for name, errors in (
        ("robot as given", v.given), ("base and tool fitted", v.nominal),
        ("calibrated", v.in_sample), ("5 folds, before", v.folds.nominal),
        ("5 folds, after", v.folds), ("held out, before", v.held_out.nominal),
        ("held out, after", v.held_out),
    ):  # fmt: skip
        wanted = []
        for unit in ("m", "rad"):
            sizes = errors.rms[unit], errors.mean[unit], errors.max[unit]
            wanted += [str(errors.count[unit]), *(in_unit(x, unit) for x in sizes)]
        assert rows[name] == tuple(wanted)


def test_every_parameter_is_in_the_tables_once(poses):
    rows = {}
    for table in tables(poses, "Parameters"):
        assert not rows.keys() & cells(table).keys()
        rows |= cells(table)
    assert set(rows) == set(poses.names)
    for k, name in enumerate(poses.names):
        unit = poses.units[k]
        assert rows[name][1] == in_unit(poses.corrections[k], unit)
        assert rows[name][2] == in_unit(poses.values[k], unit)
        assert rows[name][3] == in_unit(poses.standard_errors[k], unit)
        low, high = float(rows[name][5]), float(rows[name][6])
        assert low <= float(rows[name][1]) <= high


def test_lengths_are_in_millimetres_and_angles_in_degrees(poses):
    found = {table.columns[0][0]: table for table in tables(poses, "Parameters")}
    assert set(found) == {"mm", "deg"}
    k = poses.names.index("d3")
    assert abs(float(cells(found["mm"])["d3"][2]) - 1e3 * poses.values[k]) < 1e-4
    k = poses.names.index("alpha2")
    assert abs(float(cells(found["deg"])["alpha2"][2]) - np.degrees(poses.values[k])) < 1e-4
    assert millimetres(float("nan")) == "-"
    assert (millimetres(1e-8), degrees(0.0), in_unit(0.25, "1")) == ("1.0e-05", "0", "2.500e-01")


def test_outliers_are_listed_with_their_rows(poses):
    (table,) = tables(poses, "Outliers")
    rows = cells(table)
    assert {int(number) - 1 for number in rows} == set(OUTLIERS)
    name, row, size, _, weight = rows[str(OUTLIERS[0] + 1)]
    assert (name, row) == ("tracker", str(OUTLIERS[0] + 1))
    assert float(size) > 20.0
    assert float(weight) == 0.0


def test_what_is_not_estimated_is_listed_with_its_reason(contacts):
    text = report(contacts)
    assert "d3: it is known and fixed." in text
    assert "theta7: it does not change what is measured." in text
    for name in contacts.identifiable.regrouped_into:
        assert f"* {name}: " in text
    assert "* r1: +1 r0\n" in text


def test_kinds_noise_and_ranges(contacts):
    kinds, ranges = tables(contacts, "Measurements")
    assert [row[1] for row in cells(kinds).values()] == [
        "Position",
        "PointContact",
        "KnownDistance",
    ]
    q = contacts.solution.problem.measurements[0].q
    assert float(cells(ranges)["3"][2]) == round(float(np.degrees(q[:, 2].min())), 1)
    (noise,) = tables(contacts, "Noise")
    assert "stated" in noise.columns[4][1]
    assert "estimated" in noise.columns[4][1]
    assert "No measurements were held out" in report(contacts)


def test_lines_fit_in_a_hundred_columns(poses, contacts):
    for result in (poses, contacts):
        text = report(result)
        assert text == report(result)
        assert max(map(len, text.splitlines())) <= 100
        assert "nan" not in text
        for title in ("Outcome", "Noise", "Base and tool", "Quality of the fit"):
            assert f"\n{title}\n{'-' * len(title)}\n" in text


def test_correlations_are_sorted_and_from_the_result(poses):
    pairs = correlated_pairs(poses.correlation, poses.names, 0.3)
    sizes = [abs(c) for *_, c in pairs]
    assert sizes == sorted(sizes, reverse=True)
    a, b, c = pairs[0]
    i, j = poses.names.index(a), poses.names.index(b)
    off = poses.correlation - np.eye(len(poses.names))
    assert i < j
    assert c == poses.correlation[i, j]
    assert abs(c) == np.abs(off).max()


def test_residuals_row_by_row(poses, contacts):
    (part,) = measured_residuals(poses)
    problem = poses.solution.problem
    (wanted,) = linearised(problem, poses.solution.corrections, poses.solution.fixtures)
    np.testing.assert_array_equal(part.after, wanted.residual)
    after = np.linalg.norm(part.after[:, :3], axis=1)
    np.testing.assert_allclose(after, poses.validation.in_sample.position)
    np.testing.assert_allclose(
        np.linalg.norm(part.before[:, :3], axis=1), poses.validation.nominal.position, rtol=1e-5
    )
    np.testing.assert_allclose(part.whitened.ravel(), poses.solution.fit.whitened)
    assert np.flatnonzero(part.outlier).tolist() == OUTLIERS
    parts = measured_residuals(contacts)
    assert [part.blocks.tolist() for part in parts] == [list(range(40)), [40, 41], [42]]
    assert np.isnan(parts[2].p).all()


# --- the page -------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_the_page_says_what_the_text_says_and_needs_no_network(contacts, tmp_path):
    html_report(contacts, tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    sections = report_sections(contacts)
    headings = [unescape(x) for x in re.findall(r"<h2[^>]*>(.*?)</h2>", text)]
    assert headings == [s.title for s in sections] + ["Figures"]
    wanted = {cell for s in sections for part in s.body if isinstance(part, ReportTable)
              for _, column in part.columns for cell in column}  # fmt: skip
    cells = {unescape(x) for x in re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", text)}
    assert wanted - {""} <= cells
    images = re.findall(r'<img [^>]*src="([^"]*)"', text)
    assert len(images) == 5
    assert all(image.startswith("data:image/svg+xml;base64,") for image in images)
    assert "<script" not in text
    assert "http" not in re.sub(r"base64,[^\"]*", "", text)
    with pytest.raises(InvalidValueError, match="expected a CalibrationResult"):
        html_report("result", tmp_path / "b.html")

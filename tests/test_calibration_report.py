"""The report on a calibration says what the result holds, as text and as a page."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robotmodels.calibration import Pose, fit
from robotmodels.calibration.candidates import candidate_parameters
from robotmodels.calibration.differential import differential_model
from robotmodels.calibration.report import report_sections
from robotmodels.estimation.estimate import correlated_pairs
from robotmodels.robots import load
from robotmodels.table_text import ReportTable, in_unit

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

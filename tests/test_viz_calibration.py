"""Figures of calibrations: they show the numbers of the result, for few and for many."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from scipy.spatial.transform import Rotation

from robotmodels import se3
from robotmodels.calibration import KnownDistance, PointContact, Pose, Position, fit
from robotmodels.calibration.residuals import measured_residuals
from robotmodels.errors import InvalidValueError
from robotmodels.estimation import confidence_intervals
from robotmodels.kinematics import dgm
from robotmodels.robots import load
from robotmodels.viz import (
    plot_calibration_correlations,
    plot_calibration_in_space,
    plot_calibration_normality,
    plot_calibration_parameters,
    plot_calibration_residuals,
)

RX90 = load("rx90").with_tool(se3.translation(0.05, 0.03, 0.1))
PLOTS = (
    plot_calibration_residuals, plot_calibration_in_space, plot_calibration_parameters,
    plot_calibration_correlations, plot_calibration_normality,
)  # fmt: skip


def made(count, gross=()):
    rng = np.random.default_rng(count)
    q = rng.uniform(-2.0, 2.0, (count, 6))
    real = RX90.with_base(se3.translation(0.001, -0.002, 0.0)).with_tool(
        RX90.tool @ se3.translation(0.002, 0.0, 0.001)
    )
    T = dgm(real, q + np.array([0, 2e-3, -1e-3, 1e-3, 0, 0]))
    T[:, :3, 3] += 1e-4 * rng.normal(size=(count, 3))
    T[:, :3, :3] = (
        Rotation.from_rotvec(2e-4 * rng.normal(size=(count, 3))).as_matrix() @ (T[:, :3, :3])
    )
    T[list(gross), :3, 3] += 0.02
    return q, T


@pytest.fixture(scope="module")
def results():
    few, T = made(25)
    many, S = made(500, gross=(3, 77))
    q, P = made(30)
    touched = PointContact(q[:2], [0, 1], name="ball")
    far = float(np.linalg.norm(P[0, :3, 3] - P[1, :3, 3]))
    mixed = [Position(q, P[:, :3, 3]), touched, KnownDistance("ball:0", "ball:1", far, sigma=1e-3)]
    more = {"folds": 0, "held_out": 0.0}
    return {
        "few": fit(RX90, Pose(few, T), **more),
        "many": fit(RX90, Pose(many, S), loss="huber", **more),
        "mixed": fit(RX90, mixed, **more),
    }


@pytest.mark.parametrize("name", ["few", "many", "mixed"])
@pytest.mark.parametrize("plot", PLOTS)
def test_nothing_covers_anything_else(results, name, plot):
    figure = plot(results[name], title="A robot")
    figure.draw_without_rendering()
    FigureCanvasAgg(figure)
    boxes = [axes.get_tightbbox() for axes in figure.axes if axes.name != "3d"]
    boxes += [each.get_window_extent() for each in figure.legends]
    slack = 2.0  # pixels
    for box in boxes:
        assert min(box.x0, box.y0) >= -slack
        assert box.x1 <= figure.bbox.x1 + slack
        assert box.y1 <= figure.bbox.y1 + slack
    for a, b in combinations(boxes, 2):
        width, height = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(width, height) <= slack
    for text in figure.findobj(Text):
        if text.get_visible() and text.get_text():
            assert 6.5 <= text.get_size() <= 10.0, text


def test_residuals_are_those_of_the_result(results):
    result = results["few"]
    (part,) = measured_residuals(result)
    figure = plot_calibration_residuals(result)
    assert len(figure.axes) == 12
    assert [axes.get_ylabel() for axes in figure.axes[::2]] == [
        "x (mm)", "y (mm)", "z (mm)", "rx (deg)", "ry (deg)", "rz (deg)",
    ]  # fmt: skip
    for k in range(6):
        factor = 1e3 if k < 3 else 180.0 / np.pi
        for side, values in enumerate((part.before, part.after)):
            axes = figure.axes[2 * k + side]
            x, y = next(line for line in axes.get_lines() if len(line.get_xdata()) == 25).get_data()
            np.testing.assert_array_equal(x, np.arange(1, 26))
            np.testing.assert_allclose(y, factor * values[:, k])
            rms = np.sqrt(np.mean((factor * values[:, k]) ** 2))
            assert f"rms {rms:.3g}" in axes.get_title(loc="right")
            assert axes.get_ylim()[1] >= np.abs(y).max()


def test_outliers_do_not_set_the_scale_but_are_marked(results):
    figure = plot_calibration_residuals(results["many"])
    (part,) = measured_residuals(results["many"])
    assert {3, 77} <= set(np.flatnonzero(part.outlier))
    after = figure.axes[1]
    assert after.get_ylim()[1] < 2.0  # mm; the outliers are at 20
    (rings,) = [line for line in after.get_lines() if str(line.get_label()).startswith("outlier")]
    assert {4, 78} <= set(np.asarray(rings.get_xdata()).tolist())
    assert np.abs(rings.get_ydata()).max() <= after.get_ylim()[1]
    space = plot_calibration_in_space(results["many"])
    crosses = [c for c in space.axes[0].collections if len(c.get_offsets()) == part.outlier.sum()]
    assert len(crosses) == 1
    title = plot_calibration_normality(results["many"]).legends[0].get_title().get_text()
    assert title == f"{6 * part.outlier.sum()} rows of outliers are left out"


def test_parameters_and_intervals_are_those_of_the_result(results):
    result = results["few"]
    figure = plot_calibration_parameters(result, 0.9)
    shown = {}
    for axes, unit in zip(figure.axes, ("m", "rad"), strict=True):
        factor = 1e3 if unit == "m" else 180.0 / np.pi
        names = [text.get_text() for text in axes.get_yticklabels()]
        for bars in axes.containers:
            line, _, (ends,) = bars
            for x, y, segment in zip(*line.get_data(), ends.get_segments(), strict=True):
                shown[names[int(y)]] = (x / factor, *(segment[:, 0] / factor))
    assert set(shown) == set(result.names)
    interval = confidence_intervals(result.solution.fit, 0.9)
    for k, name in enumerate(result.names):
        np.testing.assert_allclose(shown[name], (result.deviation[k], *interval[k]), atol=1e-12)
    assert "90 % intervals" in figure.legends[0].get_title().get_text()


def test_correlations_are_ordered_from_the_base_to_the_end(results):
    result = results["few"]
    axes = plot_calibration_correlations(result).axes[0]
    names = [text.get_text() for text in axes.get_yticklabels()]
    C = np.asarray(axes.images[0].get_array())
    for (i, a), (j, b) in combinations(enumerate(names), 2):
        k, m = result.names.index(a), result.names.index(b)
        assert C[i, j] == result.correlation[k, m]
    rows = [result.parameters.entries[result.names.index(name)].row for name in names]
    assert rows == sorted(rows)


def test_arrows_in_space_are_the_errors_magnified(results):
    result = results["few"]
    (part,) = measured_residuals(result)
    axes = plot_calibration_in_space(result, magnification=250.0).axes[1]
    assert "arrows x 250" in axes.get_title()
    (arrows,) = [c for c in axes.collections if hasattr(c, "_segments3d")]
    shafts = np.array([segment for segment in arrows._segments3d if len(segment) == 2])[:25]
    length = np.linalg.norm(shafts[:, 1] - shafts[:, 0], axis=1)
    np.testing.assert_allclose(
        np.sort(length), np.sort(250.0 * np.linalg.norm(part.after[:, :3], axis=1)), rtol=1e-6
    )


def test_what_cannot_be_drawn_is_named(results):
    for plot in PLOTS:
        with pytest.raises(InvalidValueError, match="expected a CalibrationResult"):
            plot(results)
    with pytest.raises(InvalidValueError, match="magnification: expected a positive"):
        plot_calibration_in_space(results["few"], magnification=0.0)
    with pytest.raises(InvalidValueError, match="level"):
        plot_calibration_parameters(results["few"], 1.5)

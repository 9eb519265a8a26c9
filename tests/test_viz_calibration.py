"""Figures of calibrations: they show the numbers of the result, for few and for many."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from scipy.spatial.transform import Rotation

from robotmodels import se3
from robotmodels.calibration import (
    KnownDistance,
    ParameterPrior,
    PointContact,
    Pose,
    Position,
    calibrated_model,
    calibrated_pose,
    candidate_parameters,
    fit,
    select_configurations,
)
from robotmodels.calibration.report import measured_residuals
from robotmodels.datasets import panda_double_socket
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.estimation import confidence_intervals
from robotmodels.kinematics import dgm
from robotmodels.robots import load
from robotmodels.viz import (
    plot_calibration_correlations,
    plot_calibration_in_space,
    plot_calibration_normality,
    plot_calibration_parameters,
    plot_calibration_residuals,
    plot_selection,
)
from robotmodels.viz.plot_pose_path import _taken

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
            assert 8.0 <= text.get_size() <= 10.0, text


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
        np.testing.assert_allclose(shown[name], (result.corrections[k], *interval[k]), atol=1e-12)
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


@pytest.fixture(scope="module")
def sockets():
    data = panda_double_socket()
    measured = []
    for place, both in data.places.items():
        hole = np.repeat([0, 1], [len(q) for q in both])
        measured += [
            PointContact(np.concatenate(both), hole, name=place),
            KnownDistance(f"{place}:0", f"{place}:1", data.distance),
        ]
    prior = ParameterPrior(length=3e-4, angle=6e-3, compliance=6e-5)
    return fit(data.model, measured, compliance="isotropic", prior=prior, folds=0, held_out=0.0)


def longest_arrow(axes):
    (arrows,) = [c for c in axes.collections if hasattr(c, "_segments3d")]
    shafts = np.array([segment for segment in arrows._segments3d if len(segment) == 2])
    return np.linalg.norm(shafts[:, 1] - shafts[:, 0], axis=1).max()


@pytest.mark.parametrize("size", [None, (7.1, 7.0)])
def test_far_places_have_panels_of_their_own(sockets, size):
    figure = plot_calibration_in_space(sockets, size=size)
    parts = [part for part in measured_residuals(sockets) if part.measurement.views]
    assert len(figure.axes) == 6
    for row, part in enumerate(parts):
        for side, errors in enumerate((part.before, part.after)):
            axes = figure.axes[2 * row + side]
            rms = 1e3 * np.sqrt(np.mean(np.sum(errors**2, axis=1)))
            name = "after" if side else "before"
            assert axes.get_title().startswith(f"{part.measurement.name}, {name}: rms {rms:.3g} mm")
            limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
            assert np.ptp(limits, axis=1).max() < 150.0  # mm; the places are 1 m apart
            assert longest_arrow(axes) > 0.1 * np.ptp(limits, axis=1).max()


@pytest.mark.parametrize(
    ("name", "size", "title"),
    [("few", None, None), ("mixed", (7.1, 3.0), "A robot"), ("few", (5.0, 6.0), None)],
)
def test_boxes_with_their_texts_stay_in_their_halves(results, name, size, title):
    figure = plot_calibration_in_space(results[name], size=size, title=title)
    FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    assert len(figure.axes) == 2
    top = min(t.get_window_extent().y0 for t in figure.texts if "arrows" in t.get_text())
    for side, axes in enumerate(figure.axes):
        low, high = _taken(axes)
        width = figure.bbox.width
        assert low[0] >= 0.5 * side * width - 2.0
        assert high[0] <= 0.5 * (side + 1) * width + 2.0
        assert low[1] >= -2.0
        assert high[1] <= top + 2.0
        assert not axes.patch.get_visible()  # it would hide its neighbour's names


def test_flat_scenes_are_low():
    rng = np.random.default_rng(5)
    q = rng.uniform(-2.0, 2.0, (40000, 6))
    p = dgm(RX90, q)[:, :3, 3]
    q = q[np.abs(p[:, 2] - 0.2) < 0.005][:60]
    T = dgm(RX90, q)
    T[:, :3, 3] += 1e-4 * rng.normal(size=(len(q), 3))
    flat = fit(RX90, Position(q, T[:, :3, 3]), folds=0, held_out=0.0)
    assert plot_calibration_in_space(flat).get_figheight() < 3.0


def test_compliance_is_shown_in_whole_numbers(sockets):
    figure = plot_calibration_parameters(sockets)
    axes = figure.axes[2]
    assert axes.get_xlabel() == "correction (µrad/(N m))"
    figure.draw_without_rendering()
    assert axes.xaxis.get_offset_text().get_text() == ""
    names = [text.get_text() for text in axes.get_yticklabels()]
    values = {}
    for bars in axes.containers:
        values |= dict(zip(bars[0].get_ydata(), bars[0].get_xdata(), strict=True))
    for k, name in enumerate(names):
        found = sockets.corrections[sockets.names.index(name)]
        assert values[k] == pytest.approx(1e6 * found)


def crosses(figure):
    """Drawn truth by name, m or rad."""
    shown = {}
    for axes in figure.axes:
        factor = 1e3 if "mm" in axes.get_xlabel() else 180.0 / np.pi
        names = [text.get_text() for text in axes.get_yticklabels()]
        for line in axes.get_lines():
            if line.get_label() == "truth":
                x, y = line.get_data()
                shown |= {names[int(j)]: v / factor for j, v in zip(y, x, strict=True)}
    return shown


def test_known_truth_is_drawn_where_the_fit_finds_it():
    # exact data: estimates are the truth, regrouped and counted from where the fit put the base
    rng = np.random.default_rng(2)
    p = candidate_parameters(RX90)
    xi = 1e-5 * rng.normal(size=len(p))
    q = rng.uniform(-2.0, 2.0, (60, 6))
    T = calibrated_pose(calibrated_model(p, xi), q)
    result = fit(RX90, Position(q, T[:, :3, 3]), folds=0, held_out=0.0)
    truth = dict(zip(p.names, xi, strict=True))
    assert any(len(terms) > 1 for terms in result.identifiable.regrouping.values())
    figure = plot_calibration_parameters(result, truth=truth)
    shown = crosses(figure)
    assert set(shown) == set(result.names)
    for name, deviation in zip(result.names, result.corrections, strict=True):
        assert shown[name] == pytest.approx(deviation, abs=2e-9)
    assert figure.legends[0].get_texts()[-1].get_text() == "truth"
    some = crosses(plot_calibration_parameters(result, truth={"d3": truth["d3"]}))
    assert {name for name, value in some.items() if np.isfinite(value)} >= {"d3"}
    assert np.isnan(some["r4"])


def test_truth_in_the_order_of_the_parameters(results):
    result = results["few"]
    given = np.full(len(result.names), np.nan)
    at = result.names.index("theta3")
    given[at] = 1e-3
    shown = crosses(plot_calibration_parameters(result, truth=given))
    assert shown["theta3"] == pytest.approx(1e-3)
    with pytest.raises(ShapeError, match="truth: expected one correction"):
        plot_calibration_parameters(result, truth=given[1:])
    with pytest.raises(InvalidValueError, match=r"truth: expected names of candidates.*theta33"):
        plot_calibration_parameters(result, truth={"theta33": 0.0})


def test_rings_at_the_edge_leave_the_root_mean_squares_free(results):
    figure = plot_calibration_residuals(results["many"])
    FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    for axes in figure.axes:
        text = axes._right_title.get_window_extent()
        half = 0.5 * (6.0 + 0.9) * figure.dpi / 72.0
        assert text.y0 >= axes.bbox.y1 + half - 1.0


def test_selection_shows_its_numbers():
    selected = select_configurations(
        RX90, "position", 30, drawn=100, starts=1, rng=np.random.default_rng(1)
    )
    figure = plot_selection(selected, 0.05)
    line = figure.axes[0].get_lines()[0]
    np.testing.assert_array_equal(line.get_xdata(), selected.counts)
    np.testing.assert_array_equal(line.get_ydata(), selected.values)
    for axes, unit, factor in zip(figure.axes[1:], ("m", "rad"), (1e3, 180.0 / np.pi), strict=True):
        own = [u == unit for u in selected.parameters.units]
        drawn = {line.get_label(): line.get_ydata() for line in axes.get_lines()}
        values = factor * selected.standard_errors[:, own]
        np.testing.assert_allclose(drawn["median"], np.median(values, axis=1))
        np.testing.assert_allclose(drawn["largest"], values.max(axis=1))
        assert axes.get_yscale() == "log"
    enough = selected.enough(0.05)
    assert enough is not None
    for axes in figure.axes:
        assert axes.get_lines()[-1].get_xdata()[0] == enough
    assert figure.legends[0].get_title().get_text() == selected.enough_sentence(0.05)
    assert [text.get_text() for text in figure.legends[0].get_texts()][-1] == f"enough: {enough}"
    never = plot_selection(selected, 1e-6)
    assert len(never.legends[0].get_texts()) == 3
    with pytest.raises(InvalidValueError, match="expected SelectedConfigurations"):
        plot_selection(selected.q)
    with pytest.raises(InvalidValueError, match="gain"):
        plot_selection(selected, 2.0)

"""Figures and reports of calibrations and identifications show the numbers of the results."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_viz_figures import data, lines

import robotmodels as rm
from robotmodels import calibration as cal
from robotmodels import identification as idn
from robotmodels import se3, viz
from robotmodels.calibration.report import measured_residuals
from robotmodels.errors import InvalidValueError, RobotModelsError, ShapeError
from robotmodels.estimation import confidence_intervals
from robotmodels.identification.excitation import exciting_trajectory
from robotmodels.minimal_parameters import uniform_bodies

RX90 = rm.load("rx90").with_tool(se3.translation(0.05, 0.03, 0.1))
DT = 0.002
DEGREES = 180.0 / np.pi


def poses(count, gross=()):
    """Poses of a robot that differs from the nominal one, with noise and gross errors."""
    rng = np.random.default_rng(count)
    q = rng.uniform(-2.0, 2.0, (count, 6))
    real = RX90.with_base(se3.translation(0.001, -0.002, 0.0))
    T = rm.dgm(real, q + np.array([0, 2e-3, -1e-3, 1e-3, 0, 0]))
    T[:, :3, 3] += 1e-4 * rng.normal(size=(count, 3))
    turns = Rotation.from_rotvec(2e-4 * rng.normal(size=(count, 3)))
    T[:, :3, :3] = turns.as_matrix() @ T[:, :3, :3]
    T[list(gross), :3, 3] += 0.02
    return q, T


@pytest.fixture(scope="module")
def calibrated():
    """Few poses; many with outliers; places that are far apart."""
    more = {"folds": 0, "held_out": 0.0}
    sockets = rm.datasets.panda_double_socket()
    touched = []
    for place, both in sockets.places.items():
        hole = np.repeat([0, 1], [len(q) for q in both])
        touched.append(cal.PointContact(np.concatenate(both), hole, name=place))
        touched.append(cal.KnownDistance(f"{place}:0", f"{place}:1", sockets.distance))
    return {
        "few": cal.fit(RX90, cal.Pose(*poses(25)), **more),
        "many": cal.fit(RX90, cal.Pose(*poses(200, (3, 77))), loss="huber", **more),
        "sockets": cal.fit(sockets.model, touched, base=False, **more),
    }


def test_residuals_are_those_of_the_result(calibrated):
    figure = viz.plot_calibration_residuals(calibrated["few"])
    (part,) = measured_residuals(calibrated["few"])
    for k in range(6):
        factor = 1e3 if k < 3 else DEGREES
        words = ("before: base and tool fitted", "after the calibration")
        for axes, values, word in zip(
            figure.axes[2 * k :], (part.before, part.after), words, strict=False
        ):
            np.testing.assert_allclose(data(axes, word), factor * values[:, k])
            # the two sides have scales of their own
            assert axes.yaxis.get_tick_params()["labelleft"]
    (part,) = measured_residuals(calibrated["many"])
    assert {3, 77} <= set(np.flatnonzero(part.outlier))
    after = viz.plot_calibration_residuals(calibrated["many"]).axes[1]
    assert after.get_ylim()[1] < 2.0  # mm; the outliers are at 20
    (rings,) = lines(after, "outlier (at the edge: beyond it)")
    assert {4, 78} <= set(np.asarray(rings.get_xdata()).tolist())


def shown_intervals(axes, factor):
    """Estimate and ends of the interval of each name."""
    names = [text.get_text() for text in axes.get_yticklabels()]
    shown = {}
    for bars in axes.containers:
        points, _, (ends,) = bars
        for x, y, segment in zip(*points.get_data(), ends.get_segments(), strict=True):
            shown[names[int(y)]] = (x / factor, *(segment[:, 0] / factor))
    return shown


def test_parameters_and_correlations_are_those_of_the_result(calibrated):
    result = calibrated["few"]
    figure = viz.plot_calibration_parameters(result, 0.9)
    shown = shown_intervals(figure.axes[0], 1e3) | shown_intervals(figure.axes[1], DEGREES)
    interval = confidence_intervals(result.solution.fit, 0.9)
    for k, name in enumerate(result.names):
        expected = (result.corrections[k], *interval[k])
        np.testing.assert_allclose(shown.pop(name), expected, atol=1e-12)
    assert shown == {}
    axes = viz.plot_calibration_correlations(result).axes[0]
    names = [text.get_text() for text in axes.get_yticklabels()]
    k = [result.names.index(name) for name in names]
    values = np.asarray(axes.collections[0].get_array())
    np.testing.assert_array_equal(values, result.correlation[np.ix_(k, k)])


def truth_drawn(figure):
    shown = {}
    for axes in figure.axes:
        factor = 1e3 if "mm" in axes.get_xlabel() else DEGREES
        names = [text.get_text() for text in axes.get_yticklabels()]
        for line in lines(axes, "truth"):
            x, y = line.get_data()
            shown |= {names[int(j)]: v / factor for j, v in zip(y, x, strict=True)}
    return shown


def test_known_truth_is_drawn_where_the_fit_finds_it(calibrated):
    # exact data: estimates are the truth, regrouped and counted from where the fit put the base
    rng = np.random.default_rng(2)
    p = cal.candidate_parameters(RX90)
    xi = 1e-5 * rng.normal(size=len(p))
    q = rng.uniform(-2.0, 2.0, (60, 6))
    T = cal.calibrated_pose(cal.calibrated_model(p, xi), q)
    result = cal.fit(RX90, cal.Position(q, T[:, :3, 3]), folds=0, held_out=0.0)
    assert any(len(terms) > 1 for terms in result.identifiable.regrouping.values())
    truth = dict(zip(p.names, xi, strict=True))
    shown = truth_drawn(viz.plot_calibration_parameters(result, truth=truth))
    assert set(shown) == set(result.names)
    for name, correction in zip(result.names, result.corrections, strict=True):
        assert shown[name] == pytest.approx(correction, abs=2e-9)
    few = calibrated["few"]
    given = np.where(np.array(few.names) == "theta3", 1e-3, np.nan)
    drawn = truth_drawn(viz.plot_calibration_parameters(few, truth=given))
    assert drawn["theta3"] == pytest.approx(1e-3)
    with pytest.raises(ShapeError, match="truth: expected one correction"):
        viz.plot_calibration_parameters(few, truth=given[1:])
    with pytest.raises(InvalidValueError, match=r"truth: expected names of candidates.*theta33"):
        viz.plot_calibration_parameters(few, truth={"theta33": 0.0})


def arrow_lengths(axes):
    (arrows,) = [c for c in axes.collections if hasattr(c, "_segments3d")]
    shafts = np.array([segment for segment in arrows._segments3d if len(segment) == 2])
    return np.linalg.norm(shafts[:, 1] - shafts[:, 0], axis=1)


def test_arrows_in_space_are_the_errors_magnified(calibrated):
    (part,) = measured_residuals(calibrated["few"])
    figure = viz.plot_calibration_in_space(calibrated["few"], magnification=250.0)
    expected = 250.0 * np.linalg.norm(part.after[:, :3], axis=1)
    drawn = arrow_lengths(figure.axes[1])[: len(expected)]
    np.testing.assert_allclose(np.sort(drawn), np.sort(expected), rtol=1e-6)
    # places far apart have panels of their own
    figure = viz.plot_calibration_in_space(calibrated["sockets"])
    assert len(figure.axes) == 6
    for axes in figure.axes:
        extent = np.ptp([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1).max()
        assert extent < 150.0  # mm; the places are 1 m apart
        assert arrow_lengths(axes).max() > 0.1 * extent


def test_selection_shows_its_numbers():
    selected = cal.select_configurations(
        RX90, "position", 30, drawn=100, starts=1, rng=np.random.default_rng(1)
    )
    figure = viz.plot_selection(selected, 0.05)
    np.testing.assert_array_equal(data(figure.axes[0], "_criterion"), selected.values)
    for axes, unit, factor in zip(figure.axes[1:], ("m", "rad"), (1e3, DEGREES), strict=True):
        own = np.array(selected.parameters.units) == unit
        values = factor * selected.standard_errors[:, own]
        np.testing.assert_allclose(data(axes, "median"), np.median(values, axis=1))
        np.testing.assert_allclose(data(axes, "largest"), values.max(axis=1))
    (enough,) = lines(figure.axes[0], f"enough: {selected.enough(0.05)}")
    assert enough.get_xdata()[0] == selected.enough(0.05)


# ---------------------------------------------------------------- identification


def log_of(model, seconds=12.0, seed=0, **more):
    """A noisy motion of a robot."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, DT)[:, None]
    w = 2.0 * np.pi * (0.2 + 0.07 * np.arange(model.n))
    q, v, a = 0.6 * np.sin(w * t), 0.6 * w * np.cos(w * t), -0.6 * w * w * np.sin(w * t)
    tau = rm.idm(model, q, v, a) + 0.1 * rng.normal(size=q.shape)
    return idn.Log(DT, q + 1e-5 * rng.normal(size=q.shape), tau, **more)


@pytest.fixture(scope="module")
def found():
    model = rm.load("lab_trr")
    drive = rm.DriveParameters(*(np.full(model.n, x) for x in (0.1, 2.0, 1.0, 0.2)))
    model = model.with_inertia(uniform_bodies(model, 8.0)).with_drive(drive)
    log = log_of(model, starts=(0, 3500))
    return idn.fit(model, log, test=log_of(model, seconds=4.0, seed=1), checked=False)


def test_torques_are_those_of_the_log_and_the_result(found):
    test = log_of(found.model, seconds=4.0, seed=1)
    figure = viz.plot_identification_torques(found, test)
    log, edges = found.equations.log, found.equations.processing.edges
    used = np.concatenate([log.tau[edges : 3500 - edges], log.tau[3500 + edges : -edges]])
    for j in range(3):
        measured, predicted, rest = (
            data(figure.axes[2 * j], label)
            for label in ("measured", "predicted", "measured less predicted")
        )
        assert np.nanmax(measured) == used[:, j].max()  # envelopes keep every peak
        assert np.nanmin(measured) == used[:, j].min()
        rmse = found.validation.in_sample.rmse[j]
        assert 0.5 * rmse < np.nanstd(rest) < 4.0 * rmse
        assert np.nanstd(predicted) == pytest.approx(used[:, j].std(), rel=0.1)


def test_residuals_their_band_and_their_correlation(found):
    figure = viz.plot_identification_residuals(found)
    for j in range(3):
        left, right = figure.axes[2 * j : 2 * j + 2]
        e, sigma = data(left, "residual; its autocorrelation"), found.estimate.sigma[j]
        assert np.isfinite(e).sum() == found.factors.counts[j]
        low, height = left.patches[0].get_y(), left.patches[0].get_height()
        assert (low, height) == pytest.approx((-2.0 * sigma, 4.0 * sigma))
        white = found.factors.counts[j] ** -0.5
        shown = np.array([line[1, 1] for line in right.collections[1].get_segments()])
        assert np.quantile(np.abs(shown), 0.5) < 4.0 * white
    held_out = viz.plot_identification_residuals(found, log_of(found.model, seconds=4.0, seed=1))
    assert data(held_out.axes[0], "residual; its autocorrelation").size < e.size


def test_effects_and_standard_errors_are_those_of_the_parameters(found):
    sigma = found.estimate.sigma
    blocks = [(b.W / sigma[:, None], b.y / sigma, b.use) for b in found.equations.blocks()]
    W = np.concatenate([W[use] for W, _, use in blocks])
    y = np.concatenate([y[use] for _, y, use in blocks])
    effect = 100.0 * np.linalg.norm(W, axis=0) / np.linalg.norm(y)
    figure = viz.plot_identification_parameters(found)
    shown = shown_intervals(figure.axes[0], 1.0) | shown_intervals(figure.axes[1], 1.0)
    for k, name in enumerate(found.names):
        value, half = found.values[k], 1.959964 * found.standard_errors[k]
        expected = effect[k] * np.array([value, value - half, value + half])
        np.testing.assert_allclose(shown[name], expected, rtol=1e-6, atol=1e-9)
    axes = viz.plot_identification_standard_errors(found).axes[0]
    order = np.argsort(-found.relative_errors, kind="stable")
    assert [t.get_text() for t in axes.get_xticklabels()] == [found.names[k] for k in order]
    tops = np.sort([bar.get_y() + bar.get_height() for bar in axes.patches])[::-1]
    np.testing.assert_allclose(tops, 100.0 * found.relative_errors[order], rtol=1e-9)
    correlation = viz.plot_identification_correlations(found).axes[0].collections[0].get_array()
    np.testing.assert_array_equal(correlation, found.estimate.correlation)


def test_processing_shows_cutoffs_and_the_noise_they_cut(found):
    log, chosen = found.equations.log, found.equations.processing
    figure = viz.plot_processing(log, chosen, model=found.model)
    for axes, cutoff in zip(figure.axes, (chosen.cutoff, chosen.torque_cutoff), strict=False):
        assert min(patch.get_x() for patch in axes.patches) == cutoff  # grey: cut
        f, before, after = (
            lines(axes, "kept")[0].get_xdata(),
            *(data(axes, word) for word in ("as recorded", "kept")),
        )
        assert (after[f > 2.0 * cutoff] < 0.1 * before[f > 2.0 * cutoff]).all()
        np.testing.assert_allclose(after[f < 0.5 * cutoff], before[f < 0.5 * cutoff], rtol=0.15)
    bias, count = viz.plot_processing(found).axes[6:]
    # one equation of each joint for each sample that is kept
    expected = len(log) * 3 / chosen.decimation / len(found.base)
    assert data(count, "choice")[0] == pytest.approx(expected)
    assert lines(bias, "choice")[0].get_xdata()[0] == min(chosen.cutoff, chosen.torque_cutoff)


def test_excitation_shows_its_motion_and_its_search():
    arm = rm.load("lab_trr")
    drawn = exciting_trajectory(arm, starts=2, baseline=4, iterations=4, rng=0)
    figure = viz.plot_excitation(drawn)
    names = list(arm.table.joint_names)
    t = lines(figure.axes[1], names[2])[0].get_xdata()
    np.testing.assert_allclose(data(figure.axes[1], names[2]), drawn.trajectory.q(t)[:, 2])
    search, baseline = figure.axes[-2:]
    assert sorted(len(x.get_xdata()) for x in lines(search, "_start")) == sorted(
        len(start.history) for start in drawn.starts
    )
    random = lines(baseline, "_values")[0].get_ydata()
    np.testing.assert_allclose(random, [one.of(drawn.criterion) for one in drawn.baseline])


# ---------------------------------------------------------------- reports and mistakes


@pytest.mark.nightly
def test_a_report_is_one_offline_file(found, calibrated, tmp_path):
    test = log_of(found.model, seconds=4.0, seed=1)
    viz.identification_html(found, tmp_path / "i.html", test)
    viz.html_report(calibrated["few"], tmp_path / "c.html")
    for name, images, result in (("i", 7, found), ("c", 5, calibrated["few"])):
        text = (tmp_path / f"{name}.html").read_text(encoding="utf-8")
        assert text.count("<img ") == images
        assert set(re.findall(r'(?:src|href)="(.{10})', text)) == {"data:image"}
        for word in result.names:
            assert f"<td>{word}</td>" in text or f"<td>{word}R</td>" in text
    q, T = poses(25)
    flat = cal.fit(
        RX90, cal.Distance(q, np.linalg.norm(T[:, :3, 3], axis=1)), folds=0, held_out=0.0
    )
    viz.html_report(flat, tmp_path / "d.html")  # the figure in space cannot be drawn
    assert (tmp_path / "d.html").read_text(encoding="utf-8").count("<img ") == 4


def test_mistakes_are_named(found, calibrated):
    two = idn.Log(DT, np.zeros((100, 2)), np.zeros((100, 2)))
    log, chosen = found.equations.log, found.equations.processing
    for wrong, message in (
        (lambda: viz.plot_calibration_residuals("few"), "result: expected a CalibrationResult"),
        (lambda: viz.plot_calibration_in_space(calibrated["few"], magnification=0.0), "magnif"),
        (lambda: viz.plot_calibration_parameters(calibrated["few"], 1.5), "level"),
        (lambda: viz.plot_identification_torques(found, two), "test: .* 3 joints, got 2"),
        (lambda: viz.plot_processing(log), "processing: expected a Processing"),
        (lambda: viz.plot_processing(found, chosen), "the result contains them"),
        (lambda: viz.plot_processing(two, chosen), "processing: expected one of 2 joints, got 3"),
    ):
        with pytest.raises(RobotModelsError, match=message):
            wrong()

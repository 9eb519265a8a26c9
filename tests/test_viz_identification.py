"""Figures of an identification show what the result holds, for few joints and many."""

import re

import numpy as np
import pytest

import robotmodels as rm
from robotmodels.errors import InvalidValueError, RobotModelsWarning, ShapeError
from robotmodels.identification import Log, choose_processing, fit, report
from robotmodels.minimal_parameters import uniform_bodies
from robotmodels.viz import (
    identification_html,
    plot_identification_correlations,
    plot_identification_parameters,
    plot_identification_residuals,
    plot_identification_standard_errors,
    plot_identification_torques,
    plot_processing,
)
from robotmodels.viz.plot_envelope import envelope
from robotmodels.viz.plot_identification_parameters import effects

DT = 0.002


def log_of(model, seconds=12.0, seed=0, **more):
    """A noisy motion of a robot."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, DT)[:, None]
    w = 2.0 * np.pi * (0.2 + 0.07 * np.arange(model.n))
    q, v, a = 0.6 * np.sin(w * t), 0.6 * w * np.cos(w * t), -0.6 * w * w * np.sin(w * t)
    tau = rm.idm(model, q, v, a) + 0.1 * rng.normal(size=q.shape)
    return Log(DT, q + 1e-5 * rng.normal(size=q.shape), tau, **more)


def identified(model, **more):
    drive = rm.DriveParameters(*(np.full(model.n, x) for x in (0.1, 2.0, 1.0, 0.2)))
    model = model.with_inertia(uniform_bodies(model, 8.0)).with_drive(drive)
    log = log_of(model, **more)
    return fit(model, log, test=log_of(model, seconds=4.0, seed=1), checked=False)


def pendulum():
    row = {"sigma": 0, "alpha": np.pi / 2, "d": 0.0, "theta": 0.0, "r": 0.0}
    tool = np.eye(4)
    tool[0, 3] = 0.5
    return rm.RobotModel.from_table(rm.DHTable.from_rows([row]), tool=tool, name="pendulum")


@pytest.fixture(scope="module")
def found():
    return identified(rm.load("lab_trr"), starts=(0, 3500))


def lines(axes):
    return {str(line.get_label()): line for line in axes.get_lines()}


def drawn(figure):
    """Nothing fails and nothing warns when it is laid out."""
    figure.canvas.draw()
    return figure


def test_envelopes_keep_every_peak():
    rng = np.random.default_rng(0)
    y = rng.normal(size=(10007, 3))
    y[7777, 1], y[123, 2], y[10006, 0] = 50.0, -60.0, 70.0
    t = np.arange(10007.0)
    place, less = envelope(t, y, 100)
    assert place.shape == less.shape == (202, 3)
    np.testing.assert_array_equal(less.max(axis=0), y.max(axis=0))
    np.testing.assert_array_equal(less.min(axis=0), y.min(axis=0))
    assert (np.diff(place, axis=0) >= 0.0).all()
    for j in range(3):  # points are samples, at their own times
        np.testing.assert_array_equal(less[:, j], y[place[:, j].astype(int), j])
    assert envelope(t[:0], y[:0], 100)[1].shape == (0, 3)
    np.testing.assert_array_equal(envelope(t, y, 2)[1], y)


def test_torques_are_those_of_the_log_and_the_result(found):
    test = log_of(found.model, seconds=4.0, seed=1)
    figure = drawn(plot_identification_torques(found, test, title="a title"))
    assert len(figure.axes) == 6
    assert [axes.get_ylabel() for axes in figure.axes[::2]] == [
        "force (N)", "torque (N m)", "torque (N m)",
    ]  # fmt: skip
    log, edges = found.equations.log, found.equations.processing.edges
    used = np.concatenate([log.tau[edges : 3500 - edges], log.tau[3500 + edges : -edges]])
    for j in range(3):
        own = lines(figure.axes[2 * j])
        measured = np.asarray(own["measured"].get_ydata(), dtype=float)
        assert np.nanmax(measured) == used[:, j].max()
        assert np.nanmin(measured) == used[:, j].min()
        assert np.isnan(measured).sum() == 1  # between the recordings
        rest = np.asarray(own["measured less predicted"].get_ydata(), dtype=float)
        assert np.nanmax(np.abs(rest)) < 8.0 * found.validation.in_sample.rmse[j] + 1.0
        title = figure.axes[2 * j + 1].get_title(loc="left")
        assert title.endswith(f"held out: {100 * found.validation.held_out.relative[j]:.3g} %")


def test_residuals_their_band_and_their_correlation(found):
    figure = drawn(plot_identification_residuals(found))
    for j in range(3):
        left, right = figure.axes[2 * j], figure.axes[2 * j + 1]
        e = np.asarray(lines(left)["residual; its autocorrelation"].get_ydata(), dtype=float)
        assert np.isfinite(e).sum() == found.factors.counts[j]
        low, high = left.patches[0].get_y(), left.patches[0].get_height()
        assert low == pytest.approx(-2.0 * found.estimate.sigma[j])
        assert high == pytest.approx(4.0 * found.estimate.sigma[j])
        share = 100.0 * np.mean(np.abs(e[np.isfinite(e)]) > 2.0 * found.estimate.sigma[j])
        assert f"{share:.2g} % outside" in left.get_title(loc="left")
        assert right.get_xlim()[1] > 0.0
    assert figure.axes[-1].get_xlabel() == "lag (s)"


def test_effects_compare_parameters_by_their_torques(found):
    stacked = [(b.W / found.estimate.sigma[:, None], b.y / found.estimate.sigma, b.use)
               for b in found.equations.blocks()]  # fmt: skip
    W = np.concatenate([W[use] for W, _, use in stacked])
    y = np.concatenate([y[use] for _, y, use in stacked])
    expected = np.linalg.norm(W, axis=0) / np.linalg.norm(y)
    np.testing.assert_allclose(effects(found), expected, rtol=1e-9)
    figure = drawn(plot_identification_parameters(found))
    names = [text.get_text() for axes in figure.axes for text in axes.get_yticklabels()]
    assert sorted(names) == sorted(found.names)


def test_deviations_are_sorted_and_coloured_by_what_is_seen(found):
    figure = drawn(plot_identification_standard_errors(found))
    names = [text.get_text() for text in figure.axes[0].get_xticklabels()]
    order = np.argsort(-found.relative_errors, kind="stable")
    assert names == [found.names[k] for k in order]
    tops = np.sort([bar.get_y() + bar.get_height() for bar in figure.axes[0].patches])[::-1]
    np.testing.assert_allclose(tops, 100.0 * found.relative_errors[order], rtol=1e-9)


def test_processing_shows_cutoffs_and_what_they_cut(found):
    log, chosen = found.equations.log, found.equations.processing
    figure = drawn(plot_processing(log, chosen, model=found.model))
    assert len(figure.axes) == 6
    assert figure.axes[0].get_ylabel() == "(m/√Hz)"
    for k, cutoff in enumerate((chosen.cutoff, chosen.torque_cutoff)):
        own = lines(figure.axes[k])
        assert own["cutoff of the positions"].get_xdata()[0] == chosen.cutoff
        assert own["cutoff of regressor and torques"].get_xdata()[0] == chosen.torque_cutoff
        assert own["motion: 99.9 % of the velocity's power"].get_xdata()[0] == chosen.motion
        assert min(patch.get_x() for patch in figure.axes[k].patches) == cutoff  # grey: cut
        f = np.asarray(own["kept"].get_xdata(), dtype=float)
        before = np.asarray(own["as recorded"].get_ydata(), dtype=float)
        after = np.asarray(own["kept"].get_ydata(), dtype=float)
        beyond, inside = f > 2.0 * cutoff, f < 0.5 * cutoff
        assert (after[beyond] < 0.1 * before[beyond]).all()
        np.testing.assert_allclose(after[inside], before[inside], rtol=0.15)
    # the noise that was added is what is cut, up to the part below the cutoff
    noise = float(re.search(r"position: (\S+) m", figure.axes[0].get_title(loc="left"))[1])
    assert noise == pytest.approx(1e-5 * np.sqrt(1.0 - 2.0 * DT * chosen.cutoff), rel=0.1)
    raw = choose_processing(log, filtered=False, decimation=1)
    figure = drawn(plot_processing(log, raw))
    assert not any("cutoff" in name for name in lines(figure.axes[0]))
    assert not figure.axes[0].patches


def test_torques_that_are_cut_are_told_relative_to_all(found):
    log, chosen = found.equations.log, found.equations.processing
    for axes, tau in zip(drawn(plot_processing(found)).axes[1:6:2], log.tau.T, strict=True):
        title = axes.get_title(loc="left")
        cut, share = re.search(r"torque: (\S+) N(?: m)? rms \((\S+) %\) cut", title).groups()
        # white noise of 0.1 was added; the decimation passes what is below its cutoff
        assert float(cut) > 0.09 * np.sqrt(1.0 - 2.0 * DT * chosen.torque_cutoff)
        rms = np.sqrt(np.mean(tau[:3500] ** 2))  # spectra are made of the longest recording
        assert float(share) == pytest.approx(100.0 * float(cut) / rms, rel=0.1)


def test_processing_of_a_result_shows_why(found):
    """The last row: bias by noise and equations for each parameter, bounds and choice."""
    chosen, b = found.equations.processing, len(found.base)
    figure = drawn(plot_processing(found, title="a title"))
    assert len(figure.axes) == 8
    bias, count = (lines(axes) for axes in figure.axes[6:])
    bound = "bounds: 0.1 standard errors, 20 equations"
    assert bias[bound].get_ydata()[0] == 0.1
    assert count[bound].get_ydata()[0] == 20
    for own, cutoff in ((bias, min(chosen.cutoff, chosen.torque_cutoff)),
                        (count, chosen.torque_cutoff)):  # fmt: skip
        f, curve = own["at other cutoffs"].get_data()
        [x], [y] = own["choice"].get_data()
        assert x == cutoff
        assert f[0] == chosen.motion
        assert y == curve[np.flatnonzero(f == cutoff)[0]]  # the choice lies on the curve
        assert f[-1] > 5.0 * cutoff
    # the bias grows with the cutoff and passes its bound between the choice and its double
    f, curve = bias["at other cutoffs"].get_data()
    [x], [y] = bias["choice"].get_data()
    assert 0.01 < y < 0.1
    assert (curve[f < 0.5 * x] < 0.01).all()
    assert (curve[f > 2.0 * x] > 0.1).all()
    # one equation of each joint for each sample that is kept
    expected = len(found.equations.log) * 3 / chosen.decimation / b
    assert count["choice"].get_ydata()[0] == pytest.approx(expected)
    assert found.factors.rows / b <= expected
    assert figure.axes[7].get_title(loc="left") == (
        f"about {expected:.3g} equations for each parameter"
    )


def test_processing_of_a_result_shows_what_an_asked_cutoff_does(found):
    model, log = found.model, found.equations.log
    noisy = Log(DT, log.q + 2e-4 * np.random.default_rng(5).normal(size=log.q.shape), log.tau)
    with pytest.warns(RobotModelsWarning, match="Poor prediction"):
        asked = fit(model, noisy, processing={"cutoff": 30.0, "decimation": 1}, checked=False)
    bias, count = (lines(axes) for axes in drawn(plot_processing(asked)).axes[6:])
    [x], [y] = bias["choice"].get_data()
    assert x == 30.0
    assert y > 0.5  # above the bound, as the notes tell
    note = next(note for note in asked.notes if "predicted to bias parameters" in note)
    assert y == pytest.approx(float(re.search(r"up to (\S+) standard errors", note)[1]), rel=0.5)
    [x], [y] = count["choice"].get_data()
    assert (x, y) == (0.4 / DT, len(log) * 3 / len(asked.base))  # no decimation
    one = fit(model, log, form="power", checked=False)
    [_], [y] = lines(plot_processing(one).axes[7])["choice"].get_data()
    assert y == pytest.approx(len(log) / one.equations.processing.decimation / len(one.base))


def test_predicted_bias_leaves_out_what_the_equations_leave_out():
    """Noise turns the sign of a coupled motor's velocity only in its dead band."""
    data = rm.datasets.load_tx40()
    asked = fit(data.model, data.log, processing={"cutoff": 60.0, "decimation": 20})
    assert not any(note.startswith("Noise of the positions biases") for note in asked.notes)
    own = lines(plot_processing(asked).axes[12])
    f, curve = own["at other cutoffs"].get_data()
    below = f <= 60.0
    assert curve[below].max() < 0.1
    assert (np.diff(np.log(curve[below])) < np.log(20.0)).all()  # no jump


@pytest.mark.parametrize("name", ["pendulum", "planar_2r", "rx90", "iiwa14"])
def test_every_number_of_joints(name):
    model = pendulum() if name == "pendulum" else rm.load(name)
    result = identified(model, seconds=6.0)
    figures = [
        plot_identification_torques(result),
        plot_identification_residuals(result),
        plot_identification_parameters(result),
        plot_identification_standard_errors(result),
        plot_identification_correlations(result),
        plot_processing(result),
    ]
    assert len(figures[0].axes) == model.n
    for figure in figures:
        drawn(figure)
    assert max(map(len, report(result).splitlines())) <= 100


def test_the_page_is_one_offline_file(found, tmp_path):
    test = log_of(found.model, seconds=4.0, seed=1)
    identification_html(found, tmp_path / "report.html", test)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert text.count("<img ") == 7
    assert set(re.findall(r'(?:src|href)="(.{10})', text)) == {"data:image"}
    for name in found.names:
        assert f"<td>{name}</td>" in text or f"<td>{name}R</td>" in text


def test_wrong_arguments(found):
    with pytest.raises(InvalidValueError, match="expected an IdentificationResult"):
        plot_identification_torques("result")
    with pytest.raises(InvalidValueError, match="expected a Log"):
        plot_identification_residuals(found, 3)
    two = Log(DT, np.zeros((100, 2)), np.zeros((100, 2)))
    with pytest.raises(ShapeError, match="3 joints, got 2"):
        plot_identification_torques(found, two)
    with pytest.raises(InvalidValueError, match="expected a Processing"):
        plot_processing(found.equations.log, None)
    with pytest.raises(InvalidValueError, match="expected a Log or an IdentificationResult"):
        plot_processing("log")
    with pytest.raises(InvalidValueError, match="the result contains them"):
        plot_processing(found, found.equations.processing)
    with pytest.raises(ShapeError, match="2 joints, got 3"):
        plot_processing(two, found.equations.processing)

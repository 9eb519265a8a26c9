"""Every figure in print: units, size of texts, nothing over anything else, colours for all eyes."""

import io
import re
from collections.abc import Callable
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import Collection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

import robotmodels as rm
from robotmodels import calibration as cal
from robotmodels import identification as idn
from robotmodels import kinematics as kin
from robotmodels import trajectories as tr
from robotmodels.viz.figures import line_style
from robotmodels.viz.palette import ALERT, BAND, GRID, INK, LINE_COLORS, PALE

SYMBOLS = {
    "m", "mm", "µm", "rad", "mrad", "µrad", "deg", "s", "Hz", "N", "J", "mJ", "µJ", "nJ", "pJ",
    "kg", "1", "%", "no", "unit", "or",
}  # fmt: skip
NUMBERS = {  # counts, ratios and scales that have no unit
    "rows", "configuration", "configurations", "contacts", "iteration", "number of the pose",
    "residual / standard deviation", "normal quantile", "condition number", "criterion",
    "smooth condition number", "smooth criterion", "minus log det", "correlation", "value",
    "autocorrelation", "least singular value", "no unit",
    "bias / standard error", "equations / parameter",
}  # fmt: skip


# --- what is wrong with a figure ----------------------------------------------------------------


def texts_drawn(figure, monkeypatch):
    """Texts that are really drawn, with their boxes in pixels."""
    seen = {}
    draw = Text.draw

    def noted(text, renderer, *args, **kwargs):
        if text.get_visible() and text.get_text().strip():
            seen[text] = text.get_window_extent(renderer)
        return draw(text, renderer, *args, **kwargs)

    figure.draw_without_rendering()  # the layout
    with monkeypatch.context() as patch:
        patch.setattr(Text, "draw", noted)
        FigureCanvasAgg(figure).draw()
    return seen


def says_its_unit(label):
    words = " ".join(label.split())
    if words in NUMBERS or re.fullmatch(r"criterion \w+", words):
        return True
    unit = re.search(r"\(((?:[^()]|\([^()]*\))+)\)$", words)
    found = re.findall(r"[^\W\d_²³]+|%|\b1\b", unit[1]) if unit else []
    return bool(found) and set(found) <= SYMBOLS


def is_number(text):
    return re.fullmatch(r"[\d.,e+\N{MINUS SIGN}-]+|\$.*\$", text.strip()) is not None


def without_units(figure):
    """Axes whose ticks are numbers and whose label, or the one of its row or column, has no unit.

    What a panel shows may stand over it instead, as its title.
    """
    wrong = []
    shown = [axes for axes in figure.axes if axes.get_visible()]
    for axes in shown:
        for letter in "xyz" if axes.name == "3d" else "xy":
            axis = getattr(axes, f"{letter}axis")
            ticks = [tick.get_text() for tick in axis.get_ticklabels() if tick.get_visible()]
            if not any(map(is_number, filter(None, ticks))) or not axes.axison:
                continue
            labels = [axis.label.get_text()]
            box = axes.get_position()
            for other in shown:
                beside = other.get_position()
                if letter == "x" and abs(beside.x0 - box.x0) < 0.02:
                    labels.append(other.xaxis.label.get_text())
                if letter == "y" and abs(beside.y0 - box.y0) < 0.02:
                    labels.append(other.yaxis.label.get_text())
            if letter == "y":
                labels += [axes.get_title(loc=where) for where in ("left", "center")]
                labels += [over.get_title(loc="left") for over in shown  # once for a column
                           if abs(over.get_position().x0 - box.x0) < 0.02]  # fmt: skip
            if not any(map(says_its_unit, labels)):
                wrong.append(f"no unit: {letter} of {axes.get_title()!r}, {labels[0]!r}")
    return wrong


def over_each_other(boxes, figure):
    """Texts that lie on other texts or leave the page."""
    wrong = []
    width, height = figure.bbox.x1, figure.bbox.y1
    for text, box in boxes.items():
        if min(box.x0, box.y0, width - box.x1, height - box.y1) < -1.0:
            wrong.append(f"off the page: {text.get_text()!r}")
    for (one, a), (two, b) in combinations(boxes.items(), 2):
        wide = min(a.x1, b.x1) - max(a.x0, b.x0)
        if wide > 1.0 and min(a.y1, b.y1) - max(a.y0, b.y0) > 1.0:
            wrong.append(f"over each other: {one.get_text()!r} and {two.get_text()!r}")
    for legend in [*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes))]:
        a = legend.get_window_extent()
        for axes in figure.axes:
            b = axes.get_window_extent()
            wide, high = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
            if min(wide, high) > 2.0 and axes.get_visible() and axes.name != "3d":
                wrong.append("a legend hides data")
    return wrong


PAPER = (1.0, 1.0, 1.0)
ALLOWED = np.array([c[:3] for c in (*LINE_COLORS, INK, PALE, ALERT, BAND, GRID)] + [PAPER])


def colors_and_widths(figure):
    """Colours that are not the palette's, and lines too thin to print."""
    found, widths = [], []
    for artist in figure.findobj():
        if not artist.get_visible():
            continue
        if isinstance(artist, Text):
            found += [artist.get_color()] if artist.get_text().strip() else []
        elif isinstance(artist, Line2D):
            found.append(artist.get_color())
            if artist.get_linestyle() not in ("None", "", " ") and np.size(artist.get_xdata()):
                widths.append(artist.get_linewidth())
        elif isinstance(artist, Collection):
            if artist.get_array() is not None or not len(artist.get_paths()):
                continue  # a map, or nothing
            found += [*artist.get_facecolor(), *artist.get_edgecolor()]
            if len(artist.get_edgecolor()):
                widths += np.atleast_1d(artist.get_linewidth()).tolist()
        elif isinstance(artist, Patch):
            found += [artist.get_facecolor(), artist.get_edgecolor()]
            if to_rgba(artist.get_edgecolor())[3] and artist.get_linewidth():
                widths.append(artist.get_linewidth())
    rgba = np.array([to_rgba(color) for color in found])
    seen = np.unique(rgba[rgba[:, 3] > 0.0, :3], axis=0)
    off = np.abs(seen[:, None] - ALLOWED).max(axis=-1).min(axis=1)
    wrong = [f"not of the palette: {color.round(2)}" for color in seen[off > 0.005]]
    return wrong + [f"a line of {w} points" for w in {*widths} if 0.0 < w < 0.799]


def alike_in_grey(figure):
    """More than four lines of one panel, and two of them with the same dashes and marks."""
    wrong = []
    for axes in figure.axes:
        named = {str(line.get_label()): line for line in axes.get_lines()
                 if not str(line.get_label()).startswith("_")}  # fmt: skip
        looks = [(str(line._unscaled_dash_pattern), line.get_marker()) for line in named.values()]
        if len(named) > 4 and len(set(looks)) < min(len(named), 7):
            wrong.append(f"alike without colours: {list(named)}")
    return wrong


def complaints(figure, monkeypatch):
    """All that is wrong with a figure, in words."""
    boxes = texts_drawn(figure, monkeypatch)
    small = [f"{text.get_size()} points: {text.get_text()!r}" for text in boxes
             if text.get_size() < 8.0]  # fmt: skip
    return [*small, *without_units(figure), *over_each_other(boxes, figure),
            *colors_and_widths(figure), *alike_in_grey(figure)]  # fmt: skip


# --- one or more of every kind ------------------------------------------------------------------

RX90 = rm.load("rx90")
Q = np.radians([20.0, 60.0, -110.0, 30.0, 50.0, -20.0])
LIMITS = tr.MotionLimits(velocity=1.5, acceleration=6.0)


@cache
def calibrated():
    rng = np.random.default_rng(3)
    model = RX90.with_tool(rm.se3.translation(0.05, 0.02, 0.12))
    q = rng.uniform(-2.0, 2.0, (40, 6))
    T = rm.dgm(model, q + np.array([0, 2e-3, -1e-3, 1e-3, 0, 0]))
    T[:, :3, 3] += 1e-4 * rng.normal(size=(40, 3))
    T[7, :3, 3] += 0.02
    return cal.fit(model, cal.Pose(q, T), folds=0, held_out=0.0)


@cache
def identified():
    model = rm.load("lab_trr")
    drive = rm.DriveParameters(*(np.full(3, x) for x in (0.1, 2.0, 1.0, 0.2)))
    model = model.with_inertia(rm.uniform_bodies(model, 8.0)).with_drive(drive)
    t, rng = np.arange(0.0, 12.0, 0.002)[:, None], np.random.default_rng(0)
    w = 2.0 * np.pi * (0.2 + 0.07 * np.arange(3))
    q, v, a = 0.6 * np.sin(w * t), 0.6 * w * np.cos(w * t), -0.6 * w * w * np.sin(w * t)
    tau = rm.idm(model, q, v, a) + 0.1 * rng.normal(size=q.shape)
    log = idn.Log(0.002, q + 1e-5 * rng.normal(size=q.shape), tau)
    return idn.fit(model, log.rows(2000, 6000), test=log.rows(0, 2000), checked=False)


@cache
def excited():
    return idn.exciting_trajectory(rm.load("ur10e"), starts=2, baseline=5, iterations=6, rng=0)


@cache
def selected():
    return cal.select_configurations(
        RX90, "position", 20, drawn=60, starts=1, rng=np.random.default_rng(0)
    )


@cache
def fallen():
    return rm.simulate(RX90, Q, np.zeros(6), t=np.linspace(0.0, 1.0, 60))


def turned(limits=None):
    goal = Q + np.array([0.5, 0.4, -0.3, 0.9, -0.6, 1.1])
    return tr.trapezoidal(Q, goal, limits=limits or LIMITS)


def line_in_space(duration=2.0):
    start = rm.dgm(RX90, Q)
    return tr.straight_line(start, rm.se3.translation(0.0, 0.1, -0.1) @ start, duration=duration)


def across():
    """Two inverse models near the wrist's singular position."""
    off = np.linspace(-0.1, 0.1, 41)
    rows = np.tile([0.3, 1.0, -1.8, 0.4, 0.0, -0.2], (41, 1))
    rows[:, 4] += off
    twist = [0.1, -0.05, 0.08, 0.2, 0.1, -0.15]
    ways = {"pseudo-inverse": kin.PseudoInverse(), "damping": kin.DampedInverse()}
    return off, {name: rm.ikm(RX90, rows, twist, method=way) for name, way in ways.items()}


FIGURES: dict[str, dict[str, Callable[[], Figure]]] = {
    "calibration_correlations": {"": lambda: rm.viz.plot_calibration_correlations(calibrated())},
    "calibration_in_space": {"": lambda: rm.viz.plot_calibration_in_space(calibrated())},
    "calibration_normality": {"": lambda: rm.viz.plot_calibration_normality(calibrated())},
    "calibration_parameters": {
        "": lambda: rm.viz.plot_calibration_parameters(calibrated(), title="A robot")
    },
    "calibration_residuals": {"": lambda: rm.viz.plot_calibration_residuals(calibrated())},
    "ellipsoids": {
        "two": lambda: rm.viz.plot_ellipsoids(
            [rm.velocity_ellipsoid(RX90, Q), rm.force_ellipsoid(RX90, Q)], title="Both"
        )
    },
    "energy": {"": lambda: rm.viz.plot_energy(fallen(), title="A falling arm")},
    "excitation": {"": lambda: rm.viz.plot_excitation(excited())},
    "identification_correlations": {
        "": lambda: rm.viz.plot_identification_correlations(identified())
    },
    "identification_standard_errors": {
        "": lambda: rm.viz.plot_identification_standard_errors(identified())
    },
    "identification_parameters": {"": lambda: rm.viz.plot_identification_parameters(identified())},
    "identification_residuals": {"": lambda: rm.viz.plot_identification_residuals(identified())},
    "identification_torques": {
        "": lambda: rm.viz.plot_identification_torques(identified(), title="A robot")
    },
    "inertia_map": {
        "line": lambda: rm.viz.plot_inertia_map(rm.simulation.dynamics_map(RX90, 2)),
        "map": lambda: rm.viz.plot_inertia_map(
            rm.simulation.dynamics_map(rm.load("panda"), (0, 3)), title="Panda"
        ),
    },
    "inverse_velocities": {
        "": lambda: rm.viz.plot_inverse_velocities(*across(), model=RX90, title="Wrist"),
        "each joint": lambda: rm.viz.plot_inverse_velocities(
            *across(), model=RX90, each_joint=True
        ),
    },
    "joint_motion": {
        "": lambda: rm.viz.plot_joint_motion(
            rm.load("panda"),
            np.linspace(0, 1, 20),
            {
                "with": np.outer(np.linspace(0, 1, 20), np.full(7, -0.5)),
                "without": np.outer(np.linspace(0, 1, 20), np.full(7, -3.5)),
            },
        )
    },
    "joint_path": {
        "": lambda: rm.viz.plot_joint_path(
            tr.joint_path(RX90, line_in_space(), Q, samples=60), model=RX90, limits=LIMITS
        )
    },
    "pose_path": {"": lambda: rm.viz.plot_pose_path(line_in_space(), title="A line")},
    "processing": {
        "": lambda: rm.viz.plot_processing(
            identified().equations.log, identified().equations.processing, model=identified().model
        ),
        "result": lambda: rm.viz.plot_processing(identified(), title="Cutoffs"),
    },
    "profiles": {
        side: lambda side=side: rm.viz.plot_profiles(
            {
                "smoothed trapezoidal": tr.smoothed_trapezoidal(0.0, 1.0, limits=LIMITS),
                "bang-bang": tr.bang_bang(0.0, 1.0, limits=LIMITS),
                "quintic": tr.quintic(0.0, 1.0, limits=LIMITS),
            },
            limits=LIMITS,
            unit="deg",
            side_by_side=bool(side),
        )
        for side in ("", "side by side")
    },
    "selection": {"": lambda: rm.viz.plot_selection(selected())},
    "singularities": {
        "": lambda: rm.viz.plot_singularities(
            [
                rm.symbolic.singularity_map(RX90, joints=pair, at=Q, factor=factor)
                for pair, factor in zip(
                    [(1, 2), (2, 4)], rm.explain_singularities(RX90).factors[:2], strict=True
                )
            ],
            RX90,
            q=Q,
        )
    },
    "torque_parts": {"": lambda: rm.viz.plot_torque_parts(RX90, turned(), title="A move")},
    "trajectory": {
        "": lambda: rm.viz.plot_trajectory(turned(), LIMITS, model=RX90, title="RX-90"),
        "seven": lambda: rm.viz.plot_trajectory(
            tr.quintic(np.zeros(7), np.linspace(-1, 1, 7), duration=1.0), model=rm.load("panda")
        ),
        "two units": lambda: rm.viz.plot_trajectory(
            tr.quintic([0, 0, 0], [0.2, 1.0, -1.0], duration=1.0), model=rm.load("lab_trr")
        ),
    },
}
CASES = [(kind, case) for kind, cases in FIGURES.items() for case in cases]


def test_every_kind_of_figure_is_looked_at():
    kinds = {name.removeprefix("plot_") for name in rm.viz.__all__ if name.startswith("plot_")}
    assert kinds == set(FIGURES)


@pytest.mark.parametrize(("kind", "case"), CASES)
def test_nothing_is_wrong_with_it(kind, case, monkeypatch):
    figure = FIGURES[kind][case]()
    assert complaints(figure, monkeypatch) == []
    assert 3.0 <= figure.get_figwidth() <= 7.2  # one column or two


@pytest.mark.parametrize("form", ["pdf", "svg"])
def test_it_is_saved_as_lines_and_letters(form):
    file = io.BytesIO()
    FIGURES["trajectory"][""]().savefig(file, format=form)
    page = file.getvalue()
    assert page.startswith({"pdf": b"%PDF", "svg": b"<?xml"}[form])
    assert b"/Subtype /Image" not in page
    assert b"<image" not in page


# --- the checks see what is wrong ---------------------------------------------------------------


def fault(figure, kind):
    axes = figure.axes[0]
    if kind == "no unit":
        axes.set_ylabel("position")
    elif kind == "7.0 points":
        axes.xaxis.label.set_size(7.0)
        figure.axes[-1].xaxis.label.set_size(7.0)
    elif kind == "over each other":
        axes.text(0.4, 0.5, "one remark", transform=axes.transAxes, size=8.0, color=INK)
        axes.text(0.45, 0.52, "another", transform=axes.transAxes, size=8.0, color=INK)
    elif kind == "off the page":
        figure.text(0.9, 0.5, "a long remark at the edge", size=9.0, color=INK)
    elif kind == "a legend hides data":
        axes.legend(handles=axes.get_lines()[:1], loc="center", fontsize=8.0, labelcolor=INK)
    elif kind == "not of the palette":
        axes.get_lines()[0].set_color("lime")
    elif kind == "a line of 0.4 points":
        axes.get_lines()[0].set_linewidth(0.4)
    else:
        for line in axes.get_lines():
            line.set_linestyle("-")


@pytest.mark.parametrize(
    "kind",
    ["no unit", "7.0 points", "over each other", "off the page", "a legend hides data",
     "not of the palette", "a line of 0.4 points", "alike without colours"],
)  # fmt: skip
def test_each_fault_is_found(kind, monkeypatch):
    figure = FIGURES["trajectory"][""]()
    fault(figure, kind)
    found = complaints(figure, monkeypatch)
    assert found
    assert any(text.startswith(kind) for text in found), found


@pytest.mark.parametrize(
    ("label", "good"),
    [("time (s)", True), ("velocity\n(rad/s²)", True), ("deviation (µrad/(N m))", True),
     ("condition number", True), ("position", False), ("time (h)", False), ("rows ()", False)],
)  # fmt: skip
def test_a_unit_is_told_from_a_word(label, good):
    assert says_its_unit(label) is good


# --- colours ------------------------------------------------------------------------------------

# Machado, Oliveira and Fernandes (2009), A physiologically-based model for simulation of color
# vision deficiency, severity 1: what an eye without one kind of cones sees of linear RGB.
EYES = {
    "all cones": np.eye(3),
    "protanopia": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                            [-0.003882, -0.048116, 1.051998]]),
    "deuteranopia": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                              [-0.011820, 0.042940, 0.968881]]),
    "tritanopia": np.array([[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                            [0.004733, 0.691367, 0.303900]]),
}  # fmt: skip
XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
                [0.0193339, 0.1191920, 0.9503041]]) / [[0.95047], [1.0], [1.08883]]  # fmt: skip


def lab(colors, eye):
    """CIE L*a*b* (1976, white D65) of sRGB colours as an eye sees them."""
    rgb = np.array([color[:3] for color in colors])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    x, y, z = XYZ @ np.clip(EYES[eye] @ linear.T, 0.0, 1.0)
    x, y, z = (np.where(c > 0.008856, np.cbrt(c), 7.787 * c + 16 / 116) for c in (x, y, z))
    return np.stack((116 * y - 16, 500 * (x - y), 200 * (y - z)), axis=1)


def nearest(colors, eye):
    """Least distance of two of some colours, CIE 1976; 2 is just seen."""
    seen = lab(colors, eye)
    apart = np.linalg.norm(seen[:, None] - seen, axis=-1)
    return apart[np.triu_indices(len(seen), 1)].min()


@pytest.mark.parametrize("eye", EYES)
def test_lines_that_share_a_panel_differ_for_every_eye(eye):
    lines = [line_style(k).color for k in range(8)]
    assert nearest([*lines, INK, ALERT, PALE, PAPER], eye) > 17.0
    assert lab(lines, eye)[:, 0].max() < 80.0  # dark enough for white paper


def test_lines_differ_in_print_without_colours():
    for first in range(10):
        dashes = [line_style(k).dashes for k in range(first, first + 7)]
        assert len(set(dashes)) == 7


def test_the_simulation_of_eyes_sees_the_known_confusions():
    red, green = to_rgba("#d62728"), to_rgba("#2ca02c")
    assert nearest([red, green], "all cones") > 100.0
    assert nearest([red, green], "deuteranopia") < 45.0
    pair = [(0.80, 0.47, 0.65, 1.0), (0.62, 0.62, 0.62, 1.0)]  # a pink and a grey
    assert nearest(pair, "all cones") > 25.0
    assert nearest(pair, "deuteranopia") < 10.0

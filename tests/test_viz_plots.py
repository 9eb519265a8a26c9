"""Figures: what is on their axes, in which units, and that nothing covers anything else."""

import io
import pickle
import subprocess
import sys
from itertools import combinations

import matplotlib
import matplotlib.style
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from robotmodels import se3
from robotmodels.errors import InvalidValueError, ShapeError
from robotmodels.geometry import DHTable
from robotmodels.kinematics import dgm, jacobian
from robotmodels.kinematics.inverse.ikm import ikm
from robotmodels.model import RobotModel
from robotmodels.robots import load
from robotmodels.symbolic import SingularityMap, singularity_map
from robotmodels.trajectories import (
    JointPath,
    MotionLimits,
    PathEvent,
    PathEventKind,
    Samples,
    Synchronisation,
    bang_bang,
    cartesian_trajectory,
    cubic,
    fourier,
    jerk_limited,
    joint_path,
    quintic,
    smoothed_trapezoidal,
    straight_line,
    trapezoidal,
)
from robotmodels.viz.figures import line_style
from robotmodels.viz.plot_inverse_velocities import plot_inverse_velocities
from robotmodels.viz.plot_joint_motion import plot_joint_motion
from robotmodels.viz.plot_joint_path import plot_joint_path
from robotmodels.viz.plot_pose_path import plot_pose_path
from robotmodels.viz.plot_profiles import plot_profiles
from robotmodels.viz.plot_singularities import plot_singularities
from robotmodels.viz.plot_trajectory import plot_trajectory
from robotmodels.viz.plot_units import Unit, joint_names, joint_units

RX90 = load("rx90")
H = np.pi / 2
SCARA = RobotModel.from_table(
    DHTable.from_rows([
        {"sigma": 0, "name": "waist", "lower": -2.0, "upper": 1.0}, {"sigma": 2, "d": 0.1},
        {"sigma": 0, "d": 0.35, "name": "elbow", "velocity": 3.0},
        {"sigma": 1, "d": 0.3, "alpha": np.pi, "lower": 0.0, "upper": 0.2, "name": "lift"},
    ]),
    name="scara",
)  # fmt: skip
LIMITS = MotionLimits(velocity=[1.0, 2.0, 0.5], acceleration=4.0, jerk=60.0)


def lines(axes, label=None):
    """The lines that a legend would name, or those of one label."""
    found = [line for line in axes.get_lines() if not line.get_label().startswith("_")]
    if label is not None:
        found = [line for line in axes.get_lines() if line.get_label() == label]
    return found


def labels(figure):
    return [" ".join(axes.get_ylabel().split()) for axes in figure.axes]


def legend(figure):
    return [text.get_text() for each in figure.legends for text in each.get_texts()]


def wrist_map(values=None, first=None, second=None, units=("rad", "rad", "m^3")):
    a = np.linspace(-np.pi, np.pi, 41) if first is None else first
    b = np.linspace(-2.0, 2.0, 31) if second is None else second
    z = np.cos(a)[:, None] * np.sin(b) if values is None else values
    return SingularityMap("rx90", np.array([2, 4]), ("elbow", "wrist"), a, b, z, "C3 S5", units)


def crossing(count=81, spread=0.2):
    """Two inverse models on a way through the wrist singularity."""
    d = np.linspace(-spread, spread, count)
    q = np.tile([0.1, 0.2, 0.3, 0.4, 0.0, 0.6], (count, 1))
    q[:, 4] = d
    twist = np.array([0.1, 0.2, 0.05, 0.1, 0.3, 0.2])
    J = jacobian(RX90, q)
    found = {}
    for name, damping in (("light", 0.01), ("strong", 0.1)):
        v = np.stack([j.T @ np.linalg.solve(j @ j.T + damping**2 * np.eye(6), twist) for j in J])
        found[name] = (v, twist - np.einsum("nij,nj->ni", J, v))
    return d, q, twist, found


def eventful_path(timed=True):
    """A path on which everything happens, without a robot that does it."""
    N = 40
    t = np.linspace(0.0, 2.0, N) if timed else np.full(N, np.nan)
    q = np.outer(np.linspace(0.0, 1.0, N), [1.0, -1.0, 0.1])
    q[10:15] = np.nan
    kinds = list(PathEventKind)
    events = [PathEvent(kinds[0], 10, 14, t[10] - 0.01, t[14] + 0.01)]
    events += [PathEvent(kind, 16 + 3 * k, 17 + 3 * k, t[16 + 3 * k], t[17 + 3 * k])
               for k, kind in enumerate(kinds[1:])]  # fmt: skip
    events.append(PathEvent(PathEventKind.SINGULAR, 39, 39, t[39], t[39]))
    conditioning = np.linspace(0.3, 0.0, N)
    branch = np.full(N, "up")
    return JointPath(t, q, 2.0 * q, np.zeros(N, np.int8), conditioning, branch, tuple(events))


def seven():
    limits = MotionLimits(velocity=1.0, acceleration=3.0)
    goal = [1.0, -0.2, 0.6, 0.1, -0.5, 0.35, 1.3]
    return trapezoidal(np.zeros(7), goal, limits=limits,
                       synchronisation=Synchronisation.INDEPENDENT)  # fmt: skip


PROFILES = {
    "bang-bang": bang_bang(0.0, 1.0, limits=MotionLimits(1.5, 4.0)),
    "trapezoidal": trapezoidal(0.0, 1.0, limits=MotionLimits(1.5, 4.0)),
    "smoothed trapezoidal": smoothed_trapezoidal(0.0, 1.0, limits=MotionLimits(1.5, 4.0)),
    "cubic": cubic(0.0, 1.0, limits=MotionLimits(1.5, 4.0)),
    "quintic": quintic(0.0, 1.0, limits=MotionLimits(1.5, 4.0)),
    "jerk-limited": jerk_limited(0.0, 1.0, limits=MotionLimits(1.5, 4.0, 40.0)),
}

FIGURES = {
    "one joint": lambda: plot_trajectory(bang_bang(0.0, 1.0, duration=1.0)),
    "mixed": lambda: plot_trajectory(quintic([0, 0, 0], [1, -1, 0.2], duration=1.0),
                                     LIMITS, model=SCARA, title="A SCARA"),
    "seven": lambda: plot_trajectory(seven(), MotionLimits(0.9, 3.0, upper=1.2), units="deg"),
    "laws": lambda: plot_profiles(PROFILES, limits=MotionLimits(1.5, 4.0), unit="rad"),
    "laws side by side": lambda: plot_profiles(PROFILES, unit="deg", side_by_side=True,
                                               orders=(0, 2), title="Six"),
    "path": lambda: plot_joint_path(eventful_path(), model=SCARA, title="A path"),
    "in space": lambda: plot_pose_path(
        straight_line(se3.translation(0.5, 0.1, 0.2), se3.from_rpy((0.2, 1.0, 0.4)),
                      limits=MotionLimits(0.5, 2.0)), title="A line"),
    "map": lambda: plot_singularities(wrist_map()),
    "maps": lambda: plot_singularities([wrist_map(), wrist_map(), wrist_map()], RX90,
                                       q=np.zeros((25, 6)), title="Three"),
    "inverse": lambda: plot_inverse_velocities(*crossing()[::3], model=RX90, title="Wrist",
                                               limits=MotionLimits(5.0)),
    "inverse by joint": lambda: plot_inverse_velocities(*crossing()[::3], model=RX90,
                                                        each_joint=True),
    "motion": lambda: plot_joint_motion(
        load("panda"), np.linspace(0, 1, 20),
        {"with": np.outer(np.linspace(0, 1, 20), np.full(7, -0.5)),
         "without": np.outer(np.linspace(0, 1, 20), np.full(7, -3.5))}, title="Seven joints"),
}  # fmt: skip


@pytest.mark.parametrize("name", FIGURES)
def test_nothing_covers_anything_else(name):
    """Panels with their texts are apart from each other and from the legend, and on the page."""
    figure = FIGURES[name]()
    figure.draw_without_rendering()
    renderer = FigureCanvasAgg(figure).get_renderer()
    boxes = []
    for axes in figure.axes:
        if axes.name == "3d":  # its rectangle is larger than what is drawn
            sides = (axes.xaxis, axes.yaxis, axes.zaxis)
            boxes.append(Bbox.union([axis.get_tightbbox(renderer) for axis in sides]))
        elif axes.get_visible():
            boxes.append(axes.get_tightbbox())
    boxes += [each.get_window_extent() for each in figure.legends]
    slack = 2.0  # pixels: tick labels may reach a little over the end of their axis
    for box in boxes:
        assert box.x0 >= -slack
        assert box.y0 >= -slack
        assert box.x1 <= figure.bbox.x1 + slack
        assert box.y1 <= figure.bbox.y1 + slack
    for a, b in combinations(boxes, 2):
        width = min(a.x1, b.x1) - max(a.x0, b.x0)
        height = min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(width, height) <= slack
    data = [axes.get_window_extent() for axes in figure.axes if axes.get_visible()]
    assert min(box.width for box in data if box.height < 5 * box.width) > 60.0


@pytest.mark.parametrize("name", ["mixed", "path", "in space", "map", "motion"])
def test_texts_are_legible_under_any_style(name):
    with matplotlib.style.context("dark_background"), matplotlib.rc_context({"font.size": 30.0}):
        figure = FIGURES[name]()
        figure.draw_without_rendering()
        seen = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
        assert len(seen) > 8
        for text in seen:
            assert 8.0 <= text.get_size() <= 10.0, text
            assert sum(to_rgb(text.get_color())) < 1.0, text  # ink on white paper
        assert figure.get_facecolor() == (1.0, 1.0, 1.0, 1.0)
        assert all(to_rgb(axes.get_facecolor()) == (1.0, 1.0, 1.0) for axes in figure.axes)


def test_a_figure_shows_itself_and_leaves_pyplot_alone():
    script = """
import sys
import robotmodels as rm
from robotmodels.viz import plot_trajectory
assert "matplotlib" not in sys.modules
figure = plot_trajectory(rm.trajectories.quintic(0.0, 1.0, duration=1.0))
picture = figure._repr_png_()
assert picture.startswith(b"\\x89PNG") and len(picture) > 5000
assert "matplotlib.pyplot" not in sys.modules
sys.modules["matplotlib.figure"] = None
del sys.modules["robotmodels.viz.plot_figure"]
try:
    plot_trajectory(rm.trajectories.quintic(0.0, 1.0, duration=1.0))
except rm.errors.MissingExtraError as error:
    print(error)
"""
    run = subprocess.run([sys.executable, "-W", "error", "-c", script], capture_output=True,
                         text=True, timeout=120)  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert "pip install 'matplotlib" in run.stdout


def test_a_figure_is_one_of_matplotlib_and_pickles():
    figure = pickle.loads(pickle.dumps(FIGURES["one joint"]()))
    assert isinstance(figure, Figure)
    file = io.BytesIO()
    figure.savefig(file, format="pdf")
    assert file.getvalue().startswith(b"%PDF")
    assert plot_trajectory(seven(), size=(5.0, 4.0)).get_size_inches().tolist() == [5.0, 4.0]


# --- what the figures share ---------------------------------------------------------------------


def test_units_and_names_come_from_the_model():
    assert joint_names(None, 3, SCARA) == ["waist", "elbow", "lift"]
    assert joint_units(None, 3, SCARA) == [Unit.RADIAN, Unit.RADIAN, Unit.METRE]
    assert joint_units(["deg", "rad", "mm"], 3, SCARA)[2] is Unit.MILLIMETRE
    assert [Unit.UNSTATED.of(k) for k in (0, 2)] == ["rad or m", "rad/s² or m/s²"]
    with pytest.raises(InvalidValueError, match="joint 3 is prismatic, got 'rad'"):
        joint_units("rad", 3, SCARA)
    with pytest.raises(InvalidValueError, match="joint 1 is revolute, got 'mm'"):
        joint_units("mm", 3, SCARA)
    with pytest.raises(InvalidValueError, match="expected one of 'rad', 'deg'"):
        joint_units("grad", 3)
    with pytest.raises(ShapeError, match="each of the 3 joints, got 2"):
        joint_units(["rad", "m"], 3)
    with pytest.raises(ShapeError, match="got 'rx90' of 6"):
        joint_names(None, 3, RX90)
    with pytest.raises(InvalidValueError, match="expected a RobotModel"):
        joint_names(None, 3, "rx90")
    with pytest.raises(InvalidValueError, match="a list of texts"):
        joint_names("abc", 3)
    with pytest.raises(ShapeError, match="got 2"):
        joint_names(["a", "b"], 3)


def test_neighbouring_lines_differ_in_colour_and_in_dashes():
    styles = [line_style(k) for k in range(7)]
    assert len({style.color for style in styles}) == 7
    assert len({style.dashes for style in styles}) == 7


# --- trajectories -------------------------------------------------------------------------------


def test_trajectory_is_drawn_as_it_is():
    move = quintic([0.0, 0.0, 0.0], [1.0, -1.0, 0.2], duration=2.0)
    figure = plot_trajectory(move, model=SCARA)
    # columns of rad and of m, rows of derivatives
    rows = ["position", "velocity", "acceleration", "jerk"]
    units = ["", "/s", "/s²", "/s³"]
    assert labels(figure) == [
        f"{row} ({unit}{per})"
        for row, per in zip(rows, units, strict=True)
        for unit in ("rad", "m")
    ]
    for order, of in enumerate((move.q, move.v, move.a, move.jerk)):
        left, right = figure.axes[2 * order : 2 * order + 2]
        drawn = [*lines(left), *lines(right)]
        assert [line.get_label() for line in drawn] == ["waist", "elbow", "lift"]
        for j, line in enumerate(drawn):
            t, y = line.get_data()
            assert t[0] == 0.0
            assert t[-1] == 2.0
            assert t.size > 500
            np.testing.assert_allclose(y, of(t)[:, j], atol=1e-12)
    assert legend(figure) == ["waist", "elbow", "lift"]
    assert [axes.get_xlabel() for axes in figure.axes[-2:]] == ["time (s)", "time (s)"]


def test_both_sides_of_a_jump_are_drawn():
    figure = plot_trajectory(bang_bang(0.0, 1.0, duration=1.0), orders=(2,), units="m")
    t, a = lines(figure.axes[0])[0].get_data()
    at = np.flatnonzero(t == 0.5)[0]
    np.testing.assert_allclose(a[at - 1 : at + 1], [4.0, -4.0])
    assert t[at] - t[at - 1] < 1e-8
    (mark,) = lines(figure.axes[0], "_break")
    assert mark.get_xdata() == [0.5, 0.5]
    assert not lines(
        plot_trajectory(bang_bang(0, 1, duration=1), breakpoints=False).axes[0], "_break"
    )


def test_pieces_of_each_joint_are_marked_on_its_line():
    move = trapezoidal([0.0, 0.0], [1.0, 0.1], limits=MotionLimits(1.0, 4.0),
                       synchronisation=Synchronisation.INDEPENDENT)  # fmt: skip
    marks = lines(plot_trajectory(move, units="deg").axes[1], "_break")
    assert len(marks) == 2
    for j, mark in enumerate(marks):
        t, v = mark.get_data()
        np.testing.assert_array_equal(t, np.unique(move.motion.breaks[j]))
        np.testing.assert_allclose(v, np.degrees(move.v(t)[:, j]), atol=1e-12)


def test_limits_are_dashed_lines_in_the_unit_of_the_axes():
    move = trapezoidal([0, 0, 0], [1, -1, 0.2], limits=MotionLimits(1.0, 4.0))
    limits = MotionLimits(
        velocity=[0.8, 2.0, np.inf],
        velocity_lower=[-0.7, -2.0, -np.inf],
        acceleration=[5.0, 5.0, 3.0],
        lower=[-3, -3, 0],
        upper=[3, 3, 0.5],
    )
    figure = plot_trajectory(move, limits, units=["deg", "deg", "mm"], names=["a", "b", "c"])
    at = {
        (row, line.get_label()): line.get_ydata()[0]
        for row, axes in enumerate(figure.axes)
        for line in axes.get_lines()
        if "limit of" in line.get_label() and "beyond" not in line.get_label()
    }
    assert all(
        line.get_linestyle() == "--"
        for axes in figure.axes
        for line in axes.get_lines()
        if line.get_label().startswith(("_lower", "_upper"))
    )
    degrees = np.degrees([3.0, 0.8, -0.7, 2.0, 5.0])
    for key, value in {
        (0, "_upper limit of a and b"): degrees[0],
        (1, "_lower limit of c"): 0.0,
        (1, "_upper limit of c"): 500.0,
        (2, "_upper limit of a"): degrees[1],
        (2, "_lower limit of a"): degrees[2],
        (2, "_upper limit of b"): degrees[3],
        (4, "_upper limit of a and b"): degrees[4],
        (5, "_upper limit of c"): 3000.0,
    }.items():
        assert at[key] == pytest.approx(value), key
    assert not any(row in (3, 6, 7) for row, _ in at)  # infinite: no limits
    # joint a is too fast: what lies beyond is underlaid
    (beyond,) = lines(figure.axes[2], "_beyond the limit of a")
    (line,) = lines(figure.axes[2], "a")
    y, shown = line.get_ydata(), beyond.get_ydata()
    np.testing.assert_array_equal(np.isfinite(shown), y > degrees[1])
    np.testing.assert_array_equal(shown[np.isfinite(shown)], y[y > degrees[1]])
    assert legend(figure) == ["a", "b", "c", "limit", "beyond it"]


def test_limits_that_are_just_kept_are_kept():
    limits = MotionLimits(velocity=[1.0, 2.0], acceleration=[3.0, 1.0])
    figure = plot_trajectory(trapezoidal([0, 0], [1, 2], limits=limits), limits)
    assert legend(figure) == ["joint 1", "joint 2", "limit"]


def test_samples_fourier_series_and_motions_without_duration_are_drawn():
    series = fourier([[0.3, 0.1]], [[0.2, 0.4]], 2.0)
    figure = plot_trajectory(series, orders=(1,))
    t, v = lines(figure.axes[0])[1].get_data()
    np.testing.assert_allclose(v, series.v(t)[:, 1])
    samples = series.resample(samples=7)
    figure = plot_trajectory(samples)
    np.testing.assert_array_equal(
        lines(figure.axes[3])[0].get_data(), [samples.t, samples.jerk[:, 0]]
    )
    scalar = quintic(0.0, 1.0, duration=1.0).resample(samples=4)
    np.testing.assert_array_equal(lines(plot_trajectory(scalar).axes[0])[0].get_ydata(), scalar.q)
    still = plot_trajectory(trapezoidal([1.0], [1.0], limits=MotionLimits(1.0, 1.0)))
    still.draw_without_rendering()
    assert set(lines(still.axes[0])[0].get_ydata()) == {1.0}
    one = plot_trajectory(samples := Samples([0.0], [[2.0]], [[0.0]], [[0.0]], [[0.0]]))
    assert lines(one.axes[0])[0].get_ydata() == samples.q[0]


def test_trajectory_refuses_what_it_cannot_draw():
    batch = quintic(np.zeros((2, 3)), np.ones((2, 3)), duration=1.0)
    with pytest.raises(InvalidValueError, match=r"a batch of shape \(2,\)"):
        plot_trajectory(batch)
    with pytest.raises(ShapeError, match="samples of one motion"):
        plot_trajectory(batch.at([0.0, 1.0]))
    move = straight_line(np.eye(4), se3.translation(1, 0, 0), duration=1.0)
    with pytest.raises(InvalidValueError, match=r"motion of the tool.*\.law"):
        plot_trajectory(move)
    with pytest.raises(
        InvalidValueError, match="expected a Trajectory or its Samples, got ndarray"
    ):
        plot_trajectory(np.zeros(3))
    with pytest.raises(InvalidValueError, match="no samples"):
        plot_trajectory(seven().at([]))
    with pytest.raises(InvalidValueError, match="orders"):
        plot_trajectory(seven(), orders=(0, 4))
    with pytest.raises(InvalidValueError, match="orders"):
        plot_trajectory(seven(), orders=(1, 1))
    with pytest.raises(InvalidValueError, match="expected MotionLimits, got list"):
        plot_trajectory(seven(), [1.0])
    with pytest.raises(ShapeError, match="limits of 7 joints"):
        plot_trajectory(seven(), MotionLimits([1.0, 2.0]))
    with pytest.raises(InvalidValueError, match="positive inches"):
        plot_trajectory(seven(), size=(0.0, 1.0))


def test_profiles_carry_their_durations():
    figure = plot_profiles(PROFILES, unit="deg", limits=MotionLimits(1.5, 4.0))
    names = [f"{name}, {move.duration:.4g} s" for name, move in PROFILES.items()]
    assert [line.get_label() for line in lines(figure.axes[0])] == names
    assert legend(figure) == [*names, "limit"]
    for row, order in enumerate("qva"):
        for line, move in zip(lines(figure.axes[row]), PROFILES.values(), strict=True):
            t, y = line.get_data()
            np.testing.assert_allclose(y, np.degrees(getattr(move, order)(t)), atol=1e-9)
    apart = plot_profiles(list(PROFILES.values()), names=list(PROFILES), side_by_side=True,
                          orders=(1, 2))  # fmt: skip
    assert len(apart.axes) == 12
    titles = [" ".join(axes.get_title().split()) for axes in apart.axes[:6]]
    assert titles == [name.replace(",", "") for name in names]
    assert len({axes.get_ylim() for axes in apart.axes[:6]}) == 1  # common scales
    assert legend(apart) == []


def test_profiles_draw_the_joint_that_is_asked_for():
    move = quintic([0, 0, 0], [1, 2, 3], duration=1.0)
    figure = plot_profiles([move], joint=2, limits=MotionLimits([1.0, 2.0, 9.0]))
    np.testing.assert_allclose(lines(figure.axes[0])[0].get_ydata()[-1], 3.0)
    assert lines(figure.axes[1], "_upper limit of joint 3")[0].get_ydata() == [9.0, 9.0]
    for joint in (3, -1, 1.5, True):
        with pytest.raises(InvalidValueError, match="from 0 to 2"):
            plot_profiles([move], joint=joint)
    with pytest.raises(InvalidValueError, match="at least one"):
        plot_profiles({})
    with pytest.raises(InvalidValueError, match="has its own names"):
        plot_profiles({"a": move}, names=["b"])
    with pytest.raises(InvalidValueError, match="a list of them, got Trajectory"):
        plot_profiles(move)
    with pytest.raises(ShapeError, match="1 motions, got 2"):
        plot_profiles([move], names=["a", "b"])
    with pytest.raises(InvalidValueError, match="'second': expected a Trajectory"):
        plot_profiles({"first": move, "second": None})


# --- paths --------------------------------------------------------------------------------------


def test_joint_path_has_a_row_for_each_kind_of_event():
    path = eventful_path()
    figure = plot_joint_path(path, model=SCARA, units=["deg", "deg", "mm"])
    assert labels(figure) == [
        "position (deg)", "position (mm)", "velocity (deg/s)", "velocity (mm/s)",
        "conditioning (1)", "",
    ]  # fmt: skip
    for axes, values, factor, joints in (
        (figure.axes[0], path.q, np.degrees(1.0), (0, 1)),
        (figure.axes[3], path.v, 1e3, (2,)),
    ):
        for line, j in zip(lines(axes), joints, strict=True):
            np.testing.assert_array_equal(line.get_xdata(), path.t)
            np.testing.assert_allclose(line.get_ydata(), factor * values[:, j])
    events = figure.axes[-1]
    assert [text.get_text() for text in events.get_yticklabels()] == [
        "out of reach", "outside limits", "singular", "posture changes", "jump", "too fast",
    ]  # fmt: skip
    (reach,) = lines(events, "_out of reach")
    np.testing.assert_allclose(reach.get_xdata(), [path.t[10] - 0.01, path.t[14] + 0.01])
    singular = lines(events, "_ends of singular")
    assert [list(line.get_xdata()) for line in singular] == [
        [path.t[19], path.t[20]], [path.t[39]],
    ]  # fmt: skip
    # traces in the panels above
    spans = [patch.get_label() for patch in figure.axes[0].patches]
    assert spans == ["_out of reach", "_singular"]
    assert (
        len(lines(figure.axes[0], "_jump")) == len(lines(figure.axes[0], "_posture changes")) == 1
    )
    assert not lines(figure.axes[0], "_too fast")
    # the model's limits
    assert lines(figure.axes[0], "_lower limit of waist")[0].get_ydata()[0] == pytest.approx(
        np.degrees(-2.0)
    )
    assert lines(figure.axes[2], "_upper limit of elbow")[0].get_ydata()[0] == pytest.approx(
        np.degrees(3.0)
    )
    assert figure.axes[-2].get_yscale() == "log"  # the conditioning comes near zero
    shown = lines(figure.axes[-2], "conditioning")[0].get_ydata()
    np.testing.assert_array_equal(shown[:-1], path.conditioning[:-1])


def test_joint_path_without_times_is_drawn_over_the_poses():
    figure = plot_joint_path(eventful_path(timed=False), names=["a", "b", "c"])
    assert labels(figure) == ["position (rad or m)", "conditioning (1)", ""]
    assert figure.axes[-1].get_xlabel() == "number of the pose"
    assert list(lines(figure.axes[-1], "_out of reach")[0].get_xdata()) == [10.0, 14.0]
    assert legend(figure) == ["a", "b", "c"]


def test_joint_path_of_a_robot():
    q = np.array([0.1, 0.2, 1.3, 0.4, 0.5, 0.6])
    start = dgm(RX90, q)
    away = start.copy()
    away[:3, 3] = [-0.5, 0.9, -0.1]
    move = straight_line(start, away, limits=MotionLimits(1.0, 2.0))
    path = joint_path(RX90, move, q, samples=200)
    (event,) = path.of_kind(PathEventKind.OUT_OF_REACH)
    figure = plot_joint_path(path, model=RX90)
    (bar,) = lines(figure.axes[-1], "_out of reach")
    assert list(bar.get_xdata()) == [event.start, event.stop]
    calm = joint_path(RX90, cartesian_trajectory(start, dgm(RX90, q + 0.1), 9), q)
    quiet = plot_joint_path(calm, model=RX90)
    assert quiet.axes[-1].texts[0].get_text() == "nothing happens on the way"
    space = plot_pose_path(move, path)
    (run,) = lines(space.axes[0], "_run out of reach")
    np.testing.assert_allclose(
        np.transpose(run.get_data_3d())[0], move.pose(path.t[event.first])[:3, 3]
    )
    assert "out of reach" in legend(space)


def test_joint_path_refuses_what_is_none():
    with pytest.raises(InvalidValueError, match="expected a JointPath, got ndarray"):
        plot_joint_path(np.zeros((3, 6)))
    none = np.zeros((0, 3))
    empty = JointPath(none[:, 0], none, none, none[:, 0], none[:, 0], [], ())
    with pytest.raises(InvalidValueError, match="no poses"):
        plot_joint_path(empty)
    with pytest.raises(ShapeError, match="got 'rx90' of 6"):
        plot_joint_path(eventful_path(), model=RX90)


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_pose_path_has_equal_scales_and_frames(unit):
    T = np.stack(
        [se3.from_rpy((0.1 * k, 0.0, 0.02 * k), (0.1 * k, 0.02 * k, 0.3)) for k in range(9)]
    )
    figure = plot_pose_path(T, frames=3, frame_size=0.1, unit=unit)
    (axes,) = figure.axes
    factor = 1.0 if unit == "m" else 1e3
    assert [axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()] == [
        f"{name} ({unit})" for name in "xyz"
    ]
    np.testing.assert_allclose(lines(axes, "path")[0].get_data_3d(), factor * T[:, :3, 3].T)
    for k, name in enumerate("xyz"):
        drawn = [*lines(axes, f"tool {name}"), *lines(axes, f"_tool {name}")]
        assert len(drawn) == 3
        for i, line in zip((0, 4, 8), drawn, strict=True):
            ends = np.transpose(line.get_data_3d())
            np.testing.assert_allclose(ends[0], factor * T[i, :3, 3])
            np.testing.assert_allclose(ends[1] - ends[0], factor * 0.1 * T[i, :3, k], atol=1e-12)
    spans = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()), np.ptp(axes.get_zlim())])
    scale = spans / axes._box_aspect
    np.testing.assert_allclose(scale, scale[0])
    assert (spans > 0.3 * spans.max()).all()  # never flat
    assert legend(figure) == ["path", "tool x", "tool y", "tool z", "start", "end"]


def test_pose_path_of_turns_on_the_spot_and_of_one_pose():
    turn = np.stack([se3.from_rpy((0.0, 0.0, angle), (1.0, 2.0, 3.0)) for angle in (0.0, 0.5, 1.0)])
    for T in (turn, turn[:1]):
        (axes,) = plot_pose_path(T).axes
        (first,) = lines(axes, "tool x")
        assert np.linalg.norm(np.diff(first.get_data_3d(), axis=1)) == pytest.approx(0.1)
    bare = plot_pose_path(turn, frames=0)
    line = straight_line(np.eye(4), se3.translation(0.2, 0.1, 0.0), duration=1.0).resample(
        samples=5
    )
    drawn = lines(plot_pose_path(line).axes[0], "path")[0].get_data_3d()
    np.testing.assert_array_equal(drawn, line.T[:, :3, 3].T)
    assert legend(bare) == ["path", "start", "end"]
    view = plot_pose_path(turn, view=(0.5, 0.25)).axes[0]
    assert np.radians([view.azim, view.elev]) == pytest.approx([0.5, 0.25])


def test_pose_path_refuses_what_is_no_path():
    with pytest.raises(ShapeError, match=r"\(N, 4, 4\)"):
        plot_pose_path(np.eye(4))
    with pytest.raises(ShapeError, match="N at least 1"):
        plot_pose_path(np.zeros((0, 4, 4)))
    T = np.broadcast_to(np.eye(4), (3, 4, 4))
    with pytest.raises(ShapeError, match="these 3 poses, got 40"):
        plot_pose_path(T, eventful_path())
    with pytest.raises(InvalidValueError, match="expected a JointPath"):
        plot_pose_path(T, "path")
    with pytest.raises(InvalidValueError, match="a length"):
        plot_pose_path(T, unit="rad")
    with pytest.raises(InvalidValueError, match="positive length"):
        plot_pose_path(T, frame_size=0.0)
    for frames in (-1, 1.5, True):
        with pytest.raises(InvalidValueError, match="how many are drawn"):
            plot_pose_path(T, frames=frames)


# --- singular positions and inverse velocities ----------------------------------------------------


def contour_points(axes):
    zero = [each for each in axes.collections if each.get_label() == "_zero"]
    return np.concatenate([path.vertices for each in zero for path in each.get_paths()])


def test_map_is_drawn_in_degrees_with_zero_in_the_middle():
    grid = wrist_map()
    figure = plot_singularities(grid)
    axes, bar = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("elbow (deg)", "wrist (deg)")
    assert axes.get_title() == "C3 S5"
    assert bar.get_ylabel() == "value (m³)"
    image = axes.collections[0]
    np.testing.assert_array_equal(image.get_array(), grid.values.T)
    assert image.norm.vmin == -image.norm.vmax
    assert image.norm.vmax == pytest.approx(np.abs(grid.values).max())
    assert axes.get_xlim() == pytest.approx((-180.0, 180.0))
    assert axes.get_ylim() == pytest.approx(np.degrees((-2.0, 2.0)))
    # the bold line lies where cos(elbow) sin(wrist) is zero, and all of it is there
    x, y = np.radians(contour_points(axes)).T
    assert np.abs(np.cos(x) * np.sin(y)).max() < 5e-3
    for at in (-H, H):
        assert np.ptp(y[np.abs(x - at) < 0.02]) == pytest.approx(4.0, rel=0.02)
    assert np.ptp(x[np.abs(y) < 0.02]) == pytest.approx(2.0 * np.pi, rel=0.02)
    assert legend(figure) == ["singular: zero"]
    radians = plot_singularities(grid, degrees=False).axes[0]
    assert radians.get_xlabel() == "elbow (rad)"
    assert radians.get_xlim() == pytest.approx((-np.pi, np.pi))


def test_the_bold_line_of_a_robot_is_where_it_is_singular():
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    grid = singularity_map(RX90, ("joint_2", "joint_3"), at=q, samples=(80, 84))
    axes = plot_singularities(grid, RX90).axes[0]
    points = np.radians(contour_points(axes))
    assert len(points) > 300
    on_line = np.tile(q, (len(points), 1))
    on_line[:, [1, 2]] = points
    most = np.abs(grid.values).max()
    assert np.abs(np.linalg.det(jacobian(RX90, on_line))).max() < 2e-3 * most
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("joint_2 (deg)", "joint_3 (deg)")


def test_zeros_on_the_grid_cross_without_corners():
    """Lines of zeros through values that are zero themselves, at one of them and beside one."""
    for na in (20, 21):
        a, b = np.linspace(-1.0, 1.0, na), np.linspace(-1.0, 1.0, 21)
        x, y = np.radians(
            contour_points(plot_singularities(wrist_map(np.outer(a, b), a, b)).axes[0])
        ).T
        assert np.minimum(np.abs(x), np.abs(y)).max() < 1e-6
        for along, across in ((x, y), (y, x)):
            at = np.sort(along[np.abs(across) < 1e-6])
            assert at[[0, -1]] == pytest.approx([-1.0, 1.0])
            assert np.diff(at).max() < 0.11


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_zeros_that_are_touched_are_drawn_as_well(sign):
    a, b = np.linspace(-1.0, 1.0, 21), np.linspace(0.0, 0.5, 11)
    values = sign * (a[:, None] ** 2 + 0.0 * b)
    figure = plot_singularities(wrist_map(values, a, b, ("rad", "m", "1")))
    points = contour_points(figure.axes[0])
    np.testing.assert_allclose(points[:, 0], 0.0, atol=1e-9)
    assert np.ptp(points[:, 1]) == pytest.approx(0.5)
    assert figure.axes[0].get_ylabel() == "wrist (m)"
    assert figure.axes[1].get_ylabel() == "value"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_zeros_at_the_end_of_a_map_are_drawn(sign):
    a, b = np.linspace(0.0, 1.0, 21), np.linspace(0.0, 0.5, 11)
    points = contour_points(
        plot_singularities(wrist_map(sign * (a[:, None] + 0 * b), a, b)).axes[0]
    )
    np.testing.assert_allclose(points[:, 0], 0.0, atol=1e-9)
    assert np.radians(np.ptp(points[:, 1])) == pytest.approx(0.5)


def test_maps_without_zeros_zero_everywhere_and_with_gaps():
    a, b = np.linspace(-1.0, 1.0, 21), np.linspace(0.0, 0.5, 11)
    without = plot_singularities(wrist_map(2.0 + a[:, None] + b, a, b))
    assert legend(without) == []
    zero = plot_singularities(wrist_map(np.zeros((21, 11)), a, b))
    assert "zero everywhere" in zero.axes[0].texts[0].get_text()
    values = a[:, None] + b
    values[:5] = np.nan
    gaps = plot_singularities(wrist_map(values, a, b)).axes[0]
    np.testing.assert_array_equal(gaps.collections[0].get_array().mask, np.isnan(values.T))
    x, y = np.radians(contour_points(gaps)).T
    np.testing.assert_allclose(x + y, 0.0, atol=1e-9)


def test_maps_show_limits_and_postures():
    table = DHTable.from_rows(
        [{"lower": -1.0, "upper": 4.0}, {}, {"lower": -4.0, "upper": 1.5}, {}, {"lower": 2.5}]
    )
    arm = RobotModel.from_table(table)
    q = np.outer(np.linspace(0.0, 1.0, 24), np.arange(5.0))
    figure = plot_singularities([wrist_map(), wrist_map()], arm, q=q)
    axes = figure.axes[0]
    assert len(lines(axes, "_upper limit of elbow")) == 1
    assert lines(axes, "_upper limit of elbow")[0].get_xdata()[0] == pytest.approx(np.degrees(1.5))
    assert not lines(axes, "_lower limit of elbow")  # outside of the map
    hatched = [patch.get_extents() for patch in axes.patches if patch.get_hatch()]
    assert len(hatched) == 2  # above the elbow's limit, and all of it: the wrist begins at 2.5
    (drawn,) = lines(axes, "postures")
    np.testing.assert_allclose(np.radians(drawn.get_data()), q[:, [2, 4]].T)
    assert drawn.get_markevery()[-1] == 23
    assert legend(figure) == ["singular: zero", "outside joint limits", "postures"]
    assert len(lines(plot_singularities(wrist_map(), q=np.zeros(6)).axes[0], "postures")) == 1


def test_maps_refuse_what_is_none():
    for maps in ([], "map", [wrist_map(), 1], None):
        with pytest.raises(InvalidValueError, match="one or several SingularityMap"):
            plot_singularities(maps)
    with pytest.raises(ShapeError, match="at least two values"):
        plot_singularities(wrist_map(np.ones((1, 31)), np.zeros(1)))
    with pytest.raises(InvalidValueError, match="no finite value"):
        plot_singularities(wrist_map(np.full((41, 31), np.nan)))
    with pytest.raises(ShapeError, match="'scara' with its 3 joints"):
        plot_singularities(wrist_map(), SCARA)
    with pytest.raises(ShapeError, match="n at least 5"):
        plot_singularities(wrist_map(), q=[0.0, 1.0])
    with pytest.raises(InvalidValueError, match="columns"):
        plot_singularities(wrist_map(), columns=0)


def test_inverse_velocities_are_drawn_as_they_are():
    d, _, _, found = crossing()
    figure = plot_inverse_velocities(d, found, model=RX90, limits=MotionLimits([5, 5, 5, 6, 6, 6]))
    assert labels(figure) == [
        "greatest joint speed (rad/s)", "missing linear velocity (m/s)",
        "missing angular velocity (rad/s)",
    ]  # fmt: skip
    speed, linear, angular = figure.axes
    for name, (v, error) in found.items():
        for axes, values in (
            (speed, np.abs(v).max(axis=1)),
            (linear, np.linalg.norm(error[:, :3], axis=1)),
            (angular, np.linalg.norm(error[:, 3:], axis=1)),
        ):
            (line,) = lines(axes, name)
            np.testing.assert_allclose(line.get_xdata(), np.degrees(d))
            np.testing.assert_allclose(line.get_ydata(), values)
    limits = [line for line in speed.get_lines() if line.get_label().startswith("_upper")]
    assert [line.get_ydata()[0] for line in limits] == [5.0, 6.0]
    assert legend(figure) == ["light", "strong", "limit"]
    assert angular.get_xlabel() == "distance from the singular position (deg)"


def test_inverse_velocities_of_solutions_have_singular_values():
    d, q, twist, _ = crossing()
    found = ikm(RX90, q, twist)
    figure = plot_inverse_velocities(d, {"ikm": found}, distance_unit="rad")
    assert labels(figure)[-1] == "least singular value"
    np.testing.assert_array_equal(
        lines(figure.axes[-1])[0].get_ydata(), found.singular_values[:, -1]
    )
    np.testing.assert_allclose(lines(figure.axes[0])[0].get_xdata(), d)
    masked = ikm(RX90, q, twist, mask=[1, 1, 1, 0, 0, 0])
    assert "missing angular velocity (rad/s)" not in labels(plot_inverse_velocities(d, [masked]))


def test_inverse_velocities_of_each_joint():
    d, _, _, found = crossing()
    figure = plot_inverse_velocities(d, found, model=RX90, each_joint=True)
    assert [axes.get_title() for axes in figure.axes[:2]] == ["light", "strong"]
    for axes, (v, _) in zip(figure.axes[:2], found.values(), strict=True):
        np.testing.assert_allclose([line.get_ydata() for line in lines(axes)], np.abs(v).T)
    assert legend(figure) == [f"joint_{j}" for j in range(1, 7)]
    mixed = plot_inverse_velocities(d, [(np.ones((81, 3)), None)], model=SCARA)
    assert labels(mixed) == ["greatest joint speed (rad/s)", "greatest joint speed (m/s)"]


def test_scales_of_powers_where_apt():
    near = np.geomspace(1e-4, 1.0, 41)
    steep = (1.0 / near)[:, None] * np.ones(2)
    one = plot_inverse_velocities(near, {"exact": (steep, None)})
    assert (one.axes[0].get_xscale(), one.axes[0].get_yscale()) == ("log", "log")
    both = plot_inverse_velocities(np.r_[-near[::-1], 0.0, near],
                                   {"a": (np.ones((83, 1)), None)})  # fmt: skip
    assert (both.axes[0].get_xscale(), both.axes[0].get_yscale()) == ("symlog", "linear")
    even = plot_inverse_velocities(np.linspace(0.01, 1, 41), {"a": (steep, None)})
    assert even.axes[0].get_xscale() == "linear"
    forced = plot_inverse_velocities(near, {"exact": (steep, None)}, logarithmic=False)
    assert forced.axes[0].get_xscale() == "linear"
    stands = steep.copy()
    stands[3] = 0.0
    zero = plot_inverse_velocities(near, {"a": (stands, None)})
    assert zero.axes[0].get_yscale() == "symlog"  # so that zero has a place
    assert zero.axes[0].get_ylim()[0] == 0.0
    gap = steep.copy()
    gap[3] = np.nan
    assert plot_inverse_velocities(near, {"a": (gap, None)}).axes[0].get_yscale() == "log"


def test_inverse_velocities_refuse_what_does_not_fit():
    d, _, _, found = crossing()
    v, error = found["light"]
    for distance in (d[::-1], d[:, None], []):
        with pytest.raises(InvalidValueError, match="ascend"):
            plot_inverse_velocities(distance, found)
    with pytest.raises(ShapeError, match=r"velocities of shape \(81, n\), got \(80, 6\)"):
        plot_inverse_velocities(d, {"a": (v[1:], None)})
    with pytest.raises(ShapeError, match=r"errors of shape \(81, 6\), got \(81, 5\)"):
        plot_inverse_velocities(d, {"a": (v, error[:, 1:])})
    with pytest.raises(ShapeError, match=r"one robot, got \[2, 6\] joints"):
        plot_inverse_velocities(d, [(v, None), (v[:, :2], None)])
    with pytest.raises(InvalidValueError, match="IKMSolution or a pair"):
        plot_inverse_velocities(d, {"a": v})
    with pytest.raises(InvalidValueError, match="at least one"):
        plot_inverse_velocities(d, {})
    with pytest.raises(InvalidValueError, match="a different one"):
        plot_inverse_velocities(d, [(v, None), (v, None)], names=["a", "a"])
    with pytest.raises(InvalidValueError, match="own names"):
        plot_inverse_velocities(d, found, names=["a", "b"])


# --- motion within limits -----------------------------------------------------------------------


def test_joint_motion_fills_panels_with_the_range():
    t = np.linspace(0.0, 2.0, 21)
    inside = np.c_[-0.5 + np.sin(t), 5.0 * t, 0.1 + 0.05 * t]
    outside = inside + np.array([0.0, 0.0, 0.1])
    figure = plot_joint_motion(SCARA, t, {"with": inside, "without": outside})
    waist, elbow, lift, margin = figure.axes
    names = [axes.get_title(loc="left") for axes in figure.axes]
    assert names == ["waist (deg)", "elbow (deg)", "lift (m)", "least margin (%)"]
    np.testing.assert_allclose(lines(waist, "with")[0].get_ydata(), np.degrees(inside[:, 0]))
    np.testing.assert_array_equal(lines(lift, "without")[0].get_ydata(), outside[:, 2])
    # as high as the range and an eighth more on either side
    assert waist.get_ylim() == pytest.approx(np.degrees([-2.36, 1.36]))
    assert waist.get_yticks() == pytest.approx(np.degrees([-2.0, -0.5, 1.0]))
    assert lift.get_ylim()[1] > 0.3  # a joint beyond its limit is still to be seen
    assert sorted(line.get_ydata()[0] for line in lines(lift, "_limit")) == [0.0, 0.2]
    assert len([patch for patch in lift.patches if patch.get_label() == "_beyond the limit"]) == 2
    assert not elbow.patches  # no limits
    expected = np.minimum(
        np.minimum(inside[:, 0] + 2.0, 1.0 - inside[:, 0]) / 1.5,
        np.minimum(inside[:, 2], 0.2 - inside[:, 2]) / 0.1,
    )
    np.testing.assert_allclose(lines(margin, "with")[0].get_ydata(), 100.0 * expected, atol=1e-9)
    assert legend(figure) == ["with", "without", "limit", "beyond it"]
    assert figure.axes[-1].get_xlabel() == "time (s)"


def test_joint_motion_with_one_limit_or_none():
    table = DHTable(antecedent=[0, 1], sigma=[0, 0], lower=[-np.inf, -1.0], upper=[np.inf, np.inf])
    t = np.linspace(0.0, 1.0, 5)
    figure = plot_joint_motion(RobotModel.from_table(table), t, np.c_[t, t - 1.5], degrees=False)
    first, second = figure.axes  # no margin where no joint has both limits
    assert not lines(first, "_limit")
    assert [line.get_ydata()[0] for line in lines(second, "_limit")] == [-1.0]
    assert second.get_title(loc="left") == "joint_2 (rad)"
    alone = plot_joint_motion(RobotModel.from_table(table), t[:1], [[0.0, 0.0]])
    alone.draw_without_rendering()
    assert lines(alone.axes[0])[0].get_marker() == "o"


def test_joint_motion_of_seven_joints_stands_in_two_columns():
    arm = load("panda")
    t = np.linspace(0.0, 1.0, 5)
    q = np.outer(t, np.full(7, -0.3))
    figure = plot_joint_motion(arm, t, q)
    x = {axes.get_position().x0 for axes in figure.axes}
    figure.draw_without_rendering()
    assert len(figure.axes) == 8
    assert len(x) == 2
    assert sum(axes.get_xlabel() == "time (s)" for axes in figure.axes) == 2
    three = plot_joint_motion(arm, t, q, columns=3)
    assert sum(not axes.get_visible() for axes in three.axes) == 1
    assert sum(axes.get_xlabel() == "time (s)" for axes in three.axes if axes.get_visible()) == 3


def test_joint_motion_refuses_what_does_not_fit():
    t, q = np.linspace(0.0, 1.0, 5), np.zeros((5, 3))
    with pytest.raises(InvalidValueError, match="expected a RobotModel"):
        plot_joint_motion("scara", t, q)
    with pytest.raises(ShapeError, match=r"t: expected shape \(N,\)"):
        plot_joint_motion(SCARA, [], q[:0])
    with pytest.raises(ShapeError, match=r"q of 'a': expected positions of shape \(5, 3\)"):
        plot_joint_motion(SCARA, t, {"a": q[1:]})
    with pytest.raises(InvalidValueError, match="at least one motion"):
        plot_joint_motion(SCARA, t, {})
    with pytest.raises(InvalidValueError, match="finite positions"):
        plot_joint_motion(SCARA, t, np.full((5, 3), np.inf))
    with pytest.raises(InvalidValueError, match="columns"):
        plot_joint_motion(SCARA, t, q, columns=1.5)

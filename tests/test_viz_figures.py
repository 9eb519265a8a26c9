"""Figures: their lines, limits, units and legends are those of the data."""

import pickle
import subprocess
import sys

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

import robotmodels as rm
from robotmodels import se3, simulation, viz
from robotmodels import trajectories as tr
from robotmodels.errors import InvalidValueError, RobotModelsError, ShapeError
from robotmodels.symbolic import SingularityMap

H = np.pi / 2
RX90 = rm.load("rx90").with_drive(
    rm.DriveParameters(
        Ia=np.full(6, 0.2), Fv=[20, 20, 10, 1, 1, 0.5], Fc=[20, 30, 20, 5, 3, 2], offset=np.ones(6)
    )
)
SCARA = rm.RobotModel.from_table(
    rm.DHTable.from_rows([
        {"sigma": 0, "name": "waist", "lower": -2.0, "upper": 1.0}, {"sigma": 2, "d": 0.1},
        {"sigma": 0, "d": 0.35, "name": "elbow", "velocity": 3.0},
        {"sigma": 1, "d": 0.3, "alpha": np.pi, "lower": 0.0, "upper": 0.2, "name": "lift"},
    ]),
    rm.InertialParameters.from_com([3.0, 0.0, 2.0, 1.0], [[0.1, 0, 0]] * 3 + [[0, 0, 0]],
                                   [0.02 * np.eye(3)] * 4),
    name="scara",
)  # fmt: skip
Q = np.array([0.4, 0.7, 0.8, 0.4, 0.9, 0.6])
MOVE = tr.quintic([0.0, 0.0, 0.0], [1.0, -1.0, 0.2], duration=2.0)
SWING = tr.quintic(np.zeros(6), [1, -0.5, 0.8, 1, 0.5, 2], duration=1.0)
REST = np.array([0.0, 0.3, 0.5, 0.2, 0.4, 0.1])
FALL = simulation.simulate(RX90, REST, np.zeros(6), t=np.linspace(0.0, 1.5, 60))
WORKED = simulation.simulate(
    RX90, REST, np.zeros(6), np.full(6, 5.0), wrench=[10.0, 0, 20.0, 0, 1.0, 0],
    t=np.linspace(0.0, 0.5, 30),
)  # fmt: skip


def eventful_path(timed=True):
    """A path on which everything happens, without a robot that does it."""
    N, kinds = 40, list(tr.PathEventKind)
    t = np.linspace(0.0, 2.0, N) if timed else np.full(N, np.nan)
    q = np.outer(np.linspace(0.0, 1.0, N), [1.0, -1.0, 0.1])
    q[10:15] = np.nan
    events = [tr.PathEvent(kinds[0], 10, 14, t[10] - 0.01, t[14] + 0.01)]
    events += [tr.PathEvent(kind, 16 + 3 * k, 17 + 3 * k, t[16 + 3 * k], t[17 + 3 * k])
               for k, kind in enumerate(kinds[1:])]  # fmt: skip
    conditioning = np.linspace(0.3, 0.0, N)
    codes = np.zeros(N, np.int8)
    return tr.JointPath(t, q, 2.0 * q, codes, conditioning, np.full(N, "up"), tuple(events))


def wrist_map(values=None, a=None, b=None, units=("rad", "rad", "m^3")):
    a = np.linspace(-np.pi, np.pi, 41) if a is None else a
    b = np.linspace(-2.0, 2.0, 31) if b is None else b
    z = np.cos(a)[:, None] * np.sin(b) if values is None else values
    return SingularityMap("rx90", np.array([2, 4]), ("elbow", "wrist"), a, b, z, "C3 S5", units)


def crossing():
    """Two inverse models on a way through the wrist singularity."""
    d = np.linspace(-0.2, 0.2, 81)
    q = np.tile([0.1, 0.2, 0.3, 0.4, 0.0, 0.6], (81, 1))
    q[:, 4] = d
    twist = np.array([0.1, 0.2, 0.05, 0.1, 0.3, 0.2])
    found = {}
    for name, damping in (("light", 0.01), ("strong", 0.1)):
        J = rm.jacobian(RX90, q)
        square = J @ J.swapaxes(1, 2) + damping**2 * np.eye(6)
        v = (J.swapaxes(1, 2) @ np.linalg.solve(square, np.tile(twist, (81, 1))[..., None]))[..., 0]
        found[name] = (v, twist - np.einsum("nij,nj->ni", J, v))
    return d, q, twist, found


D, ROWS, TWIST, FOUND = crossing()
BOTH = [rm.velocity_ellipsoid(RX90, Q), rm.force_ellipsoid(RX90, Q)]
LINE = tr.straight_line(se3.translation(0.5, 0.1, 0.2), se3.from_rpy((0.2, 1.0, 0.4)), duration=1.0)


def lines(axes, label=None):
    """The lines that a legend would name, or those of one label."""
    if label is None:
        return [x for x in axes.get_lines() if x.get_label()[0] != "_" and len(x.get_xdata())]
    return [line for line in axes.get_lines() if line.get_label() == label]


def data(axes, label):
    """Values of the only line with a label."""
    (line,) = [line for line in lines(axes, label) if len(line.get_xdata())]
    return np.asarray(line.get_ydata(), dtype=float)


def labels(figure):
    return [" ".join(axes.get_ylabel().split()) for axes in figure.axes]


def legend(figure):
    return [text.get_text() for each in figure.legends for text in each.get_texts()]


def test_a_figure_shows_itself_and_leaves_pyplot_alone():
    script = """
import sys
import robotmodels as rm
from robotmodels.viz import plot_trajectory
assert "matplotlib" not in sys.modules
figure = plot_trajectory(rm.trajectories.quintic(0.0, 1.0, duration=1.0))
assert figure._repr_png_().startswith(b"\\x89PNG")
assert "matplotlib.pyplot" not in sys.modules
sys.modules["matplotlib.style"] = None
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
    with matplotlib.rc_context({"font.size": 30.0}):  # whatever style is set outside
        figure = pickle.loads(pickle.dumps(viz.plot_trajectory(MOVE, size=(5.0, 4.0))))
    assert isinstance(figure, Figure)
    assert figure.get_size_inches().tolist() == [5.0, 4.0]
    assert all(text.get_size() < 11.0 for text in figure.findobj(Text))
    with pytest.raises(TypeError, match="unexpected arguments: colour"):
        viz.plot_trajectory(MOVE, colour="red")


# ---------------------------------------------------------------- trajectories


def test_trajectory_is_drawn_as_it_is():
    figure = viz.plot_trajectory(MOVE, model=SCARA, units=["deg", "rad", "mm"])
    assert labels(figure)[:4] == ["position (deg)", "position (rad)", "position (mm)",
                                  "velocity (deg/s)"]  # fmt: skip
    factors = {"waist": 180.0 / np.pi, "elbow": 1.0, "lift": 1e3}
    for order, of in enumerate((MOVE.q, MOVE.v, MOVE.a, MOVE.jerk)):
        for j, (name, factor) in enumerate(factors.items()):
            axes = figure.axes[3 * order + j]
            t = lines(axes, name)[0].get_xdata()
            assert (t[0], t[-1]) == (0.0, 2.0)
            np.testing.assert_allclose(data(axes, name), factor * of(t)[:, j], atol=1e-9)
    assert legend(figure) == list(factors)
    samples = MOVE.resample(samples=7)
    drawn = viz.plot_trajectory(samples, orders=(3,)).axes[0]
    np.testing.assert_array_equal(data(drawn, "joint 2"), samples.jerk[:, 1])


def test_both_sides_of_a_jump_and_the_pieces_are_drawn():
    axes = viz.plot_trajectory(tr.bang_bang(0.0, 1.0, duration=1.0), orders=(2,), units="m").axes[0]
    t, a = axes.get_lines()[0].get_data()
    at = np.flatnonzero(t == 0.5)[0]
    np.testing.assert_allclose(a[at - 1 : at + 1], [4.0, -4.0])
    assert lines(axes, "_break")[0].get_xdata() == [0.5, 0.5]
    move = tr.trapezoidal([0.0, 0.0], [1.0, 0.1], limits=tr.MotionLimits(1.0, 4.0),
                          synchronisation=tr.Synchronisation.INDEPENDENT)  # fmt: skip
    for j, mark in enumerate(lines(viz.plot_trajectory(move, units="deg").axes[1], "_break")):
        t, v = mark.get_data()
        np.testing.assert_array_equal(t, np.unique(move.motion.breaks[j]))
        np.testing.assert_allclose(v, np.degrees(move.v(t)[:, j]), atol=1e-12)


def test_limits_are_dashed_lines_and_values_beyond_them_are_underlaid():
    move = tr.trapezoidal([0, 0, 0], [1, -1, 0.2], limits=tr.MotionLimits(1.0, 4.0))
    limits = tr.MotionLimits(velocity=[0.8, 2.0, np.inf], velocity_lower=[-0.7, -2.0, -np.inf],
                             acceleration=[5.0, 5.0, 3.0], lower=[-3, -3, 0],
                             upper=[3, 3, 0.5])  # fmt: skip
    figure = viz.plot_trajectory(move, limits, units=["deg", "deg", "mm"], names=["a", "b", "c"])
    for row, label, values in (
        (0, "_limit of a and b", np.degrees([-3.0, 3.0])),
        (1, "_limit of c", [0.0, 500.0]),
        (2, "_limit of a", np.degrees([-0.7, 0.8])),
        (2, "_limit of b", np.degrees([-2.0, 2.0])),
        (5, "_limit of c", [-3000.0, 3000.0]),
    ):
        drawn = lines(figure.axes[row], label)
        assert [line.get_ydata()[0] for line in drawn] == pytest.approx(values)
        assert {line.get_linestyle() for line in drawn} == {"--"}
    assert not lines(figure.axes[3], "_limit of c")  # infinite: no limit
    y, beyond = data(figure.axes[2], "a"), data(figure.axes[2], "beyond the limit")
    np.testing.assert_array_equal(np.isfinite(beyond), y > np.degrees(0.8))
    assert legend(figure) == ["a", "b", "c", "limit", "beyond the limit"]


# ---------------------------------------------------------------- paths


def test_joint_path_has_a_row_for_each_kind_of_event():
    path = eventful_path()
    figure = viz.plot_joint_path(path, model=SCARA, units=["deg", "deg", "mm"])
    assert labels(figure) == ["position (deg)", "position (mm)", "velocity (deg/s)",
                              "velocity (mm/s)", "conditioning (1)", ""]  # fmt: skip
    np.testing.assert_allclose(data(figure.axes[0], "elbow"), np.degrees(path.q[:, 1]))
    np.testing.assert_allclose(data(figure.axes[3], "lift"), 1e3 * path.v[:, 2])
    events = figure.axes[-1]
    assert [text.get_text() for text in events.get_yticklabels()] == [
        "out of reach", "outside limits", "singular", "posture changes", "jump", "too fast",
    ]  # fmt: skip
    for row, event in enumerate(path.events):
        bar, _ = [x for x in events.get_lines() if x.get_ydata()[0] == row]
        assert list(bar.get_xdata()) == [event.start, event.stop]
    assert [patch.get_label() for patch in figure.axes[0].patches] == ["_out of reach", "_singular"]
    assert len(lines(figure.axes[0], "_jump")) == len(lines(figure.axes[1], "_jump")) == 1
    limits = lines(figure.axes[0], "_limit of waist")  # of the model
    assert [x.get_ydata()[0] for x in limits] == pytest.approx(np.degrees([-2.0, 1.0]))
    assert figure.axes[-2].get_yscale() == "log"  # the conditioning comes near zero
    shown = data(figure.axes[-2], "_conditioning")
    np.testing.assert_array_equal(shown[:-1], path.conditioning[:-1])
    untimed = viz.plot_joint_path(eventful_path(timed=False), names=["a", "b", "c"])
    assert untimed.axes[-1].get_xlabel() == "number of the pose"
    assert list(untimed.axes[-1].get_lines()[0].get_xdata()) == [10.0, 14.0]


def test_pose_path_has_equal_scales_frames_and_events():
    T = np.stack(
        [se3.from_rpy((0.1 * k, 0.0, 0.02 * k), (0.1 * k, 0.02 * k, 0.3)) for k in range(40)]
    )
    figure = viz.plot_pose_path(T, eventful_path(), frames=3, frame_size=0.1, unit="mm")
    (axes,) = figure.axes
    factor = 1e3
    assert axes.get_zlabel() == "z (mm)"
    np.testing.assert_allclose(lines(axes, "path")[0].get_data_3d(), factor * T[:, :3, 3].T)
    for k, name in enumerate("xyz"):
        for i, line in zip((0, 20, 39), lines(axes, f"tool {name}"), strict=True):
            start, tip = np.transpose(line.get_data_3d())
            np.testing.assert_allclose(start, factor * T[i, :3, 3])
            np.testing.assert_allclose(tip - start, factor * 0.1 * T[i, :3, k], atol=1e-9)
    (run,) = lines(axes, "_out of reach")
    np.testing.assert_allclose(run.get_data_3d(), factor * T[10:15, :3, 3].T)
    spans = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()), np.ptp(axes.get_zlim())])
    np.testing.assert_allclose(spans / axes._box_aspect, (spans / axes._box_aspect)[0])


def test_joint_motion_fills_panels_with_the_range():
    t = np.linspace(0.0, 2.0, 21)
    inside = np.c_[-0.5 + np.sin(t), 5.0 * t, 0.1 + 0.05 * t]
    outside = inside + np.array([0.0, 0.0, 0.1])
    figure = viz.plot_joint_motion(SCARA, t, {"with": inside, "without": outside})
    waist, elbow, lift, margin = figure.axes
    np.testing.assert_allclose(data(waist, "with"), np.degrees(inside[:, 0]))
    assert waist.get_yticks() == pytest.approx(np.degrees([-2.0, -0.5, 1.0]))
    assert lift.get_ylim()[1] > 0.3  # a joint beyond its limit is still to be seen
    assert (len(lift.patches), len(elbow.patches)) == (2, 0)  # no limits of the elbow
    expected = np.minimum(
        np.minimum(inside[:, 0] + 2.0, 1.0 - inside[:, 0]) / 1.5,
        np.minimum(inside[:, 2], 0.2 - inside[:, 2]) / 0.1,
    )
    np.testing.assert_allclose(data(margin, "with"), 100.0 * expected, atol=1e-9)


# ---------------------------------------------------------------- velocities


def zero_points(axes):
    """Points of the bold lines and dots of a map, rad."""
    drawn = [path.vertices for each in axes.collections[1:] for path in each.get_paths()]
    drawn += [dots.get_xydata() for dots in lines(axes, "_zero")]
    return np.radians(np.concatenate(drawn))


def test_map_is_drawn_in_degrees_with_zero_in_the_middle():
    grid = wrist_map()
    figure = viz.plot_singularities(grid)
    axes, bar = figure.axes
    assert (axes.get_xlabel(), bar.get_ylabel()) == ("elbow (deg)", "value (m³)")
    image = axes.collections[0]
    np.testing.assert_array_equal(image.get_array(), grid.values.T)
    assert image.norm.vmin == -image.norm.vmax == -np.abs(grid.values).max()
    # the bold line lies where cos(elbow) sin(wrist) is zero
    x, y = zero_points(axes).T
    assert np.abs(np.cos(x) * np.sin(y)).max() < 5e-3
    assert np.ptp(x[np.abs(y) < 0.02]) == pytest.approx(2.0 * np.pi, rel=0.02)


def test_maps_show_limits_and_postures():
    rows = [{}, {}, {"lower": -4.0, "upper": 1.5}, {}, {"lower": 2.5}]
    arm = rm.RobotModel.from_table(rm.DHTable.from_rows(rows))
    q = np.outer(np.linspace(0.0, 1.0, 24), np.arange(5.0))
    figure = viz.plot_singularities([wrist_map(), wrist_map()], arm, q=q)
    axes = figure.axes[0]
    (limit,) = lines(axes, "_limit of elbow")  # the lower one is outside of the map
    assert limit.get_xdata()[0] == pytest.approx(np.degrees(1.5))
    assert len([patch for patch in axes.patches if patch.get_hatch()]) == 2
    drawn = [np.radians(np.asarray(x)) for x in lines(axes, "postures")[0].get_data()]
    np.testing.assert_allclose(drawn, q[:, [2, 4]].T)
    assert legend(figure) == ["singular: zero", "outside joint limits", "postures"]


def test_inverse_velocities_are_drawn_as_they_are():
    limits = tr.MotionLimits([5, 5, 5, 6, 6, 6])
    figure = viz.plot_inverse_velocities(D, FOUND, model=RX90, limits=limits)
    assert labels(figure) == ["greatest joint speed (rad/s)", "missing linear velocity (m/s)",
                              "missing angular velocity (rad/s)"]  # fmt: skip
    speed, linear, angular = figure.axes
    for name, (v, error) in FOUND.items():
        np.testing.assert_allclose(lines(speed, name)[0].get_xdata(), np.degrees(D))
        np.testing.assert_allclose(data(speed, name), np.abs(v).max(axis=1))
        np.testing.assert_allclose(data(linear, f"_{name}"), np.linalg.norm(error[:, :3], axis=1))
        np.testing.assert_allclose(data(angular, f"_{name}"), np.linalg.norm(error[:, 3:], axis=1))
    drawn = {x.get_ydata()[0] for x in speed.get_lines() if x.get_label().startswith("_limit")}
    assert drawn == {5.0, 6.0}
    assert legend(figure) == ["light", "strong", "limit"]
    found = rm.ikm(RX90, ROWS, TWIST)
    own = viz.plot_inverse_velocities(D, {"ikm": found}, distance_unit="rad")
    assert labels(own)[-1] == "least singular value"
    np.testing.assert_array_equal(data(own.axes[-1], "_ikm"), found.singular_values[:, -1])
    masked = rm.ikm(RX90, ROWS, TWIST, mask=[1, 1, 1, 0, 0, 0])
    assert not any("angular" in text for text in labels(viz.plot_inverse_velocities(D, [masked])))


def test_projections_are_the_widths_of_the_ellipsoid():
    figure = viz.plot_ellipsoids(BOTH)
    for row, ellipsoid in enumerate(BOTH):
        for column, plane in enumerate(((0, 1), (0, 2), (1, 2))):
            axes = figure.axes[3 * row + column]
            points = axes.get_lines()[0].get_xydata()
            for direction in np.eye(2):
                world = np.zeros(3)
                world[list(plane)] = direction
                width = ellipsoid.extent_along(world)
                assert (points @ direction).max() == pytest.approx(width, rel=1e-3)
            assert axes.get_xlim()[1] > points[:, 0].max()
            assert axes.get_ylabel() == f"${'vf'[row]}_{'xyz'[plane[1]]}$ ({['m/s', 'N'][row]})"


# ---------------------------------------------------------------- dynamics


def test_energy_lines_are_those_of_the_balance():
    figure = viz.plot_energy(WORKED)
    upper, lower = figure.axes
    names = ["kinetic energy", "potential energy", "friction work", "work of the tool",
             "\N{MINUS SIGN} control work"]  # fmt: skip
    assert legend(figure) == [*names, "sum"]
    assert upper.get_ylabel() == "energy (J)"
    np.testing.assert_array_equal(data(upper, "kinetic energy"), WORKED.kinetic)
    total = np.sum([data(upper, name) for name in names], axis=0)
    np.testing.assert_allclose(data(upper, "sum"), total, atol=1e-9)
    unit = lower.get_ylabel().removeprefix("drift (").removesuffix(")")
    factor = {"J": 1.0, "mJ": 1e3, "µJ": 1e6, "nJ": 1e9, "pJ": 1e12}[unit]
    np.testing.assert_allclose(data(lower, "_drift"), factor * WORKED.drift)
    kinds = (simulation.SimulationEventKind.STUCK, simulation.SimulationEventKind.BROKE_AWAY)
    marks = [line.get_xdata()[0] for line in lines(viz.plot_energy(FALL).axes[0], "_event")]
    assert marks == [e.t for e in FALL.events if e.kind in kinds] != []
    assert not lines(viz.plot_energy(FALL, events=False).axes[0], "_event")


def test_torque_parts_add_up_to_the_torque_of_the_model():
    wrench, friction = [0, 0, 9.0, 0, 0, 0], rm.friction.ViscousFriction(np.ones(6))
    figure = viz.plot_torque_parts(RX90, SWING, wrench=wrench, friction=friction)
    t = lines(figure.axes[0], "total")[0].get_xdata()
    q, v, a = SWING.q(t), SWING.v(t), SWING.a(t)
    tau = rm.idm(RX90, q, v, a, wrench=wrench, friction=friction)
    names = ["inertia", "Coriolis and centrifugal", "gravity", "friction", "wrench of the tool"]
    assert legend(figure) == [*names, "total"]
    for axes in figure.axes:
        j = int(axes.get_title(loc="left").removeprefix("joint_").removesuffix(" (N m)")) - 1
        np.testing.assert_allclose(data(axes, "total"), tau[:, j], atol=1e-10)
        parts = np.sum([data(axes, name) for name in names], axis=0)
        np.testing.assert_allclose(parts, tau[:, j], atol=1e-10)
    bare = viz.plot_torque_parts(RX90, SWING, drive=False, joints=[1])
    assert legend(bare) == ["inertia", "Coriolis and centrifugal", "gravity", "total"]
    gravity = rm.gravity_torque(RX90, q)[:, 1]
    np.testing.assert_allclose(data(bare.axes[0], "gravity"), gravity, atol=1e-10)
    worked = viz.plot_torque_parts(RX90, WORKED, joints=[1]).axes[0]
    np.testing.assert_allclose(data(worked, "total"), 5.0)


def test_inertia_over_one_joint():
    grid = simulation.dynamics_map(RX90, 2, samples=9)
    figure = viz.plot_inertia_map(grid)
    gravity, inertia, coupling = figure.axes
    q = np.zeros(6)
    q[2] = grid.ranges[0][3]
    M = rm.mass_matrix(RX90, q)
    for j, name in enumerate(RX90.table.names):
        assert data(gravity, name)[3] == pytest.approx(rm.gravity_torque(RX90, q)[j])
        assert data(inertia, name)[3] == pytest.approx(M[j, j])
    assert gravity.get_lines()[0].get_xdata()[-1] == pytest.approx(180.0)
    pair = data(coupling, "_joint_2 and joint_3")[3]
    assert pair == pytest.approx(M[1, 2] / np.sqrt(M[1, 1] * M[2, 2]))


def test_inertia_over_two_joints():
    grid = simulation.dynamics_map(RX90, (1, 2), samples=(7, 5))
    found = [axes for axes in viz.plot_inertia_map(grid, degrees=False).axes if axes.get_title()]
    expected = (grid.gravity[..., 1], grid.mass[..., 1, 1], grid.coupling[..., 1, 2])
    for axes, values in zip(found, expected, strict=True):
        np.testing.assert_allclose(axes.collections[0].get_array(), values.T, atol=1e-9)
    assert (found[0].get_xlabel(), found[0].get_ylabel()) == ("joint_2 (rad)", "joint_3 (rad)")


def test_plan_and_phase_plane_show_limits_that_exist():
    arm, ends = rm.load("ur5e"), ([0, -1.5, 1, 0, 0, 0], [1, -1, 0.5, 0, 0, 0])
    plan = tr.kinodynamic(arm, *ends, tr.MotionLimits(), seconds=0.1)
    bound = np.array([100.0, np.inf, 90.0, 80.0, 70.0, 60.0])
    position, _, torque = viz.plot_plan(plan, model=arm, torque=bound).axes
    assert position.get_ylabel() == "position (rad)"
    names = [x.get_label() for x in lines(position)]
    assert [x.get_label() for x in lines(torque)][:5] == names[:1] + names[2:]
    at = plan.trajectory.at(lines(torque)[0].get_xdata())
    expected = rm.idm(arm, at.q, at.v, at.a)[:, 2] / 90.0
    np.testing.assert_allclose(data(torque, names[2]), expected)
    for wrong in ([1.0, 2.0], -1.0, np.inf):
        with pytest.raises(RobotModelsError, match="torque: "):
            viz.plot_plan(plan, model=arm, torque=wrong)
    timed = tr.time_optimal(tr.linear([0.0], [1.0], 1.0), tr.MotionLimits(1.0, 2.0))
    figure = viz.plot_phase_plane(timed)
    np.testing.assert_array_equal(data(figure.axes[0], "quickest motion"), timed.rate)
    assert "maximum velocity curve" in legend(figure)


# ---------------------------------------------------------------- mistakes

T3 = np.broadcast_to(np.eye(4), (3, 4, 4))
BATCH = tr.joint_trajectory(np.zeros((2, 3)), np.ones((2, 3)), 5)
MAP_1, MAP_2 = (simulation.dynamics_map(SCARA, joints) for joints in (1, (1, 2)))
MISTAKES = (
    (lambda: viz.plot_trajectory(BATCH), "samples of one motion"),
    (lambda: viz.plot_trajectory(LINE), "trajectory: expected a Trajectory.*got PoseTrajectory"),
    (lambda: viz.plot_trajectory(MOVE, orders=(0, 4)), "orders: .* from 0 to 3, each once"),
    (lambda: viz.plot_trajectory(MOVE, tr.MotionLimits([1.0, 2.0])), "limits of 3 joints"),
    (lambda: viz.plot_trajectory(MOVE, size=(0.0, 1.0)), "size: expected positive inches"),
    (lambda: viz.plot_trajectory(MOVE, units="rad", model=SCARA), "joint 3 is prismatic"),
    (lambda: viz.plot_trajectory(MOVE, units="grad"), "expected one of 'rad', 'deg'"),
    (lambda: viz.plot_trajectory(MOVE, names=["a"]), "names: .* each of the 3 joints, got 1"),
    (lambda: viz.plot_trajectory(MOVE, model=RX90), "got 'rx90' of 6"),
    (lambda: viz.plot_profiles({"a": MOVE}, names=["b"]), "has its own names"),
    (lambda: viz.plot_pose_path(np.eye(4)), r"poses: expected shape \(N, 4, 4\)"),
    (lambda: viz.plot_pose_path(T3, eventful_path()), "path: .* these 3 poses, got 40"),
    (lambda: viz.plot_pose_path(T3, frames=-1), "frames: expected a whole number"),
    (lambda: viz.plot_joint_motion(SCARA, [0.0], {"a": [0.0]}), r"q of 'a': .* shape \(1, 3\)"),
    (lambda: viz.plot_singularities(wrist_map(), SCARA), "model: .* needs 5 joints, got 3"),
    (lambda: viz.plot_inverse_velocities(D[::-1], FOUND), "distance: .* ascend"),
    (lambda: viz.plot_inverse_velocities(D, {"a": (D[1:, None], None)}), r"shapes \(81, n\)"),
    (lambda: viz.plot_inverse_velocities(D, {"a": D}), "IKMSolution or a pair"),
    (lambda: viz.plot_torque_parts(SCARA, SWING), "motion: expected one of 3 joints"),
    (lambda: viz.plot_torque_parts(RX90, FALL, drive=False), "motion: a simulation has its own"),
    (lambda: viz.plot_inertia_map(MAP_2, pair=(1, 1)), "pair:"),
)


@pytest.mark.parametrize(("wrong", "message"), MISTAKES)
def test_mistakes_are_named(wrong, message):
    with pytest.raises(RobotModelsError, match=message) as caught:
        wrong()
    assert isinstance(caught.value, (InvalidValueError, ShapeError))
